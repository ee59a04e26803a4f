"""What a board can do, below everything else: contract.py says what a HAL has. Here: what all HALs share."""

from framestep.native import const

PASS = const(0)  # word of Hal.inside

# Bytes of the stack that a program may have in use where a pass begins on top of it. MicroPython
# raises RuntimeError where more than STACK would be used; the largest pass takes 5000, with the
# interrupts that come in it.
STACK = const(7936)
DEEPEST = const(2800)

CHANNELS = const(512)  # of DMX
CHANGED = const(0)  # word of Lights.words: 1 when a level has changed since they were taken
