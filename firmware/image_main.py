"""main.py of an image with framestep in it: a main.py on the file system goes first, and may then
do as it likes."""

import os

try:
    os.stat("/main.py")
except OSError:
    import framestep.boot

    framestep.boot.start()
else:
    execfile("/main.py")  # noqa: F821 -- MicroPython has it
