"""HAL of a board that exists only in memory, on virtual time.

Its pulse engine executes the commands that a PIO state machine gets on a board (hal/rp2/pulses.py),
and reports each edge.
"""

from array import array

from framestep.base.clock import WIDE_WRAP
from framestep.base.native import addressof
from framestep.base.native_cpython import map_device
from framestep.hal import CHANGED, QUESTION
from framestep.hal.absent import NoDmx, NoWatchdog
from framestep.hal.servos import make_servos
from framestep.pulse import engine
from framestep.pulse.kernel import StepKernel, wider
from framestep.pulse.shape import pulse_shape

CLOCK_HZ = 125_000_000
CYCLES = CLOCK_HZ // 1000
NS_PER_CYCLE = 8
TICK_NS = 1_000_000
TICK_DELAY_NS = 7_000  # from the timer's alarm to the first line of the interrupt handler
UPLOAD_BYTES = 176 * 1024
# as boards/pico/board.json, except for motors
BOARD = {
    "clocks": [125, 150, 200],
    "clock_mhz": 200,
    "chip": "rp2040",
    "pins": 30,
    "step": [2, 4, 6, 8, 10, 12, 14, 16],
    "dir": [3, 5, 7, 9, 11, 13, 15, 17],
    "enable": 18,
    "estop": 19,
    "shutter": 20,
    "meter": 21,
    "dmx": {"uart": 0, "tx": 0, "rx": 1},
    "gio": [22, 26, 27, 28],
    "with_drivers": {
        "drivers": {"uart": 1, "tx": 20, "rx": 21, "address": [0, 1, 2, 3]},
        "shutter": 26,
        "meter": 27,
        "gio": [22, 28],
    },
}


def pin_names(board):
    """Return {pin: name} of a board's inputs and outputs, as in traces."""
    names = {board[key]: key for key in ("estop", "shutter", "meter") if key in board}
    for key, name in (("gio", "gio"), ("outputs", "out"), ("inputs", "in"), ("stops", "stop")):
        names.update({pin: "%s%d" % (name, i) for i, pin in enumerate(board.get(key, []), 1)})
    return names


class PulseModel:
    """The pulse engine of one motor: commands in, edges out, times in cycles.

    It is written to like a FIFO register (`model[0] = command`). As on the chip, a command that
    finds the FIFO full is lost; `lost` counts these.
    """

    def __init__(self, clock, width, on_step, on_direction, both_edges=False):
        self.clock = clock  # returns the present cycle
        self.on_step = on_step  # f(cycle, direction level) at each edge that is a step
        self.on_direction = on_direction  # f(cycle, level) at each change
        # beyond the gap: to the first step, from one step to the next
        self.first = 9 if both_edges else 8
        self.period = engine.EDGE_CYCLES if both_edges else engine.PERIOD_CYCLES + wider(width)
        self.free_at = 0  # cycle at which the last command is done
        self.waiting = []  # cycles at which the commands in the FIFO will be fetched
        self.level = 0
        self.lost = 0

    def __setitem__(self, index, command):
        now = self.clock()
        waiting = self.waiting
        while waiting and waiting[0] <= now:
            del waiting[0]
        if len(waiting) >= engine.COMMANDS:
            self.lost += 1
            return
        start = self.free_at if self.free_at > now else now
        waiting.append(start)
        level = command & engine.DIRECTION
        pulses = (command >> engine.PULSES) & 0x1FF
        gap = (command >> engine.GAP) & 0x3FFFF
        if level != self.level:
            self.level = level
            self.on_direction(start + 2, level)
        if pulses == 0:
            self.free_at = start + gap + engine.WAIT_CYCLES
            return
        period = gap + self.period
        on_step = self.on_step
        first = start + gap + self.first
        for cycle in range(first, first + pulses * period, period):
            on_step(cycle, level)
        self.free_at = start + engine.COMMAND_CYCLES + pulses * period


class HostPort:
    """The protocol port; whoever drives the board is at its far end."""

    def __init__(self):
        self.open = False
        self.answer = False
        self.openings = 0
        self.incoming = bytearray()
        self.outgoing = bytearray()
        self._buffer = bytearray(512)

    def start(self):
        pass

    def ask(self):
        """Let the questions that have come be answered at once, as by a USB port."""
        size = 1
        while size and self.answer and self.open and self._has_frame():
            size = self.answer(self.incoming, 0, self._buffer)  # type: ignore[operator]
            if size:
                del self.incoming[: self._size()]
                self.outgoing += self._buffer[:size]

    def _has_frame(self):
        waiting = len(self.incoming)
        return waiting >= QUESTION and waiting >= self._size()

    def _size(self):
        return QUESTION + self.incoming[8] + (self.incoming[9] << 8)

    def poll(self, reader):
        moved = 0
        while self.incoming:
            taken = reader.feed(self.incoming, 0, len(self.incoming))
            if not taken:
                break
            del self.incoming[:taken]
            moved += taken
        return moved

    def glance(self):
        pass

    def look_for_stop(self):
        pass

    def send(self, writer):
        while True:
            count = writer.take(self._buffer, len(self._buffer))
            if not count:
                return
            if self.open:
                self.outgoing += self._buffer[:count]


class HostDmx:
    """Reports each changed level as an edge of `dmx1` … `dmx512`."""

    channels = 512

    def __init__(self, hal):
        self.hal = hal
        self.shown = bytearray(self.channels + 1)

    def show(self, lights):
        if not lights.words[CHANGED]:
            return
        lights.words[CHANGED] = 0
        for channel in range(1, self.channels + 1):
            level = lights.levels[channel]
            if level != self.shown[channel]:
                self.shown[channel] = level
                self.hal.report_edge("dmx%d" % channel, level)


class HostWatchdog:
    """Keeps the time by which it must be fed. caused_reset: as if it had restarted the board."""

    def __init__(self, hal, caused_reset=False):
        self.hal = hal
        self.caused_reset = caused_reset
        self.strikes_at = None  # ns
        self._ms = 0

    def arm(self, ms):
        self._ms = ms
        self.feed()

    def feed(self):
        self.strikes_at = self.hal.now_ns + self._ms * 1_000_000

    def disarm(self):
        self.strikes_at = None


class SilentWire:
    """A driver UART with nothing connected to it."""

    def select(self, motor):
        pass

    def send(self, buffer, count):
        pass

    def receive(self, buffer, at, limit):
        return 0


class HostFlash:
    """Two blocks in memory. Programming clears bits; only erasing sets them."""

    def __init__(self, blocks=2, size=1024):
        self.blocks = blocks
        self.bytes = size
        self.content = [bytearray(b"\xff" * size) for _ in range(blocks)]
        self.erasures = [0] * blocks

    def read(self, block, at, buffer):
        view = memoryview(buffer).cast("B")
        view[:] = self.content[block][at : at + len(view)]

    def program(self, block, at, page):
        content = self.content[block]
        for i, byte in enumerate(bytes(page), at):
            content[i] &= byte
        return True

    def erase(self, block, page):
        self.content[block][:] = b"\xff" * self.bytes
        self.erasures[block] += 1
        return True


class _Register:
    """A register that raises or lowers the pins of a mask, for the tick's cues."""

    def __init__(self, write):
        self.write = write

    def __setitem__(self, index, mask):
        self.write(mask)


class HostHal:
    """See framestep.hal.contract. Time does not pass until HostBoard moves it on."""

    def __init__(self, motors, rig, caused_reset=False, wire=None, flash=None, upload_bytes=0):
        self._flash = flash
        self.motors = motors
        self.now_ns = 0
        self.upload_bytes = upload_bytes or UPLOAD_BYTES
        self.port = HostPort()
        self.on_edge = None
        self.colour = 0  # of the LED, 0xRRGGBB
        self.taken = -1  # what the next reclaim() finds
        self.clock_changed = False  # as by a program on the REPL
        self.floats = 0
        self.board = rig.board
        self.driver_wire = wire(self) if wire else SilentWire()
        self.said = []  # lines that were printed about drivers
        self.names = pin_names(rig.board)
        self._places = {}  # bit numbers of pins, where pin numbers may be above 29
        self._outputs = 0  # pins that are driven
        self._levels = 0  # of all pins
        self._watchers = []  # (bits of inputs, handler)
        self.dmx = HostDmx(self) if rig.dmx and "dmx" in rig.board else NoDmx()
        self.watchdog = HostWatchdog(self, caused_reset) if rig.watchdog else NoWatchdog()
        self._clock = array("i", [0])
        self.kernel = StepKernel(motors, CYCLES, addressof(self._clock))
        self._set = _Register(lambda mask: self.drive(mask, 0))
        self._clear = _Register(lambda mask: self.drive(0, mask))
        self.kernel.outputs(map_device(self._set), map_device(self._clear))
        self.engines = []
        self._lost = [0] * motors  # commands, until the last call of take_lost_commands()
        for i in range(motors):
            settings = rig.motor(i)
            shape = pulse_shape(settings, CLOCK_HZ // 1000000)
            step = self._step(i, 0 if settings["invert"] else 1)
            model = PulseModel(
                self.cycle, shape[0], step, self._direction(i, rig.servos), shape[-1] > 0
            )
            self.kernel.configure(i, map_device(model), *shape)
            self.engines.append(model)
        self._servos = None
        if rig.servos:
            self._servos = make_servos(
                self.kernel,
                [rig.motor(i) for i in range(motors)],
                [map_device(model) for model in self.engines],
                CLOCK_HZ // 1000000,
            )

    def _step(self, motor, up):
        signal = "m%d" % (motor + 1)

        def step(cycle, level):
            on_edge = self.on_edge
            if on_edge:
                on_edge(cycle * NS_PER_CYCLE, signal, 1 if level == up else -1)

        return step

    def _direction(self, motor, servos):
        signal = "%s%d" % ("servo" if (servos >> motor) & 1 else "dir", motor + 1)

        def direction(cycle, level):
            if self.on_edge:
                self.on_edge(cycle * NS_PER_CYCLE, signal, level)

        return direction

    def cycle(self):
        return self.now_ns // NS_PER_CYCLE

    def start(self):
        pass

    def align(self):
        pass

    def flash(self):
        if self._flash is False:
            raise OSError("no flash")
        return self._flash or HostFlash()

    def irq_off(self):
        return 0

    def irq_on(self, state):
        pass

    def ticks_ms(self):
        return (self.now_ns // 1_000_000) & WIDE_WRAP

    def enable(self, motor, on):
        if self._servos and self._servos.enable(motor, on):
            return
        if self.on_edge:
            self.on_edge(self.now_ns, "enable%d" % (motor + 1), int(on))

    def report_driver(self, motor, text):
        self.said.append("driver of motor %d %s" % (motor, text))

    def report_edge(self, signal, level):
        if self.on_edge:
            self.on_edge(self.now_ns, signal, level)

    def _place(self, pin):
        """Return the number of a pin's bit."""
        if "chain" not in self.board:
            return pin
        return self._places.setdefault(pin, len(self._places))

    def output(self, pin, level):
        bit = 1 << self._place(pin)
        self._outputs |= bit
        self.drive(bit * level, bit * (1 - level))
        return bit

    def input(self, pin, pull):
        self.set_level(pin, 1 if pull == "up" else 0)
        return 1 << self._place(pin)

    def drive(self, high, low):
        levels = (self._levels | high) & ~low
        changed = (levels ^ self._levels) & self._outputs
        self._levels ^= changed
        for pin, name in self.names.items():
            place = self._places.get(pin, pin)
            if (changed >> place) & 1:
                self.report_edge(name, (levels >> place) & 1)

    def levels(self):
        return self._levels

    def watch(self, bits, handler):
        self._watchers.append((bits, handler))

    def set_level(self, pin, level):
        """Set the level of a pin from outside."""
        place = self._place(pin)
        if ((self._levels >> place) & 1) != level:
            self._levels ^= 1 << place
            self.report_edge(self.names.get(pin, "pin%d" % pin), level)
            for bits, handler in self._watchers:
                if (bits >> place) & 1:
                    handler(None)

    def led(self, colour):
        self.colour = colour

    def take_lost_commands(self):
        before, self._lost = self._lost, [model.lost for model in self.engines]
        return sum(1 << i for i, lost in enumerate(self._lost) if lost > before[i])

    def reclaim(self):
        found, self.taken = self.taken, -1
        return found

    def ready(self):
        return True

    def clock_kept(self):
        return not self.clock_changed

    def quiet(self):
        return False

    def idle(self):
        pass

    def tick(self):
        """Run one timer interrupt at the present moment."""
        self._clock[0] = (self.now_ns // 1000) & WIDE_WRAP
        self.kernel.tick(None)
        if self._servos:
            self._servos.pulse(None)
