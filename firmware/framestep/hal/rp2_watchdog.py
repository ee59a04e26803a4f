"""The watchdog of the RP2040 and RP2350 (RP2040 datasheet 4.7, RP2350 12.9).

`machine.WDT` knows no way to stop it; the chip does: a bit of its control register.
"""

import sys

import machine

from framestep.native import const, micropython, ptr32

_RP2350 = "RP2350" in sys.implementation._machine
_SCRATCH4 = (0x400D8000 if _RP2350 else 0x40058000) + 0x1C
_ARMED = const(0x6AB73121)  # what the SDK leaves in SCRATCH4: the watchdog ran, as opposed to machine.reset()
_PAGE = 0x400D if _RP2350 else 0x4005


@micropython.viper
def _disable(page: int):
    control = (page << 16) + 0x8000
    bit = 1
    ptr32(control + 0x3000)[0] = bit << 30  # ENABLE, by the register's alias that clears bits


class Watchdog:
    """See framestep.hal."""

    def __init__(self):
        scratch = machine.mem32[_SCRATCH4] & 0xFFFFFFFF
        self.barked = machine.reset_cause() == machine.WDT_RESET and scratch == _ARMED
        machine.mem32[_SCRATCH4] = 0  # told once, not again after a soft reset
        self._wdt = None

    def arm(self, ms):
        self._wdt = machine.WDT(id=0, timeout=ms)

    def feed(self):
        self._wdt.feed()  # type: ignore[union-attr]

    def disarm(self):
        _disable(_PAGE)
