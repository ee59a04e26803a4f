"""Live control, the jerk limit and the ends of the range of positions, over the protocol on the
host simulation."""

import random

import numpy as np
import pytest

from framestep_tools import payloads as p
from host_tests.end_to_end.session import run_request, simulated

COUPLE, REVERSED, LIVE = 0x10, 0x20, 0x08
LOWEST, HIGHEST = -(2**31), 2**31 - 1


def test_a_live_motor_stays_free_during_a_run(rig):
    rig.accept(p.MotorConfigure(2, 1 | LIVE)).upload({1: 20 * np.arange(49), 2: 20 * np.arange(49)})
    rig.ready(run_request(24, 1, 49, 200, 200)).accept(p.RtGo()).run(0.5)
    rig.refuse(p.Ack.ERR_MOVING, p.MotorMove(1, 0)).accept(p.MotorMove(2, -123)).run(0.3)
    assert rig.position(2) == -123
    rig.accept(p.MotorJog(2, 10000, HIGHEST)).run(0.1)
    rig.accept(p.MotorStop(2)).until(p.RtEnd, 10)
    assert rig.position(1) >= 960


# ---------------------------------------------------------------- jerk limit


def smooth(jerk, **settings):
    """Return a session whose motor 1 has a jerk limit, 1000 steps/s³."""
    session = simulated({"motors": [{"jerk": jerk}], **settings})
    return session.speed(1, 10000, 40000)


def steepest_change(session, window=0.01):
    """Return the greatest jerk (steps/s³) and acceleration of motor 1, from differences over
    windows of time."""
    t, signs = session.steps(1)
    grid = np.arange(t[0] + 2 * window, t[-1] - 2 * window, window)
    acceleration = np.diff(np.interp(grid, t, np.cumsum(signs)), 2) / window**2
    return np.abs(np.diff(acceleration)).max() / window, np.abs(acceleration).max()


@pytest.mark.needs("fine edges")
@pytest.mark.parametrize("jerk", [0, 200])
def test_ramps_keep_the_jerk(jerk):
    session = smooth(jerk).accept(p.MotorMove(1, 4000)).wait_idle()
    assert len(session.steps(1)[0]) == 4000
    steepest, acceleration = steepest_change(session)
    if jerk:
        assert steepest < jerk * 1000 * 1.3
    else:
        assert steepest > 1_000_000  # a corner
    assert acceleration < 40000 * 1.1


def moved_and_stopped(jerk, after_s, request, target=4000, stops=1):
    """Return the session of a move that is stopped after a time, and how long the stop took."""
    session = smooth(jerk).accept(p.MotorMove(1, target)).run(after_s)
    asked = session.now
    for _ in range(stops):
        session.accept(request).run(0.02)
    session.wait_idle()
    return session, session.steps(1)[0][-1] - asked


@pytest.mark.needs("fine edges")
@pytest.mark.parametrize("request_", [p.MotorStop(1), p.MotorStopAll()], ids=["STOP", "STOP_ALL"])
@pytest.mark.parametrize("target", [4000, -4000])
@pytest.mark.parametrize("after_s", [0.06, 0.12, 0.2, 0.3, 0.45, 0.6, 0.7])
def test_a_stop_keeps_the_jerk(after_s, target, request_):
    """In acceleration, cruising or deceleration, the motor comes to rest at once, and never past
    its target."""
    session, took = moved_and_stopped(200, after_s, request_, target)
    jerk, acceleration = steepest_change(session)
    assert jerk < 200_000 * 1.3
    assert acceleration < 40_000 * 1.05
    _, signs = session.steps(1)
    assert set(signs) == {1 if target > 0 else -1}
    assert len(signs) == abs(session.position(1)) <= 4000
    # at most: lose the acceleration, then a ramp of A/j + v/A, after the twelve ticks that a plan
    # waits
    assert took < 0.2 + 0.2 + 0.25 + 0.02


def test_stops_without_a_jerk_limit_and_hard_ones_are_immediate():
    session, took = moved_and_stopped(0, 0.35, p.MotorStop(1))
    assert took < 0.26  # v/A
    assert steepest_change(session)[0] > 1_000_000
    session, took = moved_and_stopped(200, 0.35, p.MotorStopAll(), stops=2)
    assert took < 0.02 + 0.07  # the second one is four times as steep
    assert steepest_change(session)[0] > 1_000_000


@pytest.mark.needs("prompt")
def test_a_stop_asked_for_again_takes_no_longer():
    session, once = moved_and_stopped(200, 0.5, p.MotorStop(1), 20000)
    other, thrice = moved_and_stopped(200, 0.5, p.MotorStop(1), 20000, stops=3)
    assert (once, session.position(1)) == (thrice, other.position(1))
    assert 0.44 < once < 0.48  # A/j + v/A, and the time until the plan begins


@pytest.mark.needs("fine edges")
def test_a_jog_let_go_keeps_the_jerk():
    session = smooth(200, jog_timeout_ms=300)
    session.accept(p.MotorJog(1, 10000, HIGHEST)).wait_idle()
    assert 1000 < len(session.steps(1)[0]) == session.position(1)
    assert steepest_change(session)[0] < 200_000 * 1.3


def test_a_move_may_follow_a_stop_under_way():
    session = smooth(200).accept(p.MotorConfigure(1, 1 | COUPLE))
    rng = random.Random(5)
    for _ in range(30):
        session.accept(p.MotorMove(1, rng.randint(-5000, 5000))).run(rng.random() * 0.5)
        session.accept(p.MotorStop(1)).run(rng.random() * 0.3)
    session.accept(p.MotorMove(1, 77)).wait_idle()
    assert session.position(1) == session.position(2) == session.made(1) == 77
    assert session.steps(1)[1].tolist() == session.steps(2)[1].tolist()


@pytest.mark.parametrize("jerk", [200, 2000])
def test_retarget_near_a_soft_limit(jerk):
    """A motor that slows down to its limit and gets a target behind it comes to rest before the
    limit, then turns."""
    session = smooth(jerk).accept(p.MotorSetLimits(1, 0, 0, 1, 6000))
    for wait in (0.4, 0.5, 0.6, 0.7, 0.8):
        session.accept(p.MotorMove(1, 6000)).run(wait)
        session.accept(p.MotorMove(1, 1000)).wait_idle()
        assert session.position(1) == session.made(1) == 1000
        _, signs = session.steps(1)
        assert np.cumsum(signs).max() <= 6000


# --------------------------------------------------------------- the ends of the range of positions


@pytest.mark.each_processor
@pytest.mark.parametrize("flags", [1, 1 | COUPLE, 1 | REVERSED])
@pytest.mark.parametrize("backlash", [0, 24])
def test_a_jog_to_the_last_step_there_is(backlash, flags):
    """Hosts send this for "jog down" and "jog up": the direction is right with any backlash."""
    for target, way in ((LOWEST, -1), (HIGHEST, 1)):
        session = simulated({"motors": [{"backlash": backlash}]})
        session.accept(p.MotorConfigure(1, flags), p.MotorJog(1, 10_000, target)).run(0.3)
        session.accept(p.MotorJog(1, 10_000, target)).run(0.3).wait_idle()
        assert session.position(1) * way > 1000
        assert set(session.steps(1)[1]) == {way}


@pytest.mark.parametrize("jerk", [0, 300])
@pytest.mark.parametrize("backlash", [0, 24])
@pytest.mark.parametrize("way", [1, -1])
def test_up_to_the_end_of_the_range(way, backlash, jerk):
    """The motor's own steps must fit as well: with play the load's range is that much shorter."""
    session = simulated({"motors": [{"backlash": backlash, "jerk": jerk}]})
    end = HIGHEST if way > 0 else LOWEST + backlash
    session.accept(p.MotorResetPosition(1, end - way * 1500))
    for _ in range(12):
        session.accept(p.MotorJog(1, 10_000, HIGHEST if way > 0 else LOWEST)).run(0.1)
    session.wait_idle()
    assert session.position(1) == end
    if backlash and way < 0:
        session.refuse(p.Ack.ERR_SOFT_LOW, p.MotorMove(1, end - 1), p.MotorMove(1, LOWEST))
        session.refuse(
            p.Ack.ERR_RANGE, p.MotorResetPosition(1, end - 1), p.MotorResetPosition(1, LOWEST)
        )
        assert session.position(1) == end
    session.accept(p.MotorMove(1, end - way * 700))
    session.run(0.2).accept(p.MotorStop(1)).wait_idle()
    session.accept(p.MotorMove(1, end)).run(0.3)
    session.accept(p.MotorMove(1, end - way * 900))  # while it slows down to the end
    session.wait_idle().accept(p.MotorMove(1, end))
    for wait in (0.3, 0.1, 0.05, 0.05):
        session.run(wait).accept(p.MotorStop(1))
    session.wait_idle()
    assert (end - session.position(1)) * way >= 0


def test_uploads_keep_to_the_range_the_play_leaves():
    session = simulated({"motors": [{"backlash": 24}]})
    session.accept(p.MotorResetPosition(1, LOWEST + 30))
    session.upload({1: [LOWEST + 30, LOWEST + 23, LOWEST + 23, LOWEST + 23]})
    session.refuse(p.Ack.ERR_RANGE, p.RtRunMove(24000, 1, 4, 500, 500))
