"""What every format of moves is read into, and what it is written from."""

import math
from dataclasses import dataclass
from typing import Protocol

from ..move_file import MoveFileError, shown
from .units import factor

GREATEST = 1e15  # of any number in a file: one more would not be another one
FIRST_FRAME = 1  # of files that do not number their frames


class Curve(Protocol):
    """Values over frames or seconds, from `first` to `last`."""

    @property
    def first(self) -> float:
        """Where it begins."""
        ...

    @property
    def last(self) -> float:
        """Where it ends."""
        ...

    def at(self, x: float) -> float:
        """The value there; before `first` and after `last` that of the end."""
        ...


@dataclass(frozen=True)
class Channel:
    """One axis of a file. `name` is empty where the file has no names, and `unit` where it does
    not name the unit; `unit` is one of `units.UNITS`."""

    name: str
    curve: Curve
    unit: str = ""


@dataclass(frozen=True)
class Recording:
    """A file as it was read: its axes, over seconds or over frames."""

    channels: list[Channel]
    seconds: bool = False

    @property
    def names(self) -> list[str]:
        """Its axes, with their units where it names them; without names by their order."""
        return [
            f"{channel.name or f'column {i}'}{f' in {channel.unit}' if channel.unit else ''}"
            for i, channel in enumerate(self.channels, 1)
        ]


@dataclass(frozen=True)
class Column:
    """Values of one axis to be written, one per frame, in `unit`, with so many decimals that each
    gives its step again."""

    name: str
    unit: str
    decimals: int
    values: list[float]

    def converted(self, unit: str) -> "Column":
        """The same in another unit of the same kind."""
        times = factor(self.unit, unit)
        assert times is not None
        decimals = self.decimals + max(0, math.ceil(-math.log10(times)))
        return Column(self.name, unit, decimals, [value * times for value in self.values])

    def texts(self) -> list[str]:
        """The values as they are written."""
        # Adding 0.0 makes 0.0 of -0.0
        return [f"{round(value, self.decimals) + 0.0:.{self.decimals}f}" for value in self.values]


@dataclass(frozen=True)
class Table:
    """A move to be written: one value per axis and frame, from scene frame `start_frame` on."""

    start_frame: int
    columns: list[Column]

    @property
    def frames(self) -> range:
        """The scene frames."""
        return range(self.start_frame, self.start_frame + len(self.columns[0].values))


def number(text: str, where: str) -> float:
    """A number as it is written; MoveFileError, with `where`, for anything else."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not abs(value) <= GREATEST or "_" in text:
        raise MoveFileError(f"{where}: expected a number, found {shown([text])}")
    return value
