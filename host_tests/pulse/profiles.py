"""Ideal motions: position over time in exact arithmetic, the times of its steps, and its segments
for the kernel.

Time in ticks of 1 ms, position in steps. Apart from the formats of a segment, nothing is shared
with the code under test.
"""

from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise

import numpy as np

from framestep.pulse import stepper
from host_tests.pulse.engine import PER_US, Bench

ONE = 1 << 22
FINE = 1 << 27
LONGEST = 32


def rounded(x: Fraction) -> int:
    return int((x + Fraction(1, 2)) // 1)


@dataclass(frozen=True)
class Piece:
    """p + v·x + a·x²/2 + j·x³/6 for `ticks` ticks from the tick `at` on."""

    at: int
    ticks: int
    p: Fraction
    v: Fraction
    a: Fraction
    j: Fraction

    def position(self, x):
        return self.p + self.v * x + self.a * x * x / 2 + self.j * x**3 / 6

    def velocity(self, x):
        return self.v + self.a * x + self.j * x * x / 2

    def split(self):
        """Split it into pieces that fit a segment."""
        done = 0
        while done < self.ticks:
            ticks = min(LONGEST, self.ticks - done)
            yield Piece(
                self.at + done,
                ticks,
                self.position(done),
                self.velocity(done),
                self.a + self.j * done,
                self.j,
            )
            done += ticks

    def segment(self):
        """Convert to the kernel's numbers: it adds up displacements of ticks and differences."""
        whole = self.p // 1
        first = self.v + self.a / 2 + self.j / 6
        second = self.a + self.j
        # The kernel rounds the acceleration down from Q27 to Q22: add half a unit.
        return (
            self.ticks,
            int(whole),
            int((self.p - whole) * ONE),
            rounded(first * ONE),
            rounded(second * FINE) + 16,
            rounded(self.j * FINE),
        )


class Profile:
    """Pieces (ticks, acceleration) or (ticks, acceleration, jerk), from position p, velocity v."""

    def __init__(self, pieces, p=0, v=0):
        self.pieces = []
        p, v, at = Fraction(p), Fraction(v), 0
        for ticks, a, *j in pieces:
            piece = Piece(at, ticks, p, v, Fraction(a), Fraction(*j) if j else Fraction(0))
            self.pieces.append(piece)
            p, v, at = piece.position(ticks), piece.velocity(ticks), at + ticks
        self.end, self.final, self.ticks = p, v, at

    def segments(self, rest=True):
        """Return segments for the kernel; `rest`: with one at the end that comes to rest."""
        made = [part.segment() for piece in self.pieces for part in piece.split()]
        if rest:
            assert self.final == 0
            made.append((1, rounded(self.end), 0, 0, 0, 0))
        return made

    def velocity(self, times):
        """Return steps per tick at each of these times, in ticks."""
        times = np.asarray(times, dtype=float)
        result = np.zeros(len(times))
        for piece in self.pieces:
            x = times - piece.at
            inside = (x >= 0) & (x <= piece.ticks)
            x = x[inside]
            result[inside] = float(piece.v) + x * (float(piece.a) + x * float(piece.j) / 2)
        return result

    def steps(self):
        """Return (times in ticks, directions): step k is made when the position reaches k."""
        times, ways = [], []
        made = int(self.pieces[0].p // 1)
        for piece in self.pieces:
            v, a, j = float(piece.v), float(piece.a), float(piece.j)
            cuts = [0.0, float(piece.ticks)]
            # times at which the velocity is zero
            for root in np.roots([c for c in (j / 2, a, v)]) if (j or a) else []:
                if abs(root.imag) < 1e-12 and 0 < root.real < piece.ticks:
                    cuts.append(root.real)
            cuts.sort()
            p = float(piece.p - made)  # relative to the steps made, for precision
            base = made
            for start, end in pairwise(cuts):

                def at(x, p=p, v=v, a=a, j=j):
                    return p + x * (v + x * (a / 2 + x * j / 6))

                first, last = at(start), at(end)
                slack = 1e-9 * np.sign(last - first)  # a motion that ends on a step reaches it
                if last > first:
                    levels = np.arange(made - base + 1, np.floor(last + slack) + 1)
                else:
                    levels = np.arange(made - base - 1, np.ceil(last + slack) - 1, -1)
                if not len(levels):
                    continue
                low, high = np.full(len(levels), start), np.full(len(levels), end)
                rising = last > first
                for _ in range(60):
                    middle = (low + high) / 2
                    before = (at(middle) < levels) == rising
                    low, high = np.where(before, middle, low), np.where(before, high, middle)
                times.append(piece.at + high)
                ways.append(np.full(len(levels), 1 if rising else -1))
                made = base + int(levels[-1])
        if not times:
            return np.zeros(0), np.zeros(0, dtype=int)
        return np.concatenate(times), np.concatenate(ways)


def trapezoid(ticks_up, acceleration, ticks_cruise):
    """Ramp up, cruise, ramp down; the end is on a whole step if acceleration · ticks_up · (ticks_up
    + ticks_cruise) is whole."""
    return Profile(
        [(ticks_up, acceleration), (ticks_cruise, 0), (ticks_up, -Fraction(acceleration))]
    )


# ---- how far edges are from them ----------------------------------------------------------------

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
