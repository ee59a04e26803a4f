"""What leaves the UARTs of the simulated ESP32, and the watchdog."""

import numpy as np
import pytest

from framestep.protocol import messages as m
from framestep_tools import payloads as p
from framestep_tools.building.board_files import board_data
from framestep_tools.simulator import driver_chips
from framestep_tools.simulator.driver_chips import Chips
from framestep_tools.simulator.esp32_board import BOARD, Esp32Board
from host_tests.end_to_end.session import Session, dmx_frames, run_request

REPLY_S = 0.06
DMX_PIN = board_data(BOARD)["dmx"]["tx"]
EIGHT = tuple(range(1, 9))


@pytest.fixture
def board(request):
    """Return board(rig): a session; all sessions end with the test."""
    made = []

    def make(rig=None):
        made.append(Esp32Board(rig))
        made[-1].wire_switches()
        return Session(made[-1], reply_s=REPLY_S)

    yield make
    for each in made:
        each.close()


# ---- DMX


def check_timing(frames, mark_us=20, low_us=176):
    for _, low, mark, slots, gap in frames:
        assert low_us * 1000 <= low <= low_us * 1010 + 2000, "break"
        assert mark_us * 1000 <= mark, "mark after break"
        assert len(slots) == 513
        assert slots[0] == 0
        assert gap < 1000


def test_dmx_on_the_wire(board):
    """Standard: ANSI E1.11. Only complete states, whatever the motors do, and they follow the
    lights."""
    session = board()
    levels = bytes((7 * c + 3) & 0xFF for c in range(512))
    session.accept(p.Dmx(0, 1, list(levels))).run(0.1)
    session.board.line(DMX_PIN)
    session.run(0.15)
    frames = dmx_frames(*session.board.line_edges(DMX_PIN))
    assert len(frames) >= 4
    check_timing(frames)
    assert {frame[3] for frame in frames} == {b"\0" + levels}
    periods = np.diff([frame[0] for frame in frames])
    assert periods.max() <= 26_000_000
    for motor in EIGHT:
        session.speed(motor, 20_000, 100_000).accept(p.MotorMove(motor, 8000))
    session.accept(p.Dmx(0, 1, [0] * 512)).run(0.1)
    session.board.line(DMX_PIN)
    begin = session.now
    session.accept(p.Dmx(1, 1, [250] * 512))
    sending = []
    while session.now - begin < 0.7:
        sending.append(session.ask(p.MotorStatus()).dmx)
        session.run(0.05)
    frames = dmx_frames(*session.board.line_edges(DMX_PIN))
    check_timing(frames)
    assert len(frames) >= 22
    assert (sending[0], sending[-1]) == (1, 0)
    for start, _, _, slots, _ in frames:
        line = 250 * min(1.0, max(0.0, (start * 1e-9 - begin - 0.06) / 0.5))
        assert all(abs(level - line) <= 250 * 0.1 / 0.5 for level in (min(slots[1:]), max(slots)))
    assert frames[-1][3] == b"\0" + bytes([250] * 512)
    session.wait_idle()
    assert session.positions == dict.fromkeys(EIGHT, 8000)


def test_a_late_main_loop_makes_long_marks_only(board):
    session = board()
    session.accept(p.Dmx(0, 1, list(range(256)) * 2)).run(0.1)
    session.board.line(DMX_PIN)
    for pause in (3, 10, 23, 60, 1):
        session.board.pause(pause)
        session.run(0.09)
    frames = dmx_frames(*session.board.line_edges(DMX_PIN))
    assert len(frames) >= 12
    check_timing(frames)
    assert {frame[3] for frame in frames} == {b"\0" + bytes(range(256)) * 2}


@pytest.mark.parametrize("low_us, mark_us", [(92, 12), (92, 1000), (1000, 500)])
def test_the_lengths_of_break_and_mark(board, low_us, mark_us):
    """At least as the rig file says."""
    session = board({"dmx_break_us": low_us, "dmx_mark_us": mark_us})
    session.run(0.1)
    frames = dmx_frames(*session.board.line_edges(DMX_PIN))
    assert len(frames) >= 2
    check_timing(frames, mark_us, low_us)


def test_a_rig_without_dmx_leaves_its_pins_alone(board):
    session = board({"dmx": False, "inputs": [{"pin": DMX_PIN}]})
    session.run(0.1)
    assert not len(session.board.line(DMX_PIN))


# ---- drivers


DRIVEN = {
    "motors": [
        {"driver": {"run_ma": 300 * motor, "microsteps": 2**motor}} for motor in (1, 2, 3, 4)
    ]
}


@pytest.fixture
def driven(board):
    """Return a session, and the chips, which are connected and set up."""
    session = board(DRIVEN)
    chips = driver_chips.of(session.board.rig.board)
    wire = Chips(chips, lambda: session.board.now_ns)
    session.run(0.5).refuse(m.ERR_GENERAL, p.MotorMove(1, 100))
    assert session.ask(p.GetCondition()).bits & m.CONDITION_DRIVER
    session.forget()
    session.board.connect(wire)
    session.run(3)
    return session, chips


def test_drivers_are_set_up_then_enabled(driven):
    """Every register arrives, complete and confirmed, and only then a driver is switched on."""
    session, chips = driven
    assert "enable" not in session.trace().signals
    assert session.ask(p.GetCondition()).bits & m.CONDITION_DRIVER == 0
    for motor, driver in enumerate(chips, 1):
        assert driver.damaged == 0
        assert len(driver.writes) == 12
        assert driver.gstat == 0
        assert driver.microsteps == 2**motor
        assert 300 * motor - 55 < driver.run_ma() <= 300 * motor  # 1/32 of 1740 mA
    session.accept(p.MotorMove(1, 100), p.MotorMove(8, 50))  # motor 8 has no driver settings
    session.wait_idle()
    assert (session.made(1), session.made(8)) == (100, 50)
    assert 0 in session.trace().signals["enable"][1]


def test_a_driver_fails_in_motion(driven):
    session, chips = driven
    for motor in (2, 3):
        session.speed(motor, 10_000, 100_000)
        session.accept(p.MotorResetPosition(motor, 0), p.MotorMove(motor, 30_000))
    session.run(0.4)
    chips[1].status |= 0x02
    chips[1].gstat |= 0x02
    session.run(0.9)
    assert not session.moving
    assert [message for _, message in session.events(p.HardStop)] == [p.HardStop(m.HARD_STOP_FAULT)]
    assert session.made(3) == session.position(3) < 30_000
    session.refuse(m.ERR_GENERAL, p.MotorMove(2, 0))
    chips[1].status &= ~0x02  # cooled down: set up again
    session.run(2).accept(p.MotorMove(2, session.position(2) + 10)).wait_idle()


# ---- the watchdog


def test_the_watchdog_restarts_a_board_that_hangs_while_a_motor_moves(board):
    session = board()
    session.speed(1, 1000, 10_000).accept(p.MotorMove(1, 30_000)).run(0.5)
    session.board.pause(9000)
    session.run(10).forget()
    assert session.ask(p.GetCondition()).bits & m.CONDITION_WATCHDOG_RESET
    session.speed(1, 1000, 10_000).accept(p.MotorMove(1, 100)).wait_idle()
    assert session.made(1) == 100


@pytest.mark.parametrize("rig, moves", [({}, False), ({"watchdog": False}, True)])
def test_it_does_not_when_nothing_moves_or_the_rig_has_none(board, rig, moves):
    session = board(rig)
    session.accept(p.MotorMove(1, 100)).wait_idle()
    if moves:
        session.accept(p.MotorMove(1, 30_000)).run(0.2)
    session.board.pause(9000)
    session.run(10)
    assert session.ask(p.GetCondition()).bits & m.CONDITION_WATCHDOG_RESET == 0
    assert session.ask(p.MotorStatus()).moving == []


# ---- servos


SERVO_PIN = 13
PERIOD_S = 0.02


def pulses(session):
    """Return the rises of the servo's pulses in s, and their widths in us."""
    times, levels = session.board.line_edges(SERVO_PIN)
    assert np.array_equal(levels, np.arange(len(levels)) % 2 == 0)
    rises, falls = times[levels == 1], times[levels == 0]
    return rises[: len(falls)] * 1e-9, (falls - rises[: len(falls)]) * 1e-3


def test_a_servo_follows_the_path_that_a_step_motor_takes(board):
    """Each pulse has a place of the step motor in the period before it, or just then."""
    session = board({"dmx": False, "motors": [{}, {"servo": {"pin": SERVO_PIN}}]})
    session.run(0.2)
    assert not len(pulses(session)[0]), "pulses before the first move"
    frames = 24
    path = np.round(600 * np.sin(2 * np.pi * np.arange(frames) / frames)).astype(int).tolist()
    for motor in (1, 2):
        session.speed(motor, 20_000, 100_000)
    session.upload({1: path, 2: path})
    before = session.play(run_request(end=frames))
    session.run(0.1)
    rises, widths = pulses(session)
    assert np.diff(rises) == pytest.approx(PERIOD_S, abs=1e-6)
    assert widths.max() > 1790
    assert widths.min() < 1210
    times, signs = session.steps(1)
    made = before[1] + np.concatenate([[0], np.cumsum(signs)])
    mine = (rises > times[0]) & (rises < times[np.argmax(made) - 1])
    assert mine.sum() > 30
    for rise, width in zip(rises[mine], widths[mine], strict=True):
        first, last = np.searchsorted(times, [rise - PERIOD_S - 0.006, rise + 0.001])
        places = made[first : last + 1]
        assert places.min() - 1.5 < (width - 1500) * 2 < places.max() + 1.5
    session.accept(p.MotorMove(2, 1000)).wait_idle().run(0.1)
    assert pulses(session)[1][-1] == pytest.approx(2000, abs=0.5)
    assert not session.events(p.HardStop)


def test_a_servo_with_pulses_from_the_start(board):
    servo = {"pin": SERVO_PIN, "at_start": "on", "rate_hz": 333}
    session = board({"dmx": False, "motors": [{}, {}, {"servo": servo}]})
    session.run(0.2)
    rises, widths = pulses(session)
    assert np.diff(rises) == pytest.approx(1 / 333, abs=1e-6)
    assert len(rises) > 50
    assert widths[1:] == pytest.approx(1500, abs=0.5)


def test_a_servo_that_is_let_go_at_the_e_stop(board):
    servo = {"pin": SERVO_PIN, "at_start": "on", "on_stop": "release", "low_us": 1000.0}
    session = board({"dmx": False, "estop": "nc", "motors": [{"servo": servo, "invert": True}]})
    session.run(0.2)
    pulses(session)  # the E-stop counts as pressed until its wire is there
    session.accept(p.MotorMove(1, 1), p.MotorMove(1, 0)).wait_idle().run(0.2)
    rises, widths = pulses(session)
    assert len(rises) > 5
    assert widths[-5:] == pytest.approx(1500, abs=0.5)
    session.accept(p.MotorMove(1, 500)).wait_idle().run(0.1)
    assert pulses(session)[1][-1] == pytest.approx(1250, abs=0.5)
    session.board.set_pin(32, 1)
    session.run(0.1)
    pulses(session)
    session.run(0.1)
    assert not len(pulses(session)[0])
