"""Motions with any requests of a main loop: limits kept in every tick, and the end exact and in
time."""

from array import array
from itertools import accumulate, pairwise
from math import sqrt

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from framestep.motion import segments
from framestep.motors.axes import Axes
from framestep.motors.axis import SPLICE_TICKS
from framestep.pulse import stepper
from framestep.pulse.engine import LEAD
from framestep_tools.judge.motion_limits import (
    ACCELERATION,
    PLAN,
    PLAN_NEAR_REST,
    VELOCITY,
    beyond,
)
from host_tests.pulse.engine import ONE, Bench

TRAVEL, STOP, PAUSE, SPEED = "travel", "stop", "pause", "speed"
LONGEST_RUN = 30_000  # ticks
TICK_S = 0.001

# The last 256th of a step is not planned: the motor just counts as being there.
UNPLANNED = 1 / 250  # steps, a little more
# If a stop ends this near to a whole step, segments.settle() puts it there in its last tick: that
# is not a motion of the plan.
SETTLED = 1 / 16  # steps


class Motor:
    """One axis on a bench, whose profile is recorded tick by tick: `gone` has the steps of each."""

    def __init__(self, velocity, acceleration, jerk=0, place=0):
        self.bench = Bench()
        self.axes = Axes(self.bench)
        self.axis = self.axes[0]
        self.block = self.bench.block()
        self.axis.set_position(array("i", [place]), 0)
        self.start = place
        self.axis.set_speed(velocity, acceleration)
        self.axis.set_jerk(jerk)
        self.bench.settle()
        self.place = place
        self.gone = [0.0]
        self.bench.after_tick.append(self._watch)
        self._prepare = self.axis.begin_plan
        self.axis.begin_plan = self._prepare_and_look

    def _watch(self):
        block = self.block
        assert block[stepper.FAULT] == 0
        before, self.place = self.place, block[stepper.POSITION] + block[stepper.FRACTION] / ONE
        way = self.place - before
        self.gone.append(0.0 if self._drops_a_fraction() or self._settles(way) else way)

    def _drops_a_fraction(self):
        """At rest a motor drops the fraction of a step that a stop has left."""
        return self.block[stepper.MODE] in (stepper.DRAIN, stepper.IDLE)

    def _settles(self, way):
        block = self.block
        if abs(way) > SETTLED or block[stepper.FRACTION]:
            return False
        segments_left = block[stepper.WRITE_INDEX] - block[stepper.READ_INDEX]
        is_last = block[stepper.LEFT] == 0 and segments_left <= 1
        was_at_rest = abs(self.gone[-1]) < 1e-3  # another plan may follow
        return is_last or was_at_rest

    def _prepare_and_look(self, hal, *ticks):
        """Record the state from which a plan starts, in steps and steps per tick."""
        if not self._prepare(hal, *ticks):
            return False
        block = self.block
        # the one of a stop at its end is dropped
        self.place = block[stepper.POSITION] + block[stepper.FRACTION] / ONE
        whole, part, low, v, lower = self.axis.cubic[: segments.G1 + 2]
        self.planned_from = whole + part / 2**16 + low / 2**46, v / 2**16 + lower / 2**46
        return True

    def run(self, ticks):
        self.bench.run(ticks, self.axes.feed)

    def move_to(self, target, share=10_000):
        return self.axis.move_to(self.bench, array("i", [0, target]), 1, share)

    def to_rest(self, limit=LONGEST_RUN):
        """Return the ticks until nothing moves any more."""
        ticks = 0
        while self.axis.moving:
            self.run(1)
            ticks += 1
            assert ticks < limit, "the motion does not end"
        return ticks

    def check(self, velocity, acceleration):
        """Check everything that holds for any motion within these limits, steps/s and steps/s²."""
        self._check_edges()
        gone = np.array([*self.gone, 0.0])
        slow = max(2 * acceleration / 1e6, UNPLANNED)
        near_rest = np.maximum(np.abs(gone[:-1]), np.abs(gone[1:])) < slow
        within = [
            tolerance.most(ACCELERATION, acceleration, TICK_S)
            for tolerance in (PLAN_NEAR_REST, PLAN)
        ]
        found = beyond(gone, 0, 1, PLAN.most(VELOCITY, velocity, TICK_S))
        assert not found, f"tick, steps per tick, allowed: {found}"
        found = beyond(gone, 1, 1, np.where(near_rest, *within))
        assert not found, f"tick, change of steps per tick, allowed: {found}"

    def _check_edges(self):
        """The steps add up to the position, each comes after the one before, none is to come."""
        steps = self.bench.engines[0]
        assert self.start + steps.position == self.block[stepper.POSITION]
        assert all(second > first for first, second in pairwise(steps.rises))
        assert not steps.rises or steps.rises[-1] < self.bench.now


def shortest(way, v, velocity, acceleration):
    """Return the ticks from a velocity v (steps per tick) to rest `way` steps further on. Limits
    per tick, no jerk limit."""
    if way < 0 or (way == 0 and v < 0):
        way, v = -way, -v
    to_stop = v * abs(v) / (2 * acceleration)
    if v < 0 or to_stop > way:
        # stop first, then come back or go on
        return abs(v) / acceleration + shortest(way - to_stop, 0, velocity, acceleration)
    if v > velocity:
        slow = (v - velocity) / acceleration
        left = way - (v * v - velocity * velocity) / (2 * acceleration)
        if left < velocity * velocity / (2 * acceleration):
            return v / acceleration + (way - to_stop) / velocity  # some way in between
        return slow + left / velocity + velocity / (2 * acceleration)
    peak = sqrt(acceleration * way + v * v / 2)
    if peak <= velocity:
        return (2 * peak - v) / acceleration
    cruise = way - (2 * velocity * velocity - v * v) / (2 * acceleration)
    return (2 * velocity - v) / acceleration + cruise / velocity


@st.composite
def speeds(draw):
    """Draw velocity and acceleration in steps/s and steps/s², with ramps of up to half a second."""
    velocity = round(10 ** draw(st.floats(1, 5.69)))
    acceleration = round(10 ** draw(st.floats(2, 6.6)))
    return velocity, max(acceleration, velocity * 2)


@st.composite
def ways(draw, velocity, acceleration):
    """Draw a distance with or without a cruise, or a few steps."""
    ramp = velocity * velocity // acceleration
    size = draw(st.sampled_from([3, 50, ramp + 1, 2 * ramp + 1, ramp + velocity // 5 + 1]))
    return draw(st.integers(-size, size))


@st.composite
def moves(draw):
    velocity, acceleration = draw(speeds())
    return velocity, acceleration, draw(ways(velocity, acceleration))


@given(moves())
@example((500_000, 4_000_000, 31_250))
@example((10, 5, 1))
@example((500_000, 250_000, -1_100_000))
@example((1_000, 1_000_000, 10))
def test_one_move(move):
    """Rest to rest: exact, and as fast as velocity and acceleration allow."""
    velocity, acceleration, way = move
    motor = Motor(velocity, acceleration)
    assert motor.move_to(way) == (way != 0)
    assert motor.axis.moving == (way != 0)
    ticks = motor.to_rest()
    assert motor.block[stepper.POSITION] == way
    motor.check(velocity, acceleration)
    theory = shortest(way, 0, velocity / 1e3, acceleration / 1e6) if way else 0
    assert theory <= ticks <= theory + LEAD + 4
    if way:
        assert set(motor.bench.engines[0].ways) == {1 if way > 0 else -1}


@st.composite
def scripts(draw):
    """Draw some requests at any time, and a target at the end."""
    velocity, acceleration = draw(speeds())
    script = []
    for _ in range(draw(st.integers(1, 6))):
        what = draw(st.sampled_from([TRAVEL, TRAVEL, TRAVEL, STOP, PAUSE, SPEED]))
        if what == TRAVEL:
            share = draw(st.sampled_from([10_000, 10_000, 5_000, 2_000, 100, 1]))
            script.append((TRAVEL, draw(ways(velocity, acceleration)), share))
        elif what == STOP:
            script.append((STOP, draw(st.sampled_from([1, 4])), 0))
        elif what == SPEED:
            script.append(
                (SPEED, draw(st.sampled_from([0.1, 0.5, 1])), draw(st.sampled_from([0.5, 1])))
            )
        script.append(
            (PAUSE, draw(st.sampled_from([0, 1, 1, 2, 3, 7, 11, 12, 13, 20, 40, 150, 400])), 0)
        )
    return velocity, acceleration, script, draw(ways(velocity, acceleration))


def play(motor, velocity, acceleration, script):
    """Carry out the requests. Return the steepest deceleration requested, as a multiple of the
    setting."""
    steepest = 1
    for what, x, y in script:
        if what == TRAVEL:
            motor.move_to(x, y)
        elif what == STOP:
            motor.axis.stop(motor.bench, x)
            steepest = max(steepest, x)
        elif what == SPEED:
            motor.axis.set_speed(max(10, round(velocity * x)), max(1, round(acceleration * y)))
        else:
            motor.run(x)
    return steepest


# its last plan begins between two ticks in each of which the phase changes
BETWEEN_BRIDGES = [
    (TRAVEL, 1, 10000), (PAUSE, 7, 0), (TRAVEL, 2, 100), (PAUSE, 20, 0), (TRAVEL, 0, 10000),
    (PAUSE, 0, 0),
]  # fmt: skip


@given(scripts())
@example(case=(100, 10000, [*BETWEEN_BRIDGES, (TRAVEL, 1, 10000), (PAUSE, 0, 0), (PAUSE, 1, 0)], 0))
@settings(max_examples=200)
def test_any_requests(case):
    """Targets, stops and settings at any time; in the end the motor is on its target, in time."""
    velocity, acceleration, script, target = case
    motor = Motor(velocity, acceleration)
    steepest = play(motor, velocity, acceleration, script)
    motor.axis.set_speed(velocity, acceleration)
    moves = motor.move_to(target)
    assert motor.axis.moving == moves
    ticks = motor.to_rest()
    place, v = motor.planned_from  # where it came to rest first, if it was about to
    assert motor.block[stepper.POSITION] == target
    motor.check(velocity, min(acceleration * steepest, 4_000_000))
    theory = shortest(target - place, v, velocity / 1e3, acceleration / 1e6)
    assert ticks <= theory + SPLICE_TICKS + LEAD + 5 + 0.01 * theory


@given(scripts(), st.sampled_from([1, 4]))
def test_stop_at_any_moment(case, factor):
    """From any motion: down to rest at once, with the requested deceleration."""
    velocity, acceleration, script, _ = case
    motor = Motor(velocity, acceleration)
    steepest = max(factor, play(motor, velocity, acceleration, script))
    motor.axis.set_speed(velocity, acceleration)
    speed = abs(motor.gone[-1])
    motor.axis.stop(motor.bench, factor)
    ticks = motor.to_rest()
    motor.check(velocity, min(acceleration * steepest, 4_000_000))
    rate = min(acceleration * factor, 4_000_000) / 1e6
    assert ticks <= speed / rate * 1.001 + LEAD + 4
    assert motor.block[stepper.FRACTION] == 0


OTHERS = st.lists(st.tuples(st.integers(1, 300), st.integers(-3000, 3000)), max_size=3)


@given(moves(), st.integers(1, 1_000_000), OTHERS)
@example((487, 1_000_000, 0), 107_232, [(1, 7), (8, 0)])
def test_jerk_limited(move, jerk, others):
    """With a jerk limit in 1000 steps/s³: the same, and the acceleration changes gradually."""
    velocity, acceleration, way = move
    if velocity / 1e3 / jerk * 1e6 > 3e6:  # ramps of minutes
        jerk = max(jerk, round(velocity / 1e3))
    motor = Motor(velocity, acceleration, jerk)
    for ticks, target in others:
        motor.move_to(target)
        motor.run(ticks)
    motor.move_to(way)
    motor.to_rest()
    assert motor.block[stepper.POSITION] == way
    motor.check(velocity, acceleration * 1.1)


@pytest.mark.parametrize(
    ("velocity", "acceleration", "jerk"),
    [(400_000, 4_000_000, 40_000), (5_000, 1_000_000, 10_000), (74, 74_826, 148), (43, 110, 7)],
)
def test_retargeted_within_the_jerk_limit(velocity, acceleration, jerk):
    """In each tick of the ramp to the top velocity: a new target does not make it overshoot."""
    for tick in range(2, round(2 * sqrt(velocity * 1e3 / jerk)) + 10, 2):
        motor = Motor(velocity, acceleration, jerk)
        motor.move_to(velocity * 10)
        motor.run(tick)
        motor.move_to(velocity * 11)
        motor.run(min(round(acceleration / jerk), 110) + 40)
        assert max(motor.gone) <= PLAN.most(VELOCITY, velocity, TICK_S), tick


@pytest.mark.parametrize("jerk", [2000, 1000, 300])
def test_stopped_on_the_way_it_keeps_within_it(jerk):
    """In each tick of a move without a cruise, whose jerk lasts a few ticks: a stop and a turn do
    not take the motor beyond the end of the move."""
    velocity, acceleration, way = 2799, 6097, 392
    for tick in range(2, 510, 4):
        for stops in (True, False):
            motor = Motor(velocity, acceleration, jerk)
            motor.move_to(way)
            motor.run(tick)
            if stops:
                motor.axis.stop(motor.bench, 1, True)
            else:
                motor.move_to(0)
            motor.to_rest()
            motor.check(velocity, acceleration)
            assert max(accumulate(motor.bench.engines[0].ways)) <= way, (tick, stops)


@st.composite
def gentle_scripts(draw):
    """Draw settings with a jerk limit and ramps of a few seconds, requests at any time, and a last
    target."""
    velocity = round(10 ** draw(st.floats(1, 3.6)))
    acceleration = max(round(10 ** draw(st.floats(2, 5))), velocity * 2)
    jerk = max(round(10 ** draw(st.floats(0, 4))), velocity // 2000)
    script = []
    for _ in range(draw(st.integers(1, 5))):
        what = draw(st.sampled_from([TRAVEL, TRAVEL, TRAVEL, STOP, SPEED]))
        if what == TRAVEL:
            share = draw(st.sampled_from([10_000, 10_000, 5_000, 1_000]))
            script.append((TRAVEL, draw(gentle_ways(velocity)), share))
        elif what == STOP:
            script.append((STOP, 1, 0))
        else:
            script.append(
                (SPEED, draw(st.sampled_from([0.1, 0.5, 1])), draw(st.sampled_from([0.5, 1])))
            )
        script.append((PAUSE, draw(st.integers(0, 60) | st.integers(0, 900)), 0))
    return velocity, acceleration, jerk, script, draw(gentle_ways(velocity))


def gentle_ways(velocity):
    return st.integers(-30, 30) | st.integers(-velocity, velocity)


@given(gentle_scripts())
@settings(max_examples=60)
def test_any_requests_within_the_jerk_limit(case):
    """Like test_any_requests, with stops and jogs of any share: within the limits, between the
    targets, exact."""
    velocity, acceleration, jerk, script, target = case
    motor = Motor(velocity, acceleration, jerk)
    lowest = highest = 0
    for what, x, y in script:
        if what == TRAVEL:
            motor.move_to(x, y)
            lowest, highest = min(lowest, x), max(highest, x)
        elif what == STOP:
            motor.axis.stop(motor.bench, x, True)
        elif what == SPEED:
            motor.axis.set_speed(max(10, round(velocity * x)), max(1, round(acceleration * y)))
        else:
            motor.run(x)
    motor.axis.set_speed(velocity, acceleration)
    motor.move_to(target)
    lowest, highest = min(lowest, target), max(highest, target)
    motor.to_rest(100_000)
    assert motor.block[stepper.POSITION] == target
    motor.check(velocity, acceleration)
    places = list(accumulate(motor.bench.engines[0].ways))
    # the position from which it turns may be a step beyond its planned end
    assert lowest - 2 <= min(places, default=0)
    assert max(places, default=0) <= highest + 2
