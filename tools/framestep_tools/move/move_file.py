"""Moves as CSV: a column `frame`, then a column per motor in their order, with positions in
steps."""

import csv
import io
import os
from dataclasses import dataclass
from pathlib import Path

from ..errors import ToolError

EXAMPLES = Path(__file__).parent
CAMERA_MOVE = EXAMPLES / "camera_move.csv"
_LONGEST = 80  # characters of a line in an error text


class MoveFileError(ToolError):
    """A file is not a move. The text names the line."""


@dataclass(frozen=True)
class Move:
    """Positions in steps for each scene frame from `start_frame` on; motors count from 1."""

    start_frame: int
    names: dict[int, str]
    positions: dict[int, list[int]]

    @property
    def frames(self) -> int:
        """Number of frames."""
        return len(next(iter(self.positions.values())))

    @property
    def end_frame(self) -> int:
        """Number of the last scene frame."""
        return self.start_frame + self.frames - 1

    def section(self, first: int, last: int) -> dict[int, list[int]]:
        """Return positions at the scene frames from `first` to `last`, including both; backward if
        `last` comes first."""
        step = 1 if last >= first else -1
        frames = range(first - self.start_frame, last + step - self.start_frame, step)
        return {motor: [steps[i] for i in frames] for motor, steps in self.positions.items()}


def or_example(path: Path) -> Path:
    """Return the file, or framestep's example of that name if there is no such file."""
    example = EXAMPLES / path.name
    return example if path.name == str(path) and not path.exists() and example.exists() else path


def read_move(path: str | os.PathLike = CAMERA_MOVE) -> Move:
    """Read a move. Raises MoveFileError, with the line, if the file is missing or wrong.

    Variants that spreadsheets write are accepted: see read_frames().
    """
    (_, frames), *motors = read_frames(path, "the move", "<motor 1>,<motor 2>…")
    return Move(
        frames[0],
        {motor: name for motor, (name, _) in enumerate(motors, 1)},
        {motor: steps for motor, (_, steps) in enumerate(motors, 1)},
    )


def read_frames(path: str | os.PathLike, what: str, columns: str) -> list[tuple[str, list[int]]]:
    """Read a table with a line for each frame. Return the names and whole numbers of its columns,
    frames first. Raises MoveFileError, with the line.

    what, columns: kind of the file and the columns after the frames, for error texts.

    Variants that spreadsheets write are accepted: a byte order mark; semicolons, tabs or blanks
    between the columns; 12.0 for 12; empty lines at the end; empty columns after the last; FRAME
    for frame.
    """
    rows = rows_of(text_of(path, what), path)
    header = rows[0] if rows else []
    if len(header) < 2 or header[0].lower() != "frame":
        raise MoveFileError(
            f"{path}, line 1: expected the header frame,{columns}, found {shown(header)}"
        )
    values: list[list[int]] = []
    for line, row in enumerate(rows[1:], 2):
        numbers = _numbers(row, header, f"{path}, line {line}")
        if values and numbers[0] != values[-1][0] + 1:
            raise MoveFileError(
                f"{path}, line {line}: expected frame {values[-1][0] + 1}, found {numbers[0]}"
            )
        values.append(numbers)
    if not values:
        raise MoveFileError(f"{path}: expected a line for each frame, found none")
    return [
        (name, list(column)) for name, column in zip(header, zip(*values, strict=True), strict=True)
    ]


def text_of(path: str | os.PathLike, what: str = "the move") -> str:
    """Read the text of a move's file. Raises MoveFileError. what: as for read_frames()."""
    try:
        with open(path, encoding="utf-8-sig") as file:
            return file.read()
    except OSError as error:
        raise MoveFileError(f"cannot read {what} {path}: {error.strerror or error}") from None
    except UnicodeDecodeError as error:
        raise MoveFileError(
            f"cannot read {what} {path}: it is not text, see byte {error.start}"
        ) from None


def separator_of(text: str) -> str:
    """Return the separator of a table's columns: the most frequent of tab, ; and , in its header,
    or a blank if it has none of them."""
    first = text.split("\n", 1)[0]
    most = max("\t;,", key=first.count)
    return most if most in first else " "


def rows_of(text: str, path: str | os.PathLike) -> list[list[str]]:
    """Return the rows of a table, without empty lines at the end and empty columns after the
    header's. Raises MoveFileError, with the line, for wrong quotes."""
    reader = csv.reader(text.splitlines(), delimiter=separator_of(text), skipinitialspace=True)
    try:
        rows = [[cell.strip() for cell in row] for row in reader]
    except csv.Error as error:
        raise MoveFileError(f"{path}, line {reader.line_num}: {error}") from None
    while rows and not any(rows[-1]):
        rows.pop()
    while rows and rows[0] and not rows[0][-1]:
        rows[0].pop()
    for row in rows[1:]:
        while len(row) > len(rows[0]) and not row[-1]:
            row.pop()
    return rows


def write_move(path: str | os.PathLike, move: Move) -> None:
    """Write a move for `read_move`. Raises MoveFileError."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(["frame", *(move.names[motor] for motor in move.positions)])
    frames = range(move.start_frame, move.end_frame + 1)
    writer.writerows(zip(frames, *move.positions.values(), strict=True))
    write_text(path, out.getvalue())


def write_text(path: str | os.PathLike, text: str) -> None:
    """Write a move's file completely or not at all. Raises MoveFileError.

    A path that is not a file, such as /dev/stdout, is written to and not replaced.
    """
    target = Path(path).resolve()
    plain = target.is_file() or not target.exists()
    written = target.with_name(f".{target.name}.part") if plain else target
    try:
        with open(written, "w", newline="", encoding="utf-8") as file:
            file.write(text)
        if plain:
            os.replace(written, target)
    except OSError as error:
        if plain:
            written.unlink(missing_ok=True)
        raise MoveFileError(f"cannot write {path}: {error.strerror or error}") from None


def shown(row: list[str]) -> str:
    """Return a row for an error text: one line of limited length."""
    text = ",".join(row)
    return repr(text if len(text) <= _LONGEST else text[:_LONGEST] + "…")


def _numbers(row: list[str], header: list[str], where: str) -> list[int]:
    """Return a row's whole numbers, one a column. Raises MoveFileError for anything else."""
    if len(row) != len(header):
        raise MoveFileError(f"{where}: expected {len(header)} whole numbers, found {shown(row)}")
    numbers = []
    for cell, name in zip(row, header, strict=True):
        whole, _, fraction = cell.partition(".")
        try:
            if fraction.strip("0") or "_" in cell:
                raise ValueError
            number = int(whole)
        except ValueError:
            raise MoveFileError(
                f"{where}: expected a whole number for {name}, found {shown([cell])}"
            ) from None
        if not -(2**31) <= number < 2**31:
            raise MoveFileError(
                f"{where}: positions have to fit 32 bits signed, found {number} for {name}"
            )
        numbers.append(number)
    return numbers
