"""DMX512 decoded from the edges of a pin alone."""

import numpy as np

BIT_NS = 4000
SLOT_NS = 11 * BIT_NS
_BREAK_NS = 80_000  # longer than any data


def frames(times, levels):
    """Return [(start of break, break, mark after break in ns, slots, longest gap between slots in
    ns)] of a line's complete frames. times: of its edges, in ns; levels: after each."""
    falls = times[levels == 0]
    ends = np.append(times[1:], times[-1] + 1)[levels == 0]
    found = []
    breaks = np.flatnonzero(ends - falls > _BREAK_NS)
    for k, at in enumerate(breaks[:-1]):
        begin = ends[at]  # the mark's
        until = falls[breaks[k + 1]]
        inside = (times >= begin) & (times < until)
        found.append(
            (
                int(falls[at]),
                int(ends[at] - falls[at]),
                int(falls[at + 1] - begin),
                *_slots(times[inside], levels[inside]),
            )
        )
    return found


def _slots(times, levels):
    """Return a frame's bytes, by samples in the middle of bits, and the longest gap between them;
    8 data bits, two stop bits."""
    slots = bytearray()
    longest = 0
    at = 1  # times[0] is the rise that begins the mark
    previous = None
    while at < len(times):
        start = times[at]
        if previous is not None:
            longest = max(longest, int(start - previous - SLOT_NS))
        previous = start
        samples = start + BIT_NS * np.arange(0.5, 11)
        index = np.searchsorted(times, samples, side="right") - 1
        bits = levels[index]
        assert bits[0] == 0, "no start or stop bit"
        assert bits[9] == bits[10] == 1, "no start or stop bit"
        slots.append(int(np.packbits(bits[1:9], bitorder="little")[0]))
        at = int(np.searchsorted(times, start + 10 * BIT_NS))
    return bytes(slots), longest
