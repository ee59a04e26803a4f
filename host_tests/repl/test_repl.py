"""The bench commands of framestep.repl on the host simulation: what they print, move and
refuse."""

import io as text
import json
import re
from itertools import takewhile

import pytest

from framestep import boot, repl
from framestep.protocol import messages as m
from framestep.protocol.declared.payload import layout
from framestep.repl import reasons, tracer
from framestep.repl.figures import live
from framestep.rig import Rig
from framestep_tools import payloads as p
from framestep_tools.client.wire import encode
from framestep_tools.simulator.boards import SimulatedBoard
from host_tests.end_to_end.realtime import MOVE, loaded


@pytest.fixture
def bench(monkeypatch, capsys):
    """Return (a session with an upload, says(command, ...), which gives the printed lines)."""
    session = loaded(estop="no", name="crane", motors=[{"backlash": 3}])
    controller = session.board._board.controller
    monkeypatch.setattr(boot, "hal", controller.hal)
    monkeypatch.setattr(boot, "controller", controller)
    monkeypatch.setattr(boot, "runner", session.board._board)

    def says(command, *arguments):
        capsys.readouterr()
        command(*arguments)
        return capsys.readouterr().out.splitlines()

    return session, says


def test_status(bench):
    session, says = bench
    lines = says(repl.status)
    assert lines[0].startswith("framestep ")
    assert lines[0].endswith(", crane")
    assert lines[1:3] == ["the host is connected", "nothing moves"]
    assert [line.split(":")[0] for line in lines if line.startswith("motor")] == [
        f"motor {i}" for i in range(1, 9)
    ]
    assert any(line.startswith("uploaded: 25 frames, room for ") for line in lines)
    session.leave().run(0.1)
    assert says(repl.status)[1] == "no host is connected"


def test_status_of_drivers(monkeypatch, capsys):
    board = SimulatedBoard({"motors": [{"driver": {"run_ma": 500}}] * 2}, board="skr_pico")
    board.chips[1].powered = False
    monkeypatch.setattr(boot, "hal", board._board.hal)
    monkeypatch.setattr(boot, "controller", board._board.controller)
    monkeypatch.setattr(boot, "runner", board._board)
    board.run_until(600_000_000)
    repl.status()
    lines = capsys.readouterr().out.splitlines()
    assert "driver of motor 1 works" in lines
    assert "driver of motor 2 does not answer (check its power and its address)" in lines
    repl.move(2, 100)
    assert "driver failed" in capsys.readouterr().out


def test_status_through_a_run(bench):
    session, says = bench
    found = []

    def look():
        line = says(repl.status)[2]
        if not found or found[-1] != line.split(" at ")[0]:
            found.append(line.split(" at ")[0])

    session.accept(p.RtRunMove(24000, 1, 25, 500, 500))
    for _ in range(20):
        look()
        session.run(0.05)
    session.accept(p.RtGo())
    while not session.events(p.RtEnd):
        look()
        session.run(0.05)
    session.wait_idle()  # on the end frame again
    look()
    assert found == [
        "the motors move to the start of a run",
        "a run waits for GO",
        "a run is on,",
        "nothing moves",
    ]


def test_move(bench):
    session, says = bench
    assert says(repl.move, 8, 200) == []
    assert "motors move" in says(repl.status)
    session.wait_idle()
    assert session.position(8) == 200
    assert session.made(8) == 200
    assert (
        says(repl.move, 9, 1)
        == says(repl.move, 0, 1)
        == says(repl.move, 1, 2**31)
        == ["refused: there is no such motor or value"]
    )
    session.accept(p.MotorSetLimits(8, 1, -10, 1, 250))
    assert says(repl.move, 8, 251) == ["refused: that is past the upper soft limit"]
    assert says(repl.move, 8, -11) == ["refused: that is past the lower soft limit"]
    session.input("estop", 0).run(0.05)
    assert says(repl.move, 8, 20)[0].startswith("refused: it may not move: E-stop held")
    assert "the E-stop was pressed" in says(repl.status)  # nothing moved
    assert session.position(8) == 200
    session.input("estop", 1).run(0.05)
    assert says(repl.move, 8, 0) == []
    session.run(0.02).input("estop", 0).wait_idle()
    assert "the E-stop was pressed; the motors were ramped down" in says(repl.status)


def test_nothing_of_dragonframes_is_disturbed(bench):
    """From RUN_MOVE to RT_END no command moves a motor, not even one that has no part."""
    session, says = bench
    session.accept(p.RtRunMove(24000, 1, 25, 500, 500)).run(0.01)
    assert says(repl.move, 8, 200) == ["refused: the motors move to the start of a run"]
    session.wait_idle()
    assert says(repl.move, 1, 200) == ["refused: a run waits for GO"]
    assert says(repl.why) == ["refused: a command of the REPL, as a run waits for GO"]
    session.accept(p.RtGo()).run(0.3)
    assert says(repl.move, 8, 200)[0].startswith("refused: a run is on, at frame ")
    for command in (repl.status, repl.io, repl.timing, repl.rig):
        assert says(command)
    session.until(p.RtEnd, 10).run(0.1)
    assert session.made(8) == 0
    assert says(repl.move, 8, 200) == []


def test_stop(bench):
    session, says = bench
    says(repl.move, 1, 50_000)
    session.run(0.3)
    says(repl.stop)
    session.wait_idle()
    assert 0 < session.position(1) < 10_000


def test_after_a_run_while_motors_set_out_for_its_end_frame(bench):
    """Nothing else is moved before all have set out. A stop keeps those that have not where they
    are, without another RT_END."""
    session, says = bench
    session.accept(p.RtRunMove(24000, 1, 25, 500, 500)).wait_idle()
    session.accept(p.RtGo())
    while not session.events(p.RtEnd):
        session.run(0.001)
    assert says(repl.move, 8, 200) == ["refused: a run comes to rest"]
    says(repl.stop)
    session.wait_idle()
    assert session.position(1) > MOVE[1][-1]
    assert session.position(2) > MOVE[2][-1]
    assert len(session.events(p.RtEnd)) == 1
    assert says(repl.move, 1, 200) == []
    session.wait_idle()
    assert session.position(1) == 200
    assert session.position(2) > MOVE[2][-1]


def test_jog(bench, monkeypatch):
    """Keys are held and released, and choose motors; the motor stops by itself."""
    session, says = bench

    class Keys(text.StringIO):
        def read(self, size=-1):
            session.run(0.1)
            return super().read(size)

    monkeypatch.setattr("sys.stdin", Keys("++++2--q"))
    lines = says(repl.jog, 1, 2000)
    assert lines[1:] == ["motor 2"]
    session.wait_idle()
    assert session.position(1) > 0 > session.position(2)
    monkeypatch.setattr("sys.stdin", Keys("+q"))
    assert says(repl.jog, 1, 10001)[1:] == ["refused: there is no such motor or value"]


def test_io(bench):
    session, says = bench
    assert says(repl.io)[:2] == ["output 1, pin 22: off", "output 2, pin 26: off"]
    assert says(repl.io, 2, True) == []
    lines = says(repl.io)
    assert lines[:2] == ["output 1, pin 22: off", "output 2, pin 26: on"]
    assert session.trace().signals["gio2"][1].tolist() == [1]
    says(repl.io, 2, False)
    assert session.trace().signals["gio2"][1].tolist() == [1, 0]
    assert says(repl.io, 5, True) == ["refused: there is no such motor or value"]
    assert "E-stop, pin 19: free" in lines
    assert "lights: 0 of 512 channels are on" in lines
    session.input("estop", 0).run(0.05)
    assert "E-stop, pin 19: held" in says(repl.io)


def test_timing(bench):
    session, says = bench
    assert len(says(repl.timing)) == 1
    session.accept(p.RtPositionFrame(25))
    lines = [line for line in says(repl.timing) if line.startswith("motor ")]
    assert [line.split(":")[0] for line in lines] == [f"motor {i}" for i in MOVE]
    assert all(0 < int(line.split()[2]) <= 16 for line in lines)


def test_live_figures_are_a_list_that_a_program_reads(bench):
    session, says = bench
    (line,) = says(live)
    assert json.loads(line)[4:6] == [16, []]
    session.accept(p.RtPositionFrame(25))
    (line,) = says(live)
    *_, limit, holds, queues, ms, interrupt_us, passes_us = json.loads(line)
    assert ms > 0
    assert interrupt_us == passes_us == 0, "nothing is measured here"
    assert limit > 1000
    assert [motor for motor, _ in queues] == list(MOVE)
    assert all(0 < waiting <= holds for _, waiting in queues)


def test_rig_shows_what_differs_from_the_defaults(bench, monkeypatch):
    _, says = bench
    lines = says(repl.rig)
    assert lines[0] == "estop = no"
    assert "name = crane" in lines
    assert [line for line in lines if "motors" in line] == ["motors[1].backlash = 3"]
    assert "outputs[1].pin = 22" in lines
    assert not any("jog_timeout_ms" in line for line in lines)
    assert lines[-1] == "all else is at its default"
    monkeypatch.setattr(boot.controller, "rig", Rig({}))
    assert says(repl.rig) == ["all else is at its default"]


def test_help_has_a_line_for_each_command(bench):
    _, says = bench
    lines = says(repl.help)
    shown = [line.partition("(")[0] for line in lines]
    assert sorted(shown) == sorted(re.findall(r"(\w+)\(", repl._COMMANDS))
    assert all(callable(getattr(repl, name)) for name in shown)
    assert max(map(len, lines)) < 100
    assert any("str" in line for line in says(repl.help, str)), "of Python"


def test_why_a_request_was_refused(bench):
    session, says = bench
    assert says(repl.why) == ["nothing was refused, and nothing has stopped the motors"]
    session.accept(p.MotorSetLimits(8, 1, -10, 1, 250))
    session.refuse(p.Ack.ERR_SOFT_UP, p.MotorMove(8, 251))
    assert says(repl.why) == ["refused: MOTOR_MOVE, as that is past the upper soft limit"]
    session.refuse(p.Ack.ERR_RANGE, p.MotorStop(9))
    session.accept(p.MotorMove(8, 20)).wait_idle()
    assert says(repl.why) == ["refused: MOTOR_STOP, as there is no such motor or value"]
    says(repl.move, 8, -11)
    assert says(repl.why) == [
        "refused: a command of the REPL, as that is past the lower soft limit"
    ]
    session.refuse(p.Ack.ERR_RANGE, p.RtRunMove(200_000, 1, 25, 0, 0))
    first, second = says(repl.why)
    assert first.startswith("refused: RT_RUN_MOVE, as ")
    assert second.startswith("the last move exceeds, at frame ")


def test_why_the_motors_were_stopped(bench, monkeypatch):
    session, says = bench
    session.accept(p.MotorMove(8, 20_000)).run(0.1).input("estop", 0).wait_idle()
    assert says(repl.why) == [
        "the E-stop is held",
        "the E-stop was pressed; the motors were ramped down",
    ]
    monkeypatch.setattr(boot, "mistake", "ports: found 3")
    assert says(repl.why)[0] == "ports: found 3"


def test_watch(bench, monkeypatch, capsys):
    session, _ = bench
    session.accept(p.MotorMove(2, 300))
    looks = iter([False, False, True])

    def key(ms):
        session.run(ms / 1000)
        return next(looks)

    monkeypatch.setattr(reasons, "_key", key)
    capsys.readouterr()
    repl.watch()
    shown = capsys.readouterr().out.split("\r")
    assert shown[0] == "any key ends\n"
    positions = [re.findall(r"(\d): (-?\d+)", line) for line in shown[1:]]
    assert [[motor for motor, _ in line] for line in positions] == [list("12345678")] * 3
    assert 0 == int(positions[0][1][1]) < int(positions[1][1][1]) <= 300
    assert shown[-1].endswith("\n")


def traced(lines):
    """Return [(direction, text)] of lines of trace(), after a look at their times."""
    found = [re.fullmatch(r" *(\d+\.\d{3}) ([<>]) (.+)", line) for line in lines]
    times = [float(line[1]) for line in found]
    assert times == sorted(times)
    return [(line[2], line[3]) for line in found]


@pytest.fixture
def tracing(bench):
    """As bench, with trace() on; it is off again afterwards."""
    session, says = bench
    begun = says(repl.trace)
    assert begun == [
        "tracing begins now: trace() prints the last requests and answers, trace(0) ends it"
    ]
    yield session, says
    repl.trace(0)
    assert tracer.active is None


def test_trace(tracing):
    session, says = tracing
    session.accept(p.MotorSetLimits(8, 1, -10, 1, 250))
    session.refuse(p.Ack.ERR_SOFT_UP, p.MotorMove(8, 251))
    session.accept(p.MotorMove(8, -5)).wait_idle()
    session.ask(p.GetLoad())
    lines = traced(says(repl.trace))
    assert lines[:6] == [
        (">", "MOTOR_SET_LIMITS 8, 1, -10, 1, 250, 0"),
        ("<", "MOTOR_SET_LIMITS: ok"),
        (">", "MOTOR_MOVE 8, 251"),
        ("<", "MOTOR_MOVE: refused, as that is past the upper soft limit"),
        (">", "MOTOR_MOVE 8, -5"),
        ("<", "MOTOR_MOVE 1"),  # it moves
    ]
    # questions for status and positions, and reports of positions, are left out
    assert lines[6] == (">", "LOAD")
    assert lines[7][1].startswith("LOAD ")
    assert len(lines) == 8
    assert traced(says(repl.trace, 3)) == lines[-3:]


def test_trace_shows_what_is_else_carried_out_at_once(tracing):
    """A question, a section of a move, and a GO."""
    session, says = tracing
    board = session.board._board

    def send(request):
        board.receive(encode(request.TYPE, request.pack(), 7))
        board.hal.port.ask()

    def seen():
        session.run(0.1)
        return [text.split(" ")[0].rstrip(":") for _, text in traced(says(repl.trace))]

    send(p.Hi())
    assert seen() == ["HI", "HI"]
    session.accept(p.RtUploadMoveBegin(1, 5))
    send(p.RtUploadMoveAxis(1, p.LAST_SECTION, range(5)))
    assert seen()[-2:] == ["RT_UPLOAD_MOVE_AXIS"] * 2
    session.accept(p.RtUploadMoveEnd(), p.RtRunMove(24_000, 1, 5)).wait_idle().run(0.3)
    send(p.RtGo())
    assert seen()[-2:] == ["RT_GO"] * 2
    repl.trace(0)
    session.wait_idle()
    send(p.Hi())
    assert board.pending == 0


def test_trace_shows_what_is_sent_unasked_and_the_length_of_uploads(tracing):
    session, says = tracing
    session.accept(p.RtUploadMoveBegin(1, 5), p.RtUploadMoveAxis(1, 0, range(5)))
    session.accept(p.MotorMove(8, 20_000)).run(0.1).input("estop", 0).wait_idle()
    lines = traced(says(repl.trace))
    assert lines[2] == (">", "RT_UPLOAD_MOVE_AXIS 1, 0, and 20 bytes")
    assert lines[-1] == ("<", "MOTOR_HARD_STOP 0")


def test_trace_keeps_the_last_frames(tracing):
    session, says = tracing
    for step in range(50):
        session.accept(p.MotorResetPosition(1, step))
    lines = traced(says(repl.trace, 99))
    assert lines[::2] == [
        (">", f"MOTOR_RESET_POSITION 1, {step}") for step in range(50 - tracer.ENTRIES // 2, 50)
    ]
    assert len(traced(says(repl.trace))) == 20


def test_trace_is_off_after_0_and_begins_afresh(bench):
    session, says = bench
    controller = session.board._board.controller
    says(repl.trace)
    session.accept(p.MotorResetPosition(1, 3))
    assert says(repl.trace, 0) == []
    assert not {"poll", "end", "ack"} & (vars(controller.reader) | vars(controller.writer)).keys()
    says(repl.trace)
    assert says(repl.trace) == []
    says(repl.trace, 0)


def test_messages_are_those_declared():
    """Each message of a host or of the device has its name and the fields of a request."""
    declared = {number: name for name, number in vars(m).items() if name.startswith("MSG_")}
    del declared[m.MSG_FLAG_ACK]
    for number, name in declared.items():
        codes = [code for _, code, _ in layout(p.REQUESTS[number])]
        single = "".join(takewhile(lambda code: isinstance(code, str) and code[0] != "*", codes))
        assert list(reasons.message(number)) == [name.removeprefix("MSG_"), single]
    assert reasons.MESSAGES.count(",") == len(declared)


def test_without_a_controller(bench, monkeypatch):
    _, says = bench
    monkeypatch.setattr(boot.runner, "alive", False)
    assert says(repl.move, 1, 5) == ["refused: framestep has been stopped"]
    monkeypatch.setattr(boot.runner, "failure", ValueError())
    assert says(repl.status)[2] == "framestep was stopped by a fault in the firmware"
    monkeypatch.setattr(boot, "controller", None)
    for command in (
        repl.status, repl.why, repl.watch, repl.trace, repl.io, repl.timing, repl.rig, repl.stop,
    ):  # fmt: skip
        assert says(command) == ["framestep has not been started"]
    assert says(live) == ["framestep has not been started"]
    assert says(repl.move, 1, 5) == ["refused: framestep has not been started"]
