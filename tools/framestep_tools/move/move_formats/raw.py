"""Columns of numbers without a header: a line per frame, a column per axis, blanks between them.

Dragonframe imports it as a raw move, Maya as channel move data (.mov).
"""

from ..move_file import MoveFileError
from .curves import Samples
from .recording import FIRST_FRAME, Channel, Recording, Table, number

NAME = "raw"
MEANING = "a line of numbers per frame, without a header: a raw move, Maya's .mov"
ENDINGS = (".txt", ".mov", ".raw")


def recognises(text: str) -> bool:
    """Return whether a file's text looks like this format."""
    try:
        return bool(_columns(text.strip().split("\n", 1)[0], "", 1))
    except MoveFileError:
        return False


def read(text: str, path: str) -> Recording:
    """Read the file's axes, without names. Raises MoveFileError, with line and column."""
    return Recording([Channel("", curve) for curve in curves(text, path)])


def curves(text: str, path: str, width: int = 0, first_line: int = 1) -> list[Samples]:
    """Return a curve per column from frame 1 on. width: required number of columns; 0: as in the
    first line."""
    columns = _columns(text, path, first_line, width)
    if not columns:
        raise MoveFileError(f"{path}: expected a line for each frame, found none")
    frames = [float(FIRST_FRAME + i) for i in range(len(columns[0]))]
    return [Samples(frames, column) for column in columns]


def _columns(text: str, path: str, first_line: int, width: int = 0) -> list[list[float]]:
    columns: list[list[float]] = []
    for line, content in enumerate(text.splitlines(), first_line):
        cells = content.replace(",", " ").split()
        if not cells:
            continue
        columns = columns or [[] for _ in range(width or len(cells))]
        if len(cells) != len(columns):
            raise MoveFileError(
                f"{path}, line {line}: expected {len(columns)} columns, found {len(cells)}"
            )
        for i, cell in enumerate(cells):
            columns[i].append(number(cell, f"{path}, line {line}, column {i + 1}"))
    return columns


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
