"""Conversion from a file's content to steps per frame, and back."""

import math
from collections.abc import Callable

from ..errors import ToolError
from .axes_file import Axis
from .move_file import Move
from .move_formats.recording import FIRST_FRAME, Channel, Column, Recording, Table
from .move_formats.units import factor

LONGEST = (
    1_000_000  # frames; more than any controller accepts, so probably a typing error in a file
)
_CLOSE = 1e-6  # frames: a last frame this close to the end of a file counts as inside
_FEWEST_DECIMALS = 4


def to_move(
    recording: Recording,
    axes: list[Axis],
    path: str,
    fps: float | None = None,
    start: int | None = None,
) -> tuple[Move, list[str]]:
    """Return a move of the axes in their motors' order, and the file's names without an axis.

    fps: frames per second, only for a file in seconds; start: number of the first frame (None: the
    file's, or 1). Raises ToolError if an axis is not in the file, its unit is of another kind, or a
    position is beyond its limits, with the frame.
    """
    if recording.seconds and fps is None:
        raise ToolError(f"{path} is in seconds: name the frames per second by --fps")
    if fps is not None and not recording.seconds:
        raise ToolError(f"{path} is in frames: --fps is for files in seconds")
    channels = _assigned(recording.channels, axes, path)
    used = [channel.curve for channel in channels if channel]
    if not used:
        raise ToolError(f'{path}: no axis to take from it: each of the axes has "hold"')
    begin = min(curve.first for curve in used)
    end = max(curve.last for curve in used)
    places = _places(begin, end, fps, path)
    first = FIRST_FRAME if recording.seconds else round(places(0))
    number = first if start is None else start
    count = max(1, math.floor((end - places(0)) * (fps or 1) + _CLOSE) + 1)
    for frame in (number, number + count - 1):
        if not -(2**31) <= frame < 2**31:
            raise ToolError(f"{path}: frame numbers have to fit 32 bits signed, found {frame}")
    positions: dict[int, list[int]] = {}
    for axis, channel in zip(axes, channels, strict=True):
        at = _position(axis, channel, path)
        steps = []
        for i in range(count):
            steps.append(axis.steps(at(places(i))))
            axis.check(steps[-1], number + i)
        positions[axis.motor] = steps
    names = {axis.motor: axis.name for axis in axes}
    taken = {id(channel) for channel in channels}
    left = [channel.name for channel in recording.channels if id(channel) not in taken]
    return Move(number, names, positions), left


def _places(begin: float, end: float, fps: float | None, path: str) -> Callable[[int], float]:
    """Return a function from a frame's index to its place in the file."""
    if (end - begin) * (fps or 1) > LONGEST:
        raise ToolError(f"{path}: expected at most {LONGEST} frames, found {begin:g} to {end:g}")
    if fps is not None:
        return lambda i: begin + i / fps
    whole = math.ceil(begin - _CLOSE)
    return lambda i: float(whole + i)


def _assigned(channels: list[Channel], axes: list[Axis], path: str) -> list[Channel | None]:
    """Return the channel of each axis, or None for an axis that holds."""
    if channels and not any(channel.name for channel in channels):
        moving = [axis for axis in axes if axis.hold is None]
        if len(channels) != len(moving):
            raise ToolError(
                f"{path} has {len(channels)} columns without names, "
                f"there are {len(moving)} axes to take from it"
            )
        columns = iter(channels)
        return [next(columns) if axis.hold is None else None for axis in axes]
    return [_named(axis, channels, path) if axis.hold is None else None for axis in axes]


def _named(axis: Axis, channels: list[Channel], path: str) -> Channel:
    """Return the channel with an axis's name: the exact one, or the only one if capitals are
    ignored."""
    for same in (str, str.lower):
        found = [channel for channel in channels if same(channel.name) == same(axis.in_file)]
        if len(found) == 1:
            return found[0]
        if found:
            raise ToolError(f"{path} has more than one axis {axis.in_file!r}")
    names = ", ".join(channel.name for channel in channels)
    raise ToolError(f"{path} has no axis {axis.in_file!r} for motor {axis.motor}; it has {names}")


def _position(axis: Axis, channel: Channel | None, path: str) -> Callable[[float], float]:
    """Return a function from a place in the file to an axis's position in its unit."""
    if channel is None:
        hold = axis.hold or 0.0
        return lambda place: hold
    unit = channel.unit or axis.file_unit
    times = factor(unit, axis.unit)
    if times is None:
        raise ToolError(
            f"{path}, axis {channel.name}: its unit {unit} cannot be converted to {axis.unit}"
        )
    curve = channel.curve
    return lambda place: curve.at(place) * times


def to_table(move: Move, axes: list[Axis]) -> Table:
    """Return a move for export: the axes that do not hold, in their files' units.

    Raises ToolError if the move has other motors than the axes, or if a position is beyond its
    limits, with the frame.
    """
    if len(move.positions) != len(axes):
        raise ToolError(
            f"the move has {len(move.positions)} motors, and there are {len(axes)} axes"
        )
    for axis in axes:
        for i, steps in enumerate(move.positions[axis.motor]):
            axis.check(steps, move.start_frame + i)
    columns = [_column(axis, move.positions[axis.motor]) for axis in axes if axis.hold is None]
    if not columns:
        raise ToolError('no axis to write: each of the axes has "hold"')
    return Table(move.start_frame, columns)


def _column(axis: Axis, steps: list[int]) -> Column:
    times = factor(axis.unit, axis.file_unit) or 1.0
    # A hundredth of a step, so rounding gives the same steps again
    decimals = max(_FEWEST_DECIMALS, math.ceil(math.log10(axis.steps_per_unit / times)) + 2)
    values = [axis.position(step) * times for step in steps]
    return Column(axis.in_file, axis.file_unit, decimals, values)
