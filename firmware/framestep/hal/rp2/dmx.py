"""DMX512 by DMA alone: frames follow each other without the processor.

A control channel passes the blocks of a list to a data channel, one after the other, in a loop
(RP2040 datasheet 2.5.6.2):

    send    start code and 512 slots to the UART, as its FIFO takes them
    drain   wait for the 33 characters that FIFO and shifter hold at most
    low     force the pin low by its output override: break
    copy    the levels in force to the wire buffer, in one go: a frame on the wire is one state of
            the lights
    break   wait
    high    lift the override: mark after break
    mark    wait
    again   set the control channel's read address to the start of the list

Waits are transfers paced by a DMA timer, a microsecond each. The UART itself does not know of the
break.
"""

from array import array

import rp2
from machine import UART, Pin, mem32

from framestep.base.native import addressof, const
from framestep.hal import CHANGED, CHANNELS
from framestep.hal.rp2 import chip

_BAUD = const(250000)
_SHORT = const(32)  # bytes of the UART's unused software buffers: the minimum
_DRAIN_US = const(1500)  # 33 characters of 44 µs, and the mark before the break
_DMA = const(0x50000000)
_CHANNEL = const(0x40)  # bytes of a channel's registers
_PACER = const(3)  # DMA timer for waits
_TREQ_PACER = const(0x3B + _PACER)
_TREQ_FREE = const(0x3F)
_BYTES = const(0)
_WORDS = const(2)
_COPY = const(3)  # index of this block in the list
_BLOCK = const(4)  # words: read address, write address, count, control
_UARTDR = const(0x00)
_UARTIMSC = const(0x38)

_OUTOVER_LOW = const(2)


def _number(channel):
    return channel.channel  # without a type, as the stubs lack this attribute


class Dmx:
    """See hal/contract.py. Takes one UART, two DMA channels and a DMA timer."""

    channels = CHANNELS

    def __init__(self, wiring, hz, break_us, mark_us):
        """wiring: {"uart", "tx", "rx"} of the board. hz: system clock. break_us, mark_us: length of
        the break and of the mark after it. Allocates."""
        tx = wiring["tx"]
        # The UART's own buffers are not used. It needs RX even if nothing is connected to it.
        rx = Pin(wiring["rx"])
        self._uart = UART(
            wiring["uart"],
            _BAUD,
            bits=8,
            parity=None,
            stop=2,
            tx=Pin(tx),
            rx=rx,
            txbuf=_SHORT,
            rxbuf=_SHORT,
        )
        uart, request = chip.UART0, chip.UART0_REQUEST
        if wiring["uart"]:
            uart, request = chip.UART1, chip.UART1_REQUEST
        mem32[uart + _UARTIMSC] = 0
        mem32[_DMA + chip.DMA_TIMERS + 4 * _PACER] = (1 << 16) | (hz // 1000000)
        self._levels = (bytearray(CHANNELS + 1), bytearray(CHANNELS + 1))
        self._places = array("I", [addressof(levels) for levels in self._levels])  # below 2^30
        self._shown = 0
        self._wire = bytearray(CHANNELS + 1)
        control = (chip.IO_PAGE << 12) + 8 * tx + 4
        normal = mem32[control]
        self._overrides = array("I", [normal | (_OUTOVER_LOW << chip.OUTOVER), normal])
        self._idle = bytearray(4)
        self._control = rp2.DMA()
        self._data = rp2.DMA()
        self._list = array("I", [0] * (8 * _BLOCK))
        self._start = array("I", [addressof(self._list)])
        wire, idle, low = addressof(self._wire), addressof(self._idle), addressof(self._overrides)
        size = CHANNELS + 1
        self._block(0, wire, uart + _UARTDR, size, _BYTES, True, False, request)
        self._block(1, idle, idle, _DRAIN_US, _BYTES, False, False, _TREQ_PACER)
        self._block(2, low, control, 1)
        self._block(_COPY, self._places[0], wire, size, _BYTES, True, True)
        self._block(4, idle, idle, break_us + 1, _BYTES, False, False, _TREQ_PACER)
        self._block(5, low + 4, control, 1)
        self._block(6, idle, idle, mark_us + 1, _BYTES, False, False, _TREQ_PACER)
        self._block(7, addressof(self._start), _DMA + _CHANNEL * _number(self._control), 1)

    def _block(
        self, i, read, write, count, size=_WORDS, inc_read=False, inc_write=False, treq=_TREQ_FREE
    ):
        ctrl = self._data.pack_ctrl(
            inc_read=inc_read,
            inc_write=inc_write,
            size=size,
            treq_sel=treq,
            chain_to=_number(self._control),
        )
        for k, word in enumerate((read, write, count, ctrl)):
            self._list[i * _BLOCK + k] = word & 0xFFFFFFFF

    def start(self):
        """Begin to send frames."""
        # four words at a time to the data channel's registers; the last one starts it
        ctrl = self._control.pack_ctrl(ring_size=4, ring_sel=True)
        data = _DMA + _CHANNEL * _number(self._data)
        self._control.config(read=self._list, write=data, count=_BLOCK, ctrl=ctrl, trigger=True)

    def show(self, lights):
        """Send the levels of an io.lights.Lights with the next frame. At most once a pass.
        Allocates nothing."""
        if lights.words[CHANGED]:
            # DMA does not read the other buffer: a copy that was under way took only 10 µs
            shown = 1 - self._shown
            self._shown = shown
            lights.take(self._levels[shown])
            self._list[_COPY * _BLOCK] = self._places[shown]
