"""Ripple of a played move, measured from the edges on the pins.

The reference is the path before it was rounded to whole steps. At an edge the motor is halfway
between two steps; between edges its velocity is assumed constant. The difference from the path is
an error at each frame and halfway between frames. Ripple is the change of that error from frame to
frame (velocity, steps per frame), and the change of that change (acceleration, steps per frame²).
At a turn, between the last edge one way and the first edge the other way, the position is unknown,
so nothing is counted.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

_MARGIN = 4  # frames at either end, where the motion begins and ends: not counted


@dataclass(frozen=True)
class Ripple:
    """Sums over all counted moments. Two of them can be added."""

    velocity: float = 0.0  # sum of squares, (steps/frame)²
    velocities: int = 0  # number of terms
    acceleration: float = 0.0
    accelerations: int = 0

    def __add__(self, other: "Ripple") -> "Ripple":
        return Ripple(
            self.velocity + other.velocity,
            self.velocities + other.velocities,
            self.acceleration + other.acceleration,
            self.accelerations + other.accelerations,
        )

    @property
    def velocity_rms(self) -> float:
        """Steps per frame."""
        return float(np.sqrt(self.velocity / self.velocities))

    @property
    def acceleration_rms(self) -> float:
        """Steps per frame²."""
        return float(np.sqrt(self.acceleration / self.accelerations))


def ripple(
    frames: np.ndarray,
    ways: np.ndarray,
    start: int,
    path: Callable[[np.ndarray], np.ndarray],
    last: int,
) -> Ripple:
    """Return the ripple of one motor.

    frames: times of its edges, in frames after the first frame; ways: 1 or -1 for each edge; start:
    its position before the first edge; path: position at a time in frames, before rounding; last:
    the path's last frame.
    """
    positions = start + np.cumsum(ways) - ways / 2
    at = np.arange(_MARGIN, last - _MARGIN + 0.25, 0.5)
    following = np.clip(np.searchsorted(frames, at, side="right"), 1, len(frames) - 1)
    known = ways[following] == ways[following - 1]
    known &= (at >= frames[0]) & (at <= frames[-1])
    error = np.interp(at, frames, positions) - path(at)
    change = error[2:] - error[:-2]
    bend = error[4:] - 2 * error[2:-2] + error[:-4]
    counts = known[2:] & known[:-2]
    counts_too = counts[2:] & counts[:-2]
    return Ripple(
        float((change[counts] ** 2).sum()),
        int(counts.sum()),
        float((bend[counts_too] ** 2).sum()),
        int(counts_too.sum()),
    )


def origins_ns(
    times_ns: np.ndarray,
    ways: np.ndarray,
    start: int,
    uploaded: Sequence[int],
    due_ns: np.ndarray,
    slack_ns: int = 0,
) -> list[tuple[int, int]]:
    """Return the spans of time in which the first frame can have been.

    With such a time, the motor is at its uploaded position at each frame's time. No spans: it
    missed a position. times_ns, ways: the motor's edges; start: its position before them; due_ns:
    times of the frames after the first one; slack_ns: how late the motor may reach a position, or
    how early leave it.
    """
    positions = np.concatenate(([start], start + np.cumsum(ways)))
    begins = np.concatenate(([-(1 << 62)], times_ns - slack_ns))
    ends = np.concatenate((times_ns + slack_ns, [1 << 62]))
    spans = [(-(1 << 62), 1 << 62)]
    for position, due in zip(uploaded, due_ns, strict=True):
        here = np.flatnonzero(positions == position)
        spans = [
            (max(low, int(begins[k]) - int(due)), min(high, int(ends[k]) - int(due)))
            for low, high in spans
            for k in here
            if max(low, int(begins[k]) - int(due)) < min(high, int(ends[k]) - int(due))
        ]
    return spans
