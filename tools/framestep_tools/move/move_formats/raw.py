"""Columns of numbers without a header: a line per frame, a column per axis, blanks between them.

Dragonframe imports it as a raw move, Maya as channel move data (.mov).
"""

import re
from itertools import pairwise

from ...text.text_file import MoveFileError
from ..table import Table as Text
from ..table import without_header
from .camera import OWN
from .curves import Samples
from .recording import FIRST_FRAME, Channel, Recording, Table

NAME = "raw"
MEANING = "a line of numbers per frame, without a header: a raw move, Maya's .mov"
ENDINGS = (".txt", ".mov", ".raw")
CAMERA = OWN

_NUMBER = re.compile(r"\s*[+-]?(?:\d|[.,]\d)[\d.,eE+\-\s;]*$")
_WHOLE = re.compile(r"[+-]?\d{1,10}")


def recognises(text: str) -> bool:
    """Return whether a file's text looks like this format."""
    first = next((line for line in text.split("\n") if _NUMBER.match(line)), "")
    before = text[: text.index(first)] if first else text
    return bool(first) and all(
        line.strip() == "" or line.lstrip().startswith(("#", "//")) for line in before.split("\n")
    )


def read(text: str, path: str, decimal: str | None = None) -> Recording:
    """Read the file's axes, without names. Raises MoveFileError, with line and column.

    A first column that counts by ones is the column of frames.
    """
    table = without_header(text, path, decimal=decimal)
    columns = columns_of(table)
    frames = frames_in(table)
    said: tuple[str, ...] = ()
    if frames:
        said = (
            f"{path}: its first column counts {frames[0]:g}, {frames[1]:g} … {frames[-1]:g}, "
            "so it is the frame",
        )
    places = frames or numbered(len(columns[0]))
    channels = [
        Channel("", Samples(places, column), "", i, counts=bool(frames) and i == 1)
        for i, column in enumerate(columns, 1)
    ]
    return Recording(channels, step=1.0, fps=table.fps, said=said)


def columns_of(table: Text, width: int = 0) -> list[list[float]]:
    """Return the numbers of a table without a header. width: as for Table.require, 0: as in the
    first line. Raises MoveFileError."""
    if not table.rows:
        raise MoveFileError(f"{table.path}: expected a line for each frame, found none")
    names = [str(i) for i in range(1, (width or len(table.rows[0])) + 1)]
    return table.columns(names)


def frames_in(table: Text) -> list[float]:
    """Return the first column if it counts by ones beside other columns; empty if not."""
    texts = [row[0] for row in table.rows]
    if len(texts) < 2 or len(table.rows[0]) < 2 or not all(map(_WHOLE.fullmatch, texts)):
        return []
    frames = [float(text) for text in texts]
    return frames if all(b == a + 1 for a, b in pairwise(frames)) else []


def numbered(count: int) -> list[float]:
    """Return the frames of a file that does not number them."""
    return [float(FIRST_FRAME + i) for i in range(count)]


def write(table: Table, fps: float | None) -> str:
    """Return the file's text."""
    return lines(table, "\n")


def lines(table: Table, end: str) -> str:
    """Return a line per frame, with columns as wide as their longest number."""
    columns = []
    for column in table.columns:
        texts = column.texts()
        width = max(map(len, texts))
        columns.append([text.rjust(width) for text in texts])
    return "".join("  ".join(row) + end for row in zip(*columns, strict=True))
