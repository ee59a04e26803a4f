"""Constants that all HALs share. A HAL is what a board can do, below everything else; contract.py
says what it has to provide."""

from framestep.base.native import const

PASS = const(0)  # index in Hal.inside

# Bytes of the stack, which has 8192. MicroPython's own limit is STACK. A program on the REPL has
# REPL_STACK, so that interrupts, which take up to 1500 bytes, always fit beyond it. A pass begins,
# and questions are answered between two, only if no more than DEEPEST is in use: the largest pass
# takes 5400, including the interrupts in it.
STACK = const(7936)
REPL_STACK = const(6400)
DEEPEST = const(2560)

QUESTION = const(12)  # bytes of a question for status, positions or HI
CHANNELS = const(512)  # of DMX
CHANGED = const(0)  # index in Lights.words: 1 if a level has changed since they were taken
