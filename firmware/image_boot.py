"""What comes before boot.py in an image: pulses are ended and DMA is stopped, then a boot.py on the
file system runs.

That may be framestep's own, from when its files were copied. Its lines do nothing a second time.
"""

import os

import framestep.leftovers

framestep.leftovers.lower_pins()
framestep.leftovers.stop_dma()
try:
    os.stat("/boot.py")
except OSError:
    pass
else:
    execfile("/boot.py")  # noqa: F821 -- MicroPython has it
