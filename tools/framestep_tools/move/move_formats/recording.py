"""Common representation of moves: every format is read into it and written from it."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

from ...axes.units import factor, without_unit
from ...text.text_file import MoveFileError
from ..table import Table as Text
from .camera import Camera

FIRST_FRAME = 1  # in files that do not number their frames


class Curve(Protocol):
    """Values over frames or seconds, from `first` to `last`."""

    @property
    def first(self) -> float:
        """Place where it begins."""
        ...

    @property
    def last(self) -> float:
        """Place where it ends."""
        ...

    @property
    def known(self) -> Sequence[float]:
        """Places of its samples or keyframes, increasing."""
        ...

    def at(self, x: float) -> float:
        """Return the value at a place; beyond `first` and `last`, the end's value."""
        ...

    def moved(self, place: Callable[[float], float]) -> "Curve":
        """Return the curve with its samples or keyframes at other places."""
        ...

    @property
    def points(self) -> Sequence[float]:
        """Values of its samples or keyframes."""
        ...

    def raised(self, by: Sequence[float]) -> "Curve":
        """Return the curve with another amount added at each sample or keyframe."""
        ...


@dataclass(frozen=True)
class Channel:
    """One axis of a file.

    name: empty if the file has no names; unit: one of `units.UNITS`, empty if the file does not
    name it; column: its number in the file, from 1; counts: it is the file's column of frames,
    which is an axis only if it is asked for by its number
    """

    name: str
    curve: Curve
    unit: str = ""
    column: int = 0
    counts: bool = False

    @property
    def bare_name(self) -> str:
        """The name without a unit in brackets."""
        return without_unit(self.name)[0]

    def __str__(self) -> str:
        return self.name or f"column {self.column}"


@dataclass(frozen=True)
class Recording:
    """Content of a file: its axes, over seconds or over frames.

    step: value of the last decimal of its times or frames; fps: frames per second that the file
    names; said: what its user should know; camera: how it has a camera, if the format says so
    """

    channels: list[Channel]
    seconds: bool = False
    step: float = 0.0
    fps: float | None = None
    said: tuple[str, ...] = ()
    camera: Camera | None = None

    @property
    def axes(self) -> list[Channel]:
        """The channels that are axes unless others are asked for."""
        return [channel for channel in self.channels if not channel.counts]

    @property
    def names(self) -> list[str]:
        """List the axes with their units, if the file has them; without names by their order."""
        return [
            f"{channel}{f' in {channel.unit}' if channel.unit else ''}" for channel in self.axes
        ]


@dataclass(frozen=True)
class Column:
    """Values of one axis for export, one per frame, in `unit`, with enough decimals to give the
    same steps again."""

    name: str
    unit: str
    decimals: int
    values: list[float]

    def converted(self, unit: str) -> "Column":
        """Convert the column to another unit of the same kind."""
        times = factor(self.unit, unit)
        assert times is not None
        decimals = self.decimals + max(0, math.ceil(-math.log10(times)))
        return Column(self.name, unit, decimals, [value * times for value in self.values])

    def texts(self) -> list[str]:
        """Return the values as text."""
        # Adding 0.0 turns -0.0 into 0.0
        return [f"{round(value, self.decimals) + 0.0:.{self.decimals}f}" for value in self.values]


@dataclass(frozen=True)
class Table:
    """A move for export: one value per axis and frame, from scene frame `start_frame` on. fps: its
    frames per second, if they are known."""

    start_frame: int
    columns: list[Column]
    fps: float | None = None

    @property
    def frames(self) -> range:
        """Scene frames of the move."""
        return range(self.start_frame, self.start_frame + len(self.columns[0].values))


# ---- parts of formats


def check_frames(table: Text, first: int, frames: list[float], name: str) -> None:
    """Raise MoveFileError unless frames are whole and count by one. first: their first row."""
    for i, frame in enumerate(frames):
        where = table.where(first + i, name)
        if frame != int(frame):
            raise MoveFileError(f"{where}: expected a whole number, found {frame:g}")
        if i and frame != frames[i - 1] + 1:
            raise MoveFileError(
                f"{where}: expected frame {frames[i - 1] + 1:.0f}, found {frame:.0f}"
            )


def check_increasing(before: float | None, frame: float, where: str) -> None:
    """Raise MoveFileError unless a keyframe comes after the one before it."""
    if before is not None and frame <= before:
        raise MoveFileError(f"{where}: expected a frame after {before:g}, found {frame:g}")


def slots(
    table: Table, names: Sequence[str], units: Mapping[str, str], format_name: str
) -> dict[str, Column]:
    """Return the columns of a format that has only these names, in its units. Capitals do not
    matter. Raises MoveFileError for another name or a unit of another kind."""
    found = {}
    for column in table.columns:
        name = next((name for name in names if name.lower() == column.name.lower()), None)
        if name is None:
            raise MoveFileError(
                f"{format_name} has only {', '.join(names)}; found {column.name!r}: name one by "
                '"in_file"'
            )
        unit = units.get(name, column.unit)
        if factor(column.unit, unit) is None:
            raise MoveFileError(f"{format_name} has {name} in {unit}, not in {column.unit}")
        found[name] = column.converted(unit)
    return found


def frame_rows(frames: range, columns: Sequence[Column | None]) -> str:
    """Return a line per frame: its number, and the columns' values, 0 for None."""
    texts = [column.texts() if column else ["0"] * len(frames) for column in columns]
    widths = [max(map(len, column)) for column in texts]
    return "".join(
        "  ".join(
            [str(frame), *(t[i].rjust(width) for t, width in zip(texts, widths, strict=True))]
        )
        + "\n"
        for i, frame in enumerate(frames)
    )
