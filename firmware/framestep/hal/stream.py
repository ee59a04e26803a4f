"""A pulse engine that is a stream of words in memory, one for each 4 µs.

For motors behind shift registers, to which the chip sends memory at a fixed rate, as an ESP32 does
by I2S (hal/esp32/chain.py). The sender calls `fill` for each tick that there is room for. That runs
the kernel, whose commands go to a ring for each motor, and then paints the engine's edges of that
tick into words.

The build puts a word's form into the code. That of I2S is a frame of two 16-bit samples in Philips
format. Its data leaves a clock late, and what is behind it latches in the middle of a frame. So
level n is bit n + 1, and levels from EARLY on are a word earlier than the others. No level above 29
is used.

Time runs by the words. The kernel's clock is moved on here, so a tick is never late unless the
words ran out. `miss` reports that, and the kernel reacts as to any engine that has run dry.

A tick's pulses are in the words painted after the next tick, because a direction may have to change
before its pulse.
"""

from array import array

from framestep.base.clock import WIDE_WRAP
from framestep.base.native import addressof, as_word, const, micropython, ptr32
from framestep.pulse.engine import (  # type: ignore[attr-defined]
    COMMANDS,
    CYCLES,
    DIRECTION,
    EARLY,
    GAP,
    LEAD,
    OUTPUTS_IN_WORD,
    PULSES,
    SHIFT,
    WIDTH,
    WORD_BITS,
    WORDS,
)
from framestep.pulse.stepper import BEHIND, TICK_US

_UPPER = const(-0x10000)  # bits of early levels in a word
_LONG_AGO = const(-0x100000)  # before any edge from which a command may still count

# Words of a motor
NEXT = const(0)  # address of the next motor's words, or 0
_STEP = const(1)  # its step pin's bit in a word
_TURN = const(2)  # the level of its direction pin
_RING = const(3)  # address of its commands
_TAKEN = const(4)  # commands taken, modulo 2^30
_AT = const(5)  # cycles from the first word to be painted to the last rising edge
_LEFT = const(6)  # pulses left of the present command
_PERIOD = const(7)
_HIGH = const(8)  # words of a pulse
_TURNS = const(9)  # the present command has yet to change the direction
REST = const(10)  # words of a pulse that extend into those to be painted
_BEFORE = const(11)  # words by which its step leaves early
_MOTOR_WORDS = const(12)

# Words of the stream itself
LEVELS = const(0)  # of all pins; steps are 0
FIRST = const(1)  # address of the first motor's words
CLOCK = const(2)  # address of the kernel's clock
_LOST = const(3)  # motors that have lost a command, a bit each
_STREAM_WORDS = const(4)


@micropython.viper
def paint(at: int, step: int, words: ptr32, stream: ptr32):
    """Paint a tick's words from words[at] on, its early levels from the word before on, and move
    the clock on.

    stream, and the motors that it leads to: words as above. What `step` is does not matter.
    """
    # The compiler keeps the first two variables in registers, so these are the ones that the loops
    # over words and pulses use most.
    clock = ptr32(stream[CLOCK])
    clock[0] = (clock[0] + TICK_US) & WIDE_WRAP
    first = at
    end = at + WORDS
    step = stream[LEVELS] << SHIFT
    if EARLY:
        words[at - 1] = words[at - 1] | (step & _UPPER)
    while at < end:
        words[at] = step
        words[at + 1] = step
        words[at + 2] = step
        words[at + 3] = step
        words[at + 4] = step
        words[at + 5] = step
        words[at + 6] = step
        words[at + 7] = step
        words[at + 8] = step
        words[at + 9] = step
        at += 10
    if EARLY:
        words[at - 1] = step & ~_UPPER
    motor = 1
    address = stream[FIRST]
    while address:
        m = ptr32(address)
        address = m[NEXT]
        step = m[_STEP]
        ring = ptr32(m[_RING])
        put = ring[COMMANDS]
        taken = m[_TAKEN]
        left = m[_LEFT]
        period = m[_PERIOD]
        high = m[_HIGH]
        rest = m[REST]
        begin = first
        if EARLY:
            begin -= m[_BEFORE]
        at = begin
        while rest:
            words[at] = words[at] | step
            at += 1
            rest -= 1
        begin = begin << WORD_BITS
        end = begin + CYCLES
        at = begin + m[_AT]
        if (put - taken) & WIDE_WRAP > COMMANDS:
            stream[_LOST] = stream[_LOST] | motor
            taken = (put - COMMANDS) & WIDE_WRAP
        motor = motor << 1
        while True:
            if left:
                pass
            else:
                if taken == put:
                    break
                command = ring[taken & (COMMANDS - 1)]
                taken = (taken + 1) & WIDE_WRAP
                wider = (command >> WIDTH) & 15
                high = wider + 1
                wider = wider << WORD_BITS
                if at + wider < begin:
                    at = begin - wider  # the engine has been idle until now
                left = (command >> PULSES) & 0x1FF
                period = (command >> GAP) & 0x3FFFF
                if left:
                    pass
                else:
                    at += period
                    continue
                period += wider
                m[_TURNS] = 0
                if stream[LEVELS] & m[_TURN]:
                    if command & DIRECTION == 0:
                        m[_TURNS] = 1
                elif command & DIRECTION:
                    m[_TURNS] = 1
            if m[_TURNS]:
                i = ((at - begin) >> WORD_BITS) + high  # the last pulse has ended
                if i >= WORDS:
                    break
                turn = m[_TURN] << SHIFT
                i += first
                till = first + WORDS
                if EARLY:
                    if turn & _UPPER:
                        i -= 1
                        till -= 1
                while i < till:
                    words[i] = words[i] ^ turn
                    i += 1
                stream[LEVELS] = stream[LEVELS] ^ m[_TURN]
                m[_TURNS] = 0
            if at + period >= end:
                break
            pulses = left
            if at + left * period >= end:
                pulses = (end - 1 - at) // period
            left -= pulses
            before = at
            i = high
            while i:  # the pulses' last words, ..., their first words
                i -= 1
                at = (i << WORD_BITS) + before
                n = pulses
                if at + n * period >= end:
                    n -= 1  # of the last pulse, this word is in the next tick
                fours = n >> 2
                while fours:
                    at = period + at
                    words[at >> WORD_BITS] = words[at >> WORD_BITS] | step
                    at = period + at
                    words[at >> WORD_BITS] = words[at >> WORD_BITS] | step
                    at = period + at
                    words[at >> WORD_BITS] = words[at >> WORD_BITS] | step
                    at = period + at
                    words[at >> WORD_BITS] = words[at >> WORD_BITS] | step
                    fours -= 1
                n = n & 3
                while n:
                    at = period + at
                    words[at >> WORD_BITS] = words[at >> WORD_BITS] | step
                    n -= 1
            rest = ((at - end) >> WORD_BITS) + high
            if rest < 0:
                rest = 0
        at -= end
        if at < _LONG_AGO:
            at = _LONG_AGO
        m[_TAKEN] = taken
        m[_AT] = at
        m[_LEFT] = left
        m[_PERIOD] = period
        m[_HIGH] = high
        m[REST] = rest


class Stream:
    """The engine of some motors. steps, turns: for each of them, its step and its direction pin, a
    bit each.

    Bits are those of the levels. Nothing allocates after construction.
    """

    def __init__(self, steps, turns):
        self.motors = len(steps)
        self._clock = array("i", [0])
        self._rings = [array("i", [0] * (COMMANDS + 1)) for _ in steps]
        self._steps = [as_word(bit << SHIFT) for bit in steps]  # as in a word
        self._motors = [array("i", [0] * _MOTOR_WORDS) for _ in steps]
        following = 0
        for i in range(self.motors - 1, -1, -1):
            words = self._motors[i]
            words[NEXT] = following
            words[_STEP] = self._steps[i]
            words[_TURN] = as_word(turns[i])
            words[_RING] = as_word(self.fifo(i))
            words[_BEFORE] = int(EARLY and steps[i] >> EARLY > 0)
            following = as_word(addressof(words))
        self._words = array("i", [0] * _STREAM_WORDS)
        self._words[FIRST] = following
        self._words[CLOCK] = as_word(addressof(self._clock))
        self._tick = None

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
        self._tick = kernel.tick
        if OUTPUTS_IN_WORD:
            levels = addressof(self._words)
            kernel.outputs(levels, levels)
        kernel.state[BEHIND] = LEAD + ahead

    def drive(self, high, low):
        """Raise and lower the pins of these bits, from the words painted next on."""
        self._words[LEVELS] = (self._words[LEVELS] | high | low) ^ low

    def mute(self, on):
        """Leave the pulses out of the words painted next, or no longer."""
        i = 0
        while i < self.motors:
            self._motors[i][_STEP] = 0 if on else self._steps[i]
            i += 1

    def fill(self, words, at):
        """Do a tick and paint its WORDS words, from words[at] on.

        Its early levels go one word further to the front: the first into words[at - 1], and the
        last word's come with the next tick.
        """
        self._tick(None)
        paint(at, 0, words, self._words)

    def miss(self, words, ticks, at):
        """Report that the words ran out for `ticks` ticks, including begun ones. Paint the words of
        the first tick after that, from words[at] on.

        They have the pulses that the motors still have to make. Whatever moves faults and ramps
        down at the next tick.
        """
        paint(at, 0, words, self._words)
        self._clock[0] = (self._clock[0] + ticks * TICK_US) & WIDE_WRAP

    def take_lost_commands(self):
        """Return the motors that have lost a command since the last call, a bit each."""
        lost = self._words[_LOST]
        self._words[_LOST] = 0
        return lost
