"""Survey of a jog's line, some cells ahead of the point that moves along it.

Each cell has a velocity and an acceleration within its motors' limits. It also has the velocity
with which it may be left, so that the next cell can be entered, and the end of the survey reached
at rest. If a motor would pass a limit, or the rig cannot reach, or the path bends too much, cells
are halved until they are as short as possible: the jog ends there.
"""

from array import array

from framestep.base.native import const
from framestep.base.results import ERR_RANGE
from framestep.motion import reals
from framestep.motion.compute import compute
from framestep.motion.formula import formula
from framestep.motors.axis import SPEED_FLOOR
from framestep.virtual_axes import registers
from framestep.virtual_axes.line import ROW, SURVEY
from framestep.virtual_axes.survey import SMOOTH

CELLS = const(8)  # ahead of the point
_RING = const(32)  # including cells behind: a stop goes back to a knot that has been planned
_CELL = const(11)  # words: five reals and the span
_END = const(0)  # s at its end
_V = const(2)
_A = const(4)
_LENGTH = const(6)
_EXIT = const(8)  # square of the velocity at its end
_SPAN = const(10)

_HALVINGS = const(12)
_LARGE = const(0x8000000)

# Next step of the survey
_PROBE = const(0)  # measure a cell
_RATE = const(1)  # compute its velocity and acceleration
_LEAVE = const(2)  # compute again how fast each cell may be left

# The length of a cell: at least 64 ms at MAX_V, and at least a quarter of the stopping distance.
_LENGTHEN = formula(
    registers,
    """
    CELL_LENGTH = max(CELL_LENGTH, 64 * MAX_V)
    CELL_LENGTH = max(CELL_LENGTH, MAX_V * MAX_V / MAX_A / 8)
    """,
)
# At first at least 16 steps of the fastest motor there (FASTEST: sixteenths of a step).
_FIRST_LENGTH = formula(registers, "CELL_LENGTH = 256 / FASTEST * HALF_CELL")
_FIRST_HALF_CELL = formula(registers, "HALF_CELL = CELL_LENGTH / 2")
_DOUBLE_CELL = formula(
    registers,
    """
    assert CELL_LENGTH / 4 > HALF_CELL
    HALF_CELL = 2 * HALF_CELL
    """,
)
# From one knot to the next the acceleration is constant, the lowest of all cells between them. So a
# cell into which a span of 32 ticks may lead counts on no more than the one before it can, and a
# cell that is shorter than that never has more.
_LIKE_BEFORE = formula(
    registers,
    """
    assert CELL_LENGTH < 32 * MAX_V
    MAX_A = min(MAX_A, CELL_A)
    """,
)
# From the last cell backward: how fast a cell may be left, and so entered.
_LEAVE_CELL = formula(
    registers,
    """
    CELL_A = min(CELL_A, BEFORE_A)
    EXIT_V2 = min(ENTRY_V2, CELL_V * CELL_V)
    ENTRY_V2 = min(EXIT_V2 + 2 * (CELL_A * CELL_LENGTH), CELL_V * CELL_V)
    """,
)
# A cell in which the next knot, at most a span of 32 ticks ahead, may be. LEFT is half the square
# of the velocity with which the point may be here, so that it can leave that cell.
_LIMIT = formula(
    registers,
    """
    MAX_V = min(MAX_V, CELL_V)
    MAX_A = min(MAX_A, CELL_A)
    LEFT = min(LEFT, EXIT_V2 / 2 + CELL_A * (CELL_END - S))
    """,
)
# In the end it is the distance in which MAX_A brings that velocity to 0.
_LEFT = formula(registers, "LEFT = LEFT / MAX_A")
# Like that in survey.py.
_NO_LIMIT = formula(
    registers,
    """
    MAX_V = 2 ** 40
    MAX_A = MAX_V
    LEFT = MAX_V
    """,
)
_IS_WITHIN = formula(registers, "assert CELL_END - CELL_LENGTH <= S")
# The end of the cell after END, and the length that results, as s is rounded.
_CELL_ENDS = formula(
    registers,
    """
    SAMPLE = END + CELL_LENGTH
    CELL_LENGTH = SAMPLE - END
    """,
)
_REACH = formula(registers, "REACH_S = (MAX_A * 16 + V) * 32 + S")


class LookAhead:
    """Look-ahead of one jog at a time."""

    def __init__(self, line, survey):
        self.line = line
        self.port = line.axes.hal.port
        self.survey = survey
        self.r = line.r
        self.cells = array("i", [0] * (_RING * _CELL))
        self.head = 0  # the cell of the point
        self.count = 0  # cells from there on
        self.behind = 0  # cells before it
        self.level = 0
        self.step = _PROBE
        self.short = False  # the cell probed last is so short that halving it is useless
        self.share = 0
        self.closed = True
        self.rows = array("i", [SURVEY, SURVEY + ROW, SURVEY + 2 * ROW])

    def begin(self, share):
        """Start at s = 0 of a line, with `share` ten-thousandths of the motors' limits.

        Return 0, or the code of what is in the way at once.
        """
        survey = self.survey
        r = self.r
        rows = self.rows
        rows[0] = SURVEY
        rows[1] = SURVEY + ROW
        rows[2] = SURVEY + 2 * ROW
        self.share = max(share, SPEED_FLOOR)
        self.head = 0
        self.count = 0
        self.behind = 0
        self.step = _PROBE
        self.closed = False
        survey.clear_greatest()
        # how fast the motors go here, measured in a first cell of a 16th of a unit
        reals.put(r, registers.END, 0, 0)
        reals.put(r, registers.HALF_CELL, 1, -5)
        self.level = 0
        while True:
            code = self._probe()
            if not code:
                break
            if self.short:
                return code
            self.level += 1
        self.port.look_for_stop()
        survey.take_directions(rows[0], rows[1], rows[2], True)
        survey.set_point_limits(self.share)
        fastest = 1
        for i in range(registers.AXES):
            if survey.motor[i] and survey.curve[2 * i] > fastest:
                fastest = survey.curve[2 * i]
        reals.put(r, registers.FASTEST, fastest, 0)
        self.port.look_for_stop()
        compute(r, _FIRST_LENGTH)
        compute(r, _LENGTHEN)
        compute(r, _FIRST_HALF_CELL)
        survey.clear_greatest()
        self.level = 0
        return 0

    def _sample(self, halves, row):
        """Set SAMPLE to 1 or 2 half cells beyond END, and find the motors there. Return a code."""
        r = self.r
        self.port.look_for_stop()
        reals.double(r, registers.SAMPLE, registers.HALF_CELL, halves - 1 - self.level)
        reals.add(r, registers.SAMPLE, registers.END, registers.SAMPLE)
        return self.line.positions_at(registers.SAMPLE, row)

    def _probe(self, port=None):
        """Measure the cell after END. Return 0 or a code. port: see Survey.look()."""
        survey = self.survey
        rows = self.rows
        self.short = self.level == _HALVINGS
        code = self._sample(1, rows[1])
        if code:
            return code
        survey.look(port)
        if survey.is_short(rows[0], rows[1]):
            self.short = True
        code = self._sample(2, rows[2])
        if code:
            return code
        survey.look(port)
        survey.clear()
        if survey.measure(rows[0], rows[1], rows[2], self.level) != SMOOTH:
            return ERR_RANGE
        return survey.passed_bound(rows[0], rows[1], rows[2])

    def extend(self, more=False):
        """Survey another cell, a step at a time, or find that it must be shorter. Return False if
        there is nothing to do.

        more: the next knot needs more than CELLS cells, as they get short toward a bound.
        """
        if self.step == _PROBE:
            if self.closed or self.count >= (_RING - 1 if more else CELLS):
                return False
            self.port.glance()
            if not self._probe(self.port):
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
            self._compute_exits()
            self.step = _PROBE
        return True

    def _append(self):
        """Add the cell that has been probed, from END to SAMPLE."""
        survey = self.survey
        r = self.r
        survey.set_point_limits(self.share, self.port)
        reals.double(r, registers.CELL_LENGTH, registers.HALF_CELL, 1 - self.level)
        compute(r, _CELL_ENDS)
        cells = self.cells
        if self.count or self.behind:
            k = _CELL * ((self.head + self.count - 1) % _RING)
            reals.fetch(r, registers.CELL_A, cells, k + _A)
            compute(r, _LIKE_BEFORE)
        k = _CELL * ((self.head + self.count) % _RING)
        self.behind = min(self.behind, _RING - 1 - self.count)
        reals.fetch(cells, k + _END, r, registers.SAMPLE)
        reals.fetch(cells, k + _V, r, registers.MAX_V)
        reals.fetch(cells, k + _A, r, registers.MAX_A)
        reals.fetch(cells, k + _LENGTH, r, registers.CELL_LENGTH)
        cells[k + _SPAN] = survey.span
        reals.copy(r, registers.END, registers.SAMPLE)
        rows = self.rows
        rows[0], rows[2] = rows[2], rows[0]
        if self.level:
            self.level -= 1
            return
        # away from slow parts cells get longer
        compute(r, _LENGTHEN)
        if compute(r, _DOUBLE_CELL):
            for i in range(registers.AXES):
                survey.greatest[i] = min(survey.greatest[i], _LARGE) * 2

    def _compute_exits(self):
        """Compute how fast each cell may be left, so that the point can come to rest at the end of
        the survey."""
        r = self.r
        cells = self.cells
        reals.put(r, registers.ENTRY_V2, 0, 0)
        i = self.count - 1
        while i >= 0:
            before = k = _CELL * ((self.head + i) % _RING)
            if i or self.behind:
                before = _CELL * ((self.head + i - 1) % _RING)
            reals.fetch(r, registers.CELL_V, cells, k + _V)
            reals.fetch(r, registers.CELL_A, cells, k + _A)
            reals.fetch(r, registers.BEFORE_A, cells, before + _A)
            reals.fetch(r, registers.CELL_LENGTH, cells, k + _LENGTH)
            compute(r, _LEAVE_CELL)
            reals.fetch(cells, k + _EXIT, r, registers.EXIT_V2)
            if not i & 3:
                self.port.glance()
            i -= 1

    def back(self):
        """Go back to the cell of S. Return False if it is not kept any more."""
        r = self.r
        cells = self.cells
        self.closed = True
        while self.behind:
            k = _CELL * ((self.head - 1) % _RING)
            reals.fetch(r, registers.CELL_END, cells, k + _END)
            if reals.compare(r, registers.CELL_END, registers.S) <= 0:
                return True
            self.head = (self.head - 1) % _RING
            self.count += 1
            self.behind -= 1
        # the first cell kept
        k = _CELL * self.head
        reals.fetch(r, registers.CELL_END, cells, k + _END)
        reals.fetch(r, registers.CELL_LENGTH, cells, k + _LENGTH)
        return bool(compute(r, _IS_WITHIN))

    def load_limits(self):
        """Set MAX_V, MAX_A and LEFT for the point. Return False if nothing is surveyed there."""
        r = self.r
        cells = self.cells
        if not self.count:
            return False
        while self.count > 1:
            reals.fetch(r, registers.CELL_END, cells, _CELL * self.head + _END)
            if reals.compare(r, registers.CELL_END, registers.S) > 0:
                break
            self.head = (self.head + 1) % _RING
            self.count -= 1
            self.behind += 1
        span = cells[_CELL * self.head + _SPAN]
        compute(r, _NO_LIMIT)
        for i in range(self.count):
            k = _CELL * ((self.head + i) % _RING)
            reals.fetch(r, registers.CELL_END, cells, k + _END)
            reals.fetch(r, registers.CELL_V, cells, k + _V)
            reals.fetch(r, registers.CELL_A, cells, k + _A)
            reals.fetch(r, registers.EXIT_V2, cells, k + _EXIT)
            compute(r, _LIMIT)
            span = min(span, cells[k + _SPAN])
            if i == 0:
                compute(r, _REACH)
            if reals.compare(r, registers.CELL_END, registers.REACH_S) > 0:
                break
        compute(r, _LEFT)
        self.survey.span = span
        return True
