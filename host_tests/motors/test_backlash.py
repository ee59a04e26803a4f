"""Backlash: the motor moves so that the load is at the requested position.

The gear is modeled here independently: the load is between the motor's position and the backlash
above it, and the motor drags it at either end.
"""

from array import array
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from framestep.motors import backlash as b
from framestep.motors.samples import sample
from framestep.moves.path import path_check
from framestep.pulse import stepper
from host_tests.motors.test_axes import Rig, word

STEPS = 30
HALF = 0x8000  # half a step, Q16
steps = st.integers(0, 10_000)
positions = st.lists(st.integers(-50_000, 50_000), min_size=1, max_size=20)
UP, EITHER, DOWN = 1, 0, -1
LOWEST, HIGHEST = -(2**31), 2**31 - 1


def gear(load, motor, backlash):
    """Return the load's position after the motor has gone to `motor`."""
    return min(max(load, motor), motor + backlash)


class Gear:
    """A motor whose load is at `load`, and a plan that begins there."""

    def __init__(self, backlash=STEPS, load=0, motor=None):
        self.block = array("i", [0] * stepper.BLOCK_WORDS)
        self.block[stepper.POSITION] = load if motor is None else motor
        self.backlash = b.make_backlash(self.block)
        self.backlash[b.BACKLASH], self.backlash[b.LOAD] = backlash, load
        self.backlash.plan_from(self.backlash, b.LOAD)

    @property
    def motor(self):
        return self.backlash[b.MOTOR]

    @property
    def offset(self):
        return self.backlash[b.OFFSET]

    @property
    def load(self):
        return self.backlash[b.PLANNED_LOAD]

    def turn_to(self, target, part=0):
        self.backlash.turn_to(word(target), 1, part)
        return self.motor

    def coast_to(self, target, part=0):
        self.backlash.coast_to(word(target), 1, part)
        return self.motor

    def take_up(self, direction):
        self.backlash.take_up(direction)
        return self.motor

    def cut(self, motor, part):
        found = array("i", [7, 0])
        at = array("i", [0] * stepper.AT_WORDS)
        at[stepper.AT_STEP], at[stepper.AT_PART] = motor, part
        return self.backlash.plan_from_cut(at, found, 1), found[1]

    def go(self, motor):
        """Move the motor there, and return the load's position."""
        self.block[stepper.POSITION] = motor
        self.backlash.refresh()
        return self.backlash[b.LOAD]


# ------------------------------------------------------------------------------ turning


@pytest.mark.parametrize(
    "targets, motor",
    [
        ([10, 20], [10, 20]),
        ([-10], [-40]),
        ([-10, -20], [-40, -50]),  # it is taken up once
        ([-10, 5], [-40, 5]),
        ([-10, -10], [-40, -40]),  # the load is already there
        ([0], [0]),
    ],
)
def test_the_motor_takes_up_the_backlash_where_the_load_turns(targets, motor):
    plan = Gear()
    assert [plan.turn_to(target) for target in targets] == motor


@given(steps, positions)
def test_the_load_comes_to_each_target(backlash, targets):
    plan, load = Gear(backlash), 0
    for target in targets:
        load = gear(load, plan.turn_to(target), backlash)
        assert load == target == plan.load
        assert plan.motor == load + plan.offset
        assert plan.offset in (0, -backlash)


@given(steps)
def test_at_the_ends_of_the_range(backlash):
    lowest = LOWEST + backlash
    plan = Gear(backlash, HIGHEST)
    assert plan.turn_to(lowest) == LOWEST
    assert plan.turn_to(HIGHEST) == HIGHEST


@pytest.mark.parametrize(
    "part, offset, load", [(HALF - 1, -STEPS, -1), (HALF, -STEPS, 0), (0, -STEPS, -1)]
)
def test_the_nearest_step_decides_in_which_direction_a_target_lies(part, offset, load):
    """From above, where half a step more than -1 is 0; the motor goes to the whole step."""
    plan = Gear(load=5)
    assert plan.turn_to(-1, part) == -1 + offset
    assert (plan.offset, plan.load) == (offset, load)
    assert plan.turn_to(load - 1, HALF) == load - 1 - STEPS, "half a step below it: it is there"
    assert plan.turn_to(load, HALF) == load, "half a step above it: it turns"


def test_a_ramp_leaves_the_backlash_as_it_is():
    plan = Gear()
    assert [plan.coast_to(-10), plan.coast_to(10)] == [-10, 10]
    assert [plan.turn_to(5), plan.coast_to(10), plan.coast_to(0)] == [-25, -20, -30]
    assert plan.turn_to(2) == 2, "which ends where the next target turns the load"
    plan.coast_to(7, HALF)
    assert (plan.load, plan.motor) == (8, 7)


@pytest.mark.parametrize("direction, motor", [(UP, 4), (EITHER, -26), (DOWN, -26)])
def test_backlash_is_taken_up_for_a_direction_without_moving_the_load(direction, motor):
    plan = Gear(load=5)
    load = gear(5, plan.turn_to(4), STEPS)
    assert plan.take_up(direction) == motor
    assert gear(load, motor, STEPS) == plan.load == 4
    assert Gear(load=5).take_up(DOWN) == 5 - STEPS


def test_a_plan_goes_on_from_where_the_motor_is_cut_off():
    plan = Gear()
    plan.turn_to(-10)
    assert plan.cut(-35, HALF) == (HALF, -5)
    assert plan.load == -4
    assert plan.turn_to(-5, 0) == -5 - STEPS
    assert plan.turn_to(-4, 0) == -4


# ------------------------------------------------------------------------------ dragging


@given(steps, positions)
def test_the_load_is_dragged(backlash, motor):
    driven, load = Gear(backlash), 0
    for position in motor:
        load = gear(load, position, backlash)
        assert driven.go(position) == load
        assert driven.backlash.offset() == position - load


def test_the_load_is_dragged_at_the_ends_of_the_range():
    driven = Gear(10_000, load=LOWEST + 10_000, motor=LOWEST)
    assert driven.go(LOWEST + 1) == LOWEST + 10_000
    driven = Gear(10_000, load=HIGHEST, motor=HIGHEST)
    assert driven.go(HIGHEST - 10_001) == HIGHEST - 1


@pytest.mark.parametrize(
    "motor, directions",
    [(0, {UP, EITHER}), (-1, {EITHER}), (-STEPS, {DOWN, EITHER}), (1 - STEPS, {EITHER})],
)
def test_for_which_directions_it_is_taken_up(motor, directions):
    driven = Gear(motor=motor)
    assert {way for way in (UP, EITHER, DOWN) if driven.backlash.taken_up(way)} == directions


def test_without_backlash_it_is_taken_up_for_any_direction():
    assert all(Gear(0).backlash.taken_up(way) for way in (UP, EITHER, DOWN))


# ------------------------------------------------------------------------------ all its users


def with_backlash(steps=STEPS):
    rig = Rig()
    rig.axes.set_backlash(0, steps)
    return rig, rig[0]


def loads(axis):
    found = word(0)
    axis.position_to(found, 1)
    return found[1]


def meet(rig, axis, limit=20_000):
    """Run until a target is met, including what follows from it."""
    for _ in range(limit):
        rig.run(1)
        if not axis.moving:
            return
    raise AssertionError("it does not come to rest")


@given(st.lists(st.tuples(st.integers(-40, 40), st.sampled_from((UP, EITHER, DOWN))), max_size=5))
def test_an_axis_moves_its_load(moves):
    rig, axis = with_backlash()
    load = 0
    for target, direction in moves:
        before = axis.block[stepper.POSITION]
        axis.move_to(rig.bench, word(target), 1, direction=direction)
        meet(rig, axis)
        motor = axis.block[stepper.POSITION]
        assert loads(axis) == target
        assert axis.rests_on(word(target), 1, direction)
        assert motor == {UP: target, DOWN: target - STEPS}.get(direction, motor)
        if not direction and target != load:
            assert motor == (target if target > load else target - STEPS)
        elif not direction:
            assert motor == before
        load = target
        assert rig.bench.engines[0].position == motor


def test_setting_the_position_leaves_the_backlash_as_it_is():
    rig, axis = with_backlash()
    axis.move_to(rig.bench, word(-5), 1)
    meet(rig, axis)
    assert axis.set_position(word(100), 1)
    assert (loads(axis), axis.block[stepper.POSITION]) == (100, 70)
    assert axis.rests_on(word(100), 1, DOWN)
    assert not axis.set_position(word(LOWEST + STEPS - 1), 1), "the motor has no room below it"
    assert axis.set_position(word(LOWEST + STEPS), 1)


def test_reports_say_where_the_load_is():
    rig, axis = with_backlash()
    axis.move_to(rig.bench, word(-5), 1)
    reported = []
    for _ in range(600):
        rig.run(1)
        sample(rig.axes.kernel.state, rig.axes.samples)
        rig.axes.choose_sample()
        reported.append(rig.axes.reported[0])
    assert sorted(set(reported)) == [-5, -4, -3, -2, -1, 0]
    assert axis.block[stepper.POSITION] == -5 - STEPS


@given(steps, positions, st.sampled_from((1, -1)), st.sampled_from((UP, DOWN)))
def test_the_check_counts_the_steps_that_the_motor_makes(backlash, frames, order, direction):
    """In the frame where it turns half as much again, plus an eighth of the neighbours'."""
    words = array("i", [0] * path_check.CHECK_WORDS)
    words[path_check.FASTEST] = 0
    words[path_check.STEEPEST] = words[path_check.HARDEST] = words[path_check.PULSED] = 2**29
    words[path_check.LOWEST], words[path_check.HIGHEST] = LOWEST, HIGHEST
    words[path_check.BACKLASH] = backlash
    words[path_check.OFFSET] = -backlash if direction < 0 else 0
    plan = Gear(backlash, frames[0])
    plan.take_up(direction)
    motor, taken = [plan.take_up(direction)], [False]
    for frame in frames[1:]:
        offset = plan.offset
        motor.append(plan.turn_to(frame))
        taken.append(plan.offset != offset)
    needed, beside, before = 0, 0, False
    for (a, c), turns in zip(pairwise(motor), taken[1:], strict=True):
        most = abs(c - a)
        needed = max(needed, most + (most // 2 + beside // 8 if turns else 0))
        if before:
            needed = max(needed, beside + beside // 2 + most // 8)
        beside, before = most, turns
    assert path_check.check(words, array("i", frames[::order]), len(frames), order) == (
        path_check.FITS
    )
    assert words[path_check.FASTEST] == needed
