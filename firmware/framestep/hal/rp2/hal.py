"""HAL of the RP2040 and RP2350: PIO pulses, a hard 1 kHz timer, a USB port for the protocol."""

import gc
from array import array

import machine
from machine import Pin, Timer, mem32
from micropython import alloc_emergency_exception_buf

from framestep.base.clock import WIDE_WRAP
from framestep.base.native import addressof, const, micropython, ptr32
from framestep.hal import PASS, REPL_STACK
from framestep.hal.rp2.pin_guard import Claim, held_pin, mend, wrong
from framestep.hal.rp2.pins import drive, drivers_off, enable_pins, levels
from framestep.hal.rp2.pulses import lost_commands
from framestep.hal.rp2.stack import NOWHERE, WholeStack, set_limit, unchecked
from framestep.hal.rp2.usb import addressed
from framestep.pulse.engine import RING
from framestep.pulse.stepper import CLOCK, DUE, TICK_US, halt

_LEAST = const(512)
_CLOSE = const(32)
_ANY = const(0x3FFFFFFF)
_GUARD_MS = const(3)  # a bus reset takes at least ten
_TRACEBACK_BYTES = const(256)  # for an exception in a pass, where it cannot allocate


def release(block):
    """Free the memory of a bytearray, even if the object itself survives.

    The garbage collector takes any word for a pointer, even machine code: "pop {r5}; movs r0, #0"
    looks like one. Such a word may keep the object alive, which is 16 bytes.
    """
    # length and address: py/objarray.h, mp_obj_array_t
    mem32[id(block) + 8] = mem32[id(block) + 12] = 0


class Rp2Hal:
    """See framestep.hal.contract. board: the data of boards/<board>/board.json; rig:
    framestep.rig.Rig."""

    def __init__(self, board, rig):
        import rp2

        from framestep.hal.rp2 import peripherals

        self.board = board
        self._raw_repl = getattr(rp2, "raw_repl", bool)  # an older image below an overlay has none
        self._stack = set_limit(REPL_STACK)
        self.motors = len(board["step"])
        self._hz = machine.freq()
        self.engine, self.kernel = peripherals.engine(board, rig)
        if RING:  # pins of the shift registers
            self._lines = sum(1 << pin for pin in board["registers"].values())
        self._servos = peripherals.servos(self, rig) if rig.servos else None
        # Drivers stay off until a motor has to move.
        self._on_level = [1 if rig.motor(i)["enable_high"] else 0 for i in range(self.motors)]
        self._enabled = 0
        self._shared = not isinstance(board["enable"], list)
        with Claim(*enable_pins(board)):
            self._enable_pins = drivers_off(board, rig)
        self.floats = self._motors_of(1 << held_pin()) if held_pin() >= 0 else 0
        self._everyone = (1 << self.motors) - 1
        self._bus_guard_callback = self._bus_guard
        self.dmx = peripherals.dmx(board.get("dmx"), rig)
        self._watched = rig.watchdog
        self.watchdog = peripherals.watchdog(rig)
        self.inside = self.watchdog.words if rig.watchdog else array("i", [0] * (PASS + 1))
        self.report_driver = None  # prints lines about drivers: see contract.py
        self.driver_wire = peripherals.wire(board["drivers"], self.motors) if rig.drivers else None
        self.port = peripherals.port(rig.ports)
        self.ticker = None
        self.passes = Timer(-1)  # made now, as there may be no memory for it later
        self.led = peripherals.led(board, self.motors)

    def clock_kept(self):
        return machine.freq() == self._hz

    def quiet(self):
        return self._raw_repl()

    def flash(self):
        import rp2

        from framestep.hal.flash import Flash

        return Flash(rp2.Flash())

    @property
    def upload_bytes(self):
        """Size of the largest free block of memory, less a few bytes. Allocates for a moment."""
        gc.collect()
        size = _LEAST
        most = gc.mem_free()
        while most - size > _CLOSE:
            middle = (size + most) // 2
            try:
                release(bytearray(middle))
                size = middle
            except MemoryError:
                most = middle
        gc.collect()
        return size

    def start(self):
        called = [type(self.kernel.state).tick, Rp2Hal._bus_guard, WholeStack.call]
        if self._watched:
            called.append(type(self.watchdog)._look)
        if self._servos:
            called.append(type(self._servos).pulse)
        self._kinds = unchecked(*called)
        alloc_emergency_exception_buf(_TRACEBACK_BYTES)
        if RING:
            self.ticker = self.engine.start()
        else:
            self.ticker = Timer(
                -1, period=1, mode=Timer.PERIODIC, callback=self.kernel.tick, hard=True
            )
        if self._servos:
            self._pulses = Timer(
                -1, period=1, mode=Timer.PERIODIC, callback=self._servos.pulse, hard=True
            )
        if self.floats:
            self._guard = Timer(
                -1,
                period=_GUARD_MS,
                mode=Timer.PERIODIC,
                callback=self._bus_guard_callback,
                hard=True,
            )
        if self._watched:
            self.watchdog.guard(self.kernel.state)
        self.port.start()

    # Timer.init() moves the timer's grid and takes nothing from the heap. In a viper function no
    # Ctrl-C can come between its two halves.
    @micropython.viper
    def align(self):
        if RING:  # ticks come with the words that are sent
            return
        kernel = self.kernel
        header = kernel.state
        state = ptr32(header)
        self.ticker.init(period=1, callback=kernel.tick, hard=True)
        state[DUE] = ptr32(state[CLOCK])[0] + TICK_US & WIDE_WRAP
        self.passes.init(period=1, callback=self._pass)

    irq_off = staticmethod(machine.disable_irq)
    irq_on = staticmethod(machine.enable_irq)
    idle = staticmethod(machine.idle)

    def enable(self, motor, on):
        """Switch a driver on or off. Drivers that share a pin are on while any of them is."""
        if self._servos and self._servos.enable(motor, on):
            return
        bit = 1 << motor
        if on:
            self._enabled |= bit
        else:
            self._enabled &= ~bit
        pin = 0 if self._shared else motor
        lit = self._enabled if self._shared else self._enabled & bit
        level = self._on_level[pin]
        self._enable_pins[pin].value(level if lit else 1 - level)

    drive = staticmethod(drive)
    levels = staticmethod(levels)

    def output(self, pin, level):
        with Claim(pin):
            Pin(pin, Pin.OUT, value=level)
        return 1 << pin

    def input(self, pin, pull):
        with Claim(pin):
            if pull == "none":
                Pin(pin, Pin.IN)
            else:
                Pin(pin, Pin.IN, pull=Pin.PULL_UP if pull == "up" else Pin.PULL_DOWN)
        return 1 << pin

    def pass_callback(self, work):
        header = addressof(self.kernel.state)
        self._pass = WholeStack(self._stack, work, self.inside, header).callback
        return self._pass

    def watch(self, bits, handler):
        handler = WholeStack(self._stack, handler, NOWHERE).callback
        for pin in range(30):
            if (bits >> pin) & 1:
                Pin(pin).irq(handler, Pin.IRQ_RISING | Pin.IRQ_FALLING, hard=True)

    def take_lost_commands(self):
        return lost_commands(self.motors)

    # ------------------------------------------------------------ pins that something else takes

    def _motors_of(self, bits):
        """Return the motors that use one of these pins (step, direction, driver), a bit each."""
        board = self.board
        enable = board["enable"]
        if RING and bits & self._lines:
            return self._everyone
        motors = 0
        for i in range(self.motors):
            if ((bits >> board["step"][i]) | (bits >> board["dir"][i])) & 1:
                motors |= 1 << i
            if (bits >> (enable if self._shared else enable[i])) & 1:
                motors |= 1 << i
        return motors

    def reclaim(self):
        if not wrong():
            return -1
        bits = mend()
        return self._motors_of(bits) if bits else -1

    def ready(self):
        return not self.floats or addressed()

    @micropython.viper
    def _bus_guard(self, _timer):
        """After a bus reset, ramp down every motor at once, however busy the main loop is, and let
        none turn. Ten milliseconds later the chip lets go of a pin, which may be a direction pin. A
        hard interrupt."""
        if not addressed():
            halt(self.kernel.blocks[0], self._everyone, _ANY, 1)
