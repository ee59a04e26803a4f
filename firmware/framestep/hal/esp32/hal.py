"""HAL of the ESP32: motors behind 74HC595 fed by I2S, ticks in batches from the main loop, the
protocol on the UART of the REPL. Never tried on hardware: docs/internals/esp32.md.

Pins up to LAST_PIN are the chip's own, for inputs. Output n of the chain is pin CHAIN + n: steps,
directions, enable lines, camera and general outputs. All of these change with their tick, which is
played after the length of the queue.

There are no hard interrupts. A pin's handler comes between two bytecodes of the main loop; in a
section where it must not come (irq_off), it waits for irq_on. A ramp would begin only after the
queue has been played. So the E-stop ends all pulses at once, and switches the drivers off as soon
as the chain is fed again. Positions are lost then.
"""

import gc
from array import array
from time import sleep_ms

from machine import Pin, Timer, idle, mem32

from framestep.base.native import const
from framestep.hal import PASS
from framestep.hal.absent import NoDmx, NoWatchdog
from framestep.hal.esp32.chain import Chain
from framestep.hal.stream import Stream
from framestep.pulse.engine import CYCLES  # type: ignore[attr-defined]
from framestep.pulse.kernel import StepKernel
from framestep.pulse.stepper import RUNNING, TICKS

_NO_TICK_MS = const(1000)  # I2S has ended: nothing more will be played
LAST_PIN = const(39)
CHAIN = const(64)
_OUTPUTS = const(30)  # of the chain: as many as fit a small integer
_LEAST = const(512)
_CLOSE = const(32)
_READINGS = const(4)  # of the E-stop, as in io/safety.py


def _release(block):
    """Free the memory of a bytearray, even if a word that looks like its address keeps the object
    alive: see release() of the RP2040's HAL."""
    mem32[id(block) + 8] = mem32[id(block) + 12] = 0


class Inside:
    """Calls work(x) with inside[PASS] at 1."""

    def __init__(self, work, inside):
        self.work = work
        self.inside = inside

    def call(self, x):
        self.inside[PASS] = 1
        try:
            self.work(x)
        finally:
            self.inside[PASS] = 0


def _no_led(_colour):
    pass


def bit_of(pin):
    """Return the bit of an output of the chain. Raises ValueError if the pin is not one."""
    if not CHAIN <= pin < CHAIN + _OUTPUTS:
        raise ValueError("pin %d: outputs are %d to %d" % (pin, CHAIN, CHAIN + _OUTPUTS - 1))
    return 1 << (pin - CHAIN)


class Esp32Hal:
    """See framestep.hal.contract. board: the data of boards/<board>/board.json; rig:
    framestep.rig.Rig. Raises ValueError for an output that is not a pin of the chain."""

    def __init__(self, board, rig):
        from framestep.pulse.shape import pulse_shape

        self.board = board
        self.motors = len(board["step"])
        steps = [bit_of(pin) for pin in board["step"]]
        stream = self.engine = Stream(steps, [bit_of(pin) for pin in board["dir"]])
        self.kernel = StepKernel(self.motors, CYCLES, stream.clock)
        for i in range(self.motors):
            shape = pulse_shape(rig.motor(i), CYCLES // 1000)
            self.kernel.configure(i, stream.fifo(i), *shape)
        self.drive = stream.drive
        self._make_drivers(board, rig)
        self.inside = array("i", [0] * (PASS + 1))
        self._sends_dmx = rig.dmx and "dmx" in board
        self.dmx = self._make_dmx(board, rig) if self._sends_dmx else NoDmx()
        self.watchdog = self._make_watchdog() if rig.watchdog else NoWatchdog()
        self.driver_wire = self._make_wire(board) if rig.drivers else None
        self.report_driver = None  # prints lines about drivers: see contract.py
        self.floats = 0
        self.passes = Timer(0)  # made now, as there may be no memory for it later
        self._inputs = []
        self._handler = None
        self._estop = rig.estop
        rig.estop_cuts_power = True  # it switches the drivers off: see _on_change()
        self._estop_pin = None
        self._held = 0  # no handler may come at present
        self._struck = False  # a handler waits
        self._cut = False  # the E-stop has ended the pulses
        self._landed = False
        chain = board["chain"]
        self.chain = Chain(
            stream, self.kernel, steps, board["buffers"], chain["sck"], chain["ws"], chain["sd"]
        )
        self._servos = self._make_servos(rig) if rig.servos else None
        self.port = self._make_port(rig)
        led = board.get("led")
        self.led = Pin(led, Pin.OUT, value=0).value if led is not None else _no_led

    # ------------------------------------------------------------ parts that a rig may do without

    def _make_port(self, rig):
        if rig.ports == 2:
            from framestep.hal.esp32.usb_port import OwnPort

            rig.ports = 1  # the passes stay in the foreground, as with one port
            return OwnPort(self)
        from framestep.hal.esp32.port import UartPort

        return UartPort(self, rig.settings["uart_baud"])

    def _make_dmx(self, board, rig):
        from framestep.hal.esp32.dmx import Dmx

        return Dmx(board["dmx"], rig.dmx_break_us, rig.dmx_mark_us)

    def _make_watchdog(self):
        from framestep.hal.esp32.watchdog import Watchdog

        return Watchdog()

    def _make_servos(self, rig):
        from framestep.hal.esp32.servos import Servos

        return Servos(self.kernel, rig, self.chain.ahead())

    def _make_wire(self, board):
        from framestep.hal.esp32.wire import Wire

        return Wire(board["drivers"])

    # ------------------------------------------------------------ drivers

    def _make_drivers(self, board, rig):
        """Set up the enable lines, with all drivers off."""
        enable = board["enable"]
        self._shared = not isinstance(enable, list)
        self._enable_bits = [bit_of(pin) for pin in ([enable] if self._shared else enable)]
        self._on_high = [rig.motor(i)["enable_high"] for i in range(len(self._enable_bits))]
        self._enabled = 0  # motors whose drivers should be on, a bit each
        self._drive_enables(0)

    def _drive_enables(self, motors):
        """Switch the drivers of these motors on, and all others off. motors: a bit each."""
        for i in range(len(self._enable_bits)):
            mine = motors if self._shared else motors & (1 << i)
            bit = self._enable_bits[i]
            if (mine != 0) == self._on_high[i]:
                self.engine.drive(bit, 0)
            else:
                self.engine.drive(0, bit)

    def enable(self, motor, on):
        if self._servos and self._servos.enable(motor, on):
            return
        if on:
            self._enabled |= 1 << motor
        else:
            self._enabled &= ~(1 << motor)
        if not self._cut:
            self._drive_enables(self._enabled)

    # ------------------------------------------------------------ the main loop

    @property
    def upload_bytes(self):
        """Size of the largest free block of memory, less a few bytes. Allocates for a moment."""
        size = _LEAST
        gc.collect()
        most = gc.mem_free()
        while most - size > _CLOSE:
            middle = (size + most) // 2
            try:
                _release(bytearray(middle))
                size = middle
            except MemoryError:
                most = middle
            gc.collect()
        return size

    def start(self):
        self.port.start()

    idle = staticmethod(idle)

    def irq_off(self):
        before = self._held
        self._held = 1
        return before

    def irq_on(self, state):
        self._held = state
        if not state and self._struck:
            self._on_change(None)

    def serve(self):
        """Keep the chain fed, servos and DMX going. To be called in each pass."""
        before = self.irq_off()
        if self._cut:
            self._recover()
        elif self._pressed():  # whether or not its interrupt came
            self._end_pulses()
        self.chain.serve()
        if self._servos:
            self._servos.serve()
        if self._sends_dmx:
            self.dmx.serve()  # type: ignore[union-attr]
        self.irq_on(before)

    def land(self):
        """After the passes have ended, continue until all motors are at rest and their last pulses
        have been played."""
        if self._landed:
            return
        self._landed = True
        left = self.chain.ahead()
        state = self.kernel.state
        idle = 0  # ms since the last tick
        while left and idle < _NO_TICK_MS:
            tick = state[TICKS]
            self.serve()
            sleep_ms(1)
            idle = idle + 1 if state[TICKS] == tick else 0
            if not state[RUNNING]:
                left -= 1
        self.chain.deinit()

    def pass_callback(self, work):
        return Inside(work, self.inside).call

    # ------------------------------------------------------------ pins

    def output(self, pin, level):
        bit = bit_of(pin)
        if level:
            self.engine.drive(bit, 0)
        else:
            self.engine.drive(0, bit)
        return bit

    def input(self, pin, pull):
        if pin > LAST_PIN:
            raise ValueError("pin %d: inputs are 0 to %d" % (pin, LAST_PIN))
        if pull == "none":
            made = Pin(pin, Pin.IN)
        else:
            made = Pin(pin, Pin.IN, Pin.PULL_UP if pull == "up" else Pin.PULL_DOWN)
        self._inputs.append(made)
        if self._estop != "none" and pin == self.board.get("estop"):
            self._estop_pin = made
        return 1 << (len(self._inputs) - 1)

    def levels(self):
        """Return the inputs that are high, one bit each, without outputs."""
        bits = 0
        bit = 1
        for pin in self._inputs:
            if pin():
                bits |= bit
            bit <<= 1
        return bits

    def watch(self, bits, handler):
        self._handler = handler
        for i, pin in enumerate(self._inputs):
            if (bits >> i) & 1:
                pin.irq(self._on_change, Pin.IRQ_RISING | Pin.IRQ_FALLING)

    def _pressed(self):
        """Return whether several readings in a row find the E-stop active: no spike."""
        pin = self._estop_pin
        if pin is None:
            return False
        active = 1 if self._estop == "nc" else 0
        for _ in range(_READINGS):
            if pin() != active:
                return False
        return True

    def _on_change(self, _pin):
        """Handle a changed switch. Called by MicroPython's scheduler, or later by irq_on()."""
        if self._held:
            self._struck = True
            return
        self._held = 1
        self._struck = False
        self._handler(None)
        if self._pressed() and not self._cut:
            self._end_pulses()
        self._held = 0

    def _end_pulses(self):
        self._cut = True
        self.chain.cut()
        self.chain.take_lost()  # no fault: see rig.estop_cuts_power
        self._drive_enables(0)

    def _recover(self):
        """After an E-stop: first the chain, with all drivers off. Once nothing moves and the button
        has been released, re-enable the drivers that should be on."""
        if self.chain.recovered() and not self._pressed():
            self._cut = False
            self._drive_enables(self._enabled)

    def align(self):
        pass  # the chain's clock makes the ticks

    def take_lost_commands(self):
        return self.chain.take_lost()

    def reclaim(self):
        return -1

    def ready(self):
        return not self._cut

    def clock_kept(self):
        return True  # I2S times the pulses by a clock of its own

    def quiet(self):
        return False  # the passes run in the foreground, so nobody uses the REPL meanwhile

    def flash(self):
        """See hal/contract.py. A write delays interrupts by 45 ms. That does no harm: the journal
        of positions writes only at rest, when a ring that runs out repeats the same levels."""
        from esp32 import Partition

        from framestep.hal.flash import Flash

        found = Partition.find(Partition.TYPE_DATA, label="vfs")
        if not found:
            raise OSError("there is no partition vfs")
        return Flash(found[0])
