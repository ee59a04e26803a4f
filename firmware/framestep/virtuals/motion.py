"""Motion along a line in virtual space: all motors of a rig at once, as one point that runs along the line.

A line is POSE = BASE + s·WAY, s from 0 on, or with an aim point JOINT = BASE + s·WAY, where a single motor is asked
for. While an aim point is on, pan and tilt are its direction and an offset, to which WAY adds.
`place` says for an s where every motor has to stand. A point moves along
s with one trapezoid: from knot to knot, `span` ticks apart, its velocity changes as far as its limits and the way that
is left allow. Between two knots every motor follows a cubic (AIM phases, motion/ramps.py) with the exact positions at
both ends; its velocity there is the point's velocity times the slope of the motor's step over s, from the knots on
either side.

Limits. What the motors can do is turned into limits of the point by surveying the line in cells of two halves. The
differences d1, d2 of a motor's steps and the second difference dd = d2 - d1 bound its slope and its bend in the
cell; a cell in which they change too much is halved. With F and G the greatest slope and bend, v and a those
of the point: F·v <= velocity, F·a + G·v² <= acceleration; half of the acceleration at most is given to the bend.
A move is surveyed whole before it starts, and has one v and one a. A jog has no end that is known: it is surveyed
some cells ahead, each with its own v and a, and never goes faster than it can stop within what has been surveyed.

Knots lie on whole ticks and a span is one segment, so the queues of all motors can be cut at the same knot and
planned anew from there: that is how a point in motion is stopped on its line.

Time in ticks, positions of motors in steps, s in units or degrees. Nothing allocates after construction.
"""

from array import array

from framestep import results as m
from framestep.clock import HALF as _HALF
from framestep.clock import WRAP as _WRAP
from framestep.motion import reals, stepper
from framestep.motion.reals import combine, multiply, order_words, put
from framestep.motors.motor import MAX_ACCELERATION, MAX_VELOCITY
from framestep.native import const, micropython, ptr32
from framestep.virtuals import aim
from framestep.virtuals.geometry import AXES, JOINT, PER_UNIT, POSE, REGISTERS

# States
IDLE = const(0)
STARTING = const(1)  # the first knots are being planned
MOVING = const(2)
HALTED = const(3)  # the motors ramp down by themselves
TAKING_UP = const(4)  # play is made for the direction in which each motor is to start
SETTLING = const(5)  # at the end of the line: motors that have turned take up their play

# Registers, after those of the geometry
BASE = const(REGISTERS)  # six: the pose at s = 0
WAY = const(REGISTERS + 12)  # six: what s adds to it
OFFSETS = const(REGISTERS + 24)  # pan and tilt less the direction of the aim point
_AIMED = const(REGISTERS + 68)  # that direction at s = 0
END = const(REGISTERS + 28)  # s at which the line ends; of a jog, up to which it has been surveyed
TOP = const(REGISTERS + 30)  # limits of the point
STEEP = const(REGISTERS + 32)
HALF_CELL = const(REGISTERS + 34)
S = const(REGISTERS + 36)  # where the knot planned last lies, and its velocity
V = const(REGISTERS + 38)
_T = const(REGISTERS + 40)  # ticks from the knot before to it
_LAST_T = const(REGISTERS + 42)
LEFT = const(REGISTERS + 44)  # way to where the point has to stand if it goes on as it may
_NEXT = const(REGISTERS + 46)
_A = const(REGISTERS + 48)
_P = const(REGISTERS + 50)
_Q = const(REGISTERS + 52)
_X = const(REGISTERS + 54)
_Y = const(REGISTERS + 56)
_Z = const(REGISTERS + 58)
_W = const(REGISTERS + 60)
_ZERO = const(REGISTERS + 62)
_AT = const(REGISTERS + 66)
_REST = const(REGISTERS + 72)  # six: the pose in which it has come to rest, but for the rounding to steps
FIRST_FREE = const(REGISTERS + 84)

SPAN = const(32)  # ticks from knot to knot, at most: one segment
_BEGIN = const(4)  # knots queued before anything moves
_AHEAD_TICKS = const(256)  # to plan ahead
_SCARCE_TICKS = const(128)  # with less than this a knot comes before a survey
_NOTICE = const(40)  # ticks from a request to the first knot that it may change
_KNOTS = const(16)  # remembered

ROW = const(12)  # words of the places of all motors: step and Q16 fraction of each
_ROWS = const(16)  # of knots; then those of the survey
SURVEY = const(192)  # ROW * _ROWS

# The survey
_CELLS = const(8)  # of a whole line, before any is halved
_WHOLE_CELL = const(1024)  # its size, in parts that may be halved nine times
_MOST_CELLS = const(96)
_SIXTEENTHS = const(4)  # of a step, as shift
_TURNS = const(20)  # of pan and tilt until they are as the aim point asks
_NOISE = const(4)  # sixteenths of a second difference that are rounding
_SMALL_BEND = const(32)  # sixteenths that make no difference
_MARGIN = const(10320)  # what the motors can do is taken for 10000 / 10320 of it: 3 % for what a survey cannot see


# Words per motor of `bounds`
_LOW = const(0)
_HIGH = const(1)
_CODE_LOW = const(2)  # and from bit 8 on: by how much (Q16) the line begins past the bound, by rounding
_CODE_HIGH = const(3)
_HAIR = const(0x1000)  # Q16: what a place may be past a bound: the rounding of a survey

_SEVEN_EIGHTHS = const(0xE000)  # Q16: a path that stays within so much of a step makes no other


@micropython.viper
def along(r, to: int, base: int, way: int, s: int, spare: int):
    """Six numbers: r[to] = r[base] + r[way]·r[s]"""
    k = 0
    while k < 12:
        multiply(r, spare, way + k, s)
        combine(r, to + k, base + k, spare, 0)
        k += 2


@micropython.viper
def _loosen(bounds: ptr32, rows: ptr32, a: int, motor: ptr32):
    """Take into `bounds` how far the places of a row lie past them, which are within a step of the motors."""
    k = 0
    i = 0
    while i < AXES:
        if motor[i + 0]:
            if (rows[a + 0] >> 2) - (bounds[k + _HIGH] >> 2) > -2:
                d = ((rows[a + 0] - bounds[k + _HIGH]) << 16) + rows[a + 1]
                if d > 0:
                    bounds[k + _CODE_HIGH] = bounds[k + _CODE_HIGH] + (d << 8)
            if (rows[a + 0] >> 2) - (bounds[k + _LOW] >> 2) < 2:
                d = ((bounds[k + _LOW] - rows[a + 0]) << 16) - rows[a + 1]
                if d > 0:
                    bounds[k + _CODE_LOW] = bounds[k + _CODE_LOW] + (d << 8)
        a += 2
        k += 4
        i += 1


@micropython.viper
def _inside(rows: ptr32, a: int, b: int, c: int, bounds: ptr32, motor: ptr32) -> int:
    """The code of the bound that a motor passes in a cell with these rows at its start, middle and end, or 0.

    Only of cells that _measure() has taken.
    """
    k = 0
    i = 0
    while i < AXES:
        if motor[i + 0]:
            d = ((rows[b + 0] - rows[a + 0]) << 4) + ((rows[b + 1] - rows[a + 1]) >> 12)
            e = ((rows[c + 0] - rows[b + 0]) << 4) + ((rows[c + 1] - rows[b + 1]) >> 12)
            # at a turning point the curve may go a little farther than the middle of the cell
            more = 0
            if (d > 0 and e < 0) or (d < 0 and e > 0):
                more = (d - e) >> 3
            middle = rows[b + 0] + (more >> 4)
            part = rows[b + 1] + ((more & 15) << 12)
            # rounded up, and then down
            slack = 0xFFFF - _HAIR - (bounds[k + _CODE_HIGH] >> 8)
            bound = bounds[k + _HIGH]
            if middle + ((part + slack) >> 16) > bound or rows[c + 0] + ((rows[c + 1] + slack) >> 16) > bound:
                return bounds[k + _CODE_HIGH] & 0xFF
            slack = _HAIR + (bounds[k + _CODE_LOW] >> 8)
            bound = bounds[k + _LOW]
            if middle + ((part + slack) >> 16) < bound or rows[c + 0] + ((rows[c + 1] + slack) >> 16) < bound:
                return bounds[k + _CODE_LOW] & 0xFF
        a += 2
        b += 2
        c += 2
        k += 4
        i += 1
    return 0


SMOOTH = const(0)
_BENT = const(1)  # the cell is to be halved
_FAR = const(2)  # farther than can be counted


@micropython.viper
def _measure(rows: ptr32, a: int, b: int, c: int, motor: ptr32, curve: ptr32, greatest: ptr32, level: int) -> int:
    """Take a cell into `curve`: per axis the greatest slope and bend so far, in sixteenths of a step per half cell of
    level 0, and per its square. greatest: the slopes alone, to judge a bend by. level: how often the cell is halved."""
    turn = 0
    while turn < 2:
        i = 0
        while i < AXES:
            if motor[i + 0]:
                k = 2 * i
                x = rows[a + k]
                y = rows[b + k]
                z = rows[c + k]
                d = ((y >> 1) - (x >> 1)) >> (24 - level)
                e = ((z >> 1) - (y >> 1)) >> (24 - level)
                if d > 0 or d < -1 or e > 0 or e < -1:
                    return _FAR
                # in sixteenths of a step per half cell of level 0, with what there is of fractions of that
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
    """Whether from row a to row b each motor moves by less than an eighth of a step."""
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
def _velocity(r, to: int, rows, a: int, b: int, c: int, before: int, after: int, spare: int):
    """r[to] = (q(b) - q(a))·r[before] + (q(c) - q(b))·r[after], q being the place in a row."""
    q = ptr32(rows)
    put(r, to, ((q[b + 0] - q[a + 0]) << 16) + q[b + 1] - q[a + 1], -16)
    multiply(r, to, to, before)
    put(r, spare, ((q[c + 0] - q[b + 0]) << 16) + q[c + 1] - q[b + 1], -16)
    multiply(r, spare, spare, after)
    combine(r, to, to, spare, 0)


@micropython.viper
def _way(rows: ptr32, a: int, b: int) -> int:
    """The way from the place in rows[a] to that in rows[b], eightfold, in Q16: up to a step."""
    d = ((rows[b + 0] - rows[a + 0]) << 16) + rows[b + 1] - rows[a + 1]
    if d > 0x2000:
        d = 0x2000
    elif d < -0x2000:
        d = -0x2000
    return d << 3


@micropython.viper
def _aimed(out: ptr32, rows, a: int, b: int, c: int, leads, i: int, bounds) -> int:
    """Where the path of a motor, of axis i, leads to for the place in rows[b], between those in rows[a] and rows[c]:
    out[0], and its fraction (Q16).

    A step is made when the path reaches it, so with a path through the places a motor would lag by half a step on
    average. So the path leads by half a step in the direction of the motion. The lead (leads[i], Q16) is what the way
    makes of it, eightfold: where a place does not change the path does not either, so a motor that stands, between
    two steps by what the line asks for, makes none. A step past its bounds is not reached.
    """
    q = ptr32(rows)
    lead = ptr32(leads)
    bound = ptr32(bounds)
    whole = q[b + 0]
    part = q[b + 1]
    d = lead[i + 0] + int(_way(rows, a, b))
    if d > 0x8000:
        d = 0x8000
    elif d < -0x8000:
        d = -0x8000
    ahead = int(_way(rows, b, c))
    # none where it is about to turn
    if d > 0 and ahead < 0:
        d += ahead
        if d < 0:
            d = 0
    elif d < 0 and ahead > 0:
        d += ahead
        if d > 0:
            d = 0
    lead[i] = d
    part += d
    whole += part >> 16
    part = part & 0xFFFF
    i = 4 * i
    d = bound[i + _HIGH]
    if whole > d or (whole == d and part > _SEVEN_EIGHTHS):
        whole = d
        part = _SEVEN_EIGHTHS
    d = bound[i + _LOW]
    if whole < d and (whole < d - 1 or part < 0x10000 - _SEVEN_EIGHTHS):
        whole = d - 1
        part = 0x10000 - _SEVEN_EIGHTHS
    out[0] = whole
    return part


@micropython.viper
def _lead(leads: ptr32, i: int, at: ptr32, j: int, part: int, rows: ptr32, k: int):
    """leads[i] for a path that is at the step at[j] and a part (Q16) of one more where the place is that in rows[k]."""
    leads[i] = ((at[j + 0] - rows[k + 0]) << 16) + part - rows[k + 1]


@micropython.viper
def _heading(rows: ptr32, a: int, b: int) -> int:
    """Negative, 0 or positive: whether the place in rows[b] lies below, at or above that in rows[a]."""
    d = rows[b + 0] - rows[a + 0]
    if d > 1 or d < -1:
        return d
    d = (d << 16) + rows[b + 1] - rows[a + 1]
    if d < 0x800 and d > -0x800:
        return 0
    return d


@micropython.viper
def _nearest(out: ptr32, j: int, rows: ptr32, k: int, present: ptr32, motor: int):
    """out[j] = the step nearest to the place in rows[k]; of two about as near that on which the motor has been."""
    step = present[motor + 0]
    out[j] = step
    d = (rows[k + 0] >> 2) - (step >> 2)
    if d < 2 and d > -2:
        d = ((rows[k + 0] - step) << 16) + rows[k + 1]
        if d < 0x9000 and d > -0x9000:
            return
    out[j] = rows[k + 0] + (rows[k + 1] >> 15)


@micropython.viper
def _landed(out, part: int, rows, k: int, present, motor: int, up: int) -> int:
    """Where a path that leads to out[0] and a part (Q16) has to end for the motor to come to rest on the step nearest
    to the place in rows[k]: out[0], and Q16 of one more.

    up: whether it leads upward. It ends beside that step, as it has come, rather than turn back onto it.
    """
    _nearest(out, 1, rows, k, present, motor)
    at = ptr32(out)
    d = ((at[0] - at[1]) << 16) + part
    if up:
        if d < 0:
            d = 0
        elif d > _SEVEN_EIGHTHS:
            d = _SEVEN_EIGHTHS
    elif d > 0:
        d = 0
    elif d < 0 - _SEVEN_EIGHTHS:
        d = 0 - _SEVEN_EIGHTHS
    at[0] = at[1] + (d >> 16)
    return d & 0xFFFF


@micropython.viper
def _hold(bounds: ptr32, k: int, present: ptr32, motor: int, target, j: int) -> int:
    t = ptr32(target)[j + 0]
    if t > present[motor + 0]:
        if t < bounds[k + _HIGH]:
            bounds[k + _HIGH] = t
        return 1
    if t < present[motor + 0]:
        if t > bounds[k + _LOW]:
            bounds[k + _LOW] = t
        return -1
    return 0


@micropython.viper
def _tiny(r: ptr32, a: int) -> int:
    """Whether an angle r[a] is below 2^-16 degrees."""
    if r[a + 0] == 0 or r[a + 1] < -46:
        return 1
    return 0


@micropython.viper
def _near(rows: ptr32, k: int, present: ptr32, motor: int) -> int:
    """Whether the place in rows[k] is within a step of where the motor is."""
    d = (rows[k + 0] >> 2) - (present[motor + 0] >> 2)
    if d > 1 or d < -1:
        return 0
    d = ((rows[k + 0] - present[motor + 0]) << 16) + rows[k + 1]
    if d > 0x10000 or d < -0x10000:
        return 0
    return 1


class Motion:
    """Runs one line at a time. r: array('i') of FIRST_FREE words, which the geometries share."""

    def __init__(self, axes, safety, r):
        self.axes = axes
        self.safety = safety
        self.r = r
        self.rig = None  # the Geometry configured
        self.guide = None  # of a jog: surveys the line ahead of the point
        self.state = IDLE
        self.bits = 0  # motors of the rig
        self.motor = array("i", [0] * AXES)  # of each axis of the rig, from 1; 0 for none
        self.rows = array("i", [0] * (SURVEY + 3 * ROW))
        self.speeds = array("i", [0] * (ROW * _KNOTS))  # of the motors at each knot: reals
        self.marks = array("i", [0] * (4 * _KNOTS))  # s and velocity of the point at each knot: reals
        self.times = array("i", [0] * _KNOTS)  # ticks from the start of the motion to each knot
        self.curve = array("i", [0] * (2 * AXES))
        self.greatest = array("i", [0] * AXES)
        self.bounds = array("i", [0] * (4 * AXES))
        self.ways = array("i", [0] * AXES)  # in which each motor begins to move
        self.leads = array("i", [0] * AXES)  # by how much each motor's path leads at the last knot queued, Q16
        self.word = array("i", [0] * 2)
        self.rest = array("i", [0] * AXES)  # steps in which a line has ended
        self.rested = False
        self.present = array("i", [0] * axes.count)
        self.knot = 0  # the last knot that has been placed
        self.queued = 0  # the last one that a phase leads to
        self.tick = 0  # in which the motion has begun
        self.closed = True  # no further knots come
        self.stopping = False
        self.span = SPAN  # ticks to the next knot
        self.aiming = False  # pan and tilt follow the aim point
        self.by_joint = False  # the line is one of JOINTs
        reals.put(r, _ZERO, 0, 0)

    # ---------------------------------------------------------------- what requests ask

    @property
    def engaged(self):
        """Bits of the motors in a virtual motion, from its acknowledgement to its end."""
        return self.bits if self.state else 0

    def adopt(self, rig):
        """Make a configured geometry the rig, or none. At rest."""
        self.rig = rig
        self.rested = False
        self.bits = 0
        for i in range(AXES):
            self.motor[i] = rig.motor[i] if rig else 0
            if self.motor[i]:
                self.bits |= 1 << (self.motor[i] - 1)

    def locate(self):
        """POSE and JOINT of where the motors are. A code."""
        for i in range(self.axes.count):
            self.axes[i].position_to(self.present, i)
        return self.rig.locate(self.present)

    def lay(self, by_joint=False):
        """Begin a line where the rig stands: BASE is its pose, or its JOINTs, and WAY is to be filled in. A code."""
        code = self.locate()
        if not code and self.aiming:
            code = self._look_at()
        if code:
            return code
        r = self.r
        if self._rests():
            # so that rounding to steps does not add up from line to line
            for k in range(0, 2 * AXES, 2):
                reals.copy(r, POSE + k, _REST + k)
        self.by_joint = by_joint
        base = JOINT if by_joint else POSE
        for k in range(0, 2 * AXES, 2):
            reals.copy(r, BASE + k, base + k)
            reals.put(r, WAY + k, 0, 0)
        self._bound()
        self.guide = None
        # what the rig says of this pose must be where it stands: there may be two ways to take it
        code = self.place(_ZERO, SURVEY)
        if code:
            return code
        for i in range(AXES):
            if self.motor[i] and not _near(self.rows, SURVEY + 2 * i, self.present, self.motor[i] - 1):
                return m.ERR_RANGE
        _loosen(self.bounds, self.rows, SURVEY, self.motor)
        return 0

    def look_at(self):
        """Take the aim point as seen from here: pan and tilt keep what they have beside its direction. A code."""
        code = self.locate()
        if code:
            return code
        r = self.r
        for k in range(0, 4, 2):
            reals.put(r, OFFSETS + k, 0, 0)
        return self._look_at()

    def _look_at(self):
        """_AIMED for the pose located, and OFFSETS, unless they differ by less than a step from what they were."""
        r = self.r
        reals.copy(r, _AIMED, POSE + 6)
        reals.copy(r, _AIMED + 2, POSE + 8)
        code = aim.direction(r, _AIMED, _AIMED + 2)
        if code:
            return code
        for k in range(0, 4, 2):
            reals.subtract(r, _X, POSE + 6 + k, _AIMED + k)
            reals.subtract(r, _Y, _X, OFFSETS + k)
            reals.multiply(r, _Y, _Y, PER_UNIT + 6 + k)
            if reals.sign(r, _Y) < 0:
                reals.negate(r, _Y, _Y)
            reals.put(r, _Z, 3, -2)
            if reals.compare(r, _Y, _Z) > 0:
                reals.copy(r, OFFSETS + k, _X)
            reals.add(r, POSE + 6 + k, _AIMED + k, OFFSETS + k)
        return 0

    def _rest(self):
        """Remember the pose in which a line has ended."""
        if self.aiming or self.by_joint:
            return
        along(self.r, _REST, BASE, WAY, S, _X)
        for i in range(AXES):
            if self.motor[i]:
                self.axes[self.motor[i] - 1].position_to(self.rest, i)
        self.rested = True

    def _rests(self):
        """Whether the motors present are where the last line has left them."""
        if self.aiming or not self.rested:
            return False
        for i in range(AXES):
            if self.motor[i] and not reals.equal_words(self.rest, i, self.present, self.motor[i] - 1):
                return False
        return True

    def _bound(self):
        """What no motor may pass: its soft limits, and where it stands in a limit switch."""
        bounds = self.bounds
        for i in range(AXES):
            motor = self.motor[i] - 1
            if motor < 0:
                continue
            axis = self.axes[motor]
            ends = self.safety.active_limits(motor)
            k = 4 * i
            bounds[k + _CODE_LOW] = m.ERR_HARD_LOW if ends & 2 else m.ERR_SOFT_LOW
            bounds[k + _CODE_HIGH] = m.ERR_HARD_UP if ends & 1 else m.ERR_SOFT_UP
            # a motor that is past a limit may come back (field note 4.3)
            if ends & 2 or order_words(self.present, motor, axis.bounds, 0) < 0:
                reals.copy_word(bounds, k + _LOW, self.present, motor)
            else:
                reals.copy_word(bounds, k + _LOW, axis.bounds, 0)
            if ends & 1 or order_words(self.present, motor, axis.bounds, 1) > 0:
                reals.copy_word(bounds, k + _HIGH, self.present, motor)
            else:
                reals.copy_word(bounds, k + _HIGH, axis.bounds, 1)

    def narrowed(self, motor):
        """Whether soft limits of a motor (from 0) now leave less room than the motion under way has counted on."""
        bounds = self.axes[motor].bounds
        for i in range(AXES):
            if self.motor[i] == motor + 1:
                if order_words(bounds, 0, self.bounds, 4 * i + _LOW) > 0:
                    return True
                return order_words(bounds, 1, self.bounds, 4 * i + _HIGH) < 0
        return False

    def bound(self, i, target, j):
        """Let axis i go no farther than the step target[j], on which side it may be; -1, 0 or 1 tells which."""
        return _hold(self.bounds, 4 * i, self.present, self.motor[i] - 1, target, j)

    def side(self, i, target, j):
        """On which side of where axis i was at the start of the line the step target[j] lies: -1, 0 or 1."""
        return order_words(target, j, self.present, self.motor[i] - 1)

    def turned(self, i, a, b):
        """Which way the motor of axis i goes from the places in row a to those in row b: -1 or 1."""
        return order_words(self.rows, b + 2 * i, self.rows, a + 2 * i) or 1

    # ---------------------------------------------------------------- places on the line

    def place(self, s, row):
        """Where the motors stand at r[s], into rows[row …]. A code."""
        rig = self.rig
        r = self.r
        if self.by_joint:
            along(r, JOINT, BASE, WAY, s, _X)
            code = self._turn()
        else:
            along(r, POSE, BASE, WAY, s, _X)
            code = self._direct(POSE) if self.aiming else 0
            if not code:
                code = rig.inverse()
        if code:
            return code
        return rig.places(self.rows, row)

    def _direct(self, pose):
        """Turn the angles of r[pose] to the aim point, from the place of POSE. A code."""
        r = self.r
        reals.subtract(r, _X, pose + 6, _AIMED)
        reals.subtract(r, _Y, pose + 8, _AIMED + 2)
        # on a line its direction never turns by half a turn
        reals.copy(r, POSE + 6, _AIMED)
        code = aim.direction(r, POSE + 6, POSE + 8)
        reals.add(r, POSE + 6, POSE + 6, _X)
        reals.add(r, POSE + 8, POSE + 8, _Y)
        return code

    def _turn(self):
        """Turn pan and tilt of JOINT to the aim point. With a nodal offset that moves the camera as well. A code."""
        rig = self.rig
        r = self.r
        for _ in range(_TURNS):
            code = rig.forward()
            if code:
                return code
            reals.copy(r, _W, POSE + 6)
            reals.copy(r, _Z, POSE + 8)
            reals.add(r, POSE + 6, _AIMED, OFFSETS)
            reals.add(r, POSE + 8, _AIMED + 2, OFFSETS + 2)
            code = self._direct(POSE)
            if code:
                return code
            reals.subtract(r, _W, POSE + 6, _W)
            reals.subtract(r, _Z, POSE + 8, _Z)
            reals.add(r, JOINT + 6, JOINT + 6, _W)
            reals.add(r, JOINT + 8, JOINT + 8, _Z)
            if _tiny(r, _W) and _tiny(r, _Z):
                return 0
        return m.ERR_RANGE

    # ---------------------------------------------------------------- the survey

    def survey(self):
        """Whether the motors can follow the line from 0 to END: a code. If so TOP and STEEP are set."""
        r = self.r
        reals.double(r, HALF_CELL, END, -4)
        self.clear()
        self.greatest_clear()
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
                return m.ERR_RANGE  # too near to a pose in which a motor would have to be infinitely fast
            code = _inside(self.rows, a, b, c, self.bounds, self.motor)
            if code:
                return code
            self.head(a, b, c, at == 0)
            at += size
            if at == _CELLS * _WHOLE_CELL:
                self.rates(10000)
                return 0
            a, c = c, a
            if level and at % (2 * size) == 0:
                size *= 2
                level -= 1
            code = self._sample(at + size, c)
        return code

    def short(self, a, b):
        """See _short."""
        return _short(self.rows, a, b)

    def clear(self):
        """Forget the slopes and bends of the cells measured."""
        for i in range(2 * AXES):
            self.curve[i] = 0

    def greatest_clear(self):
        for i in range(AXES):
            self.greatest[i] = 0

    def measure(self, a, b, c, level):
        """See _measure."""
        return _measure(self.rows, a, b, c, self.motor, self.curve, self.greatest, level)

    def head(self, a, b, c, first):
        """Take the places in rows a, b and c for the next cell of the line, or the first: which way each motor sets
        out. One that does not move until a later cell has no way yet."""
        for i in range(AXES):
            if first:
                self.ways[i] = 0
            if not self.ways[i]:
                self.ways[i] = _heading(self.rows, a + 2 * i, b + 2 * i) or _heading(self.rows, b + 2 * i, c + 2 * i)

    def inside(self, a, b, c):
        """See _inside."""
        return _inside(self.rows, a, b, c, self.bounds, self.motor)

    def _sample(self, part, row):
        """place() at a part of the line in 8192nds."""
        r = self.r
        reals.put(r, _AT, part, -13)
        reals.multiply(r, _AT, _AT, END)
        return self.place(_AT, row)

    def rates(self, share):
        """TOP and STEEP from `curve`: with `share` ten-thousandths of what the motors can do."""
        r = self.r
        curve = self.curve
        first = True
        bent = False
        for i in range(AXES):
            motor = self.motor[i] - 1
            if motor >= 0:
                numbers = self.axes[motor].numbers
                reals.put(r, _P, curve[2 * i], -_SIXTEENTHS)
                reals.fetch(r, _X, numbers, MAX_VELOCITY)
                reals.divide(r, _X, _X, _P)
                if first or reals.compare(r, _X, TOP) < 0:
                    reals.copy(r, TOP, _X)
                    first = False
                if curve[2 * i + 1]:
                    # v² = A / 2G
                    reals.put(r, _P, curve[2 * i + 1], 1 - _SIXTEENTHS)
                    reals.fetch(r, _X, numbers, MAX_ACCELERATION)
                    reals.divide(r, _X, _X, _P)
                    if not bent or reals.compare(r, _X, _Q) < 0:
                        reals.copy(r, _Q, _X)
                        bent = True
        if bent:
            reals.root(r, _Y, _Q)
            if reals.compare(r, _Y, TOP) < 0:
                reals.copy(r, TOP, _Y)
        reals.put(r, _W, share, 0)
        reals.put(r, _X, _MARGIN, 0)
        reals.divide(r, _W, _W, _X)
        reals.multiply(r, TOP, TOP, _W)
        self.span = SPAN
        if bent:
            self._smoothen()
        reals.multiply(r, _Q, TOP, TOP)
        first = True
        for i in range(AXES):
            motor = self.motor[i] - 1
            if motor >= 0:
                # a = (A - G·v²) / F
                reals.fetch(r, _X, self.axes[motor].numbers, MAX_ACCELERATION)
                reals.put(r, _P, curve[2 * i + 1], -_SIXTEENTHS)
                reals.multiply(r, _P, _P, _Q)
                reals.subtract(r, _X, _X, _P)
                reals.put(r, _P, curve[2 * i], -_SIXTEENTHS)
                reals.divide(r, _X, _X, _P)
                if first or reals.compare(r, _X, STEEP) < 0:
                    reals.copy(r, STEEP, _X)
                    first = False
        reals.multiply(r, TOP, TOP, HALF_CELL)
        reals.multiply(r, STEEP, STEEP, HALF_CELL)
        reals.multiply(r, STEEP, STEEP, _W)

    def slow(self):
        """Motors may be slower now than the motion under way has counted on: a move keeps to that from its next knot
        on, a jog where it has not been surveyed yet."""
        if self.state and not self.guide:
            r = self.r
            reals.copy(r, _NEXT, TOP)
            reals.copy(r, _AT, STEEP)
            span = self.span
            self.rates(10000)
            reals.copy(r, STEEP, _AT)  # it has to slow down first
            self.span = min(span, self.span)
            if reals.compare(r, _NEXT, TOP) < 0:
                reals.copy(r, TOP, _NEXT)

    def _smoothen(self):
        """Set the ticks from knot to knot, and if need be a lower TOP, so that a cubic is as good as the motors' path.

        With the third derivative d the slopes at the knots are wrong by up to d·h²/6, which puts the cubic beside by
        d·h³/60; toward a singular pose, where the path goes like a square root, d is 3·G²/F. With h = v·span that
        stays below a quarter of a step for v³·G²/F < 5/span³.
        """
        r = self.r
        for i in range(AXES):
            bend = self.curve[2 * i + 1]
            if self.motor[i] and bend:
                reals.put(r, _P, bend, -_SIXTEENTHS)
                reals.multiply(r, _P, _P, _P)
                reals.put(r, _X, self.greatest[i], -_SIXTEENTHS)
                reals.divide(r, _P, _P, _X)
                reals.put(r, _X, 7, -3)
                while True:
                    reals.multiply(r, _Y, TOP, TOP)
                    reals.multiply(r, _Y, _Y, TOP)
                    reals.multiply(r, _Y, _Y, _P)
                    reals.put(r, _Z, 5, -15)
                    if reals.compare(r, _Y, _Z) < 0:
                        break
                    self.span = SPAN // 2
                    reals.double(r, _Z, _Z, 3)
                    if reals.compare(r, _Y, _Z) < 0:
                        break
                    reals.multiply(r, TOP, TOP, _X)

    # ---------------------------------------------------------------- the motion

    def begin(self):
        """Start along the line that has been surveyed, or with the guide of a jog: first with what play there is."""
        self.rested = False
        self.state = TAKING_UP
        for i in range(AXES):
            motor = self.motor[i] - 1
            if motor >= 0 and not self.axes[motor].stands_on(self.present, motor, self.ways[i]):
                self.axes[motor].move_to(self.axes.hal, self.present, motor, 10000, self.ways[i])

    def _set_out(self):
        """Begin to plan, all motors being at rest where the line begins."""
        hal = self.axes.hal
        r = self.r
        self.place(_ZERO, 0)
        for i in range(AXES):
            motor = self.motor[i] - 1
            if motor >= 0:
                axis = self.axes[motor]
                axis.begin_plan(hal)
                axis.set_more_to_come(True)
                axis.block[stepper.PLANNED] = stepper.PLAN_SEGMENTS
                _lead(self.leads, i, self.present, motor, 0, self.rows, 2 * i)
                reals.fetch(self.speeds, 2 * i, r, _ZERO)
        reals.put(r, S, 0, 0)
        reals.put(r, V, 0, 0)
        self._note(0)
        self.times[0] = 0
        self.knot = 0
        self.queued = 0
        self.closed = False
        self.stopping = False
        self.state = STARTING

    def _settle(self):
        """At rest at the end of the line: the load of a motor that has turned under way is behind by its play, and
        follows now. Whether there was such a motor."""
        row = ROW * (self.knot % _KNOTS)
        for i in range(AXES):
            motor = self.motor[i] - 1
            if motor >= 0:
                _nearest(self.word, 0, self.rows, row + 2 * i, self.present, motor)
                axis = self.axes[motor]
                if not axis.stands_on(self.word, 0):
                    axis.move_to(self.axes.hal, self.word, 0)
                    self.state = SETTLING
        return self.state == SETTLING

    def stop(self):
        """Slow down along the line, as steeply as its motors allow."""
        if self.state == STARTING or self.state == TAKING_UP:
            self.halt()
        elif self.state == MOVING and not self.stopping:
            if self._cut():
                self.stopping = True
                if self.guide and not self.guide.back():
                    self.halt()
            elif not self.closed:
                self.halt()

    def halt(self, factor=1):
        """Let each motor ramp down by itself, `factor` times as steeply as it is set to."""
        if self.state:
            for i in range(AXES):
                if self.motor[i]:
                    self.axes[self.motor[i] - 1].stop(self.axes.hal, factor)
            self.state = HALTED
            self.closed = True

    def poll(self):
        """One pass: plan ahead. Whether it has planned, and so there may be more to plan at once."""
        state = self.state
        if state == IDLE:
            return False
        if state == TAKING_UP:
            if self.axes.moving_bits() & self.bits:
                return False
            self._set_out()
            return True
        if state == STARTING:
            if self.closed or self.queued >= _BEGIN:
                if self.axes.filled:
                    self._release()
                return False
            if self.guide and self.guide.extend():
                return True
            self._plan()
            if not self.closed and self.guide and not self.guide.count:
                self.halt()  # no way to go
            return True
        if state == MOVING and not self.closed:
            ahead = self._ahead(self.queued)
            if self.guide and ahead > _SCARCE_TICKS and self.guide.extend():
                return True
            if ahead < _AHEAD_TICKS:
                self._plan()
                return True
        elif not self.axes.moving_bits() & self.bits:
            if state == MOVING and self._settle():
                return True
            if state != HALTED:
                self._rest()
            self.state = IDLE
        return False

    def _elapsed(self):
        """Ticks of the motion that have been done."""
        return (self.axes.kernel.state[stepper.TICKS] - self.tick + 1) & _WRAP

    def _ahead(self, knot):
        """Ticks until a knot, below 0 once it has been passed."""
        return ((self.times[knot % _KNOTS] - self._elapsed() + _HALF) & _WRAP) - _HALF

    def _release(self):
        """All motors start in the same tick."""
        axes = self.axes
        irq = axes.hal.irq_off()
        self.tick = (axes.kernel.state[stepper.TICKS] + 1) & _WRAP
        axes.release(self.bits)
        axes.hal.irq_on(irq)
        self.state = MOVING

    # ---------------------------------------------------------------- knots

    def _note(self, knot):
        """Remember s and velocity of a knot."""
        k = 4 * (knot % _KNOTS)
        reals.fetch(self.marks, k, self.r, S)
        reals.fetch(self.marks, k + 2, self.r, V)

    def _plan(self):
        """Place the next knot, or queue the phases to the one before it, which it takes to know the velocity there."""
        knot = self.knot
        if self.queued < knot - 1:
            self._queue(knot - 1)
        elif self.queued < knot and reals.sign(self.r, V) == 0:
            self._finish(knot)
        elif self._advance():
            knot += 1
            if self.place(S, ROW * (knot % _KNOTS)):
                self.halt()  # the survey has said that it can be reached
                return
            self._note(knot)
            later = self.times[(knot - 1) % _KNOTS] + reals.floor(self.r, _T, _HALF)
            self.times[knot % _KNOTS] = later & _WRAP
            self.knot = knot

    def _queue(self, knot):
        """Append the phase to a knot that has one on either side."""
        r = self.r
        marks = self.marks
        rows = self.rows
        before = (knot - 1) % _KNOTS
        here = knot % _KNOTS
        after = (knot + 1) % _KNOTS
        # velocity · the slope of the parabola through the three
        reals.fetch(r, _X, marks, 4 * before)
        reals.fetch(r, _Y, marks, 4 * here)
        reals.fetch(r, _Z, marks, 4 * after)
        reals.subtract(r, _X, _Y, _X)
        reals.subtract(r, _Z, _Z, _Y)
        reals.fetch(r, _W, marks, 4 * here + 2)
        reals.add(r, _Y, _X, _Z)
        if reals.sign(r, _X) > 0 and reals.sign(r, _Z) > 0:
            reals.divide(r, _W, _W, _Y)
            reals.divide(r, _Y, _Z, _X)
            reals.multiply(r, _P, _W, _Y)
            reals.divide(r, _Y, _X, _Z)
            reals.multiply(r, _Q, _W, _Y)
        else:
            reals.put(r, _P, 0, 0)
            reals.put(r, _Q, 0, 0)
        reals.put(r, _LAST_T, (self.times[here] - self.times[before]) & _WRAP, 0)
        a = ROW * before
        b = ROW * here
        c = ROW * after
        word = self.word
        speeds = self.speeds
        for i in range(AXES):
            motor = self.motor[i]
            if motor:
                _velocity(r, _W, rows, a, b, c, _P, _Q, _Y)
                part = _aimed(word, rows, a, b, c, self.leads, i, self.bounds)
                reals.fetch(r, _X, speeds, a)
                reals.fetch(speeds, b, r, _W)
                self.axes[motor - 1].append_coasting_phase(_LAST_T, _X, _W, r, word, 0, part)
            a += 2
            b += 2
            c += 2
        self.queued = knot

    def _finish(self, knot):
        """Append the phase to the knot at which everything comes to rest."""
        r = self.r
        rows = self.rows
        word = self.word
        a = ROW * ((knot - 1) % _KNOTS)
        b = ROW * (knot % _KNOTS)
        for i in range(AXES):
            motor = self.motor[i] - 1
            if motor >= 0:
                axis = self.axes[motor]
                reals.fetch(r, _X, self.speeds, a)
                part = _aimed(word, rows, a, b, b, self.leads, i, self.bounds)
                part = _landed(word, part, rows, b, self.present, motor, self.leads[i] > 0)
                axis.append_coasting_phase(_T, _X, _ZERO, r, word, 0, part)
                axis.set_more_to_come(False)
            a += 2
            b += 2
        self.queued = knot
        self.closed = True

    def _advance(self):
        """s and velocity of the next knot in S and V, the ticks to it in _T. False: it cannot be told yet."""
        r = self.r
        guide = self.guide
        surveyed = not guide or guide.look()
        reals.subtract(r, _LAST_T, END, S)
        if not guide:
            reals.copy(r, LEFT, _LAST_T)
        span = self.span
        if reals.sign(r, V):
            # what a ramp of constant deceleration to the end would take
            reals.divide(r, _T, _LAST_T, V)
            reals.double(r, _T, _T, 1)
            ticks = reals.floor(r, _T, _HALF)
            if ticks < span:
                if guide and not guide.closed:
                    return False
                if ticks < 0:
                    reals.put(r, _T, 1, 0)
                if not self.stopping or not self._rest_before(_T):
                    reals.copy(r, S, END)
                    reals.put(r, V, 0, 0)
                return True
            if ticks < 2 * span:
                span = ticks // 2 + 1
        elif reals.sign(r, _LAST_T) <= 0:
            if guide and not guide.closed:
                return False
            reals.put(r, _T, 1, 0)
            return True
        if not surveyed:
            return False
        reals.put(r, _T, span, 0)
        if self.stopping and self._rest_before(_T):
            return True
        # as steep as it may, to the greatest velocity, but not above the one from which it can stop at the end:
        # (V + v)·T/2 + v²/2a = LEFT
        reals.multiply(r, _X, STEEP, _T)
        if self.stopping:
            reals.subtract(r, _NEXT, V, _X)
        else:
            reals.add(r, _NEXT, V, _X)
        if reals.compare(r, _NEXT, TOP) > 0:
            reals.subtract(r, _NEXT, V, _X)
            if reals.compare(r, _NEXT, TOP) < 0:
                reals.copy(r, _NEXT, TOP)
        reals.double(r, _X, _T, -1)
        reals.multiply(r, _Y, _X, _X)
        reals.double(r, _Z, LEFT, 1)
        reals.multiply(r, _W, V, _T)
        reals.subtract(r, _Z, _Z, _W)
        reals.divide(r, _Z, _Z, STEEP)
        reals.add(r, _Y, _Y, _Z)
        reals.root(r, _Z, _Y)
        reals.subtract(r, _Z, _Z, _X)
        reals.multiply(r, _Z, _Z, STEEP)
        if reals.compare(r, _Z, _NEXT) < 0:
            if reals.sign(r, _Z) <= 0:
                reals.double(r, _Z, V, -1)  # where cells of a jog in which it may slow down less follow each other
            reals.copy(r, _NEXT, _Z)
        self._step()
        return True

    def _rest_before(self, ticks):
        """If it can come to rest within r[ticks]: S, V and _T for that. Whether it can."""
        r = self.r
        reals.divide(r, _X, V, STEEP)
        if reals.compare(r, _X, ticks) > 0:
            return False
        reals.copy(r, _T, _X)
        reals.put(r, _NEXT, 0, 0)
        self._step()
        return True

    def _step(self):
        """S and V a time _T on, the velocity being _NEXT then."""
        r = self.r
        reals.add(r, _X, V, _NEXT)
        reals.multiply(r, _X, _X, _T)
        reals.double(r, _X, _X, -1)
        reals.add(r, S, S, _X)
        reals.copy(r, V, _NEXT)

    # ---------------------------------------------------------------- changing the plan

    def _cut(self):
        """Forget what is planned from the first knot on that is far enough ahead. False where there is none."""
        axes = self.axes
        for i in range(AXES):
            if self.motor[i]:
                axes[self.motor[i] - 1].feed()
        last = self.knot - 1 if self.closed else self.queued
        knot = max(self.knot - _KNOTS + 2, 1)
        irq = axes.hal.irq_off()
        while knot <= last and self._ahead(knot) < _NOTICE:
            knot += 1
        found = knot <= last
        if found and not (knot == self.queued and not self.closed):
            ticks = self._ahead(knot)
            for i in range(AXES):
                if self.motor[i] and not axes[self.motor[i] - 1].cut_at_phase_end(ticks, 0):
                    found = False
            if found:
                for i in range(AXES):
                    if self.motor[i]:
                        axes[self.motor[i] - 1].cut_at_phase_end(ticks, 1)
        axes.hal.irq_on(irq)
        if not found:
            return False
        r = self.r
        reals.fetch(r, S, self.marks, 4 * (knot % _KNOTS))
        reals.fetch(r, V, self.marks, 4 * (knot % _KNOTS) + 2)
        if knot != self.queued or self.closed:
            for i in range(AXES):
                if self.motor[i]:
                    k = 2 * i
                    row = ROW * (knot % _KNOTS) + k
                    part = axes[self.motor[i] - 1].resume_at_phase_end(self.word, 0)
                    _lead(self.leads, i, self.word, 0, part, self.rows, row)
        self.knot = knot
        self.queued = knot
        self.closed = False
        return True
