"""Type 1, Boom-Swing-Track: a boom that goes up and down and swings about a column on a track.

Axes: BOOM, SWING, TRACK, PAN, TILT, ROLL; boom angle 0 is level. height = length·sin(boom), reach =
length·cos(boom) + extension (the extension stays level), vNS = height (field note 9.4), the rest as
in arm.py. The boom stays on the side of the column to which it points: it goes to 88.2 degrees up
and down, and its reach stays above 0.

The boom table has the motor's own steps for -60 to 60 degrees (field note 9.2). With a table, the
message's steps per degree of the boom are not used.
"""

from array import array

from framestep.base.native import const, micropython, ptr8, ptr32
from framestep.base.results import ERR_RANGE
from framestep.motion import reals
from framestep.motion.compute import compute
from framestep.motion.formula import formula
from framestep.virtual_axes import registers
from framestep.virtual_axes.kinematics.arm import SWING_IN, SWING_OUT, TRACK_AXIS, Arm
from framestep.virtual_axes.kinematics.kinematics import ANGLES, FROM_POSE, to_steps
from framestep.virtual_axes.registers import BOOM, PER_UNIT, SPARE, STEPS

_ENTRIES = const(121)
_LAST = const(120)
_LOWEST = const(60)  # degrees below level of the first entry
_ROUNDING = const(-17)  # tolerance at the ends of the table, 2^-17 degrees: rounding of inverse()

# Degrees from the first entry to the boom, and the entry there or below.
_ENTRY = formula(
    registers,
    "-> degrees, entry",
    """
    degrees = BOOM + 60
    entry = floor(degrees)
    """,
)
# How many of the steps (in STEPS) from an entry to the next one the boom is past it.
_PAST_ENTRY = formula(
    registers,
    "degrees, entry",
    "STEPS[0] = (degrees - entry) * STEPS[0]",
    degrees=_ENTRY.degrees,
)
# From the motor's steps past an entry, and those from it to the next one, to the boom's angle.
_BOOM_OF_TABLE = formula(registers, "past, each", "BOOM = past / each + BOOM")


@micropython.viper
def _entries(buffer: ptr8, at: int, table: ptr32, keep: int) -> int:
    """Return 1 if the DWORDs from buffer[at] on all rise or all fall, else 0.

    keep: whether to put them into the table.
    """
    order = 0
    last = 0
    k = 0
    while k < _ENTRIES:
        value = buffer[at] | (buffer[at + 1] << 8) | (buffer[at + 2] << 16)
        value = value | (((buffer[at + 3] ^ 0x80) - 0x80) << 24)
        if k:
            direction = 0
            if value > last:
                direction = 1
            elif value < last:
                direction = -1
            if direction == 0 or direction + order == 0:
                return 0
            order = direction
        last = value
        if keep:
            table[k + 0] = value
        at += 4
        k += 1
    return 1


class Geometry(Arm):
    straight = 1 << TRACK_AXIS
    _inverse = (
        FROM_POSE
        + formula(
            registers,
            """
            level = sqrt((LENGTH - WRIST_NS) * (LENGTH + WRIST_NS))  # the boom as seen from above
            assert level > LENGTH * NARROW
            BOOM = angle(WRIST_NS, level)
            REACH = level + EXTENSION
            assert REACH > ZERO
            ...
            """,
        )
        + SWING_IN
    )
    _forward = (
        ANGLES
        + formula(
            registers,
            """
            boom_sine, BOOM_COSINE = sincos(BOOM)
            WRIST_NS = LENGTH * boom_sine
            REACH = LENGTH * BOOM_COSINE + EXTENSION
            ...
            """,
        )
        + SWING_OUT
        + formula(
            registers,
            """
            assert BOOM_COSINE > NARROW
            assert REACH > ZERO
            """,
        )
    )

    def __init__(self, r, other=None):
        super().__init__(r, other)
        self.table = array("i", [0] * _ENTRIES)
        self._has_table = False

    def _possible(self, configuration):
        self.load(SPARE, configuration.lengths, 0)
        if reals.sign(self.r, SPARE) <= 0:
            return False
        at = configuration.table_at
        return at < 0 or _entries(configuration.table, at, self.table, 0)

    def _adopt(self, configuration):
        at = configuration.table_at
        self._has_table = at >= 0 and self.motor[0] != 0
        if self._has_table:
            _entries(configuration.table, at, self.table, 1)
            reals.put(self.r, PER_UNIT, 0, 0)  # so that there cannot be too many steps

    def _correct(self, out, j):
        """Replace the boom's steps by those of its table."""
        if not self._has_table:
            return 0
        r = self.r
        compute(r, _ENTRY)
        k = reals.floor(r, _ENTRY.entry, _ENTRIES)
        if k < 0 or k >= _LAST:
            reals.put(r, SPARE, 0 if k < 0 else _LAST, 0)
            reals.subtract(r, SPARE, _ENTRY.degrees, SPARE)
            if reals.sign(r, SPARE) and r[SPARE + 1] + 30 > _ROUNDING:
                return ERR_RANGE
            k = 0 if k < 0 else _LAST - 1
        reals.put(r, _PAST_ENTRY.entry, k, 0)
        reals.put_difference(r, STEPS, self.table, k + 1, self.table, k)
        compute(r, _PAST_ENTRY)
        return 0 if to_steps(r, STEPS, self.table, k, out, j, 1) else ERR_RANGE

    def joint(self, i, steps, j):
        if i or not self._has_table:
            return super().joint(i, steps, j)
        r = self.r
        table = self.table
        code = 0
        reals.put_difference(r, SPARE, table, _LAST, table, 0)
        rising = reals.sign(r, SPARE)
        for k in range(0, _ENTRIES, _LAST):
            reals.put_difference(r, SPARE, steps, j, table, k)
            if reals.sign(r, SPARE) * rising == (-1 if k == 0 else 1):
                code = ERR_RANGE
        # find the greatest k, except the last, whose entry is not beyond
        k = 0
        step = 64
        while step:
            if k + step < _LAST:
                reals.put_difference(r, SPARE, steps, j, table, k + step)
                if reals.sign(r, SPARE) * rising >= 0:
                    k += step
            step >>= 1
        reals.put_difference(r, _BOOM_OF_TABLE.past, steps, j, table, k)
        reals.put_difference(r, _BOOM_OF_TABLE.each, table, k + 1, table, k)
        reals.put(r, BOOM, k - _LOWEST, 0)
        compute(r, _BOOM_OF_TABLE)
        return code
