"""What the virtual types share: registers, axes with their units, the nodal offset.

A type's module has one class, `Geometry`, whose inverse() says where the axes of the rig stand for a pose of the
camera, and whose forward() says the opposite. A pose is vTrack, vEW, vNS, vPan, vTilt, vRoll: the place of the
lens's nodal point in units, and angles in degrees (field note 9.1). World: X = EW, Y = NS (up), Z = track; the camera
at rest looks along -Z (field note 9.4).

POSE counts as forward() does. The host counts from the pose that it has told at VIRT_CONFIG (field note 9.2): what it
is told and asks for is that pose plus the change of POSE since then. So straight axes may begin anywhere, here at 0.

All numbers are `reals` in one array('i') of REGISTERS words, which all types may share, as one is configured at a time.
Nothing allocates after construction.
"""

from array import array

from framestep import results as m
from framestep.motion import reals
from framestep.native import const, micropython, ptr32
from framestep.virtuals.formulas import ADD, COPY, END, MULTIPLY, NEGATE, SINES, SUBTRACT, compute

AXES = const(6)

# Registers; of six numbers each
POSE = const(0)  # vTrack, vEW, vNS, vPan, vTilt, vRoll
JOINT = const(12)  # the rig's axes, in the order of the type's name; units or degrees
HOME = const(24)  # where they stood at VIRT_CONFIG: angles without whole turns, straight axes at 0
PER_UNIT = const(36)  # their steps per unit
# and of one number each
LENGTH = const(48)
EXTENSION = const(50)
NODAL = const(52)  # three: right, forward and up in the camera's frame
SAFE = const(58)  # safe distance, 0 for none
AIM = const(60)  # three: aim point, X, Y, Z
PLACE = const(66)  # three: EW, NS, track of the point in which the camera's axes meet
OFFSET = const(72)  # three: EW, NS, track from there to the nodal point
ZERO = const(78)
T = const(80)  # eight numbers for whatever a function needs
X = const(96)
Y = const(98)
OWN = const(100)  # four numbers that a type keeps
BEGUN = const(108)  # six: the pose for which the host has told `told`
REGISTERS = const(120)

_PAN = const(6)  # from POSE or JOINT on
_TILT = const(8)
_ROLL = const(10)

_SLACK = const(-12)  # 2^-12 units: how near to its place an axis without a motor counts as there

_word = array("i", [0, 0])  # one from a payload, and 0


# The angles' registers, from POSE or JOINT on
PAN = const(6)
TILT = const(8)
ROLL = const(10)

# OFFSET from right, up and forward of the camera at POSE to EW, NS and track: Rz(pan)·Rx(tilt)·Ry(roll) in a frame with
# x to the right, y forward and z up, of which the world has Y = z and Z = -y (field note 9.4). Positive pan turns left,
# positive tilt looks up. First the roll turns up to the right, then the tilt forward up, then the pan right forward.
_TURN = bytes(
    (SINES, T, POSE + ROLL, T + 2)
    + (MULTIPLY, X, OFFSET + 2, T + 2)
    + (MULTIPLY, Y, OFFSET, T)
    + (MULTIPLY, OFFSET + 2, OFFSET + 2, T)
    + (MULTIPLY, OFFSET, OFFSET, T + 2)
    + (ADD, OFFSET, OFFSET, OFFSET + 2)
    + (SUBTRACT, OFFSET + 2, X, Y)
    + (SINES, T, POSE + TILT, T + 2)
    + (MULTIPLY, X, OFFSET + 4, T + 2)
    + (MULTIPLY, Y, OFFSET + 2, T)
    + (MULTIPLY, OFFSET + 4, OFFSET + 4, T)
    + (MULTIPLY, OFFSET + 2, OFFSET + 2, T + 2)
    + (ADD, OFFSET + 2, OFFSET + 2, OFFSET + 4)
    + (SUBTRACT, OFFSET + 4, X, Y)
    + (SINES, T, POSE + PAN, T + 2)
    + (MULTIPLY, X, OFFSET, T + 2)
    + (MULTIPLY, Y, OFFSET + 4, T)
    + (MULTIPLY, OFFSET, OFFSET, T)
    + (MULTIPLY, OFFSET + 4, OFFSET + 4, T + 2)
    + (ADD, OFFSET + 4, OFFSET + 4, OFFSET)
    + (SUBTRACT, OFFSET, X, Y)
    + (NEGATE, OFFSET + 4, OFFSET + 4, 0)
    + (END, 0, 0, 0)
)

_NODAL = (
    bytes(
        (COPY, OFFSET, NODAL, 0)  # right
        + (COPY, OFFSET + 2, NODAL + 4, 0)  # up
        + (COPY, OFFSET + 4, NODAL + 2, 0)  # forward
    )
    + _TURN
)

# With OFFSET known: where the camera's axes meet, and its angles; the first part of every inverse()
FROM_POSE = bytes(
    (SUBTRACT, PLACE, POSE + 2, OFFSET)
    + (SUBTRACT, PLACE + 2, POSE + 4, OFFSET + 2)
    + (SUBTRACT, PLACE + 4, POSE, OFFSET + 4)
    + (COPY, JOINT + PAN, POSE + PAN, 0)
    + (COPY, JOINT + TILT, POSE + TILT, 0)
    + (COPY, JOINT + ROLL, POSE + ROLL, 0)
)

# The other way round: the first part of every forward(), and the last
ANGLES = bytes(
    (COPY, POSE + PAN, JOINT + PAN, 0) + (COPY, POSE + TILT, JOINT + TILT, 0) + (COPY, POSE + ROLL, JOINT + ROLL, 0)
)
_TO_POSE = bytes(
    (ADD, POSE + 2, PLACE, OFFSET)
    + (ADD, POSE + 4, PLACE + 2, OFFSET + 2)
    + (ADD, POSE, PLACE + 4, OFFSET + 4)
    + (END, 0, 0, 0)
)

# T to T + 10: how many steps each axis is from its place at VIRT_CONFIG
_STEPS = bytes(
    (SUBTRACT, T, JOINT, HOME)
    + (MULTIPLY, T, T, PER_UNIT)
    + (SUBTRACT, T + 2, JOINT + 2, HOME + 2)
    + (MULTIPLY, T + 2, T + 2, PER_UNIT + 2)
    + (SUBTRACT, T + 4, JOINT + 4, HOME + 4)
    + (MULTIPLY, T + 4, T + 4, PER_UNIT + 4)
    + (SUBTRACT, T + 6, JOINT + 6, HOME + 6)
    + (MULTIPLY, T + 6, T + 6, PER_UNIT + 6)
    + (SUBTRACT, T + 8, JOINT + 8, HOME + 8)
    + (MULTIPLY, T + 8, T + 8, PER_UNIT + 8)
    + (SUBTRACT, T + 10, JOINT + 10, HOME + 10)
    + (MULTIPLY, T + 10, T + 10, PER_UNIT + 10)
    + (END, 0, 0, 0)
)


@micropython.viper
def places(r: ptr32, a: int, start, i: int, out, j: int, count: int) -> int:
    """out[j], out[j + 1] = whole and Q16 fraction of start[i] + r[a], all steps; and so on for `count` numbers.

    0 if one of them is not below 2^31 - 2^23, so that sums of what lies beside it fit 32 bits, else 1.
    """
    base = ptr32(start)
    place = ptr32(out)
    end = j + count + count
    while j < end:
        value = r[a + 0]
        s = 0 - r[a + 1]
        if s < -1:
            return 0
        if s > 16:
            # to the nearest 65536th
            s -= 16
            if s > 31:
                s = 31
                value = 0
            value = (value + (1 << (s - 1))) >> s
            s = 16
        whole = value
        rest = 0
        if s < 0:
            whole = value << 1
        elif s:
            whole = value >> s
            rest = (value - (whole << s)) << (16 - s)
        half = (base[i + 0] >> 1) + (whole >> 1) + (base[i + 0] & whole & 1)
        if half > 0x3FBFFFFF or half < -0x3FC00000:
            return 0
        place[j + 0] = base[i + 0] + whole
        place[j + 1] = rest
        a += 2
        i += 1
        j += 2
    return 1


@micropython.viper
def _sum_to_word(out: ptr32, i: int, r: ptr32, a: int, told, j: int):
    """out[i] = told[j] and the whole number nearest to r[a], or the end of the range that is nearer."""
    start = ptr32(told)[j + 0]
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
    way = 0
    if s > 0x20000000:
        way = 1
    elif s < -0x20000001:
        way = -1
    else:
        half = (start >> 1) + half + (start & odd & 1)
        if half > 0x3FFFFFFF:
            way = 1
        elif half < -0x40000000:
            way = -1
    if way:
        start = 0
        odd = 0
        half = -0x40000000
        if way > 0:
            start = 1
            half = 0x3FFFFFFF
    out[i] = half + half + ((start ^ odd) & 1)


def camera_axis(r, axis, to):
    """r[to], r[to + 2], r[to + 4] = the direction, as vTrack, vEW, vNS, of an axis of the camera at POSE.

    axis: 0 X to its right, 1 Y up, 2 Z backward from where it looks (field note 9.6).
    """
    for i in range(0, 6, 2):
        reals.copy(r, OFFSET + i, ZERO)
    reals.put(r, OFFSET + 2 * axis, -1 if axis == 2 else 1, 0)
    compute(0, 0, r, _TURN)
    reals.copy(r, to, OFFSET + 4)
    reals.copy(r, to + 2, OFFSET)
    reals.copy(r, to + 4, OFFSET + 2)
    for i in range(0, 6, 2):
        reals.copy(r, OFFSET + i, ZERO)


class Rig:
    """The axes of a type: which motors, how many steps to the unit, and where they stood at VIRT_CONFIG.

    An axis that turns stands at its motor's steps by the steps per unit; an axis without a motor stands at 0.

    least: bytes of the shortest VIRT_CONFIG.
    r: array('i') of REGISTERS words, shared with the caller. motor: of the axes 0 to 5, the motor's number or 0.
    joints: how many axes the type has. main: of the virtual axes 1 to 6, the axis whose steps a jog's destination is in
    (field note 9.6), plus 1; 0 for a virtual axis that the type does not have. straight: bits of the axes that do not
    turn.

    Where a method gives back a code, it is 0, or ERR_RANGE for what the rig cannot reach. A type gives two formulas
    (formulas.py): _inverse from POSE and OFFSET to JOINT, where ABOVE refuses what cannot be reached; _forward from
    JOINT to PLACE and the angles of POSE, which computes all of them before an ABOVE.
    """

    joints = AXES
    least = 0
    main = b""
    straight = 0
    _inverse = b""
    _forward = b""

    def __init__(self, r):
        self.r = r
        self.motor = bytearray(AXES)
        self.start = array("i", [0] * AXES)
        self.told = array("i", [0] * AXES)  # the pose that VIRT_CONFIG has told, times 100000
        self._absent = False
        self._offset = False

    # ---------------------------------------------------------------- VIRT_CONFIG

    def configure(self, reader, present):
        """Take a VIRT_CONFIG; present: array('i') with the motors' steps now, motor 1 first.

        0, or ERR_RANGE for a payload that is too short or a number that cannot be: then all stays as it was.
        Afterwards POSE is where the rig stands, which may be out of inverse()'s reach.
        """
        if reader.length < self.least:
            return m.ERR_RANGE
        code = self._check(reader, present)
        if code:
            return code
        r = self.r
        for i in range(AXES):
            self.motor[i] = reader.u8(1 + 12 * i)
            self.number(reader, 5 + 12 * i, PER_UNIT + 2 * i, 1000)
            reader.copy_i32_to(9 + 12 * self._carrier(i), self.told, i)
        at = 1 + 12 * AXES
        if self.least > at + 12:
            self.number(reader, at, LENGTH, 1000)
            self.number(reader, at + 4, EXTENSION, 1000)
            at += 8
        self._offset = False
        for i in range(6):
            r[OFFSET + i] = 0
        for i in range(3):
            self.number(reader, at + 4 * i, NODAL + 2 * i, 1000)
            if reals.sign(r, NODAL + 2 * i):
                self._offset = True
        reals.put(r, SAFE, 0, 0)
        at += 12 + self._adopt(reader)
        if reader.length >= at + 4:
            self.number(reader, at, SAFE, 1000)  # what follows is ignored (field note 1.8)
        self._begin(present)
        return 0

    def _carrier(self, i):
        """The axis whose `pos` is the number i of the pose (field note 9.2): that whose steps a jog of it is in."""
        return self.main[i + 1] - 1

    def _begin(self, present):
        """HOME and `start` of all axes, and BEGUN."""
        r = self.r
        self._absent = False
        for i in range(AXES):
            home = HOME + 2 * i
            reals.put(r, home, 0, 0)
            self.start[i] = 0
            motor = self.motor[i]
            if not motor:
                self._absent = True
                continue
            if not self.straight >> i & 1:
                self.joint(i, present, motor - 1)  # counted from step 0
                # without whole turns, lest a motor that has made many of them be less exact
                reals.put(r, Y, 360, 0)
                reals.divide(r, X, JOINT + 2 * i, Y)
                reals.put(r, T, 1, -1)
                reals.add(r, X, X, T)
                reals.put(r, X, reals.floor(r, X, 0x7FFFFF), 0)
                reals.multiply(r, X, X, Y)
                reals.subtract(r, home, JOINT + 2 * i, X)
            reals.copy_word(self.start, i, present, motor - 1)
        self.locate(present)
        for k in range(0, 2 * AXES, 2):
            reals.copy(r, BEGUN + k, POSE + k)

    def _check(self, reader, present):
        """A code for what the payload says, before anything is changed."""
        for i in range(AXES):
            motor = reader.i32(1 + 12 * i)
            if motor < 0 or motor > len(present):
                return m.ERR_RANGE
            if motor:
                if reader.i32(5 + 12 * i) == 0:
                    return m.ERR_RANGE
                for k in range(i):
                    if reader.i32(1 + 12 * k) == motor:
                        return m.ERR_RANGE
        return 0

    def _adopt(self, reader):
        """What a type keeps besides; how many bytes of the payload's end that is."""
        return 0

    def number(self, reader, at, to, scale):
        """r[to] = the signed DWORD at `at`, divided by scale."""
        r = self.r
        reader.copy_i32_to(at, _word, 0)
        reals.put_difference(r, to, _word, 0, _word, 1)
        reals.put(r, X, scale, 0)
        reals.divide(r, to, to, X)

    # ---------------------------------------------------------------- the host's coordinates

    def tell(self, out, j, i):
        """out[j] = number i of POSE as the host counts it, times 100000, held within 32 bits."""
        r = self.r
        reals.subtract(r, X, POSE + 2 * i, BEGUN + 2 * i)
        reals.put(r, Y, 100000, 0)
        reals.multiply(r, X, X, Y)
        _sum_to_word(out, j, r, X, self.told, i)

    def meant(self, to, i, source, j):
        """r[to] = number i of POSE for what the host calls source[j] / 100000."""
        r = self.r
        reals.put_difference(r, X, source, j, self.told, i)
        reals.put(r, Y, 100000, 0)
        reals.divide(r, X, X, Y)
        reals.add(r, to, BEGUN + 2 * i, X)

    def shift(self, to, i):
        """r[to] = what the host counts less than POSE, of number i."""
        r = self.r
        reals.put_difference(r, X, self.told, i, _word, 1)
        reals.put(r, Y, 100000, 0)
        reals.divide(r, X, X, Y)
        reals.subtract(r, to, X, BEGUN + 2 * i)

    # ---------------------------------------------------------------- steps

    def places(self, out, j):
        """out[j + 2i], out[j + 2i + 1] = whole step and Q16 fraction at which axis i stands at JOINT. A code.

        out: array('i'), 12 words of it. For an axis without a motor: 0.
        """
        r = self.r
        compute(0, 0, r, _STEPS)
        if not places(r, T, self.start, 0, out, j, AXES):
            return m.ERR_RANGE
        return self._bend(out, j)

    def _bend(self, out, j):
        """What a type has to change of places()."""
        return 0

    def joint(self, i, steps, j):
        """JOINT of axis i from the step steps[j]. A code."""
        r = self.r
        reals.put_difference(r, X, steps, j, self.start, i)
        reals.divide(r, X, X, PER_UNIT + 2 * i)
        reals.add(r, JOINT + 2 * i, HOME + 2 * i, X)
        return 0

    def locate(self, present):
        """JOINT and POSE from the motors' steps; inverse() keeps to the side of the rig that these are on. A code.

        With ERR_RANGE the numbers are there, but the rig is not where inverse() leads to.
        """
        code = 0
        for i in range(AXES):
            if self.motor[i]:
                code |= self.joint(i, present, self.motor[i] - 1)
            else:
                reals.copy(self.r, JOINT + 2 * i, HOME + 2 * i)
        self._choose()
        return code | self.forward()

    def _choose(self):
        """Decide on the branch of inverse() by JOINT."""

    # ---------------------------------------------------------------- kinematics

    def inverse(self):
        """JOINT for the POSE. A code; with ERR_RANGE JOINT is of no use."""
        r = self.r
        if self._offset:
            compute(0, 0, r, _NODAL)
        if not compute(0, 0, r, self._inverse):
            return m.ERR_RANGE
        if self._absent:
            for i in range(AXES):
                if self.motor[i] == 0:
                    reals.subtract(r, X, JOINT + 2 * i, HOME + 2 * i)
                    if reals.sign(r, X) and r[X + 1] + 30 > _SLACK:
                        return m.ERR_RANGE
                    reals.copy(r, JOINT + 2 * i, HOME + 2 * i)
        return 0

    def forward(self):
        """POSE for the JOINTs. A code; with ERR_RANGE it is not one that inverse() leads back from."""
        r = self.r
        code = 0 if compute(0, 0, r, self._forward) else m.ERR_RANGE
        if self._offset:
            compute(0, 0, r, _NODAL)
        compute(0, 0, r, _TO_POSE)
        return code
