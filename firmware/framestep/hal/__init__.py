"""What a board can do, below everything else: contract.py says what a HAL has. Here: what all HALs share."""

from framestep.native import const

PASS = const(0)  # word of Hal.inside

CHANNELS = const(512)  # of DMX
CHANGED = const(0)  # word of Lights.words: 1 when a level has changed since they were taken
