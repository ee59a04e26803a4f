"""A Pico 2 with sixteen motors behind shift registers (hal/rp2/registers.py), judged by the edges
at the outputs of its registers."""

import binascii
import random
import re

import numpy as np
import pytest

from framestep.motors.positions import HOMED, KNOWN
from framestep.pulse import register_engine, stepper
from framestep_emulator import Emulator
from framestep_tools import payloads as p
from framestep_tools.building import images
from framestep_tools.judge.judge import judge
from framestep_tools.judge.reference import Reference
from framestep_tools.simulator.boards import EmulatedBoard
from host_tests.board.test_faults import HANG, starts_again
from host_tests.board.test_homing import BACK, Rail
from host_tests.end_to_end.motors.home_switches import trust
from host_tests.end_to_end.session import Session, deceleration, run_request
from host_tests.hal.streams import REPLAY, here
from host_tests.hal.test_stream import session as drawn_session
from host_tests.selection import sweep

BOARD = "pico2_595"
MOTORS = range(1, 17)
WORD_US = 4
ESTOP, LIMIT, HOME, ENABLE = 19, 10, 11, 18
STEPS, TURNS = range(64, 96, 2), range(65, 96, 2)
HOMING = {"limit": 2, "travel": 3000, "speed": 3000, "slow_speed": 500, "back_off": BACK}
RIG = {
    "estop": "nc",
    "limits": [{"high": LIMIT, "contact": "no"}, {"low": HOME}],
    "motors": [*[{}] * 14, {"home": {**HOMING, "position": 1000}}],
}
ROLL_MS = 300
STATE = "import framestep.boot as b\nstate = b.hal.kernel.state\n"


def started(board):
    """Return a session with a board whose switches are untouched."""
    board.wire_switches()
    session = Session(board, 16, reply_s=0.1)
    session.run(0.1)
    return session


@pytest.fixture(scope="module")
def session():
    with EmulatedBoard(RIG, board=BOARD) as board:
        yield started(board)


@pytest.fixture(autouse=True)
def at_rest(request):
    yield
    if "session" in request.fixturenames:
        found = request.getfixturevalue("session")
        found.accept(p.MotorStopAll()).wait_idle().forget()


def all_at(session, rate, acceleration=200_000):
    """Let all motors go far away at nearly the same velocity, half of them down."""
    for motor in MOTORS:
        session.speed(motor, rate - 37 * motor, acceleration)
    at = session.positions
    session.accept(*(p.MotorMove(m, at[m] + 10**6 * (-1 if m % 2 else 1)) for m in MOTORS))
    session.run(rate / acceleration + 0.1)


def check_counts(session, before):
    """Each motor is where its edges say."""
    after = session.positions
    assert [after[m] - before[m] for m in MOTORS] == [session.made(m) for m in MOTORS]


def test_it_says_what_it_is(session):
    info = session.ask(p.Hi())
    assert (info.motors, info.limit_sets) == (16, 2)
    assert info.upload_frames >= 10_000


def test_sixteen_motors_play_at_60_frames_a_second(session):
    """All at up to 20 000 steps/s: no step off, and no queue runs dry."""
    frames, fps = 45, 60
    at, k = session.positions, np.arange(frames)
    seconds = (frames - 1) / fps
    moves = {}
    for motor in MOTORS:
        session.speed(motor, 30_000, 400_000)
        far = (20_000 - 37 * motor) * seconds / (2 * np.pi)
        path = far * (1 - np.cos(2 * np.pi * k / (frames - 1)))
        moves[motor] = at[motor] + np.round(path).astype(int)
    session.upload(moves)
    before = session.play(run_request(fps, 1, frames, ROLL_MS, ROLL_MS))
    assert not session.events(p.HardStop)
    path = Reference(moves, 1000 * fps, ROLL_MS, ROLL_MS)
    found = judge(session.trace(), moves, 1000 * fps, before, session.positions, path)
    assert found.good, found.complaints
    assert found.worst_position == 0
    errors = np.concatenate([motor.edge_error_us for motor in found.motors])
    errors = np.abs(errors[~np.isnan(errors)])
    assert len(errors) > 16 * 4000
    assert errors.max() <= WORD_US


def test_constant_velocity_on_the_grid(session):
    """Every edge is in the word that contains its ideal time."""
    all_at(session, 20_000)
    session.forget()
    with session.board.emulator.measure() as measured:
        session.run(0.05)
    for motor in MOTORS:
        times, ways = session.steps(motor)
        rate = 20_000 - 37 * motor
        assert len(times) > 0.045 * rate
        off = 1e6 * (times - np.arange(len(times)) / rate)
        assert np.ptp(off) / 2 <= WORD_US / 2 + 0.3, f"motor {motor}"
        assert np.ptp(ways) == 0
    assert measured["exceptions"]["irq10"]["max"] / 150 < 500, "µs of a millisecond"


def test_turns_in_motion(session):
    """Motors that are sent elsewhere while they run: no step is lost, no direction changes within a
    pulse, and each in time before the next."""
    dice = random.Random(16)
    before = session.positions
    for motor in MOTORS:
        session.speed(motor, 20_000, 1_000_000)
    for _ in range(12):
        for motor in dice.sample(MOTORS, 5):
            session.accept(p.MotorMove(motor, before[motor] + dice.randint(-400, 400)))
        session.run(0.008)
    session.wait_idle()
    check_counts(session, before)
    trace = session.trace()
    found = 0
    for motor in MOTORS:
        steps = session.steps(motor)[0] * 1e6
        for turn in trace.signals[f"dir{motor}"][0][1:] / 1e3:
            found += 1
            assert not ((steps <= turn) & (turn < steps + WORD_US - 0.1)).any()
            after = steps[steps > turn]
            assert not len(after) or after[0] - turn >= 5
    assert found > 20


def ramped_down(session, before, acceleration, after):
    """Each motor came to rest on a ramp of this, and no step is lost."""
    for motor in MOTORS:
        slope = deceleration(*session.steps(motor), after + 0.004)
        assert slope == pytest.approx(acceleration, rel=0.05), f"motor {motor}"
    check_counts(session, before)


def test_estop(session):
    """All ramp down together, four times as steeply, and the host hears it once."""
    before = session.positions
    session.forget()
    all_at(session, 10_000, 20_000)
    pressed = session.now
    session.board.emulator.set_pin(ESTOP, 1)
    session.wait_idle()
    assert [message for _, message in session.events(p.HardStop)] == [p.HardStop(0)]
    ramped_down(session, before, 80_000, pressed)
    session.board.emulator.set_pin(ESTOP, 0)
    session.run(0.1)


def test_lost_host(session):
    """All ramp down together, each with its acceleration; the next host finds them at rest."""
    before = session.positions
    session.forget()
    all_at(session, 10_000, 20_000)
    gone = session.now
    session.leave().run(0.8).come_back()
    assert not session.moving
    assert not session.events(p.HardStop)
    ramped_down(session, before, 20_000, gone)
    assert max(session.steps(motor)[0][-1] for motor in MOTORS) < gone + 0.52


def test_home_of_a_motor_beyond_the_twelfth(session):
    """Motor 15 finds its switch while the others stand."""
    session.forget()
    rail = Rail(session, -700, motor=15, switch=HOME)
    session.accept(p.Home(b"\x0f"))
    rail.run_until_at_rest()
    assert trust(session, 15) == (KNOWN, HOMED)
    assert session.position(15) == 1000 + BACK
    assert rail.steps == pytest.approx(-700 + BACK, abs=1)
    assert not session.events(p.HardStop)


def test_limit_switch_of_the_last_motor(session):
    session.accept(p.MotorSetLimits(16, 0, 0, 0, 0, 1))
    session.speed(16, 5000, 50_000).speed(15, 5000, 50_000)
    at = session.positions
    session.accept(p.MotorMove(16, at[16] + 20_000), p.MotorMove(15, at[15] + 2000)).run(0.2)
    session.board.emulator.set_pin(LIMIT, 0)
    session.wait_idle()
    session.board.emulator.set_pin(LIMIT, 1)
    assert [message for _, message in session.events(p.HardStop)] == [p.HardStop(1, 16)]
    assert session.position(15) == at[15] + 2000
    check_counts(session, at)
    session.accept(p.MotorSetLimits(16, 0, 0, 0, 0, 0))


def test_a_line_that_something_else_takes(session):
    """A program on the REPL takes the registers' data pin: the motors stop, the host hears why, and
    framestep has its pin again."""
    all_at(session, 5000)
    repl = session.board.emulator.repl()
    repl.exec("from machine import Pin\nPin(2, Pin.IN)")
    session.wait_idle()
    assert p.HardStop(100) in [message for _, message in session.events(p.HardStop)]
    assert session.board.emulator.pins()[2]["function"] == 6, "PIO 0"
    session.forget()
    before = session.positions
    session.accept(p.MotorMove(5, before[5] + 100)).wait_idle()
    assert session.made(5) == 100


def test_answers_while_all_move(session):
    all_at(session, 20_000)
    took = []
    for _ in range(40):
        begun = session.now
        session.ask(p.MotorStatus())
        took.append(session.now - begun)
        session.run(0.0007)
    assert np.median(took) <= 0.0015
    assert max(took) <= 0.004


@pytest.mark.parametrize("ms", sweep([2, 13], 2))
def test_a_late_interrupt(session, ms):
    """Up to a block late nothing is lost. Then the ring runs dry: all steps are low, no word is
    played again, and whatever moves faults and ramps down."""
    repl = session.board.emulator.repl()
    before = session.positions
    all_at(session, 10_000)
    repl.exec(
        f"{STATE}import machine, time\n"
        "irq = machine.disable_irq()\nbegun = time.ticks_us()\n"
        f"while time.ticks_diff(time.ticks_us(), begun) < {1000 * ms - 700}: pass\n"
        "machine.enable_irq(irq)"
    )
    session.run(0.1)
    stopped = [message for _, message in session.events(p.HardStop)]
    if ms == 2:
        assert not stopped
    else:
        assert stopped == [p.HardStop(100)]
        session.wait_idle()
        check_counts(session, before)
        gaps = [np.diff(session.steps(motor)[0]).max() for motor in MOTORS]
        assert min(gaps) > 0.009
        assert not repl.eval(f"state[{stepper.FAULTS}] & ~{stepper.FAULT_LATE}")


def test_c_paints_the_kernel_s_words(tmp_path):
    """The image paints by C; in any session its words are those of the kernel on CPython."""
    lines = [*drawn_session(random.Random(5), 4, 3), "end"]
    lines += ["new 2 3", "speed 0 15000 400000", "speed 1 900 90000", "travel 0 500"]  # wide pulses
    lines += ["travel 1 -40", *["batch 20"] * 5, "travel 0 -500", *["batch 20"] * 8, "end"]
    replay = re.sub(r'if __name__ == "__main__":.*', "", REPLAY.read_text(), flags=re.DOTALL)
    for name, module in (("engine", register_engine), ("stepper", stepper)):  # as the build does
        imported = re.search(f"from framestep.pulse.{name} import (.*)", replay)
        values = [getattr(module, constant) for constant in imported[1].split(", ")]
        replay = replay.replace(imported[0], f"{imported[1]} = {values}")
    files = {"/main.py": b"", "/replay.py": replay.encode(), "/lines": "\n".join(lines).encode()}
    with Emulator(images.frozen(BOARD), files=files) as emulator:  # framestep has not begun
        repl = emulator.repl()
        repl.exec(
            "import binascii, replay\nimport framestep.hal.stream as s\n"
            "from framestep.hal.rp2.painted import paint\ns.paint = paint\n"
            "class Out:\n"
            "    crc = size = 0\n"
            "    def write(self, words):\n"
            "        self.crc = binascii.crc32(words, self.crc)\n"
            "        self.size += 4 * len(words)\n"
            "out = Out()\nreplay.play(open('/lines'), out)",
            timeout=200,
        )
        wanted = here(lines, tmp_path / "here", "registers")
        assert repl.eval("[out.size, out.crc]") == [len(wanted), binascii.crc32(wanted)]


def test_a_reset_by_the_watchdog_in_motion():
    """The main loop hangs, and the motors have not ramped down yet: from the reset on the registers
    show nothing, not even for a moment once they are enabled again, and the drivers are off."""
    with EmulatedBoard(RIG, board=BOARD) as board:
        found, emulator = started(board), board.emulator
        all_at(found, 20_000)
        emulator.events(clear=True)
        emulator.repl().start(f"import framestep.boot as b\nb.hal.watchdog.arm(100)\n{HANG}")
        emulator.trace_start([*STEPS, *TURNS])
        emulator.wait_event("reset", 1000)
        reset = emulator.ns
        assert not emulator.pin(ENABLE), "the drivers were on"
        emulator.advance(310)
        assert emulator.pin(ENABLE)
        starts_again(found)
        trace = emulator.trace_stop()
        rises = trace["t"][trace["level"] == 1]
        assert sum(rises > reset - 1_000_000) > 16 * 15, "they were in motion"
        assert trace["t"].max() <= reset + 4 * WORD_US * 1000  # the emulator is words ahead
        last = dict(zip(trace["pin"].tolist(), trace["level"].tolist(), strict=True))
        assert set(last.values()) == {0}
        found.accept(p.MotorMove(5, found.position(5) + 100)).wait_idle()
        assert emulator.pin(ENABLE) == 0


def test_a_soft_reset_in_motion():
    """No step after it, all outputs are low, and framestep is there again."""
    with EmulatedBoard(RIG, board=BOARD) as board:
        found = started(board)
        all_at(found, 15_000)
        repl = board.repl
        repl.open_port(True)
        repl.receive(b"\r\x03\r\x01")
        found.run(0.02).forget()
        repl.receive(b"\x04")
        struck = found.now
        found.run(0.002)
        board.run_until(board.now_ns + 1_800_000_000)
        for motor in MOTORS:
            times, _ = found.steps(motor)
            assert len(times)
            assert times[-1] < struck + 0.02, f"motor {motor}"
        board.emulator.trace_start([*STEPS, *TURNS])
        assert not board.emulator.trace_read()["level"].any()


def test_power_up():
    """The registers begin with random levels; nothing is seen of them, nor of a reset."""
    with EmulatedBoard(RIG, board=BOARD) as board:
        emulator = board.emulator
        emulator.trace_start([*STEPS, *TURNS])
        emulator.reset()
        emulator.wait_usb(20_000, ports=2)
        emulator.advance(300)
        assert not emulator.trace_stop()["level"].any()
