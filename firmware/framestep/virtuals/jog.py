"""The guide of a jog: surveys its line some cells ahead of the point that moves along it (motion.py).

Each cell has a velocity and an acceleration that are within its motors' limits, and the velocity with which it may be
left, so that what follows can be entered, and the end of the survey reached at rest. Where a motor would pass a limit,
or the rig cannot reach, or the way bends too much, cells get half as long until they cannot be halved: there it ends.
"""

from array import array

from framestep.motion import reals
from framestep.motors.axis import SPEED_FLOOR
from framestep.native import const
from framestep.results import ERR_RANGE
from framestep.virtuals import motion as v
from framestep.virtuals.geometry import AXES

CELLS = const(8)  # ahead of the point
_RING = const(32)  # with those behind it: a stop takes it back to a knot that has been planned already
_CELL = const(11)  # words: s at its end, velocity, acceleration, length, square of the velocity at its end, span
_TOP = const(2)
_STEEP = const(4)
_LENGTH = const(6)
_EXIT = const(8)
_SPAN = const(10)

_LEAST_MS = const(64)  # that a cell takes
_HALVINGS = const(12)
_STEPS = const(256)  # sixteenths of a step: the least that a motor moves in a cell

_LARGE = const(0x8000000)

# What is the next step of the survey
_PROBE = const(0)  # a cell is measured
_RATE = const(1)  # it gets its velocity and acceleration
_LEAVE = const(2)  # how fast each cell may be left is computed anew

# Registers
_X = const(v.FIRST_FREE)
_Y = const(v.FIRST_FREE + 2)
_Z = const(v.FIRST_FREE + 4)
_REACH = const(v.FIRST_FREE + 6)
FIRST_FREE = const(v.FIRST_FREE + 8)


class Guide:
    """Of one jog at a time. motion: the Motion whose guide it is."""

    def __init__(self, motion):
        self.motion = motion
        self.cells = array("i", [0] * (_RING * _CELL))
        self.head = 0  # the cell of the point
        self.count = 0  # from there on
        self.behind = 0  # before that
        self.level = 0
        self.step = _PROBE
        self.short = False  # the cell probed last is so short that its half is of no use
        self.share = 0
        self.closed = True
        self.rows = array("i", [v.SURVEY, v.SURVEY + v.ROW, v.SURVEY + 2 * v.ROW])

    def begin(self, share):
        """Start at s = 0 of a line that has been laid, with ten-thousandths of what the motors can do.

        0, or the code of what is in the way at once.
        """
        motion = self.motion
        r = motion.r
        self.rows[0] = v.SURVEY
        self.rows[1] = v.SURVEY + v.ROW
        self.rows[2] = v.SURVEY + 2 * v.ROW
        self.share = max(share, SPEED_FLOOR)
        self.head = 0
        self.count = 0
        self.behind = 0
        self.step = _PROBE
        self.closed = False
        motion.guide = self
        motion.greatest_clear()
        # How fast the motors go here, from a first cell of a 16th of a unit
        reals.put(r, v.END, 0, 0)
        reals.put(r, v.HALF_CELL, 1, -5)
        self.level = 0
        while True:
            code = self._probe()
            if not code:
                break
            if self.short:
                return code
            self.level += 1
        motion.head(self.rows[0], self.rows[1], self.rows[2], True)
        motion.rates(self.share)
        fastest = 1
        for i in range(AXES):
            if motion.motor[i] and motion.curve[2 * i] > fastest:
                fastest = motion.curve[2 * i]
        reals.put(r, _X, _STEPS, 0)
        reals.put(r, _Y, fastest, 0)
        reals.divide(r, _X, _X, _Y)
        reals.multiply(r, _X, _X, v.HALF_CELL)
        self._lengthen()
        reals.double(r, v.HALF_CELL, _X, -1)
        motion.greatest_clear()
        self.level = 0
        return 0

    def _lengthen(self):
        """_X, the length of a cell: what takes _LEAST_MS at TOP or more, and a quarter of the way in which it stops."""
        r = self.motion.r
        self._longer(v.TOP, _LEAST_MS)
        reals.multiply(r, _Z, v.TOP, v.TOP)
        reals.divide(r, _Z, _Z, v.STEEP)
        reals.double(r, _Z, _Z, -3)
        self._longer(_Z, 1)

    def _longer(self, a, times):
        """_X = the greater of _X and r[a]·times."""
        r = self.motion.r
        reals.put(r, _Y, times, 0)
        reals.multiply(r, _Y, _Y, a)
        if reals.compare(r, _Y, _X) > 0:
            reals.copy(r, _X, _Y)

    def _probe(self):
        """Measure the cell after END. 0 or a code."""
        motion = self.motion
        r = motion.r
        rows = self.rows
        self.short = self.level == _HALVINGS
        reals.double(r, _REACH, v.HALF_CELL, -self.level)
        reals.add(r, _REACH, v.END, _REACH)
        code = motion.place(_REACH, rows[1])
        if code:
            return code
        if motion.short(rows[0], rows[1]):
            self.short = True
        reals.double(r, _REACH, v.HALF_CELL, 1 - self.level)
        reals.add(r, _REACH, v.END, _REACH)
        code = motion.place(_REACH, rows[2])
        if code:
            return code
        motion.clear()
        if motion.measure(rows[0], rows[1], rows[2], self.level) != v.SMOOTH:
            return ERR_RANGE
        return motion.inside(rows[0], rows[1], rows[2])

    def extend(self):
        """Survey a cell more, a step at a time, or find that it must be shorter. False where there is nothing to do."""
        if self.step == _PROBE:
            if self.closed or self.count >= CELLS:
                return False
            if not self._probe():
                self.step = _RATE
                return True
            if self.short:
                self.closed = True
            self.level += 1
        elif self.step == _RATE:
            self._append()
            self.step = _LEAVE
        else:
            self.count += 1
            self._exits()
            self.step = _PROBE
        return True

    def _append(self):
        """Take the cell that has been probed."""
        motion = self.motion
        r = motion.r
        motion.rates(self.share)
        reals.double(r, _REACH, v.HALF_CELL, 1 - self.level)
        reals.add(r, _REACH, v.END, _REACH)
        cells = self.cells
        k = _CELL * ((self.head + self.count) % _RING)
        self.behind = min(self.behind, _RING - 1 - self.count)
        reals.subtract(r, _X, _REACH, v.END)
        reals.fetch(cells, k, r, _REACH)
        reals.fetch(cells, k + _TOP, r, v.TOP)
        reals.fetch(cells, k + _STEEP, r, v.STEEP)
        reals.fetch(cells, k + _LENGTH, r, _X)
        cells[k + _SPAN] = motion.span
        reals.copy(r, v.END, _REACH)
        rows = self.rows
        rows[0], rows[2] = rows[2], rows[0]
        if self.level:
            self.level -= 1
        else:
            # away from where it is slow cells get longer
            self._lengthen()
            reals.double(r, _X, _X, -2)
            if reals.compare(r, _X, v.HALF_CELL) > 0:
                reals.double(r, v.HALF_CELL, v.HALF_CELL, 1)
                for i in range(AXES):
                    motion.greatest[i] = min(motion.greatest[i], _LARGE) * 2

    def _exits(self):
        """From the last cell back: how fast each may be left, so that it comes to rest at the end of the survey."""
        r = self.motion.r
        cells = self.cells
        reals.put(r, _Z, 0, 0)
        i = self.count - 1
        while i >= 0:
            k = _CELL * ((self.head + i) % _RING)
            reals.fetch(r, _X, cells, k + _TOP)
            reals.multiply(r, _X, _X, _X)
            if reals.compare(r, _X, _Z) < 0:
                reals.copy(r, _Z, _X)
            reals.fetch(cells, k + _EXIT, r, _Z)
            reals.copy(r, _REACH, _X)
            reals.fetch(r, _X, cells, k + _STEEP)
            reals.fetch(r, _Y, cells, k + _LENGTH)
            reals.multiply(r, _X, _X, _Y)
            reals.double(r, _X, _X, 1)
            reals.add(r, _Z, _Z, _X)
            if reals.compare(r, _REACH, _Z) < 0:
                reals.copy(r, _Z, _REACH)
            i -= 1

    def back(self):
        """The point has been taken back to S. False where its cell is not remembered any more."""
        r = self.motion.r
        cells = self.cells
        self.closed = True
        while self.behind:
            k = _CELL * ((self.head - 1) % _RING)
            reals.fetch(r, _X, cells, k)
            if reals.compare(r, _X, v.S) <= 0:
                return True
            self.head = (self.head - 1) % _RING
            self.count += 1
            self.behind -= 1
        # the first of those remembered
        k = _CELL * self.head
        reals.fetch(r, _X, cells, k)
        reals.fetch(r, _Y, cells, k + _LENGTH)
        reals.subtract(r, _X, _X, _Y)
        return reals.compare(r, _X, v.S) <= 0

    def look(self):
        """Set TOP, STEEP and LEFT of the motion for where its point is. False where nothing is surveyed."""
        r = self.motion.r
        cells = self.cells
        if not self.count:
            return False
        while self.count > 1:
            reals.fetch(r, _X, cells, _CELL * self.head)
            if reals.compare(r, _X, v.S) > 0:
                break
            self.head = (self.head + 1) % _RING
            self.count -= 1
            self.behind += 1
        # the cells that the next knot may lie in
        for i in range(self.count):
            k = _CELL * ((self.head + i) % _RING)
            if i:
                self.motion.span = min(self.motion.span, cells[k + _SPAN])
                reals.fetch(r, _X, cells, k + _TOP)
                if reals.compare(r, _X, v.TOP) < 0:
                    reals.copy(r, v.TOP, _X)
                reals.fetch(r, _X, cells, k + _STEEP)
                if reals.compare(r, _X, v.STEEP) < 0:
                    reals.copy(r, v.STEEP, _X)
            else:
                self.motion.span = cells[k + _SPAN]
                reals.fetch(r, v.TOP, cells, k + _TOP)
                reals.fetch(r, v.STEEP, cells, k + _STEEP)
                # no farther than with this acceleration
                reals.put(r, _Y, v.SPAN, 0)
                reals.multiply(r, _REACH, v.STEEP, _Y)
                reals.double(r, _REACH, _REACH, -1)
                reals.add(r, _REACH, _REACH, v.V)
                reals.multiply(r, _REACH, _REACH, _Y)
                reals.add(r, _REACH, _REACH, v.S)
            reals.fetch(r, _X, cells, k)
            reals.fetch(r, _Y, cells, k + _EXIT)
            reals.divide(r, _Y, _Y, v.STEEP)
            reals.double(r, _Y, _Y, -1)
            reals.add(r, _Y, _Y, _X)
            reals.subtract(r, _Y, _Y, v.S)
            if i == 0 or reals.compare(r, _Y, v.LEFT) < 0:
                reals.copy(r, v.LEFT, _Y)
            if reals.compare(r, _X, _REACH) > 0:
                break
        return True
