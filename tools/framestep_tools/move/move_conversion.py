"""Conversion from a file's content to steps per frame, and back."""

import math
import re
from collections.abc import Callable, Mapping
from typing import NamedTuple

from ..axes.axes_file import Axis
from ..axes.units import factor
from ..errors import ToolError
from ..text.text_file import listed
from .camera_pose import PARTS, pose_columns
from .camera_rig import CameraRig
from .frame_times import Frame, to_frames
from .move_file import Move
from .move_formats.camera import Camera
from .move_formats.recording import FIRST_FRAME, Channel, Column, Curve, Recording, Table
from .smoothing import smoothed
from .turns import unwrapped

LONGEST = (
    1_000_000  # frames; more than any controller accepts, so probably a typing error in a file
)
_CLOSE = 1e-6  # frames: what calculation may lose
_HAIR = 0.01  # frames: keys that are meant to be on a frame
_FEWEST_DECIMALS = 4
_POSE_DECIMALS = 6  # of millimetres, which gives the same steps again
_TURNING_S = 0.2  # samples of a rotation farther apart may be a turn that is meant
_MOST_SHOWN = 8
_SMALL = 1e-6  # steps: what calculation may lose
_COLUMN = re.compile(r"(?:column )?(\d{1,6})", re.IGNORECASE)


def to_move(
    recording: Recording,
    axes: list[Axis],
    path: str,
    fps: float | None = None,
    start: int | None = None,
    chosen: Mapping[str, str] | None = None,
    unwrap: bool = True,
    smooth: int | None = None,
    camera: CameraRig | None = None,
    posed: bool = False,
) -> tuple[Move, list[str]]:
    """Return a move of the axes in their motors' order, and the file's names without an axis.

    fps: frames per second; a file in seconds that does not name its own needs it, none may name
    others.
    start: number of the first frame (None: the file's, or 1); chosen: heading or number of the
    file's column by the name of an axis; unwrap: rotations go on beyond full turns;
    smooth: over so many frames, needs scipy; camera: the rig that takes the camera to its poses in
    the file; posed: the file has to have poses. Raises ToolError if an axis is not in the file, its
    unit is of another kind, or a position is beyond its limits or the rig's reach, with the frame.
    """
    named = recording.fps
    if recording.seconds and fps is None and named is None:
        raise ToolError(f"{path} is in seconds: name the frames per second by --fps")
    if fps is not None and named and not same_rate(fps, named):
        raise ToolError(
            f"{path} is at {named:.10g} frames/s, --fps says {fps:.10g}: leave --fps out"
        )
    fps = named or fps
    chosen = chosen or {}
    pose = pose_columns(recording, camera, chosen, path) if camera else None
    if posed and not pose:
        raise ToolError(
            f"--camera: {path} has no camera's pose: expected columns such as x, y, z, or "
            f"--column x=2 and so on; it has {listed(recording.names)}"
        )
    by_pose = camera.moved if camera and pose else []
    others = [axis for axis in axes if axis not in by_pose]
    if pose:
        chosen = {name: column for name, column in chosen.items() if name not in PARTS}
    channels = _assigned(recording, others, path, chosen)
    taken = [channel for channel in channels if channel]
    taken += pose.channels.values() if pose else ()
    used = [channel.curve for channel in taken]
    if not used:
        raise ToolError(f'{path}: no axis to take from it: each of the axes has "hold"')
    span = _span(recording, used, fps, start, path)
    whole, number, count = span.whole, span.number, span.frames
    if smooth and count < smooth:
        raise ToolError(f"--smooth {smooth} needs at least as many frames, {path} has {count}")
    said = [*recording.said, *span.said]

    def over_frames(channel: Channel, name: str, unit: str) -> Curve:
        """Return a channel's curve over frames, its full turns unwrapped."""
        curve = channel.curve.moved(span.frame)
        if unwrap:
            nearest = max(1.0, _TURNING_S * (fps or 1.0)) + _CLOSE
            curve, turns = unwrapped(curve, channel.unit or unit, nearest)
            if turns:
                said.append(_of_turns(name, [math.ceil(x) - whole + number for x in turns]))
        return curve

    frames = [float(whole + i) for i in range(count)]
    places: dict[int, list[float]] = {}
    for axis, channel in zip(others, channels, strict=True):
        curve = over_frames(channel, axis.name, axis.file_unit) if channel else None
        at = _position(axis, channel, curve, path)
        places[axis.motor] = [at(place) for place in frames]
    if camera and pose:
        poses = pose.poses(
            lambda channel, unit: over_frames(channel, channel.name, unit), frames, camera, path
        )
        swing = camera.swing
        turned = _in_degrees(swing, places[swing.motor]) if swing else []
        found, about = camera.positions(poses, turned, number, path)
        places |= found
        said += [*pose.said, *about]
    positions: dict[int, list[int]] = {}
    moving = {axis.motor for axis, channel in zip(others, channels, strict=True) if channel}
    moving |= {axis.motor for axis in by_pose}
    for axis in axes:
        if smooth and axis.motor in moving:
            rough, places[axis.motor] = places[axis.motor], smoothed(places[axis.motor], smooth)
            said.append(_of_smoothing(axis, rough, places[axis.motor], smooth, number))
        steps = [axis.steps(place) for place in places[axis.motor]]
        for i, step in enumerate(steps):
            axis.check(step, number + i)
        positions[axis.motor] = steps
    names = {axis.motor: axis.name for axis in axes}
    if not any(channel.name for channel in recording.axes):
        said.append(
            ", ".join(
                f"{channel} is {name}"
                for name, channel in [
                    *((axis.name, channel) for axis, channel in zip(others, channels, strict=True)),
                    *(pose.channels.items() if pose else ()),
                ]
                if channel
            )
        )
    known = {id(channel) for channel in taken}
    left = [str(channel) for channel in recording.axes if id(channel) not in known]
    return Move(number, names, positions, fps, tuple(said)), left


class _Span(NamedTuple):
    """Frames of a move: the function from a place in the file to a frame, the first whole frame
    there, its number in the move, how many there are, and what to say."""

    frame: Frame
    whole: int
    number: int
    frames: int
    said: list[str]


def _span(
    recording: Recording, curves: list[Curve], fps: float | None, start: int | None, path: str
) -> _Span:
    """Return the frames of a move, as `to_move` makes it."""
    begin, end = min(curve.first for curve in curves), max(curve.last for curve in curves)
    per_place = fps if fps and recording.seconds else 1.0
    if (end - begin) * per_place > LONGEST:
        raise ToolError(f"{path}: expected at most {LONGEST} frames, found {begin:g} to {end:g}")
    frame = to_frames(
        [curve.known for curve in curves], recording.step, per_place, from_zero=recording.seconds
    )
    begin, end = frame(begin), frame(end)
    whole = math.ceil(begin - _CLOSE)
    first = FIRST_FRAME if recording.seconds else whole
    number = first if start is None else start
    # In seconds the last frame is on the end position, even if that comes between two frames
    last = math.ceil(end - _CLOSE) if recording.seconds else math.floor(end + _CLOSE)
    last = max(whole, last)
    count = last - whole + 1
    for edge in (number, number + count - 1):
        if not -(2**31) <= edge < 2**31:
            raise ToolError(f"{path}: frame numbers have to fit 32 bits signed, found {edge}")
    said = [f"{path} ends at frame {end:g}: what comes after frame {last} is left out"] * (
        end - last > _HAIR
    )
    return _Span(frame, whole, number, count, said)


def _in_degrees(axis: Axis, positions: list[float]) -> list[float]:
    times = factor(axis.unit, "deg") or 1.0
    return [position * times for position in positions]


def _of_turns(name: str, frames: list[int]) -> str:
    """Say at which frames a rotation is unwrapped."""
    shown = ", ".join(map(str, frames[:_MOST_SHOWN])) + " …" * (len(frames) > _MOST_SHOWN)
    return (
        f"{name} jumps by full turns and goes on instead, from frame{'s' * (len(frames) > 1)} "
        f"{shown} (--no-unwrap of framestep import: it jumps)"
    )


def _of_smoothing(
    axis: Axis, rough: list[float], smooth: list[float], frames: int, number: int
) -> str:
    """Say by how much smoothing has changed an axis."""
    changes = [abs(a - b) for a, b in zip(rough, smooth, strict=True)]
    most = max(changes)
    shown = f"{most:.3g}" if most * axis.steps_per_unit >= _SMALL else "0"
    at = f", at frame {number + changes.index(most)}" if shown != "0" else ""
    return f"{axis.name}: smoothed over {frames} frames, by at most {shown} {axis.unit}{at}"


def same_rate(one: float, other: float) -> bool:
    """Return whether two rates are the same, such as 23.976 and 24000/1001."""
    return round(one, 2) == round(other, 2)


def _assigned(
    recording: Recording, axes: list[Axis], path: str, chosen: Mapping[str, str]
) -> list[Channel | None]:
    """Return the channel of each axis, or None for an axis that holds."""
    for name in chosen:
        if name not in (axis.name for axis in axes):
            known = ", ".join(axis.name for axis in axes)
            raise ToolError(f"--column: there is no axis {name!r}, there are {known}")
    channels = recording.axes
    if channels and not any(channel.name for channel in channels):
        moving = [axis for axis in axes if axis.hold is None or axis.name in chosen]
        if not moving:
            return [None for _ in axes]
        asked = [axis for axis in moving if _column_number(chosen.get(axis.name, axis.in_file))]
        if not asked:
            if len(channels) != len(moving):
                after = f" from column {channels[0].column} on" if channels[0].column > 1 else ""
                raise ToolError(
                    f"{path} has {len(channels)} columns without names{after}, "
                    f"there are {len(moving)} axes to take from it: "
                    f"choose by --column {moving[0].name if moving else axes[0].name}=2 and so on"
                )
            columns = iter(channels)
            return [next(columns) if axis in moving else None for axis in axes]
    return [
        _named(axis, recording.channels, path, chosen.get(axis.name))
        if axis.hold is None or axis.name in chosen
        else None
        for axis in axes
    ]


def _column_number(text: str) -> int:
    """Return the number in "5" or "column 5", else 0."""
    found = _COLUMN.fullmatch(text)
    return int(found[1]) if found else 0


def _named(axis: Axis, channels: list[Channel], path: str, choice: str | None) -> Channel:
    """Return the channel of an axis: the one with its name, also if capitals or a unit in brackets
    are ignored, or with its number. choice: that a user has named."""
    wanted = axis.in_file if choice is None else choice
    names: tuple[Callable[[Channel], bool], ...] = (
        lambda channel: channel.name == wanted,
        lambda channel: channel.name.lower() == wanted.lower(),
        lambda channel: channel.bare_name.lower() == wanted.lower(),
    )
    for same in names:
        found = [channel for channel in channels if channel.name and same(channel)]
        if len(found) == 1:
            return found[0]
        if found:
            raise ToolError(f"{path} has more than one axis {wanted!r}")
    number = _column_number(wanted)
    if number:
        for channel in channels:
            if channel.column == number:
                return channel
        last = max(channel.column for channel in channels)
        raise ToolError(f"{path} has no column {number} for axis {axis.name}; its last is {last}")
    there = listed(list(map(str, channels)))
    raise ToolError(f"{path} has no axis {wanted!r} for motor {axis.motor}; it has {there}")


def _position(
    axis: Axis, channel: Channel | None, curve: Curve | None, path: str
) -> Callable[[float], float]:
    """Return a function from a frame to an axis's position in its unit. curve: over frames."""
    if channel is None or curve is None:
        hold = axis.hold or 0.0
        return lambda place: hold
    unit = channel.unit or axis.file_unit
    times = factor(unit, axis.unit)
    if times is None:
        raise ToolError(
            f"{path}, axis {channel.name}: its unit {unit} cannot be converted to {axis.unit}"
        )
    return lambda place: curve.at(place) * times


def to_table(move: Move, axes: list[Axis]) -> Table:
    """Return a move for export: the axes that do not hold, in their files' units.

    Raises ToolError if the move has other motors than the axes, or with the frame if a position is
    beyond its limits or an axis is not where it holds.
    """
    _check(move, axes)
    for axis in axes:
        steps = move.positions[axis.motor]
        i = _off_hold(axis, steps)
        if axis.hold is not None and i is not None:
            raise ToolError(
                f"frame {move.start_frame + i}, axis {axis.name}: it is at "
                f'{axis.position(steps[i]):.10g} {axis.unit}, and "hold" leaves it out of the '
                f'file, to stay at {axis.hold:.10g} {axis.unit}: take "hold" out of axes.toml'
            )
    columns = [_column(axis, move.positions[axis.motor]) for axis in axes if axis.hold is None]
    if not columns:
        raise ToolError('no axis to write: each of the axes has "hold"')
    return Table(move.start_frame, columns, move.fps)


def to_pose_table(move: Move, axes: list[Axis], rig: CameraRig, camera: Camera) -> Table:
    """Return the pose of the rig's camera for export, as a format's camera.

    Raises ToolError as `to_table` does, or if the rig's arm cannot be there.
    """
    _check(move, axes)
    poses = rig.poses(move.positions, move.start_frame)
    camera = camera.changed(rig.order, rig.up)
    written = camera.written(poses[:, :3], poses[:, 3:])
    angles = {name for name, _ in camera.rotations}
    columns = [
        Column(name, "deg", _POSE_DECIMALS + 1, values.tolist())
        if name in angles
        else Column(name, "mm", _POSE_DECIMALS, values.tolist()).converted(rig.file_unit)
        for name, values in written.items()
    ]
    return Table(move.start_frame, columns, move.fps)


def left_by_pose(move: Move, axes: list[Axis], rig: CameraRig) -> list[str]:
    """Return the names of the axes that the pose of the rig's camera does not have."""
    return [
        axis.name
        for axis in axes
        if axis not in rig.axes.values()
        and (axis.hold is None or _off_hold(axis, move.positions[axis.motor]) is not None)
    ]


def _off_hold(axis: Axis, steps: list[int]) -> int | None:
    """Return the first index at which an axis is not where it holds."""
    hold = axis.steps(axis.hold or 0.0)
    return next((i for i, step in enumerate(steps) if step != hold), None)


def _check(move: Move, axes: list[Axis]) -> None:
    if list(move.positions) != [axis.motor for axis in axes]:
        motors = ", ".join(map(str, move.positions))
        raise ToolError(
            f"the move has positions for motor{'s' * (len(move.positions) > 1)} {motors}, "
            f"and there {'are axes' if len(axes) > 1 else 'is an axis'} for "
            f"{', '.join(str(axis.motor) for axis in axes)}"
        )
    for axis in axes:
        for i, steps in enumerate(move.positions[axis.motor]):
            axis.check(steps, move.start_frame + i)


def _column(axis: Axis, steps: list[int]) -> Column:
    times = factor(axis.unit, axis.file_unit) or 1.0
    # A hundredth of a step, so rounding gives the same steps again
    decimals = max(_FEWEST_DECIMALS, math.ceil(math.log10(axis.steps_per_unit / times)) + 2)
    values = [axis.position(step) * times for step in steps]
    return Column(axis.in_file, axis.file_unit, decimals, values)
