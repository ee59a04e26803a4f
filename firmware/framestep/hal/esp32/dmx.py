"""DMX512 by a UART, from the main loop: the hardware sends a frame by itself, and passes begin the
next.

ESP-IDF's break is out of reach, and MicroPython's sendbreak() waits and is too short. So the break
is a zero at a lower rate: its start bit and eight data bits are low, and its stop bits begin the
mark after break. A late pass makes a mark longer, which DMX512 allows for up to a second.
"""

from time import ticks_diff, ticks_us

from machine import UART, Pin

from framestep.base.native import const
from framestep.hal import CHANGED, CHANNELS

_BAUD = const(250000)
_QUEUE = const(2048)  # bytes for the driver: a frame, in the pieces that ESP-IDF makes of it
_LOW_BITS = const(9)
_STOP_BITS = const(2)

# What the UART sends, or has sent
_FRAME = const(0)
_BREAK = const(1)
_MARK = const(2)


class Dmx:
    """See hal/contract.py. Takes one UART."""

    channels = CHANNELS

    def __init__(self, wiring, break_us, mark_us):
        """wiring: {"uart", "tx", "rx"} of the board. break_us, mark_us: least length of the break
        and of the mark after it. Allocates."""
        # Without RX the UART would take a pin of the flash.
        tx, rx = Pin(wiring["tx"]), Pin(wiring["rx"])
        uart = UART(
            wiring["uart"], _BAUD, bits=8, parity=None, stop=_STOP_BITS, tx=tx, rx=rx, txbuf=_QUEUE
        )
        self._set_rate = uart.init
        self._write = uart.write
        self._is_sent = uart.txdone
        # a microsecond more, as the UART rounds the length of a bit down
        self._break_rate = _LOW_BITS * 1000000 // (break_us + 1)
        # besides the stop bits of the break
        self._mark_us = mark_us - _STOP_BITS * 1000000 // self._break_rate
        self._zero = bytes(1)
        self._levels = bytearray(CHANNELS + 1)
        self._sending = _FRAME
        self._marked = 0  # when the mark's stop bits had been sent, ticks_us

    def show(self, lights):
        """Send the levels of an io.lights.Lights with the next frame. Allocates nothing."""
        if lights.words[CHANGED]:
            lights.take(self._levels)

    def serve(self):
        """Begin the next break, mark or frame once the last has been sent. To be called in each
        pass. Allocates nothing."""
        if not self._is_sent():
            return
        if self._sending == _FRAME:
            self._set_rate(self._break_rate)
            self._write(self._zero)
            self._sending = _BREAK
            return
        if self._sending == _BREAK:
            self._set_rate(_BAUD)
            self._marked = ticks_us()
            self._sending = _MARK
        if ticks_diff(ticks_us(), self._marked) >= self._mark_us:
            self._write(self._levels)
            self._sending = _FRAME
