"""An RGB LED with a chip in it (WS2812 or similar), driven by a PIO state machine, which holds off
no interrupt.

24 bits, green first and each colour's highest bit first, 0.1 µs per cycle. A 0 is high for 0.3 µs
and low for 1.0, a 1 high for 0.7 and low for 0.6, which suits WS2812, WS2812B and SK6812. The line
then rests for 308 µs, so that the LED shows the colour (WS2812B needs more than 280 µs) and a word
that follows at once is not passed on to a second LED.
"""

import rp2
from machine import Pin

from framestep.base.native import const

_HZ = const(10000000)


@rp2.asm_pio(sideset_init=rp2.PIO.OUT_LOW, out_shiftdir=rp2.PIO.SHIFT_LEFT)
def colour_bits():
    wrap_target()
    pull(block).side(0)
    set(y, 23).side(0)
    label("bit")
    out(x, 1).side(0)[5]
    jmp(not_x, "zero").side(1)[2]
    jmp(y_dec, "bit").side(1)[3]
    jmp("rest").side(0)
    label("zero")
    jmp(y_dec, "bit").side(0)[3]
    label("rest")
    set(y, 5).side(0)
    label("more")
    set(x, 31).side(0)
    label("wait")
    jmp(x_dec, "wait").side(0)[15]
    jmp(y_dec, "more").side(0)
    wrap()


class RgbLed:
    """See hal/contract.py, Hal.led(). Dark at first, whatever it showed before a reset of the
    board."""

    def __init__(self, pin, number):
        """number: of its state machine."""
        machine = rp2.StateMachine(
            number, colour_bits, freq=_HZ, sideset_base=Pin(pin, Pin.OUT, value=0)
        )
        machine.active(1)
        self._put = machine.put
        self._put(0)
        self._shown = 0

    def show(self, colour):
        """Show 0xRRGGBB: sends one word to the state machine if it is new. Allocates nothing."""
        if colour != self._shown:
            self._shown = colour
            self._put(((colour & 0xFF00) << 8) | ((colour >> 8) & 0xFF00) | (colour & 0xFF), 8)
