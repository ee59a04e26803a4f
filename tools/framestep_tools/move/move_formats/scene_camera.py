"""A camera in a three-dimensional scene: its pose over time becomes x, y, z, pan, tilt, roll."""

from collections.abc import Callable

import numpy as np

from ...text.text_file import MoveFileError
from .camera import SCENE, going_on, pan_tilt_roll
from .curves import Samples
from .recording import Channel, Recording

Pose = tuple[
    np.ndarray, np.ndarray
]  # positions, and matrices from the camera's axes to the scene's
UNITS = {"x": "m", "y": "m", "z": "m", "pan": "deg", "tilt": "deg", "roll": "deg"}
_MOST = 2_000_000  # samples


def recorded(
    keys: np.ndarray,
    pose: Callable[[np.ndarray], Pose],
    longest: float,
    step: float,
    path: str,
    seconds: bool = False,
    fps: float | None = None,
    said: tuple[str, ...] = (),
) -> Recording:
    """Return the pose of a camera, sampled at its keys, and where keys are farther apart than
    `longest` also between them, `step` apart at most.

    keys: places of keys, increasing; pose: in metres, y up, at places. Raises MoveFileError.
    """
    if not np.all(np.isfinite(keys)):
        raise MoveFileError(f"{path}: expected numbers as times of keys")
    gaps = np.diff(keys)
    parts = np.where(gaps > longest, np.ceil(gaps / step), 1)
    if parts.sum() >= _MOST:
        raise MoveFileError(f"{path}: expected at most {_MOST} samples, found keys far apart")
    pieces = [
        np.linspace(start, start + gap, int(count), endpoint=False) if count > 1 else [start]
        for start, gap, count in zip(keys[:-1], gaps, parts, strict=True)
    ]
    places = np.concatenate([*pieces, keys[-1:]])
    position, matrix = pose(places)
    columns = np.hstack([position, going_on(pan_tilt_roll(matrix))])
    if not np.all(np.isfinite(columns)):
        raise MoveFileError(f"{path}: the camera's pose is not a number at some key")
    at = places.tolist()
    return Recording(
        [
            Channel(name, Samples(at, column.tolist()), unit, i)
            for i, ((name, unit), column) in enumerate(
                zip(UNITS.items(), columns.T, strict=True), 1
            )
        ],
        seconds=seconds,
        fps=fps,
        said=said,
        camera=SCENE,
    )
