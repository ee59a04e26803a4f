"""Kuper's ASCII file: a line `Axes = Pan, Tilt`, then a line of positions per frame; CR and LF end
a line."""

import re

from ..move_file import MoveFileError, shown
from . import raw
from .recording import Channel, Recording, Table

NAME = "kuper"
MEANING = "Kuper ASCII: a line Axes = …, then a line of numbers per frame"
ENDINGS = (".kup", ".kuper", ".asc")

_HEADER = re.compile(r"\s*axes\s*=(.*)", re.IGNORECASE)


def recognises(text: str) -> bool:
    """Return whether a file's text looks like this format."""
    return bool(_HEADER.match(text))


def read(text: str, path: str) -> Recording:
    """Read the file's axes. Raises MoveFileError, with line and column."""
    header = _HEADER.match(text)
    names = [name.strip() for name in header[1].split(",")] if header else []
    if not header or not all(names):
        raise MoveFileError(
            f"{path}: expected a first line like Axes = Pan, Tilt, "
            f"found {shown(text.strip().splitlines()[:1])}"
        )
    before = text[: header.end()].count("\n") + 1
    found = raw.curves(text[header.end() :], path, len(names), before)
    return Recording([Channel(name, curve) for name, curve in zip(names, found, strict=True)])


def write(table: Table, fps: float | None) -> str:
    """Return the file's text. Raises MoveFileError for a comma in an axis's name."""
    for column in table.columns:
        if "," in column.name:
            raise MoveFileError(f"Kuper separates the names of axes by commas: {column.name!r}")
    names = ", ".join(column.name for column in table.columns)
    return f"Axes = {names}\r\n" + raw.lines(table, "\r\n")
