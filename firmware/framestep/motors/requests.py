"""Requests about single motors: moves, jogs, stops, positions, settings.

Their handlers are added to the link's. A handler returns the code to acknowledge with,
or 0 if it has answered itself. Nothing allocates after construction.
"""

from array import array

from framestep.base.clock import elapsed
from framestep.base.native import const
from framestep.base.results import FRAME, MOTOR, ROOM, WHAT
from framestep.motors import bounds
from framestep.motors.axis import FULL_SPEED
from framestep.motors.bounds import SOFT_LOWER
from framestep.motors.rates import ACCELERATION_LIMIT, TICKS_PER_SECOND, VELOCITY_LIMIT
from framestep.protocol import messages as m
from framestep.pulse import stepper

_COUPLING = const(m.MOTOR_COUPLE | m.MOTOR_COUPLE_REVERSED)


class Motors:
    """Handlers of requests about single motors. motion: a Motion. homing may be None."""

    def __init__(self, rig, link, motion, safety, homing, reports):
        self.rig = rig
        self.reader = link.reader
        self.writer = link.writer
        self.axes = motion.axes
        self.hal = motion.axes.hal
        self.interlock = motion.interlock
        self.safety = safety
        self.shared = safety.shared
        self.moves = motion.moves
        self.operations = motion.moves.operations
        self.virtuals = motion.virtuals
        self.homing = homing
        self.reports = reports
        # fastest velocity, steps/s, that each motor's pulses allow
        kernel = self.hal.kernel
        per_second = TICKS_PER_SECOND * kernel.state[stepper.CYCLES]
        self.fastest = array(
            "i", [min(VELOCITY_LIMIT, per_second // b[stepper.SHORTEST]) for b in kernel.blocks]
        )
        self.heard_at = array("i", [0] * self.axes.count)  # time of the last JOG, ms
        self.words = array("i", [0] * 2)  # from the request: a target, or two limits
        for i in range(self.axes.count):
            self.axes[i].set_jerk(self.rig.motor(i)["jerk"])
            self.axes.set_backlash(i, self.rig.motor(i)["backlash"])
        link.handlers.update(
            {
                m.MSG_MOTOR_MOVE: self._move,
                m.MSG_MOTOR_STOP: self._stop,
                m.MSG_MOTOR_RESET_POSITION: self._reset_position,
                m.MSG_MOTOR_JOG: self._jog,
                m.MSG_MOTOR_CONFIGURE: self._configure,
                m.MSG_MOTOR_SET_SPEED: self._set_speed,
                m.MSG_MOTOR_SET_LIMITS: self._set_limits,
                m.MSG_EXCEEDED: self._exceeded,
            }
        )

    # ---------------------------------------------------------------- moves, jogs, stops

    def _motor(self):
        """Return the motor of this request, from 0; -1 if there is no such motor."""
        number = self.reader.u8(m.MotorMove.motor)  # the first field of all these requests
        return number - 1 if 0 < number <= self.axes.count else -1

    def _move(self):
        """MSG_MOTOR_MOVE (field notes 4.3 and 4.8).

        The answer says whether it moves; in the dialect dmc-lite it is a code (field note 1.4).
        """
        motor = self._motor()
        if motor < 0:
            return m.ERR_RANGE
        self.reader.copy_i32_to(m.MotorMove.position, self.words, 0)
        code = self.move(motor)
        if code != m.OK or self.rig.dword_acks:
            return code
        writer = self.writer
        virtuals = self.virtuals
        writer.begin(m.MSG_MOTOR_MOVE, self.reader)
        moving = self.axes[motor].moving or virtuals.owned and virtuals.moves_camera(motor)
        writer.u8(1 if moving else 0)
        writer.end()
        return 0

    def move(self, motor):
        """Move a motor to words[0]. Return a code; nothing moves unless it is OK."""
        code = self.interlock.may_move(motor)
        if code != m.OK:
            return code
        self.hal.port.look_for_stop()
        axis = self.axes[motor]
        side = bounds.outside(axis, self.words, 0)
        if side:
            return m.ERR_SOFT_UP if side > 0 else m.ERR_SOFT_LOW
        code = self.safety.limit_blocking(motor, self.words, 0)
        if code != m.OK:
            return code
        self.interlock.stop_jogging(1 << motor)
        if self.virtuals.moves_camera(motor):
            return self.virtuals.move_keeping_aim(motor, self.words, 0)
        self.interlock.switch_on(1 << motor)
        axis.move_to(self.hal, self.words, 0)
        return m.OK

    def _jog(self):
        """MSG_MOTOR_JOG: speed 1 … 10000 (field note 4.2)."""
        motor = self._motor()
        speed = self.reader.u16(m.MotorJog.speed)
        if motor < 0 or speed < 1 or speed > FULL_SPEED:
            return m.ERR_RANGE
        self.reader.copy_i32_to(m.MotorJog.destination, self.words, 0)
        return self.jog(motor, speed)

    def jog(self, motor, speed):
        """Jog a motor toward words[0], at most to its soft limit. speed: 1 … 10000. Return a code,
        like move()."""
        code = self.interlock.may_move(motor)
        if code != m.OK:
            return code
        self.hal.port.look_for_stop()
        axis = self.axes[motor]
        bounds.clamp(axis, self.words, 0)
        code = self.safety.limit_blocking(motor, self.words, 0)
        if code != m.OK:
            return code
        bit = 1 << motor
        if self.virtuals.moves_camera(motor):
            return self.virtuals.move_keeping_aim(motor, self.words, 0, speed)
        self.heard_at[motor] = self.reader.now
        if not self.interlock.jogging & bit or not axis.heads_for(self.words, 0, speed):
            self.interlock.begin_jog(bit)
            axis.move_to(self.hal, self.words, 0, speed)
        return m.OK

    def end_jogs(self, now):
        """Stop motors whose JOG has not been repeated in time (field note 4.2). now: ms."""
        limit = self.rig.jog_timeout_ms
        for motor in range(self.axes.count):
            bit = 1 << motor
            if self.interlock.jogging & bit:
                axis = self.axes[motor]
                if not axis.moving:
                    self.interlock.stop_jogging(bit)
                elif limit and elapsed(now, self.heard_at[motor]) >= limit:
                    axis.stop(self.hal, 1, True)
                    self.interlock.stop_jogging(bit)

    def _stop(self):
        """MSG_MOTOR_STOP (spec; field notes 1.8 and 6.11).

        If the motor belongs to an operation or a virtual motion, all motors of it stop.
        """
        motor = self._motor()
        if motor < 0:
            return m.ERR_RANGE
        motor = self.interlock.leading(motor)
        self.interlock.stop_jogging(1 << motor)
        if self.homing:
            self.homing.end(1 << motor)
        virtual = self.virtuals.owned
        in_operation = (self.operations.bits >> motor) & 1
        if in_operation:
            self.operations.stop(land=True, spared=virtual)
        if (virtual >> motor) & 1:
            self.virtuals.stop()
        elif not in_operation:
            self.axes[motor].stop(self.hal, 1, True)
        return m.OK

    # ---------------------------------------------------------------- settings

    def _reset_position(self):
        """MSG_MOTOR_RESET_POSITION: set the motor's position (field note 4.5)."""
        motor = self._motor()
        if motor < 0:
            return m.ERR_RANGE
        axis = self.axes[motor]
        if axis.moving or (self.interlock.owned >> self.interlock.leading(motor)) & 1:
            return m.ERR_MOVING  # field note 4.5; a motor of an operation may move soon
        self.reader.copy_i32_to(m.MotorResetPosition.position, self.words, 0)
        if not axis.set_position(self.words, 0):
            return m.ERR_RANGE
        self.axes.positions.set_known(motor)
        self.axes.position_was_set(motor)
        if self.shared:
            self.shared.hit_here(motor)
        self.operations.settings_changed()
        self.reports.report_positions()
        return m.OK

    def _configure(self):
        """MSG_MOTOR_CONFIGURE: bits MOTOR_ (field notes 3.1 and 4.5)."""
        motor = self._motor()
        flags = self.reader.u8(m.MotorConfigure.flags)
        if motor < 0:
            return m.ERR_RANGE
        axis = self.axes[motor]
        enabled = flags & m.MOTOR_ENABLED
        coupling = (flags ^ self.interlock.flags[motor]) & _COUPLING
        if flags != self.interlock.flags[motor]:
            owned = self.interlock.coupled(self.operations.owned | self.interlock.homing)
            virtual = self.interlock.coupled(self.virtuals.owned)
            if coupling:
                owned |= owned >> 1  # the next motor is affected as well
                virtual |= virtual >> 1
            if (
                (owned >> motor) & 1
                or (axis.moving or (virtual >> motor) & 1)
                and (coupling or not enabled)
            ):
                return m.ERR_MOVING
        if coupling:
            code = self._couple(motor, flags & _COUPLING)
            if code != m.OK:
                return code
        self.interlock.flags[motor] = flags
        bit = 1 << motor
        if enabled:
            self.interlock.switch_on(bit)
        else:
            self.interlock.switch_off(bit)
            self.axes.positions.driver_off(motor)
        self.moves.set_motors(self.interlock.with_flag(m.MOTOR_BLUR), self.interlock.excluded())
        self.operations.settings_changed()
        return m.OK

    def _couple(self, motor, flags):
        """Couple the next motor to this one, or end that (field note 3.1). Return a code."""
        if motor + 1 >= self.axes.count:
            return m.ERR_RANGE
        axis = self.axes[motor]
        partner = self.axes[motor + 1]
        if partner.moving:
            return m.ERR_MOVING
        if not flags:
            axis.uncouple()
        elif (
            axis.leader
            or partner.partner
            or not axis.couple(partner, flags & m.MOTOR_COUPLE_REVERSED)
        ):
            return m.ERR_RANGE  # no chains
        return m.OK

    def _set_speed(self):
        """MSG_MOTOR_SET_SPEED, in steps/s and steps/s².

        Acceleration 0 is half the velocity (field note 4.1).
        """
        motor = self._motor()
        velocity = self.reader.u30(m.MotorSetSpeed.velocity)
        acceleration = self.reader.u30(m.MotorSetSpeed.acceleration)
        if motor < 0 or velocity < 1 or velocity > self.fastest[motor]:
            return m.ERR_RANGE
        if acceleration < 0:
            acceleration = ACCELERATION_LIMIT
        self.axes.set_speed(motor, velocity, acceleration)
        self.hal.port.look_for_stop()
        self.operations.settings_changed()
        self.virtuals.changed(self.interlock.leading(motor))
        return m.OK

    def _set_limits(self):
        """MSG_MOTOR_SET_LIMITS: soft limits and limit switches (field notes 3.3 and 4.3)."""
        reader = self.reader
        motor = self._motor()
        hw_set = reader.u8(m.MotorSetLimits.limit_set)
        lower_enable = reader.u8(m.MotorSetLimits.lower_enable)
        upper_enable = reader.u8(m.MotorSetLimits.upper_enable)
        switches = hw_set & m.HW_SET_MASK
        if motor < 0 or lower_enable > 1 or upper_enable > 1 or not self.safety.has(switches):
            return m.ERR_RANGE
        if (self.interlock.homing >> self.interlock.leading(motor)) & 1:
            return m.ERR_MOVING  # field note 4.9
        reader.copy_i32_to(m.MotorSetLimits.lower, self.words, 0)
        reader.copy_i32_to(m.MotorSetLimits.upper, self.words, 1)
        if not self.axes[motor].set_limits(lower_enable != 0, upper_enable != 0, self.words, 0):
            return m.ERR_RANGE
        if self.homing:
            self.homing.restore()
        self.safety.assign(motor, switches, hw_set & m.HW_SET_SWAP)
        self.operations.settings_changed()
        motor = self.interlock.leading(motor)
        self.virtuals.changed(motor)
        if not ((self.operations.on_path | self.virtuals.owned) >> motor) & 1:
            self.axes[motor].keep_to_limits(self.hal)
        return m.OK

    def _exceeded(self):
        """MSG_EXCEEDED, framestep's own (field note 5.5).

        The answer has what the last move exceeded, then the settings of that motor, or of the
        motor in the request: m.Exceeded, field by field.
        """
        writer = self.writer
        exceeded = self.operations.exceeded
        motor = self.reader.u8(m.GetExceeded.motor) - 1 if self.reader.length else exceeded[MOTOR]
        if motor < 0 or motor >= self.axes.count:
            return m.ERR_RANGE
        writer.begin(m.MSG_EXCEEDED, self.reader)
        writer.u8(exceeded[WHAT])
        writer.u8(exceeded[MOTOR] + 1 if exceeded[WHAT] else 0)
        writer.put_i32s_from(exceeded, FRAME, 2)  # and BY
        axis = self.axes[motor]
        safety = self.safety
        writer.u8(motor + 1)
        writer.u32(axis.own_velocity)
        writer.u32(axis.own_acceleration)
        writer.put_i32s_from(axis.bounds, SOFT_LOWER, 2)
        bits = safety.active_limits(motor) * m.SET_AT_UPPER  # and SET_AT_LOWER, the next bit
        if axis.lower_enabled:
            bits |= m.SET_LOWER
        if axis.upper_enabled:
            bits |= m.SET_UPPER
        if self.interlock.flags[motor] & m.MOTOR_ENABLED:
            bits |= m.SET_ENABLED
        if axis.leader:
            bits |= m.SET_FOLLOWS
        writer.u8(bits)
        writer.u16(safety.active_sets(0))
        writer.u16(safety.active_sets(1))
        writer.put_i32s_from(exceeded, ROOM, 1)
        writer.end()
        return 0
