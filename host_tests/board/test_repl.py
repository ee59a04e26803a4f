"""The operator's side on the emulated board: bench commands during a run, LED, faults in words, how
to prevent the start."""

import pytest

from framestep_emulator import Emulator
from framestep_tools.building import images
from framestep_tools.payloads import HardStop, Hi, MotorMove, RtEnd, RtGo
from framestep_tools.simulator.boards import EmulatedBoard
from host_tests.board.test_end_to_end import assert_played, load, move
from host_tests.end_to_end.io.test_led import FAULT
from host_tests.end_to_end.session import Session

LED, JUMPER = 25, 27

BEAT_NS = 128_000_000  # of the LED; beats count from power-on


@pytest.fixture(scope="module")
def session():
    with EmulatedBoard() as board:
        yield Session(board, reply_s=0.1)


def led(board, levels=16):
    """Return the LED's levels in this many beats, in the middle of each; the first may be any."""
    shown = ""
    now = board.emulator.ns // BEAT_NS * BEAT_NS + BEAT_NS // 2
    for beat in range(1, levels + 1):
        board.run_until(now + beat * BEAT_NS)
        shown += "*" if board.emulator.pin(LED) else "."
    return shown


def shows(pattern, shown):
    """Whether the LED showed a piece of that pattern, repeated."""
    return shown in 3 * pattern


def test_tracing_beside_a_run(session):
    """It moves no edge, and takes little memory."""
    repl = session.board.emulator.repl()
    repl.exec("import framestep.repl, gc")
    before = repl.eval("(gc.collect(), gc.mem_free())[1]")
    assert "tracing begins now" in repl.exec("trace()")
    assert 0 < before - repl.eval("(gc.collect(), gc.mem_free())[1]") < 3000, "bytes"
    positions = move(session, frames=40)
    stands = load(session, positions)
    session.accept(RtGo())
    assert session.client.wait_event(RtEnd, 10)
    session.run(0.1)
    assert_played(session, stands, positions)
    lines = [line.split(maxsplit=1)[1] for line in repl.exec("trace()").splitlines()]
    assert lines[-3:] == ["> RT_GO", "< RT_GO: ok", "< RT_END"]
    assert any(line.startswith("> RT_RUN_MOVE 24000, 1, 40, 300, 300, ") for line in lines)
    assert repl.exec("trace(0)") == ""
    assert abs(before - repl.eval("(gc.collect(), gc.mem_free())[1]")) < 500, "bytes"


CTRL_C = """
struck = 0
while struck < {count}:
    try:
        while True:
            pass
    except KeyboardInterrupt:
        struck += 1
"""


def test_ctrl_c_beside_a_run(session):
    """It always ends a program on the REPL, also if it comes during a pass, where the USB task runs
    because a question has two packets to its answer. It moves no edge."""
    positions = move(session, frames=60)
    stands = load(session, positions)
    session.accept(RtGo())
    repl = session.board.emulator.repl()
    client = session.client
    count = 60
    repl.start(CTRL_C.format(count=count))
    session.run(0.08)
    for i in range(count):
        session.run(0.02 + i / 7000)
        asked = client.send(Hi())
        session.run(i / 50_000)
        repl.serial.write(b"\x03")
        assert client.answer_to(asked)
    session.run(0.05)
    assert repl.finish(1) == ""
    assert session.client.wait_event(RtEnd, 10)
    session.run(0.1)
    assert_played(session, stands, positions)


def test_jog_by_keys(session):
    """At the prompt, as for a person."""
    board = session.board
    repl = board.emulator.repl()
    serial = repl.serial
    repl.exec("import framestep.repl")
    repl.leave()
    session.forget()
    serial.write(b"jog(7, 5000)\r")
    session.run(0.1)
    for _ in range(4):
        serial.write(b"+")
        session.run(0.15)
    serial.write(b"q")
    session.wait_idle()
    assert session.made(7) == session.position(7) > 500
    serial.timeout = 0.05
    serial.write(b"1+1\r")
    session.run(0.1)
    assert serial.read(5000).endswith(b"2\r\n>>> ")


def test_faults_in_words(session):
    """The REPL shows what stopped the motors, and so does the LED; then an exception, with its
    traceback."""
    board = session.board
    repl = board.emulator.repl()
    repl.exec("import time, framestep.boot as b")
    # more lines than are kept until the REPL can show them
    repl.exec(
        "b.runner.task = lambda: [b.hal.report_driver(1, 'does %d' % i) for i in range(20)]\n"
        "time.sleep_ms(100)"
    )
    text = repl.unasked()
    lines = [f"framestep: driver of motor 1 does {i}" for i in range(4, 20)]
    assert text.splitlines() == ["framestep: drivers: 4 earlier lines are lost", *lines]
    repl.exec("import framestep.repl; move(1, 40000)")
    session.run(0.3)
    # this writes a file, which blocks interrupts
    assert repl.exec("with open('/x', 'w') as f: f.write('x' * 600)\ntime.sleep_ms(800)") == ""
    late = (
        "framestep: the interrupt came too late, so pulses broke off; the motors were ramped down"
    )
    assert late in repl.unasked()
    assert "motor 1" in repl.exec("status()")
    assert not session.moving
    assert shows(FAULT, led(board))
    assert {message for _, message in session.events(HardStop)} == {HardStop(100)}
    session.forget()
    assert repl.exec("b.controller.moves.poll = None\ntime.sleep_ms(200)") == ""
    text = repl.unasked(300)
    assert "framestep: stopped by a fault in the firmware; a reset starts it again" in text
    assert 'File "framestep/controller.py", line' in text
    assert "TypeError" in text
    assert shows(FAULT, led(board)), "although nothing looks after it any more"
    session.run(0.05)
    assert [message for _, message in session.events(HardStop)] == [HardStop(100)]
    assert repl.eval("6 * 7") == 42
    assert (
        repl.exec("import framestep.repl; status()")
        .splitlines()[2]
        .startswith("framestep was stopped by a fault")
    )


ESTOP = 19
# A program that prints for a while
COPY = "import sys\nfor i in range(40):\n print(i)\n time.sleep_ms(20)"


def test_nothing_unasked_in_the_raw_repl():
    """It would get between the bytes that a tool reads, and break its transfer. It is printed once
    the prompt is back, and says that motors were ramped down only if some moved."""
    with EmulatedBoard({"estop": "nc"}, trace=False) as board:
        board.wire_switches()
        session = Session(board, reply_s=0.1)
        emulator = board.emulator
        repl = emulator.repl()
        repl.exec("import time, framestep.boot as b")
        for text, moves in (("", False), ("; the motors were ramped down", True), ("", False)):
            if moves:
                session.accept(MotorMove(1, 10_000))
            repl.start(COPY)
            emulator.advance(200)
            emulator.set_pin(ESTOP, 1)
            emulator.advance(200)
            emulator.set_pin(ESTOP, 0)
            assert repl.finish(5).split() == [str(i) for i in range(40)]
            session.wait_idle()
            assert repl.unasked() == f"framestep: the E-stop was pressed{text}\n"
        # raw paste, as mpremote and Thonny use it
        repl.enter()
        repl.serial.write(b"\x05A\x01")
        repl.expect(b"R\x01")
        window = int.from_bytes(repl.serial.read(2), "little")
        emulator.set_pin(ESTOP, 1)
        emulator.advance(100)
        emulator.set_pin(ESTOP, 0)
        repl.serial.write(b"print('pasted')"[:window] + b"\x04")
        said = repl.expect(b"\x04>")
        assert said.strip(b"\x01") == b"\x04pasted\r\n\x04\x04>"
        assert repl.unasked() == "framestep: the E-stop was pressed\n"


def test_bootsel_and_jumper_keep_it_from_starting():
    with Emulator(images.frozen("skr_pico")) as emulator:

        def found():
            """Return what exists of framestep after main.py."""
            boot = "__import__('framestep.boot').boot"
            return emulator.repl().eval(
                f"({boot}.hal is not None, {boot}.hal is not None and {boot}.runner.alive)"
            )

        emulator.press_bootsel()
        emulator.reset()
        assert found() == (False, False)
        emulator.press_bootsel(False)
        emulator.set_pin(JUMPER, 0)
        emulator.reset()
        assert found() == (False, False)
        # Pressed before power-up, BOOTSEL starts the chip's own loader, so a person presses it
        # later
        emulator.set_pin(JUMPER, None)
        emulator.reset()
        emulator.advance(700)
        emulator.press_bootsel()
        emulator.advance(2000)
        assert found() == (True, False)
