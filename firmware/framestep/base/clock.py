"""Counters that wrap.

Ticks and milliseconds are counted modulo 2^29. The board's small integers end at 2^30 - 1, and the
main loop must not allocate larger ones. With 2^29 the sum of two readings, or of a reading and a
span, stays small. A span counts as forward up to HALF, which is three days, and as backward beyond.

The functions below work on readings of these counters. They do not exist on a board: the build
replaces each call by its expression (framestep_tools.building.inlining).
"""

from framestep.base.native import const

WRAP = const(0x1FFFFFFF)
HALF = const(0x10000000)

# Modulo 2^30, for counters to which nothing is added: microseconds, MicroPython's own milliseconds,
# indexes of a queue.
WIDE_WRAP = const(0x3FFFFFFF)
WIDE_HALF = const(0x20000000)


def after(then, span):
    """Return the reading `span` after another."""
    return (then + span) & WRAP


def elapsed(now, then):
    """Return the span from the reading `then` to the reading `now`."""
    return (now - then) & WRAP


def reached(now, then):
    """Return whether the counter has reached `then`; it reads `now`."""
    return (now - then) & WRAP < HALF
