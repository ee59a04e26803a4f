"""Which positions are known, held or lost, what makes them so, and how this is reported."""

import pytest

from framestep import texts
from framestep.hal.host import HostFlash
from framestep.motors.positions import DRIVER_OFF, HELD, KNOWN, LOST, SET, STEPS, UNPOWERED, UNSET
from framestep.protocol import messages as m
from framestep_tools import payloads as p
from framestep_tools.simulator.boards import SimulatedBoard
from host_tests.end_to_end.session import Session, simulated, tell

NOT_SET = p.PositionTrust(LOST, UNSET)
IS_SET = p.PositionTrust(KNOWN, SET)
MISSING = p.PositionTrust(LOST, STEPS)


def trust(session, *motors):
    found = session.ask(p.GetCondition()).positions
    assert len(found) == session.motors
    return [found[motor - 1] for motor in motors]


@pytest.fixture
def moving():
    """Yield a session: motors 1 and 2 cruise, 3 rests, with known positions; 4 moves without."""
    session = simulated({"estop": "nc", "limits": [{"high": 22, "contact": "no"}]})
    session.input("estop", 0)
    session.run(0.05).accept(*(p.MotorResetPosition(motor, 100 * motor) for motor in (1, 2, 3)))
    session.accept(*(p.MotorMove(motor, 50_000) for motor in (1, 2, 4))).run(0.5).forget()
    return session


def at_rest_afterwards(session):
    """Assert that all rest after a fault that the host knows of."""
    assert {message for _, message in session.events(p.HardStop)} == {p.HardStop(100)}
    session.wait_idle()


def test_set_and_moved(moving):
    assert trust(moving, 1, 2, 3, 4, 5) == [IS_SET, IS_SET, IS_SET, NOT_SET, NOT_SET]
    moving.accept(p.MotorStopAll()).wait_idle()
    assert trust(moving, 1, 4) == [IS_SET, NOT_SET]
    moving.accept(p.MotorResetPosition(4, 0))
    assert trust(moving, 4) == [IS_SET]


def test_a_driver_that_was_off(moving):
    moving.accept(p.MotorStopAll()).wait_idle()
    moving.accept(
        *(p.MotorConfigure(motor, 0) for motor in (1, 4)), p.MotorConfigure(1, m.MOTOR_ENABLED)
    )
    assert trust(moving, 1, 2, 4) == [p.PositionTrust(HELD, DRIVER_OFF), IS_SET, NOT_SET]
    moving.accept(p.MotorMove(1, 0)).wait_idle()
    assert trust(moving, 1) == [p.PositionTrust(HELD, DRIVER_OFF)]
    moving.accept(p.MotorResetPosition(1, 0))
    assert trust(moving, 1) == [IS_SET]


@pytest.mark.needs("inside")
@pytest.mark.provokes("fault")
def test_a_command_that_finds_its_fifo_full(moving):
    engine = moving.board._board.hal.engines[1]
    before = moving.positions
    moving.forget()
    engine.waiting[:] = [engine.clock() + 150_000] * 8  # the engine takes none for 1.2 ms
    moving.run(0.05)
    at_rest_afterwards(moving)
    assert trust(moving, 1, 2, 3, 4) == [IS_SET, MISSING, IS_SET, NOT_SET]
    assert moving.position(2) - before[2] == moving.position(1) - before[1]
    assert moving.made(2) <= moving.made(1) - 3
    moving.accept(p.MotorMove(2, 0)).wait_idle()
    assert trust(moving, 2) == [MISSING]
    moving.accept(p.MotorResetPosition(2, 0))
    assert trust(moving, 2) == [IS_SET]


@pytest.mark.needs("inside")
@pytest.mark.provokes("fault")
def test_pulses_that_broke_off(moving):
    moving.board._board.next_tick += 10_000_000
    moving.run(0.05)
    at_rest_afterwards(moving)
    assert trust(moving, 1, 2, 3, 4) == [MISSING, MISSING, IS_SET, MISSING]


@pytest.mark.needs("inside")
@pytest.mark.inside
def test_stops_that_lose_nothing(moving):
    """The main loop away, an E-stop, a limit, a lost host: the motors ramp down, and every step
    counts."""
    axes = moving.board._board.controller.axes
    feed, axes.feed = axes.feed, lambda urgent: None
    moving.run(2)
    axes.feed = feed
    at_rest_afterwards(moving)
    moving.accept(p.MotorSetLimits(2, 0, 0, 0, 0, 1))
    for stop in ("estop", 22, None):
        moving.accept(*(p.MotorMove(motor, 0 if stop == "estop" else 30_000) for motor in (1, 2)))
        moving.run(0.3)
        if stop is None:
            moving.leave().run(2).come_back()
        else:
            level = 1 if stop == "estop" else 0
            moving.input(stop, level).run(0.1).input(stop, 1 - level)
        moving.wait_idle()
    assert trust(moving, 1, 2, 3) == [IS_SET] * 3


def test_an_e_stop_that_cuts_the_power():
    session = simulated({"estop": "nc", "estop_cuts_power": True})
    session.input("estop", 0)
    session.run(0.05).accept(*(p.MotorResetPosition(motor, 0) for motor in (1, 2)))
    session.accept(*(p.MotorMove(motor, 50_000) for motor in (1, 4))).run(0.5)
    session.input("estop", 1).wait_idle().input("estop", 0).run(0.1)
    gone = p.PositionTrust(LOST, UNPOWERED)
    assert trust(session, 1, 2, 3, 4) == [gone, p.PositionTrust(HELD, DRIVER_OFF), NOT_SET, gone]


def test_soft_limits_count_from_a_lost_position(moving):
    moving.accept(p.MotorSetLimits(5, 1, -100, 1, 100))
    moving.refuse(p.Ack.ERR_SOFT_UP, p.MotorMove(5, 101))
    assert trust(moving, 5) == [NOT_SET]


@pytest.mark.needs("inside")
def test_the_repl_says_so_in_words(moving):
    lines = texts.positions(moving.board._board.controller)
    place = moving.position(1)
    assert lines[0] == f"motor 1: {place}, known: set by the host"
    assert lines[4] == "motor 5: 0, lost: not set since power-up"
    assert lines[8] == texts.LIMITS_COUNT
    assert len(lines) == 9


@pytest.mark.needs("inside")
@pytest.mark.inside
def test_the_status_command_says_so(command):
    board = SimulatedBoard({"estop": "nc"}, motors=2)

    def says(*lines):
        status, out, _ = command(board, "status")
        assert (status, out.splitlines()[1:]) == (0, list(lines))

    tell(board, p.MotorResetPosition(1, -7))
    says(
        "motor 1: -7, known: set by the host",
        "motor 2: 0, lost: not set since power-up",
        "the E-stop is held",
        "soft limits do not protect a motor whose position is lost; RESET_POSITION sets it "
        "(framestep zero)",
    )
    tell(board, p.MotorResetPosition(2, -7))
    says("motors 1 to 2: -7, known: set by the host", "the E-stop is held")
    tell(board, p.MotorResetPosition(2, 0))
    board._board.controller.handlers.pop(m.MSG_CONDITION)  # like another device
    says(
        "motor 1: -7",
        "motor 2: 0",
        "this device does not report how far its positions can be trusted",
    )


@pytest.mark.needs("inside")
@pytest.mark.provokes("positions")  # the observers count from 0
@pytest.mark.each_processor
@pytest.mark.parametrize("motors", [8, 24])
def test_positions_of_any_size_outlast_power_cuts(motors):
    """They are saved 2 s after they are set; motor 1, which is never set, stays lost."""
    steps = (2**31 - 1, -(2**31), 5, -5, 2**30, -(2**30), 0)
    flash = HostFlash()
    saved = {}
    for turn in range(3):
        board = SimulatedBoard({"remember_positions": True}, motors, flash=flash)
        session = Session(board, motors)
        assert trust(session, 1)[0].state == LOST
        for motor, place in saved.items():
            assert session.position(motor) == place, f"motor {motor} in turn {turn}"
            assert trust(session, motor)[0].state == HELD, f"motor {motor} in turn {turn}"
        saved = {motor: steps[(motor + turn) % len(steps)] for motor in range(2, motors + 1)}
        session.accept(*(p.MotorResetPosition(motor, place) for motor, place in saved.items()))
        session.run(2.1)
        if turn == 1:
            session.accept(p.MotorMove(2, saved[2] - 900), p.MotorStopAll()).wait_idle().run(2.1)
            saved[2] = session.position(2)
