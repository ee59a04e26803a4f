"""The firmware on the simulated ESP32, from the bytes on its UART to the edges behind the shift
registers. Time is virtual, and a pass takes half a millisecond."""

import numpy as np
import pytest

from framestep.motors.positions import BROKEN_OFF, HELD, LOST, RESTORED
from framestep.rig import Rig, RigError
from framestep_tools import payloads as p
from framestep_tools.bench.esp32_memory import fits, memory
from framestep_tools.board.rig_file import read
from framestep_tools.building.board_files import ROOT, board_data, files_boards
from framestep_tools.client.wire import FrameDecoder, encode
from framestep_tools.judge.judge import frame_times_ns
from framestep_tools.simulator.esp32_board import BOARD, Esp32Board
from host_tests.end_to_end.runs.moves import FRAMES, MOVE, assert_played
from host_tests.end_to_end.session import Session, deceleration, run_request
from host_tests.selection import sweep

QUEUE_S = 0.028  # from the tick to its pulses, at most: 24 buffers and two ticks
REPLY_S = 0.06


@pytest.fixture
def board(request):
    """Return board(rig, baud): a session; all sessions end with the test."""
    made = []

    def make(rig=None, baud=115200):
        made.append(Esp32Board(rig, baud=baud))
        made[-1].wire_switches()
        return Session(made[-1], reply_s=REPLY_S)

    yield make
    for each in made:
        each.close()


@pytest.fixture
def rig(board):
    session = board()
    for motor in range(1, 9):
        session.speed(motor, 20000, 100_000)
    return session


@pytest.mark.parametrize("name", sweep(files_boards(), "esp32_595"))
def test_each_board_with_its_example(name):
    """Its motors move, its drivers are on meanwhile, and its E-stop is where its data says.

    The simulated chip is a first-generation ESP32, which has the pins that the S3 uses.
    """
    rig = read(ROOT / "boards" / name / "rig.json")
    count = rig["motor_count"]
    with Esp32Board(rig, name) as board:
        session = Session(board, motors=count, reply_s=REPLY_S)
        board.wire_switches()
        session.run(0.1)
        for motor in range(1, count + 1):
            session.speed(motor, 20000, 100_000).accept(p.MotorMove(motor, 100 * motor))
        session.wait_idle()
        assert [session.made(motor) for motor in range(1, count + 1)] == [
            100 * motor for motor in range(1, count + 1)
        ]
        board.set_pin(board_data(name)["estop"], 1)
        session.run(0.1)
        assert session.code(p.MotorMove(1, 0)) != p.Ack.OK
        levels = session.trace().signals
        lines = [line for line in levels if line.startswith("enable")]
        assert len(lines) == (count if isinstance(board_data(name)["enable"], list) else 1)
        assert all({0, 1} <= set(map(int, levels[line][1])) for line in lines)


def test_memory():
    """If there is too little, sentences say so and name the settings that help; these do help."""
    assert fits({}, 270)
    with Esp32Board(heap_kb=232) as board:
        board.run_until(board.now_ns + 300_000_000)
        said = board.transmit().decode()
    assert "framestep: set a smaller motor_count or virtuals in rig.json" in said
    assert "framestep: this module has too little memory: take one with PSRAM" in said
    assert said.endswith(">>> ")
    assert fits({"virtuals": 0}, 232)
    assert not fits({"virtuals": 0}, 200)
    assert fits({"virtuals": 0, "motor_count": 1}, 210)


def test_the_memory_that_is_measured():
    """A move gets what the rest leaves, but for a little."""
    heap_kb = 512
    plain, small = memory({}, heap_kb), memory({"virtuals": 0}, heap_kb)
    assert 0.94 * heap_kb * 1024 < plain.heap_bytes + plain.move_bytes < heap_kb * 1024
    assert small.heap_bytes < plain.heap_bytes - 30_000
    assert small.code_bytes < plain.code_bytes
    assert small.frames > plain.frames > 10_000


@pytest.mark.parametrize("length", [1, 14, 21])
def test_it_starts_with_any_memory(board, length):
    """A word that looks like the address of a block kept this block, and there was no memory left
    for the upload; it depended on the length of a text in the rig file."""
    assert (
        board({"motors": [{"pulse_us": 1.0}] * 8, "name": "x" * length}).ask(p.Hi()).upload_frames
    )


def test_who_it_is(board):
    info = board({"name": "jib"}).ask(p.Hi())
    assert (info.name, info.motors, info.dmx_channels) == ("jib", 8, 512)
    assert (info.outputs, info.inputs) == (4, 4)
    assert board({"dmx": False}).ask(p.Hi()).dmx_channels == 0


@pytest.mark.parametrize("fps", sweep([23.976, 24, 60], 23.976, 60))
def test_a_run(rig, fps):
    """At each frame's time each motor is on its uploaded position, and the frame is reported."""
    rig.upload(MOVE)
    before = rig.play(run_request(fps, 1, FRAMES, 700, 300))
    verdict = assert_played(rig, before, MOVE, fps)
    times = (verdict.origin_ns + frame_times_ns(FRAMES, round(fps * 1000))) * 1e-9
    reported = {}
    for time, message in rig.events(p.Positions):
        reported.setdefault(message.move_time, time)
    late = [reported[1000 * (i + 1)] - times[i] for i in range(1, FRAMES)]
    assert min(late) >= 0
    assert max(late) <= 0.01


def test_a_run_with_pauses_of_the_main_loop(rig):
    """20 ms lose nothing."""
    rig.upload(MOVE)
    rig.ready(run_request(24, 1, FRAMES, 700, 300))
    before = rig.positions
    rig.forget().accept(p.RtGo())
    for _ in range(20):
        rig.board.pause(20)
        rig.run(0.08)
    rig.run(1)
    assert len(rig.events(p.RtEnd)) == 1
    assert_played(rig, before, MOVE, 24)
    assert not rig.events(p.HardStop)


def test_a_pause_that_is_too_long(rig):
    """The motor ramps down, the host hears of it, the position is lost; each step was made once."""
    rig.accept(p.MotorResetPosition(1, 0), p.MotorMove(1, 30_000)).run(0.4)
    rig.board.pause(60)
    rig.run(0.6)
    assert rig.moving == []
    assert rig.events(p.HardStop)
    assert rig.made(1) == rig.position(1) < 30_000
    trust = rig.ask(p.GetCondition()).positions
    assert (trust[0].state, trust[0].reason) == (0, 1)
    rig.accept(p.MotorMove(1, 0)).wait_idle()
    assert rig.made(1) == 0


@pytest.mark.parametrize("stops, factor", [(1, 1), (2, 4)])
def test_a_stop_takes_the_queue_and_the_ramp(rig, stops, factor):
    rig.accept(p.MotorMove(1, 30_000)).run(0.5)
    rig.accept(*[p.MotorStopAll()] * stops)
    asked = rig.now
    rig.wait_idle()
    times, ways = rig.steps(1)
    pace = np.diff(times)
    slower = times[1:][(pace > 57e-6) & (times[1:] > asked)][0]
    assert slower - asked < QUEUE_S + 0.03 / factor + 0.004
    assert deceleration(times, ways, slower) == pytest.approx(100_000 * factor, rel=0.15)
    assert ways.sum() == rig.position(1)


def test_the_e_stop(board):
    """All pulses end at once, the drivers are off as soon as the chain gets that, the host hears of
    it, and positions are lost. After the release all continues."""
    session = board({"estop": "nc"})
    session.run(0.1)
    session.speed(1, 20000, 100_000).accept(p.MotorResetPosition(1, 0), p.MotorMove(1, 30_000))
    session.run(0.4)
    session.board.set_pin(32, 1)
    struck = session.now
    session.run(0.4)
    times, _ = session.steps(1)
    assert times[-1] < struck + 0.002
    enable = session.trace().signals["enable"]
    assert enable[1][-1] == 1
    assert enable[0][-1] * 1e-9 < struck + 0.03
    assert session.events(p.HardStop)
    assert session.ask(p.GetCondition()).positions[0].state == 0
    assert session.code(p.MotorMove(1, 0)) != p.Ack.OK
    session.board.set_pin(32, 0)
    session.run(0.1).forget().accept(p.MotorResetPosition(1, 500), p.MotorMove(1, 1500)).wait_idle()
    assert session.made(1) == 1000
    assert session.position(1) == 1500


def test_a_spike_is_no_e_stop(board):
    session = board({"estop": "nc"})
    session.run(0.1).forget()  # the input counts as active until its wire is there
    session.speed(1, 20000, 100_000).accept(p.MotorMove(1, 6000)).run(0.2)
    session.board.set_pin(32, 1)
    session.board.set_pin(32, 0)
    session.wait_idle()
    assert session.made(1) == session.position(1) == 6000
    assert not session.events(p.HardStop)


def test_an_e_stop_that_bounces_and_comes_again(board):
    """Whatever happens during the recovery, pulses come only after it."""
    session = board({"estop": "nc"})
    session.run(0.1)
    session.speed(1, 20000, 100_000).accept(p.MotorResetPosition(1, 0), p.MotorMove(1, 30_000))
    session.run(0.4)
    struck = session.now
    for held, released in [(0.0005, 0.0005), (0.003, 0.02), (0.03, 0.001), (0.2, 0.1)]:
        session.board.set_pin(32, 1)
        session.run(held)
        session.board.set_pin(32, 0)
        session.run(released)
    times, _ = session.steps(1)
    assert times[-1] < struck + 0.002
    session.accept(p.MotorResetPosition(1, 0), p.MotorMove(1, 1000)).forget().wait_idle()
    assert session.made(1) == 1000


def test_the_e_stop_is_held_when_it_starts(board):
    session = board({"estop": "nc"})
    session.board.set_pin(32, 1)
    session.run(0.2)
    assert session.code(p.MotorMove(1, 100)) != p.Ack.OK
    session.board.set_pin(32, 0)
    session.run(0.1).accept(p.MotorMove(1, 100)).wait_idle()
    assert session.made(1) == 100


def test_remembered_positions(board):
    """They survive a power cut at rest. In motion it loses them, and flash is not written."""
    session = board({"remember_positions": True})
    session.speed(1, 20000, 100_000).accept(p.MotorResetPosition(1, 100), p.MotorMove(1, 5100))
    session.wait_idle().run(2.5)  # STILL_MS, and the time to write
    session.board.power_off()
    session.board.power_on()
    again = Session(session.board, reply_s=REPLY_S)
    assert again.position(1) == 5100
    trust = again.ask(p.GetCondition()).positions[0]
    assert (trust.state, trust.reason) == (HELD, RESTORED)
    again.speed(1, 20000, 100_000).accept(p.MotorMove(1, 0)).run(0.15)
    again.board.power_off()
    again.board.power_on()
    last = Session(again.board, reply_s=REPLY_S)
    trust = last.ask(p.GetCondition()).positions[0]
    assert (trust.state, trust.reason) == (LOST, BROKEN_OFF)


def test_the_byte_of_ctrl_c_in_a_frame_is_data(rig):
    rig.accept(p.MotorMove(3, 3), p.MotorMove(3, 0x0303)).wait_idle()
    assert rig.made(3) == 0x0303


def test_ctrl_c_lands_the_motors(rig):
    """Whatever ends the firmware first brings the motors to rest; then the REPL has the port."""
    rig.accept(p.MotorMove(1, 30_000)).run(0.4)
    rig.board.receive(b"\r\x03")
    rig.board.run_until(rig.board.now_ns + 1_000_000_000)
    said = rig.board.transmit().decode(errors="replace")
    assert "KeyboardInterrupt" in said
    assert said.endswith(">>> ")
    times, _ = rig.steps(1)
    pace = np.diff(times)
    assert pace[-1] > 5 * pace.min(), "a ramp"


def test_the_commands_of_the_repl():
    """There is memory for all of them. Ctrl-C has ended framestep, so motors stay where they
    are."""
    stopped = "framestep has been stopped"
    with Esp32Board(read(ROOT / "boards" / BOARD / "rig.json"), BOARD) as board:

        def typed(line):
            board.receive(f"{line}\r\n".encode())
            board.run_until(board.now_ns + 1_000_000_000)
            return board.transmit().decode(errors="replace")

        assert typed("\x03").endswith(">>> ")
        assert "status() why()" in typed("import framestep.repl")
        for command, expected in {
            "status()": [stopped, "\r\nmotor 1: 0, "],
            "timing()": [stopped],
            "rig()": ["slider, pan and tilt", "motor_count"],
            "io()": [stopped],
            "move(1, 200)": [f"refused: {stopped}"],
            "home(1)": [f"refused: {stopped}"],
            "stop()": [stopped],
            "why()": [stopped],
            "help()": ["positions, until a key is pressed"],
        }.items():
            said = typed(command)
            assert "Error" not in said, command
            assert "more memory" not in said, command
            assert all(text in said for text in expected), said
            assert said.endswith(">>> "), command


def test_reading_the_upload_port_takes_no_step(rig):
    """An upload while a motor moves: 115 200 baud, without a lost byte or a late edge."""
    rig.accept(p.MotorMove(5, 20_000))
    rig.client.upload_move(1, 200, {1: list(range(0, 2000, 10)), 2: [7] * 200})
    rig.wait_idle()
    assert rig.made(5) == 20_000
    pace = np.diff(rig.steps(5)[0])
    steady = pace[len(pace) // 3 : len(pace) // 2]
    assert steady.max() - steady.min() < 9e-6


@pytest.mark.parametrize("baud", sweep([230400, 460800, 921600], 921600))
def test_a_higher_rate(board, baud):
    """An upload while a motor moves, with pauses of the main loop: no byte is lost."""
    session = board({"uart_baud": baud}, baud)
    session.speed(5, 20000, 100_000).accept(p.MotorMove(5, 20_000))
    began = session.now
    for first in (1, 101):
        session.board.pause(200 / baud * 10_000)  # MicroPython's ring holds 260 bytes
        frames = {motor: list(range(0, 1000 * motor, 10 * motor)) for motor in range(1, 9)}
        session.client.upload_move(first, first + 99, frames)
    assert session.now - began < 6400 / baud * 10 + 0.2
    session.wait_idle()
    assert session.made(5) == 20_000
    assert session.ask(p.Hi()).motors == 8


@pytest.mark.parametrize("baud", [115200, 460800])
def test_many_requests_at_once(board, baud):
    """Each is answered: sending does not keep the board from receiving."""
    session = board({"uart_baud": baud}, baud)
    session.port.write(b"".join(encode(p.MotorStatus.TYPE, b"", 100 + i) for i in range(80)))
    session.board.run_until(session.board.now_ns + 400_000_000)
    session.port.timeout = 0
    answers = [frame.id for frame in FrameDecoder().feed(session.port.read(100_000))]
    assert answers == [100 + i for i in range(80)]


def test_the_rate_stays_after_ctrl_c_and_a_soft_reset(board):
    there = board({"uart_baud": 460800}, 460800).board

    def said(data):
        there.receive(data)
        there.run_until(there.now_ns + 500_000_000)
        return there.transmit()

    assert said(b"\r\x03").endswith(b">>> ")
    assert said(b"import os\r\nos.remove('/rig.json')\r\n").endswith(b">>> ")
    assert b"soft reboot" in said(b"\x04")  # and the file is gone, so the rate is the usual one
    there.baud = 115200
    assert b"framestep" in said(encode(p.Hi.TYPE, b"", 1))


def test_at_another_rate_nothing_gets_across():
    with Esp32Board({"uart_baud": 460800}) as there:
        there.run_until(there.now_ns + 200_000_000)
        there.transmit()
        there.receive(encode(p.Hi.TYPE, b"", 1))
        there.run_until(there.now_ns + 200_000_000)
        assert not there.transmit()


@pytest.mark.parametrize(
    "found, wanted",
    [
        ({"outputs": [{"pin": 22}]}, r"outputs\[1\].pin: found 22, allowed is a pin from 64 to 93"),
        ({"inputs": [{"pin": 70}]}, r"inputs\[1\].pin: found 70"),
        ({"limits": [{"high": 45}]}, r"limits\[1\].high: found 45, allowed is a pin from 0 to 39"),
        ({"inputs": [{"pin": 18}]}, r"found 18, which is the board's shift registers' sck already"),
        ({"inputs": [{"pin": 3}]}, r"found 3, which is the board's uart 2 already"),
        ({"motors": [{"servo": {}}]}, r"motors\[1\].servo.pin: found -1, expected is a pin of"),
        ({"motors": [{"servo": {"pin": 70}}]}, r"motors\[1\].servo.pin: found 70, allowed is"),
        ({"motors": [{"servo": {"pin": 18}}]},
         "found 18, which is the board's shift registers' sck"),
        ({"motors": [{"servo": {"pin": pin, "rate_hz": 40 + pin}} for pin in (12, 13, 14, 15, 19)]},
         "found 19|rate_hz: found 5 different ones"),
        ({"ports": 2}, "ports: found 2, this board has 1"),
        ({"uart_baud": 57600}, "uart_baud: found 57600, allowed is one of 115200, 230400, 460800"),
        ({"inputs": [{"pin": 4}]}, "found 4, which is the board's DMX tx already"),
        ({"motors": [{}] * 4 + [{"driver": {"run_ma": 500}}]},
         r"motors\[5\].driver: found an object, but .* that of motors 1 to 4"),
    ],
)  # fmt: skip
def test_settings_that_are_not_for_it(found, wanted):
    with pytest.raises(RigError, match=wanted):
        Rig(found, board_data(BOARD))


def test_dmx_on_a_board_without_a_pin_for_it():
    without = {key: value for key, value in board_data(BOARD).items() if key != "dmx"}
    with pytest.raises(RigError, match="dmx: found true, but this board has no pin for it"):
        Rig({"dmx": True}, without)
