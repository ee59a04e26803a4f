"""How a file writes its numbers: with a decimal point or a decimal comma.

Both signs also group thousands, so a single number such as 1,234 may be 1.234 or 1234. All numbers
of a file decide together; if they do not, the file is refused with both readings.
"""

import re
from collections.abc import Iterable
from typing import NamedTuple

from .text_file import MoveFileError, shown

GREATEST = 1e15  # of any number in a file: above it a float cannot count by ones
POINT, COMMA = ".", ","
WORDS = {"point": POINT, "comma": COMMA}  # of --decimal
OPTION = "say which by --decimal point or --decimal comma"

_EXPONENT = r"(?:[eE][+-]?\d+)?"
# thousands by decimal sign
_GROUPED = {POINT: r"[1-9]\d{0,2}(?:,\d{3})+", COMMA: r"[1-9]\d{0,2}(?:\.\d{3})+"}
_BLANKS = re.compile(r"(?<=\d)[ \u00a0\u202f\u2009'’](?=\d{3}(?!\d))")  # between thousands too
_EITHER = re.compile(r"[+-]?[1-9]\d{0,2}[.,]\d{3}")  # a fraction, or one group of thousands
_WITH = {
    POINT: re.compile(rf"[+-]?(?:{_GROUPED[POINT]}|\d*)(?:\.\d*)?{_EXPONENT}"),
    COMMA: re.compile(rf"[+-]?(?:{_GROUPED[COMMA]}|\d*)(?:,\d*)?{_EXPONENT}"),
}
_CUT = re.compile(r"[+-]?[\d.,]+[eE][+-]?")


class Cell(NamedTuple):
    """A number's text, and where it is."""

    text: str
    where: str


def number(text: str, where: str, decimal: str = POINT) -> float:
    """Return a number. Raises MoveFileError, which begins with `where`. decimal: POINT or COMMA."""
    try:
        value = float(text)
        if decimal == COMMA and "." in text:
            raise ValueError
    except ValueError:
        value = _formatted(text, decimal)
    if not abs(value) <= GREATEST or "_" in text:
        cut = "; its exponent is cut off" if _CUT.fullmatch(text) else ""
        comma = " with a decimal comma" if decimal == COMMA else ""
        raise MoveFileError(f"{where}: expected a number{comma}, found {shown([text])}{cut}")
    return value


def _formatted(text: str, decimal: str) -> float:
    """Return a number with a decimal comma, or with groups of thousands; not a number if it is
    none."""
    bare = _BLANKS.sub("", text)
    if not _WITH[decimal].fullmatch(bare):
        return float("nan")
    try:
        return float(bare.replace(COMMA, "") if decimal == POINT else _pointed(bare))
    except ValueError:
        return float("nan")


def _pointed(text: str) -> str:
    return text.replace(POINT, "").replace(COMMA, POINT)


def decimal_of(cells: Iterable[Cell], path: str, way_out: str = OPTION) -> str:
    """Return the decimal sign of a file's numbers. Raises MoveFileError if they contradict each
    other or leave both possible. What is no number has no say. way_out: what to do then."""
    says: dict[str, Cell] = {}
    either: dict[str, Cell] = {}
    for cell in cells:
        text = _BLANKS.sub("", cell.text)
        if COMMA not in text and POINT not in text:
            continue
        if _EITHER.fullmatch(text):
            either.setdefault(COMMA if COMMA in text else POINT, cell)
            continue
        for sign in (POINT, COMMA):
            other = COMMA if sign == POINT else POINT
            if _WITH[sign].fullmatch(text) and not _WITH[other].fullmatch(text):
                says.setdefault(sign, cell)
    if len(says) == 2:
        point, comma = says[POINT], says[COMMA]
        raise MoveFileError(
            f"{point.where}: {shown([point.text])} has a decimal point, "
            f"but {shown([comma.text])} a decimal comma ({_place(comma.where, path)})"
        )
    if says:
        return next(iter(says))
    if COMMA in either:
        cell = either[COMMA]
        raise ambiguous(cell, _pointed(cell.text), cell.text.replace(COMMA, ""), way_out)
    return POINT


def ambiguous(cell: Cell, one: str, other: str, way_out: str = OPTION) -> MoveFileError:
    """Return the error for a number that can be read in two ways."""
    return MoveFileError(f"{cell.where}: {shown([cell.text])} may be {one} or {other}: {way_out}")


def _place(where: str, path: str) -> str:
    return where.removeprefix(path).lstrip(", ")
