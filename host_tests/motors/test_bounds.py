"""Stops within a motor's bounds."""

from array import array

from hypothesis import assume, given
from hypothesis import strategies as st

from framestep.motors import bounds
from framestep.motors.backlash import BACKLASH, make_backlash
from framestep.motors.rates import kernel_rate
from framestep.pulse import stepper
from host_tests.pulse.engine import ONE

FASTEST = 400_000


class Motion:
    """A motor under way, with a bound ahead of it."""

    def __init__(self, velocity, part=0.0, backlash=0, on_path=True):
        """velocity: steps/s, with a sign. part: of a step that it is beyond its position."""
        self.on_path = on_path
        self.block = array("i", [0] * stepper.BLOCK_WORDS)
        self.block[stepper.VELOCITY] = round(velocity / 1000 * ONE)
        self.block[stepper.FRACTION] = round(part * ONE)
        self.block[stepper.POSITION] = 1000
        self.backlash = make_backlash(self.block)
        self.backlash[BACKLASH] = backlash
        self.bounds = array("i", [-(2**31), 2**31 - 1, *[0] * (bounds.BOUNDS_WORDS - 2)])

    def bound(self, room):
        """Set a bound this many steps ahead."""
        if self.block[stepper.VELOCITY] < 0:
            self.bounds[bounds.LOWER] = 1000 - room + self.backlash[BACKLASH]
        else:
            self.bounds[bounds.UPPER] = 1000 + room

    def rate(self, acceleration):
        """Return the deceleration as a multiple of the set one."""
        rate = kernel_rate(acceleration)
        return bounds.stop_rate(self.block, self.bounds, rate, self.on_path) / rate

    def way(self, acceleration):
        """Return how many steps from its position the stop ends, by the kernel's arithmetic."""
        rate = kernel_rate(acceleration)
        rate = bounds.stop_rate(self.block, self.bounds, rate, self.on_path)
        velocity = abs(self.block[stepper.VELOCITY])
        part = self.block[stepper.FRACTION]
        ticks = velocity // rate
        way = ticks * velocity - rate * ticks * (ticks + 1) // 2
        return (way + (part if self.block[stepper.VELOCITY] > 0 else -part)) / ONE


velocities = st.floats(101, FASTEST) | st.floats(101, 500)


@given(
    velocities, st.sampled_from([1, -1]), st.floats(-0.5, 0.5), st.sampled_from([0, 7]),
    st.floats(1, 3.9), st.integers(10, 1_000_000),
)  # fmt: skip
def test_a_stop_ends_within_the_bound(velocity, sign, part, backlash, excess, acceleration):
    """excess: how many times the acceleration a stop takes."""
    room = int(velocity**2 / 2 / acceleration / excess)
    assume(room > 2 and velocity / acceleration < 60)
    motion = Motion(sign * velocity, part, backlash)
    motion.bound(room)
    way = motion.way(acceleration)
    assert room * 0.9 - 3 < way < room + 1


@given(velocities, st.integers(100, 4_000_000), st.floats(1.05, 1e6))
def test_a_bound_beyond_the_stop_changes_nothing(velocity, acceleration, more):
    motion = Motion(velocity)
    motion.bound(min(int(velocity**2 / 2 / acceleration * more) + 2, 2**31 - 2000))
    assert motion.rate(acceleration) == 1


def test_a_motor_outside_stops_as_usual():
    motion = Motion(5000)
    motion.bound(-1)
    assert motion.rate(20_000) == 1


@given(st.floats(101, FASTEST), st.integers(10, 4_000_000))
def test_at_most_four_times_as_steep(velocity, acceleration):
    """That is for a bound that has been set in motion."""
    motion = Motion(velocity)
    motion.bound(0)
    motion.bounds[bounds.IN_MOTION] = 1
    assert motion.rate(acceleration) <= 4


@given(st.floats(1, FASTEST), st.integers(3, 1000), st.sampled_from([1, -1]))
def test_as_steep_as_the_path_that_turns_before_the_bound(velocity, room, sign):
    motion = Motion(sign * velocity)
    motion.bound(room)
    assert motion.way(10) < room + 1


@given(st.floats(1, 99), st.sampled_from([1, -1]), st.sampled_from([-1, 0, 2000]))
def test_a_slow_motor_stops_at_once(velocity, sign, room):
    motion = Motion(sign * velocity)
    motion.bound(room)
    assert motion.way(10) < 1


@given(st.floats(1, FASTEST), st.integers(1, 4_000_000), st.integers(0, 5000))
def test_away_from_a_path_only_the_rounding_is_made_up_for(velocity, acceleration, room):
    motion = Motion(velocity, on_path=False)
    motion.bound(room)
    rate = kernel_rate(acceleration)
    assert motion.rate(acceleration) in (1, (rate + 1) / rate)


@given(st.floats(1, 20_000), st.integers(1, 4_000_000), st.sampled_from([1, -1]))
def test_a_slowing_down_to_the_bound_ends_there(velocity, acceleration, sign):
    """Away from a path, and at any velocity."""
    room = int(velocity**2 / 2 / acceleration)
    assume(0 < room < 2**24 and velocity / acceleration < 60)
    motion = Motion(sign * velocity, on_path=False)
    motion.bound(room)
    assert motion.way(acceleration) < room + 2
