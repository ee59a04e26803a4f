"""What follows a stop by the kernel (a hard stop, an E-stop, a limit switch, a fault): limits hold
for any request.

The kernel's stop does not limit the jerk; this must not enter the plan of the next motion.
"""

import numpy as np
import pytest

from framestep_tools import payloads as p
from host_tests.end_to_end.session import assert_no_faster, deceleration, simulated

VELOCITY, ACCELERATION = 5000, 20000


def speeding(rig, seconds=1.0):
    """Return a session in which motor 1 runs at full speed toward a far step."""
    session = simulated(rig)
    session.speed(1, VELOCITY, ACCELERATION).accept(p.MotorMove(1, 1_000_000)).run(seconds)
    return session


def assert_calm(session, before, target, overshoot):
    """Assert that from the time `before` on the motor is never too fast, and at most `overshoot`
    steps past the target."""
    times, signs = session.steps(1)
    assert_no_faster(times, VELOCITY)
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


HARD = [p.MotorStopAll(), p.MotorStopAll()]


@pytest.mark.parametrize("wait", [0.001, 0.01, 0.03, 0.05, 0.062, 0.064, 0.066])
@pytest.mark.parametrize("jerk", [0, 1, 100, 10_000])
@pytest.mark.parametrize("way", [50, -50, 3000, -3000])
def test_a_move_after_a_hard_stop(jerk, wait, way):
    """With any jerk limit the motor goes no further than it needs to stop, and never faster than
    allowed."""
    session = speeding({"motors": [{"jerk": jerk}]}, 8.0 if jerk == 1 else 1.0)
    session.accept(*HARD)
    asked = session.now
    session.run(wait)
    target = session.position(1) + way
    session.accept(p.MotorMove(1, target)).wait_idle()
    # v²/2a, at the motor's own deceleration
    assert_calm(session, asked, target, VELOCITY**2 / (2 * ACCELERATION) + 5)


@pytest.mark.parametrize("jerk", [1, 100])
def test_any_stops_and_moves(jerk):
    """In quick succession at any time: the motor is never too fast, and ends at its last
    target."""
    rng = np.random.default_rng(jerk)
    session = simulated({"motors": [{"jerk": jerk}]})
    session.speed(1, VELOCITY, ACCELERATION).accept(p.MotorSetLimits(1, 1, -6000, 1, 6000))
    for _ in range(60):
        for request in rng.choice(
            np.array(
                [p.MotorStopAll(), p.MotorStop(1), p.MotorMove(1, 0), p.MotorJog(1, 9000, 10**6)]
            ),
            3,
        ):
            if isinstance(request, p.MotorMove):
                request = p.MotorMove(1, int(rng.integers(-6000, 6001)))
            session.ask(request)
            session.run(float(rng.choice([0.001, 0.005, 0.02, 0.1, 0.4])))
    session.accept(p.MotorMove(1, 123)).wait_idle()
    times, signs = session.steps(1)
    places = np.cumsum(signs)
    assert_no_faster(times, VELOCITY)
    assert np.abs(places).max() <= 6000
    assert session.position(1) == places[-1] == 123


@pytest.mark.parametrize("jerk", [0, 100])
def test_a_move_as_a_stop_ends(jerk):
    """In the last ticks of a stop, or of any motion, a plan would not be ready in time: it waits
    until the motor rests."""
    for wait in np.arange(0, 0.025, 0.001):
        session = simulated({"motors": [{"jerk": jerk}]})
        session.speed(1, VELOCITY, ACCELERATION).accept(p.MotorMove(1, 1000))
        session.run(0.03).accept(*HARD).run(float(wait))
        session.accept(p.MotorMove(1, -20))
        assert session.moving == [1]
        session.wait_idle()
        assert session.position(1) == session.made(1) == -20


def test_a_hard_stop_as_a_slow_stop_ends():
    """A stop that ends between two steps, close to one, is put on that one within a tick. A hard
    stop at this moment does not take that for a velocity."""
    for wait in range(8, 18):
        session = simulated({"motors": [{"jerk": 1_000_000}]})
        session.speed(1, 10, 55).accept(p.MotorJog(1, 50, -(2**31))).run(0.45)
        session.accept(p.MotorStop(1))
        session.run(wait / 1000).accept(*HARD).wait_idle()
        assert session.position(1) == 0, wait


@pytest.mark.parametrize("jerk", [0, 100])
@pytest.mark.parametrize("factor", [1, 4])
def test_the_second_stop_is_the_kernels(factor, jerk):
    """Field note 4.4: by the motor's deceleration times the factor, from the next tick on, even if
    the factor is 1."""
    session = speeding({"hard_stop_factor": factor, "motors": [{"jerk": jerk}]})
    session.accept(p.MotorStopAll()).run(0.05)
    session.accept(p.MotorStopAll())
    asked = session.now
    session.wait_idle()
    times, signs = session.steps(1)
    assert deceleration(times, signs, asked + 0.003) == pytest.approx(
        factor * ACCELERATION, rel=0.03
    )


def test_a_slow_jog_stays_slow_when_it_turns():
    """With a jerk limit a motor that slows down comes to rest before it turns; its share is not
    lost."""
    session = simulated({"motors": [{"jerk": 200}]})
    session.speed(1, VELOCITY, ACCELERATION).accept(p.MotorSetLimits(1, 0, 0, 1, 1500))
    session.accept(p.MotorMove(1, 1500)).run(0.45)
    for _ in range(12):
        assert session.code(p.MotorJog(1, 1000, -(2**31))) == p.Ack.OK
        session.run(0.1)
    session.accept(p.MotorStop(1)).wait_idle()
    times, signs = session.steps(1)
    down = times[signs < 0]
    assert len(down) > 100
    assert np.diff(down).min() >= 10 / VELOCITY - 5e-6
