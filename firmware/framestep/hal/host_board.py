"""A board that exists only in memory, on virtual time: for the simulator and for tests.

Its main loop makes a pass once a tick, and once whenever bytes arrive.
"""

from framestep.controller import Controller
from framestep.hal.host import BOARD, TICK_DELAY_NS, TICK_NS, HostHal
from framestep.pulse import stepper
from framestep.rig import Rig


class HostBoard:
    """A controller on virtual time. It calls `on_edge(time_ns, signal, value)` for every edge.

    rig: content of a rig file (a dictionary), or None. Raises RigError for a mistake in it.
    motors: how many, whatever the board has.
    broken: as with a mistake in the rig file. chip: as for HostHal.
    """

    def __init__(
        self,
        rig=None,
        motors=None,
        board=BOARD,
        broken=False,
        **chip,
    ):
        self.alive = True  # like a Runner
        self.failure = None
        self.rig = Rig(rig, board)
        count = motors or self.rig.board.get("motors") or len(self.rig.board["step"])
        self.hal = HostHal(count, self.rig, **chip)
        self.controller = Controller(self.hal, self.rig, broken)
        try:
            self.controller.moves.take_memory()
        except ValueError:
            pass  # too little memory: as in boot.py, HI reports room for no frame
        self.controller.answer_hi_at_once()
        self.hal.port.answer = self.controller.answer
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
        """Bytes received that the controller has not read yet."""
        return len(self.hal.port.incoming)

    def receive(self, data):
        """Take bytes from the host. The controller reads them when time passes."""
        self.hal.port.incoming += data

    def transmit(self):
        """Return what the controller has sent since the last call."""
        data = bytes(self.hal.port.outgoing)
        self.hal.port.outgoing.clear()
        return data

    def open_port(self, is_open):
        """Open or close the port as the host does (DTR)."""
        port = self.hal.port
        if is_open and not port.open:
            port.openings += 1
        port.open = is_open
        if not is_open:
            port.incoming.clear()
            port.outgoing.clear()

    def set_input(self, name, level):
        """Set the level of an input pin, by its name (gio3, estop) or number."""
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

    def run_until(self, ns, until_output=False):
        """Let virtual time pass, with a tick and a pass of the main loop each millisecond.

        until_output: stop after a tick in which the controller has sent something.
        """
        hal = self.hal
        self.controller.poll(hal.ticks_ms())
        while self.next_tick <= ns:
            hal.now_ns = self.next_tick
            hal.tick()
            self.controller.poll(hal.ticks_ms())
            self.next_tick += TICK_NS
            if until_output and hal.port.outgoing:
                return
        if ns > hal.now_ns:
            hal.now_ns = ns
            self.controller.poll(hal.ticks_ms())

    def moving(self):
        """Return whether a motor moves or is about to."""
        return self.controller.axes.moving

    def steps(self, motor):
        """Return the steps made by a motor, counted from 0."""
        return self.hal.kernel.blocks[motor][stepper.POSITION]
