"""The pose of a camera in a file: its columns, and its numbers in framestep's directions."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..axes.units import factor
from ..errors import ToolError
from .camera_rig import CameraRig
from .move_formats.camera import ALIASES, OWN, Camera
from .move_formats.recording import Channel, Curve, Recording

PARTS = tuple(ALIASES)


@dataclass(frozen=True)
class PoseColumns:
    """The columns of a camera's pose, by the names in `camera`. A missing angle is 0."""

    camera: Camera
    channels: dict[str, Channel]

    @property
    def said(self) -> list[str]:
        """What the user should know."""
        said = [f"{', '.join(map(str, self.channels.values()))}: the camera's pose, by [camera]"]
        missing = [name for name, _ in self.camera.rotations if name not in self.channels]
        if missing and len(self.camera.rotations) < 4:  # After Effects writes what is not 0
            said.append(f"the file has no {', '.join(missing)}, taken as 0")
        return said

    def poses(
        self,
        curve: Callable[[Channel, str], Curve],
        places: Sequence[float],
        rig: CameraRig,
        path: str,
    ) -> np.ndarray:
        """Return x, y, z in mm and pan, tilt, roll in degrees at these places, a row for each.

        curve: a channel's curve over them, in its own unit or else this one. Raises ToolError for a
        unit of another kind.
        """

        def columns(names: Sequence[str], of: str, to: str) -> np.ndarray:
            out = np.zeros((len(places), len(names)))
            for i, name in enumerate(names):
                channel = self.channels.get(name)
                if channel is None:
                    continue
                times = factor(channel.unit or of, to)
                if times is None:
                    raise ToolError(
                        f"{path}, {channel}: its unit {channel.unit} cannot be converted to {to}"
                    )
                at = curve(channel, of).at
                out[:, i] = [at(place) for place in places]
                out[:, i] *= times
            return out

        camera = self.camera
        position = columns(camera.position, rig.file_unit, "mm")
        target = columns(camera.target, rig.file_unit, "mm") if camera.target else None
        rotations = columns([name for name, _ in camera.rotations], "deg", "deg")
        angles = camera.angles(position, target, rotations)
        return np.hstack([camera.places(position), angles])


def pose_columns(
    recording: Recording, rig: CameraRig, chosen: Mapping[str, str], path: str
) -> PoseColumns | None:
    """Return the columns of the camera's pose, or None if the file has none.

    chosen: columns that the user has named, also for x, y, z, pan, tilt, roll: these count as
    framestep does. Raises ToolError if one of these is not there.
    """
    asked = any(part in chosen for part in PARTS)
    camera = recording.camera if recording.camera and not asked else OWN
    channels = {}
    for name in camera.names:
        names: tuple[str, ...] = ALIASES[name] if camera is OWN else (name,)
        if name in chosen:
            names = (chosen[name],)
        found = [channel for text in names for channel in _called(recording, text)]
        if found:
            channels[name] = found[0]
        elif name in chosen or (name in camera.position and any(p in chosen for p in "xyz")):
            said = f"{chosen[name]!r} for {name}" if name in chosen else f"for {name}, name it too"
            raise ToolError(
                f"--column: {path} has no column {said}; it has "
                f"{', '.join(map(str, recording.channels))}"
            )
    needed = [*camera.position, *(camera.target or ())]
    if not all(name in channels for name in needed):
        return None
    return PoseColumns(camera.changed(rig.order, rig.up), channels)


def _called(recording: Recording, name: str) -> list[Channel]:
    """Return the channels with a name or a column's number."""
    wanted = name.lower()
    number = int(wanted) if wanted.isascii() and wanted.isdecimal() and len(wanted) < 7 else 0
    return [
        channel
        for channel in recording.channels
        if wanted in (channel.name.lower(), channel.bare_name.lower())
        or (number and channel.column == number)
    ]
