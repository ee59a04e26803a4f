"""Stop inputs: the E-stop button and the hardware limit switches (field notes 3.3 and 8.4).

Each switch is one bit of the word of Hal.levels(). A switch counts as active once four readings in
a row find it so (this filters spikes), and as released after RELEASE_MS of inactive readings.

A limit acts on the motors to which SET_LIMITS has assigned its set, and only if they move toward
it. The E-stop acts on all motors, and nothing may move while it is held. It makes the motors stop;
it does not cut their power.

A change of a pin calls on_switch_change() in an interrupt. From the next tick on the motors ramp
down, all in the same tick, whatever the main loop is busy with. Later poll() ends their operations
and reports to the host.

Nothing allocates after construction.
"""

from array import array

from framestep.base import results
from framestep.base.clock import elapsed
from framestep.base.native import addressof, as_word, const, micropython, ptr32
from framestep.motors.feeder import coupled
from framestep.motors.rates import ACCELERATION_LIMIT, kernel_rate
from framestep.pulse.engine import MOTORS
from framestep.pulse.stepper import (
    DOWN,
    HELD,
    MODE,
    RUN,
    SPAN,
    STOP,
    VELOCITY,
    WHOLE_SPAN,
    halt,
    moving,
)

RELEASE_MS = const(20)
_READINGS = const(3)  # after the first one
LOWER = const(MOTORS)  # result of unreported(): motor 0 is at its lower limit
ESTOP = const(2 * MOTORS)  # result of unreported(): the E-stop was pressed
_STANDSTILL = const(4194)  # lower velocities count as rest: a step per second, Q22 steps per tick

# Words of Safety.words
SWITCHES = const(0)  # pins of all switches
REST = const(1)  # their levels while none is active
_SEEN = const(2)  # switches active at the last reading
ACTIVE = const(3)  # these, and switches that were active less than RELEASE_MS ago
_SINCE = const(4)  # time of the last change of _SEEN
CAUGHT = const(5)  # switches that an interrupt has found active
# motors that it has stopped at their upper and at their lower limit, a bit each: see _approaching()
_CAUGHT_UPPER = const(6)
_CAUGHT_LOWER = const(7)
AT_UPPER = const(8)  # motors being stopped there
AT_LOWER = const(9)
_REACH_UPPER = const(10)  # motors found on the way there by the present poll()
_REACH_LOWER = const(11)
_DUE_UPPER = const(12)  # reports that are due
_DUE_LOWER = const(13)
_DUE_ESTOP = const(14)
_MOVED = const(15)  # motors that moved when it found the E-stop pressed
_ESTOP = const(16)  # bit of the E-stop, or 0
_EVERYONE = const(17)  # one bit per motor
_STEEPEST = const(18)  # the steepest ramp of a stop, and the factor: see stepper.halt()
_FACTOR = const(19)
_COUNT = const(20)  # number of motors; for each of them three words follow:
_MOTORS = const(21)
_BLOCK = const(0)  # address of its state block
_UPPER_PIN = const(1)  # of the limit switch at its upper end, or 0
_LOWER_PIN = const(2)
_MOTOR_WORDS = const(3)

_MOVES = const(RUN | STOP)  # modes


@micropython.viper
def _update(w: ptr32, levels: int, now: int):
    """Update with levels and what interrupts have found, which begins _REACH_UPPER and
    _REACH_LOWER. Interrupts are off."""
    seen = (levels ^ w[REST]) & w[SWITCHES]
    if (seen ^ w[_SEEN]) | w[CAUGHT]:
        w[_SEEN] = seen
        w[_SINCE] = now
    seen |= w[CAUGHT]
    w[CAUGHT] = 0
    w[_REACH_UPPER] = w[_CAUGHT_UPPER]
    w[_REACH_LOWER] = w[_CAUGHT_LOWER]
    w[_CAUGHT_UPPER] = 0
    w[_CAUGHT_LOWER] = 0
    if elapsed(now, w[_SINCE]) >= RELEASE_MS:
        w[ACTIVE] = seen
    else:
        w[ACTIVE] = w[ACTIVE] | seen


@micropython.viper
def _approaching(w: ptr32, active: int, to: int) -> int:
    """Return the motors that move toward an active limit. Add those at upper limits to w[to], those
    at lower ones to w[to + 1]."""
    bits = 0
    bit = 1
    at = _MOTORS
    n = w[_COUNT]
    while n:
        block = ptr32(w[at + _BLOCK])
        pins = w[at + _UPPER_PIN]
        v = block[VELOCITY]
        end = to
        if block[DOWN]:
            pins = w[at + _LOWER_PIN]
            v = 0 - v
            end += 1
        # Check velocity and pulses: the end of a motion away may tremble within a step. With a
        # SPAN of its own the motor comes to rest within this tick; see stepper.halt().
        if pins & active and v > _STANDSTILL and block[MODE] & _MOVES:
            if block[SPAN] == block[WHOLE_SPAN]:
                bits |= bit
                w[end] = w[end] | bit
        bit <<= 1
        at += _MOTOR_WORDS
        n -= 1
    return bits


@micropython.viper
def _ends(w: ptr32, motor: int) -> int:
    """Return the active limits of a motor: 1 the upper one, 2 the lower one."""
    at = _MOTORS + motor * _MOTOR_WORDS
    active = w[ACTIVE]
    ends = 0
    if w[at + _UPPER_PIN] & active:
        ends = 1
    if w[at + _LOWER_PIN] & active:
        ends |= 2
    return ends


@micropython.viper
def _limit_toward(target: ptr32, i: int, here: ptr32) -> int:
    """Return the limit in the direction of target[i], as in _ends(); 0 if the motor is there."""
    if target[i + 0] > here[0]:
        return 1
    if target[i + 0] < here[0]:
        return 2
    return 0


class Safety:
    """The stop inputs of a rig."""

    def __init__(self, hal, rig, axes):
        self.hal = hal
        self.axes = axes
        self._levels = hal.levels
        self.words = words = array("i", [0] * (_MOTORS + _MOTOR_WORDS * axes.count))
        words[_COUNT] = axes.count
        words[_EVERYONE] = (1 << axes.count) - 1
        words[_STEEPEST] = kernel_rate(ACCELERATION_LIMIT)
        words[_FACTOR] = rig.hard_stop_factor
        for i in range(axes.count):
            words[_MOTORS + i * _MOTOR_WORDS] = as_word(addressof(axes[i].block))
        self.block = axes[0].block  # it leads to the others
        self.header = axes.kernel.state
        self.sets = []
        self.shared = None  # switches of both ends on one input
        for limit in rig.limits:
            high = self._switch(limit["high"], limit["contact"])
            low = high
            if limit["pin"] < 0:
                low = self._switch(limit["low"], limit["contact"])
            self.sets.append((high, low))
        if [limit for limit in rig.limits if limit["pin"] >= 0]:
            from framestep.io.shared_switches import SharedSwitches

            self.shared = SharedSwitches(self, rig, axes)
        if rig.estop != "none":
            words[_ESTOP] = self._switch(hal.board["estop"], rig.estop)
        self._here = array("i", [0])
        self.tripped = False  # the E-stop is held
        if self.words[SWITCHES]:
            hal.watch(self.words[SWITCHES], self.on_switch_change)

    def _switch(self, pin, contact):
        """Make a pin the input of a switch to ground. Return its bit in Hal.levels()."""
        if pin < 0:
            return 0
        bit = self.hal.input(pin, "up")
        self.words[SWITCHES] |= bit
        if contact == "no":
            self.words[REST] |= bit
        return bit

    def active_sets(self, end):
        """Return the limit sets whose switch at an end is active, one bit each. end: 0 upper, 1
        lower."""
        bits = 0
        for i in range(len(self.sets)):
            if self.is_active(self.sets[i][end]):
                bits |= 1 << i
        return bits

    def has(self, number):
        """Return whether a limit set of this number exists. 0 means none and always exists."""
        return number <= len(self.sets)

    def assign(self, motor, number, swapped):
        """Assign a limit set, or none (0), to a motor (from 0). swapped: swap its two ends."""
        high = 0
        low = 0
        if number:
            high, low = self.sets[number - 1]
            if swapped:
                high, low = low, high
        self.set_limit_pins(motor, 1, high)
        self.set_limit_pins(motor, 0, low)

    def limit_pins(self, motor, upper):
        """Return the pins of the limit switches at one end of a motor. upper: 1 or 0."""
        if self.shared:
            return self.shared.assigned[2 * motor + upper]
        return self.counting_pins(motor, upper)

    def set_limit_pins(self, motor, upper, pins):
        """Use these pins for the limit switches at one end of a motor. upper: 1 or 0."""
        if self.shared:
            self.shared.assigned[2 * motor + upper] = pins
            self.count_pins(motor, upper)
        else:
            self.words[_MOTORS + motor * _MOTOR_WORDS + _LOWER_PIN - upper] = pins

    def counting_pins(self, motor, upper):
        """Return those of these pins that count at present."""
        return self.words[_MOTORS + motor * _MOTOR_WORDS + _LOWER_PIN - upper]

    def count_pins(self, motor, upper):
        """Let only those of these pins count that are the switch of this end."""
        pins = self.shared.counting(motor, upper)
        self.words[_MOTORS + motor * _MOTOR_WORDS + _LOWER_PIN - upper] = pins

    def poll_shared(self):
        """Let both ends count for motors that have left one. Needed every few milliseconds."""
        if self.shared:
            self.shared.poll()

    def is_active(self, pins):
        """Return whether a switch at one of these pins is active."""
        return self.words[ACTIVE] & pins != 0

    def limit_blocking(self, motor, target, i):
        """Check whether an active limit keeps a motor (from 0) from going to target[i].

        Return OK, ERR_HARD_UP or ERR_HARD_LOW.
        """
        if self.words[ACTIVE] == 0:
            return results.OK
        self.axes[motor].position_to(self._here, 0)
        ends = self.active_limits(motor) & _limit_toward(target, i, self._here)
        if ends == 0:
            return results.OK
        return results.ERR_HARD_UP if ends == 1 else results.ERR_HARD_LOW

    @property
    def active(self):
        """Whether any switch is active."""
        return self.words[ACTIVE] != 0

    def active_limits(self, motor):
        """Return the active limits of a motor (from 0) and of its coupled motor: 1 upper, 2
        lower."""
        axis = self.axes[motor]
        ends = _ends(self.words, motor)
        if axis.partner:
            others = _ends(self.words, self._number(axis.partner))
            if axis.reversed:
                others = (others >> 1) | ((others & 1) << 1)
            ends |= others
        return ends

    def _number(self, axis):
        for i in range(self.axes.count):
            if self.axes[i] is axis:
                return i

    def _steady(self, levels):
        """Return the levels; a switch counts as active only if several readings find it so."""
        rest = self.words[REST]
        levels ^= rest
        for _ in range(_READINGS):
            levels &= self.hal.levels() ^ rest
        return levels ^ rest

    @micropython.viper
    def on_switch_change(self, _source):
        """Stop the motors that a changed switch concerns.

        Called in a hard interrupt. No tick comes meanwhile, so it looks up few attributes, and does
        nothing for a contact that bounces, or is one of several at once, if it has been dealt with.
        """
        words = self.words
        w = ptr32(words)
        levels = self._levels
        active = w[SWITCHES]
        n = 0
        while active and n <= _READINGS:
            active &= int(levels()) ^ w[REST]
            n += 1
        if active & (w[CAUGHT] ^ -1) == 0:
            return
        w[CAUGHT] = w[CAUGHT] | active
        bits = w[_EVERYONE]
        if active & w[_ESTOP]:
            header = self.header
            w[_MOVED] = w[_MOVED] | int(moving(header))
            h = ptr32(header)
            h[HELD] = 1
        else:
            bits = int(_approaching(words, active, _CAUGHT_UPPER))
            if bits == 0:
                return
            bits = int(coupled(self.block, bits))
        halt(self.block, bits, w[_STEEPEST], w[_FACTOR])

    def poll(self, now, levels):
        """Read the switches. Needed only while one is active, or has been until now.

        now: milliseconds modulo 2^29. levels: Hal.levels(). Return whether the caller has to act:
        `tripped` has become True, or a motor has come to a limit.
        """
        words = self.words
        levels = self._steady(levels)
        irq = self.hal.irq_off()
        _update(words, levels, now)
        if words[ACTIVE] & words[_ESTOP] == 0:
            self.header[HELD] = words[_MOVED] = 0
        self.hal.irq_on(irq)
        return self._judge(words)

    def _judge(self, words):
        """Update `tripped`, AT_UPPER and AT_LOWER. Return as in poll()."""
        news = False
        held = words[ACTIVE] & words[_ESTOP] != 0
        if held != self.tripped:
            self.tripped = held
            words[_DUE_ESTOP] = 1 if held else 0
            news = held
        _approaching(words, words[ACTIVE], _REACH_UPPER)
        for lower in range(2):
            bits = words[_REACH_UPPER + lower]
            fresh = bits & ~words[AT_UPPER + lower]
            words[AT_UPPER + lower] = bits
            if fresh:
                words[_DUE_UPPER + lower] |= fresh
                news = True
                if self.shared:
                    for motor in range(self.axes.count):
                        if (fresh >> motor) & 1:
                            self.shared.take(motor, 1 - lower, words[ACTIVE])
        return news

    @property
    def estop_held(self):
        """Return whether the E-stop is held, even if no pass has seen it yet."""
        return self.tripped or self.words[CAUGHT] & self.words[_ESTOP] != 0

    def motors_at_estop(self):
        """Return the motors that moved when the E-stop was pressed, a bit each."""
        return self.words[_MOVED]

    def motors_at_limit(self):
        """Return the motors to be stopped at a limit, a bit each; of coupled motors the leader."""
        bits = self.words[AT_UPPER] | self.words[AT_LOWER]
        motors = 0
        for i in range(self.axes.count):
            if (bits >> i) & 1:
                leader = self.axes[i].leader
                motors |= 1 << (self._number(leader) if leader else i)
        return motors

    def unreported(self):
        """Return what has stopped motors and has yet to be reported; -1: nothing.

        ESTOP; a motor (from 0) that has come to its upper limit; or LOWER plus a motor that has
        come to its lower one.
        """
        words = self.words
        if words[_DUE_ESTOP]:
            return ESTOP
        for lower in range(2):
            bits = words[_DUE_UPPER + lower]
            if bits:
                motor = 0
                while not (bits >> motor) & 1:
                    motor += 1
                return motor + LOWER * lower
        return -1

    def reported(self, what):
        """Note that a result of unreported() has been reported."""
        if what == ESTOP:
            self.words[_DUE_ESTOP] = 0
        else:
            lower = what // LOWER
            self.words[_DUE_UPPER + lower] &= ~(1 << what - LOWER * lower)

    def drop_limit_reports(self):
        """Drop the reports of stops at limits."""
        self.words[_DUE_UPPER] = self.words[_DUE_LOWER] = 0
