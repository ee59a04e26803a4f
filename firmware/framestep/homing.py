"""Homing: a motor finds its home switch, which defines its position (field note 4.9).

One motor after the other: fast toward the switch, back off it, toward it again slowly. The place
where the slow approach finds it becomes the `position` of the rig file. Then the motor backs off
once more, so that the switch is free. While a motor looks for its switch, the switch acts as one of
its limits: Safety slows the motor down from an interrupt, whatever the main loop is busy with.

The two sides of a gantry (`square_within`) go through these phases together, each to its own
switch. If they are coupled, they are not until both are done.

Loaded only if a motor of the rig file has `home`. Nothing allocates after construction.
"""

from array import array

from framestep.base.clock import elapsed
from framestep.base.native import const, micropython
from framestep.io.safety import AT_LOWER, AT_UPPER, LOWER
from framestep.motion import reals
from framestep.motors import bounds
from framestep.motors.axis import MOTION_ACCELERATION, MOTION_VELOCITY
from framestep.motors.positions import (
    HELD,
    HOMED,
    HOMING,
    KNOWN,
    LOST,
    NOT_FOUND,
    NOT_OPENED,
    NOT_SQUARE,
)
from framestep.motors.rates import MAX_ACCELERATION, TICKS_PER_SECOND
from framestep.protocol import messages as m
from framestep.stops import FAULT_HOMING, HOMING_REPORT

SETTLE_MS = const(50)  # at rest, before a switch is judged: longer than it bounces
_OWN_RATES = const(1)  # a speed for Axis.move_to() that means the rates of _set_velocity()
_EITHER = const(-1)  # results of SharedSwitches.side()
_ONE_END = const(-2)
_Y = const(14)  # a scratch register of Axis.numbers

# Phases
_NONE = const(0)
_SEEK = const(1)  # fast toward the switch
_BACK = const(2)  # off the switch
_AGAIN = const(3)  # slowly toward it
_LEAVE = const(4)  # off it, with the position known
_ENDED = const(5)  # somebody has stopped it: until it is at rest, the switch is still its limit

_UNCOUPLED = const(-1)  # a coupling; else it is Axis.reversed

# Words
_TARGET = const(0)
_HERE = const(1)
_DISTANCE = const(2)
_FOUND = const(3)  # position at which the switch was found
_WORDS = const(4)


class Seeker:
    """A motor that looks for its home switch. homing: the Homing that says what it does."""

    def __init__(self, homing):
        self.homing = homing
        self.axes = homing.axes
        self.safety = homing.safety
        self.words = array("i", [0] * _WORDS)
        self.pin = 0  # of the switch, a bit of Hal.levels()
        self.away = 0  # 1: away from the switch is downward
        self.found = False  # in this phase
        self.limits = 0  # soft limits to restore: 1 lower, 2 upper; the partner's times 4
        self.pins = 0  # pins of the limit switch at this end, to restore
        self.motor = 0
        self.axis = None
        self.home = None

    def begin(self, motor, known):
        """Take a motor. known: its position is, so soft limits apply."""
        self.motor = motor
        self.axis = self.axes[motor]
        self.home = self.homing.homes[motor]
        upward = self.home["toward"] == "high"
        self.away = 1 if upward else 0
        self.pin = self.safety.sets[self.home["limit"] - 1][0 if upward else 1]
        self.pins = self.safety.limit_pins(motor, self.away)
        self.safety.set_limit_pins(motor, self.away, self.pins | self.pin)
        self.limits = 0
        self.axes.hal.port.look_for_stop()
        if not known:
            self._suspend_limits()

    def active(self):
        """Return whether its switch is active."""
        return self.safety.is_active(self.pin)

    def at_switch(self):
        """Return whether it is on its home switch, and not on one of the other end at this pin."""
        safety = self.safety
        return safety.is_active(self.pin & safety.counting_pins(self.motor, self.away))

    def stop_here(self, factor):
        """It has found its switch: note where, and stop."""
        self.found = True
        reals.copy_word(self.words, _FOUND, self.axes.reported, self.motor)
        self.axis.stop(self.homing.hal, factor)

    def stand_on_switch(self):
        """It is on its switch: note where."""
        self.axis.position_to(self.words, _FOUND)

    def go(self, distance, back):
        """Set out for so many steps. back: from where the switch was found, away from it; else from
        here, toward it."""
        words = self.words
        words[_DISTANCE] = distance
        start = _FOUND
        if not back:
            self.axis.position_to(words, _HERE)
            start = _HERE
        away = self.away if back else self.away ^ 1
        reals.add_words(words, _TARGET, words, start, words, _DISTANCE, away)
        self.axis.move_to(self.homing.hal, words, _TARGET, _OWN_RATES)

    def set_rates(self, speed, slower):
        """Set the velocity of the next motion, in steps/s, at most its own and that of the axis
        `slower`; its acceleration is the lower one of the two."""
        axis = self.axis
        r = axis.numbers
        axis.speed = _OWN_RATES
        axis.rates_outdated = False
        speed = min(speed, axis.velocity, slower.velocity)
        if axis.acceleration < slower.acceleration:
            slower = axis
        reals.put(r, MOTION_VELOCITY, speed, 0)
        reals.put(r, _Y, TICKS_PER_SECOND, 0)
        reals.divide(r, MOTION_VELOCITY, MOTION_VELOCITY, _Y)
        reals.fetch(r, MOTION_ACCELERATION, slower.numbers, MAX_ACCELERATION)

    def arrive(self):
        """Make the place where the switch was found the `position` of the rig file. The motor has
        come to rest some steps beyond it. Return whether that is possible."""
        words = self.words
        axis = self.axis
        axis.position_to(words, _HERE)
        reals.add_words(words, _DISTANCE, words, _HERE, words, _FOUND, 1)
        words[_FOUND] = self.home["position"]
        reals.add_words(words, _HERE, words, _FOUND, words, _DISTANCE, 0)
        return axis.set_position(words, _HERE)

    def is_found_at_limit(self, bits):
        """Return whether it is one of these motors stopped at a limit, and the limit is its switch,
        which is then not reported."""
        own = 1 << self.motor
        safety = self.safety
        end, other = (AT_UPPER, AT_LOWER) if self.away else (AT_LOWER, AT_UPPER)
        others = safety.is_active(self.pins & ~self.pin)
        if not bits & own & safety.words[end] & ~safety.words[other] or others:
            return False
        safety.reported(self.motor if self.away else self.motor + LOWER)
        return True

    def restore(self):
        """Restore the limit switches of SET_LIMITS."""
        self.safety.set_limit_pins(self.motor, self.away, self.pins)

    def _suspend_limits(self):
        """Suspend soft limits, as the motor's number does not show where it is."""
        axis = self.axis
        self.limits = (1 if axis.lower_enabled else 0) | (2 if axis.upper_enabled else 0)
        axis.lower_enabled = axis.upper_enabled = False
        partner = axis.partner
        if partner:
            self.limits |= (4 if partner.lower_enabled else 0) | (8 if partner.upper_enabled else 0)
            partner.lower_enabled = partner.upper_enabled = False
        bounds.update(axis)

    def restore_limits(self):
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
            bounds.update(axis)


class Homing:
    """Homes motors. `Interlock.homing` has the bits of motors that are not done. Whoever stops
    motors ends homing (end()).

    motion: a Motion. faults: a FaultLog.
    """

    def __init__(self, rig, link, motion, io, reports, faults):
        self.reader = link.reader
        self.axes = axes = motion.axes
        self.hal = axes.hal
        self.interlock = motion.interlock
        self.operations = motion.moves.operations
        self.virtuals = motion.virtuals
        self.safety = io.safety
        self.shared = io.safety.shared
        self.inputs = inputs = io.gio.inputs
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
        # motors that are a side of a gantry together with the next one
        self.pairs = 0
        for motor in found:
            if self.homes[motor]["square_within"]:
                self.pairs |= 1 << motor
                self.capable |= 2 << motor
        self.order = bytes([i for i in found if not (self.pairs << 1 >> i) & 1])
        self.phase = _NONE
        self.seekers = [Seeker(self), Seeker(self)]
        self.paired = False  # both look for their switches, otherwise the first
        self.coupling = _UNCOUPLED  # of the two, to restore
        self.bounded = False  # the sides of a gantry: one goes `square_within` farther at most
        self.cleared = False  # both go back first, as a switch of a gantry was pressed
        self.probing = False  # on a switch of either end: it has to open on the way away from home
        self.rested_at = 0  # ms
        self.known = 0  # motors whose position was known, so that soft limits apply
        self.news = 0  # motors whose result has yet to be printed on the REPL
        button = rig.home_input
        self.button = 1 << (button - 1) if button else 0
        self.was_on = inputs.values & self.button
        link.handlers.update({m.MSG_HOME: self._home})

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
            if self._enabled(motor):
                bits |= 1 << motor
        return bits

    def _enabled(self, motor):
        interlock = self.interlock
        if (self.pairs >> motor) & 1 and not interlock.flags[motor + 1] & m.MOTOR_ENABLED:
            return False
        return interlock.enabled(motor)

    def start(self, bits):
        """Home the motors of these bits. Return a code; nothing changes unless it is OK."""
        if bits & ~self.capable:
            return m.ERR_RANGE
        if not bits or not self.interlock.allow_motion():
            return m.ERR_GENERAL
        if self.phase == _ENDED and not self._moving():
            self.restore()
        if self.operations.busy or self.interlock.in_virtual_motion or self.phase:
            return m.ERR_MOVING
        bits |= bits >> 1 & self.pairs
        bits |= (bits & self.pairs) << 1
        states = self.axes.positions.states
        known = 0
        for motor in range(self.axes.count):
            if (bits >> motor) & 1:
                code = self._refusal(motor)
                if code != m.OK:
                    return code
                if states[motor] == KNOWN:
                    known |= 1 << motor
                self.axes.hal.port.look_for_stop()
        self.known = known
        positions = self.axes.positions
        positions.about_to_change()
        for motor in range(self.axes.count):
            if (bits >> motor) & 1:
                positions.put(motor, HELD if (known >> motor) & 1 else LOST, HOMING)
        self.interlock.set_homing(bits)
        self.news &= ~bits
        self._next()
        return m.OK

    def _refusal(self, motor):
        """Return OK, or the reason why this motor may not be homed."""
        leader = motor - 1 if (self.pairs << 1 >> motor) & 1 else motor
        code = self.interlock.may_move(leader)
        if code == m.OK and not self._enabled(leader):
            code = m.ERR_GENERAL
        if code != m.OK:
            return code
        axis = self.axes[motor]
        if axis.moving or self.virtuals.moves_camera(motor):
            return m.ERR_MOVING
        if self.axes.positions.states[motor] == KNOWN:
            words = self.seekers[0].words
            words[_TARGET] = self.homes[motor]["position"]
            side = bounds.outside(axis, words, _TARGET)
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

    # ---------------------------------------------------------------- phases

    def poll(self, now):
        """Do one pass of the main loop. now: milliseconds modulo 2^29."""
        if self.button:
            self._watch_button()
        if not self.phase:
            return
        if self.phase == _ENDED:
            if not self._moving():
                self.restore()
            return
        if self.phase == _SEEK or self.phase == _AGAIN:
            for i in range(2 if self.paired else 1):
                seeker = self.seekers[i]
                if not seeker.found and seeker.at_switch():
                    self.axes.choose_sample()
                    seeker.stop_here(self.factor)
            if self.paired and self.phase == _SEEK and not self.bounded:
                self._bound()
        if self._moving():
            self.rested_at = now
        elif elapsed(now, self.rested_at) >= SETTLE_MS:
            self._judge()

    def _bound(self):
        """Let one side of a gantry go little farther once the other has found its switch, or has
        come to rest without."""
        first, second = self.seekers
        if first.found or not first.axis.moving:
            first = second
        elif not second.found and second.axis.moving:
            return
        self.bounded = True
        if not first.found and first.axis.moving:
            first.go(self.seekers[0].home["square_within"], False)

    def _moving(self):
        seekers = self.seekers
        return seekers[0].axis.moving or self.paired and seekers[1].axis.moving

    def _next(self):
        """Begin with the next motor, or the next two, if there are any."""
        for motor in self.order:
            if (self.interlock.homing >> motor) & 1:
                break
        else:
            return
        self.paired = (self.pairs >> motor) & 1 != 0
        self.coupling = _UNCOUPLED
        axis = self.axes[motor]
        if self.paired and axis.partner:
            self.coupling = axis.reversed
            axis.uncouple()
        pressed = False
        for i in range(2 if self.paired else 1):
            seeker = self.seekers[i]
            seeker.begin(motor + i, (self.known >> (motor + i)) & 1)
            seeker.stand_on_switch()
            pressed |= seeker.active()
            self.axes.hal.port.look_for_stop()
        seeker = self.seekers[0]
        side = self.shared.side(motor, seeker.pin) if self.shared else _ONE_END
        self.probing = False
        self.cleared = self.paired and pressed
        if not pressed or side == 1 - seeker.away:
            self._go(_SEEK)
            return
        if side == _EITHER:  # perhaps it is on its home switch
            self.probing = True
            self.shared.put(motor, seeker.away)
        self._go(_BACK)

    def _go(self, phase):
        """Set out on a phase."""
        self.phase = phase
        self.bounded = False
        self.rested_at = self.reader.now
        first = self.seekers[0]
        home = first.home
        speed = home["speed"]
        if phase == _AGAIN and not home["stall"] or self.probing:
            speed = home["slow_speed"]
        self.interlock.switch_on((3 if self.paired else 1) << first.motor)
        for i in range(2 if self.paired else 1):
            seeker = self.seekers[i]
            seeker.found = False
            back_off = seeker.home["back_off"]
            seeker.set_rates(speed, self.seekers[1 - i if self.paired else 0].axis)
            if phase == _SEEK:
                seeker.go(home["travel"], False)
            elif phase == _AGAIN:
                seeker.go(2 * back_off, False)
            else:
                seeker.go(back_off + (home["square"] if i and phase == _LEAVE else 0), True)

    def _judge(self):
        """At rest after a phase: begin the next one, or note what is wrong."""
        phase = self.phase
        if not self.interlock.allow_motion():
            self.end()
            return
        for i in range(2 if self.paired else 1):
            seeker = self.seekers[i]
            if phase == _SEEK or phase == _AGAIN:
                # A switch that was found but is open again was disturbed, if the motor was so slow
                # that it cannot have passed it. (A stall, however, ends as soon as it rests.)
                if not seeker.found or (
                    phase == _AGAIN and not seeker.active() and not seeker.home["stall"]
                ):
                    seeking = self.paired and phase == _SEEK
                    if seeking and self.seekers[1 - i].found:
                        self._fail(1 << seeker.motor, NOT_SQUARE)
                    else:
                        self._fail(self._bits() if seeking else 1 << seeker.motor, NOT_FOUND)
                    return
            elif seeker.active():
                if self.probing:  # so it is on that of the other end
                    self.probing = False
                    self.shared.put(seeker.motor, 1 - seeker.away)
                    self._go(_SEEK)
                else:
                    self._fail(1 << seeker.motor, NOT_OPENED)
                return
        self.probing = False
        if phase == _SEEK:
            self._go(_BACK)
        elif phase == _BACK:
            # The other side of a gantry may still be far from its switch.
            self._go(_SEEK if self.cleared else _AGAIN)
            self.cleared = False
        elif phase == _AGAIN:
            self._arrive()
        else:
            self._done()

    def _arrive(self):
        """Set the positions."""
        positions = self.axes.positions
        for i in range(2 if self.paired else 1):
            seeker = self.seekers[i]
            if not seeker.arrive():
                self._fail(1 << seeker.motor, NOT_FOUND)
                return
            positions.about_to_change()
            positions.put(seeker.motor, KNOWN, HOMED)
            self.axes.position_was_set(seeker.motor)
            if self.shared:
                self.shared.hit_here(seeker.motor)
            seeker.restore_limits()
        self.operations.settings_changed()
        self.reports.report_positions()
        self._go(_LEAVE)

    def _bits(self):
        """Return the motors that look for their switches, one bit each."""
        return (3 if self.paired else 1) << self.seekers[0].motor

    def _done(self):
        """Finish these motors, and go on with the next ones."""
        self.release()
        self._note_result(self._bits())
        self.interlock.set_homing(self.interlock.homing & ~self._bits())
        self._next()

    def _fail(self, bits, reason):
        """Mark the positions as lost, and end homing. bits: the motors that have failed; reason: of
        motors/positions.py."""
        self.end()
        positions = self.axes.positions
        positions.set_lost(self._bits(), HOMING)
        positions.set_lost(bits, reason)
        self.faults.note(FAULT_HOMING, 0)
        self._note_result(bits)

    @micropython.viper
    def sides(self) -> int:
        """Return the motors of a gantry that is homed, one bit each: they stop together."""
        bits = 0
        if self.paired:
            bits = 3 << int(self.seekers[0].motor)
        return bits

    def end(self, bits=-1):
        """End homing if any of these motors, which are about to be stopped, is homed."""
        if self.interlock.homing & bits:
            self.interlock.set_homing(0)
            self.release()

    def release(self):
        """Release the motors, and stop both sides of a gantry. Their switches remain their limits
        until they are at rest."""
        self.phase = _ENDED
        for i in range(2 if self.paired else 1):
            seeker = self.seekers[i]
            seeker.restore_limits()
            seeker.axis.rates_outdated = True
            if self.paired and seeker.axis.moving:
                seeker.axis.stop(self.hal)
        if not self._moving():
            self.restore()

    def restore(self):
        """After release(): restore the limit switches of SET_LIMITS, and the coupling."""
        if self.phase == _ENDED:
            self.phase = _NONE
            first = self.seekers[0]
            if self.probing:
                self.probing = False
                self.shared.forget(first.motor)
            for i in range(2 if self.paired else 1):
                self.seekers[i].restore()
            if self.coupling != _UNCOUPLED:
                first.axis.couple(self.seekers[1].axis, self.coupling)
                self.coupling = _UNCOUPLED

    def take_limit(self, bits):
        """Filter the motors stopped at a limit, one bit each: remove those that have found their
        home switches, which are not reported. Another motor that is being homed ends homing."""
        if self.phase == _SEEK or self.phase == _AGAIN:
            for i in range(2 if self.paired else 1):
                if self.seekers[i].is_found_at_limit(bits):
                    bits &= ~(1 << self.seekers[i].motor)
        self.end(bits)
        return bits

    # ---------------------------------------------------------------- reports to people

    def _note_result(self, bits):
        """Have the results of these motors printed on the REPL."""
        self.news |= bits
        self.faults.note(0, HOMING_REPORT)

    def report(self):
        """Print the results. Allocates nothing."""
        for motor in range(self.axes.count):
            if (self.news >> motor) & 1:
                reason = self.axes.positions.reasons[motor]
                text = "is homed"
                if reason == NOT_FOUND:
                    text = "did not find its home switch: its position is lost"
                elif reason == NOT_OPENED:
                    text = "did not come off its home switch: its position is lost"
                elif reason == NOT_SQUARE:
                    text = "is too far from its home switch when the other side has found its own"
                print("framestep: motor", motor + 1, text)
        self.news = 0
