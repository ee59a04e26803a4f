"""Base class of the types of rig: axes with their units, the nodal offset, the host's coordinates.

A type's module has one class, `Geometry`. Its inverse() finds the axes of the rig for a pose of the
camera, and its forward() the opposite. A pose is vTrack, vEW, vNS, vPan, vTilt, vRoll: the position
of the lens's nodal point in units, and angles in degrees (field note 9.1). The camera at rest looks
along -Z (field note 9.4).

POSE counts as in forward(). The host counts from the pose that it gave at VIRT_CONFIG (field note
9.2): its numbers are that pose plus the change of POSE since then. So linear axes may begin
anywhere, here at 0.

All numbers are `reals` in one array('i'), laid out in registers.py. Everything between the host's
numbers, a type's formulas and motor steps is in this file. Nothing allocates after construction.
"""

from array import array

from framestep.base.native import const, micropython, ptr32
from framestep.base.results import ERR_RANGE
from framestep.motion import reals
from framestep.motion.compute import compute
from framestep.motion.formula import formula
from framestep.virtual_axes import registers

_SLACK = const(-12)  # an axis without a motor may be off by 2^-12 units

_word = array("i", [0, 0])  # any word, and 0

# From `right`, `up` and `forward` of the camera to EW, NS and track: Rz(pan)·Rx(tilt)·Ry(roll) in a
# frame with x to the right, y forward and z up; in the world Y = z and Z = -y (field note 9.4).
# Positive pan turns left, positive tilt looks up.
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

# With OFFSET known: the intersection of the camera's axes, and its angles. The first part of every
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

# The opposite: the first part of every forward(), and the last.
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

# Steps of each axis since VIRT_CONFIG
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

_THOUSANDTHS = formula(registers, "number -> number", "number = number / 1000")

# HOME of an axis that turns: its angle without whole turns, so that a motor that has made many
# turns does not lose accuracy.
_WITHOUT_TURNS = formula(
    registers, "angle -> angle", "angle = angle - floor(angle / 360 + 0.5) * 360"
)

# From a number of POSE to the host's, in hundred-thousandths, and back, with its FIRST_POSE; and
# the difference of the two counts.
_TO_HOST = formula(registers, "own, first -> own", "own = (own - first) * 100000")
_FROM_HOST = formula(registers, "host, first -> host", "host = first + host / 100000")
_HOST_OFFSET = formula(registers, "host, first -> host", "host = host / 100000 - first")


@micropython.viper
def to_steps(r: ptr32, a: int, start, i: int, out, j: int, count: int) -> int:
    """Set out[j], out[j + 1] to whole steps and Q16 fraction of start[i] + r[a] steps; repeat that
    for `count` numbers.

    Return 1; or 0 if the size of one is not below 2^31 - 2^23, so that sums with nearby numbers fit
    32 bits, or if it is 2^26 steps or more from start[i], where r[a] is not exact to a 16th step.
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
    """out[i] = the sum of base[j] and the integer nearest to r[a], limited to the range"""
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
    # Divide by 4 first, so that no sum needs 33 bits.
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
    """Set r[to], r[to + 2], r[to + 4] to the direction, as vTrack, vEW, vNS, of an axis of the
    camera at POSE.

    axis: 0 X to its right, 1 Y up, 2 Z backward from where it looks (field note 9.6).
    """
    for i in range(0, 6, 2):
        reals.put(r, registers.OFFSET + i, 0, 0)
    reals.put(r, registers.OFFSET + 2 * axis, -1 if axis == 2 else 1, 0)
    compute(r, _TURN)
    reals.copy(r, to, registers.OFFSET + 4)
    reals.copy(r, to + 2, registers.OFFSET)
    reals.copy(r, to + 4, registers.OFFSET + 2)
    for i in range(0, 6, 2):
        reals.put(r, registers.OFFSET + i, 0, 0)


class Configuration:
    """The numbers of a VIRT_CONFIG, checked for all that does not depend on the rig's type.

    Arrays of words: motors (from 1, 0 for none), steps_per_unit · 1000 and positions · 100000 for
    each axis; lengths · 1000: LENGTH, EXTENSION, the nodal offset to the right, forward and up,
    safe distance. table, table_at: the bytes of a boom table begin at table[table_at]; -1 for none.
    """

    def __init__(self):
        self.motors = array("i", [0] * registers.AXES)
        self.steps_per_unit = array("i", [0] * registers.AXES)
        self.positions = array("i", [0] * registers.AXES)
        self.lengths = array("i", [0] * 6)
        self.table = None
        self.table_at = -1


class Kinematics:
    """The axes of a type: their motors, steps per unit, and positions at VIRT_CONFIG.

    The position of an axis that turns is its motor's steps divided by the steps per unit; without a
    motor it is 0.

    r: array('i') of registers.REGISTERS words, shared with the caller. motor: number of the motor
    of each of the axes 0 to 5, or 0. main: for each of the virtual axes 1 to 6, the axis in whose
    steps a jog's destination is (field note 9.6), plus 1; 0 for a virtual axis that the type does
    not have. straight: bits of the linear axes.

    A code is 0, or ERR_RANGE for what the rig cannot reach. A type provides two formulas. _inverse
    leads from POSE and OFFSET to JOINT; a condition refuses what cannot be reached. _forward leads
    from JOINT to WRIST and the angles of POSE, and computes all of them before a condition.
    """

    main = b""
    straight = 0
    _inverse = b""
    _forward = b""

    def __init__(self, r, other=None):
        """other: an instance of another type, with which this one shares its arrays."""
        self.r = r
        self.motor = other.motor if other else bytearray(registers.AXES)
        self.start = other.start if other else array("i", [0] * registers.AXES)
        # at VIRT_CONFIG, times 100000
        self.host_pose = other.host_pose if other else array("i", [0] * registers.AXES)
        self._absent = False  # an axis has no motor
        self._offset = False  # there is a nodal offset

    # ---------------------------------------------------------------- VIRT_CONFIG

    def configure(self, configuration, present):
        """Adopt a Configuration. present: array('i') with the motors' present steps, motor 1 first.

        Return 0, or ERR_RANGE for an impossible number; nothing changes then. Afterwards POSE is
        the rig's pose, which may be out of inverse()'s reach.
        """
        if not self._possible(configuration):
            return ERR_RANGE
        r = self.r
        lengths = configuration.lengths
        for i in range(registers.AXES):
            self.motor[i] = configuration.motors[i]
            self.load(registers.PER_UNIT + 2 * i, configuration.steps_per_unit, i)
            # a number of the pose comes with the axis in whose steps its jogs are (field note 9.2)
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
        """Return whether a rig of this type can have these numbers. Changes only scratch
        registers."""
        return True

    def _adopt(self, configuration):
        """Keep the numbers that only this type has."""

    def load(self, to, words, i):
        """r[to] = words[i] / 1000"""
        r = self.r
        reals.put_difference(r, _THOUSANDTHS.number, words, i, _word, 1)
        compute(r, _THOUSANDTHS)
        reals.copy(r, to, _THOUSANDTHS.number)

    def _begin(self, present):
        """Set HOME and `start` of all axes, and FIRST_POSE."""
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
                reals.copy(r, _WITHOUT_TURNS.angle, registers.JOINT + 2 * i)
                compute(r, _WITHOUT_TURNS)
                reals.copy(r, home, _WITHOUT_TURNS.angle)
            reals.copy_word(self.start, i, present, motor - 1)
        self.locate(present)
        for k in range(0, 2 * registers.AXES, 2):
            reals.copy(r, registers.FIRST_POSE + k, registers.POSE + k)

    # ---------------------------------------------------------------- the host's coordinates

    def to_host(self, out, j, i):
        """out[j] = number i of POSE as the host counts it, times 100000, limited to 32 bits."""
        r = self.r
        reals.copy(r, _TO_HOST.own, registers.POSE + 2 * i)
        reals.copy(r, _TO_HOST.first, registers.FIRST_POSE + 2 * i)
        compute(r, _TO_HOST)
        _sum_to_word(out, j, r, _TO_HOST.own, self.host_pose, i)

    def from_host(self, to, i, source, j):
        """r[to] = number i of POSE that corresponds to the host's source[j] / 100000."""
        r = self.r
        reals.put_difference(r, _FROM_HOST.host, source, j, self.host_pose, i)
        reals.copy(r, _FROM_HOST.first, registers.FIRST_POSE + 2 * i)
        compute(r, _FROM_HOST)
        reals.copy(r, to, _FROM_HOST.host)

    def host_offset(self, to, i):
        """r[to] = the host's number i minus POSE's."""
        r = self.r
        reals.put_difference(r, _HOST_OFFSET.host, self.host_pose, i, _word, 1)
        reals.copy(r, _HOST_OFFSET.first, registers.FIRST_POSE + 2 * i)
        compute(r, _HOST_OFFSET)
        reals.copy(r, to, _HOST_OFFSET.host)

    # ---------------------------------------------------------------- steps

    def motor_steps(self, out, j):
        """Put whole steps and Q16 fraction of axis i at JOINT into out[j + 2i], out[j + 2i + 1]
        (array('i'), 12 words); 0 for an axis without a motor. Return a code.
        """
        r = self.r
        compute(r, _STEPS)
        if not to_steps(r, registers.STEPS, self.start, 0, out, j, registers.AXES):
            return ERR_RANGE
        return self._correct(out, j)

    def _correct(self, out, j):
        """Correct the result of motor_steps(), if a type has to. Return a code."""
        return 0

    def joint(self, i, steps, j):
        """Set JOINT of axis i for the step steps[j]. Return a code."""
        r = self.r
        reals.put_difference(r, registers.SPARE, steps, j, self.start, i)
        reals.divide(r, registers.SPARE, registers.SPARE, registers.PER_UNIT + 2 * i)
        reals.add(r, registers.JOINT + 2 * i, registers.HOME + 2 * i, registers.SPARE)
        return 0

    def locate(self, present):
        """Set JOINT and POSE from the motors' steps. inverse() stays on this side of the rig.

        Return a code. With ERR_RANGE the numbers are set, but inverse() does not lead back there.
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
        """Choose by JOINT which of the rig's solutions for a pose inverse() gives."""

    # ---------------------------------------------------------------- kinematics

    def inverse(self):
        """Set JOINT for the POSE. Return a code; with ERR_RANGE JOINT is useless."""
        r = self.r
        if self._offset:
            compute(r, _NODAL_OFFSET)
        if not compute(r, self._inverse):
            return ERR_RANGE
        if self._absent:
            for i in range(registers.AXES):
                if self.motor[i] == 0:
                    reals.subtract(
                        r, registers.SPARE, registers.JOINT + 2 * i, registers.HOME + 2 * i
                    )
                    if reals.sign(r, registers.SPARE) and r[registers.SPARE + 1] + 30 > _SLACK:
                        return ERR_RANGE
                    reals.copy(r, registers.JOINT + 2 * i, registers.HOME + 2 * i)
        return 0

    def forward(self):
        """Set POSE for the JOINTs. Return a code; with ERR_RANGE inverse() does not lead back from
        it."""
        r = self.r
        code = 0 if compute(r, self._forward) else ERR_RANGE
        if self._offset:
            compute(r, _NODAL_OFFSET)
        compute(r, _TO_POSE)
        return code
