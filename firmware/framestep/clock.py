"""Counters that run round.

Ticks and milliseconds are counted modulo 2^29: a small integer of the board ends at 2^30 - 1, and a larger one is an
allocation, which ends the main loop. So the sum of two readings, or of a reading and a span, stays below 2^30 before
it is taken modulo. Spans up to HALF, three days, can be told from spans into the past.

The functions are for readings of these counters. On a board there is none of them: the build puts what they compute
in the place of each call (framestep_tools.inlining).
"""

from framestep.native import const

WRAP = const(0x1FFFFFFF)
HALF = const(0x10000000)

# Of counters that nothing is added to: microseconds, MicroPython's own milliseconds, places in a queue. Modulo 2^30.
WIDE_WRAP = const(0x3FFFFFFF)
WIDE_HALF = const(0x20000000)


def after(then, span):
    """The reading `span` after another."""
    return (then + span) & WRAP


def elapsed(now, then):
    """The span from the reading `then` to the reading `now`."""
    return (now - then) & WRAP


def reached(now, then):
    """Whether the counter, which shows `now`, has come to the reading `then`."""
    return (now - then) & WRAP < HALF
