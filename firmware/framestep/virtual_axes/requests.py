"""The virtual axes of a rig and their requests, VIRT_* of the specification: whether they may move,
how they start, what stops them.

Their handlers are added to the link's. A handler returns the code to acknowledge with,
or 0 if it has answered itself. Nothing allocates after construction.
"""

from array import array

from framestep.base.native import const
from framestep.motion import reals
from framestep.protocol import messages as m
from framestep.virtual_axes.jogs import Jogs
from framestep.virtual_axes.kinematics.kinematics import Configuration
from framestep.virtual_axes.line import Line
from framestep.virtual_axes.move import LinearMove
from framestep.virtual_axes.registers import (
    AIM_X,
    AXES,
    BASE,
    DIRECTION,
    END,
    GOAL,
    HOME,
    JOINT,
    REGISTERS,
)
from framestep.virtual_axes.survey import Survey

_TYPES = const(5)  # including 0 for none
_LEAST_BYTES = b"\x01\x5d\x11\x5d\x55"  # of a VIRT_CONFIG, by type
_AXES_AT = const(m.VirtConfig.SIZE)
_AXIS_BYTES = const(m.VirtualAxis.SIZE)
_SWING_PAN_BYTES = const(m.VirtualAxis.position)  # all of an axis but its position
_TABLE_AT = const(93)  # of boom-swing-track, if the payload has it
_TABLE_BYTES = const(4 * m.BOOM_TABLE_SIZE)

_POSE_OF_AIM = b"\x01\x02\x00"  # indexes in a pose of X, Y, Z of an aim point
_FASTEST = const(10000)  # greatest speed of a jog, ten-thousandths
_CARRIERS = const(3)  # axes that carry pan and tilt
_PAN = const(3)  # axes of the types that have positions
_TILT = const(4)


def _geometries(mask, r):
    """Return the types in a mask of capabilities, in a list by number."""
    found = [None] * _TYPES  # type: list
    rig = None  # type: object
    if mask & m.CAP_BOOM_SWING_TRACK:
        from framestep.virtual_axes.kinematics import boom_swing_track

        rig = found[m.VIRT_BOOM_SWING_TRACK] = boom_swing_track.Geometry(r)
    if mask & m.CAP_SWING_PAN:
        from framestep.virtual_axes.kinematics import swing_pan

        rig = found[m.VIRT_SWING_PAN] = swing_pan.Geometry(r, rig)
    if mask & m.CAP_Y_SWING_TRACK:
        from framestep.virtual_axes.kinematics import y_swing_track

        rig = found[m.VIRT_Y_SWING_TRACK] = y_swing_track.Geometry(r, rig)
    if mask & m.CAP_X_Y_Z:
        from framestep.virtual_axes.kinematics import x_y_z

        found[m.VIRT_X_Y_Z] = x_y_z.Geometry(r, rig)
    return found


def read_configuration(reader, kind, motors, configuration):
    """Read a VIRT_CONFIG of a type into a Configuration. motors: how many there are.

    Return False for a payload that is too short, or an impossible axis: no such motor, a motor that
    another axis has, 0 steps per unit. spec: MSG_VIRT_CONFIG, field notes 9.2 and 9.3.
    """
    if reader.length < _LEAST_BYTES[kind]:
        return False
    axes, size, least = AXES, _AXIS_BYTES, 0
    if kind == m.VIRT_SWING_PAN:
        axes, size, least = 2, _SWING_PAN_BYTES, 1
    for i in range(AXES):
        configuration.motors[i] = 0
        configuration.steps_per_unit[i] = 0
        configuration.positions[i] = 0
        configuration.lengths[i] = 0
    at = _AXES_AT
    for i in range(axes):
        motor = reader.i32(at + m.VirtualAxis.motor)
        if motor < least or motor > motors:
            return False
        if motor:
            if reader.i32(at + m.VirtualAxis.steps_per_unit_milli) == 0:
                return False
            for k in range(i):
                if configuration.motors[k] == motor:
                    return False
        configuration.motors[i] = motor
        reader.copy_i32_to(at + m.VirtualAxis.steps_per_unit_milli, configuration.steps_per_unit, i)
        if size == _AXIS_BYTES:
            reader.copy_i32_to(at + m.VirtualAxis.position, configuration.positions, i)
        at += size
    configuration.table_at = -1
    if kind == m.VIRT_SWING_PAN:
        return True
    for i in range(2 if kind == m.VIRT_X_Y_Z else 0, 5):
        reader.copy_i32_to(at, configuration.lengths, i)
        at += 4
    if kind == m.VIRT_BOOM_SWING_TRACK and reader.length >= _TABLE_AT + _TABLE_BYTES:
        configuration.table = reader.buffer
        configuration.table_at = reader.payload + _TABLE_AT
        at += _TABLE_BYTES
    if reader.length >= at + 4:
        reader.copy_i32_to(at, configuration.lengths, 5)  # what follows is ignored (field note 1.8)
    return True


class VirtualAxes:
    """The line along which the camera moves, the move or jog along it, and handlers of requests.

    operations: of uploaded moves. interlock: an Interlock.
    """

    def __init__(self, rig, link, axes, safety, operations, interlock, reports):
        self.reader = link.reader
        self.writer = link.writer
        self.reports = reports
        self.rig = rig
        self.operations = operations
        self.axes = axes
        self.interlock = interlock
        self.r = array("i", [0] * REGISTERS)
        self.line = Line(axes, safety, self.r)
        self.survey = Survey(self.line)
        self.move = LinearMove(self.line, self.survey)
        self.jogs = Jogs(self)
        self.moved = 0  # the virtual axis of a motion, or 0
        self.capabilities = rig.virtuals
        self.types = _geometries(self.capabilities, self.r)
        self.configuration = Configuration()
        self.word = array("i", [0] * 2)
        self.point = array("i", [0] * 3)  # the aim point, units · 1000
        self.old = array("i", [0] * 6)  # the previous point, in case a new one is refused
        link.handlers.update(
            {
                m.MSG_VIRT_CONFIG: self._configure,
                m.MSG_VIRT_MOVE: self._move,
                m.MSG_VIRT_STOP: self._stop,
                m.MSG_VIRT_JOG: self._jog,
                m.MSG_VIRT_JOG_ON_LINE: self._jog_on_line,
                m.MSG_VIRT_GET_POSITION: self._get_position,
            }
        )
        if self.capabilities & m.CAP_AIM_POINT:
            link.handlers[m.MSG_VIRT_AIM_POINT] = self._aim_point

    @property
    def configured(self):
        """Whether a VIRT_CONFIG has defined the rig."""
        return self.line.rig is not None

    @property
    def owned(self):
        """Bits of the motors in a virtual motion, from its acknowledgement to its end."""
        return self.move.owned

    def poll(self, now):
        """Do one pass of the main loop. now: ms, as in clock.py. Return whether there may be more
        to plan at once."""
        return self.jogs.poll(now, self.rig.jog_timeout_ms)

    def stop(self):
        """Slow down along the line. Nothing follows."""
        self.jogs.stop()
        self.move.stop(True)

    def halt(self, factor=1):
        """Let each motor ramp down by itself, with `factor` times its acceleration."""
        self.jogs.stop()
        self.move.halt(factor)

    def changed(self, motor):
        """Adapt to a new speed or new soft limits of a motor (from 0): with less room a motion
        ends."""
        if (self.owned >> motor) & 1:
            if self.line.limits_narrowed(motor):
                self.stop()
            self.move.slow_down()

    # ---------------------------------------------------------------- setting out

    def may_move(self):
        """Return OK, or why the rig may not move now."""
        line = self.line
        if not self.configured:
            return m.ERR_GENERAL
        code = self.interlock.may_move_all()
        if code != m.OK:
            return code
        if self.operations.owned & line.bits:
            return m.ERR_MOVING
        if not self.interlock.all_enabled(line.bits):
            return m.ERR_GENERAL
        if not self.move.state and self.axes.moving_bits() & line.bits:
            return m.ERR_MOVING
        return m.OK

    def set_out(self, number, ahead=None):
        """Set out along the line begun. number: its virtual axis or 0; ahead: of a jog."""
        self.moved = number
        self.interlock.prepare(self.line.bits)
        self.move.begin(ahead)

    def head_for(self, to, number):
        """Set END and DIRECTION of the line so that its number `number` goes from BASE to r[to].

        Return the direction, -1 or 1, or 0 if it is there.
        """
        r = self.r
        reals.subtract(r, END, to, BASE + 2 * number)
        direction = reals.sign(r, END)
        if direction < 0:
            reals.negate(r, END, END)
        reals.put(r, DIRECTION + 2 * number, direction or 1, 0)
        return direction

    def set_out_to_end(self, number):
        """Set out on a move to END of the line begun. Return a code."""
        code = self.survey.check_line()
        if code:
            return code
        self.jogs.none()
        self.set_out(number)
        return m.OK

    # ---------------------------------------------------------------- motors with an aim point

    def holds(self, motor):
        """Return whether this motor (from 0) is one of the rig that VIRT_CONFIG has defined."""
        if self.configured:
            for i in range(AXES):
                if self.line.motor[i] == motor + 1:
                    return True
        return False

    def moves_camera(self, motor):
        """Return whether pan and tilt have to follow this motor (from 0) to stay aimed."""
        if self.line.aiming:
            for i in range(_CARRIERS):
                if self.line.motor[i] == motor + 1:
                    return True
        return False

    def move_keeping_aim(self, motor, target, i, speed=0):
        """Move such a motor to the step target[i], with pan and tilt following. Return a code.

        speed: of a jog, in ten-thousandths; 0 for a move.
        """
        line = self.line
        axis = 0
        while line.motor[axis] != motor + 1:
            axis += 1
        code = self.may_move()
        if code != m.OK:
            return code
        if self.move.state:
            return self.jogs.jog_motor(axis, target, i, speed) if speed else m.ERR_MOVING
        return self.begin_keeping_aim(axis, target, i, speed)

    def begin_keeping_aim(self, axis, target, i, speed):
        """Move the motor of this axis to the step target[i], or jog it there. Return a code."""
        line = self.line
        code = line.begin_line(True)
        if code:
            return code
        direction = line.clip_end(axis, target, i)
        if not direction:
            return m.OK
        line.rig.joint(axis, target, i)
        self.head_for(JOINT + 2 * axis, axis)
        if speed:
            return self.jogs.begin_motor(axis, direction, speed)
        return self.set_out_to_end(0)

    # ---------------------------------------------------------------- position of the rig

    def locate(self):
        """Set POSE to the reported positions of the motors, without disturbing a plan."""
        line = self.line
        rig = line.rig
        for i in range(AXES):
            motor = line.motor[i]
            if motor:
                rig.joint(i, self.axes.reported, motor - 1)
            else:
                reals.copy(self.r, JOINT + 2 * i, HOME + 2 * i)
            self.axes.hal.port.look_for_stop()
        rig.forward()

    # ---------------------------------------------------------------- configuration

    def _configure(self):
        """MSG_VIRT_CONFIG: read_configuration() reads it (field notes 9.2 and 9.3)."""
        reader = self.reader
        line = self.line
        kind = reader.u8(m.VirtConfig.type)
        if kind >= _TYPES:
            return m.ERR_RANGE
        busy = self.axes.moving_bits() | self.operations.owned | self.owned
        if busy & line.bits:
            return m.ERR_MOVING
        if kind == m.VIRT_NONE:
            line.adopt(None)
            return m.OK
        rig = self.types[kind]
        if rig is None:
            return m.ERR_UNSUPPORTED
        configuration = self.configuration
        if not read_configuration(reader, kind, self.axes.count, configuration):
            return m.ERR_RANGE
        bits = 0
        for motor in configuration.motors:
            if motor:
                bits |= 1 << (motor - 1)
        if bits & busy:
            return m.ERR_MOVING
        if not self.interlock.all_enabled(bits):
            return m.ERR_RANGE
        for motor in range(self.axes.count):
            self.axes[motor].position_to(line.present, motor)
        code = rig.configure(configuration, line.present)
        if code:
            return code
        line.adopt(rig)
        self.reports.report_positions()
        return m.OK

    # ---------------------------------------------------------------- positions

    def send_positions(self, reader):
        """Send VIRT_GET_POSITION, as the answer to the request in `reader`, or unasked if None.
        Return whether there was room.

        Unasked it has the moment of the last report of the motors' positions (field note 4.6).
        """
        writer = self.writer
        port = self.axes.hal.port
        if reader:
            self.axes.choose_sample()
        self.locate()
        if not reader:
            port.glance()
        writer.begin(m.MSG_VIRT_GET_POSITION, reader)
        for i in range(AXES):
            self.line.rig.to_host(self.word, 0, i)
            port.look_for_stop()
            writer.put_i32s_from(self.word, 0, 1)
        if self.capabilities & m.CAP_AIM_POINT:
            writer.u8(1 if self.line.aiming else 0)
            for i in range(3):
                writer.put_i32s_from(self.point, i, 1)
        return writer.end()

    def _get_position(self):
        """MSG_VIRT_GET_POSITION: answer with the pose (field notes 9.2 and 9.8)."""
        if not self.configured:
            return m.ERR_GENERAL
        self.send_positions(self.reader)
        return 0

    # ---------------------------------------------------------------- moves

    def _number(self):
        """Return the virtual axis of this request, or 0 if the rig has no such axis."""
        number = self.reader.u8(m.VirtMove.motor)  # the first field of all these requests
        if number < 1 or number > AXES or not self.line.rig.main[number]:
            return 0
        return number

    def _move(self):
        """MSG_VIRT_MOVE, in units · 100000 (field notes 9.1 and 9.5)."""
        code = self.may_move()
        if code != m.OK:
            return code
        number = self._number()
        if not number:
            return m.ERR_RANGE
        if self.move.state:
            return m.ERR_MOVING
        line = self.line
        code = line.begin_line()
        if code:
            return code
        self.reader.copy_i32_to(m.VirtMove.position, self.word, 0)
        line.rig.from_host(GOAL, number - 1, self.word, 0)
        if not self.head_for(GOAL, number - 1):
            return m.OK
        return self.set_out_to_end(number)

    def _stop(self):
        """MSG_VIRT_STOP (field notes 9.1 and 9.6)."""
        if not self.configured:
            return m.ERR_GENERAL
        number = self._number()
        if not number:
            return m.ERR_RANGE
        self.jogs.stop_axis(number)
        if self.moved == number:
            self.jogs.forget()
            self.move.stop(self.move.closed)  # at the end or again: at once
        return m.OK

    # ---------------------------------------------------------------- jogs

    def _jog(self):
        """MSG_VIRT_JOG: the destination is a step of the axis' main motor (field note 9.6)."""
        reader = self.reader
        code = self.may_move()
        if code != m.OK:
            return code
        number = self._number()
        speed = reader.u16(m.VirtJog.speed)
        if not number or speed < 1 or speed > _FASTEST:
            return m.ERR_RANGE
        reader.copy_i32_to(m.VirtJog.destination, self.word, 0)
        return self.jogs.jog_axis(number, speed, self.word)

    def _jog_on_line(self):
        """MSG_VIRT_JOG_ON_LINE, at a speed with a sign.

        It goes on until VIRT_STOP of the axis, or a limit (field note 9.6).
        """
        reader = self.reader
        code = self.may_move()
        if code != m.OK:
            return code
        axis = reader.u8(m.VirtJogOnLine.axis)
        speed = reader.i16(m.VirtJogOnLine.speed)
        if axis > m.LINE_TILT or not speed or speed < -_FASTEST or speed > _FASTEST:
            return m.ERR_RANGE
        direction = 1 if speed > 0 else -1
        return self.jogs.jog_camera(axis, direction, speed * direction)

    # ---------------------------------------------------------------- the aim point

    def _aim_point(self):
        """MSG_VIRT_AIM_POINT, in units · 1000.

        The answer repeats the request (field note 9.7).
        """
        if not self.configured:
            return m.ERR_GENERAL
        reader = self.reader
        line = self.line
        enable = reader.u8(m.SetVirtAimPoint.enable)
        if enable > 1:
            return m.ERR_RANGE
        if self.move.state:
            return m.ERR_MOVING
        if enable:
            if (
                not line.rig.main[m.VIRT_MOTOR_TRACK]
                or not line.motor[_PAN]
                or not line.motor[_TILT]
            ):
                return m.ERR_RANGE  # nothing to follow with
            if self.axes.moving_bits() & line.bits:
                return m.ERR_MOVING
            code = self._take_point()
            if code:
                return code
        line.aiming = enable == 1
        writer = self.writer
        writer.begin(m.MSG_VIRT_AIM_POINT, reader)
        writer.u8(enable)
        for i in range(3):
            reader.copy_i32_to(m.SetVirtAimPoint.x + 4 * i, self.point, i)
            writer.put_i32s_from(self.point, i, 1)
        writer.end()
        return 0

    def _take_point(self):
        """Take the aim point of the request. Return a code; on error the previous one stays."""
        r = self.r
        rig = self.line.rig
        for i in range(3):
            at = AIM_X + 2 * i
            reals.fetch(self.old, 2 * i, r, at)
            self.reader.copy_i32_to(m.SetVirtAimPoint.x + 4 * i, self.word, 0)
            rig.host_offset(GOAL, _POSE_OF_AIM[i])
            rig.load(at, self.word, 0)
            reals.subtract(r, at, at, GOAL)
        code = self.line.take_aim()
        if code:
            for k in range(0, 6, 2):
                reals.fetch(r, AIM_X + k, self.old, k)
        return code
