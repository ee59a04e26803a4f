"""Requests about virtual axes: VIRT_* of the specification.

The controller merges `handlers` into its own table. A handler returns the code to acknowledge with,
or 0 if it has answered itself. Nothing allocates after construction.
"""

from array import array

from framestep.base.native import const
from framestep.motion import reals
from framestep.protocol import messages as m
from framestep.virtual_axes.kinematics.kinematics import Configuration
from framestep.virtual_axes.registers import AIM_X, AXES, GOAL
from framestep.virtual_axes.virtual_axes import VirtualAxes

_TYPES = const(5)  # including 0 for none
_LEAST_BYTES = b"\x01\x5d\x11\x5d\x55"  # of a VIRT_CONFIG, by type
_AXES_AT = const(m.VirtConfig.SIZE)
_AXIS_BYTES = const(m.VirtualAxis.SIZE)
_SWING_PAN_BYTES = const(m.VirtualAxis.position)  # all of an axis but its position
_TABLE_AT = const(93)  # of boom-swing-track, if the payload has it
_TABLE_BYTES = const(4 * m.BOOM_TABLE_SIZE)

_POSE_OF_AIM = b"\x01\x02\x00"  # indexes in a pose of X, Y, Z of an aim point
_FASTEST = const(10000)  # greatest speed of a jog, ten-thousandths
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


class Virtuals(VirtualAxes):
    """The virtual axes (VirtualAxes) with their messages."""

    def __init__(self, rig, reader, writer, axes, safety, operations, gate, reports):
        VirtualAxes.__init__(self, rig, axes, safety, operations, gate)
        self.reader = reader
        self.writer = writer
        self.reports = reports
        self.capabilities = rig.virtuals
        self.types = _geometries(self.capabilities, self.r)
        self.configuration = Configuration()
        self.word = array("i", [0] * 2)
        self.point = array("i", [0] * 3)  # the aim point, units · 1000
        self.old = array("i", [0] * 6)  # the previous point, in case a new one is refused
        self.handlers = {
            m.MSG_VIRT_CONFIG: self._configure,
            m.MSG_VIRT_MOVE: self._move,
            m.MSG_VIRT_STOP: self._stop,
            m.MSG_VIRT_JOG: self._jog,
            m.MSG_VIRT_JOG_ON_LINE: self._jog_on_line,
            m.MSG_VIRT_GET_POSITION: self._get_position,
        }
        if self.capabilities & m.CAP_AIM_POINT:
            self.handlers[m.MSG_VIRT_AIM_POINT] = self._aim_point

    # ---------------------------------------------------------------- configuration

    def _configure(self):
        """MSG_VIRT_CONFIG: read_configuration() reads it (field notes 9.2 and 9.3)."""
        reader = self.reader
        line = self.line
        kind = reader.u8(m.VirtConfig.type)
        if kind >= _TYPES:
            return m.ERR_RANGE
        busy = self.axes.moving_bits() | self.operations.engaged | self.engaged
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
        if not self.gate.all_enabled(bits):
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
        if reader:
            self.axes.choose_sample()
        self.locate()
        writer.begin(m.MSG_VIRT_GET_POSITION, reader)
        for i in range(AXES):
            self.line.rig.to_host(self.word, 0, i)
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
