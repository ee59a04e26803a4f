"""The start of a board's shift registers, before anything else: all outputs low, then enabled.

After power-up registers have random levels, and after a soft reset those of the last word. Until
this has been done, a pull-up at OE keeps the outputs off.
"""

from machine import Pin

BITS = 32


def clear(wires):
    """Shift zeros in, and enable the outputs. wires: pins, see boards/<board>/board.json."""
    clock, latch, _ = [Pin(wires[key], Pin.OUT, value=0) for key in ("clock", "latch", "data")]
    for _ in range(BITS):
        clock(1)
        clock(0)
    latch(1)
    latch(0)
    Pin(wires["enable"], Pin.OUT, value=0)
