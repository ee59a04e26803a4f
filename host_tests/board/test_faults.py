"""Faults on the emulated board: every edge until the motors rest, the outputs, and the messages to
the host.

The E-stop in motion and an exception in the main loop are in test_io.py, limit switches in
end_to_end/io/test_stop_inputs.py.
"""

import numpy as np
import pytest

from framestep.io.watchdog import HOST_UNREAD_MS, TIMEOUT_MS
from framestep.motors.positions import (
    BEFORE,
    BROKEN_OFF,
    HELD,
    KNOWN,
    LOST,
    RESTORED,
    SET,
    STEPS,
    UNSET,
)
from framestep.protocol import messages as m
from framestep_tools import payloads as p
from framestep_tools.client.client import NoAnswer
from host_tests.board.conftest import on_both, on_pico
from host_tests.end_to_end.session import Session, assert_within, deceleration, run_request

VELOCITY, ACCELERATION = 10_000, 50_000
OUTPUT, SAFE_ON, SHUTTER, ENABLE = 26, 22, 20, 18
RIG = {
    "remember_positions": True,
    "outputs": [{"pin": OUTPUT}, {"pin": SAFE_ON, "safe": "on"}],
    "motor_count": 6,
    "dmx": False,
}
HANG = """
import framestep.boot as b
def hang(urgent):
    while True:
        pass
b.controller.axes.feed = hang
"""
RAISE = """
import framestep.boot as b
def handler():
    raise ValueError("in a handler")
b.controller.handlers[0x21] = handler
"""
# Waits of 2 ms each, more than the FIFO holds; in one line, as a loop would let other code run
OVERFLOW = f"""
import machine, framestep.boot as b
fifo = b.hal.engine.fifo(4)
{"machine.mem32[fifo] = 0xFFFFC01;" * 12}
"""


def session(chip):
    found = Session(chip.emulated(RIG), motors=6, reply_s=0.1)
    for motor in (1, 2, 3):
        found.speed(motor, VELOCITY, ACCELERATION).accept(p.MotorResetPosition(motor, 0))
    return found


def levels(found):
    return [found.board.emulator.pin(pin) for pin in (OUTPUT, SAFE_ON, SHUTTER)]


def start(found, *moves):
    """Switch outputs on and start motors. Return where these were."""
    before = found.positions
    found.forget().accept(p.GioOut(1), p.GioCam(m.GIO_CAM_SHUTTER), *moves).run(0.4)
    assert levels(found) == [1, 0, 1]
    return before


def away(found, steps=30_000):
    """Return moves of motors 1 and 2 that take seconds."""
    return p.MotorMove(1, found.position(1) + steps), p.MotorMove(2, found.position(2) - steps)


def ramped_down(found, motor, before, failed, within):
    """Assert that the motor came to rest after the fault with its own deceleration, within its
    limits; return the position of its steps."""
    times, signs = found.steps(motor)
    assert 0 < times[-1] - failed < within
    assert_within(times, signs, VELOCITY * 1.001, ACCELERATION)
    assert deceleration(times, signs, times[-1] - 0.15) == pytest.approx(ACCELERATION, rel=0.1)
    return before[motor] + int(signs.sum())


def starts_again(found):
    """Wait for a board after a reset: the host opens its port and is greeted."""
    emulator = found.board.emulator
    # from here on: if the port is still open, the board may send messages before the host is back
    found.client.events.clear()
    emulator.wait_usb(after=emulator.ns, ports=2)
    found.leave()
    found.board.run_until(emulator.ns + 10_000_000)
    found.come_back().until(p.DeviceInfo)


def trust(found):
    return [(each.state, each.reason) for each in found.ask(p.GetCondition()).positions]


@pytest.fixture(scope="module")
def rig(chip):
    """Yield a session that all tests use in turn; each leaves it at rest."""
    found = session(chip)
    with found.board:
        yield found


@on_pico
def test_the_port_is_dropped_in_the_middle_of_a_run(rig):
    # 5760 steps/s from the seventh frame on
    path = np.cumsum(np.minimum(40 * np.arange(60), 240)).tolist()
    rig.upload({1: path, 2: [-place for place in path]})
    rig.ready(run_request(end=len(path), pre=200))
    before = rig.positions
    rig.forget().accept(p.GioOut(1), p.GioCam(m.GIO_CAM_SHUTTER), p.RtGo()).run(1.2)
    failed = rig.now
    rig.leave()
    rig.board.run_until(rig.board.now_ns + 600_000_000)
    assert levels(rig) == [0, 1, 0]
    stands = [ramped_down(rig, motor, before, failed, 0.2) for motor in (1, 2)]
    edges = len(rig.steps(1)[0])
    rig.come_back().until(p.DeviceInfo).run(0.3)
    assert [rig.position(1), rig.position(2)] == stands
    assert len(rig.steps(1)[0]) == edges
    assert not rig.events(p.RtEnd)
    assert not rig.moving
    assert trust(rig)[:4] == [(KNOWN, SET)] * 3 + [(LOST, UNSET)]


def test_a_queue_that_is_not_filled_in_time(rig, chip):
    """The main loop does something else for a second and a half, then continues."""
    before = start(rig, *away(rig))
    repl = rig.board.emulator.repl()
    repl.exec("import framestep.boot as b\nb.controller.axes.feed = lambda urgent: None")
    watched = f"print(machine.mem32[{chip.watchdog}] >> 30 & 1)"  # its ENABLE
    assert repl.exec("import machine\n" + watched) == "1\n"
    failed = rig.now
    rig.run(1)
    # one, or two if the motors' queues run dry some milliseconds apart
    assert {message for _, message in rig.events(p.HardStop)} == {p.HardStop(100)}
    assert levels(rig) == [0, 1, 0]
    assert not rig.moving
    for motor in (1, 2):
        assert ramped_down(rig, motor, before, failed, 0.8) == rig.position(motor)
    assert repl.exec(watched) == "0\n"
    repl.exec("del b.controller.axes.feed")
    rig.forget().run(0.3)
    assert not rig.made(1)
    assert not rig.made(2)
    assert trust(rig)[:3] == [(KNOWN, SET)] * 3


@on_both
def test_a_command_that_finds_its_fifo_full(rig):
    """Of motor 5, which is at rest: its position is lost, all others ramp down and keep theirs."""
    before = start(rig, *away(rig))
    failed = rig.now
    rig.board.emulator.repl().exec(OVERFLOW)
    rig.run(0.5).wait_idle()
    assert [message for _, message in rig.events(p.HardStop)] == [p.HardStop(100)]
    assert levels(rig) == [0, 1, 0]
    for motor in (1, 2):
        assert ramped_down(rig, motor, before, failed, 1) == rig.position(motor)
    assert trust(rig)[:6] == [(KNOWN, SET)] * 3 + [(LOST, UNSET), (LOST, STEPS), (LOST, UNSET)]
    assert not rig.made(5)
    rig.forget()


@on_pico
@pytest.mark.repeats
def test_a_host_that_takes_nothing(rig):
    """Its port is open, but it does not read: no request would get an answer, so nothing could stop
    the rig."""
    before = start(rig, *away(rig, 80_000))
    emulator = rig.board.emulator
    emulator.cmd("hold", port=1, on=True)
    failed = rig.now
    rig.board.run_until(rig.board.now_ns + (HOST_UNREAD_MS + 2000) * 1_000_000)
    emulator.cmd("hold", port=1, on=False)
    assert levels(rig) == [0, 1, 0]
    for motor in (1, 2):
        ramped_down(rig, motor, before, failed, HOST_UNREAD_MS / 1000 + 1)
        assert rig.steps(motor)[0][-1] - failed > HOST_UNREAD_MS / 1000
    rig.run(0.5)
    assert not rig.moving
    assert trust(rig)[:2] == [(KNOWN, SET)] * 2


def test_positions_outlive_the_power(rig):
    """After two seconds at rest they are saved; the first motion clears the saved ones before its
    first step."""
    emulator = rig.board.emulator
    rig.accept(
        p.MotorResetPosition(1, 2**31 - 1),
        p.MotorResetPosition(2, -12345),
        p.MotorMove(1, 2**31 - 3000),
    )
    rig.wait_idle()
    assert rig.ask(p.GetCondition()).bits == m.CONDITION_POSITIONS_PENDING
    rig.run(2.1)
    assert rig.ask(p.GetCondition()).bits == m.CONDITION_POSITIONS_SAVED
    emulator.reset()
    starts_again(rig)
    assert (rig.position(1), rig.position(2)) == (2**31 - 3000, -12345)
    assert trust(rig)[:5] == [(HELD, RESTORED)] * 3 + [(LOST, BEFORE)] * 2
    for motor in (1, 2):
        rig.speed(motor, VELOCITY, ACCELERATION)
    start(rig, p.MotorMove(1, 0), p.MotorMove(2, 0))
    times, signs = rig.steps(1)
    assert_within(times, signs, VELOCITY * 1.001, ACCELERATION)
    emulator.reset()
    starts_again(rig)
    assert (rig.position(1), rig.position(2)) == (2**31 - 3000, -12345)
    assert trust(rig)[:5] == [(LOST, BROKEN_OFF)] * 5
    rig.accept(*(p.MotorResetPosition(motor, 0) for motor in (1, 2, 3)))
    for motor in (1, 2):
        rig.speed(motor, VELOCITY, ACCELERATION)


@on_pico
def test_an_exception_inside_a_handler(rig):
    """It ends the passes and all answers; a power cycle starts the board again."""
    before = start(rig, *away(rig))
    emulator = rig.board.emulator
    emulator.repl().exec(RAISE)
    failed = rig.now
    rig.client.send(p.GioOut(0))
    rig.run(0.6)
    with pytest.raises(NoAnswer):
        rig.client.request(p.MotorStatus(), timeout_s=0.1)
    assert [message for _, message in rig.events(p.HardStop)] == [p.HardStop(100)]
    assert levels(rig) == [0, 1, 0]
    for motor in (1, 2):
        ramped_down(rig, motor, before, failed, 0.5)
    assert "in a handler" in emulator.repl().eval("str(b.runner.failure)")
    edges = len(rig.steps(1)[0])
    rig.run(0.3)
    assert len(rig.steps(1)[0]) == edges
    assert emulator.pin(ENABLE) == 0
    emulator.cmd("reset")
    emulator.advance(310)
    assert emulator.pin(ENABLE) == 1  # the drivers are off long before the rest is loaded
    starts_again(rig)
    rig.accept(p.MotorMove(1, rig.position(1) + 100)).wait_idle()


def test_a_main_loop_that_hangs(rig):
    """The queues run dry and the tick ramps the motors down; then the watchdog starts the board
    again."""
    for motor in (1, 2):
        rig.speed(motor, VELOCITY, ACCELERATION).accept(p.MotorResetPosition(motor, 0))
    rig.run(2.2)
    before = start(rig, p.MotorMove(1, 30_000), p.MotorMove(2, -30_000))
    emulator = rig.board.emulator
    assert emulator.pin(ENABLE) == 0
    emulator.events(clear=True)
    # a shorter time of the watchdog saves computing time
    emulator.repl().start(
        f"import framestep.boot as b\nb.hal.watchdog.arm({TIMEOUT_MS // 4})\n" + HANG
    )
    failed = rig.now
    emulator.wait_event("reset", TIMEOUT_MS)
    reset = emulator.ns * 1e-9
    assert reset - failed == pytest.approx(TIMEOUT_MS / 4000, abs=0.2)
    starts_again(rig)
    rig.run(0.5)
    assert [message for _, message in rig.events(p.HardStop)] == [p.HardStop(100)]
    assert levels(rig) == [0, 1, 0]
    assert emulator.pin(ENABLE) == 1
    for motor in (1, 2):
        ramped_down(rig, motor, before, failed, 0.8)
    assert np.all(rig.steps(1)[0] < reset)
    condition = rig.ask(p.GetCondition())
    assert condition.bits == m.CONDITION_WATCHDOG_RESET | m.CONDITION_POSITIONS_PENDING
    assert set(condition.positions) == {p.PositionTrust(LOST, BROKEN_OFF)}
    assert "watchdog" in emulator.repl().exec(
        "from framestep import texts; import framestep.boot as b\n"
        "print(texts.conditions(b.controller.condition()))"
    )


@pytest.mark.repeats
def test_a_call_that_takes_longer_than_the_watchdog_waits(rig):
    """On the REPL, in C, in motion: the motors ramp down, nothing is lost, the host hears of it,
    and all continues."""
    for motor in (1, 2):
        rig.speed(motor, VELOCITY, ACCELERATION).accept(p.MotorResetPosition(motor, 0))
    before = start(rig, p.MotorMove(1, 30_000), p.MotorMove(2, -30_000))
    emulator = rig.board.emulator
    emulator.events(clear=True)
    repl = emulator.repl()
    # a shorter time of the watchdog saves computing time
    failed = rig.now
    repl.start(
        f"import framestep.boot as b\nb.hal.watchdog.arm({TIMEOUT_MS // 5})\nsum(range(110000))"
    )
    repl.finish(20)
    assert emulator.ns * 1e-9 - failed > TIMEOUT_MS / 5000 + 0.5
    rig.board.run_until(emulator.ns + 500_000_000)
    rig.run(0.1)
    assert not [event for event in emulator.events() if event["type"] == "reset"]
    assert [message for _, message in rig.events(p.HardStop)] == [p.HardStop(100)]
    assert levels(rig) == [0, 1, 0]
    assert emulator.pin(ENABLE) == 0
    for motor in (1, 2):
        assert ramped_down(rig, motor, before, failed, 1) == rig.position(motor)
    assert trust(rig)[:2] == [(KNOWN, SET)] * 2
    rig.forget().accept(p.MotorMove(1, rig.position(1) + 100)).wait_idle()
    assert rig.made(1) == 100


@pytest.mark.repeats
def test_a_tick_that_has_died(rig):
    """During a long call on the REPL: nothing controls the motors any more, so the board starts
    again."""
    start(rig, p.MotorMove(1, rig.position(1) + 30_000), p.MotorMove(2, rig.position(2) - 30_000))
    emulator = rig.board.emulator
    emulator.events(clear=True)
    died = rig.now
    emulator.repl().start(
        "import framestep.boot as b\n"
        f"b.hal.watchdog.arm({TIMEOUT_MS // 5})\n"
        "b.hal.ticker.deinit()\n"
        "sum(range(110000))"
    )
    emulator.wait_event("reset", TIMEOUT_MS)
    assert emulator.ns * 1e-9 - died == pytest.approx(TIMEOUT_MS / 5000, abs=0.3)
    starts_again(rig)
    rig.run(0.2)
    assert [message for _, message in rig.events(p.HardStop)] == [p.HardStop(100)]


@pytest.mark.repeats
def test_the_watchdog_leaves_the_repl_alone(rig):
    """A soft reset at rest, as mpremote makes one before it copies files: framestep starts again,
    and the watchdog does not act."""
    rig.accept(p.MotorMove(1, rig.position(1) + 100)).wait_idle()
    emulator = rig.board.emulator
    emulator.events(clear=True)
    repl = emulator.repl()
    repl.enter()
    repl.serial.write(b"\x04")
    emulator.advance(TIMEOUT_MS + 2000)
    repl.serial.reset_input_buffer()
    assert not [event for event in emulator.events() if event["type"] == "reset"]
    assert repl.exec("print(__import__('framestep.boot').boot.runner.alive)") == "True\n"
