"""Counters of ticks and of milliseconds run modulo 2^29.

A small integer of the board ends at 2^30 - 1, and a larger one is an allocation, which ends the main loop. So the sum
of two readings, or of a reading and a span, must stay below 2^30 before it is taken modulo. The span from one reading
to another, `(now - then) & WRAP`, can be told up to HALF, three days.
"""

from framestep.native import const

WRAP = const(0x1FFFFFFF)
HALF = const(0x10000000)
