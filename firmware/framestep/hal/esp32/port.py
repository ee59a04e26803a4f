"""The protocol on the UART of an ESP32's REPL. Every pass begins by polling the port, so that also
feeds the chain."""

from framestep.hal.ports.stdin_port import StdinPort


class UartPort(StdinPort):
    """A framestep.hal.ports.stdin_port whose `open` is always true. hal: each pass calls its
    serve()."""

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
