"""Limits of the point that moves along a line, from the limits of the motors.

The line is sampled in cells of two halves. The differences d1, d2 of a motor's steps and the second
difference dd = d2 - d1 bound its slope and its bend in the cell. A cell in which they change too
much is halved. With the greatest slope F and bend G, and v and a of the point: F·v <= velocity,
F·a + G·v² <= acceleration. At most half of the acceleration is given to the bend.

A move is surveyed as a whole before it starts, and has one v and one a. A jog has no known end, so
lookahead.py surveys it cell by cell. Nothing allocates after construction.
"""

from array import array

from framestep.base.native import const, micropython, ptr32
from framestep.base.results import ERR_RANGE
from framestep.motion import reals
from framestep.motion.compute import compute
from framestep.motion.formula import formula
from framestep.motors.rates import MAX_ACCELERATION, MAX_VELOCITY
from framestep.virtual_axes import registers
from framestep.virtual_axes.line import CODE_HIGH, CODE_LOW, HIGH, LOW, ROW, SURVEY

SPAN = const(32)  # ticks from knot to knot, at most: one segment

_CELLS = const(8)  # of a whole line, before any is halved
_WHOLE_CELL = const(1024)  # its size; it may be halved nine times
_MOST_CELLS = const(96)
_SIXTEENTHS = const(4)  # of a step, as shift
_NOISE = const(4)  # rounding in a second difference, sixteenths
_SMALL_BEND = const(32)  # a negligible bend, sixteenths
_TOLERANCE = const(0x1000)  # Q16: how far a position may exceed a bound, as a survey is rounded

SMOOTH = const(0)
_BENT = const(1)  # the cell has to be halved
_FAR = const(2)  # too far to be counted

# 2^40 is greater than any limit and any distance. Only 10000 / 10320 of the motors' limits are
# used, since a survey cannot see everything.
_NO_LIMIT = formula(
    registers,
    """
    MAX_V = 2 ** 40
    MAX_A = MAX_V
    BEND_V2 = MAX_V
    SHARE = SHARE / 10320
    """,
)

# Limits of the point from a motor's limits, in half cells per tick.
_LIMIT_V = formula(
    registers,
    """
    MAX_V = min(MAX_V, MOTOR_V / SLOPE)
    assert BEND > ZERO
    BEND_V2 = min(BEND_V2, MOTOR_A / (2 * BEND))  # half of the acceleration
    """,
)
_LIMIT_V_IN_BENDS = formula(registers, "MAX_V = min(MAX_V, sqrt(BEND_V2)) * SHARE")
_LIMIT_A = formula(registers, "MAX_A = min(MAX_A, (MOTOR_A - BEND * (MAX_V * MAX_V)) / SLOPE)")
_IN_UNITS = formula(
    registers,
    """
    MAX_V = MAX_V * HALF_CELL
    MAX_A = MAX_A * HALF_CELL * SHARE
    """,
)

# A cubic from knot to knot has to approximate the motor's path. With the third derivative d the
# slopes at the knots are wrong by up to d·h²/6, which displaces the cubic by d·h³/60. Toward a
# singular pose, where the path goes like a square root, d is 3·G²/F. With h = v·span the error
# stays below a quarter of a step for v³·G²/F < 5/span³.
_THIRD = formula(registers, "THIRD = BEND * BEND / SLOPE")
_IS_SMOOTH = formula(registers, "assert MAX_V * MAX_V * MAX_V * THIRD < 5 / 32 ** 3")
_IS_SMOOTH_AT_HALF_SPAN = formula(registers, "assert MAX_V * MAX_V * MAX_V * THIRD < 5 / 16 ** 3")
_SLOWER = formula(registers, "MAX_V = MAX_V * 0.875")


@micropython.viper
def _inside(rows: ptr32, a: int, b: int, c: int, bounds: ptr32, motor: ptr32) -> int:
    """Return the code of the bound that a motor passes in a cell, or 0. a, b, c: rows at its start,
    middle and end.

    Only for cells that _measure() has accepted.
    """
    k = 0
    i = 0
    while i < registers.AXES:
        if motor[i + 0]:
            d = ((rows[b + 0] - rows[a + 0]) << 4) + ((rows[b + 1] - rows[a + 1]) >> 12)
            e = ((rows[c + 0] - rows[b + 0]) << 4) + ((rows[c + 1] - rows[b + 1]) >> 12)
            # at a turning point the curve may go a little beyond the middle of the cell
            more = 0
            if (d > 0 and e < 0) or (d < 0 and e > 0):
                more = (d - e) >> 3
            middle = rows[b + 0] + (more >> 4)
            part = rows[b + 1] + ((more & 15) << 12)
            # rounded up, and then down
            slack = 0xFFFF - _TOLERANCE - (bounds[k + CODE_HIGH] >> 8)
            bound = bounds[k + HIGH]
            last = rows[c + 0] + ((rows[c + 1] + slack) >> 16)
            if middle + ((part + slack) >> 16) > bound or last > bound:
                return bounds[k + CODE_HIGH] & 0xFF
            slack = _TOLERANCE + (bounds[k + CODE_LOW] >> 8)
            bound = bounds[k + LOW]
            last = rows[c + 0] + ((rows[c + 1] + slack) >> 16)
            if middle + ((part + slack) >> 16) < bound or last < bound:
                return bounds[k + CODE_LOW] & 0xFF
        a += 2
        b += 2
        c += 2
        k += 4
        i += 1
    return 0


@micropython.viper
def _measure(
    rows: ptr32, a: int, b: int, c: int, motor: ptr32, curve: ptr32, greatest: ptr32, level: int
) -> int:
    """Measure a cell into `curve`: the greatest slope and bend so far of each axis.

    They are in sixteenths of a step per half cell of level 0, and per its square. greatest: the
    slopes alone, to judge bends by. level: how often the cell has been halved.
    """
    turn = 0
    while turn < 2:
        i = 0
        while i < registers.AXES:
            if motor[i + 0]:
                k = 2 * i
                x = rows[a + k]
                y = rows[b + k]
                z = rows[c + k]
                d = ((y >> 1) - (x >> 1)) >> (24 - level)
                e = ((z >> 1) - (y >> 1)) >> (24 - level)
                if d > 0 or d < -1 or e > 0 or e < -1:
                    return _FAR
                # in sixteenths of a step per half cell of level 0, including the fractions
                d = ((y - x) << (4 + level)) + ((rows[b + k + 1] - rows[a + k + 1]) >> (12 - level))
                e = ((z - y) << (4 + level)) + ((rows[c + k + 1] - rows[b + k + 1]) >> (12 - level))
                bend = e - d
                if bend < 0:
                    bend = 0 - bend
                if d < 0:
                    d = 0 - d
                if e < 0:
                    e = 0 - e
                if e > d:
                    d = e
                bend -= _NOISE << level
                if bend < 0:
                    bend = 0
                # a parabola's slope at the end of the cell, and what a cubic adds to its bend there
                d += (bend >> 1) + 1
                if d >> 29 or bend >> 28:
                    return _FAR
                more = bend // ((d >> 3) + 1)
                if more > 8:
                    more = 8
                more = bend + (bend >> 1) * more
                if more >> (29 - level):
                    return _FAR
                more = more << level
                if turn:
                    if curve[k + 0] < d:
                        curve[k] = d
                    if curve[k + 1] < more:
                        curve[k + 1] = more
                    if greatest[i + 0] < d:
                        greatest[i] = d
                else:
                    if greatest[i + 0] > d:
                        d = greatest[i + 0]
                    if bend > _SMALL_BEND << level and bend > d >> 3:
                        return _BENT
            i += 1
        turn += 1
    return SMOOTH


@micropython.viper
def _short(rows: ptr32, a: int, b: int) -> int:
    """Return whether from row a to row b each motor moves by less than an eighth of a step."""
    end = a + ROW
    while a < end:
        d = rows[b + 0] - rows[a + 0]
        if d > 1 or d < -1:
            return 0
        d = (d << 16) + rows[b + 1] - rows[a + 1]
        if d > 0x2000 or d < -0x2000:
            return 0
        a += 2
        b += 2
    return 1


@micropython.viper
def _heading(rows: ptr32, a: int, b: int) -> int:
    """Return negative, 0 or positive: the position in rows[b] is below, at or above the one in
    rows[a]."""
    d = rows[b + 0] - rows[a + 0]
    if d > 1 or d < -1:
        return d
    d = (d << 16) + rows[b + 1] - rows[a + 1]
    if d < 0x800 and d > -0x800:
        return 0
    return d


class Survey:
    """Survey of one line at a time."""

    def __init__(self, line):
        self.line = line
        self.r = line.r
        self.axes = line.axes
        self.motor = line.motor
        self.rows = line.rows
        self.curve = array("i", [0] * (2 * registers.AXES))
        self.greatest = array("i", [0] * registers.AXES)
        self.directions = array("i", [0] * registers.AXES)  # first direction of each motor
        self.span = SPAN  # ticks from knot to knot

    def check_line(self):
        """Return a code: whether the motors can follow the line from 0 to END. If so, set MAX_V and
        MAX_A."""
        r = self.r
        reals.double(r, registers.HALF_CELL, registers.END, -4)
        self.clear()
        self.clear_greatest()
        a = SURVEY
        b = SURVEY + ROW
        c = SURVEY + 2 * ROW
        at = 0
        size = _WHOLE_CELL
        level = 0
        left = _MOST_CELLS
        code = self._sample(size, c)
        while not code:
            code = self._sample(at + size // 2, b)
            if code:
                break
            found = self.measure(a, b, c, level)
            left -= 1
            if found == _BENT and size > 2 and left:
                b, c = c, b
                size //= 2
                level += 1
                continue
            if found != SMOOTH:
                # too near to a pose in which a motor would have to be infinitely fast
                return ERR_RANGE
            code = self.passed_bound(a, b, c)
            if code:
                return code
            self.axes.hal.port.look_for_stop()
            self.take_directions(a, b, c, at == 0)
            at += size
            if at == _CELLS * _WHOLE_CELL:
                self.set_point_limits(10000)
                return 0
            a, c = c, a
            if level and at % (2 * size) == 0:
                size *= 2
                level -= 1
            code = self._sample(at + size, c)
        return code

    def _sample(self, part, row):
        """Find the motors' positions at a part of the line, in 8192nds. Return a code."""
        r = self.r
        self.line.axes.hal.port.look_for_stop()
        reals.put(r, registers.SAMPLE, part, -13)
        reals.multiply(r, registers.SAMPLE, registers.SAMPLE, registers.END)
        return self.line.positions_at(registers.SAMPLE, row)

    # ---------------------------------------------------------------- cells; a, b, c: their rows

    def clear(self):
        """Drop the slopes and bends of the measured cells."""
        for i in range(2 * registers.AXES):
            self.curve[i] = 0

    def clear_greatest(self):
        """Drop the slopes by which bends are judged."""
        for i in range(registers.AXES):
            self.greatest[i] = 0

    def measure(self, a, b, c, level):
        """Measure a cell: see _measure."""
        return _measure(self.rows, a, b, c, self.motor, self.curve, self.greatest, level)

    def is_short(self, a, b):
        """Return whether a half cell is short: see _short."""
        return _short(self.rows, a, b)

    def passed_bound(self, a, b, c):
        """Return the code of a passed bound: see _inside."""
        return _inside(self.rows, a, b, c, self.line.bounds, self.motor)

    def take_directions(self, a, b, c, first):
        """Note in which direction each motor starts, from the next cell of the line or the first.

        A motor that does not move until a later cell has no direction yet.
        """
        for i in range(registers.AXES):
            if first:
                self.directions[i] = 0
            if not self.directions[i]:
                direction = _heading(self.rows, a + 2 * i, b + 2 * i)
                self.directions[i] = direction or _heading(self.rows, b + 2 * i, c + 2 * i)

    # ---------------------------------------------------------------- limits

    def _load_motor(self, i):
        """Load SLOPE, BEND and the limits of the motor of axis i. Return False if there is none."""
        motor = self.motor[i] - 1
        if motor < 0:
            return False
        r = self.r
        numbers = self.axes[motor].numbers
        reals.put(r, registers.SLOPE, self.curve[2 * i], -_SIXTEENTHS)
        reals.put(r, registers.BEND, self.curve[2 * i + 1], -_SIXTEENTHS)
        reals.fetch(r, registers.MOTOR_V, numbers, MAX_VELOCITY)
        reals.fetch(r, registers.MOTOR_A, numbers, MAX_ACCELERATION)
        return True

    def set_point_limits(self, share, port=None):
        """Set MAX_V, MAX_A and `span` from `curve`, with `share` ten-thousandths of the motors'
        limits. port: see look()."""
        r = self.r
        reals.put(r, registers.SHARE, share, 0)
        compute(r, _NO_LIMIT)
        for i in range(registers.AXES):
            if self._load_motor(i):
                compute(r, _LIMIT_V)
            if i & 1:
                self.look(port)
        compute(r, _LIMIT_V_IN_BENDS)
        self.span = SPAN
        for i in range(registers.AXES):
            if self.motor[i] and self.curve[2 * i + 1]:
                self._smoothen(i)
        self.look(port)
        for i in range(registers.AXES):
            if self._load_motor(i):
                compute(r, _LIMIT_A)
            if i & 1:
                self.look(port)
        compute(r, _IN_UNITS)

    def look(self, port):
        """Answer a question that has come; without a port only begin a stop, within a request."""
        if port:
            port.glance()
        else:
            self.axes.hal.port.look_for_stop()

    def _smoothen(self, i):
        """Lower `span`, and if need be MAX_V, until cubics approximate the path of axis i."""
        r = self.r
        reals.put(r, registers.BEND, self.curve[2 * i + 1], -_SIXTEENTHS)
        reals.put(r, registers.SLOPE, self.greatest[i], -_SIXTEENTHS)
        compute(r, _THIRD)
        while not compute(r, _IS_SMOOTH):
            self.span = SPAN // 2
            if compute(r, _IS_SMOOTH_AT_HALF_SPAN):
                break
            compute(r, _SLOWER)

    def slow_down(self):
        """Adapt to motors that may now be slower than the present move assumes, from the next knot
        on."""
        r = self.r
        span = self.span
        reals.copy(r, registers.NEXT_V, registers.MAX_V)
        reals.copy(r, registers.TO_END, registers.MAX_A)
        self.set_point_limits(10000)
        reals.copy(r, registers.MAX_A, registers.TO_END)  # it has to slow down first
        self.span = min(span, self.span)
        if reals.compare(r, registers.NEXT_V, registers.MAX_V) < 0:
            reals.copy(r, registers.MAX_V, registers.NEXT_V)
