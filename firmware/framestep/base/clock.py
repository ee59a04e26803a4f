"""Counters that wrap.

Ticks and milliseconds are counted modulo 2^29. The board's small integers end at 2^30 - 1, and a
larger number is an allocation, which ends the main loop. With 2^29 the sum of two readings, or of a
reading and a span, stays small. A span of up to HALF, three days, is told apart from one into the
past.

The functions below are for readings of these counters. They do not exist on a board: the build puts
what they compute in the place of each call (framestep_tools.building.inlining).
"""

from framestep.base.native import const

WRAP = const(0x1FFFFFFF)
HALF = const(0x10000000)

# For counters to which nothing is added: microseconds, MicroPython's own milliseconds, places in a
# queue. Modulo 2^30.
WIDE_WRAP = const(0x3FFFFFFF)
WIDE_HALF = const(0x20000000)


def after(then, span):
    """The reading `span` after another."""
    return (then + span) & WRAP


def elapsed(now, then):
    """The span from the reading `then` to the reading `now`."""
    return (now - then) & WRAP


def reached(now, then):
    """Whether the counter, which reads `now`, has reached `then`."""
    return (now - then) & WRAP < HALF
