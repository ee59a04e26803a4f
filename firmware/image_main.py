"""main.py of an image with framestep: starts framestep, or runs a main.py on the file system
instead."""

import os
import sys

import micropython

try:
    os.stat("/main.py")
except OSError:
    # mpremote sends a Ctrl-C as soon as it finds the port; it must not break off the start. The
    # REPL enables it again.
    micropython.kbd_intr(-1)
    if "framestep_overlay" in sys.modules:
        sys.modules["framestep_overlay"].start()
    else:
        import framestep.boot

        framestep.boot.start()
else:
    execfile("/main.py")  # type: ignore[name-defined]  # noqa: F821 -- MicroPython has it
