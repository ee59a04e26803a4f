"""Requests about virtual axes: VIRT_* of the specification.

The controller merges `handlers` into its own table; a handler returns the code to acknowledge with, or 0 where it has
answered itself. Nothing allocates after construction.
"""

from array import array

from framestep.clock import WRAP as _WRAP
from framestep.motion import reals
from framestep.native import const
from framestep.protocol import messages as m
from framestep.virtuals import geometry as g
from framestep.virtuals import jog
from framestep.virtuals import motion as v

_TYPES = const(5)  # and 0 is none
_PLACE_OF = b"\x01\x02\x00"  # where X, Y, Z of an aim point stand in a pose
_LINE_AXES = b"\x02\x03\x01\x04\x05"  # the virtual axis whose VIRT_STOP ends a jog on line (field note 9.6)

# Registers
_X = const(jog.FIRST_FREE)
_AXIS = const(jog.FIRST_FREE + 2)  # three
_REGISTERS = const(jog.FIRST_FREE + 8)

_FASTEST = const(10000)  # ten-thousandths: the speed of a jog
_PAN = const(3)  # axes of the types that have a place
_TILT = const(4)
_CARRIERS = const(3)  # axes that carry pan and tilt


def _geometries(mask, r):
    """The types that a mask of capabilities has, by their number."""
    found = [None] * _TYPES
    if mask & m.CAP_BOOM_SWING_TRACK:
        from framestep.virtuals import boom_swing_track

        found[m.VIRT_BOOM_SWING_TRACK] = boom_swing_track.Geometry(r)
    if mask & m.CAP_SWING_PAN:
        from framestep.virtuals import swing_pan

        found[m.VIRT_SWING_PAN] = swing_pan.Geometry(r)
    if mask & m.CAP_Y_SWING_TRACK:
        from framestep.virtuals import y_swing_track

        found[m.VIRT_Y_SWING_TRACK] = y_swing_track.Geometry(r)
    if mask & m.CAP_X_Y_Z:
        from framestep.virtuals import x_y_z

        found[m.VIRT_X_Y_Z] = x_y_z.Geometry(r)
    return found


class Virtuals:
    """The virtual axes of a rig. controller: for what is shared with other requests."""

    def __init__(self, controller):
        self.controller = controller
        self.reader = controller.reader
        self.writer = controller.writer
        self.operations = controller.operations
        axes = controller.axes
        self.axes = axes
        self.capabilities = controller.rig.virtuals
        self.r = array("i", [0] * _REGISTERS)
        self.types = _geometries(self.capabilities, self.r)
        self.motion = v.Motion(axes, controller.safety, self.r)
        self.guide = jog.Guide(self.motion)
        self.word = array("i", [0] * 2)
        self.point = array("i", [0] * 3)  # the aim point, units · 1000
        self.old = array("i", [0] * 6)  # the point before, if a new one is refused
        self.now = 0
        # the jog under way: what was asked for, and when last, where it ends by itself
        self.jogging = 0
        self.jog_speed = 0
        self.jog_way = 0
        self.jog_at = -1
        # another one, for when that has come to rest
        self.later = 0
        self.later_speed = 0
        self.later_way = 0
        self.later_at = 0
        self.later_to = array("i", [0])
        self.moved = 0  # bits of the virtual axes that a motion is about
        self.handlers = {
            m.MSG_VIRT_CONFIG: self._config,
            m.MSG_VIRT_MOVE: self._move,
            m.MSG_VIRT_STOP: self._stop,
            m.MSG_VIRT_JOG: self._jog,
            m.MSG_VIRT_JOG_ON_LINE: self._jog_on_line,
            m.MSG_VIRT_GET_POSITION: self._get_position,
        }
        if self.capabilities & m.CAP_AIM_POINT:
            self.handlers[m.MSG_VIRT_AIM_POINT] = self._aim_point

    # ---------------------------------------------------------------- what the controller asks

    @property
    def configured(self):
        return self.motion.rig is not None

    @property
    def engaged(self):
        """Bits of the motors in a virtual motion, from its acknowledgement to its end."""
        return self.motion.engaged

    def poll(self, now):
        """One pass; now: milliseconds modulo 2^30. Whether there may be more to plan at once."""
        self.now = now
        motion = self.motion
        planned = False
        if motion.state:
            limit = self.controller.rig.jog_timeout_ms
            if self.jog_at >= 0 and limit and (now - self.jog_at) & _WRAP >= limit:
                self._leave()
                motion.stop()
            planned = motion.poll()
            if self.later and not motion.state:
                self._turn(limit)
        return planned

    def _leave(self):
        """The jog under way ends: the same one, asked for again, is another."""
        self.jog_at = -1
        self.jog_speed = 0

    def stop(self):
        """Slow down along the line."""
        self._leave()
        self.later = 0
        self.motion.stop()

    def changed(self, motor):
        """Speed or soft limits of a motor (from 0) have been set: a motion that has less room for that ends."""
        if self.engaged >> motor & 1:
            if self.motion.narrowed(motor):
                self.stop()
            self.motion.slow()

    def halt(self, factor=1):
        """Let each motor ramp down by itself, `factor` times as steeply as it is set to."""
        self._leave()
        self.later = 0
        self.motion.halt(factor)

    # ---------------------------------------------------------------- configuration

    def _config(self):
        """MSG_VIRT_CONFIG: type 0, then what the type's module says (field notes 9.2 and 9.3)."""
        reader = self.reader
        kind = reader.u8(0)
        if kind >= _TYPES:
            return m.ERR_RANGE
        busy = self.axes.moving_bits() | self.operations.engaged | self.engaged
        if busy & self.motion.bits:
            return m.ERR_MOVING
        if kind == m.VIRT_NONE:
            self.motion.adopt(None)
            self.motion.aiming = False
            return m.OK
        rig = self.types[kind]
        if rig is None:
            return m.ERR_UNSUPPORTED
        bits = self._named(kind)
        if bits & busy:
            return m.ERR_MOVING
        if not self._usable(bits):
            return m.ERR_RANGE
        present = self.motion.present
        for motor in range(self.axes.count):
            self.axes[motor].position_to(present, motor)
        code = rig.configure(reader, present)
        if code:
            return code
        self.motion.adopt(rig)
        self.motion.aiming = False
        self.controller.reports.position = True
        return m.OK

    def _named(self, kind):
        """Bits of the motors that a VIRT_CONFIG names; of those that there are."""
        reader = self.reader
        size = 8 if kind == m.VIRT_SWING_PAN else 12
        bits = 0
        at = 1
        while at + 4 <= reader.length and at < size * g.AXES:
            motor = reader.i32(at)
            if 0 < motor <= self.axes.count:
                bits |= 1 << (motor - 1)
            at += size
        return bits

    def _usable(self, bits):
        """Whether all motors of these bits are enabled, and led by no other."""
        for motor in range(self.axes.count):
            if bits >> motor & 1 and not self.controller.motors.enabled(motor):
                return False
        return True

    # ---------------------------------------------------------------- positions

    def locate(self):
        """POSE of where the motors are by what is told of them; a plan under way is not disturbed."""
        motion = self.motion
        rig = motion.rig
        for i in range(g.AXES):
            motor = motion.motor[i]
            if motor:
                rig.joint(i, self.axes.reported, motor - 1)
            else:
                reals.copy(self.r, g.JOINT + 2 * i, g.HOME + 2 * i)
        rig.forward()

    def send_positions(self, reader):
        """VIRT_GET_POSITION, asked for or not: then of the same moment as the motors' positions told last (field note
        4.6). Whether there was room."""
        writer = self.writer
        if reader:
            self.axes.choose_sample()
        self.locate()
        writer.begin(m.MSG_VIRT_GET_POSITION, reader)
        for i in range(g.AXES):
            self.motion.rig.tell(self.word, 0, i)
            writer.put_i32s_from(self.word, 0, 1)
        if self.capabilities & m.CAP_AIM_POINT:
            writer.u8(1 if self.motion.aiming else 0)
            for i in range(3):
                writer.put_i32s_from(self.point, i, 1)
        return writer.end()

    def _get_position(self):
        """MSG_VIRT_GET_POSITION: no payload. Answered with the pose (field notes 9.2 and 9.8)."""
        if not self.configured:
            return m.ERR_GENERAL
        self.send_positions(self.reader)
        return 0

    # ---------------------------------------------------------------- moves

    def _may(self):
        """OK, or why the rig may not be moved now."""
        motion = self.motion
        if not self.configured:
            return m.ERR_GENERAL
        code = self.controller.motors.may_move_all()
        if code != m.OK:
            return code
        if self.operations.engaged & motion.bits:
            return m.ERR_MOVING
        if not self._usable(motion.bits):
            return m.ERR_GENERAL
        if not motion.state and self.axes.moving_bits() & motion.bits:
            return m.ERR_MOVING
        return m.OK

    def _number(self):
        """The virtual axis of this request, or 0 where the rig has no such."""
        number = self.reader.u8(0)
        if number < 1 or number > g.AXES or not self.motion.rig.main[number]:
            return 0
        return number

    def _begin(self, bits):
        """Set out along the line that has been laid; bits: of the virtual axes that it is about."""
        self.moved = bits
        self.jog_at = -1
        self.controller.motors.motors_sent(self.motion.bits)
        self.motion.begin()

    def _move(self):
        """MSG_VIRT_MOVE: virtual axis 0, position 1 (field notes 9.1 and 9.5)."""
        code = self._may()
        if code != m.OK:
            return code
        number = self._number()
        if not number:
            return m.ERR_RANGE
        motion = self.motion
        if motion.state:
            return m.ERR_MOVING
        code = motion.lay()
        if code:
            return code
        r = self.r
        axis = 2 * (number - 1)
        self.reader.copy_i32_to(1, self.word, 0)
        motion.rig.meant(_X, number - 1, self.word, 0)
        reals.subtract(r, v.END, _X, v.BASE + axis)
        way = reals.sign(r, v.END)
        if not way:
            return m.OK
        reals.put(r, v.WAY + axis, way, 0)
        if way < 0:
            reals.negate(r, v.END, v.END)
        code = motion.survey()
        if code:
            return code
        self._begin(1 << number)
        self.jogging = 0
        return m.OK

    # ---------------------------------------------------------------- jogs

    def _under_way(self, kind, way, speed):
        """Whether the jog under way is this one, so that it only goes on."""
        return self.motion.state and self.jogging == kind and self.jog_way == way and self.jog_speed == speed

    def _next(self, kind, way, speed):
        """Another jog than the one under way is asked for: that one comes to rest first (field note 4.2). A code."""
        if not self.jogging:
            return m.ERR_MOVING
        self.stop()
        self.later = kind
        self.later_way = way
        self.later_speed = speed
        self.later_at = self.now
        reals.copy_word(self.later_to, 0, self.word, 0)
        return m.OK

    def _turn(self, limit):
        """Now it has: set out on that other one, unless it is long since it was asked for."""
        kind = self.later
        self.later = 0
        if self._may() != m.OK:
            return
        if kind > g.AXES:
            self._set_line(kind - g.AXES - 1, self.later_way, self.later_speed)
        elif not limit or (self.now - self.later_at) & _WRAP < limit:
            reals.copy_word(self.word, 0, self.later_to, 0)
            if kind > 0:
                self._set_jog(kind, self.later_speed)
            elif self.motion.aiming:
                self._set_drive(-1 - kind, self.word, 0, self.later_speed)

    def _follow(self, kind, way, speed, bits):
        """Set out on a jog along the line that has been laid. A code.

        Where a soft limit or the rig's reach leaves no way to go nothing moves, as with a motor's jog.
        """
        code = self.guide.begin(speed)
        if code:
            return m.OK if code == m.ERR_SOFT_LOW or code == m.ERR_SOFT_UP else code
        self._begin(bits)
        self.jogging = kind
        self.jog_way = way
        self.jog_speed = speed
        return m.OK

    def _jog(self):
        """MSG_VIRT_JOG: virtual axis 0, speed 1, destination 3: a step of its main motor (field note 9.6)."""
        reader = self.reader
        code = self._may()
        if code != m.OK:
            return code
        number = self._number()
        speed = reader.u16(1)
        if not number or speed < 1 or speed > _FASTEST:
            return m.ERR_RANGE
        motion = self.motion
        main = motion.rig.main[number] - 1
        if not motion.motor[main]:
            return m.ERR_RANGE
        reader.copy_i32_to(3, self.word, 0)
        if motion.state:
            # the side on which the destination lies as seen from the start tells which way it is to go
            if not self.later and self._under_way(number, motion.side(main, self.word, 0), speed):
                self.jog_at = self.now
                return m.OK
            return self._next(number, 0, speed)
        return self._set_jog(number, speed)

    def _set_jog(self, number, speed):
        """Jog a virtual axis toward the step word[0] of its main motor. A code."""
        motion = self.motion
        main = motion.rig.main[number] - 1
        code = motion.lay()
        if code:
            return code
        way = motion.bound(main, self.word, 0)
        if not way:
            return m.OK
        reals.put(self.r, v.WAY + 2 * (number - 1), self._sense(main, number) * way, 0)
        code = self._follow(number, way, speed, 1 << number)
        if code == m.OK and motion.state:
            self.jog_at = self.now
        return code

    def _sense(self, main, number):
        """1 or -1: whether the motor of axis `main` goes up or down where the virtual axis goes up."""
        motion = self.motion
        r = self.r
        axis = v.WAY + 2 * (number - 1)
        for way in range(1, -2, -2):
            reals.put(r, axis, way, 0)
            reals.put(r, _X, 1, -6)
            if not motion.place(_X, v.SURVEY + v.ROW):
                return way * motion.turned(main, v.SURVEY, v.SURVEY + v.ROW)
        return 1

    def _jog_on_line(self):
        """MSG_VIRT_JOG_ON_LINE: axis 0, speed 1. Until VIRT_STOP of the axis, or a limit (field note 9.6)."""
        reader = self.reader
        code = self._may()
        if code != m.OK:
            return code
        axis = reader.u8(0)
        speed = reader.i16(1)
        if axis > m.LINE_TILT or not speed or speed < -_FASTEST or speed > _FASTEST:
            return m.ERR_RANGE
        way = 1 if speed > 0 else -1
        speed *= way
        kind = g.AXES + 1 + axis
        number = _LINE_AXES[axis]
        motion = self.motion
        if not motion.rig.main[number]:
            return m.ERR_RANGE
        if motion.state:
            if not self.later and self._under_way(kind, way, speed):
                return m.OK
            return self._next(kind, way, speed)
        return self._set_line(axis, way, speed)

    def _set_line(self, axis, way, speed):
        """Jog along an axis of the camera. A code."""
        code = self.motion.lay()
        if code:
            return code
        r = self.r
        number = _LINE_AXES[axis]
        if axis <= m.LINE_Z:
            for k in range(m.VIRT_MOTOR_PAN - 1, m.VIRT_MOTOR_ROLL):
                self.motion.rig.shift(_X, k)
                reals.add(r, g.POSE + 2 * k, v.BASE + 2 * k, _X)
            g.camera_axis(r, axis, _AXIS)
            for k in range(0, 6, 2):
                if way < 0:
                    reals.negate(r, v.WAY + k, _AXIS + k)
                else:
                    reals.copy(r, v.WAY + k, _AXIS + k)
        else:
            reals.put(r, v.WAY + 2 * (number - 1), way, 0)
        return self._follow(g.AXES + 1 + axis, way, speed, 1 << number)

    # ---------------------------------------------------------------- the aim point

    def _aim_point(self):
        """MSG_VIRT_AIM_POINT: enable 0, x 1, y 5, z 9. Answered with the same (field note 9.7)."""
        if not self.configured:
            return m.ERR_GENERAL
        reader = self.reader
        motion = self.motion
        enable = reader.u8(0)
        if enable > 1:
            return m.ERR_RANGE
        if motion.state:
            return m.ERR_MOVING
        if enable:
            if not motion.rig.main[m.VIRT_MOTOR_TRACK] or not motion.motor[_PAN] or not motion.motor[_TILT]:
                return m.ERR_RANGE  # nothing to follow with
            if self.axes.moving_bits() & motion.bits:
                return m.ERR_MOVING
            r = self.r
            for k in range(0, 6, 2):
                reals.fetch(self.old, k, r, g.AIM + k)
                motion.rig.number(reader, 1 + 2 * k, _X, 1000)
                motion.rig.shift(g.AIM + k, _PLACE_OF[k >> 1])
                reals.subtract(r, g.AIM + k, _X, g.AIM + k)
            code = motion.look_at()
            if code:
                for k in range(0, 6, 2):
                    reals.fetch(r, g.AIM + k, self.old, k)
                return code
        motion.aiming = enable == 1
        writer = self.writer
        writer.begin(m.MSG_VIRT_AIM_POINT, reader)
        writer.u8(enable)
        for i in range(3):
            reader.copy_i32_to(1 + 4 * i, self.point, i)
            writer.put_i32s_from(self.point, i, 1)
        writer.end()
        return 0

    def leads(self, motor):
        """Whether pan and tilt have to follow where this motor (from 0) goes, because an aim point is on."""
        motion = self.motion
        if motion.aiming:
            for i in range(_CARRIERS):
                if motion.motor[i] == motor + 1:
                    return True
        return False

    def drive(self, motor, target, i, speed=0):
        """Send such a motor to the step target[i], pan and tilt following; speed: that of a jog. A code."""
        motion = self.motion
        axis = 0
        while motion.motor[axis] != motor + 1:
            axis += 1
        code = self._may()
        if code != m.OK:
            return code
        kind = -1 - axis
        if motion.state:
            if not speed:
                return m.ERR_MOVING
            if not self.later and self._under_way(kind, motion.side(axis, target, i), speed):
                self.jog_at = self.now
                return m.OK
            reals.copy_word(self.word, 0, target, i)
            return self._next(kind, 0, speed)
        return self._set_drive(axis, target, i, speed)

    def _set_drive(self, axis, target, i, speed):
        """Send the motor of this axis to the step target[i], or jog it there. A code."""
        motion = self.motion
        code = motion.lay(True)
        if code:
            return code
        way = motion.bound(axis, target, i)
        if not way:
            return m.OK
        r = self.r
        reals.put(r, v.WAY + 2 * axis, 1, 0)
        motion.rig.joint(axis, target, i)
        reals.subtract(r, v.END, g.JOINT + 2 * axis, v.BASE + 2 * axis)
        if reals.sign(r, v.END) < 0:
            reals.negate(r, v.END, v.END)
            reals.put(r, v.WAY + 2 * axis, -1, 0)
        if speed:
            code = self._follow(-1 - axis, way, speed, 0)
            if code == m.OK and motion.state:
                self.jog_at = self.now
            return code
        code = motion.survey()
        if code:
            return code
        self._begin(0)
        self.jogging = 0
        return m.OK

    def _stop(self):
        """MSG_VIRT_STOP: virtual axis 0 (field notes 9.1 and 9.6)."""
        if not self.configured:
            return m.ERR_GENERAL
        number = self._number()
        if not number:
            return m.ERR_RANGE
        later = self.later
        if later > g.AXES:
            later = _LINE_AXES[later - g.AXES - 1]
        if later == number:
            self.later = 0
        if self.moved >> number & 1:
            self._leave()
            self.motion.stop()
        return m.OK
