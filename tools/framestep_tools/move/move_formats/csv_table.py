"""CSV: a header, then a line per frame or sample. The first column is the frame or the time.

Blender and Maya have no CSV format for animation; scripts for them and spreadsheets write this one.
"""

import csv
import io

from ..move_file import MoveFileError, rows_of, separator_of, shown
from .curves import Samples
from .recording import Channel, Recording, Table, number

NAME = "csv"
MEANING = "a header, then a line per frame; the first column is frame or seconds"
ENDINGS = (".csv", ".tsv")

# Headers of the first column, in lower case, and how many of its units a second has; None: frames
_CLOCKS: dict[str, float | None] = {
    "frame": None, "frames": None, "frame number": None,
    "seconds": 1, "second": 1, "sec": 1, "s": 1, "time": 1, "time (s)": 1, "time [s]": 1,
    "milliseconds": 1000, "ms": 1000, "time (ms)": 1000, "time [ms]": 1000, "time_ms": 1000,
}  # fmt: skip


def recognises(text: str) -> bool:
    """Return whether a file's text looks like this format."""
    first = text.split("\n", 1)[0]
    return first.split(separator_of(text))[0].strip().strip('"').lower() in _CLOCKS


def read(text: str, path: str) -> Recording:
    """Read the file's axes. Raises MoveFileError, with line and column, also for a missing
    frame."""
    rows = rows_of(text, path)
    header = rows[0] if rows else []
    if len(header) < 2 or header[0].lower() not in _CLOCKS:
        raise MoveFileError(
            f"{path}, line 1: expected a header that begins with frame or seconds, "
            f"found {shown(header)}"
        )
    clock = _CLOCKS[header[0].lower()]
    decimal_comma = separator_of(text) != ","  # as in spreadsheets of many countries
    places: list[float] = []
    columns: list[list[float]] = [[] for _ in header[1:]]
    for line, row in enumerate(rows[1:], 2):
        if len(row) != len(header):
            raise MoveFileError(
                f"{path}, line {line}: expected {len(header)} columns, found {len(row)}"
            )
        cells = [
            number(
                cell.replace(",", ".") if decimal_comma else cell,
                f"{path}, line {line}, column {name}",
            )
            for cell, name in zip(row, header, strict=True)
        ]
        _check_place(cells[0], places, clock, f"{path}, line {line}, column {header[0]}")
        places.append(cells[0])
        for column, cell in zip(columns, cells[1:], strict=True):
            column.append(cell)
    if not places:
        raise MoveFileError(f"{path}: expected a line for each frame, found none")
    if clock:
        places = [place / clock for place in places]
    channels = [
        Channel(name, Samples(places, column))
        for name, column in zip(header[1:], columns, strict=True)
    ]
    return Recording(channels, seconds=clock is not None)


def _check_place(place: float, before: list[float], clock: float | None, where: str) -> None:
    if clock is None:
        if place != int(place):
            raise MoveFileError(f"{where}: expected a whole number, found {place:g}")
        if before and place != before[-1] + 1:
            raise MoveFileError(f"{where}: expected frame {before[-1] + 1:.0f}, found {place:.0f}")
    elif before and place <= before[-1]:
        raise MoveFileError(f"{where}: expected a time after {before[-1]:g}, found {place:g}")


def write(table: Table, fps: float | None) -> str:
    """Return the file's text: with frames, or with seconds from 0 on if fps is given."""
    first: list[str] = (
        [f"{i / fps:.9f}" for i in range(len(table.frames))]
        if fps
        else list(map(str, table.frames))
    )
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(["seconds" if fps else "frame", *(column.name for column in table.columns)])
    writer.writerows(zip(first, *(column.texts() for column in table.columns), strict=True))
    return out.getvalue()
