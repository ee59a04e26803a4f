"""What follows boot.py in an image with framestep in it, where that is frozen: one on the file
system."""

import os

try:
    os.stat("/boot.py")
except OSError:
    pass
else:
    execfile("/boot.py")  # noqa: F821 -- MicroPython has it
