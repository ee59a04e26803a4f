"""The protocol on the UART of an ESP32's REPL. Every pass begins by polling the port, so that also
feeds the chain."""

from time import sleep_ms, ticks_add, ticks_diff, ticks_us

import machine

from framestep.base.native import const
from framestep.hal.ports.stdin_port import StdinPort

_BAUD = const(115200)  # of the REPL after a reset; a soft reset keeps the last rate
_SENT_MS = const(20)  # time to send what waits in the UART at this rate
_REPL = const(0)  # number of its UART
_HARDWARE = const(128)  # bytes that wait in the UART
_PACKET = const(64)
_BYTE_BITS = const(10)


class UartPort(StdinPort):
    """A framestep.hal.ports.stdin_port whose `open` is always true. hal: each pass calls its
    serve(); baud: the UART's rate from start() on, until a reset."""

    def __init__(self, hal, baud):
        StdinPort.__init__(self)
        self._baud = baud
        self._full_us = self._us(_HARDWARE)
        self._packet_us = self._us(_PACKET)
        self._sent_by = 0  # when all bytes will have been sent, ticks_us
        self._serve = hal.serve
        self._land = hal.land

    def _us(self, count):
        return count * _BYTE_BITS * 1000000 // self._baud

    def start(self):
        if self._baud != _BAUD or machine.reset_cause() == machine.SOFT_RESET:
            sleep_ms(_SENT_MS)
            try:
                machine.UART(_REPL, self._baud)
            except OSError:
                # It has set the rate by then. What it sets next is for ESP-IDF's driver, which the
                # REPL's UART does without.
                pass
        self._sent_by = ticks_us()
        StdinPort.start(self)

    def poll(self, reader):
        self._serve()
        return StdinPort.poll(self, reader)

    def send(self, writer):
        """Send a packet if the UART has room for it: otherwise MicroPython would wait for it, 10 ms
        at a time, and the ring of received bytes would overflow meanwhile."""
        now = ticks_us()
        waiting = ticks_diff(self._sent_by, now)
        if not 0 < waiting <= self._full_us:  # or it was so long ago that the counter has wrapped
            waiting = 0
        if waiting + self._packet_us > self._full_us:
            return True
        count = writer.take(self._out, _PACKET)
        if count:
            self._write(self._packets[count])
            self._sent_by = ticks_add(now, waiting + self._us(count))
        return count

    def stop(self):
        self._land()
        StdinPort.stop(self)
