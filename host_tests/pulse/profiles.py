"""Ideal motions: position over time in exact arithmetic, the times of its steps, and its segments
for the kernel.

Time in ticks of 1 ms, position in steps. Apart from the formats of a segment, nothing is shared
with the code under test.
"""

from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise

import numpy as np

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
