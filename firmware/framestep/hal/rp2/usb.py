"""Facts about the USB bus that the controller of the RP2040 and RP2350 knows, but MicroPython does
not expose.

Addresses: RP2040 datasheet 4.1.2.5.4 (buffer control: a word for IN and one for OUT of each
endpoint) and 4.1.4. Nothing here allocates.
"""

import time

from machine import disable_irq, enable_irq
from uctypes import bytearray_at

from framestep.base.native import const, micropython, ptr32

# a word for IN and one for OUT of each endpoint; bit 31: enabled
_ENDPOINT_CONTROL = const(0x50100000)
_BUFFER_CONTROL = const(0x50100080)
_AVAILABLE = const(0x400)  # the controller has the packet; the host has not collected it yet
_ANY_AVAILABLE = const(0x4000400)  # either of an endpoint's two buffers
_LENGTH = const(0x3FF)
# the controller has 4 kB of memory; its driver uses the first 1 kB, for the endpoints there are
_MEMORY = 0x50100600
_SOF_RD = const(0x50110048)
ADDRESS_REGISTER = 0x50110000  # ADDR_ENDP
_USB_PAGE = const(0x50110)  # of 4 kB
_ADDRESS = const(0x7F)
# word of that page: bit 2n for a packet sent from IN endpoint n that the driver has not noticed
_BUFF_STATUS = const(22)
_TRANSACTION_US = const(64)  # token, 64 bytes with stuffed bits and the handshake take 60
# In the last 200 µs of a frame the driver waits for the next one (erratum RP2040-E15)
_HELD_BACK_US = const(220)

_LOOK_MS = const(10)
_STILL = const(10)  # checks with the same frame number: the bus is dead


def memory(size):
    """Return memory for USB, 2560 bytes at most. A soft reset leaves it as it is; any other reset
    fills it with zeros."""
    return bytearray_at(_MEMORY, size)


@micropython.viper
def enabled(endpoint: int) -> bool:
    """Return whether the driver has an IN endpoint. After a bus reset it has none until the host
    has configured it again."""
    return ptr32(_ENDPOINT_CONTROL)[2 * endpoint] < 0


@micropython.viper
def in_flight(endpoint: int, out: int) -> bool:
    """Return whether a transfer of an endpoint is under way, or its end has yet to be reported. To
    be called with interrupts off."""
    page = _USB_PAGE
    page <<= 12
    at = 2 * endpoint + out
    return (
        ptr32(_BUFFER_CONTROL)[at] & _ANY_AVAILABLE != 0 or ptr32(page)[_BUFF_STATUS] >> at & 1 != 0
    )


@micropython.viper
def packet_waits(endpoint: int) -> bool:
    """Return whether a packet waits at IN endpoint number `endpoint` for the host to collect it."""
    return ptr32(_BUFFER_CONTROL)[2 * endpoint] & _AVAILABLE != 0


@micropython.viper
def arrived(endpoint: int) -> int:
    """Return the length of the last packet that came to OUT endpoint number `endpoint`, or -1 if
    the controller waits for one."""
    word = ptr32(_BUFFER_CONTROL)[2 * endpoint + 1]
    return -1 if word & _AVAILABLE else word & _LENGTH


@micropython.viper
def empty_packet(endpoint: int):
    """Make the packet that is under way at an IN endpoint an empty one, with the same toggle bit.

    If the host is just collecting it, it is sent. Interrupts are off during this, so that the
    driver does not notice. Takes 70 µs if a packet with bytes waits, and up to 220 µs more, with
    interrupts on, while the driver holds it back.
    """
    control = ptr32(_BUFFER_CONTROL)
    page = _USB_PAGE
    page <<= 12
    at = 2 * endpoint
    begun = int(time.ticks_us())
    while control[at] & _AVAILABLE == 0 and (int(time.ticks_us()) - begun) & 0xFFFF < _HELD_BACK_US:
        pass
    irq = disable_irq()
    try:
        word = control[at]
        if word & _AVAILABLE and word & _LENGTH:
            control[at] = word & (-1 - _AVAILABLE)  # from now on the host has to wait
            begun = int(time.ticks_us())
            while (int(time.ticks_us()) - begun) & 0xFFFF < _TRANSACTION_US:
                pass
            if (ptr32(page)[_BUFF_STATUS] >> at) & 1 == 0:
                word &= -1 - _LENGTH
                control[at] = word & (-1 - _AVAILABLE)
                wait = 4  # 12 cycles (RP2040 datasheet 4.1.2.5.1)
                while wait > 0:
                    wait -= 1
                control[at] = word
    finally:
        enable_irq(irq)


@micropython.viper
def addressed() -> bool:
    """Return whether the host has given the board an address since the last reset of the bus."""
    page = _USB_PAGE
    page <<= 12  # as a constant it would be an object
    return ptr32(page)[0] & _ADDRESS != 0


@micropython.viper
def frame_number() -> int:
    """Return the number of the host's last USB frame, 0 to 2047, one a millisecond. It is constant
    on a dead bus."""
    return ptr32(_SOF_RD)[0] & 0x7FF


class BusWatch:
    """Detects a dead bus: the cable is out, or the host sleeps. The USB driver does not report
    that."""

    def __init__(self):
        self._looked_at = time.ticks_ms()
        self._frame = frame_number()
        self._still = -1  # until a frame has come

    def dead(self):
        """Return whether the bus is dead: there were USB frames, but none for 0.1 s, or the board
        has no address.

        To be called often; it checks every 10 ms.
        """
        now = time.ticks_ms()
        if time.ticks_diff(now, self._looked_at) >= _LOOK_MS:
            self._looked_at = now
            frame = frame_number()
            if frame != self._frame:
                self._frame = frame
                self._still = 0
            elif 0 <= self._still < _STILL:
                self._still += 1
        return self._still == _STILL or self._still >= 0 and not addressed()
