"""Kuper's ASCII file: a line `Axes = Pan, Tilt`, then a line of positions per frame; CR and LF end
a line."""

import re

from ...text.text_file import MoveFileError, shown
from ..table import Table as Text
from ..table import contents, without_header
from . import raw
from .camera import OWN
from .curves import Samples
from .recording import Channel, Recording, Table

NAME = "kuper"
MEANING = "Kuper ASCII: a line Axes = …, then a line of numbers per frame"
ENDINGS = (".kup", ".kuper", ".asc")
CAMERA = OWN

_HEADER = re.compile(r"\s*axes\s*=(.*)", re.IGNORECASE)
_BETWEEN_NAMES = re.compile(r"\s*[,;\t]\s*")


def recognises(text: str) -> bool:
    """Return whether a file's text looks like this format."""
    lines, _ = contents(text)
    return bool(lines and _HEADER.match(lines[0][1]))


def read(text: str, path: str, decimal: str | None = None) -> Recording:
    """Read the file's axes. Raises MoveFileError, with line and column."""
    lines, comments = contents(text)
    header = _HEADER.match(lines[0][1]) if lines else None
    names = _BETWEEN_NAMES.split(header[1].strip()) if header else []
    if not header or not all(names):
        raise MoveFileError(
            f"{path}: expected a first line like Axes = Pan, Tilt, "
            f"found {shown([line for _, line in lines[:1]])}"
        )
    below = "\n".join(text.split("\n")[lines[0][0] :])
    table = without_header(below, path, len(names), lines[0][0], decimal)
    columns = raw.columns_of(table, len(names))
    places = raw.numbered(len(columns[0]))
    return Recording(
        [
            Channel(name, Samples(places, column), "", i)
            for i, (name, column) in enumerate(zip(names, columns, strict=True), 1)
        ],
        step=1.0,
        fps=Text(path, [], [], comments).fps,
    )


def write(table: Table, fps: float | None) -> str:
    """Return the file's text. Raises MoveFileError for a comma in an axis's name."""
    for column in table.columns:
        if "," in column.name:
            raise MoveFileError(f"Kuper separates the names of axes by commas: {column.name!r}")
    names = ", ".join(column.name for column in table.columns)
    return f"Axes = {names}\r\n" + raw.lines(table, "\r\n")
