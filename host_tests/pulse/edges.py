"""Ideal times of a motion's edges, and how far the edges are from them."""

from fractions import Fraction

import numpy as np

from framestep.pulse import stepper
from host_tests.pulse.engine import PER_US, Bench
from host_tests.pulse.profiles import ONE, Profile

# At very low velocity, the kernel's rounding of the position is a long time.
ROUNDING_STEPS = 1e-4


def steady(rate, ticks, p=0):
    """Full velocity from the first tick on: no real motion begins like that."""
    return Profile([(ticks, 0)], p=p, v=Fraction(rate, 1000))


# How far a timer's grid may be off after a gap or at boot: it is not corrected below a sixteenth.
GRID_US = 16


def errors_us(bench, start, profile, motor=0, ticks=None, made=0):
    """Return the errors of a motion's edges, in µs, minus their median, which is within what a grid
    may be off.

    Near rest, the effect of rounding is subtracted. ticks: length of a steady motion that was cut
    off there; its first ticks are left out. made: edges of earlier motions.
    """
    times, ways = bench.times(motor)
    times, ways = times[made:], ways[made:]
    ideal, ideal_ways = profile.steps()
    if ticks is not None:
        count = np.count_nonzero(ideal < ticks - 0.01)
        first = np.count_nonzero(ideal <= 3)
        times, ways = times[first:count], ways[first:count]
        ideal, ideal_ways = ideal[first:count], ideal_ways[first:count]
    assert ways.tolist() == ideal_ways.tolist()
    assert len(ways) > 1
    error = (times - start) / PER_US - ideal * 1000
    offset = np.median(error)
    assert abs(offset) < GRID_US
    error -= offset
    # the velocity after the first ROUNDING_STEPS from rest
    steepest = max(float(abs(piece.a) + abs(piece.j) * piece.ticks) for piece in profile.pieces)
    slowest = np.sqrt(2 * ROUNDING_STEPS * steepest) + 1e-9
    if jerk := max(float(abs(piece.j)) for piece in profile.pieces):
        slowest = min(slowest, 2 * ROUNDING_STEPS / (6 * ROUNDING_STEPS / jerk) ** (1 / 3))
    slack = 1000 * 2 * ROUNDING_STEPS / np.maximum(np.abs(profile.velocity(ideal)), slowest)
    return np.sign(error) * np.maximum(np.abs(error) - slack, 0)


def at_rest(bench, motor=0):
    """Check a motor that has come to rest by itself."""
    block = bench.block(motor)
    assert block[stepper.MODE] == stepper.IDLE
    assert block[stepper.FAULT] == 0
    assert block[stepper.FRACTION] == block[stepper.VELOCITY] == 0
    assert bench.engines[motor].position == block[stepper.POSITION]
    engine = bench.engines[motor]
    assert not engine.rises or engine.rises[-1] + engine.high_cycles < bench.now, (
        "pulses are still on their way"
    )


def moving(rate=20_000, brake=Fraction(1, 50), motors=1, **options):
    """Make a bench with motors at a steady rate. Also returns that motion."""
    bench = Bench(motors, jitter_us=0, **options).settle()
    profile = steady(rate, 400)
    for motor in range(motors):
        bench.block(motor)[stepper.BRAKE] = int(brake * ONE)
    start = bench.play([profile.segments(rest=False)] * motors, 50, motors=range(motors))
    return bench, profile, start
