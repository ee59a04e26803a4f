"""RP2040 and RP2350: PIO pulses, a hard 1 kHz timer, the protocol on a USB port of its own.

With two ports the controller runs in the background, called by a timer from MicroPython's scheduler,
and the REPL stays what it is. With one port it runs in the foreground, as the port is the REPL's.
"""

import gc
import sys
from time import ticks_ms  # modulo 2^30 where small integers have 31 bits

import machine
from machine import Pin, Timer
from micropython import alloc_emergency_exception_buf, heap_lock, heap_unlock

from framestep.controller import LED_FAULT, glow
from framestep.hal import NoDmx, NoWatchdog
from framestep.hal.rp2_pins import CLEAR_REGISTER, SET_REGISTER, drive, drivers_off, levels
from framestep.hal.rp2_pulses import PulseEngine, lost_commands
from framestep.motion.stepper import StepKernel
from framestep.native import const
from framestep.protocol.messages import CONDITION_BARKED, CONDITION_FORGETFUL

_TIMER_RP2040 = const(0x40054028)  # TIMERAWL, RP2040 datasheet 4.6.5
_TIMER_RP2350 = const(0x400B0028)  # TIMER0 TIMERAWL, RP2350 datasheet 12.8.5
_FASTEST_ENGINE = const(131000000)  # cycles per second: two ticks must fit a command's 18 bits
_STEP = const(512)
_PASS_MS = const(1)
_SAYINGS = const(16)
_BEAT_MS = const(128)
_TRACEBACK_BYTES = const(256)  # of an exception in a pass, which can be given no memory then


def _no_led(_colour):
    pass


class Rp2Hal:
    """See framestep.hal. board: the data of boards/<board>/board.json; rig: framestep.rig.Rig."""

    def __init__(self, board, rig):
        self.motors = len(board["step"])
        hz = machine.freq()
        while hz > _FASTEST_ENGINE:
            hz //= 2
        cycles_per_us = hz // 1000000
        self.engine = PulseEngine(board["step"], board["dir"], hz)
        timer = _TIMER_RP2350 if "RP2350" in sys.implementation._machine else _TIMER_RP2040
        self.kernel = StepKernel(self.motors, cycles_per_us * 1000, timer)
        self.kernel.outputs(SET_REGISTER, CLEAR_REGISTER)
        for i in range(self.motors):
            settings = rig.motor(i)
            width = (int(settings["pulse_us"] * cycles_per_us) - 34 + 16) // 32
            setup = int(settings["setup_us"] * cycles_per_us)
            width = 0 if width < 0 else 15 if width > 15 else width
            self.kernel.configure(i, self.engine.fifo(i), width, setup, settings["invert"])
        # Drivers stay off until a motor is to move.
        self._on_level = [1 if rig.motor(i)["enable_high"] else 0 for i in range(self.motors)]
        self._enabled = 0
        self._shared = not isinstance(board["enable"], list)
        self._enable_pins = drivers_off(board, rig)
        self.board = board
        self.dmx = self._make_dmx(board.get("dmx"), rig)
        self.watchdog = self._make_watchdog() if rig.watchdog else NoWatchdog()
        self._sayings = 0  # how often drivers have been said to do something since it was told; the last are kept
        self._saying_motors = bytearray(_SAYINGS)
        self._saying_texts = [""] * _SAYINGS
        self.wire = self._make_wire(board["drivers"]) if rig.drivers else None
        self.port = self._make_port(rig.ports)
        self.background = rig.ports == 2
        self._ticker = None
        self._passes = None
        self._pass_callback = self._pass
        self._controller = None
        self.failure = None  # the exception that ended the passes
        self.alive = False  # passes go on
        self.task = None  # what framestep.repl wants done between two passes
        self.led = self._make_led(board)

    def _make_dmx(self, wiring, rig):
        if wiring is None or not rig.dmx:
            return NoDmx()
        from framestep.hal.rp2_dmx import Dmx

        dmx = Dmx(wiring, machine.freq(), rig.dmx_break_us, rig.dmx_mark_us, "RP2350" in sys.implementation._machine)
        dmx.start()
        return dmx

    def _make_watchdog(self):
        from framestep.hal.rp2_watchdog import Watchdog

        return Watchdog()

    def _make_wire(self, wiring):
        if "pins" in wiring:
            from framestep.hal.rp2_one_wire import OneWire

            return OneWire(wiring["pins"][: self.motors], self.motors)
        from framestep.hal.rp2_wire import Wire

        return Wire(wiring, "RP2350" in sys.implementation._machine)

    def _make_led(self, board):
        if "led" in board:
            return Pin(board["led"], Pin.OUT, value=0).value
        if "rgb" not in board:
            return _no_led
        from framestep.hal.rp2_rgb import RgbLed

        # The next state machine behind those of the motors, unless the drivers' lines (rp2_one_wire) begin with it.
        machine = self.motors
        if machine % 4 == 0:
            machine += 2 * len(board.get("drivers", {}).get("pins", ()))
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
        """The largest block of memory that there is. Allocates, for a moment."""
        gc.collect()
        size = gc.mem_free()
        while size > _STEP:
            try:
                bytearray(size)
            except MemoryError:
                size -= _STEP
                continue
            gc.collect()
            return size
        return _STEP

    def start(self):
        alloc_emergency_exception_buf(_TRACEBACK_BYTES)
        self._ticker = Timer(-1, period=1, mode=Timer.PERIODIC, callback=self.kernel.tick, hard=True)
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
        Pin(pin, Pin.OUT, value=level)
        return 1 << pin

    def input(self, pin, pull):
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

    def trouble(self):
        return lost_commands(self.motors)

    # ---------------------------------------------------------------- running a controller

    def run(self, controller):
        """Run it: in the background, and return at once, or until a Ctrl-C on its own port."""
        self._controller = controller
        self.alive = True
        if self.background:
            self._passes = Timer(-1, period=_PASS_MS, mode=Timer.PERIODIC, callback=self._pass_callback)
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
        """One pass, the heap locked: it needs none, and MicroPython then puts call frames of more than eleven words on
        the stack, for which it would otherwise search the whole heap. Returns what the controller's poll() does."""
        heap_lock()
        try:
            return self._controller.poll(ticks_ms())  # type: ignore[union-attr]
        finally:
            heap_unlock()

    # Outside _poll() the heap is not locked, so this is kept to the few words that a call frame has on the stack.
    def _pass(self, error):
        if self._passes is None:
            return  # it waited in the scheduler when the passes ended
        try:
            self._poll()
            if self._controller.untold or self.task or self._sayings:  # type: ignore[union-attr]
                self._after()
        except KeyboardInterrupt:
            self._interrupted()
        except Exception as error:
            self.failure = error
            self._broken()

    def _after(self):
        """What a pass may not do itself: it allocates, and it prints."""
        if self.task:
            task = self.task
            self.task = None
            task()
        if not self._controller.was_moving:  # type: ignore[union-attr]
            self._tell()

    def _interrupted(self):
        # Meant for a program that runs on the REPL, but it struck in a pass; what was being done
        # is half done. (At the prompt Ctrl-C is a character and strikes nothing.)
        self._controller.fail()  # type: ignore[union-attr]
        print("framestep: Ctrl-C came in the middle of the controller's work; motors stop")

    def _broken(self):
        self.stop()
        self._controller.give_up()  # type: ignore[union-attr]
        print("framestep: stopped by a fault in the firmware; a reset starts it again")
        sys.print_exception(self.failure)  # type: ignore[attr-defined]
        self._beat = 0
        self._blinker = Timer(-1, period=_BEAT_MS, mode=Timer.PERIODIC, callback=self._blink)

    def _tell(self):
        """Say in words why motors were stopped, and what drivers do. Not on the protocol's own port, nor while motors
        move, as the REPL's host may let the board wait."""
        if self._controller.untold:  # type: ignore[union-attr]
            from framestep import words

            for line in words.faults(self._controller.untold):  # type: ignore[union-attr]
                print("framestep:", line)
            self._controller.untold = 0  # type: ignore[union-attr]
        if self._sayings > _SAYINGS:
            print("framestep: drivers:", self._sayings - _SAYINGS, "earlier lines are lost")
        for i in range(max(0, self._sayings - _SAYINGS), self._sayings):
            print("framestep: driver of motor", self._saying_motors[i % _SAYINGS], self._saying_texts[i % _SAYINGS])
        self._sayings = 0

    def _tell_all(self):
        """When the protocol gives back the REPL's port: everything that could not be said there since the start."""
        from framestep import words

        bits = self._controller.condition() & (CONDITION_BARKED | CONDITION_FORGETFUL)  # type: ignore[union-attr]
        for line in words.conditions(bits):
            print("framestep:", line)
        self._tell()

    def _blink(self, _timer):
        """The LED, when no passes do it any more."""
        self._beat = (self._beat + 1) & 15
        self.led(glow(LED_FAULT, self._beat))

    def stop(self):
        """End the passes; the motors ramp down. The REPL is left as it was, and no watchdog strikes it."""
        self.alive = False
        self.led(0)
        self.watchdog.disarm()
        if self._passes:
            self._passes.deinit()
            self._passes = None
        if self._controller:
            self._controller.abandon()
