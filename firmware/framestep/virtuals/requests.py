"""Requests about virtual axes: VIRT_* of the specification.

The controller merges `handlers` into its own table; a handler returns the code to acknowledge with, or 0 where it has
answered itself. Nothing allocates after construction.
"""

from array import array

from framestep.motion import reals
from framestep.native import const, micropython, ptr32
from framestep.protocol import messages as m
from framestep.virtuals import geometry as g
from framestep.virtuals import motion as v

_TYPES = const(5)  # and 0 is none

# Registers
_SCALE = const(v.FIRST_FREE)
_X = const(v.FIRST_FREE + 2)
_REGISTERS = const(v.FIRST_FREE + 4)


@micropython.viper
def _to_word(out: ptr32, i: int, r: ptr32, a: int):
    """out[i] = the whole number nearest to r[a], or the end of the range that is nearer."""
    x = r[a + 0]
    s = 0 - r[a + 1]
    if s > 30:
        x = 0
    elif s > 0:
        x = (x + (1 << (s - 1))) >> s
    elif s == 0:
        pass
    elif s == -1:
        x = x << 1
    elif x < 0:
        x = -0x40000000
        x = x + x
    else:
        x = 0x3FFFFFFF
        x = x + x + 1
    out[i] = x


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
        self.stage = controller.stage
        axes = controller.axes
        self.axes = axes
        self.capabilities = controller.rig.virtuals
        self.r = array("i", [0] * _REGISTERS)
        self.types = _geometries(self.capabilities, self.r)
        self.motion = v.Motion(axes, controller.safety, self.r)
        self.word = array("i", [0])
        self.moved = 0  # bits of the virtual axes that a motion is about
        self.handlers = {
            m.MSG_VIRT_CONFIG: self._config,
            m.MSG_VIRT_MOVE: self._move,
            m.MSG_VIRT_STOP: self._stop,
            m.MSG_VIRT_GET_POSITION: self._get_position,
        }

    # ---------------------------------------------------------------- what the controller asks

    @property
    def configured(self):
        return self.motion.rig is not None

    @property
    def engaged(self):
        """Bits of the motors in a virtual motion, from its acknowledgement to its end."""
        return self.motion.engaged

    def poll(self, now):
        """One pass."""
        self.motion.poll()

    def stop(self):
        """Slow down along the line."""
        self.motion.stop()

    def halt(self, factor=1):
        """Let each motor ramp down by itself, `factor` times as steeply as it is set to."""
        self.motion.halt(factor)

    # ---------------------------------------------------------------- configuration

    def _config(self):
        """spec: MSG_VIRT_CONFIG. type 0, then what the type's module says."""
        reader = self.reader
        kind = reader.u8(0)
        if kind >= _TYPES:
            return m.ERR_RANGE
        busy = self.axes.moving_bits() | self.stage.engaged | self.engaged
        if busy & self.motion.bits:
            return m.ERR_MOVING
        if kind == m.VIRT_NONE:
            if reader.length != 1:
                return m.ERR_RANGE
            self.motion.adopt(None)
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
        self.controller.say_position = True
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
            if bits >> motor & 1:
                if not self.controller.flags[motor] & m.MOTOR_ENABLED or self.axes[motor].leader:
                    return False
        return True

    # ---------------------------------------------------------------- positions

    def locate(self):
        """POSE of where the motors are now; a plan under way is not disturbed."""
        motion = self.motion
        rig = motion.rig
        for i in range(g.AXES):
            motor = motion.motor[i]
            if motor:
                self.axes[motor - 1].position_to(self.word, 0)
                rig.joint(i, self.word, 0)
            else:
                reals.copy(self.r, g.JOINT + 2 * i, g.HOME + 2 * i)
        rig.forward()

    def send_positions(self, reader):
        """VIRT_GET_POSITION, asked for or not. Whether there was room."""
        r = self.r
        writer = self.writer
        self.locate()
        writer.begin(m.MSG_VIRT_GET_POSITION, reader)
        reals.put(r, _SCALE, 100000, 0)
        for i in range(g.AXES):
            reals.multiply(r, _X, g.POSE + 2 * i, _SCALE)
            _to_word(self.word, 0, r, _X)
            writer.word_from(self.word, 0)
        return writer.end()

    def _get_position(self):
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
        code = self.controller.may_move_all()
        if code != m.OK:
            return code
        if self.stage.engaged & motion.bits:
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
        self.moved = bits
        self.controller.moving_all(self.motion.bits)
        self.motion.begin()

    def _move(self):
        """spec: MSG_VIRT_MOVE. virtual axis 0, position 1."""
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
        motion.rig.number(self.reader, 1, _X, 100000)
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
        return m.OK

    def _stop(self):
        """spec: MSG_VIRT_STOP. virtual axis 0."""
        if not self.configured:
            return m.ERR_GENERAL
        number = self._number()
        if not number:
            return m.ERR_RANGE
        if self.moved >> number & 1:
            self.motion.stop()
        return m.OK
