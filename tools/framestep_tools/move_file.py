"""Moves kept as CSV: a column `frame`, then a column per motor in the order of the motors, positions in steps."""

import csv
import os
from dataclasses import dataclass
from pathlib import Path

from .errors import ToolError

CAMERA_MOVE = Path(__file__).with_name("moves") / "camera_move.csv"


class MoveFileError(ToolError):
    """A file that is no move; the text names the line."""


@dataclass(frozen=True)
class Move:
    """Positions in steps for each scene frame from `start_frame` on; motors count from 1."""

    start_frame: int
    names: dict[int, str]
    positions: dict[int, list[int]]

    @property
    def frames(self) -> int:
        """How many frames the move has."""
        return len(next(iter(self.positions.values())))

    @property
    def end_frame(self) -> int:
        """The last scene frame."""
        return self.start_frame + self.frames - 1

    def section(self, first: int, last: int) -> dict[int, list[int]]:
        """Positions at the scene frames from `first` to `last`, both included; backward if `last` comes first."""
        step = 1 if last >= first else -1
        frames = range(first - self.start_frame, last + step - self.start_frame, step)
        return {motor: [steps[i] for i in frames] for motor, steps in self.positions.items()}


def read_move(path: str | os.PathLike = CAMERA_MOVE) -> Move:
    """Read a move; MoveFileError if the file is not there or not as described above."""
    try:
        with open(path, newline="") as file:
            rows = list(csv.reader(file))
    except (OSError, UnicodeDecodeError) as error:
        raise MoveFileError(f"cannot read the move {path}: {error}") from None
    header = rows[0] if rows else []
    if len(header) < 2 or header[0] != "frame":
        raise MoveFileError(f"{path}: expected the header frame,<motor 1>,<motor 2>…, found {','.join(header)!r}")
    values: list[list[int]] = []
    for line, row in enumerate(rows[1:], 2):
        try:
            numbers = [int(cell) for cell in row]
        except ValueError:
            numbers = []
        if len(numbers) != len(header):
            raise MoveFileError(f"{path}, line {line}: expected {len(header)} whole numbers, found {','.join(row)!r}")
        if values and numbers[0] != values[-1][0] + 1:
            raise MoveFileError(f"{path}, line {line}: expected frame {values[-1][0] + 1}, found {numbers[0]}")
        if not all(-(2**31) <= number < 2**31 for number in numbers):
            raise MoveFileError(f"{path}, line {line}: positions have to fit 32 bits signed")
        values.append(numbers)
    if not values:
        raise MoveFileError(f"{path}: expected a line for each frame, found none")
    columns = [list(column) for column in zip(*values, strict=True)]
    return Move(columns[0][0], dict(enumerate(header[1:], 1)), dict(enumerate(columns[1:], 1)))
