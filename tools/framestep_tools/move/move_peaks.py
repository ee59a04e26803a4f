"""How fast, how steep and how far the path of a run becomes, and where: from the coefficients of
its cubics, so nothing falls between two samples."""

from typing import NamedTuple

import numpy as np

from ..judge.reference import Reference

_SAME = 1e-4  # of a value
_SAME_STEPS = 0.01
PRE_ROLL, FRAMES, POST_ROLL = "pre-roll", "frames", "post-roll"


class Peak(NamedTuple):
    """A value, and when it is reached: seconds after the first frame."""

    value: float
    seconds: float


class Peaks(NamedTuple):
    """Of one motor: the greatest velocity (steps/s), acceleration (steps/s²) and jerk (steps/s³)
    as magnitudes, and the ends of its way in steps.

    The jerk is that within the cubics; at a frame the acceleration may jump.
    """

    velocity: Peak
    acceleration: Peak
    jerk: Peak
    lowest: Peak
    highest: Peak


def peaks(path: Reference, motor: int) -> Peaks:
    """The peaks of a motor's path from the begin of its pre-roll to the end of its post-roll."""
    t, pieces = path.pieces(motor)
    c = pieces[1:-1].T  # those between the two rests
    begins, span = t[:-1], np.diff(t)

    def within(x: np.ndarray) -> np.ndarray:
        """Those of these times after the pieces' begins that lie in their pieces, else 0."""
        return np.where(np.isfinite(x) & (x > 0) & (x < span), x, 0)

    with np.errstate(divide="ignore", invalid="ignore"):
        vertex = within(-c[2] / (3 * c[3]))
        root = np.sqrt(c[2] ** 2 - 3 * c[1] * c[3])
        straight = within(-c[1] / (2 * c[2]))
        turns = [within((-c[2] + root) / (3 * c[3])), within((-c[2] - root) / (3 * c[3])), straight]
    ends = [np.zeros(len(span)), span]

    def at(times: list[np.ndarray], value) -> tuple[np.ndarray, np.ndarray]:
        """Values at times after the pieces' begins, and when that is."""
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
    """The greatest of these values, and the first time at which one is within `same` of it: frames
    last whole microseconds, so an even motion is not quite as fast in all."""
    greatest = values.max()
    return Peak(float(greatest), float(seconds[values >= greatest - same].min()))
