"""Positions half a frame before and after a frame, on the path that framestep plays.

Go-motion needs them (field note 7.2). They are calculated as in the firmware.
"""

from array import array
from collections.abc import Sequence

from framestep.moves.path import path

_FAR = 2**30 - 1  # means no soft limit
_BOUNDS = array("i", [-_FAR, _FAR, 0])
_HALF_FRAME = 24  # a slope is in twelfths of a step per frame


def ends(steps: Sequence[int], index: int) -> tuple[int, int]:
    """Return the positions in steps at angle 0 and at angle 360 of the frame with this index.

    steps: positions of the whole upload. Beyond its ends the path goes straight on.
    """
    last = len(steps) - 1
    slopes = [_slope(steps, min(max(index + i, 0), last)) for i in (-1, 0, 1)]
    window = _window(steps, index)
    here = slopes[1]
    early = path.midway(window, 1, slopes[0], here) if index > 0 else -here // _HALF_FRAME
    late = path.midway(window, 3, slopes[2], here) if index < last else here // _HALF_FRAME
    return int(steps[index]) + early, int(steps[index]) + late


def _window(steps: Sequence[int], index: int) -> "array[int]":
    """Return the five positions around a frame. Beyond the ends the end positions repeat."""
    last = len(steps) - 1
    window = array("i", [0] * path.WINDOW_WORDS)
    window[path.MOST] = path.MONOTONE
    for word in range(5):
        window[path.FRAMES + word] = int(steps[min(max(index + word - 2, 0), last)])
    return window


def _slope(steps: Sequence[int], index: int) -> int:
    return path.slope(_window(steps, index), _BOUNDS, index, len(steps) - 1 - index)
