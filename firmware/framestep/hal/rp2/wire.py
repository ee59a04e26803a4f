"""The drivers' UART. It uses only the FIFOs, so it needs no interrupt.

An exchange is at most 8 bytes out and 24 in (echoes included). Each FIFO holds 32 (RP2040 datasheet
4.2, RP2350 12.1).
"""

from machine import UART, Pin, mem32

from framestep.base.native import const, micropython, ptr8, ptr32
from framestep.hal.rp2 import chip

_BAUD = const(115200)
_SHORT = const(32)  # bytes of the UART's unused software buffers: the minimum
_UARTIMSC = const(0x38)
_FR = const(6)  # word of the flags
_RXFE = const(0x10)
_TXFF = const(0x20)

_PERIPHERALS = const(0x40000000)


@micropython.viper
def _send(uart: int, data: ptr8, count: int):
    base = 0x400
    base <<= 20  # 0x40000000; as a constant it would be an object
    registers = ptr32(base + uart)
    i = 0
    while i < count:
        if registers[_FR] & _TXFF == 0:
            registers[0] = data[i + 0]
        i += 1


@micropython.viper
def _receive(uart: int, data: ptr8, at: int, limit: int) -> int:
    base = 0x400
    base <<= 20
    registers = ptr32(base + uart)
    count = 0
    while count < limit:
        if registers[_FR] & _RXFE:
            break
        data[at + count] = registers[0]  # the low byte; the checksum detects damaged bytes
        count += 1
    return count


class Wire:
    """See hal/contract.py. Takes one UART."""

    def __init__(self, wiring):
        """wiring: {"uart", "tx", "rx"} of the board."""
        number = wiring["uart"]
        tx, rx = Pin(wiring["tx"]), Pin(wiring["rx"])
        self._uart = UART(
            number, _BAUD, bits=8, parity=None, stop=1, tx=tx, rx=rx, txbuf=_SHORT, rxbuf=_SHORT
        )
        at = chip.UART1 if number else chip.UART0
        self._offset = at - _PERIPHERALS
        mem32[at + _UARTIMSC] = 0  # its own buffers are not used

    def select(self, motor):
        pass

    def send(self, buffer, count):
        _send(self._offset, buffer, count)

    def receive(self, buffer, at, limit):
        return _receive(self._offset, buffer, at, limit)
