"""JOG on the host simulation: speed, timeout, turning, soft limits in motion."""

import numpy as np
import pytest

from framestep_tools import payloads as p
from host_tests.end_to_end.session import assert_within, deceleration, simulated

FARTHEST, LOWEST = 2**31 - 1, -(2**31)


def jog_for(rig, seconds, request, every=0.1):
    """Jog as Dragonframe does while a key is held."""
    until = rig.now + seconds
    while rig.now < until:
        rig.accept(request).run(every)


@pytest.mark.needs("fine edges")
@pytest.mark.parametrize(
    ("speed", "share"), [(10000, 1.0), (5000, 0.5), (300, 0.03), (100, 0.01), (1, 0.01)]
)
def test_jog_speed(rig, speed, share):
    """Field note 4.2: velocity and acceleration scaled, with a small minimum."""
    rig.speed(1, 8000, 16000)
    jog_for(rig, 1.5, p.MotorJog(1, speed, FARTHEST))
    rig.accept(p.MotorStop(1)).wait_idle()
    times, _ = rig.steps(1)
    assert 1 / np.diff(times).min() == pytest.approx(8000 * share, rel=3e-3)
    # after n steps of the ramp: sqrt(2·n / a)
    n = int(0.8 * 8000 * share / (2 * 16000 / 8000))
    for k in (n // 4, n):
        assert times[k] - times[0] == pytest.approx(
            ((2 * k + 2) ** 0.5 - 2**0.5) / (16000 * share) ** 0.5, rel=2e-3, abs=1e-3
        )


def test_jog_ends_without_another(rig):
    """500 ms after the last request it ramps down."""
    jog_for(rig, 1.0, p.MotorJog(1, 10000, FARTHEST), every=0.2)
    rig.accept(p.MotorJog(1, 10000, FARTHEST))
    asked = rig.now
    rig.run(0.45)
    times, signs = rig.steps(1)
    assert np.diff(times[-20:]).max() < 1 / 4900, "slows down too soon"
    rig.wait_idle()
    times, signs = rig.steps(1)
    assert times[-1] - asked == pytest.approx(0.5 + 5000 / 20000, abs=0.012)
    assert deceleration(times, signs, asked + 0.51) == pytest.approx(20000, rel=0.01)
    assert rig.position(1) == signs.sum()


@pytest.mark.parametrize(("timeout_ms", "ends"), [(0, False), (200, True)])
def test_jog_timeout_of_the_rig_file(timeout_ms, ends):
    rig = simulated({"jog_timeout_ms": timeout_ms})
    rig.accept(p.MotorJog(1, 10000, FARTHEST)).run(3)
    assert (rig.moving == []) == ends
    assert rig.made(1) == pytest.approx(5000 * 0.2 if ends else 5000 * 2.9, abs=400)


def test_jog_reaches_its_destination(rig):
    """A jog repeated there gets its answer and moves nothing."""
    jog_for(rig, 1.2, p.MotorJog(1, 10000, 2500))
    rig.wait_idle()
    assert rig.position(1) == rig.made(1) == 2500
    rig.accept(p.MotorJog(1, 10000, 2500))
    assert rig.moving == []


def test_jog_repeated_is_one_motion(rig):
    """Repetitions do not disturb it: the edges match a single request's."""
    other = simulated({"jog_timeout_ms": 0})
    rig.board.run_until(100_000_000)
    other.board.run_until(100_000_000)
    jog_for(rig, 0.8, p.MotorJog(1, 7000, FARTHEST), every=0.03)
    other.accept(p.MotorJog(1, 7000, FARTHEST)).run(0.8)
    count = len(rig.steps(1)[0]) - 20
    assert count > 1500
    assert (rig.steps(1)[0][:count] == other.steps(1)[0][:count]).all()


def test_jog_turns_by_ramps(rig):
    """Field note 4.2: against its direction the motor ramps to a stop, then turns."""
    jog_for(rig, 0.8, p.MotorJog(1, 10000, FARTHEST))
    jog_for(rig, 1.0, p.MotorJog(1, 10000, LOWEST))
    jog_for(rig, 0.4, p.MotorJog(1, 4000, LOWEST))
    rig.accept(p.MotorStop(1)).wait_idle()
    times, signs = rig.steps(1)
    assert_within(times, signs, 5000, 20000)
    turns = np.flatnonzero(np.diff(signs))
    assert len(turns) == 1
    gaps = np.diff(times)
    # n steps before and after the turn last as long as the ramp needs: sqrt(2n/a) each
    at = turns[0]
    for n in (50, 300):
        assert times[at] - times[at - n] == pytest.approx((2 * n / 20000) ** 0.5, abs=0.012)
        assert times[at + 1 + n] - times[at + 1] == pytest.approx((2 * n / 20000) ** 0.5, abs=0.012)
    assert gaps[at] < 0.03
    assert rig.position(1) == signs.sum()


def test_jog_is_held_by_soft_limits(both):
    both.accept(p.MotorSetLimits(1, 1, -1200, 1, 1500))
    for destination, ends in ((FARTHEST, 1500), (LOWEST, -1200), (1600, 1500), (2**30, 1500)):
        jog_for(both, 1.5, p.MotorJog(1, 10000, destination))
        both.wait_idle()
        assert both.position(1) == ends
        assert both.made(1) == ends
    highest = np.cumsum(both.steps(1)[1])
    assert highest.max() == 1500
    assert highest.min() == -1200


GENTLER = {
    "a slower jog": [p.MotorJog(1, 500, FARTHEST)],
    "a jog with less acceleration": [
        p.MotorSetSpeed(1, 20000, 2000),
        p.MotorJog(1, 10000, FARTHEST),
    ],
    "a move with less acceleration": [p.MotorSetSpeed(1, 20000, 2000), p.MotorMove(1, 8000)],
    "a stop with less acceleration": [p.MotorSetSpeed(1, 20000, 2000), p.MotorStop(1)],
}


@pytest.mark.needs("prompt", only=("a jog with", "a move with", "a slower", "a stop with"))
@pytest.mark.parametrize("jerk", [0, 300])
@pytest.mark.parametrize("requests", GENTLER.values(), ids=GENTLER)
def test_soft_limits_hold_for_what_is_gentler_under_way(requests, jerk):
    """A motor near its limit can still stop there, whatever is requested meanwhile."""
    rig = simulated({"motors": [{"jerk": jerk}]})
    rig.accept(p.MotorSetSpeed(1, 20000, 40000), p.MotorSetLimits(1, 1, -100_000, 1, 8000))
    jog_for(rig, 0.4, p.MotorJog(1, 10000, FARTHEST))
    rig.accept(p.MotorJog(1, 10000, FARTHEST)).run(0.2)
    assert 5000 < rig.position(1) < 8000
    rig.accept(*requests).wait_idle()
    assert np.cumsum(rig.steps(1)[1]).max() <= 8000


@pytest.mark.parametrize("stop, acceleration", [(p.MotorStop(1), 179), (p.MotorStopAll(), 250)])
def test_a_stop_in_the_slowing_down_to_a_soft_limit_ends_there(stop, acceleration):
    """The kernel's decelerations are whole numbers, so at a low acceleration the stop would take a
    longer way than planned."""
    rig = simulated()
    ramp = 2000**2 // (2 * acceleration)
    rig.accept(p.MotorSetLimits(1, 1, -2 * ramp, 1, 100), p.MotorSetSpeed(1, 2000, acceleration))
    rig.accept(p.MotorMove(1, -2 * ramp)).run(2000 / acceleration * 1.3)
    rig.accept(stop).wait_idle()
    lowest = np.cumsum(rig.steps(1)[1]).min()
    assert -2 * ramp <= lowest <= -2 * ramp + 3 + ramp // 250


UNDER_WAY = {
    "a move": [p.MotorMove(1, 30_000)],
    "a jog": [p.MotorJog(1, 10_000, FARTHEST)],
    "a move that turns": [p.MotorMove(1, -30_000), p.MotorMove(1, 30_000)],
}


@pytest.mark.parametrize("jerk", [0, 300])
@pytest.mark.parametrize("backlash", [0, 40])
@pytest.mark.parametrize("room", [9_000, 1_000], ids=["in time", "too late"])
@pytest.mark.parametrize("requests", UNDER_WAY.values(), ids=UNDER_WAY)
def test_a_soft_limit_set_under_way_holds(requests, room, backlash, jerk):
    """The motor comes to rest on it; if the limit is too near for a stop, it comes back (field note
    4.3)."""
    rig = simulated({"motors": [{"jerk": jerk, "backlash": backlash}], "jog_timeout_ms": 0})
    rig.accept(p.MotorSetSpeed(1, 20_000, 40_000))
    for request in requests:
        rig.accept(request).run(0.3)
    rig.run(0.2)
    limit = rig.position(1) + room
    rig.accept(p.MotorSetLimits(1, 1, -100_000, 1, limit)).wait_idle()
    assert rig.position(1) == limit
    times, signs = rig.steps(1)
    assert_within(times, signs, 20_000, 40_000)
    if room > 5_000:
        assert np.cumsum(signs).max() <= limit
    else:
        stop_s = 20_000 / 40_000 / 2 + 0.05 + (0.2 if jerk else 0)
        assert limit < np.cumsum(signs).max() < limit - room + 20_000 * stop_s
    rig.refuse(p.Ack.ERR_SOFT_UP, p.MotorMove(1, limit + 1))


@pytest.mark.parametrize("stop", [p.MotorStop(1), p.MotorStopAll()])
@pytest.mark.parametrize("jerk", [0, 300])
def test_a_soft_limit_set_in_a_stop_does_not_send_it_on(stop, jerk):
    rig = simulated({"motors": [{"jerk": jerk}]})
    rig.accept(p.MotorSetSpeed(1, 20_000, 40_000), p.MotorMove(1, 30_000)).run(0.4)
    rig.accept(stop).run(0.05)
    limit = rig.position(1) + 12_000
    rig.accept(p.MotorSetLimits(1, 1, -100_000, 1, limit)).wait_idle()
    assert rig.position(1) < limit - 2_000


@pytest.mark.needs("prompt")
def test_a_soft_limit_set_as_it_comes_to_rest_does_not_send_it_on(rig):
    """It is so slow that it rests in the next tick, while its last pulses are queued."""
    rig.accept(p.MotorSetSpeed(1, 62, 1000), p.MotorJog(1, 100, -(2**31))).run(0.1)
    rig.accept(p.MotorStop(1), p.MotorSetLimits(1, 1, -9, 0, 0)).run(0.01)
    assert not rig.moving


def test_limits_of_another_motor_leave_a_move_alone(rig):
    rig.accept(p.MotorMove(1, 3000)).run(0.2)
    rig.accept(p.MotorSetLimits(2, 1, -1, 1, 1), p.MotorSetLimits(1, 1, -1, 1, 3000)).wait_idle()
    assert rig.position(1) == 3000


def test_less_acceleration_waits_for_the_motor_to_stand(rig):
    rig.accept(p.MotorSetSpeed(1, 20000, 40000), p.MotorMove(1, 8000)).run(0.2)
    rig.accept(p.MotorSetSpeed(1, 20000, 2000)).wait_idle()
    fast, _ = rig.steps(1)
    rig.accept(p.MotorMove(1, 0)).wait_idle()
    slow = rig.steps(1)[0][len(fast) :]
    assert np.ptp(fast) == pytest.approx(2 * (8000 / 40000) ** 0.5, rel=0.05)
    assert np.ptp(slow) == pytest.approx(2 * (8000 / 2000) ** 0.5, rel=0.05)


def test_jog_past_a_limit_goes_back_only(rig):
    rig.accept(p.MotorResetPosition(1, 3000), p.MotorSetLimits(1, 1, 0, 1, 1000))
    jog_for(rig, 0.3, p.MotorJog(1, 10000, FARTHEST))
    rig.wait_idle()
    assert rig.position(1) == 3000, "moved further out"
    jog_for(rig, 2.0, p.MotorJog(1, 10000, LOWEST))
    rig.wait_idle()
    assert rig.position(1) == 0


def test_jog_refused(both):
    both.refuse(
        p.Ack.ERR_RANGE, p.MotorJog(1, 0, 100), p.MotorJog(1, 10001, 100), p.MotorJog(1, 65535, 100)
    )
    both.refuse(
        p.Ack.ERR_RANGE, p.MotorJog(0, 100, 100), p.MotorJog(9, 100, 100), p.MotorJog(255, 100, 100)
    )
    both.run(0.2)
    assert both.moving == []
    assert both.made(1) == 0


def test_refused_jog_does_not_prolong(rig):
    rig.accept(p.MotorJog(1, 10000, FARTHEST))
    asked = rig.now
    for _ in range(6):
        rig.run(0.1).refuse(p.Ack.ERR_RANGE, p.MotorJog(1, 0, FARTHEST))
    rig.wait_idle()
    assert rig.steps(1)[0][-1] - asked == pytest.approx(0.75, abs=0.012)


@pytest.mark.each_processor
def test_move_after_jog(rig):
    """A MOVE replaces a jog, and no jog's time-out ends it."""
    rig.accept(p.MotorJog(1, 10000, FARTHEST)).run(0.4)
    rig.accept(p.MotorMove(1, 6000)).wait_idle()
    assert rig.position(1) == rig.made(1) == 6000
