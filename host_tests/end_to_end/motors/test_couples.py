"""Coupled motors (field note 3.1): two motors with one load. They stay together whatever happens,
and each within its limits."""

import itertools

import numpy as np
import pytest

from framestep_tools import payloads as p
from host_tests.end_to_end import realtime
from host_tests.end_to_end.session import (
    assert_no_faster,
    deceleration,
    run_request,
    simulated,
)

COUPLE, REVERSED = 0x10, 0x20
LIMITS = {"estop": "nc", "limits": [{"high": 26, "low": 27}]}


def assert_together(session, sense):
    """Assert that the two motors have made the same steps, at the same times except for
    rounding."""
    times, signs = session.steps(1)
    others, turned = session.steps(2)
    assert (signs == sense * turned).all()
    assert np.abs(times - others).max() < 3e-6


# Settings of two motors in any order: the leader is the faster and steeper one
SETTINGS = [
    p.MotorSetSpeed(1, 20_000, 100_000),
    p.MotorSetSpeed(2, 4_000, 10_000),
    p.MotorSetLimits(1, 1, -5000, 1, 20_000),
    p.MotorSetLimits(2, 1, -3000, 1, 7000),
    p.MotorResetPosition(2, 1000),
]


@pytest.mark.parametrize("flag, sense", [(COUPLE, 1), (REVERSED, -1)])
@pytest.mark.parametrize("at", range(len(SETTINGS) + 1))
def test_the_stricter_setting_counts_in_any_order(at, flag, sense):
    """The speed and acceleration of the slower motor count, and the limits of both, the follower's
    as the leader sees them."""
    session = simulated()
    requests = [*SETTINGS[:at], p.MotorConfigure(1, 1 | flag), *SETTINGS[at:]]
    session.accept(*requests)
    low, high = (-4000, 6000) if sense > 0 else (-5000, 4000)
    session.refuse(p.Ack.ERR_SOFT_UP, p.MotorMove(1, high + 1))
    session.refuse(p.Ack.ERR_SOFT_LOW, p.MotorMove(1, low - 1)).forget()
    session.accept(p.MotorMove(1, high)).wait_idle()
    times, _ = session.steps(1)
    assert_no_faster(times, 4000)
    assert np.ptp(times) == pytest.approx(high / 4000 + 0.4, abs=0.03)
    session.accept(p.MotorMove(1, low)).run(1)
    asked = session.now
    session.accept(p.MotorStop(2)).wait_idle()
    assert deceleration(*session.steps(1), asked + 0.003) == pytest.approx(10_000, rel=0.03)
    for _ in range(30):
        session.accept(p.MotorJog(1, 10_000, -(2**31))).run(0.1)
    session.wait_idle()
    assert session.position(1) == low
    assert_together(session, sense)


@pytest.mark.needs("ramped E-stop", only=("estop",))
@pytest.mark.parametrize("flag, sense", [(COUPLE, 1), (REVERSED, -1)])
@pytest.mark.parametrize(
    "cause", ["estop", "leader's limit", "follower's limit", "two STOP_ALL", "STOP", "port closed"]
)
def test_together_in_every_stop(cause, flag, sense):
    """Alone each would brake differently; and they move on together from there."""
    pin = 26 if sense > 0 or cause != "follower's limit" else 27
    session = simulated(LIMITS)
    for each in "estop", 26, 27:
        session.input(each, 0)
    session.run(0.1).accept(
        p.MotorConfigure(1, 1 | flag),
        p.MotorSetSpeed(1, 9000, 60_000),
        p.MotorSetSpeed(2, 20_000, 9_000),
    )
    if cause.endswith("limit"):
        motor = 1 if cause.startswith("leader") else 2
        session.accept(p.MotorSetLimits(motor, 0, 0, 0, 0, 1))
    for k in range(6):
        session.accept(p.MotorMove(1, 50_000)).run(0.6 + 0.013 * k)
        if cause == "estop":
            session.input("estop", 1)
        elif cause.endswith("limit"):
            session.input(pin, 1)
        elif cause == "port closed":
            session.leave()
        else:
            session.accept(*[p.MotorStopAll()] * 2 if cause == "two STOP_ALL" else [p.MotorStop(1)])
        session.run(1.5)
        if cause == "port closed":
            session.come_back().run(0.1)
        session.input("estop", 0).input(pin, 0).run(0.1)
        assert session.moving == []
        assert_together(session, sense)
        session.accept(p.MotorMove(1, -70 * k)).wait_idle()
        assert session.positions[1] == sense * session.positions[2] == -70 * k
        assert_together(session, sense)
        session.accept(p.MotorMove(1, 0)).wait_idle()


def test_a_follower_cannot_be_asked_and_the_last_motor_has_none(rig):
    rig.refuse(p.Ack.ERR_RANGE, p.MotorConfigure(8, 1 | COUPLE))
    rig.accept(p.MotorConfigure(3, 1 | COUPLE))
    rig.refuse(p.Ack.ERR_GENERAL, p.MotorMove(4, 10), p.MotorJog(4, 100, 10))
    rig.refuse(p.Ack.ERR_RANGE, p.MotorConfigure(4, 1 | COUPLE)).accept(p.MotorMove(3, 1000))
    rig.refuse(p.Ack.ERR_MOVING, p.MotorConfigure(3, 1)).run(0.1)
    rig.accept(p.MotorStop(4)).wait_idle()  # stops both
    assert 0 < rig.position(3) == rig.position(4) < 1000
    rig.accept(p.MotorConfigure(3, 1), p.MotorMove(4, 10)).wait_idle()
    assert rig.position(4) == 10


def test_an_uploaded_move_is_run_together():
    """Positions of the follower do not count."""
    session = simulated()
    session.accept(p.MotorConfigure(1, 1 | REVERSED))
    session.upload({1: 40 * np.arange(25), 2: 7 * np.arange(25)})
    session.play(run_request(24, 1, 25, 300, 300))
    assert len(session.steps(1)[0]) > 960
    assert_together(session, -1)


@pytest.mark.parametrize("flag, sense", [(COUPLE, 1), (REVERSED, -1)])
def test_stops_at_any_moment_leave_no_step_between(flag, sense):
    rng = np.random.default_rng(5)
    session = simulated()
    session.accept(
        p.MotorResetPosition(2, 500),
        p.MotorConfigure(1, 1 | flag),
        p.MotorSetSpeed(1, 23_000, 170_000),
        p.MotorSetSpeed(2, 23_000, 170_000),
    )
    for _ in range(150):
        session.accept(p.MotorMove(1, int(rng.integers(-4000, 4000))))
        session.run(float(rng.uniform(0.005, 0.2)))
        session.accept(*[p.MotorStopAll()] * int(rng.integers(1, 3)))
        session.run(float(rng.choice([0.001, 0.01, 0.3])))
    session.accept(p.MotorMove(1, 333)).wait_idle()
    assert_together(session, sense)
    assert session.position(1) == 333
    assert session.position(2) == 500 + sense * 333


@pytest.mark.parametrize("flag, sense", [(COUPLE, 1), (REVERSED, -1)])
def test_limits_that_leave_no_room(flag, sense):
    """The way back into the range of one is past the limit of the other: nothing moves."""
    session = simulated()
    limits = (1, 0, 0, 0) if sense > 0 else (0, 0, 1, 0)
    session.accept(
        p.MotorConfigure(1, 1 | flag),
        p.MotorSetLimits(2, *limits),
        p.MotorSetLimits(1, 0, 0, 1, -1000),
    )
    session.refuse(p.Ack.ERR_SOFT_LOW, p.MotorMove(1, -500), p.MotorMove(1, -2000))
    session.refuse(p.Ack.ERR_SOFT_UP, p.MotorMove(1, 500))
    for target in (-2000, -500, 500):
        session.accept(p.MotorJog(1, 10_000, target)).run(0.6)
    assert session.made(1) == session.made(2) == 0


def test_a_disabled_partner_keeps_both_still():
    """If one of them had no power, the other would pull at the load: the leader is refused, and
    nothing is switched on."""
    session = simulated()
    session.upload({1: [0, 10, 20], 3: [0, 10, 20]})
    session.accept(p.MotorConfigure(1, 1 | COUPLE), p.MotorConfigure(2, 0), p.MotorConfigure(3, 1))
    session.forget()
    session.refuse(
        p.Ack.ERR_GENERAL, p.MotorMove(1, 100), p.MotorJog(1, 5000, 100), p.MotorMove(2, 100)
    )
    session.accept(p.MotorConfigure(1, 1 | COUPLE), p.RtPositionFrame(1), run_request(end=3))
    session.wait_idle().accept(p.RtGo()).run(3)
    assert session.made(3) >= 20
    assert session.made(1) == session.made(2) == 0
    assert not any(level for _, level in realtime.edges(session, "enable2"))
    session.accept(p.MotorConfigure(2, 1), p.MotorMove(1, 100)).wait_idle()
    assert session.made(1) == session.made(2) == 100


def test_a_follower_is_not_switched_off_in_motion():
    session = simulated()
    session.accept(p.MotorConfigure(1, 1 | COUPLE), p.MotorMove(1, 3000)).run(0.2)
    session.refuse(
        p.Ack.ERR_MOVING, p.MotorConfigure(2, 0), p.MotorConfigure(1, 0), p.MotorResetPosition(2, 5)
    )
    session.wait_idle()
    assert session.positions[2] == 3000


def test_a_run_keeps_the_followers_limits_and_speed():
    session = simulated()
    session.accept(p.MotorSetSpeed(1, 20_000, 100_000), p.MotorConfigure(1, 1 | REVERSED))
    session.upload({1: [40 * k for k in range(25)]})
    session.accept(p.MotorSetLimits(2, 1, -900, 0, 0))
    session.refuse(p.Ack.ERR_SOFT_UP, run_request(end=25))
    session.accept(p.MotorSetLimits(2, 1, -2000, 0, 0), p.MotorSetSpeed(2, 900, 100_000))
    session.refuse(p.Ack.ERR_RANGE, run_request(end=25))
    session.accept(p.MotorSetSpeed(2, 9000, 100_000), run_request(end=25)).wait_idle()
    session.accept(p.RtGo()).run(0.7)
    session.accept(p.MotorStop(2))  # a STOP of the follower ends the run like the leader's
    session.run(1.5)
    assert session.moving == []
    assert 0 < session.position(1) < 960
    assert_together(session, -1)


def test_the_stricter_jerk():
    for jerks in itertools.permutations([0, 200]):
        session = simulated({"motors": [{"jerk": jerk} for jerk in jerks]})
        session.accept(p.MotorConfigure(1, 1 | COUPLE), p.MotorMove(1, 2000)).wait_idle()
        # 2·(v/a + a/j) + distance at full speed
        assert np.ptp(session.steps(1)[0]) == pytest.approx(
            2000 / 5000 + 5000 / 20000 + 20000 / 200e3, abs=0.06
        )


@pytest.mark.each_processor
def test_coupled_at_the_ends_of_the_range():
    session = simulated()
    session.accept(p.MotorResetPosition(1, 2**31 - 1), p.MotorResetPosition(2, -(2**31)))
    session.refuse(p.Ack.ERR_RANGE, p.MotorConfigure(1, 1 | COUPLE))
    session.refuse(p.Ack.ERR_RANGE, p.MotorConfigure(1, 1 | REVERSED))  # no room for half a step
    session.accept(p.MotorResetPosition(2, -(2**31) + 1), p.MotorConfigure(1, 1 | REVERSED))
    session.refuse(p.Ack.ERR_RANGE, p.MotorResetPosition(2, 1), p.MotorResetPosition(2, -(2**31)))
    session.accept(p.MotorMove(1, 2**31 - 500)).wait_idle()
    assert session.positions[1] == 2**31 - 500
    assert session.positions[2] == -(2**31) + 500
    for _ in range(5):
        session.accept(p.MotorJog(1, 10_000, 2**31 - 1)).run(0.1)
    session.wait_idle()
    assert session.positions[1] + session.positions[2] == 0
    assert_together(session, -1)
