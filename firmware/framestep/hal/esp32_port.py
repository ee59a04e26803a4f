"""The protocol on the UART of an ESP32's REPL. A pass begins with a look at the port, so that is
where the chain is fed."""

from framestep.hal.stdin_port import StdinPort


class UartPort(StdinPort):
    """See framestep.hal.stdin_port; `open` is always true. hal: whose serve() each pass calls."""

    def __init__(self, hal):
        StdinPort.__init__(self)
        self._serve = hal.serve
        self._land = hal.land

    def poll(self, reader):
        self._serve()
        return StdinPort.poll(self, reader)

    def stop(self):
        self._land()
        StdinPort.stop(self)
