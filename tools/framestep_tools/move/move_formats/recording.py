"""Common representation of moves: every format is read into it and written from it."""

import math
from dataclasses import dataclass
from typing import Protocol

from ..move_file import MoveFileError, shown
from .units import factor

GREATEST = 1e15  # of any number in a file: above it a float cannot count by ones
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

    def at(self, x: float) -> float:
        """Return the value at a place; beyond `first` and `last`, the end's value."""
        ...


@dataclass(frozen=True)
class Channel:
    """One axis of a file. `name` is empty if the file has no names. `unit` is one of `units.UNITS`,
    or empty if the file does not name it."""

    name: str
    curve: Curve
    unit: str = ""


@dataclass(frozen=True)
class Recording:
    """Content of a file: its axes, over seconds or over frames."""

    channels: list[Channel]
    seconds: bool = False

    @property
    def names(self) -> list[str]:
        """List the axes with their units, if the file has them; without names by their order."""
        return [
            f"{channel.name or f'column {i}'}{f' in {channel.unit}' if channel.unit else ''}"
            for i, channel in enumerate(self.channels, 1)
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
    """A move for export: one value per axis and frame, from scene frame `start_frame` on."""

    start_frame: int
    columns: list[Column]

    @property
    def frames(self) -> range:
        """Scene frames of the move."""
        return range(self.start_frame, self.start_frame + len(self.columns[0].values))


def number(text: str, where: str) -> float:
    """Parse a number. Raises MoveFileError, with `where`."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not abs(value) <= GREATEST or "_" in text:
        raise MoveFileError(f"{where}: expected a number, found {shown([text])}")
    return value
