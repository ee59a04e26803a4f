"""Runs a controller alongside MicroPython's REPL.

With two ports the controller runs in the background: a timer calls it from MicroPython's scheduler,
and the REPL works as usual. With one port, which is the REPL's, it runs in the foreground.

A pass runs with the heap locked. It needs no heap, and MicroPython then puts call frames of more
than eleven words on the stack. Otherwise it would search the whole heap for room, and collect it if
it is full, which takes 30 ms for each frame. Code outside of the lock has smaller frames (a test
counts them), or may take long. If a program on the REPL has taken all memory, everything goes on,
including all reports that need no memory.
"""

import io
import sys
from os import dupterm, dupterm_notify  # type: ignore[attr-defined]
from time import sleep_us, ticks_diff, ticks_ms, ticks_us  # 30 bits where small integers have 31

from machine import Timer
from micropython import heap_lock, heap_unlock, stack_use

from framestep.base.native import const, micropython
from framestep.base.results import BY, EXCEEDED_MEMORY, EXCEEDED_RATE, FRAME, MOTOR, ROOM, WHAT
from framestep.controller import LED_FAULT, glow
from framestep.faults import ALL, FAULTS, outcome
from framestep.hal import DEEPEST, PASS
from framestep.moves.path.move_check import UNREPORTED
from framestep.protocol.messages import CONDITION_POSITIONS_UNSAVABLE, CONDITION_WATCHDOG_RESET
from framestep.pulse.stepper import TICKS
from framestep.stops import HOMING_REPORT

_PASS_MS = const(1)
_APART_US = const(500)  # passes, at least; one is due each millisecond
_BEHIND_TICK_US = const(20)  # from a tick to a pass: see run()
_NO_TICK_MS = const(20)  # longer is no reason to wait on: motions will report it
_LINES = const(16)
_BEAT_MS = const(128)
_AFTER_RAW = const(50)  # passes from the end of raw mode until the prompt is there
_CTRL_C = const(3)
_BROKEN = "framestep: Ctrl-C interrupted the controller"
_BROKEN_IN_MOTION = _BROKEN + ALL


class _CtrlC(io.IOBase):
    """A terminal on which Ctrl-C has been pressed."""

    def readinto(self, buffer):
        buffer[0] = _CTRL_C
        return 1

    def write(self, data):
        return len(data)

    def ioctl(self, request, argument):
        return 0


@micropython.viper
def _interrupt(terminal, notify, ctrl_c):
    """Raise a KeyboardInterrupt in the interrupted code, as soon as it goes on."""
    before = terminal(ctrl_c)
    notify(None)
    terminal(before)


class Runner:
    """hal: see framestep.hal.contract; background: whether the REPL has a port of its own."""

    def __init__(self, hal, background):
        self._hal = hal
        hal.report_driver = self.report_driver
        self.background = background
        self._inside = hal.inside
        # lines about drivers that have yet to be printed; only the newest are kept
        self._lines = 0
        self._line_motors = bytearray(_LINES)
        self._line_texts = [""] * _LINES
        # Made now, as there may be no memory for them later
        self._pass_callback = hal.pass_callback(self._pass)
        self._blink_callback = self._blink
        self._beat = 0
        self._controller = None
        self.failure = None  # the exception that ended the passes
        self.alive = False  # passes go on
        self._answer = False  # the controller's, for the port
        self._begun_at = 0  # time of the last pass, ticks_us
        self.task = None  # a function of framestep.repl to call between two passes
        self._traceback_task = self._traceback
        self._failing = False  # a pass was broken off: the next one stops the motors
        self._wait = 0  # passes until texts that had to wait may be printed
        self._failed = ""  # its line, which has yet to be printed
        self._news = False  # it, or lines about drivers, have yet to be printed
        self._struck = False  # Ctrl-C came in a pass; pass it on to the program on the REPL
        self._ctrl_c = _CtrlC()

    def report_driver(self, motor, text):
        """Print on the REPL what the driver of a motor (from 1) does, once nothing moves.

        Allocates nothing.
        """
        place = self._lines % _LINES
        self._line_motors[place] = motor
        self._line_texts[place] = text
        self._lines += 1
        self._news = True

    def run(self, controller):
        """Run the controller: in the background, returning at once; or until Ctrl-C on its
        port."""
        self._controller = controller
        if self.background:
            # Passes begin at a fixed time after a tick. The one that reads a GO releases the motors
            # a millisecond and a half later. If that were close to a tick, it would sometimes come
            # before and sometimes after it, and runs would begin up to 2 ms apart instead of 1
            # (`make bench`: go_ms_spread).
            ticks = self._hal.kernel.state
            tick = ticks[TICKS]
            begun = ticks_ms()
            while ticks[TICKS] == tick and ticks_diff(ticks_ms(), begun) < _NO_TICK_MS:
                pass
            sleep_us(_BEHIND_TICK_US)
            self.alive = True
            controller.answer_hi_at_once()
            self._hal.port.answer = self._answer = controller.answer
            self._hal.passes.init(
                period=_PASS_MS, mode=Timer.PERIODIC, callback=self._pass_callback
            )
            return
        self.alive = True
        idle = self._hal.idle
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
            self._hal.port.stop()  # gives it back to the REPL
            self._report_all()

    def _poll(self):
        """Do one pass in the foreground. Return the result of the controller's poll()."""
        heap_lock()
        self._inside[PASS] = 1
        try:
            return self._controller.poll(ticks_ms())
        finally:
            self._inside[PASS] = 0
            heap_unlock()

    # MicroPython raises a pending Ctrl-C at the next branch. So there is no branch before _turn(),
    # which expects it, nor after the last line, which passes it on.
    def _pass(self, timer):
        heap_lock()
        try:
            self._turn()
        finally:
            heap_unlock()
        if self.task:
            self._inside[PASS] = 0
            self._after()
        port = self._hal.port
        if self._struck or port.struck:
            self._struck = port.struck = False
            _interrupt(dupterm, dupterm_notify, self._ctrl_c)

    def _turn(self):
        """Do one pass in the background; catch anything that it raises.

        A Ctrl-C is meant for a program on the REPL.
        """
        controller = self._controller
        try:
            if not self.alive or stack_use() > DEEPEST:
                # The passes ended while this one waited in the scheduler. Or a program is deep in
                # calls, so that the stack may be too small for a pass; the next one comes in 1 ms.
                return
        except KeyboardInterrupt:
            self._struck = True  # at a point where nothing is half done
        try:
            if self._failing:
                self._failed = _BROKEN_IN_MOTION if controller.axes.moving_bits() else _BROKEN
                controller.stops.fault_stop()
                self._failing = False
                self._hal.port.answer = self._answer
                self._news = True
            if not 0 <= ticks_diff(ticks_us(), self._begun_at) < _APART_US:
                # else it has been held up
                self._begun_at = ticks_us()
                controller.poll(ticks_ms())
        except KeyboardInterrupt:
            self._fail()
            return
        except Exception as error:
            self.failure = error
            self._end()
            self.task = self._traceback_task
            return
        try:
            if (self._news or controller.faults.unreported) and not controller.reports.was_moving:
                if self._hal.quiet():
                    self._wait = _AFTER_RAW
                elif self._wait:
                    self._wait -= 1
                else:
                    self._report()
        except KeyboardInterrupt:
            self._struck = True  # the REPL's port was full, and the report is cut short

    def _fail(self):
        """A Ctrl-C has left a pass half done: nothing is answered before the next one has stopped
        the motors."""
        self._struck = self._failing = True
        self._hal.port.answer = False

    def _after(self):
        """Do what allocates, and so cannot be done in a pass."""
        if self._failing and self.alive:
            return  # the pass has left its work half done
        task = self.task
        self.task = None
        try:
            task()
        except KeyboardInterrupt:
            self._fail()
        except Exception as error:
            try:
                sys.print_exception(error)  # type: ignore[attr-defined]
            except KeyboardInterrupt:
                self._struck = True

    def _end(self):
        """Stop after an exception has ended the passes."""
        self.stop()
        self._controller.stops.crash_stop()

    def _broken(self):
        """Stop after an exception has ended the passes in the foreground."""
        heap_lock()
        try:
            self._end()
        finally:
            heap_unlock()
        self._traceback()

    def _traceback(self):
        """Print what ended the passes, now or once it may be printed."""
        self._hal.passes.init(period=_BEAT_MS, mode=Timer.PERIODIC, callback=self._blink_callback)
        if self._hal.quiet():
            self._news = True
            return
        self._news = False
        print("framestep: stopped by a fault in the firmware; a reset starts it again")
        sys.print_exception(self.failure)  # type: ignore[attr-defined]

    def _report(self):
        """Print why motors were stopped, and what drivers do. Allocates nothing.

        Not on the protocol's port; not while motors move, as the REPL's host may keep the board
        waiting; and not in the REPL's raw mode, where it would break a tool's transfer.
        """
        faults = self._controller.faults
        unreported = faults.unreported
        faults.unreported = 0
        for bit, text in FAULTS:
            if unreported & bit:
                print("framestep: ", text, outcome(bit, faults.moved), sep="")
        self._news = False
        exceeded = self._controller.operations.exceeded
        if unreported & UNREPORTED and exceeded[WHAT] == EXCEEDED_MEMORY:
            print(
                "framestep: the upload does not fit into memory; bytes needed and free:",
                exceeded[BY],
                exceeded[ROOM],
            )
        elif unreported & UNREPORTED and exceeded[WHAT] == EXCEEDED_RATE:
            print(
                "framestep: too many frames in 1000 s; asked:",
                exceeded[BY],
                "possible:",
                exceeded[ROOM],
            )
        elif unreported & UNREPORTED and exceeded[WHAT]:
            print(
                "framestep: the last move exceeds a limit of motor",
                exceeded[MOTOR] + 1,
                "at frame",
                exceeded[FRAME],
                "- see status()",
            )
        if unreported & HOMING_REPORT:
            self._controller.homing.report()
        if self._failed:
            print(self._failed)
            self._failed = ""
        lines = self._lines
        self._lines = 0
        if lines > _LINES:
            print("framestep: drivers:", lines - _LINES, "earlier lines are lost")
        for i in range(max(0, lines - _LINES), lines):
            print(
                "framestep: driver of motor",
                self._line_motors[i % _LINES],
                self._line_texts[i % _LINES],
            )

    def _report_all(self):
        """Print all that had to wait, after the port has been given back to the REPL."""
        try:
            from framestep import texts

            bits = self._controller.condition() & (
                CONDITION_WATCHDOG_RESET | CONDITION_POSITIONS_UNSAVABLE
            )
            for line in texts.conditions(bits):
                print("framestep:", line)
        except MemoryError:
            pass
        self._report()

    def _blink(self, _timer):
        """Flash the LED after the passes have ended, and print why, if that had to wait."""
        if self._news:
            self._traceback()
        self._beat = (self._beat + 1) & 15
        self._hal.led(glow(LED_FAULT, self._beat))

    def stop(self):
        """End the passes: ramp the motors down, switch the watchdog off; the REPL goes on."""
        self.alive = False
        if self.background:
            self._hal.port.answer = False
        self._hal.passes.deinit()
        heap_lock()
        try:
            self._hal.led(0)
            self._hal.watchdog.disarm()
            if self._controller:
                self._controller.stops.stop_everything()
        finally:
            heap_unlock()
