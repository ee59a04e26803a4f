"""The protocol on the UART of an ESP32's REPL. Every pass begins by polling the port, so that also
feeds the chain."""

from time import sleep_ms

import machine

from framestep.base.native import const
from framestep.hal.ports.stdin_port import StdinPort

_BAUD = const(115200)  # of the REPL after a reset; a soft reset keeps the last rate
_SENT_MS = const(20)  # time to send what waits in the UART at this rate
_REPL = const(0)  # number of its UART


class UartPort(StdinPort):
    """A framestep.hal.ports.stdin_port whose `open` is always true. hal: each pass calls its
    serve(); baud: the UART's rate from start() on, until a reset."""

    def __init__(self, hal, baud):
        StdinPort.__init__(self)
        self._baud = baud
        self._serve = hal.serve
        self._land = hal.land

    def start(self):
        if self._baud != _BAUD or machine.reset_cause() == machine.SOFT_RESET:
            sleep_ms(_SENT_MS)
            try:
                machine.UART(_REPL, self._baud)
            except OSError:
                # It has set the rate by then. What it sets next is for ESP-IDF's driver, which the
                # REPL's UART does without.
                pass
        StdinPort.start(self)

    def poll(self, reader):
        self._serve()
        return StdinPort.poll(self, reader)

    def stop(self):
        self._land()
        StdinPort.stop(self)
