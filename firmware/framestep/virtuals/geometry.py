"""What the virtual types share: registers, axes with their units, the nodal offset.

A type's module has one class, `Geometry`, whose inverse() says where the axes of the rig stand for a pose of the
camera, and whose forward() says the opposite. A pose is vTrack, vEW, vNS, vPan, vTilt, vRoll: the place of the
lens's nodal point in units, and angles in degrees (field note 9.1). World: X = EW, Y = NS (up), Z = track; the camera
at rest looks along -Z (field note 9.4).

All numbers are `reals` in one array('i') of REGISTERS words, which all types may share, as one is configured at a time.
Nothing allocates after construction.
"""

from array import array

from framestep.motion import reals
from framestep.native import const, micropython, ptr32
from framestep.protocol import messages as m
from framestep.virtuals import trig

AXES = const(6)

# Registers; of six numbers each
POSE = const(0)  # vTrack, vEW, vNS, vPan, vTilt, vRoll
JOINT = const(12)  # the rig's axes, in the order of the type's name; units or degrees
HOME = const(24)  # where they stood at VIRT_CONFIG
PER_UNIT = const(36)  # their steps per unit
# and of one number each
LENGTH = const(48)
EXTENSION = const(50)
NODAL = const(52)  # three: right, forward and up in the camera's frame
SAFE = const(58)  # safe distance, 0 for none
AIM = const(60)  # three: aim point, X, Y, Z
PLACE = const(66)  # three: EW, NS, track of the point in which the camera's axes meet
OFFSET = const(72)  # three: EW, NS, track from there to the nodal point
T = const(78)  # four numbers that a type or a function needs for itself
_S = const(86)
_C = const(88)
_X = const(90)
_Y = const(92)
REGISTERS = const(94)

_PAN = const(6)  # from POSE or JOINT on
_TILT = const(8)
_ROLL = const(10)

_SLACK = const(-12)  # 2^-12 units: how near to its place an axis without a motor counts as there

_word = array("i", [0, 0])  # one from a payload, and 0


@micropython.viper
def _scaled(r: ptr32, a: int, start, i: int, out, j: int) -> int:
    """out[j], out[j + 1] = whole and Q16 fraction of start[i] + r[a]; 0 if that is no int32."""
    value = r[a + 0]
    s = 0 - r[a + 1]
    if s < -1:
        return 0
    base = ptr32(start)
    place = ptr32(out)
    if s > 16:
        # to the nearest 65536th
        n = s - 16
        if n > 31:
            n = 31
            value = 0
        value = (value + (1 << (n - 1))) >> n
        s = 16
    whole = value
    rest = 0
    if s < 0:
        whole = value << 1
    elif s:
        whole = value >> s
        rest = (value - (whole << s)) << (16 - s)
    half = (base[i + 0] >> 1) + (whole >> 1) + (base[i + 0] & whole & 1)
    if half > 0x3FFFFFFF or half < -0x40000000:
        return 0
    place[j] = base[i + 0] + whole
    place[j + 1] = rest
    return 1


def place(r, a, start, i, out, j):
    """out[j], out[j + 1] = whole and Q16 fraction of start[i] + r[a], all steps. A code."""
    return 0 if _scaled(r, a, start, i, out, j) else m.ERR_RANGE


def turn(r, x, y, angle):
    """Turn (r[x], r[y]) by r[angle] degrees, from x toward y."""
    trig.sines(r, _S, _C, angle)
    reals.multiply(r, _X, x, _C)
    reals.multiply(r, _Y, y, _S)
    reals.multiply(r, y, y, _C)
    reals.multiply(r, x, x, _S)
    reals.add(r, y, y, x)
    reals.subtract(r, x, _X, _Y)


def _to_world(r, v):
    """v, v + 2, v + 4: from right, up, forward of the camera at POSE to EW, NS, track.

    Rz(pan)·Rx(tilt)·Ry(roll) in a frame with x to the right, y forward and z up, of which the world has Y = z and
    Z = -y (field note 9.4). Positive pan turns left, positive tilt looks up.
    """
    turn(r, v + 2, v, POSE + _ROLL)
    turn(r, v + 4, v + 2, POSE + _TILT)
    turn(r, v, v + 4, POSE + _PAN)
    reals.negate(r, v + 4, v + 4)


def camera_axis(r, axis, to):
    """r[to], r[to + 2], r[to + 4] = the direction, as vTrack, vEW, vNS, of an axis of the camera at POSE.

    axis: 0 X to its right, 1 Y up, 2 Z backward from where it looks (field note 9.6).
    """
    for i in range(3):
        reals.put(r, OFFSET + 2 * i, 0, 0)
    reals.put(r, OFFSET + 2 * axis, -1 if axis == 2 else 1, 0)
    _to_world(r, OFFSET)
    reals.copy(r, to, OFFSET + 4)
    reals.copy(r, to + 2, OFFSET)
    reals.copy(r, to + 4, OFFSET + 2)


class Rig:
    """The axes of a type: which motors, how many steps to the unit, and where they stood at VIRT_CONFIG.

    r: array('i') of REGISTERS words, shared with the caller. motor: of the axes 0 to 5, the motor's number or 0.
    joints: how many axes the type has. main: of the virtual axes 1 to 6, the axis whose steps a jog's destination is in
    (field note 9.6), plus 1; 0 for a virtual axis that the type does not have.

    Where a method gives back a code, it is 0, or ERR_RANGE for what the rig cannot reach.
    """

    joints = AXES
    main = b""

    def __init__(self, r):
        self.r = r
        self.motor = bytearray(AXES)
        self.start = array("i", [0] * AXES)
        self._absent = False
        self._offset = False

    # ---------------------------------------------------------------- VIRT_CONFIG

    def configure(self, reader, present):
        """Take a VIRT_CONFIG; present: array('i') with the motors' steps now, motor 1 first.

        0; ERR_UNSUPPORTED for a length that the type does not have; ERR_RANGE for a number that cannot be. Unless it
        is 0 all stays as it was. Afterwards POSE is where the rig stands, which may be out of inverse()'s reach.
        """
        numbers = self._numbers(reader.length)
        if numbers < 0:
            return m.ERR_UNSUPPORTED
        code = self._check(reader, present)
        if code:
            return code
        r = self.r
        self._absent = False
        for i in range(AXES):
            motor = reader.u8(1 + 12 * i)
            self.motor[i] = motor
            self.number(reader, 5 + 12 * i, PER_UNIT + 2 * i, 1000)
            self.number(reader, 9 + 12 * i, HOME + 2 * i, 100000)
            if motor:
                reals.copy_word(self.start, i, present, motor - 1)
            else:
                self.start[i] = 0
                self._absent = True
        at = 1 + 12 * AXES
        if numbers == 5:
            self.number(reader, at, LENGTH, 1000)
            self.number(reader, at + 4, EXTENSION, 1000)
            at += 8
        self._offset = False
        for i in range(3):
            self.number(reader, at + 4 * i, NODAL + 2 * i, 1000)
            if reals.sign(r, NODAL + 2 * i):
                self._offset = True
        reals.put(r, SAFE, 0, 0)
        rest = reader.length - at - 12
        if rest == 4 or rest == 488:  # 484 are the boom table
            self.number(reader, reader.length - 4, SAFE, 1000)
        self._adopt(reader)
        self.locate(present)
        return 0

    def _numbers(self, length):
        """How many numbers follow the triples in a payload of this length; -1 if it is none of this type."""
        raise NotImplementedError

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
        """What a type keeps besides."""

    def number(self, reader, at, to, scale):
        """r[to] = the signed DWORD at `at`, divided by scale."""
        r = self.r
        reader.word_to(at, _word, 0)
        reals.put_difference(r, to, _word, 0, _word, 1)
        reals.put(r, _S, scale, 0)
        reals.divide(r, to, to, _S)

    # ---------------------------------------------------------------- steps

    def steps(self, i, out, j):
        """out[j] = the whole step and out[j + 1] = the fraction in Q16 at which axis i stands at JOINT. A code.

        out: array('i'). Of an axis without a motor: 0.
        """
        r = self.r
        reals.subtract(r, _X, JOINT + 2 * i, HOME + 2 * i)
        reals.multiply(r, _X, _X, PER_UNIT + 2 * i)
        return place(r, _X, self.start, i, out, j)

    def joint(self, i, steps, j):
        """JOINT of axis i from the step steps[j]. A code."""
        r = self.r
        reals.put_difference(r, _X, steps, j, self.start, i)
        reals.divide(r, _X, _X, PER_UNIT + 2 * i)
        reals.add(r, JOINT + 2 * i, HOME + 2 * i, _X)
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
        self.nodal()
        reals.subtract(r, PLACE, POSE + 2, OFFSET)
        reals.subtract(r, PLACE + 2, POSE + 4, OFFSET + 2)
        reals.subtract(r, PLACE + 4, POSE, OFFSET + 4)
        reals.copy(r, JOINT + _PAN, POSE + _PAN)
        reals.copy(r, JOINT + _TILT, POSE + _TILT)
        reals.copy(r, JOINT + _ROLL, POSE + _ROLL)
        if not self._reach():
            return m.ERR_RANGE
        if self._absent:
            for i in range(AXES):
                if self.motor[i] == 0:
                    reals.subtract(r, _X, JOINT + 2 * i, HOME + 2 * i)
                    if reals.sign(r, _X) and r[_X + 1] + 30 > _SLACK:
                        return m.ERR_RANGE
                    reals.copy(r, JOINT + 2 * i, HOME + 2 * i)
        return 0

    def forward(self):
        """POSE for the JOINTs. A code; with ERR_RANGE it is not one that inverse() leads back from."""
        r = self.r
        reals.copy(r, POSE + _PAN, JOINT + _PAN)
        reals.copy(r, POSE + _TILT, JOINT + _TILT)
        reals.copy(r, POSE + _ROLL, JOINT + _ROLL)
        code = 0 if self._stand() else m.ERR_RANGE
        self.nodal()
        reals.add(r, POSE + 2, PLACE, OFFSET)
        reals.add(r, POSE + 4, PLACE + 2, OFFSET + 2)
        reals.add(r, POSE, PLACE + 4, OFFSET + 4)
        return code

    def _reach(self):
        """The first three JOINTs from PLACE, and what they do to the pan; False where the rig cannot reach."""
        raise NotImplementedError

    def _stand(self):
        """PLACE from the first three JOINTs, and vPan; False where inverse() does not lead back."""
        raise NotImplementedError

    def nodal(self):
        """OFFSET from NODAL and the angles of POSE."""
        r = self.r
        if not self._offset:
            for i in range(6):
                r[OFFSET + i] = 0
            return
        reals.copy(r, OFFSET, NODAL)
        reals.copy(r, OFFSET + 2, NODAL + 4)
        reals.copy(r, OFFSET + 4, NODAL + 2)
        _to_world(r, OFFSET)
