"""Stop inputs: the E-stop button and the hardware limit switches (field notes 3.3 and 8.4).

Every switch is one bit of the word that HAL.levels() gives. It counts as active at first sight, read
again three times against spikes, and as released once it has been so for RELEASE_MS.

A limit acts on the motors that SET_LIMITS has given its set: on one that moves toward it. The E-stop
acts on all, and while it is held nothing may move. It asks the motors to stop; it does not cut their power.

A change on a pin calls catch() in an interrupt, which makes motors slow down from the next tick on, all in
the same one, whatever the main loop is busy with. poll() then ends what they were doing, and tells the host.

Nothing allocates after construction.
"""

from array import array

from framestep import results
from framestep.clock import elapsed
from framestep.motion.stepper import DOWN as MOVING_DOWN
from framestep.motion.stepper import MODE, RUN, STOP, VELOCITY, halt_motors
from framestep.motors.axis import ACCELERATION_LIMIT, kernel_rate
from framestep.native import addressof, as_word, const, micropython, ptr32

RELEASE_MS = const(20)
_LOOKS = const(3)
ESTOP = const(24)  # of untold(): the E-stop has been pressed,
LOWER = const(12)  # and motor 0 at its lower limit, as in the bits of _approaching
_SLOWEST = const(4194)  # velocity that counts as motion: a step per second, Q22 steps per tick

# Words of Safety.words
SWITCHES = const(0)  # pins of all switches
REST = const(1)  # their levels while none is active
_SEEN = const(2)  # those active at the last look
ACTIVE = const(3)  # the same, held for RELEASE_MS
_SINCE = const(4)  # when _SEEN changed
CAUGHT = const(5)  # those that an interrupt has found active
_STRUCK = const(6)  # motors that it has stopped at a limit, as _approaching has them
_COUNT = const(7)  # motors; for each of them three words follow:
_MOTORS = const(8)
_BLOCK = const(0)  # address of its state block
_UP = const(1)  # pin of the limit switch at its upper end, or 0
_DOWN = const(2)
_MOTOR_WORDS = const(3)

_MOVES = const(RUN | STOP)  # modes


@micropython.viper
def _update(w: ptr32, levels: int, now: int) -> int:
    """Take in what has been seen and caught; the motors of _STRUCK. Interrupts are off."""
    seen = (levels ^ w[REST]) & w[SWITCHES]
    struck = w[_STRUCK]
    if (seen ^ w[_SEEN]) | w[CAUGHT]:
        w[_SEEN] = seen
        w[_SINCE] = now
    seen |= w[CAUGHT]
    w[CAUGHT] = 0
    w[_STRUCK] = 0
    if elapsed(now, w[_SINCE]) >= RELEASE_MS:
        w[ACTIVE] = seen
    else:
        w[ACTIVE] = w[ACTIVE] | seen
    return struck


@micropython.viper
def _catch(w: ptr32, levels: int) -> int:
    """Take in the levels seen in an interrupt: the switches active in them."""
    seen = (levels ^ w[REST]) & w[SWITCHES]
    w[CAUGHT] = w[CAUGHT] | seen
    return seen


@micropython.viper
def _approaching(w: ptr32, active: int) -> int:
    """Motors that move toward an active limit: bit 0 on for the upper end, bit LOWER on for the lower one."""
    bits = 0
    i = 0
    at = _MOTORS
    while i < w[_COUNT]:
        if (w[at + _UP] | w[at + _DOWN]) & active:
            block = ptr32(w[at + _BLOCK])
            if block[MODE] & _MOVES:
                # Both the velocity and the pulses: the end of a motion away may tremble within a step.
                v = block[VELOCITY]
                if v > _SLOWEST:
                    if w[at + _UP] & active and block[MOVING_DOWN] == 0:
                        bits |= 1 << i
                elif v < 0 - _SLOWEST:
                    if w[at + _DOWN] & active and block[MOVING_DOWN]:
                        bits |= 1 << (i + LOWER)
        at += _MOTOR_WORDS
        i += 1
    return bits


@micropython.viper
def _ends(w: ptr32, motor: int) -> int:
    """Active limits of a motor: 1 the upper one, 2 the lower one."""
    at = _MOTORS + motor * _MOTOR_WORDS
    active = w[ACTIVE]
    ends = 0
    if w[at + _UP] & active:
        ends = 1
    if w[at + _DOWN] & active:
        ends |= 2
    return ends


@micropython.viper
def _way(target: ptr32, i: int, place: ptr32) -> int:
    """The end that target[i] lies toward, as _ends has it; 0 where it is here."""
    if target[i + 0] > place[0]:
        return 1
    if target[i + 0] < place[0]:
        return 2
    return 0


class Safety:
    """The stop inputs of a rig."""

    def __init__(self, hal, rig, axes):
        self.hal = hal
        self.axes = axes
        self.factor = rig.hard_stop_factor
        self.words = words = array("i", [0] * (_MOTORS + _MOTOR_WORDS * axes.count))
        words[_COUNT] = axes.count
        for i in range(axes.count):
            words[_MOTORS + i * _MOTOR_WORDS] = as_word(addressof(axes[i].block))
        self.blocks = [axes[i].block for i in range(axes.count)]
        self.sets = [
            (self._switch(limit["high"], limit["contact"]), self._switch(limit["low"], limit["contact"]))
            for limit in rig.limits
        ]
        self._estop = 0
        if rig.estop != "none":
            self._estop = self._switch(hal.board["estop"], rig.estop)
        self._everyone = (1 << axes.count) - 1
        self._steepest = kernel_rate(ACCELERATION_LIMIT)
        self._place = array("i", [0])
        self.tripped = False  # the E-stop is held
        self.struck = 0  # motors that are being stopped at a limit, as _approaching has them
        # what is to be told
        self._say_estop = False
        self._say_struck = 0
        if self.words[SWITCHES]:
            hal.watch(self.words[SWITCHES], self.catch)

    def _switch(self, pin, contact):
        """Make a pin the input of a switch to ground; its bit."""
        if pin < 0:
            return 0
        bit = self.hal.input(pin, "up")
        self.words[SWITCHES] |= bit
        if contact == "no":
            self.words[REST] |= bit
        return bit

    def held(self, end):
        """Limit sets whose switch at an end (0 the upper, 1 the lower) is active, one bit each."""
        bits = 0
        for i in range(len(self.sets)):
            if self.sets[i][end] & self.words[ACTIVE]:
                bits |= 1 << i
        return bits

    def has(self, number):
        """Whether there is a limit set of this number; 0 stands for none."""
        return number <= len(self.sets)

    def assign(self, motor, number, swapped):
        """Give a motor (from 0) a limit set, or none (0). swapped: its two inputs change places."""
        high = 0
        low = 0
        if number:
            high, low = self.sets[number - 1]
            if swapped:
                high, low = low, high
        at = _MOTORS + motor * _MOTOR_WORDS
        self.words[at + _UP] = high
        self.words[at + _DOWN] = low

    def bars(self, motor, target, i):
        """OK, or why a motor (from 0) may not go to target[i] from where it is: ERR_HARD_UP or ERR_HARD_LOW."""
        if self.words[ACTIVE] == 0:
            return results.OK
        self.axes[motor].position_to(self._place, 0)
        ends = self.ends(motor) & _way(target, i, self._place)
        if ends == 0:
            return results.OK
        return results.ERR_HARD_UP if ends == 1 else results.ERR_HARD_LOW

    @property
    def active(self):
        """Whether any switch is."""
        return self.words[ACTIVE] != 0

    def ends(self, motor):
        """Ends at which a motor (from 0) or one coupled to it stands in a limit: bit 0 the upper, bit 1 the lower."""
        axis = self.axes[motor]
        ends = _ends(self.words, motor)
        if axis.partner:
            others = _ends(self.words, self._number(axis.partner))
            if axis.turned:
                others = others >> 1 | (others & 1) << 1
            ends |= others
        return ends

    def _number(self, axis):
        for i in range(self.axes.count):
            if self.axes[i] is axis:
                return i

    def _steady(self, levels):
        """The levels, in which a switch is active only if it is so at each of some looks."""
        rest = self.words[REST]
        levels ^= rest
        for _ in range(_LOOKS):
            levels &= self.hal.levels() ^ rest
        return levels ^ rest

    def catch(self, _source):
        """A switch has changed. From a hard interrupt, for which it takes long: some tenths of a millisecond."""
        words = self.words
        active = _catch(words, self._steady(self.hal.levels()))
        if active & self._estop:
            halt_motors(self.blocks, self._everyone, self.factor, self._steepest)
        elif active:
            bits = _approaching(words, active)
            if bits:
                words[_STRUCK] |= bits
                halt_motors(self.blocks, self._coupled(bits), self.factor, self._steepest)

    def poll(self, now, levels):
        """Look at the switches, while one is or was active. Whether there is news.

        now: milliseconds modulo 2^29, levels: HAL.levels(). The news is for the caller to act on: `tripped` has
        become True, or motors have come into `struck`.
        """
        words = self.words
        levels = self._steady(levels)
        irq = self.hal.irq_off()
        bits = _update(words, levels, now)
        self.hal.irq_on(irq)
        return self._judge(words, bits)

    def _judge(self, words, bits):
        """What has changed with what is active now, and motors of _STRUCK. Whether there is news."""
        news = False
        held = words[ACTIVE] & self._estop != 0
        if held != self.tripped:
            self.tripped = held
            self._say_estop = held
            news = held
        bits |= _approaching(words, words[ACTIVE])
        fresh = bits & ~self.struck
        self.struck = bits
        if fresh:
            self._say_struck |= fresh
            news = True
        return news

    def _coupled(self, bits):
        """The motors of such bits and those coupled to them, one bit each."""
        bits |= bits >> LOWER
        motors = 0
        for i in range(self.axes.count):
            if bits >> i & 1:
                motors |= 1 << i
                other = self.axes[i].leader or self.axes[i].partner
                if other:
                    motors |= 1 << self._number(other)
        return motors

    def struck_motors(self):
        """Motors to be stopped at a limit, one bit each; of coupled ones the leader."""
        bits = self.struck | self.struck >> LOWER
        motors = 0
        for i in range(self.axes.count):
            if bits >> i & 1:
                leader = self.axes[i].leader
                motors |= 1 << (self._number(leader) if leader else i)
        return motors

    def untold(self):
        """What has stopped motors and has not been told, in turn: ESTOP, a motor (from 0) that has come to its upper
        limit, LOWER and a motor that has come to its lower one; -1: nothing more."""
        if self._say_estop:
            return ESTOP
        bits = self._say_struck
        if bits:
            for i in range(2 * LOWER):
                if bits >> i & 1:
                    return i
        return -1

    def told(self, what):
        """What untold() has given has been told."""
        if what == ESTOP:
            self._say_estop = False
        else:
            self._say_struck &= ~(1 << what)

    def forget_limits(self):
        """What limits have stopped need not be told any more."""
        self._say_struck = 0
