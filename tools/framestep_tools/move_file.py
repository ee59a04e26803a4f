"""Moves kept as CSV: a column `frame`, then a column per motor in the order of the motors, positions in steps."""

import csv
import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .errors import ToolError

CAMERA_MOVE = Path(__file__).with_name("moves") / "camera_move.csv"


class MoveFileError(ToolError):
    """A file that is no move; the text names the line."""


@dataclass(frozen=True)
class Move:
    """Positions in steps for each scene frame from `start_frame` on; motors count from 1."""

    start_frame: int
    names: dict[int, str]
    positions: dict[int, np.ndarray]

    @property
    def frames(self) -> int:
        """How many frames the move has."""
        return len(next(iter(self.positions.values())))

    @property
    def end_frame(self) -> int:
        """The last scene frame."""
        return self.start_frame + self.frames - 1

    def section(self, first: int, last: int) -> dict[int, np.ndarray]:
        """Positions at the scene frames from `first` to `last`, both included; backward if `last` comes first."""
        step = 1 if last >= first else -1
        index = np.arange(first, last + step, step) - self.start_frame
        return {motor: steps[index] for motor, steps in self.positions.items()}


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
        values.append(numbers)
    if not values:
        raise MoveFileError(f"{path}: expected a line for each frame, found none")
    table = np.array(values, np.int64)
    if (outside := np.abs(table) >= 2**31).any():
        line = int(np.flatnonzero(outside.any(axis=1))[0]) + 2
        raise MoveFileError(f"{path}, line {line}: positions have to fit 32 bits signed")
    return Move(
        int(table[0, 0]),
        dict(enumerate(header[1:], 1)),
        {motor: table[:, motor] for motor in range(1, len(header))},
    )
