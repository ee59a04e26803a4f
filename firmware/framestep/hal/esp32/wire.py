"""The drivers' UART."""

from machine import UART, Pin

from framestep.base.copying import copy_bytes
from framestep.base.native import const

_BAUD = const(115200)
_HEARD = const(32)


class Wire:
    """See hal/contract.py. Takes one UART."""

    def __init__(self, wiring):
        """wiring: {"uart", "tx", "rx"} of the board."""
        tx, rx = Pin(wiring["tx"]), Pin(wiring["rx"])
        uart = UART(wiring["uart"], _BAUD, bits=8, parity=None, stop=1, tx=tx, rx=rx)
        self._waiting = uart.any
        self._read = uart.readinto
        self._heard = bytearray(_HEARD)
        self.send = uart.write  # of (buffer, count); its own queue takes them

    def select(self, motor):
        pass

    def receive(self, buffer, at, limit):
        count = min(self._waiting(), limit, _HEARD)
        if count:
            self._read(self._heard, count)
            copy_bytes(buffer, at, self._heard, 0, count)
        return count
