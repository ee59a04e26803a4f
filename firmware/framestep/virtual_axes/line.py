"""A line in virtual space: its definition, the motors' positions on it, and their bounds.

It is POSE = BASE + s·DIRECTION, for s from 0 on. If a single motor moves while an aim point is on,
it is JOINT = BASE + s·DIRECTION. While an aim point is on, pan and tilt are its direction plus an
offset, to which DIRECTION adds. Nothing allocates after construction.
"""

from array import array

from framestep.base import results
from framestep.base.native import const, micropython, ptr32
from framestep.motion import reals
from framestep.motion.compute import compute
from framestep.motion.formula import formula
from framestep.motion.reals import combine, multiply, order_words
from framestep.virtual_axes import registers
from framestep.virtual_axes.kinematics import aim

ROW = const(12)  # words of `rows` with all motors' positions: step and Q16 fraction of each
SURVEY = const(192)  # index of the first of the survey's three rows, after those of 16 knots

# Words per motor of `bounds`
LOW = const(0)
HIGH = const(1)
CODE_LOW = const(2)  # from bit 8 on: how far (Q16) the line begins beyond the bound, by rounding
CODE_HIGH = const(3)

_TURNS = const(20)  # most iterations until pan and tilt are aimed

# Keep the offsets of pan and tilt from the direction of the aim point, unless they change by more
# than rounding to steps.
_KEEP_PAN = formula(
    registers,
    """
    offset = V_PAN - AIMED_PAN
    steps = (offset - PAN_OFFSET) * PER_UNIT[3]
    assert max(steps, -steps) > 0.75
    PAN_OFFSET = offset
    """,
)
_KEEP_TILT = formula(
    registers,
    """
    offset = V_TILT - AIMED_TILT
    steps = (offset - TILT_OFFSET) * PER_UNIT[4]
    assert max(steps, -steps) > 0.75
    TILT_OFFSET = offset
    """,
)
_AS_AIMED = formula(
    registers,
    """
    V_PAN = AIMED_PAN + PAN_OFFSET
    V_TILT = AIMED_TILT + TILT_OFFSET
    """,
)
_FOLLOW_POINT = formula(
    registers,
    """
    V_PAN = DIRECTION_PAN + (V_PAN - AIMED_PAN)
    V_TILT = DIRECTION_TILT + (V_TILT - AIMED_TILT)
    """,
)
_KEEP_ANGLES = formula(
    registers,
    """
    TURN_PAN = V_PAN
    TURN_TILT = V_TILT
    V_PAN = AIMED_PAN + PAN_OFFSET
    V_TILT = AIMED_TILT + TILT_OFFSET
    """,
)
_TURN_JOINTS = formula(
    registers,
    """
    TURN_PAN = V_PAN - TURN_PAN
    TURN_TILT = V_TILT - TURN_TILT
    JOINT_PAN = JOINT_PAN + TURN_PAN
    JOINT_TILT = JOINT_TILT + TURN_TILT
    assert max(TURN_PAN, -TURN_PAN) < 2 ** -17  # degrees
    assert max(TURN_TILT, -TURN_TILT) < 2 ** -17
    """,
)


@micropython.viper
def along(r, to: int, base: int, direction: int, s: int, spare: int):
    """Six numbers: r[to] = r[base] + r[direction]·r[s]"""
    k = 0
    while k < 12:
        multiply(r, spare, direction + k, s)
        combine(r, to + k, base + k, spare, 0)
        k += 2


@micropython.viper
def _allow_start(bounds: ptr32, rows: ptr32, a: int, motor: ptr32):
    """Note in `bounds` by how much positions of a row, within a step of the bounds, exceed them."""
    k = 0
    i = 0
    while i < registers.AXES:
        if motor[i + 0]:
            if (rows[a + 0] >> 2) - (bounds[k + HIGH] >> 2) > -2:
                d = ((rows[a + 0] - bounds[k + HIGH]) << 16) + rows[a + 1]
                if d > 0:
                    bounds[k + CODE_HIGH] = bounds[k + CODE_HIGH] + (d << 8)
            if (rows[a + 0] >> 2) - (bounds[k + LOW] >> 2) < 2:
                d = ((bounds[k + LOW] - rows[a + 0]) << 16) - rows[a + 1]
                if d > 0:
                    bounds[k + CODE_LOW] = bounds[k + CODE_LOW] + (d << 8)
        a += 2
        k += 4
        i += 1


@micropython.viper
def _clip(bounds: ptr32, k: int, present: ptr32, motor: int, target, j: int) -> int:
    """Narrow a motor's bounds to the step target[j]. Return on which side that lies: -1, 0 or 1."""
    t = ptr32(target)[j + 0]
    if t > present[motor + 0]:
        if t < bounds[k + HIGH]:
            bounds[k + HIGH] = t
        return 1
    if t < present[motor + 0]:
        if t > bounds[k + LOW]:
            bounds[k + LOW] = t
        return -1
    return 0


@micropython.viper
def _within_a_step(rows: ptr32, k: int, present: ptr32, motor: int) -> int:
    """Return whether the position in rows[k] is within a step of the motor's."""
    d = (rows[k + 0] >> 2) - (present[motor + 0] >> 2)
    if d > 1 or d < -1:
        return 0
    d = ((rows[k + 0] - present[motor + 0]) << 16) + rows[k + 1]
    if d > 0x10000 or d < -0x10000:
        return 0
    return 1


class Line:
    """One line at a time. r: the array of registers, shared with the rig's kinematics."""

    def __init__(self, axes, safety, r):
        self.axes = axes
        self.safety = safety
        self.r = r
        self.rig = None  # the Kinematics configured
        self.bits = 0  # motors of the rig
        self.motor = array("i", [0] * registers.AXES)  # of each axis of the rig, from 1; 0 for none
        self.rows = array("i", [0] * (SURVEY + 3 * ROW))
        self.bounds = array("i", [0] * (4 * registers.AXES))
        self.present = array("i", [0] * axes.count)  # steps of all motors at the line's beginning
        self.rest = array("i", [0] * registers.AXES)  # steps of the rig's motors at the last end
        self.rested = False
        self.aiming = False  # pan and tilt follow the aim point
        self.by_joint = False  # the line is one of JOINTs

    def adopt(self, rig):
        """Make a configured Kinematics the rig, or None. Only at rest."""
        self.rig = rig
        self.rested = False
        self.aiming = False
        self.bits = 0
        for i in range(registers.AXES):
            self.motor[i] = rig.motor[i] if rig else 0
            if self.motor[i]:
                self.bits |= 1 << (self.motor[i] - 1)

    # ---------------------------------------------------------------- its beginning

    def locate(self):
        """Set POSE and JOINT to where the motors are. Return a code."""
        for i in range(self.axes.count):
            self.axes[i].position_to(self.present, i)
        self.axes.hal.port.look_for_stop()
        return self.rig.locate(self.present)

    def begin_line(self, by_joint=False):
        """Begin a line where the rig is. BASE becomes its pose, or its axes; DIRECTION becomes 0,
        to be set by the caller. Return a code."""
        code = self.locate()
        if not code and self.aiming:
            code = self._take_aim()
        if code:
            return code
        r = self.r
        port = self.axes.hal.port
        port.look_for_stop()
        if self._is_where_line_ended():
            # so that rounding to steps does not add up from line to line
            for k in range(0, 2 * registers.AXES, 2):
                reals.copy(r, registers.POSE + k, registers.LAST_END + k)
        self.by_joint = by_joint
        base = registers.JOINT if by_joint else registers.POSE
        for k in range(0, 2 * registers.AXES, 2):
            reals.copy(r, registers.BASE + k, base + k)
            reals.put(r, registers.DIRECTION + k, 0, 0)
        port.look_for_stop()
        self._set_bounds()
        port.look_for_stop()
        # The inverse of this pose must be where the rig is: there may be two solutions.
        code = self.positions_at(registers.ZERO, SURVEY)
        if code:
            return code
        port.look_for_stop()
        for i in range(registers.AXES):
            motor = self.motor[i] - 1
            if motor >= 0 and not _within_a_step(self.rows, SURVEY + 2 * i, self.present, motor):
                return results.ERR_RANGE
        _allow_start(self.bounds, self.rows, SURVEY, self.motor)
        return 0

    def take_aim(self):
        """Take the aim point as seen from here; pan and tilt keep their offsets from it. Return a
        code."""
        code = self.locate()
        if code:
            return code
        reals.put(self.r, registers.PAN_OFFSET, 0, 0)
        reals.put(self.r, registers.TILT_OFFSET, 0, 0)
        return self._take_aim()

    def _take_aim(self):
        """Set AIMED_PAN, AIMED_TILT and the offsets for the pose located. Return a code."""
        r = self.r
        reals.copy(r, registers.NEAR_PAN, registers.V_PAN)
        code = aim.direction(r)
        if code:
            return code
        reals.copy(r, registers.AIMED_PAN, registers.DIRECTION_PAN)
        reals.copy(r, registers.AIMED_TILT, registers.DIRECTION_TILT)
        reals.copy(
            r, registers.NEAR_PAN, registers.AIMED_PAN
        )  # on a line it never turns by half a turn
        compute(r, _KEEP_PAN)
        compute(r, _KEEP_TILT)
        compute(r, _AS_AIMED)
        return 0

    def remember_end(self):
        """Keep the pose at S, where the line has ended."""
        if self.aiming or self.by_joint:
            return
        along(
            self.r,
            registers.LAST_END,
            registers.BASE,
            registers.DIRECTION,
            registers.S,
            registers.SPARE,
        )
        for i in range(registers.AXES):
            if self.motor[i]:
                self.axes[self.motor[i] - 1].position_to(self.rest, i)
        self.rested = True

    def forget_end(self):
        """Drop the kept pose, because the motors start."""
        self.rested = False

    def _is_where_line_ended(self):
        """Return whether the motors present are where the last line ended."""
        if self.aiming or not self.rested:
            return False
        for i in range(registers.AXES):
            motor = self.motor[i] - 1
            if motor >= 0 and not reals.equal_words(self.rest, i, self.present, motor):
                return False
        return True

    # ---------------------------------------------------------------- bounds

    def _set_bounds(self):
        """Set the bounds: soft limits, and no motion into an active limit switch."""
        bounds = self.bounds
        for i in range(registers.AXES):
            motor = self.motor[i] - 1
            if motor < 0:
                continue
            axis = self.axes[motor]
            ends = self.safety.active_limits(motor)
            k = 4 * i
            bounds[k + CODE_LOW] = results.ERR_HARD_LOW if ends & 2 else results.ERR_SOFT_LOW
            bounds[k + CODE_HIGH] = results.ERR_HARD_UP if ends & 1 else results.ERR_SOFT_UP
            # a motor beyond a limit may come back (field note 4.3)
            if ends & 2 or order_words(self.present, motor, axis.bounds, 0) < 0:
                reals.copy_word(bounds, k + LOW, self.present, motor)
            else:
                reals.copy_word(bounds, k + LOW, axis.bounds, 0)
            if ends & 1 or order_words(self.present, motor, axis.bounds, 1) > 0:
                reals.copy_word(bounds, k + HIGH, self.present, motor)
            else:
                reals.copy_word(bounds, k + HIGH, axis.bounds, 1)

    def limits_narrowed(self, motor):
        """Return whether soft limits of a motor (from 0) now leave less room than the line uses."""
        bounds = self.axes[motor].bounds
        for i in range(registers.AXES):
            if self.motor[i] == motor + 1:
                if order_words(bounds, 0, self.bounds, 4 * i + LOW) > 0:
                    return True
                return order_words(bounds, 1, self.bounds, 4 * i + HIGH) < 0
        return False

    def clip_end(self, i, target, j):
        """Limit axis i to the step target[j]. Return on which side that lies: -1, 0 or 1."""
        return _clip(self.bounds, 4 * i, self.present, self.motor[i] - 1, target, j)

    def side(self, i, target, j):
        """Return on which side of axis i's position at the line's beginning the step target[j]
        lies: -1, 0 or 1."""
        return order_words(target, j, self.present, self.motor[i] - 1)

    def direction(self, i, a, b):
        """Return in which direction the motor of axis i goes from row a to row b: -1 or 1."""
        return order_words(self.rows, b + 2 * i, self.rows, a + 2 * i) or 1

    # ---------------------------------------------------------------- positions

    def positions_at(self, s, row):
        """Put the motors' positions at r[s] into rows[row …]. Return a code."""
        rig = self.rig
        r = self.r
        if self.by_joint:
            along(r, registers.JOINT, registers.BASE, registers.DIRECTION, s, registers.SPARE)
            code = self._aim_joints()
        else:
            along(r, registers.POSE, registers.BASE, registers.DIRECTION, s, registers.SPARE)
            code = self._aim_pose() if self.aiming else 0
            if not code:
                code = rig.inverse()
        if code:
            return code
        return rig.motor_steps(self.rows, row)

    def _aim_pose(self):
        """Turn the angles of POSE to the aim point, from its position. Return a code."""
        code = aim.direction(self.r)
        compute(self.r, _FOLLOW_POINT)
        return code

    def _aim_joints(self):
        """Turn pan and tilt of JOINT to the aim point, by iteration, because with a nodal offset
        that moves the camera. Return a code."""
        r = self.r
        for _ in range(_TURNS):
            code = self.rig.forward()
            if code:
                return code
            compute(r, _KEEP_ANGLES)
            code = self._aim_pose()
            if code:
                return code
            if compute(r, _TURN_JOINTS):
                return 0
        return results.ERR_RANGE
