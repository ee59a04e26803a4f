"""Queued phases of a JOG_ALL, to find the place on the path at any moment.

The path is one axis whose unit is the frame. Each phase of it is a row. Positions and velocities
along the path are real numbers in the player's registers. Nothing allocates after construction.
"""

from array import array

from framestep.base.clock import HALF as _HALF
from framestep.base.clock import after, elapsed
from framestep.base.native import const
from framestep.motion import reals
from framestep.motion.compute import compute
from framestep.motion.formula import formula
from framestep.moves.path import registers
from framestep.moves.path.move_check import HALF
from framestep.moves.path.registers import DISTANCE, HERE, HERE_RATE, NEXT, RATE, SINCE, P, T, X, Y

# Words of a row: a phase of the path, a cubic like the motors'

# A queue of 16 segments holds 16 phases at most; a few more wait, or have just been played.
_ROWS = const(24)
_ROW = const(14)
_WHOLE = const(0)  # whole ticks from the beginning of the jog to the phase
_FRACTION = const(1)  # real: and a fraction of a tick
_TIME = const(3)  # reals: duration in ticks,
_FROM = const(5)  # velocity at its start and
_TO = const(7)  # at its end, frames per tick,
_PASSED = const(9)  # frames from INDEX to its start,
_DISTANCE = const(11)  # and from there to its end
INDEX = const(13)  # of the last frame before it

# Add a phase of T ticks: X whole ticks, and the fraction in SINCE.
_TO_END = formula(
    registers,
    """
    SINCE = SINCE + T
    X = floor(SINCE)
    SINCE = SINCE - X
    """,
)
# The phase begins Y ticks after a whole tick. X: ticks since that tick, then since its beginning.
_HAS_BEGUN = formula(
    registers,
    """
    X = X - Y
    assert X >= ZERO
    """,
)
# Place on a cubic X ticks after its beginning. It takes Y ticks for T frames, from the velocity
# HERE_RATE to DISTANCE, and begins P frames after its row's INDEX.
_LOCATE = formula(
    registers,
    """
    X = min(X, Y)
    z = X / Y
    mean = T / Y
    q = HERE_RATE + DISTANCE - mean - mean
    p = mean - HERE_RATE - q
    q = q * z
    HERE = ((p + q) * z + HERE_RATE) * X + P
    HERE_RATE = HERE_RATE + (2 * p + q + 2 * q) * z
    HERE_RATE = max(HERE_RATE, ZERO)
    """,
)


class JogPhases:
    """Rows of the phases queued last. numbers: the player's registers."""

    def __init__(self, numbers):
        self.numbers = numbers
        self.rows = array("i", [0] * (_ROWS * _ROW))
        self.count = 0  # rows so far
        self.whole = 0  # ticks to the end of what is queued

    def begin(self, ticks):
        """Set the beginning of the next phase: `ticks` whole ticks after the jog's."""
        self.whole = ticks
        reals.put(self.numbers, SINCE, 0, 0)

    def add(self, index):
        """Add a phase: DISTANCE frames in T ticks, with velocities from RATE to NEXT.

        It begins HERE frames after `index`.
        """
        r = self.numbers
        k = self.count % _ROWS * _ROW
        rows = self.rows
        rows[k + _WHOLE] = self.whole
        reals.fetch(rows, k + _FRACTION, r, SINCE)
        reals.fetch(rows, k + _TIME, r, T)
        reals.fetch(rows, k + _FROM, r, RATE)
        reals.fetch(rows, k + _TO, r, NEXT)
        reals.fetch(rows, k + _PASSED, r, HERE)
        reals.fetch(rows, k + _DISTANCE, r, DISTANCE)
        rows[k + INDEX] = index
        self.count += 1
        compute(0, 0, r, _TO_END)
        self.whole = after(self.whole, reals.floor(r, X, HALF))

    def locate(self, ticks):
        """Find HERE and HERE_RATE, `ticks` ticks after the beginning of the jog.

        Return the index of the phase's row in `rows`, or -1.
        """
        r = self.numbers
        rows = self.rows
        n = self.count
        last = max(n - _ROWS, 0)
        while n > last:
            n -= 1
            k = n % _ROWS * _ROW
            since = elapsed(ticks, rows[k + _WHOLE])
            if since < _HALF:
                reals.put(r, X, since, 0)
                reals.fetch(r, Y, rows, k + _FRACTION)
                if compute(0, 0, r, _HAS_BEGUN):
                    break
        else:
            return -1
        reals.fetch(r, Y, rows, k + _TIME)
        reals.fetch(r, HERE_RATE, rows, k + _FROM)
        reals.fetch(r, DISTANCE, rows, k + _TO)
        reals.fetch(r, T, rows, k + _DISTANCE)
        reals.fetch(r, P, rows, k + _PASSED)
        compute(0, 0, r, _LOCATE)
        return k
