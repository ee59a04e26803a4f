"""What a board can do, below everything else: contract.py says what a HAL has. Here: what all HALs
share."""

from framestep.base.native import const

PASS = const(0)  # word of Hal.inside

# Bytes of the stack. MicroPython's own limit is STACK; a program on the REPL has REPL_STACK, so
# that interrupts, which take up to 1500 bytes, fit beyond it in any case. A pass begins where no
# more than DEEPEST is in use: the largest one takes 5000, with the interrupts that come in it.
STACK = const(7936)
REPL_STACK = const(6400)
DEEPEST = const(2560)

CHANNELS = const(512)  # of DMX
CHANGED = const(0)  # word of Lights.words: 1 when a level has changed since they were taken
