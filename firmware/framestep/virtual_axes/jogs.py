"""Jogs: of virtual axes, along the camera's own axes, of a motor that carries an aimed camera.

A request for the present jog keeps it going. A request for another one first brings the present jog
to rest (field note 4.2). Nothing allocates after construction.
"""

from array import array

from framestep.base import results
from framestep.base.clock import elapsed
from framestep.base.native import const
from framestep.motion import reals
from framestep.virtual_axes.kinematics.kinematics import CAMERA_AXES, camera_axis
from framestep.virtual_axes.line import ROW, SURVEY
from framestep.virtual_axes.lookahead import LookAhead
from framestep.virtual_axes.registers import BASE, CAMERA_AXIS, DIRECTION, SAMPLE, SPARE, V_PAN

# Kinds
NONE = const(0)
AXIS = const(1)  # a virtual axis, from 1, toward a step of its main motor
CAMERA = const(2)  # an axis of the camera, from 0
MOTOR = const(3)  # an axis of the rig, from 0; pan and tilt keep the camera aimed

_LINE_AXES = b"\x02\x03\x01\x04\x05"  # the virtual axis whose VIRT_STOP ends it (field note 9.6)


class Jog:
    """A requested jog."""

    def __init__(self):
        self.kind = NONE
        self.number = 0
        self.direction = 0  # -1 or 1
        self.speed = 0  # ten-thousandths of the motors' limits; 0 once it is to end
        self.asked = -1  # time of the last request, ms; -1 if it goes on without further requests
        self.end = array("i", [0])  # a step of its motor

    def axis(self):
        """Return the virtual axis that it moves, or 0."""
        if self.kind == AXIS:
            return self.number
        return _LINE_AXES[self.number] if self.kind == CAMERA else 0


class Jogs:
    """The present jog and the next one. virtuals: for the line, and what jogs share with moves."""

    def __init__(self, virtuals):
        self.virtuals = virtuals
        self.line = virtuals.line
        self.move = virtuals.move
        self.ahead = LookAhead(self.line, virtuals.survey)
        self.r = self.line.r
        self.jog = Jog()  # the present one; its kind is NONE during a move
        self.next = Jog()
        self.now = 0

    def poll(self, now, limit):
        """Do one pass of the main loop. now: ms. limit: ms after which a jog that is not requested
        again ends, or 0.

        Return whether there may be more to plan at once.
        """
        self.now = now
        if not self.move.state:
            return False
        asked = self.jog.asked
        if asked >= 0 and limit and elapsed(now, asked) >= limit:
            self.forget()
            self.move.stop()
        planned = self.move.poll()
        if self.next.kind and not self.move.state:
            self._begin_next(limit)
        return planned

    def forget(self):
        """End the present jog; an identical request starts a new one."""
        self.jog.asked = -1
        self.jog.speed = 0

    def none(self):
        """Note that the motion that starts now is no jog."""
        self.jog.kind = NONE
        self.jog.asked = -1

    def stop(self):
        """Let nothing follow; the caller stops the move."""
        self.forget()
        self.next.kind = NONE

    def stop_axis(self, number):
        """On a VIRT_STOP of a virtual axis, drop the next jog if it is of that axis."""
        if self.next.axis() == number:
            self.next.kind = NONE

    # ---------------------------------------------------------------- the present jog

    def _repeats(self, kind, number, direction, speed):
        """Return whether this is the present jog. If so, note the repeated request."""
        jog = self.jog
        if self.next.kind or jog.kind != kind or jog.number != number:
            return False
        if jog.direction != direction or jog.speed != speed:
            return False
        if jog.asked >= 0:
            jog.asked = self.now
        return True

    def _follow(self, kind, number, direction, speed):
        """Set out on a jog along the line that has been begun. Return a code.

        If a soft limit or the rig's reach leaves no room, nothing moves, as in a motor's jog.
        """
        code = self.ahead.begin(speed)
        if code == results.ERR_SOFT_LOW or code == results.ERR_SOFT_UP:
            return results.OK
        if code:
            return code
        jog = self.jog
        jog.kind = kind
        jog.number = number
        jog.direction = direction
        jog.speed = speed
        jog.asked = -1 if kind == CAMERA else self.now
        self.virtuals.set_out(jog.axis(), self.ahead)
        return results.OK

    # ---------------------------------------------------------------- the next jog

    def _ask_next(self, kind, number, direction, speed, target, i):
        """Keep a request for another jog until the present one has come to rest. Return a code.

        target[i]: the step to which it goes, if it goes to one.
        """
        if not self.jog.kind:
            return results.ERR_MOVING
        self.forget()
        self.move.stop()
        jog = self.next
        jog.kind = kind
        jog.number = number
        jog.direction = direction
        jog.speed = speed
        jog.asked = self.now
        reals.copy_word(jog.end, 0, target, i)
        return results.OK

    def _begin_next(self, limit):
        """Set out on the next jog, unless the request is too old."""
        jog = self.next
        kind = jog.kind
        jog.kind = NONE
        if self.virtuals.may_move() != results.OK:
            return
        if kind == CAMERA:
            self._begin_camera(jog.number, jog.direction, jog.speed)
        elif not limit or elapsed(self.now, jog.asked) < limit:
            if kind == AXIS:
                self._begin_axis(jog.number, jog.speed, jog.end)
            elif self.line.aiming:
                self.virtuals.begin_keeping_aim(jog.number, jog.end, 0, jog.speed)

    # ---------------------------------------------------------------- virtual axes

    def jog_axis(self, number, speed, target):
        """Jog a virtual axis toward the step target[0] of its main motor. Return a code."""
        main = self.line.rig.main[number] - 1
        if not self.line.motor[main]:
            return results.ERR_RANGE
        if not self.move.state:
            return self._begin_axis(number, speed, target)
        # on which side of the line's start the destination lies shows the direction
        if self._repeats(AXIS, number, self.line.side(main, target, 0), speed):
            return results.OK
        return self._ask_next(AXIS, number, 0, speed, target, 0)

    def _begin_axis(self, number, speed, target):
        line = self.line
        main = line.rig.main[number] - 1
        code = line.begin_line()
        if code:
            return code
        direction = line.clip_end(main, target, 0)
        if not direction:
            return results.OK
        reals.put(self.r, DIRECTION + 2 * (number - 1), self._sense(main, number) * direction, 0)
        return self._follow(AXIS, number, direction, speed)

    def _sense(self, main, number):
        """Return 1 or -1: whether the motor of axis `main` goes up or down while the virtual axis
        goes up."""
        r = self.r
        for direction in range(1, -2, -2):
            reals.put(r, DIRECTION + 2 * (number - 1), direction, 0)
            reals.put(r, SAMPLE, 1, -6)
            if not self.line.positions_at(SAMPLE, SURVEY + ROW):
                return direction * self.line.direction(main, SURVEY, SURVEY + ROW)
        return 1

    # ---------------------------------------------------------------- the camera's axes

    def jog_camera(self, axis, direction, speed):
        """Jog the camera along one of its axes (protocol: LINE_), or pan or tilt it. Return a
        code."""
        if not self.line.rig.main[_LINE_AXES[axis]]:
            return results.ERR_RANGE
        if not self.move.state:
            return self._begin_camera(axis, direction, speed)
        if self._repeats(CAMERA, axis, direction, speed):
            return results.OK
        return self._ask_next(CAMERA, axis, direction, speed, self.next.end, 0)

    def _begin_camera(self, axis, direction, speed):
        line = self.line
        code = line.begin_line()
        if code:
            return code
        r = self.r
        if axis < CAMERA_AXES:  # otherwise pan or tilt
            # the angles as the host counts them
            for k in range(0, 6, 2):
                line.rig.host_offset(SPARE, (V_PAN + k) >> 1)
                reals.add(r, V_PAN + k, BASE + V_PAN + k, SPARE)
            camera_axis(r, axis, CAMERA_AXIS)
            for k in range(0, 6, 2):
                if direction < 0:
                    reals.negate(r, DIRECTION + k, CAMERA_AXIS + k)
                else:
                    reals.copy(r, DIRECTION + k, CAMERA_AXIS + k)
        else:
            reals.put(r, DIRECTION + 2 * (_LINE_AXES[axis] - 1), direction, 0)
        return self._follow(CAMERA, axis, direction, speed)

    # ---------------------------------------------------------------- motors with an aim point

    def jog_motor(self, axis, target, i, speed):
        """Jog such a motor toward the step target[i] while something moves. Return a code."""
        if self._repeats(MOTOR, axis, self.line.side(axis, target, i), speed):
            return results.OK
        return self._ask_next(MOTOR, axis, 0, speed, target, i)

    def begin_motor(self, axis, direction, speed):
        """Set out on a jog of such a motor along the line that has been begun. Return a code."""
        return self._follow(MOTOR, axis, direction, speed)
