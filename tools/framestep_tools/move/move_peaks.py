"""Peaks of velocity, acceleration, jerk and position of a run's path, and their times.

They come from the coefficients of its cubics, so no peak is missed between two samples.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ..judge.reference import Reference

_SAME = 1e-4  # as a part of a value
_SAME_STEPS = 0.01
PRE_ROLL, FRAMES, POST_ROLL = "pre-roll", "frames", "post-roll"


class Peak(NamedTuple):
    """A value and its time, in seconds after the first frame."""

    value: float
    seconds: float


class Peaks(NamedTuple):
    """Peaks of one motor: magnitudes of velocity (steps/s), acceleration (steps/s²) and jerk
    (steps/s³), and its lowest and highest position in steps.

    Jerk is measured within the cubics; at a frame the acceleration may jump.
    """

    velocity: Peak
    acceleration: Peak
    jerk: Peak
    lowest: Peak
    highest: Peak


def peaks(path: Reference, motor: int) -> Peaks:
    """Return the peaks of a motor's path, from the start of its pre-roll to the end of its
    post-roll."""
    t, pieces = path.pieces(motor)
    c = pieces[1:-1].T  # the pieces between the two rests
    begins, span = t[:-1], np.diff(t)

    def within(x: np.ndarray) -> np.ndarray:
        """Return these times, relative to the pieces' starts, or 0 for a time outside its piece."""
        return np.where(np.isfinite(x) & (x > 0) & (x < span), x, 0)

    with np.errstate(divide="ignore", invalid="ignore"):
        vertex = within(-c[2] / (3 * c[3]))
        root = np.sqrt(c[2] ** 2 - 3 * c[1] * c[3])
        straight = within(-c[1] / (2 * c[2]))
        turns = [within((-c[2] + root) / (3 * c[3])), within((-c[2] - root) / (3 * c[3])), straight]
    ends = [np.zeros(len(span)), span]

    def at(
        times: list[np.ndarray], value: Callable[[np.ndarray], np.ndarray]
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return values at times relative to the pieces' starts, and the absolute times."""
        return (
            np.concatenate([value(x) for x in times]),
            np.concatenate([begins + x for x in times]),
        )

    velocity = at([*ends, vertex], lambda x: abs(c[1] + x * (2 * c[2] + x * 3 * c[3])))
    acceleration = at(ends, lambda x: abs(2 * c[2] + x * 6 * c[3]))
    jerk = at([span / 2], lambda x: abs(6 * c[3]))
    position = at([*ends, *turns], lambda x: c[0] + x * (c[1] + x * (c[2] + x * c[3])))
    lowest = _greatest(-position[0], position[1], _SAME_STEPS)
    return Peaks(
        _greatest(*velocity, _same(velocity[0])),
        _greatest(*acceleration, _same(acceleration[0])),
        _greatest(*jerk, _same(jerk[0])),
        lowest._replace(value=-lowest.value),
        _greatest(*position, _SAME_STEPS),
    )


def _same(values: np.ndarray) -> float:
    return _SAME * float(values.max())


def _greatest(values: np.ndarray, seconds: np.ndarray, same: float) -> Peak:
    """Return the largest value, and the first time at which a value is within `same` of it.

    Frames last whole microseconds, so a uniform motion does not have exactly equal velocities.
    """
    greatest = values.max()
    return Peak(float(greatest), float(seconds[values >= greatest - same].min()))
