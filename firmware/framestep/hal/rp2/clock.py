"""The clock of the processor and of the pulse engine.

RP2040: Raspberry Pi certifies 133 MHz at the core voltage of power-on, 1.10 V, and 200 MHz at
1.15 V. MicroPython's machine.freq() keeps the flash below MICROPY_HW_FLASH_MAX_FREQ
(flash_mhz in board.json). USB, timer and watchdog have clocks of their own. All else is set up
after this, from the new clock. The RP2350 has its 150 MHz from power-on.
"""

from time import sleep_ms

import machine
from machine import mem32

from framestep.base.native import const

# RP2040 datasheet 2.10.6: register VREG of VREG_AND_CHIP_RESET, EN and VSEL
_VREG = const(0x40064000)
_1_15_V = const(0xC1)
_SETTLE_MS = const(1)


def set_clock(mhz):
    """Run the processor at one of the chip's `clocks`; 0 changes nothing. The core's voltage is
    raised first, and stays so. Call before anything is set up that counts cycles."""
    hz = mhz * 1000000
    if hz and machine.freq() != hz:
        mem32[_VREG] = _1_15_V
        sleep_ms(_SETTLE_MS)
        machine.freq(hz)
