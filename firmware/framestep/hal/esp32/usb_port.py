"""The protocol on a USB serial port of its own, next to the REPL's: on an ESP32-S3 with MicroPython
1.27 or newer.

The passes stay in the foreground, as on a board with one port: nothing on the REPL can hold up the
feeding of the chain, and no garbage collection of a program. A Ctrl-C on the REPL's port ends them
and gives it back; other bytes from there are dropped.

Unlike on an RP2040, a soft reset disconnects the device, because the buffers of its transfers are
in the heap. A pulled cable goes unnoticed until something has to be sent.
"""

import select
import sys

import micropython

from framestep.base.native import const
from framestep.hal.ports.usb_descriptor import descriptor
from framestep.hal.ports.usb_port import UsbPort

_CTRL_C = const(3)
# String descriptors by their index: manufacturer, product and, as the sixth, the port's name. None:
# MicroPython's own. Not an object of Python's code, because that would let passes begin within
# MicroPython's USB task.
_STRINGS = (None, "MicroPython", "framestep", None, None, "framestep DMC")


class OwnPort(UsbPort):
    """A framestep.hal.ports.usb_port. hal: each pass calls its serve()."""

    def __init__(self, hal):
        UsbPort.__init__(self)
        self._serve = hal.serve
        self._land = hal.land
        self._input = select.poll()
        self._byte = bytearray(1)
        self._readinto = sys.stdin.buffer.readinto  # type: ignore[union-attr]

    def start(self):
        """Add the port to the built-in one; returns at once. The host sees the board disappear and
        come back with two ports."""
        usb = self._usb
        usb.active(False)
        usb.builtin_driver = self._builtin  # type: ignore[attr-defined]
        usb.config(
            self._builtin.desc_dev,
            descriptor(self._builtin),
            _STRINGS,
            self._configured,
            self._reset,
            self._control,
            self._transferred,
        )
        usb.active(True)
        self._input.register(sys.stdin, select.POLLIN)
        self._input.ipoll(0)  # allocates its result, once
        micropython.kbd_intr(-1)

    def poll(self, reader):
        """See UsbPort. Raises KeyboardInterrupt to give the REPL back."""
        self._serve()
        if next(self._input.ipoll(0), None):  # this also runs MicroPython's USB task
            self._readinto(self._byte)
            if self._byte[0] == _CTRL_C:
                self.stop()
                raise KeyboardInterrupt
        return UsbPort.poll(self, reader)

    def stop(self):
        """Give the REPL back, once the motors are at rest."""
        self._land()
        micropython.kbd_intr(_CTRL_C)
