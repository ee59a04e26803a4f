"""Light levels and triggers of a move as CSV: a column `frame`, then a column per DMX channel (`5`
or `dmx 5`, levels 0 to 255) or output (`output 2`, 1 if it is on, else 0).

The frames are the move's, from its first one on. After the last line lights keep their levels, and
outputs are off.
"""

import os
import re
from collections.abc import Iterator
from dataclasses import dataclass

from framestep.moves.upload.light_levels import CHANNELS
from framestep.protocol import messages

from ..payloads import (
    LAST_SECTION,
    Ack,
    DeviceInfo,
    Request,
    RtUploadMoveDmx,
    RtUploadMoveTriggers,
    Trigger,
)
from ..text.text_file import MoveFileError, read_text
from .move_file import frames_of

_COLUMN = re.compile(r"(?:dmx ?)?(?P<channel>\d+)|output ?(?P<output>\d+)", re.IGNORECASE)
_MOST_OUTPUTS = 32  # bits of a trigger's mask
_CHANNEL_AND_INDEX = 6  # bytes of a section before its levels
_PER_SECTION = messages.LARGEST_PAYLOAD - _CHANNEL_AND_INDEX
_MASK = 4  # bytes of a message before its triggers
_PER_MESSAGE = (messages.LARGEST_PAYLOAD - _MASK) // 8


@dataclass(frozen=True)
class Lights:
    """`levels`: by DMX channel, 0 to 255 for each frame. `outputs`: by general output from 1, 0 or
    1 for each frame."""

    start_frame: int
    levels: dict[int, list[int]]
    outputs: dict[int, list[int]]

    @property
    def end_frame(self) -> int:
        """Number of the last scene frame in the file."""
        columns = [*self.levels.values(), *self.outputs.values()]
        return self.start_frame + len(columns[0]) - 1

    def check(self, start_frame: int, end_frame: int, device: DeviceInfo) -> None:
        """Raise MoveFileError if the frames do not match a move's scene frames, or the device lacks
        a channel or output."""
        if self.start_frame != start_frame:
            raise MoveFileError(
                f"the lights begin at frame {self.start_frame}, "
                f"the move begins at frame {start_frame}: expected levels from that frame on"
            )
        if self.end_frame > end_frame:
            raise MoveFileError(
                f"the lights end at frame {self.end_frame}, after the move's last frame, "
                f"{end_frame}"
            )
        for what, wanted, there in (
            ("DMX channel", self.levels, device.dmx_channels),
            ("output", self.outputs, device.outputs),
        ):
            if wanted and max(wanted) > there:
                has = f"{what}s 1 to {there}" if there else f"no {what}s"
                raise MoveFileError(
                    f"there is no {what} {max(wanted)}: {device.name} has {has} "
                    "(set in its rig file)"
                )

    def requests(self) -> Iterator[Request[Ack]]:
        """Yield the requests that upload them, between a move's begin and end."""
        for channel, levels in self.levels.items():
            for index in range(0, len(levels), _PER_SECTION):
                last = LAST_SECTION if index + _PER_SECTION >= len(levels) else 0
                yield RtUploadMoveDmx(channel, index | last, levels[index : index + _PER_SECTION])
        if not self.outputs:
            return
        mask = sum(1 << (output - 1) for output in self.outputs)
        triggers = []
        for index in range(self.end_frame - self.start_frame + 1):
            bits = sum(on[index] << (output - 1) for output, on in self.outputs.items())
            if bits:
                triggers.append(Trigger(index, bits))
        for at in range(0, max(len(triggers), 1), _PER_MESSAGE):
            yield RtUploadMoveTriggers(mask, triggers[at : at + _PER_MESSAGE])


def read_lights(path: str | os.PathLike[str]) -> Lights:
    """Read a table of lights. Raises MoveFileError, with the line, for a mistake."""
    read = read_text(path, "the lights")
    table, (frames, *columns) = frames_of(read, path, "<channel>,output <number>…")
    lights = Lights(frames[0], {}, {})
    for name, values in zip(table.rows[0][1:], columns, strict=True):
        kind, number = _column(name, table.where(0))
        found = lights.levels if kind == "channel" else lights.outputs
        if number in found:
            raise MoveFileError(f"{table.where(0)}: {name} occurs twice")
        most = 255 if kind == "channel" else 1
        for row, value in enumerate(values, 1):
            if not 0 <= value <= most:
                raise MoveFileError(
                    f"{table.where(row)}: expected 0 to {most} for {name}, found {value}"
                )
        found[number] = values
    return lights


def _column(name: str, where: str) -> tuple[str, int]:
    """Return "channel" or "output", and its number."""
    found = _COLUMN.fullmatch(name)
    if found:
        kind = "channel" if found["channel"] else "output"
        number = int(found[kind])
        if 1 <= number <= (CHANNELS if kind == "channel" else _MOST_OUTPUTS):
            return kind, number
    raise MoveFileError(
        f"{where}: expected a DMX channel, 1 to {CHANNELS}, or an output such as "
        f"output 1, found {name[:80]!r}"
    )
