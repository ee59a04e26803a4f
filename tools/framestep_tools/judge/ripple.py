"""How restless a played move is, judged by the edges on the pins.

The path before it was rounded to whole steps is the measure. An edge says that the motor is between
two steps; between edges the motion is taken as even. Beside the path that gives an error at each
frame and half-way between two, and the unrest: how much that error changes from frame to frame
(velocity, steps per frame), and how much that change changes (acceleration, steps per frame²).
Where the motor turns, from the last edge one way to the first one the other way, edges say nothing,
and nothing is counted.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

_MARGIN = 4  # frames at either end that are not counted: there the motion begins and ends


@dataclass(frozen=True)
class Unrest:
    """Sums over the moments that count; two of them can be added."""

    velocity: float = 0.0  # sum of squares, (steps/frame)²
    velocities: int = 0  # how many
    acceleration: float = 0.0
    accelerations: int = 0

    def __add__(self, other: "Unrest") -> "Unrest":
        return Unrest(
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


def unrest(
    frames: np.ndarray,
    ways: np.ndarray,
    start: int,
    path: Callable[[np.ndarray], np.ndarray],
    last: int,
) -> Unrest:
    """Of one motor. frames: when its edges come, in frames after the first; ways: 1 or -1 each;
    start: its position before the first of them. path: position at a time in frames, before
    rounding; last: its last frame."""
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
    return Unrest(
        float((change[counts] ** 2).sum()),
        int(counts.sum()),
        float((bend[counts_too] ** 2).sum()),
        int(counts_too.sum()),
    )


def origins_ns(
    times_ns: np.ndarray, ways: np.ndarray, start: int, uploaded: Sequence[int], due_ns: np.ndarray
) -> list[tuple[int, int]]:
    """When the first frame can have been, so that at each frame's time the motor stood on its
    position: spans of time, empty if it never can.

    times_ns, ways: the motor's edges; start: its position before them; due_ns: times of the frames
    after the first one.
    """
    positions = np.concatenate(([start], start + np.cumsum(ways)))
    begins = np.concatenate(([-(1 << 62)], times_ns))
    ends = np.concatenate((times_ns, [1 << 62]))
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
