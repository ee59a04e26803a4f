"""The watchdog of the RP2040 and RP2350 (RP2040 datasheet 4.7, RP2350 12.9).

`machine.WDT` cannot stop it; the chip can, by a bit of its control register.

A program on the REPL may make a call in C that holds the main loop up for longer than the
watchdog's timeout. By then the tick has ramped every motor down, and a reset would only switch the
drivers off and lose the positions. So a hard timer feeds the watchdog as well while three things
hold: the tick still counts, no motor takes segments any more, and the main loop is outside of a
pass, so that it is not framestep itself that hangs.
"""

from array import array

import machine

from framestep.base.native import addressof, as_word, const, micropython, ptr32
from framestep.hal import PASS
from framestep.hal.rp2 import chip
from framestep.pulse.stepper import FIRST, MODE, NEXT, RUN, TICKS

_SCRATCH4 = const((chip.WATCHDOG_PAGE << 16) + 0x801C)
_SCRATCH0 = const((chip.WATCHDOG_PAGE << 16) + 0x800C)
# in SCRATCH0 while framestep_overlay protects a start with the watchdog
_STARTING = const(0x1DEA5C3B)
# in SCRATCH4, by the SDK: the watchdog runs, as opposed to machine.reset()
_ARMED = const(0x6AB73121)
_GUARD_MS = const(500)

# State words; PASS is one of them
_HEADER = const(4)  # address of the tick's header
_SEEN = const(1)  # its count of ticks at the last check
_LOAD = const(2)  # the counter's value after feeding
_REGISTER = const(3)  # address of the register that feeds it
_WORDS = const(5)


@micropython.viper
def _disable(page: int):
    control = (page << 16) + 0x8000
    bit = 1
    ptr32(control + 0x3000)[0] = bit << 30  # ENABLE, by the register's alias for clearing bits


class Watchdog:
    """See hal/contract.py."""

    def __init__(self):
        scratch = machine.mem32[_SCRATCH4] & 0xFFFFFFFF
        self.caused_reset = machine.reset_cause() == machine.WDT_RESET and scratch == _ARMED
        machine.mem32[_SCRATCH4] = 0  # so that it is not reported again after a soft reset
        # it may still run after a soft reset in motion
        if machine.mem32[_SCRATCH0] != _STARTING:
            _disable(chip.WATCHDOG_PAGE)
        self._wdt = None
        self.words = array("i", [0] * _WORDS)  # the main loop keeps PASS
        self._timer = None

    def guard(self, header):
        """Begin to feed it from a hard timer as well, see above. header: the tick's."""
        words = self.words
        words[_HEADER] = as_word(addressof(header))
        words[_REGISTER] = (chip.WATCHDOG_PAGE << 16) + 0x8004  # LOAD
        self._timer = machine.Timer(
            -1, period=_GUARD_MS, mode=machine.Timer.PERIODIC, callback=self._look, hard=True
        )

    @micropython.viper
    def _look(self, _timer):
        w = ptr32(self.words)
        m = ptr32(w[_HEADER])
        ticks = m[TICKS]
        if ticks == w[_SEEN]:
            return
        w[_SEEN] = ticks
        if w[PASS] or w[_LOAD] == 0:
            return
        a = m[FIRST]
        while a:
            m = ptr32(a)
            a = m[NEXT]
            if m[MODE] & RUN:
                return
        ptr32(w[_REGISTER])[0] = w[_LOAD]

    def arm(self, ms):
        self._wdt = machine.WDT(id=0, timeout=ms)
        self.words[_LOAD] = ms * 1000 * chip.WATCHDOG_COUNTS

    def feed(self):
        self._wdt.feed()

    def disarm(self):
        self.words[_LOAD] = 0
        _disable(chip.WATCHDOG_PAGE)
