"""What the edges of a servo's pulses tell, beside a step motor on the same path."""

import numpy as np

LATEST = 0.0022  # s after the end of a pulse by which the path has come to its width


def pulses(session, motor=2):
    """The rises of a servo's pulses in s, and their widths in µs."""
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
    """Each pulse has the width of a place where the step motor is at its end, or within LATEST.

    start: where the motor stood before its first edge. Widths are 1500 µs at 0. farthest: only
    until it is at its highest position, the end of the post-roll: each motor sets out on its way
    back by itself. sense: -1 where the servo goes the other way. beside: the session that has the
    step motor, if it is another one that has been asked the same.
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
