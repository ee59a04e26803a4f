"""Guards the pins of the RP2040 and RP2350 that framestep has claimed.

Every pin is set up within `with Claim(pin, ...):`, at boot. Claim notes its function and its pad,
so that wrong() finds later changes by a program on the REPL or by the chip's own software, and
mend() undoes them.

Chips B0 and B1 need this most. Their USB controller may miss the end of a bus reset (erratum
RP2040-E5). So after each one the SDK takes GPIO 15 for about a millisecond, and then restores what
it found there. A pin claimed during that time would be dead from then on, and USB would wait for
ever. So nothing is claimed while USB holds a pin: interrupts are off from that check on, and the
SDK takes the pin in an interrupt.

Only Claim allocates.
"""

from array import array

from machine import disable_irq, enable_irq

from framestep.base.native import const, micropython, ptr32
from framestep.hal.rp2 import chip
from framestep.hal.rp2.pins import free, held

_PINS = const(30)
_CHIP_ID = 0x40000000  # of the RP2040: the highest four bits are the revision, 1 for B0 and B1

_HELD_PIN = const(15)

_noted = array("i", [0] * (2 * _PINS))  # control, pad
_claimed = [0]  # a bit for each pin


def held_pin():
    """Return the pin that this chip's USB may take for a while after a bus reset, or -1."""
    from machine import mem32

    return _HELD_PIN if chip.MAY_LOSE_PIN and ((mem32[_CHIP_ID] >> 28) & 15) == 1 else -1


@micropython.viper
def _compare(noted: ptr32, pins: int, io: int, pads: int, mask: int, put: int) -> int:
    """Return which pins of these bits differ from the notes. put: restore them."""
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
    """Return the claimed pins that have been changed, a bit each; 0 while USB holds a pin, as it
    gives that back."""
    return (
        0
        if held()
        else _compare(_noted, _claimed[0], chip.IO_PAGE, chip.PADS_PAGE, chip.CONTROL, 0)
    )


def mend():
    """Restore changed pins. Return their bits. Does nothing while USB holds a pin."""
    state = disable_irq()
    bits = (
        0
        if held()
        else _compare(_noted, _claimed[0], chip.IO_PAGE, chip.PADS_PAGE, chip.CONTROL, 1)
    )
    enable_irq(state)
    return bits


class Claim:
    """`with Claim(2, 3): ...` sets up these pins while USB holds none, and notes their state
    afterwards.

    Waits up to two milliseconds, see free(). Interrupts are off within: for quick work only.
    """

    def __init__(self, *pins):
        self.pins = pins

    def __enter__(self):
        self.state = free()

    def __exit__(self, kind, value, trace):
        if kind is None:
            for pin in self.pins:
                _note(_noted, pin, chip.IO_PAGE, chip.PADS_PAGE)
                _claimed[0] |= 1 << pin
        enable_irq(self.state)
