"""Pulse engine of an RP2350 for motors behind a chain of 74HC595: PIO and DMA send the words of
hal/stream.py, a word of 32 levels each 4 µs. In an image with this engine the build puts this
module in the place of pulses.py.

Bit n of a word is output n of the chain, counted from its first stage. DMA plays a ring of BLOCKS
ticks, and interrupts as each begins. The interrupt does a tick and paints its words. Words follow
the system clock, so the kernel's clock is moved on with them.

Nothing steps by itself. DMA fills a played block with zeros, so no word is played twice: if the
interrupt comes too late, the ring runs dry, and all steps stay low. The next interrupt reports
that, and whatever moves faults and ramps down. The program sends zeros if its FIFO is empty, so all
outputs are low 40 µs after DMA has ended (soft_reset.py).
"""

from array import array

import rp2
from machine import Pin, mem32

from framestep.base.clock import WIDE_WRAP
from framestep.base.native import addressof, as_word, const, micropython, ptr32
from framestep.hal.rp2 import chip
from framestep.hal.rp2.painted import paint  # paint.c, compiled
from framestep.hal.rp2.pin_guard import Claim
from framestep.hal.rp2.stack import unchecked
from framestep.hal.stream import CLOCK, FIRST, LEVELS, NEXT, REST, Stream
from framestep.pulse.engine import AHEAD, CYCLES, WORDS  # type: ignore[attr-defined]
from framestep.pulse.kernel import StepKernel
from framestep.pulse.stepper import RUNNING, SPENT, TICK_US, WORST_LATE

_FIRST_PIN = const(64)  # number of output 0 in a board's data
BLOCKS = const(4)  # of the ring
_CLOCK_HZ = const(20000000)  # of the program, 80 cycles for a word
_WORD_US = const(4)
_DMA = const(0x50000000)
_CHANNEL = const(0x40)
_COUNT = const(0x08)  # registers of a channel
_WRITE_TRIGGER = const(0x2C)
_READ_TRIGGER = const(0x3C)
_PIO = const(0x50200000)
_TXF = const(0x10)

# Words of the feeder
_HEADER = const(0)  # addresses: of the tick's header, of the stream's words, of the ring
_STREAM = const(1)
_RING = const(2)
_TABLE = const(3)  # address of the first block's address
_FOLLOWING = const(4)  # of the register that shows where the next block's address is
_LEFT = const(5)  # of the register that counts the words left of the present block
_PAINT = const(6)  # block to be painted next
_SEEN = const(7)  # when the interrupt came last
_FEED_WORDS = const(8)

_CLEAR_X = const(0xE020)  # the instruction set(x, 0)

_stream = None
_tick = None


@rp2.asm_pio(
    out_init=rp2.PIO.OUT_LOW,
    sideset_init=[rp2.PIO.OUT_LOW, rp2.PIO.OUT_LOW],
    out_shiftdir=rp2.PIO.SHIFT_LEFT,
    fifo_join=rp2.PIO.JOIN_TX,
)
def send_words():
    wrap_target()
    pull(noblock).side(0)  # X, which is 0, if there is none
    set(y, 31).side(0)[6]
    label("bit")
    out(pins, 1).side(0)
    jmp(y_dec, "bit").side(1)  # the registers' clock
    nop().side(2)[7]  # and their latch
    wrap()


@micropython.viper
def hold(words: ptr32, at: int, stream: ptr32, ticks: int):
    """Paint a tick's words without pulses from words[at] on, and move the clock on by `ticks` more
    ticks. A pulse that has been cut off counts as made."""
    clock = ptr32(stream[CLOCK])
    clock[0] = (ticks * TICK_US + clock[0]) & WIDE_WRAP
    end = at + WORDS
    while at < end:
        words[at] = stream[LEVELS]
        at += 1
    a = stream[FIRST]
    while a:
        m = ptr32(a)
        a = m[NEXT]
        m[REST] = 0


class Feed(array):
    """The feeder's words, with the interrupt as a method, as pulse.tick.Header."""

    @micropython.viper
    def serve(m: ptr32, _dma):
        timer = ptr32(chip.MICROSECONDS)
        h = ptr32(m[_HEADER])
        begun = timer[0]
        since = (begun - m[_SEEN]) & WIDE_WRAP
        m[_SEEN] = begun
        played = ((ptr32(m[_FOLLOWING])[0] - m[_TABLE]) >> 2) - 1  # the block that is played
        lead = (m[_PAINT] - played) & (BLOCKS - 1)
        if lead == 0 or since > AHEAD * TICK_US:
            # The ring has run dry. Levels first, so that directions are there before a pulse.
            m[_PAINT] = (played + 1) & (BLOCKS - 1)
            hold(m[_RING], m[_PAINT] * WORDS, m[_STREAM], since // TICK_US)
            m[_PAINT] = (m[_PAINT] + 1) & (BLOCKS - 1)
            lead = 2
        elif h[RUNNING]:
            late = (WORDS - (ptr32(m[_LEFT])[0] & 0xFFFF)) * _WORD_US
            if late > h[WORST_LATE]:
                h[WORST_LATE] = late
        while lead < AHEAD:
            lead += 1
            _tick(None)
            paint(m[_PAINT] * WORDS, 0, m[_RING], m[_STREAM])
            m[_PAINT] = (m[_PAINT] + 1) & (BLOCKS - 1)
        h[SPENT] = (timer[0] - begun + h[SPENT]) & WIDE_WRAP


def lost_commands(_motors):
    """Return the motors that have lost a command since the last call, one bit each."""
    return _stream.take_lost_commands()


def aligned(words):
    """Return the address of an array's first word whose address is a multiple of 16."""
    return (addressof(words) + 15) & -16


class PulseEngine(Stream):
    """A Stream that is sent to registers. wires: the chip's pins, see boards/<board>/board.json."""

    def __init__(self, steps, turns, wires):
        global _stream
        super().__init__(*([1 << pin - _FIRST_PIN for pin in pins] for pins in (steps, turns)))
        _stream = self
        with Claim(wires["data"], wires["clock"], wires["latch"], wires["enable"]):
            self._machine = rp2.StateMachine(
                0,
                send_words,
                freq=_CLOCK_HZ,
                out_base=Pin(wires["data"]),
                sideset_base=Pin(wires["clock"]),
            )
            Pin(wires["enable"], Pin.OUT, value=0)
        mem32[chip.KEPT_PINS] = 0
        self._machine.exec(_CLEAR_X)
        self._machine.active(1)
        self._ring = array("i", bytearray(4 * BLOCKS * WORDS))
        self._make_dma()

    def _make_dma(self):
        """Set up four channels: play a block into the FIFO; aim the next one at the block; wipe
        that; and point the first one to the next block, with an interrupt."""
        play, aim, wipe, move = self._dma = [rp2.DMA() for _ in range(4)]
        number = self._numbers = [dma.channel for dma in self._dma]  # type: ignore[attr-defined]
        self._table = array("i", [0] * 8)
        table = self._table_at = aligned(self._table)
        ring = addressof(self._ring)
        for i in range(BLOCKS):
            mem32[table + 4 * i] = ring + 4 * WORDS * i
        self._nothing = array("i", [0])
        play.config(
            read=ring,
            write=_PIO + _TXF,
            count=WORDS,
            ctrl=play.pack_ctrl(inc_write=False, treq_sel=0, chain_to=number[1]),
        )
        aim.config(
            read=table,
            write=_DMA + _CHANNEL * number[2] + _WRITE_TRIGGER,
            count=1,
            ctrl=aim.pack_ctrl(inc_write=False, ring_size=4, ring_sel=False),
        )
        wipe.config(
            read=addressof(self._nothing),
            write=ring,
            count=WORDS,
            ctrl=wipe.pack_ctrl(inc_read=False, chain_to=number[3]),
        )
        move.config(
            read=table + 4,
            write=_DMA + _CHANNEL * number[0] + _READ_TRIGGER,
            count=1,
            ctrl=move.pack_ctrl(inc_write=False, ring_size=4, ring_sel=False, irq_quiet=False),
        )

    def attach(self, kernel, ahead):
        global _tick
        super().attach(kernel, ahead)
        _tick = self._tick
        feed = self._feed = Feed("i", [0] * _FEED_WORDS)
        feed[_HEADER] = as_word(addressof(kernel.state))
        feed[_STREAM] = as_word(addressof(self._words))
        feed[_RING] = as_word(addressof(self._ring))
        feed[_TABLE] = as_word(self._table_at)
        feed[_FOLLOWING] = _DMA + _CHANNEL * self._numbers[3]
        feed[_LEFT] = _DMA + _CHANNEL * self._numbers[0] + _COUNT
        feed[_PAINT] = AHEAD - 1

    def start(self):
        """Begin to play; the interrupt ticks the kernel. Return what must be kept."""
        kinds = unchecked(Feed.serve, hold)
        self._dma[3].irq(self._feed.serve, hard=True)
        self._feed[_SEEN] = mem32[chip.MICROSECONDS] & WIDE_WRAP
        self._dma[0].active(1)
        return kinds


def made(board, rig):
    """Return the engine and the kernel of a rig's motors."""
    from framestep.pulse.shape import pulse_shape

    engine = PulseEngine(board["step"], board["dir"], board["registers"])
    kernel = StepKernel(engine.motors, CYCLES, engine.clock)
    for i in range(engine.motors):
        kernel.configure(i, engine.fifo(i), *pulse_shape(rig.motor(i), CYCLES // TICK_US))
    kernel.outputs(chip.OUT_SET, chip.OUT_CLEAR)
    engine.attach(kernel, AHEAD)
    return engine, kernel
