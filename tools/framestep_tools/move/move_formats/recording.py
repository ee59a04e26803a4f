"""Common representation of moves: every format is read into it and written from it."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

from .units import factor, without_unit

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
    names; said: what its user should know
    """

    channels: list[Channel]
    seconds: bool = False
    step: float = 0.0
    fps: float | None = None
    said: tuple[str, ...] = ()

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
