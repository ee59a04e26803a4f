"""What a JOG_ALL has queued: its phases, and where on the path they are at a moment.

The path is one axis whose unit is the frame. Each phase of it is a row; positions and velocities
along the path are real numbers in the player's registers. Nothing allocates after construction.
"""

from array import array

from framestep.clock import HALF as _HALF
from framestep.clock import after, elapsed
from framestep.motion import reals
from framestep.moves.move_check import HALF, T, X, Y
from framestep.native import const

# Registers: frames and ticks; move_check.OWN is the first that is free
TOP = const(36)  # velocity that the jog keeps to
TWICE = const(38)  # twice the acceleration, 8·10^-6 frames per tick²
RATE = const(40)  # velocity at the last frame queued
NEXT = const(42)  # and at the one after it
SLOWEST = const(44)  # ticks that one frame takes from rest to rest: 2/sqrt(4·10^-6)
SINCE = const(46)  # what is to be added to `whole`
FRAME_SCALE = const(48)
HERE = const(50)  # locate(): frames from a row's INDEX, and the velocity there
HERE_RATE = const(52)
WAY = const(54)  # way to go, frames
P = const(56)  # to work with
Q = const(58)
_Z = const(60)
LIMIT = const(62)  # acceleration of a landing

# Words of a row: a phase of the axis, a cubic as the motors' are
_ROWS = const(24)  # a ring of 16 segments holds that many phases at most; some more wait, or have just been played
_ROW = const(14)
_WHOLE = const(0)  # whole ticks from the beginning to that of the phase
_FRACTION = const(1)  # real: the rest
_TIME = const(3)  # reals: its duration in ticks,
_FROM = const(5)  # velocities at its ends, frames per tick,
_TO = const(7)
_PASSED = const(9)  # frames from INDEX to where it begins,
_WAY = const(11)  # and on to its end
INDEX = const(13)  # of the last frame before it


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
        """Note a phase: WAY frames in T ticks, from the velocity RATE to NEXT.

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
        reals.fetch(rows, k + _WAY, r, WAY)
        rows[k + INDEX] = index
        self.count += 1
        reals.add(r, SINCE, SINCE, T)
        ticks = reals.floor(r, SINCE, HALF)
        self.whole = after(self.whole, ticks)
        reals.put(r, X, ticks, 0)
        reals.subtract(r, SINCE, SINCE, X)

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
                reals.subtract(r, X, X, Y)
                if reals.sign(r, X) >= 0:
                    break
        else:
            return -1
        reals.fetch(r, Y, rows, k + _TIME)
        if reals.compare(r, X, Y) > 0:
            reals.copy(r, X, Y)
        # with z = x/T: u = from·x + z·(p + z·q)·x, velocity = from + z·(2p + 3z·q)
        reals.divide(r, _Z, X, Y)
        reals.fetch(r, HERE_RATE, rows, k + _FROM)
        reals.fetch(r, WAY, rows, k + _TO)
        reals.fetch(r, T, rows, k + _WAY)
        reals.divide(r, T, T, Y)
        reals.add(r, Q, HERE_RATE, WAY)
        reals.subtract(r, Q, Q, T)
        reals.subtract(r, Q, Q, T)  # from + to - 2·mean
        reals.subtract(r, P, T, HERE_RATE)
        reals.subtract(r, P, P, Q)  # 3·mean - 2·from - to
        reals.multiply(r, Q, Q, _Z)
        reals.add(r, HERE, P, Q)
        reals.multiply(r, HERE, HERE, _Z)
        reals.add(r, HERE, HERE, HERE_RATE)
        reals.multiply(r, HERE, HERE, X)
        reals.fetch(r, Y, rows, k + _PASSED)
        reals.add(r, HERE, HERE, Y)
        reals.double(r, P, P, 1)
        reals.add(r, P, P, Q)
        reals.double(r, Q, Q, 1)
        reals.add(r, P, P, Q)
        reals.multiply(r, P, P, _Z)
        reals.add(r, HERE_RATE, HERE_RATE, P)
        if reals.sign(r, HERE_RATE) < 0:
            reals.put(r, HERE_RATE, 0, 0)
        return k
