"""Judges the pulses of a servo by their edges, against a step motor on the same path."""

import numpy as np

LATEST = 0.0022  # s after the end of a pulse until the path reaches its width


def pulses(session, motor=2):
    """Return the rises of a servo's pulses in s, and their widths in µs."""
    none = np.array([], dtype=np.int64)
    times, levels = session.trace().signals.get(f"servo{motor}", (none, none))
    rises, falls = times[levels == 1], times[levels == 0]
    if len(falls) and len(rises):
        falls = falls[falls > rises[0]]
    count = min(len(rises), len(falls))
    return rises[:count] * 1e-9, (falls[:count] - rises[:count]) * 1e-3


def assert_follows(
    session, start, steps_per_us, motor=1, farthest=False, servo=2, sense=1, beside=None
):
    """Assert that each pulse has the width of a place of the step motor at its end or within
    LATEST.

    start: the motor's position before its first edge. Widths are 1500 µs at 0. farthest: only until
    its highest position, the end of the post-roll, because each motor starts its way back on its
    own. sense: -1 if the servo moves the other way. beside: the session with the step motor, if it
    is another one with the same requests.
    """
    rises, widths = pulses(session, servo)
    times, signs = (beside or session).steps(motor)
    made = start + np.concatenate([[0], np.cumsum(signs)])
    ends = rises + widths * 1e-6
    if farthest:
        ends = ends[ends < times[np.argmax(made) - 1]]
        assert len(ends) > 40
    first = np.searchsorted(times, ends)
    last = np.searchsorted(times, ends + LATEST)
    steps = (widths[: len(ends)] - 1500) * steps_per_us * sense
    for k, (i, j) in enumerate(zip(first, last, strict=True)):
        places = made[i : j + 1]
        assert places.min() - 1.1 < steps[k] < places.max() + 1.1, (
            f"at {ends[k]:.4f} s {steps[k]:.1f} steps, motor {places}"
        )
