"""Type 1, Boom-Swing-Track: a boom that goes up and down and swings about a column on a track.

Axes: BOOM, SWING, TRACK, PAN, TILT, ROLL; boom angle 0 is level. height = length·sin(boom), reach = length·cos(boom)
+ extension (the extension stays level), vNS = height (field note 9.4), the rest as arm.py says. The boom is on the side
of the column that it points to: it goes to 89.1 degrees up and down, and its reach stays above 0.

The boom table gives the motor's own steps for -60 to 60 degrees (field note 9.2); the message's steps per degree and
position of the boom are not used then.
"""

from array import array

from framestep.motion import reals
from framestep.native import const, micropython, ptr32
from framestep.protocol import messages as m
from framestep.virtuals import arm, trig
from framestep.virtuals import geometry as g

_BOOM = const(g.JOINT)
_X = const(g.T + 2)
_Y = const(g.T + 4)

_LENGTH_AT = const(73)  # in the payload
_TABLE_AT = const(93)
_ENTRIES = const(121)
_LOWEST = const(60)  # degrees below level of the first
_ROUNDING = const(-18)  # 2^-18 degrees: so far beyond its ends the table goes, as an angle from inverse() may be


@micropython.viper
def _order(words: ptr32) -> int:
    """The sign of words[1] - words[0]."""
    if words[1] > words[0]:
        return 1
    if words[1] < words[0]:
        return -1
    return 0


@micropython.viper
def _stretch(table: ptr32, steps, j: int) -> int:
    """Between which entries steps[j] lies: the lower one, 0 to 119; -1 or 120 beyond the ends."""
    place = ptr32(steps)[j + 0]
    low = 0
    high = 120
    falling = 0
    if table[120] < table[0]:
        falling = 1
    if falling:
        if place > table[0]:
            return -1
        if place < table[120]:
            return 120
    else:
        if place < table[0]:
            return -1
        if place > table[120]:
            return 120
    while high - low > 1:
        k = (low + high) >> 1
        if falling:
            if place <= table[k + 0]:
                low = k
            else:
                high = k
        elif place >= table[k + 0]:
            low = k
        else:
            high = k
    return low


class Geometry(arm.Arm):
    def __init__(self, r):
        super().__init__(r)
        self.table = array("i", [0] * _ENTRIES)
        self.words = array("i", [0, 0])
        self._tabled = False

    def _numbers(self, length):
        return 5 if length == 93 or length == 97 or length == 577 or length == 581 else -1

    def _check(self, reader, present):
        self.number(reader, _LENGTH_AT, g.T, 1000)
        if reals.sign(self.r, g.T) <= 0:
            return m.ERR_RANGE
        if reader.length > 100:
            rising = 0
            for k in range(_ENTRIES - 1):
                reader.word_to(_TABLE_AT + 4 * k, self.words, 0)
                reader.word_to(_TABLE_AT + 4 + 4 * k, self.words, 1)
                order = _order(self.words)
                if order == 0 or order == -rising:
                    return m.ERR_RANGE
                rising = order
        return super()._check(reader, present)

    def _adopt(self, reader):
        self._tabled = reader.length > 100 and self.motor[0] > 0
        if self._tabled:
            for k in range(_ENTRIES):
                reader.word_to(_TABLE_AT + 4 * k, self.table, k)

    def steps(self, i, out, j):
        if i or not self._tabled:
            return super().steps(i, out, j)
        r = self.r
        reals.put(r, _X, _LOWEST, 0)
        reals.add(r, _X, _X, _BOOM)
        reals.put(r, _Y, 1, _ROUNDING)
        reals.add(r, _X, _X, _Y)
        if reals.sign(r, _X) < 0:
            return m.ERR_RANGE
        reals.double(r, _Y, _Y, 1)
        reals.subtract(r, _X, _X, _Y)
        k = reals.floor(r, _X, 0x7FFF)
        if k > 119:
            return m.ERR_RANGE
        if k < 0:
            k = 0
        reals.put(r, _Y, k - _LOWEST, 0)
        reals.subtract(r, _X, _BOOM, _Y)
        reals.put_difference(r, _Y, self.table, k + 1, self.table, k)
        reals.multiply(r, _X, _X, _Y)
        return g.place(r, _X, self.table, k, out, j)

    def joint(self, i, steps, j):
        if i or not self._tabled:
            return super().joint(i, steps, j)
        r = self.r
        k = _stretch(self.table, steps, j)
        code = 0
        if k < 0 or k > 119:
            code = m.ERR_RANGE
            k = 0 if k < 0 else 119
        reals.put_difference(r, _X, steps, j, self.table, k)
        reals.put_difference(r, _Y, self.table, k + 1, self.table, k)
        reals.divide(r, _X, _X, _Y)
        reals.put(r, _Y, k - _LOWEST, 0)
        reals.add(r, _BOOM, _X, _Y)
        return code

    def _reach(self):
        r = self.r
        if not arm.leg(r, _Y, g.LENGTH, g.PLACE + 2):
            return False
        trig.angle(r, _BOOM, g.PLACE + 2, _Y)
        reals.add(r, arm.REACH, _Y, g.EXTENSION)
        return self._swing()

    def _stand(self):
        r = self.r
        trig.sines(r, _X, _Y, _BOOM)
        reals.multiply(r, g.PLACE + 2, g.LENGTH, _X)
        reals.multiply(r, arm.REACH, g.LENGTH, _Y)
        reals.add(r, arm.REACH, arm.REACH, g.EXTENSION)
        reals.put(r, _X, 1, arm.NARROW)
        level = reals.compare(r, _Y, _X) > 0  # before _swung() takes these registers
        self._swung()
        return level and reals.sign(r, arm.REACH) > 0
