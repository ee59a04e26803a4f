"""Moves as CSV: a column `frame`, then a column per motor with positions in steps. A comment such
as `# fps: 25` before the header names the frames per second."""

import csv
import io
import os
import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from ..text.numerals import POINT, Cell, ambiguous, decimal_of, number
from ..text.text_file import MoveFileError, Text, read_text, shown, write_text
from .table import Table, with_header

if TYPE_CHECKING:
    from ..axes.rig_axes import Axes

EXAMPLES = Path(__file__).parent
CAMERA_MOVE = EXAMPLES / "camera_move.csv"
_WAY_OUT = "write whole steps, without fractions and signs between thousands"
_THOUSANDS = re.compile(r"[+-]?[1-9]\d{0,2}\.\d{3}")
_TENTHS = re.compile(  # a point that is not between thousands
    r"[+-]?(?:\d+\.\d{0,2}|0*\.\d+|\d+\.\d{4,}|\d{4,}\.\d*|0\d*\.\d*)"
)


@dataclass(frozen=True)
class Move:
    """Positions in steps for each scene frame from `start_frame` on; motors count from 1.

    fps: the frames per second that its file names; said: what its user should know; counted: says
    which motors the columns are that count in their order
    """

    start_frame: int
    names: dict[int, str]
    positions: dict[int, list[int]]
    fps: float | None = None
    said: tuple[str, ...] = field(default=(), compare=False)
    counted: str = field(default="", compare=False)

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


def read_move(path: str | os.PathLike[str] = CAMERA_MOVE, axes: "Axes | None" = None) -> Move:
    """Read a move. Raises MoveFileError, with the line, if the file is missing or wrong.

    axes: whose names head its columns (headings.py). Variants that spreadsheets write are accepted:
    see frames_of().
    """
    return move_of(read_text(path), path, axes)


def move_of(read: Text, path: str | os.PathLike[str], axes: "Axes | None" = None) -> Move:
    """Return the move in a file's text, as `read_move` does. path: for errors."""
    from ..axes.rig_axes import Axes
    from .headings import columns_of

    table, (frames, *steps) = frames_of(read, path, "<motor 1>,<motor 2>…")
    columns = columns_of(table.rows[0][1:], axes or Axes(), str(path))
    positions = dict(sorted(zip(columns.motors, steps, strict=True)))
    return Move(frames[0], columns.names, positions, table.fps, read.said, columns.counted)


def frames_of(
    read: Text, path: str | os.PathLike[str], columns: str
) -> tuple[Table, list[list[int]]]:
    """Return a table with a line for each frame, and the whole numbers of its columns, frames
    first. Raises MoveFileError, with the line.

    path, columns: the file, and what follows the frames in its header, for error texts.

    Variants that spreadsheets write are accepted: semicolons, tabs or blanks between the columns;
    12.0 or 12,0 for 12; empty lines at the end; empty columns after the last; FRAME for frame;
    comments after # or //.
    """
    table = with_header(read.text, str(path))
    header = table.rows[0] if table.rows else []
    if len(header) < 2 or header[0].lower() != "frame":
        where = f"{path}, line {table.lines[0]}" if table.rows else f"{path} is empty"
        raise MoveFileError(
            f"{where}: expected the header frame,{columns}, found {shown(header)}"
            + _way_out(read.text)
        )
    for i, row in enumerate(table.rows[1:], 1):
        if len(row) != len(header):
            raise MoveFileError(
                f"{table.where(i)}: expected {len(header)} whole numbers, found {shown(row)}"
            )
    if len(table.rows) < 2:
        raise MoveFileError(f"{path}: expected a line for each frame, found none")
    values = [list(column) for column in zip(*_whole(table), strict=True)]
    for i, (before, frame) in enumerate(zip(values[0], values[0][1:], strict=False), 2):
        if frame != before + 1:
            raise MoveFileError(f"{table.where(i)}: expected frame {before + 1}, found {frame}")
    return table, values


def _way_out(text: str) -> str:
    """Return what to do with the file of another program."""
    from .move_formats import FORMATS

    found = next((each for each in FORMATS.values() if each.recognises(text)), None)
    return f": framestep import reads {found.NAME}" if found else ""


def _whole(table: Table) -> list[list[int]]:
    """Return the whole numbers below a header. Raises MoveFileError for other cells."""
    try:
        rows = [list(map(int, row)) for row in table.rows[1:]]
    except ValueError:
        decimal = table.decimal or _sign(table)
        rows = [
            [
                _integer(cell, decimal, name, table.where(i))
                for cell, name in zip(row, table.rows[0], strict=True)
            ]
            for i, row in enumerate(table.rows[1:], 1)
        ]
    for i, row in enumerate(rows, 1):
        if not (min(row) >= -(2**31) and max(row) < 2**31) or any("_" in c for c in table.rows[i]):
            for cell, value, name in zip(table.rows[i], row, table.rows[0], strict=True):
                if "_" in cell:
                    raise _no_whole(cell, name, table.where(i))
                if not -(2**31) <= value < 2**31:
                    raise MoveFileError(
                        f"{table.where(i)}: positions have to fit 32 bits signed, "
                        f"found {value} for {name}"
                    )
    return rows


def _sign(table: Table) -> str:
    """Return the decimal sign of whole numbers such as 12.0. Raises MoveFileError if 1.000 may be
    1 or 1000."""
    cells = [
        Cell(cell, f"{table.where(i)}, column {name}")
        for i, row in enumerate(table.rows[1:], 1)
        for cell, name in zip(row, table.rows[0], strict=False)
    ]
    found = decimal_of(cells, table.path, _WAY_OUT)
    if found == POINT and not any(_TENTHS.fullmatch(cell.text) for cell in cells):
        for cell in cells:
            if _THOUSANDS.fullmatch(cell.text):
                one, other = cell.text.partition(".")[0], cell.text.replace(".", "")
                raise ambiguous(cell, f"{one} with decimals", other, _WAY_OUT)
    return found


def _integer(cell: str, decimal: str, name: str, where: str) -> int:
    try:
        return int(cell)
    except ValueError:
        pass
    try:
        value = number(cell, where, decimal)
    except MoveFileError:
        value = 0.5
    if value != int(value) or "e" in cell.lower():
        raise _no_whole(cell, name, where)
    return int(value)


def _no_whole(cell: str, name: str, where: str) -> MoveFileError:
    return MoveFileError(f"{where}: expected a whole number for {name}, found {shown([cell])}")


def write_move(path: str | os.PathLike[str], move: Move) -> None:
    """Write a move for `read_move`. Raises MoveFileError.

    A column that is not at its motor's place is headed by the motor, which holds without axes.toml.
    """
    from .headings import heading

    out = io.StringIO()
    if move.fps:
        out.write(f"# fps: {move.fps:.10g}\n")
    writer = csv.writer(out, lineterminator="\n")
    headings = [
        heading(motor, place, move.names[motor]) for place, motor in enumerate(move.positions, 1)
    ]
    writer.writerow(["frame", *headings])
    frames = range(move.start_frame, move.end_frame + 1)
    writer.writerows(zip(frames, *move.positions.values(), strict=True))
    write_text(path, out.getvalue())
