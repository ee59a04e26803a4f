"""Registers that differ between the chips that can measure themselves.

RP2040 datasheet 2.5.7 (DMA), 2.19.6 (pins), 4.6.5 (timer); RP2350 datasheet 12.6, 9.11, 12.8.5. The
numbers come from the chips' SDK (hardware_regs).
"""

from dataclasses import dataclass


@dataclass(frozen=True)
class Registers:
    """Registers of a chip.

    blocks: PIO blocks; microseconds: the timer's raw counter; pin_control: control of pin 0, eight
    bytes a pin; output_override: first bit of its two-bit field.

    DMA: trigger, abort: addresses relative to the first; increment, silent, busy: bits of a
    channel's control; chain, request: first bits of these fields in it; count: the largest count.
    """

    blocks: int
    microseconds: int
    pin_control: int
    output_override: int
    trigger: int
    abort: int
    increment: int
    silent: int
    busy: int
    chain: int
    request: int
    count: int


CHIPS = {
    "rp2040": Registers(
        blocks=2,
        microseconds=0x40054028,
        pin_control=0x40014004,
        output_override=8,
        trigger=0x430,
        abort=0x444,
        increment=1 << 5,
        silent=1 << 21,
        busy=1 << 24,
        chain=11,
        request=15,
        count=0x7FFFFFFF,
    ),
    # not yet tried on a chip
    "rp2350": Registers(
        blocks=3,
        microseconds=0x400B0028,
        pin_control=0x40028004,
        output_override=12,
        trigger=0x450,
        abort=0x464,
        increment=1 << 6,
        silent=1 << 23,
        busy=1 << 26,
        chain=13,
        request=17,
        count=0x0FFFFFFF,
    ),
}
