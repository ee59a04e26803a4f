"""The virtual axes of a rig: whether they may move, how they start, what stops them.

requests.py adds the messages. Nothing allocates after construction.
"""

from array import array

from framestep.base.native import const, micropython
from framestep.base.results import ERR_GENERAL, ERR_MOVING, OK
from framestep.motion import reals
from framestep.virtual_axes.jogs import Jogs
from framestep.virtual_axes.line import Line
from framestep.virtual_axes.move import LinearMove
from framestep.virtual_axes.registers import AXES, BASE, DIRECTION, END, HOME, JOINT, REGISTERS
from framestep.virtual_axes.survey import Survey

_CARRIERS = const(3)  # axes that carry pan and tilt


class VirtualAxes:
    """The line along which the camera moves, and the move or jog along it.

    operations: of uploaded moves. gate: a Gate.
    """

    def __init__(self, rig, axes, safety, operations, gate):
        self.rig = rig
        self.operations = operations
        self.axes = axes
        self.gate = gate
        self.r = array("i", [0] * REGISTERS)
        self.line = Line(axes, safety, self.r)
        self.survey = Survey(self.line)
        self.move = LinearMove(self.line, self.survey)
        self.jogs = Jogs(self)
        self.moved = 0  # the virtual axis of a motion, or 0

    @property
    def configured(self):
        """Whether a VIRT_CONFIG has defined the rig."""
        return self.line.rig is not None

    @property
    @micropython.viper
    def engaged(self) -> int:
        """Bits of the motors in a virtual motion, from its acknowledgement to its end."""
        return int(self.move.engaged)

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
        if (self.engaged >> motor) & 1:
            if self.line.limits_narrowed(motor):
                self.stop()
            self.move.slow_down()

    # ---------------------------------------------------------------- setting out

    def may_move(self):
        """Return OK, or why the rig may not move now."""
        line = self.line
        if not self.configured:
            return ERR_GENERAL
        code = self.gate.may_move_all()
        if code != OK:
            return code
        if self.operations.engaged & line.bits:
            return ERR_MOVING
        if not self.gate.all_enabled(line.bits):
            return ERR_GENERAL
        if not self.move.state and self.axes.moving_bits() & line.bits:
            return ERR_MOVING
        return OK

    def set_out(self, number, ahead=None):
        """Set out along the line begun. number: its virtual axis or 0; ahead: of a jog."""
        self.moved = number
        self.gate.send(self.line.bits)
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
        return OK

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
        if code != OK:
            return code
        if self.move.state:
            return self.jogs.jog_motor(axis, target, i, speed) if speed else ERR_MOVING
        return self.begin_keeping_aim(axis, target, i, speed)

    def begin_keeping_aim(self, axis, target, i, speed):
        """Move the motor of this axis to the step target[i], or jog it there. Return a code."""
        line = self.line
        code = line.begin_line(True)
        if code:
            return code
        direction = line.clip_end(axis, target, i)
        if not direction:
            return OK
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
        rig.forward()
