"""RP2040 and RP2350: PIO pulses, a hard 1 kHz timer, the protocol on a USB port of its own.

With two ports the controller runs in the background, called by a timer from MicroPython's scheduler,
and the REPL stays what it is. With one port it runs in the foreground, as the port is the REPL's.
"""

import gc
import io
import sys
from array import array
from os import dupterm, dupterm_notify  # type: ignore[attr-defined]
from time import ticks_ms  # modulo 2^30 where small integers have 31 bits

import machine
from machine import Pin, Timer
from micropython import alloc_emergency_exception_buf, heap_lock, heap_unlock

from framestep.controller import LED_FAULT, glow
from framestep.faults import FAULTS, outcome
from framestep.hal.engine import FASTEST_HZ, HIGH_CYCLES, WIDTH_CYCLES, WIDTHS
from framestep.hal.rp2_claims import Claim, held_pin, mend, wrong
from framestep.hal.rp2_pins import CLEAR_REGISTER, SET_REGISTER, drive, drivers_off, enable_pins, levels
from framestep.hal.rp2_pulses import PulseEngine, lost_commands
from framestep.hal.rp2_usb import addressed
from framestep.hal.rp2_watchdog import PASS
from framestep.motion.kernel import StepKernel
from framestep.motion.stepper import halt_motors
from framestep.moves.follow import UNTOLD, WHAT
from framestep.native import const, micropython
from framestep.protocol.messages import CONDITION_BARKED, CONDITION_FORGETFUL

_TIMER_RP2040 = const(0x40054028)  # TIMERAWL, RP2040 datasheet 4.6.5
_TIMER_RP2350 = const(0x400B0028)  # TIMER0 TIMERAWL, RP2350 datasheet 12.8.5
_LEAST = const(512)
_CLOSE = const(32)
_PASS_MS = const(1)
_SAYINGS = const(16)
_BEAT_MS = const(128)
_CTRL_C = const(3)
_ANY = const(0x3FFFFFFF)
_GUARD_MS = const(3)  # a bus reset takes ten at least
_TRACEBACK_BYTES = const(256)  # of an exception in a pass, which can be given no memory then


def _no_led(_colour):
    pass


class _CtrlC(io.IOBase):
    """A terminal on which somebody has pressed Ctrl-C."""

    def readinto(self, buffer):
        buffer[0] = _CTRL_C
        return 1

    def write(self, data):
        return len(data)

    def ioctl(self, request, argument):
        return 0


@micropython.viper
def _interrupt(terminal, notify, ctrl_c):
    """Let a KeyboardInterrupt strike as soon as MicroPython goes on with what this has interrupted."""
    before = terminal(ctrl_c)
    notify(None)
    terminal(before)


class Rp2Hal:
    """See framestep.hal. board: the data of boards/<board>/board.json; rig: framestep.rig.Rig."""

    def __init__(self, board, rig):
        self.board = board
        self.motors = len(board["step"])
        hz = machine.freq()
        while hz > FASTEST_HZ:
            hz //= 2
        cycles_per_us = hz // 1000000
        self.engine = PulseEngine(board["step"], board["dir"], hz)
        timer = _TIMER_RP2350 if "RP2350" in sys.implementation._machine else _TIMER_RP2040
        self.kernel = StepKernel(self.motors, cycles_per_us * 1000, timer)
        self.kernel.outputs(SET_REGISTER, CLEAR_REGISTER)
        for i in range(self.motors):
            settings = rig.motor(i)
            width = (int(settings["pulse_us"] * cycles_per_us) - HIGH_CYCLES + WIDTH_CYCLES // 2) // WIDTH_CYCLES
            setup = int(settings["setup_us"] * cycles_per_us)
            width = 0 if width < 0 else WIDTHS - 1 if width >= WIDTHS else width
            self.kernel.configure(i, self.engine.fifo(i), width, setup, settings["invert"])
        # Drivers stay off until a motor is to move.
        self._on_level = [1 if rig.motor(i)["enable_high"] else 0 for i in range(self.motors)]
        self._enabled = 0
        self._shared = not isinstance(board["enable"], list)
        with Claim(*enable_pins(board)):
            self._enable_pins = drivers_off(board, rig)
        self.floats = self._motors_of(1 << held_pin()) if held_pin() >= 0 else 0
        self._everyone = (1 << self.motors) - 1
        self._bus_guard_callback = self._bus_guard
        self.dmx = self._make_dmx(board.get("dmx"), rig)
        self._watched = rig.watchdog
        self.watchdog = self._make_watchdog(rig)
        # [PASS]: within a pass
        self._inside = self.watchdog.words if rig.watchdog else array("i", [0] * (PASS + 1))
        self._sayings = 0  # how often drivers have been said to do something since it was told; the last are kept
        self._saying_motors = bytearray(_SAYINGS)
        self._saying_texts = [""] * _SAYINGS
        self.wire = self._make_wire(board["drivers"]) if rig.drivers else None
        self.port = self._make_port(rig.ports)
        self.background = rig.ports == 2
        self._ticker = None
        # Made now, as there may be no memory for them later
        self._passes = Timer(-1)
        self._pass_callback = self._pass
        self._blink_callback = self._blink
        self._beat = 0
        self._controller = None
        self.failure = None  # the exception that ended the passes
        self.alive = False  # passes go on
        self.task = None  # what framestep.repl wants done between two passes
        self._traceback_task = self._traceback
        self._failing = False  # a pass was broken off: the next one stops the motors
        self._failed = False  # that is to be told
        self._news = False  # that or something of drivers is
        self._struck = False  # Ctrl-C came in a pass: it is passed on to whom it was for
        self._ctrl_c = _CtrlC()
        self.led = self._make_led(board)

    def _make_dmx(self, wiring, rig):
        if wiring is None or not rig.dmx:
            from framestep.hal.absent import NoDmx

            return NoDmx()
        from framestep.hal.rp2_dmx import Dmx

        with Claim(wiring["tx"], wiring["rx"]):
            dmx = Dmx(
                wiring, machine.freq(), rig.dmx_break_us, rig.dmx_mark_us, "RP2350" in sys.implementation._machine
            )
        dmx.start()
        return dmx

    def _make_watchdog(self, rig):
        if rig.watchdog:
            from framestep.hal.rp2_watchdog import Watchdog

            return Watchdog()
        from framestep.hal.absent import NoWatchdog

        return NoWatchdog()

    def _make_wire(self, wiring):
        if "pins" in wiring:
            from framestep.hal.rp2_one_wire import OneWire

            pins = wiring["pins"][: self.motors]
            with Claim(*pins):
                return OneWire(pins, self.motors)
        from framestep.hal.rp2_wire import Wire

        with Claim(wiring["tx"], wiring["rx"]):
            return Wire(wiring, "RP2350" in sys.implementation._machine)

    def _make_led(self, board):
        if "led" in board:
            with Claim(board["led"]):
                return Pin(board["led"], Pin.OUT, value=0).value
        if "rgb" not in board:
            return _no_led
        from framestep.hal.rp2_rgb import RgbLed

        # The next state machine behind those of the motors, unless the drivers' lines (rp2_one_wire) begin with it.
        machine = self.motors
        if machine % 4 == 0:
            machine += 2 * len(board.get("drivers", {}).get("pins", ()))
        with Claim(board["rgb"]):
            return RgbLed(board["rgb"], machine).show

    def flash(self):
        from framestep.hal.rp2_flash import Flash

        return Flash()

    def _make_port(self, ports):
        if ports == 2:
            from framestep.hal.usb_port import UsbPort

            return UsbPort()
        from framestep.hal.stdin_port import StdinPort

        return StdinPort()

    @property
    def upload_bytes(self):
        """The largest block of memory that there is, but for a few bytes. Allocates, for a moment."""
        gc.collect()
        size = _LEAST
        most = gc.mem_free()
        while most - size > _CLOSE:
            middle = (size + most) // 2
            try:
                bytearray(middle)
                size = middle
            except MemoryError:
                most = middle
        gc.collect()
        return size

    def start(self):
        alloc_emergency_exception_buf(_TRACEBACK_BYTES)
        self._ticker = Timer(-1, period=1, mode=Timer.PERIODIC, callback=self.kernel.tick, hard=True)
        if self.floats:
            self._guard = Timer(-1, period=_GUARD_MS, mode=Timer.PERIODIC, callback=self._bus_guard_callback, hard=True)
        if self._watched:
            self.watchdog.guard(self.kernel.state)  # type: ignore[union-attr]
        self.port.start()

    irq_off = staticmethod(machine.disable_irq)
    irq_on = staticmethod(machine.enable_irq)
    idle = staticmethod(machine.idle)

    def ticks_ms(self):
        return ticks_ms()

    def enable(self, motor, on):
        """Switch a driver on or off; drivers that share a pin are on while one of them is."""
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

    def watch(self, bits, handler):
        for pin in range(30):
            if bits >> pin & 1:
                Pin(pin).irq(handler, Pin.IRQ_RISING | Pin.IRQ_FALLING, hard=True)

    def say(self, motor, text):
        place = self._sayings % _SAYINGS
        self._saying_motors[place] = motor
        self._saying_texts[place] = text
        self._sayings += 1
        self._news = True

    def trouble(self):
        return lost_commands(self.motors)

    # ---------------------------------------------------------------- pins that something else takes

    def _motors_of(self, bits):
        """Motors that have one of these pins for their steps, direction or driver, a bit each."""
        board = self.board
        enable = board["enable"]
        motors = 0
        for i in range(self.motors):
            if (bits >> board["step"][i] | bits >> board["dir"][i]) & 1:
                motors |= 1 << i
            if bits >> (enable if self._shared else enable[i]) & 1:
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
        """After a bus reset every motor ramps down at once, however busy the main loop is, and none turns round on the
        way: ten milliseconds later the chip lets go of a pin, which might be the direction of one. A hard interrupt."""
        if not addressed():
            halt_motors(self.kernel.blocks, self._everyone, 1, _ANY)

    # ---------------------------------------------------------------- running a controller
    #
    # A pass runs with the heap locked: it needs none, and MicroPython then puts call frames of more than eleven words
    # on the stack, for which it would otherwise search the whole heap, and collect it where it is full: 30 ms for each
    # frame. What runs outside the lock has smaller frames (a test counts them), or may take long. A program on the REPL
    # may have taken all memory: then everything goes on, and what needs no memory is told.

    def run(self, controller):
        """Run it: in the background, and return at once, or until a Ctrl-C on its own port."""
        self._controller = controller
        self.alive = True
        if self.background:
            self._passes.init(period=_PASS_MS, mode=Timer.PERIODIC, callback=self._pass_callback)
            return
        idle = machine.idle
        try:
            while True:
                if not self._poll():
                    idle()
        except KeyboardInterrupt:
            self.stop()
            raise
        except Exception as error:
            self.failure = error
            self._broken()
        finally:
            self.port.stop()  # the REPL has it again
            self._tell_all()

    def _poll(self):
        """One pass in the foreground. Returns what the controller's poll() does."""
        heap_lock()
        self._inside[PASS] = 1
        try:
            return self._controller.poll(ticks_ms())  # type: ignore[union-attr]
        finally:
            self._inside[PASS] = 0
            heap_unlock()

    # MicroPython raises a Ctrl-C that is pending at the next branch. So there is none here in front of _turn(), which
    # expects it, nor behind the last line, which passes it on.
    def _pass(self, _timer):
        heap_lock()
        try:
            self._turn()
        finally:
            self._inside[PASS] = 0
            heap_unlock()
        if self.task:
            self._after()
        if self._struck:
            self._struck = False
            _interrupt(dupterm, dupterm_notify, self._ctrl_c)

    def _turn(self):
        """One pass in the background, whatever strikes in it. Ctrl-C is meant for a program that runs on the REPL."""
        controller = self._controller
        try:
            if not self.alive:
                return  # this pass waited in the scheduler when they ended
        except KeyboardInterrupt:
            self._struck = True  # where nothing is half done
        try:
            if self._failing:
                controller.fail()  # type: ignore[union-attr]
                self._failing = False
                self._failed = self._news = True
            self._inside[PASS] = 1
            controller.poll(ticks_ms())  # type: ignore[union-attr]
        except KeyboardInterrupt:
            self._struck = self._failing = True
            return
        except Exception as error:
            self.failure = error
            self._end()
            self.task = self._traceback_task
            return
        if (controller.untold or self._news) and not controller.was_moving:  # type: ignore[union-attr]
            self._tell()

    def _after(self):
        """What a pass may not do itself, as it allocates."""
        if self._failing and self.alive:
            return  # what the pass was at is half done
        task = self.task
        self.task = None
        try:
            task()  # type: ignore[misc]
        except KeyboardInterrupt:
            self._struck = self._failing = True
        except Exception as error:
            sys.print_exception(error)  # type: ignore[attr-defined]

    def _end(self):
        """An exception has ended the passes."""
        self.stop()
        self._controller.give_up()  # type: ignore[union-attr]

    def _broken(self):
        """The same in the foreground."""
        heap_lock()
        try:
            self._end()
        finally:
            heap_unlock()
        self._traceback()

    def _traceback(self):
        self._passes.init(period=_BEAT_MS, mode=Timer.PERIODIC, callback=self._blink_callback)
        print("framestep: stopped by a fault in the firmware; a reset starts it again")
        sys.print_exception(self.failure)  # type: ignore[attr-defined]

    def _tell(self):
        """Say why motors were stopped, and what drivers do. Not on the protocol's own port, nor while motors move, as
        the REPL's host may let the board wait. Allocates nothing."""
        untold = self._controller.untold  # type: ignore[union-attr]
        self._controller.untold = 0  # type: ignore[union-attr]
        for bit, text in FAULTS:
            if untold & bit:
                print("framestep: ", text, outcome(bit), sep="")
        self._news = False
        told = self._controller.stage.follower.exceeded  # type: ignore[union-attr]
        if untold & UNTOLD and told[WHAT]:
            print("framestep: the last move asks too much of motor", told[1] + 1, "at frame", told[2], "- see status()")
        if self._failed:
            self._failed = False
            print("framestep: Ctrl-C came in the middle of the controller's work; the motors were ramped down")
        sayings = self._sayings
        self._sayings = 0
        if sayings > _SAYINGS:
            print("framestep: drivers:", sayings - _SAYINGS, "earlier lines are lost")
        for i in range(max(0, sayings - _SAYINGS), sayings):
            print("framestep: driver of motor", self._saying_motors[i % _SAYINGS], self._saying_texts[i % _SAYINGS])

    def _tell_all(self):
        """When the protocol gives back the REPL's port: everything that could not be said there since the start."""
        try:
            from framestep import words

            bits = self._controller.condition() & (CONDITION_BARKED | CONDITION_FORGETFUL)  # type: ignore[union-attr]
            for line in words.conditions(bits):
                print("framestep:", line)
        except MemoryError:
            pass
        self._tell()

    def _blink(self, _timer):
        """The LED, when no passes do it any more."""
        self._beat = (self._beat + 1) & 15
        self.led(glow(LED_FAULT, self._beat))

    def stop(self):
        """End the passes; the motors ramp down. The REPL is left as it was, and no watchdog strikes it."""
        self.alive = False
        self._passes.deinit()
        heap_lock()
        try:
            self.led(0)
            self.watchdog.disarm()
            if self._controller:
                self._controller.abandon()
        finally:
            heap_unlock()
