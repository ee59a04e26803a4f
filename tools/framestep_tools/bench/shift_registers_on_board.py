"""A pulse engine for more motors than a Pico 2 has state machines, as a prototype: PIO sends words
to chains of 74HC595, sixteen motors each. Runs on the emulated board, for shift_registers.py.

A word of 32 levels lasts 4 µs: bit 2n is the step of a chain's motor n, bit 2n + 1 its direction.
The tick and its commands are those of the ESP32's engine (hal/stream.py). `paint` is its painting,
copied, without what I2S demands. DMA plays a ring of BLOCKS ticks, and interrupts as each begins.
The interrupt does a tick and paints its words.

A played block is filled with zeros by DMA itself. So words are played once, however late the
interrupt comes; a ring that has run dry is silent. The program sends zeros, too, if DMA ends.
"""

# The words and types of kernels and PIO programs: see tools/check_types.py
# mypy: ignore-errors
# ruff: noqa: F821

from array import array

import machine
import rp2
from machine import Pin, mem32

from framestep.base.clock import WIDE_WRAP
from framestep.base.native import addressof, as_word, const, micropython, ptr32
from framestep.hal.rp2 import chip
from framestep.motors.axes import Axes
from framestep.pulse.engine import (  # type: ignore[attr-defined]
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
from framestep.pulse.kernel import StepKernel
from framestep.pulse.stepper import BEHIND, FAULTS, MODE, POSITION, TICK_US

CHAIN = const(16)  # motors of a chain
BLOCKS = const(4)  # of a ring, a tick each
AHEAD = const(3)  # painted ones, with the one that is played
_SETUP_US = const(5)
_CLOCK_HZ = const(20000000)  # of the program: 80 cycles for a word, whole at 125, 150, 200 MHz
_DMA = const(0x50000000)
_CHANNEL = const(0x40)
_READ_TRIGGER = const(0x3C)
_WRITE_TRIGGER = const(0x2C)
_PIO = const(0x50200000)
_TXF = const(0x10)
_LONG_AGO = const(-0x100000)

# Words of a motor
_NEXT = const(0)
_STEP = const(1)
_TURN = const(2)
_RING = const(3)
_TAKEN = const(4)
_AT = const(5)
_LEFT = const(6)
_PERIOD = const(7)
_HIGH = const(8)
_TURNS = const(9)
_REST = const(10)
_MOTOR_WORDS = const(11)

# Words of a chain
_LEVELS = const(0)
_FIRST = const(1)
_LOST = const(2)
_WORDS = const(3)  # address of its ring's words
_FOLLOWING = const(4)  # address of the next chain's words, or 0
_CHAIN_WORDS = const(5)

# Words of the feeder
_CLOCK = const(0)  # of the kernel
_TABLE = const(1)  # address of the first block's address
_PLAYED = const(2)  # address of the register that shows which block is played next
_PAINT = const(3)  # block to be painted next
_SEEN = const(4)  # when the interrupt came last
_MISSES = const(5)
_CHAINS = const(6)
_PAINTED_US = const(7)
_TICKED_US = const(8)
_FEED_WORDS = const(9)


@rp2.asm_pio(
    out_init=rp2.PIO.OUT_LOW,
    sideset_init=(rp2.PIO.OUT_LOW, rp2.PIO.OUT_LOW),
    out_shiftdir=rp2.PIO.SHIFT_LEFT,
    fifo_join=rp2.PIO.JOIN_TX,
)
def words_out():
    wrap_target()
    pull(noblock).side(0)  # X, which is 0, if there is none
    set(y, 31).side(0)[6]
    label("bit")
    out(pins, 1).side(0)
    jmp(y_dec, "bit").side(1)  # the registers' clock
    nop().side(2)[7]  # and their latch
    wrap()


@micropython.viper
def paint(at: int, step: int, words: ptr32, stream: ptr32):
    """Paint a tick's words of a chain from words[at] on. What `step` is does not matter."""
    first = at
    end = at + WORDS
    step = stream[_LEVELS]
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
    motor = 1
    begin = first << WORD_BITS
    end = begin + CYCLES
    address = stream[_FIRST]
    while address:
        m = ptr32(address)
        address = m[_NEXT]
        step = m[_STEP]
        ring = ptr32(m[_RING])
        put = ring[COMMANDS]
        taken = m[_TAKEN]
        left = m[_LEFT]
        period = m[_PERIOD]
        high = m[_HIGH]
        rest = m[_REST]
        at = first
        while rest:
            words[at] = words[at] | step
            at += 1
            rest -= 1
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
                    at = begin - wider
                left = (command >> PULSES) & 0x1FF
                period = (command >> GAP) & 0x3FFFF
                if left:
                    pass
                else:
                    at += period
                    continue
                period += wider
                m[_TURNS] = 0
                if stream[_LEVELS] & m[_TURN]:
                    if command & DIRECTION == 0:
                        m[_TURNS] = 1
                elif command & DIRECTION:
                    m[_TURNS] = 1
            if m[_TURNS]:
                i = ((at - begin) >> WORD_BITS) + high
                if i >= WORDS:
                    break
                turn = m[_TURN]
                i += first
                till = first + WORDS
                while i < till:
                    words[i] = words[i] ^ turn
                    i += 1
                stream[_LEVELS] = stream[_LEVELS] ^ turn
                m[_TURNS] = 0
            if at + period >= end:
                break
            pulses = left
            if at + left * period >= end:
                pulses = (end - 1 - at) // period
            left -= pulses
            before = at
            i = high
            while i:
                i -= 1
                at = (i << WORD_BITS) + before
                n = pulses
                if at + n * period >= end:
                    n -= 1
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
        m[_REST] = rest


@micropython.viper
def hold(stream: ptr32, at: int):
    """Paint a block without pulses. A pulse that has been cut off counts as made."""
    words = ptr32(stream[_WORDS])
    end = at + WORDS
    while at < end:
        words[at] = stream[_LEVELS]
        at += 1
    a = stream[_FIRST]
    while a:
        m = ptr32(a)
        a = m[_NEXT]
        m[_REST] = 0


class Feed(array):
    """The feeder's words, with the interrupt as a method."""

    @micropython.viper
    def serve(m: ptr32, _dma):
        timer = ptr32(chip.MICROSECONDS)
        clock = ptr32(m[_CLOCK])
        now = timer[0]
        gone = (now - m[_SEEN]) & WIDE_WRAP
        m[_SEEN] = now
        played = ptr32(m[_PLAYED])
        current = ((played[0] - m[_TABLE]) >> 2) - 1
        lead = (m[_PAINT] - current) & (BLOCKS - 1)
        if lead == 0 or gone > AHEAD * TICK_US:
            # The ring has run dry. Levels first, so that directions are there before a pulse.
            m[_MISSES] = m[_MISSES] + 1
            lead = 2
            m[_PAINT] = (current + 1) & (BLOCKS - 1)
            a = m[_CHAINS]
            while a:
                chain = ptr32(a)
                hold(a, m[_PAINT] * WORDS)
                a = chain[_FOLLOWING]
            m[_PAINT] = (m[_PAINT] + 1) & (BLOCKS - 1)
            clock[0] = (gone // TICK_US * TICK_US + clock[0]) & WIDE_WRAP
        while lead < AHEAD:
            lead += 1
            now = timer[0]
            tick(None)
            m[_TICKED_US] = timer[0] - now + m[_TICKED_US]
            now = timer[0]
            clock[0] = (clock[0] + TICK_US) & WIDE_WRAP
            a = m[_CHAINS]
            while a:
                chain = ptr32(a)
                paint(m[_PAINT] * WORDS, 0, chain[_WORDS], a)
                a = chain[_FOLLOWING]
            m[_PAINT] = (m[_PAINT] + 1) & (BLOCKS - 1)
            m[_PAINTED_US] = timer[0] - now + m[_PAINTED_US]


def aligned(words):
    """Return the address of an array's first word whose address is a multiple of 16."""
    return (addressof(words) + 15) & -16


class Chain:
    """Words, program and DMA of a chain for some motors. pins: data, clock, latch."""

    def __init__(self, number, motors, pins):
        self.rings = [array("i", [0] * (COMMANDS + 1)) for _ in range(motors)]
        self.motors = [array("i", [0] * _MOTOR_WORDS) for _ in range(motors)]
        following = 0
        for i in range(motors - 1, -1, -1):
            words = self.motors[i]
            words[_NEXT] = following
            words[_STEP] = as_word(1 << 2 * i)
            words[_TURN] = as_word(2 << 2 * i)
            words[_RING] = as_word(addressof(self.rings[i]))
            following = as_word(addressof(words))
        self.ring = array("i", [0] * (BLOCKS * WORDS))
        self.words = array("i", [0] * _CHAIN_WORDS)
        self.words[_FIRST] = following
        self.words[_WORDS] = as_word(addressof(self.ring))
        self.number = number
        self.machine = rp2.StateMachine(
            number,
            words_out,
            freq=_CLOCK_HZ,
            out_base=Pin(pins[0]),
            sideset_base=Pin(pins[1]),
        )
        self.machine.exec("set(x, 0)")
        self._make_dma()

    def _make_dma(self):
        play, aim, wipe, move = [rp2.DMA() for _ in range(4)]
        self.dma = (play, aim, wipe, move)
        self._table = array("i", [0] * 8)
        self.table = aligned(self._table)
        for i in range(BLOCKS):
            mem32[self.table + 4 * i] = addressof(self.ring) + 4 * WORDS * i
        self._nothing = array("i", [0])
        request = self.number  # of PIO 0: DREQ_PIO0_TX0 is 0
        play.config(
            read=addressof(self.ring),
            write=_PIO + _TXF + 4 * self.number,
            count=WORDS,
            ctrl=play.pack_ctrl(inc_write=False, treq_sel=request, chain_to=aim.channel),
        )
        aim.config(
            read=self.table,
            write=_DMA + _CHANNEL * wipe.channel + _WRITE_TRIGGER,
            count=1,
            ctrl=aim.pack_ctrl(inc_write=False, ring_size=4, ring_sel=False),
        )
        wipe.config(
            read=addressof(self._nothing),
            write=addressof(self.ring),
            count=WORDS,
            ctrl=wipe.pack_ctrl(inc_read=False, chain_to=move.channel),
        )
        move.config(
            read=self.table + 4,
            write=_DMA + _CHANNEL * play.channel + _READ_TRIGGER,
            count=1,
            ctrl=move.pack_ctrl(inc_write=False, ring_size=4, ring_sel=False, irq_quiet=False),
        )


class Board:
    """As much of a HAL as axes need. pins: three for each chain."""

    def __init__(self, motors, pins):
        global tick
        self.port = self
        self._clock = array("i", [0])
        self.kernel = StepKernel(motors, CYCLES, addressof(self._clock))
        self.kernel.state[BEHIND] = LEAD + AHEAD
        tick = self.kernel.tick
        self.chains = []
        feed = self.feed = Feed("i", [0] * _FEED_WORDS)
        following = 0
        for number in range((motors - 1) // CHAIN, -1, -1):
            count = min(CHAIN, motors - CHAIN * number)
            chain = Chain(number, count, pins[3 * number : 3 * number + 3])
            chain.words[_FOLLOWING] = following
            following = as_word(addressof(chain.words))
            self.chains.insert(0, chain)
        for i in range(motors):
            ring = self.chains[i // CHAIN].rings[i % CHAIN]
            setup = _SETUP_US * CYCLES // TICK_US
            self.kernel.configure(i, addressof(ring), 0, setup, False)
        move = self.chains[0].dma[3]
        feed[_CHAINS] = following
        feed[_CLOCK] = as_word(addressof(self._clock))
        feed[_TABLE] = self.chains[0].table
        feed[_PLAYED] = _DMA + _CHANNEL * move.channel
        feed[_PAINT] = AHEAD - 1
        feed[_SEEN] = mem32[chip.MICROSECONDS] & WIDE_WRAP
        move.irq(feed.serve, hard=True)
        for chain in self.chains:
            chain.dma[0].active(1)
        mem32[_PIO] = mem32[_PIO] | ((1 << len(self.chains)) - 1)
        self.axes = Axes(self)

    def glance(self):
        """As a port: no questions come."""

    irq_off = staticmethod(machine.disable_irq)
    irq_on = staticmethod(machine.enable_irq)

    def state(self):
        """Return what tests look at: positions, modes, faults, lost commands, misses."""
        blocks = self.kernel.blocks
        return (
            [b[POSITION] for b in blocks],
            [b[MODE] for b in blocks],
            self.kernel.state[FAULTS],
            [chain.words[_LOST] for chain in self.chains],
            self.feed[_MISSES],
        )

    def times(self):
        """Return the µs spent on ticks and on painting, and begin again."""
        found = self.feed[_TICKED_US], self.feed[_PAINTED_US]
        self.feed[_TICKED_US] = self.feed[_PAINTED_US] = 0
        return found
