"""A move at other frames per second, or at another speed: the same path through time."""

import math

import numpy as np

from ..axes.axes_file import Axis
from ..judge.reference import Reference
from .move_file import Move

_CLOSE = 1e-6  # frames: what calculation may lose


def resampled(move: Move, axes: list[Axis], ratio: float, fps: float | None) -> Move:
    """Return a move that goes along the same path, as the board plays it without smoothing.

    ratio: frames of the given move for one of the new one; fps: of the new one. The last frame is
    on the end position, even if the given move ends between two frames. Raises ToolError for a
    position beyond its axis's limits.
    """
    last = move.frames - 1
    count = max(1, math.ceil(last / ratio - _CLOSE) + 1)
    places = np.minimum(np.arange(count) * ratio, last)
    path = Reference(move.positions, 1000, 1000, 1000, smooth=False)  # a frame each second
    positions = {}
    for axis in axes:
        steps = [round(float(step)) for step in path(axis.motor, places)]
        for i, step in enumerate(steps):
            axis.check(step, move.start_frame + i)
        positions[axis.motor] = steps
    return Move(move.start_frame, move.names, positions, fps, move.said)
