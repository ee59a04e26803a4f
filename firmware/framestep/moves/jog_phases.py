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
from framestep.moves.path.registers import DISTANCE, DURATION, HERE, HERE_RATE, NEXT, RATE, SINCE

# Words of a row: a phase of the path, a cubic like the motors'

# A queue of 16 segments holds 16 phases at most; a few more wait, or have just been played.
_ROWS = const(24)
_ROW = const(14)
_WHOLE = const(0)  # whole ticks from the beginning of the jog to the phase
# numbers of reals.py
_FRACTION = const(1)  # the fraction of a tick to be added to _WHOLE
_TIME = const(3)  # duration in ticks
_FROM = const(5)  # velocity at its start, frames per tick
_TO = const(7)  # velocity at its end, frames per tick
_PASSED = const(9)  # frames from INDEX to its start
_DISTANCE = const(11)  # frames from its start to its end

INDEX = const(13)  # of the last frame before it

# Add a phase of DURATION: whole ticks, and the fraction in SINCE.
_TO_END = formula(
    registers,
    "-> ticks",
    """
    SINCE = SINCE + DURATION
    ticks = floor(SINCE)
    SINCE = SINCE - ticks
    """,
)
# The phase begins a fraction of a tick after a whole one. since: ticks since that whole tick;
# ticks: since the phase's beginning.
_HAS_BEGUN = formula(
    registers,
    "since, fraction -> ticks",
    """
    ticks = since - fraction
    assert ticks >= ZERO
    """,
)
# Place on a cubic, so many ticks after its beginning. It takes `duration` ticks for `frames`, from
# the velocity HERE_RATE to DISTANCE. HERE: frames from its beginning.
_LOCATE = formula(
    registers,
    "ticks, duration, frames",
    """
    ticks = min(ticks, duration)
    z = ticks / duration
    mean = frames / duration
    q = HERE_RATE + DISTANCE - mean - mean
    p = mean - HERE_RATE - q
    q = q * z
    HERE = ((p + q) * z + HERE_RATE) * ticks + HERE
    HERE_RATE = HERE_RATE + (2 * p + q + 2 * q) * z
    HERE_RATE = max(HERE_RATE, ZERO)
    """,
    ticks=_HAS_BEGUN.ticks,
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
        """Add a phase: DISTANCE frames in DURATION, with velocities from RATE to NEXT.

        It begins HERE frames after `index`.
        """
        r = self.numbers
        k = self.count % _ROWS * _ROW
        rows = self.rows
        rows[k + _WHOLE] = self.whole
        reals.fetch(rows, k + _FRACTION, r, SINCE)
        reals.fetch(rows, k + _TIME, r, DURATION)
        reals.fetch(rows, k + _FROM, r, RATE)
        reals.fetch(rows, k + _TO, r, NEXT)
        reals.fetch(rows, k + _PASSED, r, HERE)
        reals.fetch(rows, k + _DISTANCE, r, DISTANCE)
        rows[k + INDEX] = index
        self.count += 1
        compute(r, _TO_END)
        self.whole = after(self.whole, reals.floor(r, _TO_END.ticks, HALF))

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
                reals.put(r, _HAS_BEGUN.since, since, 0)
                reals.fetch(r, _HAS_BEGUN.fraction, rows, k + _FRACTION)
                if compute(r, _HAS_BEGUN):
                    break
        else:
            return -1
        reals.fetch(r, _LOCATE.duration, rows, k + _TIME)
        reals.fetch(r, HERE_RATE, rows, k + _FROM)
        reals.fetch(r, DISTANCE, rows, k + _TO)
        reals.fetch(r, _LOCATE.frames, rows, k + _DISTANCE)
        reals.fetch(r, HERE, rows, k + _PASSED)
        compute(r, _LOCATE)
        return k
