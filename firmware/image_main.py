"""main.py of an image with framestep in it: a main.py on the file system goes first, and may then
do as it likes."""

import os
import sys

import micropython

try:
    os.stat("/main.py")
except OSError:
    # mpremote sends a Ctrl-C as soon as it finds the port, which must not break off the start. The
    # REPL sets it again.
    micropython.kbd_intr(-1)
    if "framestep_overlay" in sys.modules:
        sys.modules["framestep_overlay"].start()
    else:
        import framestep.boot

        framestep.boot.start()
else:
    execfile("/main.py")  # noqa: F821 -- MicroPython has it
