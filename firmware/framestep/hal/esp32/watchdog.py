"""The watchdog of an ESP32: ESP-IDF's for tasks, by machine.WDT.

It cannot be stopped, but given another time: six days while disarmed. A timer feeds it once a day,
as long as MicroPython runs anything at all.
"""

import machine

from framestep.base.native import const

_DISARMED_MS = const(1 << 29)  # ESP-IDF counts up to four times as many
_DAY_MS = const(86400000)


class Watchdog:
    """See hal/contract.py."""

    def __init__(self):
        self.caused_reset = machine.reset_cause() == machine.WDT_RESET
        self._wdt = None
        self._timer = machine.Timer(1, period=_DAY_MS, callback=self._daily)

    def arm(self, ms):
        self._wdt = machine.WDT(0, ms)  # type: ignore[call-arg]

    def feed(self):
        self._wdt.feed()

    def disarm(self):
        if self._wdt:
            self.arm(_DISARMED_MS)

    def _daily(self, _timer):
        if self._wdt:
            self._wdt.feed()
