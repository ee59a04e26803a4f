"""CSV: a header, then a line per frame or sample. The first column is the frame or the time.

Blender and Maya have no CSV format for animation; scripts for them and spreadsheets write this one.
"""

import csv
import io
import re
from dataclasses import replace
from itertools import pairwise

from ...axes.units import factor, unit_of, without_unit
from ...text.text_file import MoveFileError, shown
from ..frame_times import last_decimal
from ..table import Table as Text
from ..table import contents, rates_in, separator_of, with_header
from .camera import OWN
from .curves import Samples
from .recording import Channel, Column, Recording, Table, check_frames

NAME = "csv"
MEANING = "a header, then a line per frame; the first column is frame or seconds"
ENDINGS = (".csv", ".tsv")
CAMERA = OWN

# Headers of the first column, in lower case, and how many of its units a second has; None: frames
_CLOCKS: dict[str, float | None] = {
    "frame": None, "frames": None, "frame number": None, "frame no": None, "frame no.": None,
    "frame #": None, "frame_number": None,
    "seconds": 1, "second": 1, "sec": 1, "s": 1, "time": 1, "time (s)": 1, "time [s]": 1,
    "time (sec)": 1, "time_s": 1, "milliseconds": 1000, "ms": 1000, "time (ms)": 1000,
    "time [ms]": 1000, "time_ms": 1000,
}  # fmt: skip
_BEHIND_SIGN = re.compile(r"^\s*(?:#|//)\s*")


def recognises(text: str) -> bool:
    """Return whether a file's text looks like this format."""
    return _header_line(text) is not None


def is_in_seconds(text: str) -> bool:
    """Return whether a text that looks like this format has times, not frames."""
    at = _header_line(text)
    clock = _clock_of(_BEHIND_SIGN.sub("", text.split("\n")[at])) if at is not None else "frame"
    return _CLOCKS[clock] is not None


def _header_line(text: str) -> int | None:
    """Return the index of the line that is the header, also behind a # or //, or None."""
    lines, _ = contents(text)
    first = lines[0][0] if lines else 1
    for i, line in reversed(list(enumerate(text.split("\n")[:first]))):
        bare = _BEHIND_SIGN.sub("", line)
        if _clock_of(bare) in _CLOCKS and (bare == line or not rates_in(bare)):
            return i
        if i + 1 == first and line.strip().strip('"').lower().startswith("sep="):
            below = contents("\n".join(text.split("\n")[first:]))[0]
            return first + below[0][0] - 1 if below and _clock_of(below[0][1]) in _CLOCKS else None
    return None


def _clock_of(line: str) -> str:
    return line.split(separator_of(line))[0].strip().strip('"').lower()


def read(text: str, path: str, decimal: str | None = None) -> Recording:
    """Read the file's axes. Raises MoveFileError, with line and column, also for a missing
    frame."""
    at = _header_line(text)
    if at is not None:
        lines = text.split("\n")
        lines[at] = _BEHIND_SIGN.sub("", lines[at])
        text = "\n".join(lines)
    table = with_header(text, path, decimal)
    header = table.rows[0] if table.rows else []
    if len(header) < 2 or header[0].lower() not in _CLOCKS:
        raise MoveFileError(
            f"{path}, line {table.lines[0] if table.rows else 1}: "
            f"expected a header that begins with frame or seconds, found {shown(header)}"
        )
    clock = _CLOCKS[header[0].lower()]
    units = units_row(table)
    first = 2 if units else 1
    if len(table.rows) <= first:
        raise MoveFileError(f"{path}: expected a line for each frame, found none")
    places, *columns = table.columns(header, first)
    step = last_decimal(row[0] for row in table.rows[first:])
    _check_places(table, first, places, clock)
    if clock:
        places = [place / clock for place in places]
        step /= clock
    channels = [
        Channel(name, Samples(places, column), units[i - 1] if units else without_unit(name)[1], i)
        for i, (name, column) in enumerate(zip(header[1:], columns, strict=True), 2)
    ]
    return Recording(channels, clock is not None, step, table.fps)


def units_row(table: Text) -> list[str]:
    """Return the units in the second row of a table, one a column; empty if they are not there."""
    row = table.rows[1] if len(table.rows) > 1 else []
    found = [unit_of(cell) for cell in row]
    named = [bool(cell.strip(" -")) == bool(unit) for cell, unit in zip(row, found, strict=True)]
    return found if len(row) == len(table.rows[0]) and any(found[1:]) and all(named[1:]) else []


def _check_places(table: Text, first: int, places: list[float], clock: float | None) -> None:
    name = table.rows[0][0]
    if clock is None:
        check_frames(table, first, places, name)
        return
    for i, (before, place) in enumerate(pairwise(places), 1):
        if place <= before:
            raise MoveFileError(
                f"{table.where(first + i, name)}: expected a time after {before:g}, found {place:g}"
            )


def write(table: Table, fps: float | None) -> str:
    """Return the file's text: with frames, or with seconds from 0 on if fps is given. Headings name
    the unit, so that nothing takes the numbers for steps."""
    columns = [_with_unit(column) for column in table.columns]
    first: list[str] = (
        [f"{i / fps:.9f}" for i in range(len(table.frames))]
        if fps
        else list(map(str, table.frames))
    )
    out = io.StringIO()
    if table.fps and not fps:
        out.write(f"# fps: {table.fps:.10g}\n")
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(["seconds" if fps else "frame", *(column.name for column in columns)])
    writer.writerows(zip(first, *(column.texts() for column in columns), strict=True))
    return out.getvalue()


def _with_unit(column: Column) -> Column:
    """Return a column in the unit that its heading names, else with its unit in the heading."""
    unit = without_unit(column.name)[1]
    if unit and factor(column.unit, unit):
        return column.converted(unit)
    if unit or not unit_of(column.unit):
        return column
    return replace(column, name=f"{column.name} ({column.unit})")
