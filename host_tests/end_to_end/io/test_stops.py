"""What follows a stop by the kernel (a hard stop, an E-stop, a limit switch, a fault): limits hold,
whatever is asked.

The kernel's stop keeps no limit of the jerk; that must not get into the plan of what comes after
it.
"""

import numpy as np
import pytest

from framestep_tools.payloads import (
    Ack,
    MotorJog,
    MotorMove,
    MotorSetLimits,
    MotorStop,
    MotorStopAll,
)
from host_tests.end_to_end.session import deceleration, simulated

VELOCITY, ACCELERATION = 5000, 20000


def speeding(rig, seconds=1.0):
    """A session in which motor 1 has run at full speed for some time, toward a far step."""
    session = simulated(rig)
    session.speed(1, VELOCITY, ACCELERATION)
    session.ask(MotorMove(1, 1_000_000))
    session.run(seconds)
    return session


def assert_calm(session, before, target, overshoot):
    """From the moment `before` on: never too fast, and by `overshoot` steps past the target at
    most."""
    times, signs = session.steps(1)
    assert np.diff(times).min() >= 1 / VELOCITY - 5e-6
    places = np.cumsum(signs)
    at = places[np.searchsorted(times, before)]
    low, high = sorted((at, target))
    assert (
        low - overshoot
        <= places[times > before].min()
        <= places[times > before].max()
        <= high + overshoot
    )
    assert session.position(1) == places[-1] == target


HARD = [MotorStopAll(), MotorStopAll()]


@pytest.mark.parametrize("wait", [0.001, 0.01, 0.03, 0.05, 0.062, 0.064, 0.066])
@pytest.mark.parametrize("jerk", [0, 1, 100, 10_000])
@pytest.mark.parametrize("way", [50, -50, 3000, -3000])
def test_a_move_after_a_hard_stop(jerk, wait, way):
    """Whatever the jerk limit: no farther than the motor needs to stop, and never faster than it
    may be."""
    session = speeding({"motors": [{"jerk": jerk}]}, 8.0 if jerk == 1 else 1.0)
    session.accept(*HARD)
    asked = session.now
    session.run(wait)
    target = session.position(1) + way
    session.ask(MotorMove(1, target))
    session.wait_idle()
    # v²/2a, at the motor's own deceleration
    assert_calm(session, asked, target, VELOCITY**2 / (2 * ACCELERATION) + 5)


@pytest.mark.parametrize("jerk", [1, 100])
def test_any_stops_and_moves(jerk):
    """One upon the other at any moment: the motor is never too fast, and in the end where it was
    sent last."""
    rng = np.random.default_rng(jerk)
    session = simulated({"motors": [{"jerk": jerk}]})
    session.speed(1, VELOCITY, ACCELERATION)
    session.accept(MotorSetLimits(1, 1, -6000, 1, 6000))
    for _ in range(60):
        for request in rng.choice(
            np.array([MotorStopAll(), MotorStop(1), MotorMove(1, 0), MotorJog(1, 9000, 10**6)]), 3
        ):
            if isinstance(request, MotorMove):
                request = MotorMove(1, int(rng.integers(-6000, 6001)))
            session.ask(request)
            session.run(float(rng.choice([0.001, 0.005, 0.02, 0.1, 0.4])))
    session.ask(MotorMove(1, 123))
    session.wait_idle()
    times, signs = session.steps(1)
    places = np.cumsum(signs)
    assert np.diff(times).min() >= 1 / VELOCITY - 5e-6
    assert np.abs(places).max() <= 6000
    assert session.position(1) == places[-1] == 123


@pytest.mark.parametrize("jerk", [0, 100])
def test_a_move_as_a_stop_ends(jerk):
    """In the last ticks of a stop, and of any motion, a plan would not be made in time: it waits
    for the rest."""
    for wait in np.arange(0, 0.025, 0.001):
        session = simulated({"motors": [{"jerk": jerk}]})
        session.speed(1, VELOCITY, ACCELERATION)
        session.ask(MotorMove(1, 1000))
        session.run(0.03)
        session.accept(*HARD)
        session.run(float(wait))
        session.ask(MotorMove(1, -20))
        assert session.moving == [1]
        session.wait_idle()
        assert session.position(1) == session.made(1) == -20


@pytest.mark.parametrize("jerk", [0, 100])
@pytest.mark.parametrize("factor", [1, 4])
def test_the_second_stop_is_the_kernels(factor, jerk):
    """Field note 4.4: by the motor's deceleration times the factor, from the next tick on, also
    where that is 1."""
    session = speeding({"hard_stop_factor": factor, "motors": [{"jerk": jerk}]})
    session.accept(MotorStopAll())
    session.run(0.05)
    session.accept(MotorStopAll())
    asked = session.now
    session.wait_idle()
    times, signs = session.steps(1)
    assert deceleration(times, signs, asked + 0.003) == pytest.approx(
        factor * ACCELERATION, rel=0.03
    )


def test_a_slow_jog_stays_slow_when_it_turns():
    """With a jerk limit a motor that slows down already comes to rest before it turns; its share is
    not forgotten."""
    session = simulated({"motors": [{"jerk": 200}]})
    session.speed(1, VELOCITY, ACCELERATION)
    session.accept(MotorSetLimits(1, 0, 0, 1, 1500))
    session.ask(MotorMove(1, 1500))
    session.run(0.45)
    for _ in range(12):
        assert session.code(MotorJog(1, 1000, -(2**31))) == Ack.OK
        session.run(0.1)
    session.accept(MotorStop(1))
    session.wait_idle()
    times, signs = session.steps(1)
    down = times[signs < 0]
    assert len(down) > 100
    assert np.diff(down).min() >= 10 / VELOCITY - 5e-6
