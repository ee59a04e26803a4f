"""What the types of rig share: axes with their units, the nodal offset, the host's coordinates.

A type's module has one class, `Geometry`, whose inverse() says where the axes of the rig stand for
a pose of the camera, and whose forward() says the opposite. A pose is vTrack, vEW, vNS, vPan,
vTilt, vRoll: the position of the lens's nodal point in units, and angles in degrees (field note
9.1). The camera at rest looks along -Z (field note 9.4).

POSE counts as forward() does. The host counts from the pose that it has given at VIRT_CONFIG (field
note 9.2): what it is told and asks for is that pose plus the change of POSE since then. So straight
axes may begin anywhere, here at 0.

All numbers are `reals` in one array('i'), laid out in registers.py. What lies between the host's
numbers, a type's formulas and motor steps is one file. Nothing allocates after construction.
"""

from array import array

from framestep.base.native import const, micropython, ptr32
from framestep.base.results import ERR_RANGE
from framestep.motion import reals
from framestep.motion.compute import compute
from framestep.motion.formula import formula
from framestep.virtual_axes import registers

_SLACK = const(-12)  # how far off an axis without a motor may be: 2^-12 units

_word = array("i", [0, 0])  # any word, and 0

# From `right`, `up` and `forward` of the camera to EW, NS and track: Rz(pan)·Rx(tilt)·Ry(roll) in a
# frame with x to the right, y forward and z up, of which the world has Y = z and Z = -y (field note
# 9.4). Positive pan turns left, positive tilt looks up.
_TURN = formula(
    registers,
    """
    sine, cosine = sincos(V_ROLL)  # turns up to the right
    side = OFFSET_EW * cosine + OFFSET_NS * sine
    OFFSET_NS = OFFSET_NS * cosine - OFFSET_EW * sine

    sine, cosine = sincos(V_TILT)  # turns forward up
    ahead = OFFSET_TRACK * cosine - OFFSET_NS * sine
    OFFSET_NS = OFFSET_NS * cosine + OFFSET_TRACK * sine

    sine, cosine = sincos(V_PAN)  # turns right forward
    OFFSET_EW = side * cosine - ahead * sine
    OFFSET_TRACK = -(ahead * cosine + side * sine)
    """,
)

_NODAL_OFFSET = (
    formula(
        registers,
        """
        OFFSET_EW = NODAL_RIGHT
        OFFSET_NS = NODAL_UP
        OFFSET_TRACK = NODAL_FORWARD
        ...
        """,
    )
    + _TURN
)

# With OFFSET known: where the camera's axes meet, and its angles. The first part of every
# inverse().
FROM_POSE = formula(
    registers,
    """
    WRIST_EW = V_EW - OFFSET_EW
    WRIST_NS = V_NS - OFFSET_NS
    WRIST_TRACK = V_TRACK - OFFSET_TRACK
    JOINT_PAN = V_PAN
    JOINT_TILT = V_TILT
    JOINT_ROLL = V_ROLL
    ...
    """,
)

# The other way round: the first part of every forward(), and the last.
ANGLES = formula(
    registers,
    """
    V_PAN = JOINT_PAN
    V_TILT = JOINT_TILT
    V_ROLL = JOINT_ROLL
    ...
    """,
)
_TO_POSE = formula(
    registers,
    """
    V_EW = WRIST_EW + OFFSET_EW
    V_NS = WRIST_NS + OFFSET_NS
    V_TRACK = WRIST_TRACK + OFFSET_TRACK
    """,
)

# How many steps each axis is from where it stood at VIRT_CONFIG.
_STEPS = formula(
    registers,
    """
    STEPS[0] = (JOINT[0] - HOME[0]) * PER_UNIT[0]
    STEPS[1] = (JOINT[1] - HOME[1]) * PER_UNIT[1]
    STEPS[2] = (JOINT[2] - HOME[2]) * PER_UNIT[2]
    STEPS[3] = (JOINT[3] - HOME[3]) * PER_UNIT[3]
    STEPS[4] = (JOINT[4] - HOME[4]) * PER_UNIT[4]
    STEPS[5] = (JOINT[5] - HOME[5]) * PER_UNIT[5]
    """,
)

# HOME of an axis that turns (in `x`): its angle without whole turns, lest a motor that has made
# many of them be less exact.
_WITHOUT_TURNS = formula(registers, "X = X - floor(X / 360 + 0.5) * 360")

# A number of a pose, of which Y is in FIRST_POSE: what the host counts since then, in its
# hundred-thousandths, and back; and the difference of the two counts.
_TO_HOST = formula(registers, "X = (X - Y) * 100000")
_FROM_HOST = formula(registers, "X = Y + X / 100000")
_HOST_OFFSET = formula(registers, "X = X / 100000 - Y")


@micropython.viper
def to_steps(r: ptr32, a: int, start, i: int, out, j: int, count: int) -> int:
    """out[j], out[j + 1] = whole and Q16 fraction of start[i] + r[a] steps; and so on, `count`
    times.

    0, else 1, if one of them is not below 2^31 - 2^23, so that sums of what lies beside it fit 32
    bits, or is 2^26 steps and more from start[i], where r[a] is no longer exact to a 16th of one.
    """
    base = ptr32(start)
    to = ptr32(out)
    end = j + count + count
    while j < end:
        value = r[a + 0]
        s = 0 - r[a + 1]
        if value and s < 4:
            return 0
        if s > 16:
            # to the nearest 65536th
            s -= 16
            if s > 31:
                s = 31
                value = 0
            value = (value + (1 << (s - 1))) >> s
            s = 16
        whole = value >> s
        rest = (value - (whole << s)) << (16 - s)
        half = (base[i + 0] >> 1) + (whole >> 1) + (base[i + 0] & whole & 1)
        if half > 0x3FBFFFFF or half < -0x3FC00000:
            return 0
        to[j + 0] = base[i + 0] + whole
        to[j + 1] = rest
        a += 2
        i += 1
        j += 2
    return 1


@micropython.viper
def _sum_to_word(out: ptr32, i: int, r: ptr32, a: int, base, j: int):
    """out[i] = the sum of base[j] and the whole number nearest to r[a], or the nearer end of the
    range."""
    start = ptr32(base)[j + 0]
    half = r[a + 0]
    s = 0 - r[a + 1]
    odd = 0
    if s > 30:
        half = 0
    elif s >= 0:
        if s:
            half = (half + (1 << (s - 1))) >> s
        odd = half & 1
        half = half >> 1
    elif s == -2:
        half = half << 1
    elif s < -2:
        if half < 0:
            half = -0x40000000
        else:
            half = 0x3FFFFFFF
        half = half + half
    # by quarters first, so that no sum needs 33 bits
    s = (start >> 2) + (half >> 1)
    direction = 0
    if s > 0x20000000:
        direction = 1
    elif s < -0x20000001:
        direction = -1
    else:
        half = (start >> 1) + half + (start & odd & 1)
        if half > 0x3FFFFFFF:
            direction = 1
        elif half < -0x40000000:
            direction = -1
    if direction:
        start = 0
        odd = 0
        half = -0x40000000
        if direction > 0:
            start = 1
            half = 0x3FFFFFFF
    out[i] = half + half + ((start ^ odd) & 1)


CAMERA_AXES = const(3)  # X, Y and Z; the protocol's LINE_ has them first


def camera_axis(r, axis, to):
    """r[to], r[to + 2], r[to + 4] = direction, as vTrack, vEW, vNS, of an axis of the camera at
    POSE.

    axis: 0 X to its right, 1 Y up, 2 Z backward from where it looks (field note 9.6).
    """
    for i in range(0, 6, 2):
        reals.put(r, registers.OFFSET + i, 0, 0)
    reals.put(r, registers.OFFSET + 2 * axis, -1 if axis == 2 else 1, 0)
    compute(0, 0, r, _TURN)
    reals.copy(r, to, registers.OFFSET + 4)
    reals.copy(r, to + 2, registers.OFFSET)
    reals.copy(r, to + 4, registers.OFFSET + 2)
    for i in range(0, 6, 2):
        reals.put(r, registers.OFFSET + i, 0, 0)


class Configuration:
    """The numbers of a VIRT_CONFIG, with what can be checked without the rig's type.

    Arrays of words: motors (from 1, 0 for none), steps_per_unit · 1000 and positions · 100000 by
    axis; lengths · 1000: LENGTH, EXTENSION, the nodal offset to the right, forward and up, safe
    distance.
    table, table_at: the bytes of a boom table begin at table[table_at]; -1 for none.
    """

    def __init__(self):
        self.motors = array("i", [0] * registers.AXES)
        self.steps_per_unit = array("i", [0] * registers.AXES)
        self.positions = array("i", [0] * registers.AXES)
        self.lengths = array("i", [0] * 6)
        self.table = None
        self.table_at = -1


class Kinematics:
    """The axes of a type: which motors, how many steps to the unit, where they stood at
    VIRT_CONFIG.

    An axis that turns stands at its motor's steps by the steps per unit; one without a motor at 0.

    r: array('i') of registers.REGISTERS words, shared with the caller. motor: of the axes 0 to 5,
    the motor's number or 0. main: of the virtual axes 1 to 6, the axis whose steps a jog's
    destination is in (field note 9.6), plus 1; 0 for a virtual axis that the type does not have.
    straight: bits of the axes that do not turn.

    Where a method returns a code, it is 0, or ERR_RANGE for what the rig cannot reach. A type gives
    two formulas: _inverse from POSE and OFFSET to JOINT, in which a condition refuses what cannot
    be reached; _forward from JOINT to WRIST and the angles of POSE, which computes all of them
    before a condition.
    """

    main = b""
    straight = 0
    _inverse = b""
    _forward = b""

    def __init__(self, r, other=None):
        """other: one of another type, with which this one shares its arrays."""
        self.r = r
        self.motor = other.motor if other else bytearray(registers.AXES)
        self.start = other.start if other else array("i", [0] * registers.AXES)
        # at VIRT_CONFIG, times 100000
        self.host_pose = other.host_pose if other else array("i", [0] * registers.AXES)
        self._absent = False  # an axis has no motor
        self._offset = False  # there is a nodal offset

    # ---------------------------------------------------------------- VIRT_CONFIG

    def configure(self, configuration, present):
        """Adopt a Configuration; present: array('i') with the motors' steps now, motor 1 first.

        0, or ERR_RANGE for a number that cannot be: then all stays as it was. Afterwards POSE is
        where the rig stands, which may be out of inverse()'s reach.
        """
        if not self._possible(configuration):
            return ERR_RANGE
        r = self.r
        lengths = configuration.lengths
        for i in range(registers.AXES):
            self.motor[i] = configuration.motors[i]
            self.load(registers.PER_UNIT + 2 * i, configuration.steps_per_unit, i)
            # a number of the pose is told by the axis in whose steps a jog of it is (field note
            # 9.2)
            if self.main[i + 1]:
                reals.copy_word(self.host_pose, i, configuration.positions, self.main[i + 1] - 1)
            else:
                self.host_pose[i] = 0
            reals.put(r, registers.OFFSET + 2 * i, 0, 0)
        self.load(registers.LENGTH, lengths, 0)
        self.load(registers.EXTENSION, lengths, 1)
        self._offset = False
        for i in range(3):
            self.load(registers.NODAL_RIGHT + 2 * i, lengths, 2 + i)
            if reals.sign(r, registers.NODAL_RIGHT + 2 * i):
                self._offset = True
        self.load(registers.SAFE, lengths, 5)
        self._adopt(configuration)
        self._begin(present)
        return 0

    def _possible(self, configuration):
        """Whether a rig of this type can have these numbers; it changes nothing but scratch
        registers."""
        return True

    def _adopt(self, configuration):
        """Keep what only this type has."""

    def load(self, to, words, i):
        """r[to] = words[i] / 1000"""
        r = self.r
        reals.put_difference(r, to, words, i, _word, 1)
        reals.put(r, registers.X, 1000, 0)
        reals.divide(r, to, to, registers.X)

    def _begin(self, present):
        """HOME and `start` of all axes, and FIRST_POSE."""
        r = self.r
        self._absent = False
        for i in range(registers.AXES):
            home = registers.HOME + 2 * i
            reals.put(r, home, 0, 0)
            self.start[i] = 0
            motor = self.motor[i]
            if not motor:
                self._absent = True
                continue
            if not (self.straight >> i) & 1:
                self.joint(i, present, motor - 1)  # counted from step 0
                reals.copy(r, registers.X, registers.JOINT + 2 * i)
                compute(0, 0, r, _WITHOUT_TURNS)
                reals.copy(r, home, registers.X)
            reals.copy_word(self.start, i, present, motor - 1)
        self.locate(present)
        for k in range(0, 2 * registers.AXES, 2):
            reals.copy(r, registers.FIRST_POSE + k, registers.POSE + k)

    # ---------------------------------------------------------------- the host's coordinates

    def to_host(self, out, j, i):
        """out[j] = number i of POSE as the host counts it, times 100000, held within 32 bits."""
        r = self.r
        reals.copy(r, registers.X, registers.POSE + 2 * i)
        reals.copy(r, registers.Y, registers.FIRST_POSE + 2 * i)
        compute(0, 0, r, _TO_HOST)
        _sum_to_word(out, j, r, registers.X, self.host_pose, i)

    def from_host(self, to, i, source, j):
        """r[to] = number i of POSE for what the host calls source[j] / 100000."""
        r = self.r
        reals.put_difference(r, registers.X, source, j, self.host_pose, i)
        reals.copy(r, registers.Y, registers.FIRST_POSE + 2 * i)
        compute(0, 0, r, _FROM_HOST)
        reals.copy(r, to, registers.X)

    def host_offset(self, to, i):
        """r[to] = what the host counts less POSE, of number i."""
        r = self.r
        reals.put_difference(r, registers.X, self.host_pose, i, _word, 1)
        reals.copy(r, registers.Y, registers.FIRST_POSE + 2 * i)
        compute(0, 0, r, _HOST_OFFSET)
        reals.copy(r, to, registers.X)

    # ---------------------------------------------------------------- steps

    def motor_steps(self, out, j):
        """out[j + 2i], out[j + 2i + 1] = whole step and Q16 fraction of axis i at JOINT. A code.

        out: array('i'), 12 words of it. For an axis without a motor: 0.
        """
        r = self.r
        compute(0, 0, r, _STEPS)
        if not to_steps(r, registers.STEPS, self.start, 0, out, j, registers.AXES):
            return ERR_RANGE
        return self._correct(out, j)

    def _correct(self, out, j):
        """Change what a type has to change of motor_steps(). A code."""
        return 0

    def joint(self, i, steps, j):
        """JOINT of axis i from the step steps[j]. A code."""
        r = self.r
        reals.put_difference(r, registers.X, steps, j, self.start, i)
        reals.divide(r, registers.X, registers.X, registers.PER_UNIT + 2 * i)
        reals.add(r, registers.JOINT + 2 * i, registers.HOME + 2 * i, registers.X)
        return 0

    def locate(self, present):
        """JOINT and POSE from the motors' steps; inverse() stays on the side of the rig they are
        on.

        A code. With ERR_RANGE the numbers are there, but the rig is not where inverse() leads to.
        """
        code = 0
        for i in range(registers.AXES):
            if self.motor[i]:
                code |= self.joint(i, present, self.motor[i] - 1)
            else:
                reals.copy(self.r, registers.JOINT + 2 * i, registers.HOME + 2 * i)
        self._choose_side()
        return code | self.forward()

    def _choose_side(self):
        """Decide by JOINT which of the rig's ways to take a pose inverse() gives."""

    # ---------------------------------------------------------------- kinematics

    def inverse(self):
        """JOINT for the POSE. A code; with ERR_RANGE JOINT is of no use."""
        r = self.r
        if self._offset:
            compute(0, 0, r, _NODAL_OFFSET)
        if not compute(0, 0, r, self._inverse):
            return ERR_RANGE
        if self._absent:
            for i in range(registers.AXES):
                if self.motor[i] == 0:
                    reals.subtract(r, registers.X, registers.JOINT + 2 * i, registers.HOME + 2 * i)
                    if reals.sign(r, registers.X) and r[registers.X + 1] + 30 > _SLACK:
                        return ERR_RANGE
                    reals.copy(r, registers.JOINT + 2 * i, registers.HOME + 2 * i)
        return 0

    def forward(self):
        """POSE for the JOINTs. A code; with ERR_RANGE it is not one that inverse() leads back
        from."""
        r = self.r
        code = 0 if compute(0, 0, r, self._forward) else ERR_RANGE
        if self._offset:
            compute(0, 0, r, _NODAL_OFFSET)
        compute(0, 0, r, _TO_POSE)
        return code
