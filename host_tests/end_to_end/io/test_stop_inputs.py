"""E-stop and limit switches on the host simulation: what they stop, and how steeply."""

import math

import pytest

from framestep.motors.positions import KNOWN, LOST
from framestep.protocol import messages as m
from framestep_tools import payloads as p
from host_tests.end_to_end.session import (
    ACCELERATION,
    SWITCHES,
    VELOCITY,
    calm,
    deceleration,
    inputs,
    run_request,
    simulated,
)

PATH = [round(1000 * (1 - math.cos(math.pi * k / 40))) for k in range(41)]


def start(session, motion):
    """Start some motors; return which."""
    if motion == "moves":
        session.accept(
            p.MotorMove(1, 100_000), p.MotorMove(2, -100_000), p.MotorJog(3, 10000, 100_000)
        )
        session.run(0.35)
        return (1, 2, 3)
    session.upload({1: PATH, 2: [-at for at in PATH]})
    run = run_request(end=len(PATH), flags=m.RUN_LOOP if motion == "loop" else 0)
    if motion == "jog all":
        session.accept(p.RtPositionFrame(1)).wait_idle()
        session.accept(p.RtJogAll(24000, len(PATH))).run(0.9)
        return (1, 2)
    if motion == "shoot":
        run = p.RtShootFrame2(5, 2000, 0, 180)
        session.accept(p.MotorConfigure(1, 3), p.MotorConfigure(2, 3))
    session.accept(run)
    if motion == "positioning":
        return (1, 2)
    session.wait_idle()
    if motion != "ready":
        session.accept(p.RtGo()).run(1.2)
    return (1, 2)


MOTIONS = ("moves", "run", "loop", "jog all", "shoot", "positioning", "ready")


REQUESTS = (
    p.MotorMove(1, 500), p.MotorJog(2, 5000, 500), p.RtPositionFrame(2), run_request(end=3),
    p.RtShootFrame(2, 1, 100, 500), p.RtShootFrame2(2, 100, 0, 180), p.RtGo(), p.RtJogAll(24000, 3),
)  # fmt: skip


def estop_pressed(motion, factor=1):
    """Press the E-stop in a motion; return the session, the motors, and when that was."""
    session = simulated({"estop": "nc", "hard_stop_factor": factor})
    session.run(0.01)
    assert [message for _, message in session.events(p.HardStop)] == [
        p.HardStop(0)
    ]  # its wire is off
    calm(session, estop=True)
    motors = start(session, motion)
    session.client.events.clear()
    session.input("estop", 1)
    return session, motors, session.now


@pytest.mark.needs("ramped E-stop", only=("1-moves", "4-moves"))
@pytest.mark.needs("prompt")
@pytest.mark.parametrize("motion", MOTIONS)
@pytest.mark.parametrize("factor", [1, 4])
def test_the_estop_stops_all_motors_on_their_ramps_and_says_so(motion, factor):
    session, motors, pressed = estop_pressed(motion, factor)
    session.run(1)
    assert not session.moving
    ((reported, message),) = session.events(p.HardStop)
    assert message == p.HardStop(0)
    assert reported - pressed <= 0.002
    for motor in motors:
        times, signs = session.steps(motor)
        late = times[times > pressed]
        if motion == "moves":
            steepness = deceleration(times, signs, pressed + 0.004)
            assert steepness == pytest.approx(factor * ACCELERATION, rel=0.05)
        # no motor moves for longer than a ramp from its top speed and the queued ticks take
        longest = VELOCITY / (factor * ACCELERATION) + 0.006
        assert not len(late) or late[-1] - pressed <= longest
    assert len(session.events(p.RtEnd)) == (motion not in ("moves", "jog all"))


@pytest.mark.needs("ramped E-stop")
@pytest.mark.parametrize("motion", MOTIONS)
def test_nothing_moves_after_the_estop_until_it_is_released_and_asked_to(motion):
    session, _, _ = estop_pressed(motion)
    session.run(1).forget().refuse(m.ERR_GENERAL, *REQUESTS)
    session.input("estop", 0).run(1)
    assert not session.moving
    assert not session.events(p.HardStop)
    assert not session.events(p.RtEnd)
    assert not [signal for signal in session.trace().signals if signal.startswith("m")]
    session.refuse(m.ERR_GENERAL, p.RtGo())
    session.accept(p.MotorJog(3, 10000, 500))


def test_requests_that_move_nothing_are_answered_while_the_estop_is_held():
    session = simulated({"estop": "no"})
    session.input("estop", 0).run(0.01)
    session.accept(
        p.GioOut(1), p.Dmx(1, 1, [5]), p.MotorSetLimits(1, 0, 0, 0, 0, 0), p.MotorConfigure(1, 1)
    )
    assert inputs(session) == 0
    assert session.ask(p.Hi()).motors == 8


class AtLimit:
    """Motors 4 and 5 move; motor 4 reaches one of its two switches. `hit` is when."""

    def __init__(self, direction, swap):
        self.direction = direction
        self.session = session = simulated(SWITCHES)
        calm(session)
        session.accept(p.MotorSetLimits(4, 0, 0, 0, 0, 1 | swap))
        session.accept(p.MotorMove(4, 30_000 * direction), p.MotorMove(5, 30_000 * direction))
        session.run(1)
        self.pin = 22 if (direction > 0) != bool(swap) else 26
        session.input(48 - self.pin, 1)  # the other end, which the motor leaves
        session.run(0.2).input(48 - self.pin, 0).run(0.05)
        assert tuple(session.moving) == (4, 5)
        assert not session.events(p.HardStop)
        session.input(self.pin, 1)
        self.hit = session.now

    def rest(self):
        """Wait until all motors are at rest. Return where motor 4 is."""
        self.session.run(0.3).wait_idle()
        here = self.session.position(4)
        self.session.forget()
        return here


@pytest.fixture(
    params=[(1, 0), (-1, 0), (1, m.HW_SET_SWAP), (-1, m.HW_SET_SWAP)],
    ids=("upper", "lower", "upper, swapped", "lower, swapped"),
)
def at_limit(request):
    return AtLimit(*request.param)


@pytest.mark.each_processor
def test_a_limit_stops_its_motor_alone(at_limit):
    """By four times its acceleration, and it is reported within 2 ms."""
    session = at_limit.session
    session.run(0.3)
    assert tuple(session.moving) == (5,)
    ((reported, message),) = session.events(p.HardStop)
    assert message == p.HardStop(1 if at_limit.direction > 0 else 2, 4)
    assert reported - at_limit.hit <= 0.002
    slope = deceleration(*session.steps(4), at_limit.hit + 0.004)
    assert slope == pytest.approx(4 * ACCELERATION, rel=0.05)


def test_at_a_limit_everything_that_leads_on_is_refused(at_limit):
    session, direction = at_limit.session, at_limit.direction
    here = at_limit.rest()
    refusal = m.ERR_HARD_UP if direction > 0 else m.ERR_HARD_LOW
    session.refuse(
        refusal, p.MotorMove(4, here + direction), p.MotorJog(4, 5000, here + 1000 * direction)
    )
    session.upload({4: [here + 100 * direction] * 2})
    blur = p.BlurMotor(4, here + 100 * direction, here + 110 * direction)
    shoot = p.RtShootFrame2(1, 100, 0, 180, [blur])
    session.refuse(refusal, p.RtPositionFrame(1), run_request(), shoot)
    assert not session.steps(4)[0].size


@pytest.mark.each_processor
def test_a_motor_may_leave_its_limit_and_come_back_once_that_is_released(at_limit):
    session = at_limit.session
    here = at_limit.rest()
    away = here - 100 * at_limit.direction
    session.accept(p.MotorMove(4, away)).wait_idle()
    assert session.position(4) == away
    assert not session.events(p.HardStop)
    session.input(at_limit.pin, 0).run(0.05).accept(p.MotorMove(4, here)).wait_idle()
    assert session.position(4) == here


def test_a_limit_during_a_run_ends_it():
    session = simulated(SWITCHES)
    calm(session)
    session.accept(p.MotorSetLimits(1, 0, 0, 0, 0, 1))
    session.upload({1: PATH, 2: PATH})
    session.ready(run_request(end=len(PATH))).forget()
    session.accept(p.RtGo()).run(1.2)
    session.input(22, 1).until(p.RtEnd).run(0.5)
    assert [message for _, message in session.events(p.HardStop)] == [p.HardStop(1, 1)]
    assert not session.events(p.RtEnd)
    assert not session.moving
    assert session.position(1) < PATH[-1]
    assert session.position(2) < PATH[-1]


def test_sets_that_are_not_there():
    session = simulated(SWITCHES)
    session.accept(*(p.MotorSetLimits(1, 0, 0, 0, 0, n) for n in (1, 2, 0x81, 0x82, 0, 0x80)))
    session.accept(p.MotorSetLimits(1, 0, 0, 0, 0, 1))
    session.refuse(
        m.ERR_RANGE, p.MotorSetLimits(1, 0, 0, 0, 0, 3), p.MotorSetLimits(1, 0, 0, 0, 0, 0x83)
    )
    session.refuse(m.ERR_RANGE, p.MotorSetLimits(1, 1, 5, 1, 4, 0))  # crossed soft limits
    # set 1 is still in force, and nothing is wired to it
    session.refuse(m.ERR_HARD_UP, p.MotorMove(1, 10))
    session.accept(p.MotorSetLimits(1, 0, 0, 0, 0, 0))
    assert session.ask(p.MotorMove(1, 10)).moving


@pytest.mark.needs("inside")
@pytest.mark.provokes("fault")
def test_a_pin_that_something_else_has_taken():
    """At rest the firmware puts it back before a motion may begin; in motion, within a tenth of a
    second, everything ramps down."""
    session = simulated()
    hal = session.board._board.hal
    session.accept(*(p.MotorResetPosition(motor, 0) for motor in (1, 2)))
    hal.taken = 0b10
    session.refuse(m.ERR_GENERAL, p.MotorMove(1, 1000)).run(0.2)
    assert [message for _, message in session.events(p.HardStop)] == [p.HardStop(100)]
    assert [each.state for each in session.ask(p.GetCondition()).positions[:2]] == [KNOWN, LOST]
    session.forget().accept(p.MotorResetPosition(2, 0), p.MotorMove(1, 5000), p.MotorMove(2, 5000))
    session.run(0.3)
    taken = session.now
    hal.taken = 0
    session.wait_idle()
    assert [message for _, message in session.events(p.HardStop)] == [p.HardStop(100)]
    assert session.steps(1)[0][-1] - taken < 0.1 + 5000 / 20000 + 0.05
    assert [each.state for each in session.ask(p.GetCondition()).positions[:2]] == [KNOWN, KNOWN]
