"""A pulse engine that is a stream of words in memory: a bit for each pin, a word for each 4 µs.

For chips that can send memory to their pins at a fixed rate but cannot interrupt at 1 kHz. The main
loop calls `fill` when there is room for some ticks. For each tick `fill` runs the kernel, whose
commands go to a ring for each motor, and then paints the engine's edges of that tick into words.

Time runs by the words. The kernel's clock is moved on here, so a tick is never late unless the
words ran out. `miss` reports that, and the kernel reacts as to any engine that has run dry.

A tick's pulses are in the words painted after the next tick, because a direction may have to change
before its pulse.
"""

from array import array

from framestep.base.clock import WIDE_WRAP
from framestep.base.native import addressof, as_word, const, micropython, ptr32
from framestep.pulse.engine import (
    COMMANDS,
    CYCLES,
    DIRECTION,
    GAP,
    LEAD,
    PULSES,
    WIDTH,
    WORD_BITS,
    WORDS,
)
from framestep.pulse.stepper import BEHIND, TICK_US

_LONG_AGO = const(-0x100000)  # before any edge from which a command may still count

# Words of a motor
_STEP = const(0)  # the bits of its step pin
_TURN = const(1)  # and direction pin
_RING = const(2)  # address of its commands
_TAKEN = const(3)  # commands taken, modulo 2^30
_AT = const(4)  # cycles from the first word to be painted to the last rising edge
_LEFT = const(5)  # pulses left of the present command
_PERIOD = const(6)
_HIGH = const(7)  # words of a pulse
_TURNS = const(8)  # the present command has yet to change the direction
_REST = const(9)  # words of a pulse that extend into those to be painted
_MOTOR = const(4)  # log2 of the words of a motor


@micropython.viper
def paint(words: ptr32, first: int, motors: ptr32, count: int, levels: ptr32) -> int:
    """Paint a tick's words from words[first] on. Return the motors that lost a command, a bit each.

    motors: the words of `count` motors, as above. levels: a word with the levels of all pins, in
    which steps are 0.
    """
    i = first
    base = levels[0]
    while i < first + WORDS:
        words[i] = base
        i += 1
    lost = 0
    motor = 0
    while motor < count:
        k = motor << _MOTOR
        step = motors[k + _STEP]
        turn = motors[k + _TURN]
        ring = ptr32(motors[k + _RING])
        taken = motors[k + _TAKEN]
        at = motors[k + _AT]
        left = motors[k + _LEFT]
        period = motors[k + _PERIOD]
        high = motors[k + _HIGH]
        i = first
        rest = motors[k + _REST]
        while rest:
            words[i] = words[i] | step
            i += 1
            rest -= 1
        if (ring[COMMANDS] - taken) & WIDE_WRAP > COMMANDS:
            lost |= 1 << motor
            taken = (ring[COMMANDS] - COMMANDS) & WIDE_WRAP
        while True:
            if left == 0:
                if taken == ring[COMMANDS]:
                    break
                command = ring[taken & (COMMANDS - 1)]
                taken = (taken + 1) & WIDE_WRAP
                wider = (command >> WIDTH) & 15
                high = wider + 1
                motors[k + _HIGH] = high
                wider = wider << WORD_BITS
                if at + wider < 0:
                    at = 0 - wider  # the engine has been idle until now
                left = (command >> PULSES) & 0x1FF
                period = (command >> GAP) & 0x3FFFF
                if left == 0:
                    at += period
                    continue
                period += wider
                motors[k + _TURNS] = 0
                if levels[0] & turn:
                    if command & DIRECTION == 0:
                        motors[k + _TURNS] = 1
                elif command & DIRECTION:
                    motors[k + _TURNS] = 1
            if motors[k + _TURNS]:
                i = (at >> WORD_BITS) + high  # the last pulse has ended
                if i >= WORDS:
                    break
                i += first
                while i < first + WORDS:
                    words[i] = words[i] ^ turn
                    i += 1
                levels[0] = levels[0] ^ turn
                motors[k + _TURNS] = 0
            i = (at + period) >> WORD_BITS
            if i >= WORDS:
                break
            at += period
            left -= 1
            n = i + high
            if n > WORDS:
                rest = n - WORDS
                n = WORDS
            n += first
            i += first
            while i < n:
                words[i] = words[i] | step
                i += 1
        motors[k + _TAKEN] = taken
        at -= CYCLES
        if at < _LONG_AGO:
            at = _LONG_AGO
        motors[k + _AT] = at
        motors[k + _LEFT] = left
        motors[k + _PERIOD] = period
        motors[k + _REST] = rest
        motor += 1
    return lost


class Stream:
    """The engine of some motors. steps, turns: for each of them, the bits of its step and its
    direction pin.

    Bits are below 2^30. Nothing allocates after construction.
    """

    def __init__(self, steps, turns):
        self.motors = len(steps)
        self._clock = array("i", [0])
        self._levels = array("i", [0])
        self._rings = [array("i", [0] * (COMMANDS + 1)) for _ in steps]
        self._words = array("i", [0] * (self.motors << _MOTOR))
        for i in range(self.motors):
            k = i << _MOTOR
            self._words[k + _STEP] = steps[i]
            self._words[k + _TURN] = turns[i]
            self._words[k + _RING] = as_word(self.fifo(i))
        self._kernel = None
        self._lost = 0

    @property
    def clock(self):
        """Address of the clock for StepKernel."""
        return addressof(self._clock)

    def fifo(self, motor):
        """Address of a motor's ring, for StepKernel.configure()."""
        return addressof(self._rings[motor])

    def attach(self, kernel, ahead):
        """Run this kernel. ahead: ticks that may wait in memory to be sent, at most; see
        stepper.BEHIND."""
        self._kernel = kernel
        kernel.outputs(addressof(self._levels), addressof(self._levels))
        kernel.state[BEHIND] = LEAD + ahead

    def drive(self, high, low):
        """Raise and lower the pins of these bits, from the words painted next on."""
        self._levels[0] = (self._levels[0] | high | low) ^ low

    def fill(self, words, ticks, at=0):
        """Do `ticks` ticks, which fill ticks · WORDS words of the array, from words[at] on."""
        while ticks:
            self._kernel.tick(None)
            self._clock[0] = (self._clock[0] + TICK_US) & WIDE_WRAP
            self._lost |= paint(words, at, self._words, self.motors, self._levels)
            at += WORDS
            ticks -= 1

    def miss(self, words, ticks, at=0):
        """Report that the words ran out for `ticks` ticks, including begun ones. Paint the words of
        the first tick after that, from words[at] on.

        They have the pulses that the motors still have to make. Whatever moves faults and ramps
        down at the next tick.
        """
        self._lost |= paint(words, at, self._words, self.motors, self._levels)
        self._clock[0] = (self._clock[0] + (ticks + 1) * TICK_US) & WIDE_WRAP

    def take_lost_commands(self):
        """Return the motors that have lost a command since the last call, a bit each."""
        lost = self._lost
        self._lost = 0
        return lost
