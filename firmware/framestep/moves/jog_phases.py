"""What a JOG_ALL has queued: its phases, and where on the path they are at a moment.

The path is one axis whose unit is the frame. Each phase of it is a row; positions and velocities
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

# Words of a row: a phase of the axis, a cubic as the motors' are

# a ring of 16 segments holds that many phases at most; some more wait, or have just been played
_ROWS = const(24)
_ROW = const(14)
_WHOLE = const(0)  # whole ticks from the beginning to that of the phase
_FRACTION = const(1)  # real: the rest
_TIME = const(3)  # reals: its duration in ticks,
_FROM = const(5)  # velocities at its ends, frames per tick,
_TO = const(7)
_PASSED = const(9)  # frames from INDEX to where it begins,
_DISTANCE = const(11)  # and on to its end
INDEX = const(13)  # of the last frame before it

# A phase of T ticks more: X whole ticks, and the rest in SINCE.
_TO_END = formula(
    registers,
    """
    SINCE = SINCE + T
    X = floor(SINCE)
    SINCE = SINCE - X
    """,
)
# X ticks after the whole tick at which a phase begins that begins Y ticks later.
_HAS_BEGUN = formula(
    registers,
    """
    X = X - Y
    assert X >= ZERO
    """,
)
# Where a cubic is X ticks after it begins. It takes Y ticks for T frames, from the velocity
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
    """Rows of the last phases queued. numbers: the player's registers."""

    def __init__(self, numbers):
        self.numbers = numbers
        self.rows = array("i", [0] * (_ROWS * _ROW))
        self.count = 0  # rows so far
        self.whole = 0  # ticks to the end of what is queued

    def begin(self, ticks):
        """The next phase begins `ticks` whole ticks after the beginning."""
        self.whole = ticks
        reals.put(self.numbers, SINCE, 0, 0)

    def add(self, index):
        """Note a phase: DISTANCE frames in T ticks, from the velocity RATE to NEXT.

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
        """Find where the axis is `ticks` ticks after the beginning: HERE and HERE_RATE.

        Returns the index of the phase's row in `rows`, -1 if there is none.
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
