"""boot.py of an image: ends pulses, stops DMA, puts an overlay in place, and runs a boot.py on the
file system.

After a soft reset framestep starts again from here, since mpremote skips main.py then.
"""

import os
import sys

import micropython

micropython.kbd_intr(-1)  # so that a Ctrl-C does not break off the start

import framestep.soft_reset  # noqa: E402

framestep.soft_reset.lower_pins()
framestep.soft_reset.stop_dma()
try:
    os.stat("/overlay")
except OSError:
    pass
else:
    __import__("framestep_overlay").begin()
try:
    os.stat("/boot.py")
except OSError:
    pass
else:
    micropython.kbd_intr(3)
    execfile("/boot.py")  # type: ignore[name-defined]  # noqa: F821 -- MicroPython has it

if framestep.soft_reset.usb_alive():
    micropython.kbd_intr(-1)
    if "framestep_overlay" in sys.modules:
        sys.modules["framestep_overlay"].start(True)
    else:
        import framestep.boot

        framestep.boot.start(True)
