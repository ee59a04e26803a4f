"""Pins of the RP2040 and RP2350 that framestep has claimed, and whether they still are what it made
them.

Every pin is set up within `with Claim(pin, ...):`, at boot. Its function and its pad are noted
there, so that wrong() finds whatever has been changed since, by a program on the REPL or by the
chip's own software, and mend() puts it back.

Chips B0 and B1 need this most. Their USB controller may miss the end of a bus reset (erratum
RP2040-E5), so after each one the SDK takes GPIO 15 for about a millisecond, then writes back what
it had found there. A pin claimed in that time would be dead from then on, and USB would wait for
ever. So nothing is claimed while a pin is held: interrupts are off from that look on, and the SDK
takes the pin in an interrupt.

Nothing here allocates but Claim.

Addresses: RP2040 datasheet 2.19.6 and 4.1.4, RP2350 datasheet 9.11 and 12.7.
"""

import sys
from array import array

from machine import disable_irq, enable_irq

from framestep.base.native import const, micropython, ptr32
from framestep.hal.rp2.pins import free, held

_PINS = const(30)
_RP2350 = "RP2350" in sys.implementation._machine
_IO_PAGE = 0x40028 if _RP2350 else 0x40014  # of 4 kB: status and control, a word each for every pin
_PADS_PAGE = 0x40038 if _RP2350 else 0x4001C  # a word ahead, then one for every pin
# Of a control word: function, and whether output enable and input are overridden. Not what
# overrides the output, by which DMX makes its breaks.
_CONTROL = 0x3C01F if _RP2350 else 0x3301F
_CHIP_ID = 0x40000000  # of the RP2040: its highest four bits are the revision, 1 for B0 and B1

_HELD_PIN = const(15)

_noted = array("i", [0] * (2 * _PINS))  # control, pad
_claimed = [0]  # a bit for each pin


def held_pin():
    """The pin that this chip's USB may take for a while after a bus reset, or -1."""
    from machine import mem32

    return _HELD_PIN if not _RP2350 and ((mem32[_CHIP_ID] >> 28) & 15) == 1 else -1


@micropython.viper
def _compare(noted: ptr32, pins: int, io: int, pads: int, mask: int, put: int) -> int:
    """The pins of these bits that are not as noted; put: make them so."""
    control = ptr32((io << 12) + 4)
    pad = ptr32((pads << 12) + 4)
    wrong = 0
    pin = 0
    while pins >> pin:
        if (pins >> pin) & 1:
            k = pin << 1
            if (control[k] ^ noted[k]) & mask or pad[pin] != noted[k + 1]:
                wrong |= 1 << pin
                if put:
                    pad[pin] = noted[k + 1]
                    control[k] = noted[k]
        pin += 1
    return wrong


@micropython.viper
def _note(noted: ptr32, pin: int, io: int, pads: int):
    control = ptr32((io << 12) + 4)
    pad = ptr32((pads << 12) + 4)
    k = pin << 1
    noted[k] = control[k]
    noted[k + 1] = pad[pin]


def wrong():
    """Claimed pins that are not what they were made, a bit each; 0 while USB holds one, as it gives
    that back."""
    return 0 if held() else _compare(_noted, _claimed[0], _IO_PAGE, _PADS_PAGE, _CONTROL, 0)


def mend():
    """Make them what they were; the bits of those that were not. Nothing is done while USB holds a
    pin."""
    state = disable_irq()
    bits = 0 if held() else _compare(_noted, _claimed[0], _IO_PAGE, _PADS_PAGE, _CONTROL, 1)
    enable_irq(state)
    return bits


class Claim:
    """`with Claim(2, 3): ...` sets these pins up while USB holds none, and notes what they have
    become.

    Waits up to two milliseconds. Interrupts are off within: for quick things only.
    """

    def __init__(self, *pins):
        self.pins = pins

    def __enter__(self):
        self.state = free()

    def __exit__(self, kind, value, trace):
        if kind is None:
            for pin in self.pins:
                _note(_noted, pin, _IO_PAGE, _PADS_PAGE)
                _claimed[0] |= 1 << pin
        enable_irq(self.state)
