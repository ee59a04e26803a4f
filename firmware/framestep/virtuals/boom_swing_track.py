"""Type 1, Boom-Swing-Track: a boom that goes up and down and swings about a column on a track.

Axes: BOOM, SWING, TRACK, PAN, TILT, ROLL; boom angle 0 is level. height = length·sin(boom), reach = length·cos(boom)
+ extension (the extension stays level), vNS = height (field note 9.4), the rest as arm.py says. The boom is on the side
of the column that it points to: it goes to 88.2 degrees up and down, and its reach stays above 0.

The boom table gives the motor's own steps for -60 to 60 degrees (field note 9.2); the message's steps per degree of the
boom are not used then.
"""

from array import array

from framestep import results
from framestep.motion import reals
from framestep.native import const, micropython, ptr8, ptr32
from framestep.virtuals import arm
from framestep.virtuals import geometry as g
from framestep.virtuals.formulas import ABOVE, ADD, ANGLE, END, MULTIPLY, ROOT, SINES, SUBTRACT

_BOOM = const(g.JOINT)
_LEVEL = const(g.T + 6)  # length·cos(boom)

_LENGTH_AT = const(73)  # in the payload
_TABLE_AT = const(93)
_ENTRIES = const(121)
_TABLE_BYTES = const(484)
_LOWEST = const(60)  # degrees below level of the first
_ROUNDING = const(-17)  # 2^-17 degrees: so far beyond the table's ends an angle from inverse() may be


@micropython.viper
def _entries(buffer: ptr8, at: int, table: ptr32, keep: int) -> int:
    """1 if the DWORDs from buffer[at] on rise throughout or fall throughout, else 0; keep: they go to the table."""
    order = 0
    last = 0
    k = 0
    while k < _ENTRIES:
        value = buffer[at] | buffer[at + 1] << 8 | buffer[at + 2] << 16 | ((buffer[at + 3] ^ 0x80) - 0x80) << 24
        if k:
            way = 0
            if value > last:
                way = 1
            elif value < last:
                way = -1
            if way == 0 or way + order == 0:
                return 0
            order = way
        last = value
        if keep:
            table[k + 0] = value
        at += 4
        k += 1
    return 1


class Geometry(arm.Arm):
    straight = 1 << arm.TRACK_AXIS
    _inverse = (
        g.FROM_POSE
        + bytes(
            # √(length² − NS²)
            (SUBTRACT, _LEVEL, g.LENGTH, g.PLACE + 2)
            + (ADD, g.X, g.LENGTH, g.PLACE + 2)
            + (MULTIPLY, _LEVEL, _LEVEL, g.X)
            + (ROOT, _LEVEL, _LEVEL, 0)
            + (MULTIPLY, g.X, g.LENGTH, arm.NARROW)
            + (ABOVE, 0, _LEVEL, g.X)
            + (ANGLE, _BOOM, g.PLACE + 2, _LEVEL)
            + (ADD, arm.REACH, _LEVEL, g.EXTENSION)
            + (ABOVE, 0, arm.REACH, g.ZERO)
        )
        + arm.SWUNG
    )
    _forward = (
        g.ANGLES
        + bytes(
            (SINES, g.X, _BOOM, g.Y)
            + (MULTIPLY, g.PLACE + 2, g.LENGTH, g.X)
            + (MULTIPLY, _LEVEL, g.LENGTH, g.Y)
            + (ADD, arm.REACH, _LEVEL, g.EXTENSION)
        )
        + arm.SWING_OUT
        + bytes(
            (ABOVE, 0, g.Y, arm.NARROW)  #
            + (ABOVE, 0, arm.REACH, g.ZERO)
            + (END, 0, 0, 0)
        )
    )

    def __init__(self, r):
        super().__init__(r)
        self.table = array("i", [0] * _ENTRIES)
        self._tabled = False

    def _check(self, reader, present):
        self.number(reader, _LENGTH_AT, g.T, 1000)
        if reals.sign(self.r, g.T) <= 0:
            return results.ERR_RANGE
        if reader.length >= _TABLE_AT + _TABLE_BYTES and not self._read(reader, 0):
            return results.ERR_RANGE
        return super()._check(reader, present)

    def _adopt(self, reader):
        self._tabled = reader.length >= _TABLE_AT + _TABLE_BYTES
        if not self._tabled:
            return 0
        if self.motor[0]:
            self._read(reader, 1)
            reals.put(self.r, g.PER_UNIT, 0, 0)  # so that they cannot be too many steps
        else:
            self._tabled = False
        return _TABLE_BYTES

    def _read(self, reader, keep):
        return _entries(reader.buffer, reader.payload + _TABLE_AT, self.table, keep)

    def _bend(self, out, j):
        """The boom's place by its table."""
        if not self._tabled:
            return 0
        r = self.r
        reals.put(r, g.X, _LOWEST, 0)
        reals.add(r, g.X, _BOOM, g.X)
        k = reals.floor(r, g.X, _ENTRIES)
        if k < 0 or k > 119:
            reals.put(r, g.Y, 0 if k < 0 else 120, 0)
            reals.subtract(r, g.Y, g.X, g.Y)
            if reals.sign(r, g.Y) and r[g.Y + 1] + 30 > _ROUNDING:
                return results.ERR_RANGE
            k = 0 if k < 0 else 119
        reals.put(r, g.Y, k, 0)
        reals.subtract(r, g.X, g.X, g.Y)
        reals.put_difference(r, g.Y, self.table, k + 1, self.table, k)
        reals.multiply(r, g.X, g.X, g.Y)
        return 0 if g.places(r, g.X, self.table, k, out, j, 1) else results.ERR_RANGE

    def joint(self, i, steps, j):
        if i or not self._tabled:
            return super().joint(i, steps, j)
        r = self.r
        table = self.table
        code = 0
        reals.put_difference(r, g.Y, table, 120, table, 0)
        rising = reals.sign(r, g.Y)
        for k in range(0, 121, 120):
            reals.put_difference(r, g.X, steps, j, table, k)
            if reals.sign(r, g.X) * rising == (-1 if k == 0 else 1):
                code = results.ERR_RANGE
        # the greatest k whose entry is not beyond, 119 at most
        k = 0
        step = 64
        while step:
            if k + step < 120:
                reals.put_difference(r, g.X, steps, j, table, k + step)
                if reals.sign(r, g.X) * rising >= 0:
                    k += step
            step >>= 1
        reals.put_difference(r, g.X, steps, j, table, k)
        reals.put_difference(r, g.Y, table, k + 1, table, k)
        reals.divide(r, g.X, g.X, g.Y)
        reals.put(r, g.Y, k - _LOWEST, 0)
        reals.add(r, _BOOM, g.X, g.Y)
        return code
