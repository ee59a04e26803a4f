"""A board that exists only in memory, on virtual time: for the simulator and for tests.

The main loop passes once a tick, and once for each time bytes arrive.
"""

from framestep.controller import Controller
from framestep.hal.host import BOARD, TICK_DELAY_NS, TICK_NS, HostHal
from framestep.pulse import stepper
from framestep.rig import Rig


class HostBoard:
    """A controller on virtual time. `on_edge(time_ns, signal, value)` is told every edge.

    rig: what a rig file holds (a dictionary), or None. RigError for a mistake in it.
    motors: how many, whatever the board has.
    caused_reset: as if the watchdog had started the board.
    wire: called with the HAL, returns what the drivers' UART is connected to.
    flash: what has outlived a power cut; False: there is none.
    upload_bytes: memory for the uploaded move.
    broken: as with a mistake in the rig file.
    """

    def __init__(
        self,
        rig=None,
        motors=None,
        board=BOARD,
        caused_reset=False,
        wire=None,
        flash=None,
        upload_bytes=0,
        broken=False,
    ):
        self.alive = True  # as a Runner
        self.failure = None
        self.rig = Rig(rig, board)
        count = motors or self.rig.board.get("motors") or len(self.rig.board["step"])
        self.hal = HostHal(count, self.rig, caused_reset, wire, flash, upload_bytes)
        self.controller = Controller(self.hal, self.rig, broken)
        try:
            self.controller.moves.take_memory()
        except ValueError:
            pass  # too little of it: as in boot.py, HI tells that there is room for no frame
        self.next_tick = TICK_DELAY_NS

    @property
    def now_ns(self):
        return self.hal.now_ns

    @property
    def on_edge(self):
        return self.hal.on_edge

    @on_edge.setter
    def on_edge(self, function):
        self.hal.on_edge = function

    @property
    def pending(self):
        """Bytes received but not yet taken in by the controller."""
        return len(self.hal.port.incoming)

    def receive(self, data):
        """Bytes from the host; they are looked at when time moves on."""
        self.hal.port.incoming += data

    def transmit(self):
        """What the controller has sent since the last call."""
        data = bytes(self.hal.port.outgoing)
        self.hal.port.outgoing.clear()
        return data

    def open_port(self, is_open):
        """The host opens or closes the port (DTR)."""
        port = self.hal.port
        if is_open and not port.open:
            port.openings += 1
        port.open = is_open
        if not is_open:
            port.incoming.clear()
            port.outgoing.clear()

    def set_input(self, name, level):
        """Put an input pin to a level, by its name (gio3, estop) or its number."""
        hal = self.hal
        pin = (
            name
            if isinstance(name, int)
            else next((p for p, n in hal.names.items() if n == name), None)
        )
        if pin is None:
            raise ValueError(
                "no pin %r; there are %s and numbers" % (name, ", ".join(hal.names.values()))
            )
        hal.set_level(pin, level)

    def run_until(self, ns):
        """Let virtual time pass: a tick and a pass of the main loop each millisecond."""
        hal = self.hal
        self.controller.poll(hal.ticks_ms())
        while self.next_tick <= ns:
            hal.now_ns = self.next_tick
            hal.tick()
            self.controller.poll(hal.ticks_ms())
            self.next_tick += TICK_NS
        if ns > hal.now_ns:
            hal.now_ns = ns
            self.controller.poll(hal.ticks_ms())

    def moving(self):
        """Whether a motor moves or is about to."""
        return self.controller.axes.moving

    def steps(self, motor):
        """Steps made by a motor, counted from 0."""
        return self.hal.kernel.blocks[motor][stepper.POSITION]
