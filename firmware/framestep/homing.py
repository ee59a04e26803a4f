"""Homing: a motor finds its home switch, which defines its position (field note 4.9).

One motor after the other: fast toward the switch, back off it, toward it again slowly. The place
where the slow approach finds it becomes the `position` of the rig file. Then the motor backs off
once more, so that the switch is free. While a motor looks for its switch, the switch acts as one of
its limits: Safety slows the motor down from an interrupt, whatever the main loop is busy with.

Loaded only if a motor of the rig file has `home`. Nothing allocates after construction.
"""

from array import array

from framestep.base.clock import elapsed
from framestep.base.native import const
from framestep.io.safety import LOWER
from framestep.motion import reals
from framestep.motors.axis import MOTION_ACCELERATION, MOTION_VELOCITY
from framestep.motors.bounds import update as update_bounds
from framestep.motors.motor import MAX_ACCELERATION, TICKS_PER_SECOND
from framestep.motors.positions import HELD, HOMED, HOMING, KNOWN, LOST, NOT_FOUND, NOT_OPENED
from framestep.protocol import messages as m
from framestep.stops import FAULT_HOMING, HOMING_REPORT

SETTLE_MS = const(50)  # at rest, before a switch is judged: longer than it bounces
_OWN_RATES = const(1)  # a speed for Axis.move_to() that means the rates of _set_velocity()
_EITHER = const(-1)  # results of SharedSwitches.side()
_ONE_END = const(-2)
_Y = const(14)  # a scratch register of Motor.numbers

# Phases
_NONE = const(0)
_SEEK = const(1)  # fast toward the switch
_BACK = const(2)  # off the switch
_AGAIN = const(3)  # slowly toward it
_LEAVE = const(4)  # off it, with the position known
_ENDED = const(5)  # somebody has stopped it: until it is at rest, the switch is still its limit

# Words
_TARGET = const(0)
_HERE = const(1)
_DISTANCE = const(2)
_FOUND = const(3)  # position at which the switch was found
_WORDS = const(4)


class Homing:
    """Homes motors. `Gate.homing` has the bits of motors that are not done. Whoever stops motors
    ends homing (end()).

    operations: of uploaded moves. faults: a FaultLog.
    """

    def __init__(
        self, hal, rig, reader, axes, safety, inputs, gate, operations, virtuals, reports, faults
    ):
        self.hal = hal
        self.reader = reader
        self.axes = axes
        self.safety = safety
        self.shared = safety.shared
        self.inputs = inputs
        self.gate = gate
        self.operations = operations
        self.virtuals = virtuals
        self.reports = reports
        self.faults = faults
        self.factor = rig.hard_stop_factor
        self.homes = [rig.motor(i)["home"] for i in range(axes.count)]
        found = [i for i in range(axes.count) if self.homes[i]]
        found.sort(key=lambda i: 16 * self.homes[i]["order"] + i)
        self.order = bytes(found)
        self.capable = 0
        for motor in found:
            self.capable |= 1 << motor
        self.words = array("i", [0] * _WORDS)
        self.phase = _NONE
        self.motor = 0
        self.axis = self.axes[0]
        self.home = self.homes[found[0]]
        self.pin = 0  # of the switch, a bit of Hal.levels()
        self.away = 0  # 1: away from the switch is downward
        self.found = False  # in this phase
        self.probing = False  # on a switch of either end: it has to open on the way away from home
        self.rested_at = 0  # ms
        self.known = 0  # motors whose position was known, so that soft limits apply
        self.limits = 0  # soft limits to restore: 1 lower, 2 upper; the partner's times 4
        self.pins = 0  # pins of the limit switch at this end, to restore
        self.news = 0  # motors whose result has yet to be printed on the REPL
        button = rig.home_input
        self.button = 1 << (button - 1) if button else 0
        self.was_on = inputs.values & self.button
        self.handlers = {m.MSG_HOME: self._home}

    # ---------------------------------------------------------------- requests

    def _home(self):
        """MSG_HOME, framestep's own (field note 4.9). Without motors: all enabled ones that have
        `home` in the rig file."""
        reader = self.reader
        bits = 0
        for i in range(reader.length):
            number = reader.u8(i)
            if number < 1 or number > self.axes.count:
                return m.ERR_RANGE
            bits |= 1 << (number - 1)
        return self.start(bits or self.usable())

    def usable(self):
        """Return the motors that have `home` and may move, one bit each."""
        bits = 0
        for motor in self.order:
            if self.gate.enabled(motor):
                bits |= 1 << motor
        return bits

    def start(self, bits):
        """Home the motors of these bits. Return a code; nothing changes unless it is OK."""
        if bits & ~self.capable:
            return m.ERR_RANGE
        if not bits or not self.gate.allow_motion():
            return m.ERR_GENERAL
        if self.phase == _ENDED and not self.axis.moving:
            self.restore()
        if self.operations.busy or self.gate.virtual or self.phase:
            return m.ERR_MOVING
        known = 0
        for motor in self.order:
            if (bits >> motor) & 1:
                code = self._refusal(motor)
                if code != m.OK:
                    return code
                if self.axes.positions.states[motor] == KNOWN:
                    known |= 1 << motor
        self.known = known
        positions = self.axes.positions
        positions.about_to_change()
        for motor in self.order:
            if (bits >> motor) & 1:
                positions.put(motor, HELD if (known >> motor) & 1 else LOST, HOMING)
        self.gate.set_homing(bits)
        self.news &= ~bits
        self._next()
        return m.OK

    def _refusal(self, motor):
        """Return OK, or the reason why this motor may not be homed."""
        code = self.gate.may_move(motor)
        if code != m.OK:
            return code
        axis = self.axes[motor]
        if axis.moving or self.virtuals.moves_camera(motor):
            return m.ERR_MOVING
        if self.axes.positions.states[motor] == KNOWN:
            self.words[_TARGET] = self.homes[motor]["position"]
            side = axis.outside(self.words, _TARGET)
            if side:
                return m.ERR_SOFT_UP if side > 0 else m.ERR_SOFT_LOW
        return m.OK

    def _watch_button(self):
        """Home motors of unknown position when the input for homing goes on."""
        on = self.inputs.values & self.button
        if on and not self.was_on:
            states = self.axes.positions.states
            bits = self.usable()
            for motor in self.order:
                if states[motor] == KNOWN:
                    bits &= ~(1 << motor)
            self.start(bits)
        self.was_on = on

    # ---------------------------------------------------------------- one motor

    def poll(self, now):
        """Do one pass of the main loop. now: milliseconds modulo 2^29."""
        if self.button:
            self._watch_button()
        if not self.phase:
            return
        axis = self.axis
        if self.phase == _ENDED:
            if not axis.moving:
                self.restore()
            return
        if (self.phase == _SEEK or self.phase == _AGAIN) and not self.found and self._at_switch():
            self.found = True
            self.axes.choose_sample()
            reals.copy_word(self.words, _FOUND, self.axes.reported, self.motor)
            axis.stop(self.hal, self.factor)
        if axis.moving:
            self.rested_at = now
        elif elapsed(now, self.rested_at) >= SETTLE_MS:
            self._judge()

    def _active(self):
        return self.safety.is_active(self.pin)

    def _at_switch(self):
        """Return whether it is on its home switch, and not on one of the other end at this pin."""
        safety = self.safety
        return safety.is_active(self.pin & safety.counting_pins(self.motor, self.away))

    def _next(self):
        """Begin with the next motor, if there is one."""
        for motor in self.order:
            if (self.gate.homing >> motor) & 1:
                self.motor = motor
                self.axis = self.axes[motor]
                self.home = self.homes[motor]
                break
        else:
            return
        upward = self.home["toward"] == "high"
        self.away = 1 if upward else 0
        self.pin = self.safety.sets[self.home["limit"] - 1][0 if upward else 1]
        self.pins = self.safety.limit_pins(self.motor, self.away)
        self.safety.set_limit_pins(self.motor, self.away, self.pins | self.pin)
        self.limits = 0
        if not (self.known >> self.motor) & 1:
            self._suspend_limits()
        side = self.shared.side(self.motor, self.pin) if self.shared else _ONE_END
        self.probing = False
        if not self._active() or side == 1 - self.away:
            self._go(_SEEK)
            return
        if side == _EITHER:  # perhaps it is on its home switch
            self.probing = True
            self.shared.put(self.motor, self.away)
        self.axis.position_to(self.words, _FOUND)
        self._go(_BACK)

    def _go(self, phase):
        """Set out on a phase."""
        self.phase = phase
        self.found = False
        self.rested_at = self.reader.now
        home = self.home
        words = self.words
        speed = home["speed"]
        back = self.away
        if phase == _SEEK:
            words[_DISTANCE] = home["travel"]
            back ^= 1
        elif phase == _AGAIN:
            words[_DISTANCE] = 2 * home["back_off"]
            if not home["stall"]:
                speed = home["slow_speed"]
            back ^= 1
        else:
            words[_DISTANCE] = home["back_off"]
            if self.probing:
                speed = home["slow_speed"]
        start = _FOUND
        if back != self.away:
            self.axis.position_to(words, _HERE)
            start = _HERE
        reals.add_words(words, _TARGET, words, start, words, _DISTANCE, back)
        self._set_velocity(speed)
        self.gate.switch_on(1 << self.motor)
        self.axis.move_to(self.hal, words, _TARGET, _OWN_RATES)

    def _set_velocity(self, speed):
        """Set the velocity of the next motion, in steps/s, at most the motor's; its acceleration is
        the motor's."""
        axis = self.axis
        r = axis.numbers
        axis.speed = _OWN_RATES
        axis.rates_outdated = False
        reals.put(r, MOTION_VELOCITY, min(speed, axis.velocity), 0)
        reals.put(r, _Y, TICKS_PER_SECOND, 0)
        reals.divide(r, MOTION_VELOCITY, MOTION_VELOCITY, _Y)
        reals.copy(r, MOTION_ACCELERATION, MAX_ACCELERATION)

    def _judge(self):
        """At rest after a phase: begin the next one, or note what is wrong."""
        phase = self.phase
        if not self.gate.allow_motion():
            self.end()
        elif phase == _SEEK or phase == _AGAIN:
            # A switch that was found but is open again was disturbed, if the motor was so slow that
            # it cannot have passed it. (A stall, however, ends as soon as the motor rests.)
            if not self.found or (
                phase == _AGAIN and not self._active() and not self.home["stall"]
            ):
                self._fail(NOT_FOUND)
            elif phase == _SEEK:
                self._go(_BACK)
            else:
                self._arrive()
        elif self._active():
            if self.probing:  # so it is on that of the other end
                self.probing = False
                self.shared.put(self.motor, 1 - self.away)
                self._go(_SEEK)
            else:
                self._fail(NOT_OPENED)
        elif phase == _BACK:
            self.probing = False
            self._go(_AGAIN)
        else:
            self._done()

    def _arrive(self):
        """Make the place where the switch was found the `position` of the rig file. The motor has
        come to rest some steps beyond it."""
        words = self.words
        axis = self.axis
        axis.position_to(words, _HERE)
        reals.add_words(words, _DISTANCE, words, _HERE, words, _FOUND, 1)
        words[_FOUND] = self.home["position"]
        reals.add_words(words, _HERE, words, _FOUND, words, _DISTANCE, 0)
        if not axis.set_position(words, _HERE):
            self._fail(NOT_FOUND)
            return
        positions = self.axes.positions
        positions.about_to_change()
        positions.put(self.motor, KNOWN, HOMED)
        self.axes.position_was_set(self.motor)
        if self.shared:
            self.shared.hit_here(self.motor)
        self.operations.settings_changed()
        self.reports.report_positions()
        self._restore_limits()
        self._go(_LEAVE)

    def _done(self):
        """Finish this motor, and go on with the next one."""
        self.release()
        self._note_result()
        self.gate.set_homing(self.gate.homing & ~(1 << self.motor))
        self._next()

    def _fail(self, reason):
        """Mark this motor's position as lost, and end homing. reason: of motors/positions.py."""
        self.end()
        self.axes.positions.set_lost(1 << self.motor, reason)
        self.faults.note(FAULT_HOMING, 0)
        self._note_result()

    def end(self, bits=-1):
        """End homing if any of these motors, which are about to be stopped, is homed."""
        if self.gate.homing & bits:
            self.gate.set_homing(0)
            self.release()

    def release(self):
        """Release the motor. Its switch remains its limit until it is at rest."""
        self.phase = _ENDED
        self._restore_limits()
        self.axis.rates_outdated = True
        if not self.axis.moving:
            self.restore()

    def restore(self):
        """After release(): restore the limit switches of SET_LIMITS."""
        if self.phase == _ENDED:
            self.phase = _NONE
            if self.probing:
                self.probing = False
                self.shared.forget(self.motor)
            self.safety.set_limit_pins(self.motor, self.away, self.pins)

    # ---------------------------------------------------------------- limits

    def _suspend_limits(self):
        """Suspend soft limits, as the motor's number does not show where it is."""
        axis = self.axis
        self.limits = (1 if axis.lower_enabled else 0) | (2 if axis.upper_enabled else 0)
        axis.lower_enabled = axis.upper_enabled = False
        partner = axis.partner
        if partner:
            self.limits |= (4 if partner.lower_enabled else 0) | (8 if partner.upper_enabled else 0)
            partner.lower_enabled = partner.upper_enabled = False
        update_bounds(axis)

    def _restore_limits(self):
        """Restore the soft limits."""
        limits = self.limits
        if limits:
            self.limits = 0
            axis = self.axis
            axis.lower_enabled = limits & 1 != 0
            axis.upper_enabled = limits & 2 != 0
            if axis.partner:
                axis.partner.lower_enabled = limits & 4 != 0
                axis.partner.upper_enabled = limits & 8 != 0
            update_bounds(axis)

    def take_limit(self, bits):
        """Filter the motors stopped at a limit, one bit each: remove the one that has found its
        home switch, which is not reported. Another motor that is being homed ends homing."""
        own = 1 << self.motor
        if bits & own and (self.phase == _SEEK or self.phase == _AGAIN):
            safety = self.safety
            end = self.motor if self.away else self.motor + LOWER
            both = own | (own << LOWER)
            others = safety.is_active(self.pins & ~self.pin)
            if safety.at_limit & both == 1 << end and not others:
                safety.reported(end)
                bits &= ~own
        self.end(bits)
        return bits

    # ---------------------------------------------------------------- reports to people

    def _note_result(self):
        """Have the result printed on the REPL."""
        self.news |= 1 << self.motor
        self.faults.note(0, HOMING_REPORT)

    def report(self):
        """Print the results. Allocates nothing."""
        for motor in self.order:
            if (self.news >> motor) & 1:
                reason = self.axes.positions.reasons[motor]
                text = "is homed"
                if reason == NOT_FOUND:
                    text = "did not find its home switch: its position is lost"
                elif reason == NOT_OPENED:
                    text = "did not come off its home switch: its position is lost"
                print("framestep: motor", motor + 1, text)
        self.news = 0
