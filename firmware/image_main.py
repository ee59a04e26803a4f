"""main.py of an image with framestep in it: a main.py on the file system goes first, and may then
do as it likes."""

import os
import sys

try:
    os.stat("/main.py")
except OSError:
    if "framestep_overlay" in sys.modules:
        sys.modules["framestep_overlay"].start()
    else:
        import framestep.boot

        framestep.boot.start()
else:
    execfile("/main.py")  # noqa: F821 -- MicroPython has it
