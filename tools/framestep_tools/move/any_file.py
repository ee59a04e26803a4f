"""Moves from any file that framestep reads: its own, in steps, and other programs', in units."""

import os
from dataclasses import replace

from ..axes.rig_axes import FILE, Axes
from ..errors import ToolError
from ..text.text_file import Text, listed, read_text
from .camera_rig import rig_of
from .move_conversion import to_move
from .move_file import CAMERA_MOVE, Move, move_of, read_move
from .move_formats import FORMATS, csv_table, of_content, refuse_others


def read_any(path: str | os.PathLike[str], axes: Axes, fps: float | None = None) -> Move:
    """Read a move. fps: frames per second, for a file in seconds. Raises ToolError.

    The columns of framestep's example are motors 1, 2 …, whatever axes.toml calls them.
    """
    if path == CAMERA_MOVE:
        move = read_move(path)
        names = {m: a.name if (a := axes.axis(m)) else name for m, name in move.names.items()}
        return replace(move, names=names)
    return any_of(read_text(path), path, axes, fps)


def any_of(read: Text, path: str | os.PathLike[str], axes: Axes, fps: float | None = None) -> Move:
    """Return the move in a file's text, as `read_any` does. path: for errors."""
    refuse_others(read.text, str(path))
    if is_in_steps(read.text):
        return move_of(read, path, axes)
    name = str(path)
    recording = of_content(read.text, name).read(read.text, name)
    if not axes.list:
        raise ToolError(
            f"{path} is in units, and there is no {FILE}, which assigns its axes "
            f"({listed(recording.names)}) to motors; docs/use/axes.md shows one"
        )
    rate = fps if recording.seconds and not recording.fps else None
    move, left = to_move(recording, axes.list, name, rate, camera=rig_of(axes))
    said = [*read.said, *move.said]
    if left:
        said.append(f"left out, no axis names them: {listed(left)}")
    return Move(move.start_frame, move.names, move.positions, move.fps, tuple(said))


def is_in_steps(text: str) -> bool:
    """Return whether a file is a move in steps: its first heading is frame, or no format is
    recognised."""
    if csv_table.recognises(text):
        return not csv_table.is_in_seconds(text)
    return not any(each.recognises(text) for each in FORMATS.values())
