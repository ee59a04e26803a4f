"""Tables as text: lines of cells, with comments and rates, for every format that has columns."""

import csv
import re
from dataclasses import dataclass, field
from itertools import chain

from ..text.numerals import COMMA, GREATEST, POINT, Cell, ambiguous, decimal_of, number
from ..text.text_file import MoveFileError, shown

SLOWEST, FASTEST = 0.001, 1000.0  # frames per second
_COMMENT = re.compile(r"\s*(?://|#)(.*)")
_SEPARATOR_LINE = re.compile(r'"?sep=(.)"?', re.IGNORECASE)  # Excel's own, before the header
_RATE_NUMBER = r"[+-]?\.?\d(?:[\d.,/+-]|e(?=[\d+-]))*"
_RATE = re.compile(
    rf"(?:fps|frame ?rate|frames per second)[^\w.+-]{{0,3}}(?P<after>{_RATE_NUMBER})(?!\w)"
    rf"|(?<![\w.,/+-])(?P<before>{_RATE_NUMBER}) ?(?:fps|frames/s|frames per second)\b",
    re.IGNORECASE,
)
# A comment that begins like "fps: 25" and so has to name a rate
_NAMES_RATE = re.compile(
    r"(?:fps|frame ?rate|frames per second)\s*[:=]\s*(?P<rate>.*)", re.IGNORECASE
)
_COMMA_BETWEEN_DIGITS = re.compile(r"\d,\d")
_GROUPED = re.compile(r"[+-]?[1-9]\d{0,2}(?:,\d{3})+\.\d*")
_BETWEEN = re.compile(r"[,;]?\s+|;")  # columns, if a comma between two digits is decimal
_ALL_BETWEEN = re.compile(r"\s*[,;]\s*|\s+")


@dataclass
class Table:
    """Rows of cells, each with the number of its line. `comments`: the text after # or //,
    likewise.

    decimal: the sign that the caller names; None: the file's numbers decide.
    """

    path: str
    rows: list[list[str]]
    lines: list[int]
    comments: list[tuple[int, str]] = field(default_factory=list)
    decimal: str | None = None

    def where(self, row: int, column: str = "") -> str:
        """Return path, line and column for an error."""
        return f"{self.path}, line {self.lines[row]}" + (f", column {column}" if column else "")

    @property
    def fps(self) -> float | None:
        """The frames per second that comments name. Raises MoveFileError, with the line, if none
        can be so, or if they contradict each other."""
        found: list[str] = []
        rates: list[float] = []
        for line, comment in self.comments:
            named = rates_in(comment)
            if not named and (wrong := _NAMES_RATE.match(comment)):
                named = [wrong["rate"]]
            for text in named:
                value = rate(text.replace(COMMA, POINT))
                if value is None:
                    raise MoveFileError(
                        f"{self.path}, line {line}: expected frames per second from {SLOWEST:g} to "
                        f"{FASTEST:g}, such as 25 or 24000/1001, found {shown([text])}"
                    )
                found.append(text)
                rates.append(value)
                if value != rates[0]:
                    raise MoveFileError(
                        f"{self.path}, line {line}: comments say {found[0]} and {text} frames per "
                        "second: leave one"
                    )
        return rates[0] if rates else None

    def require(self, width: int, first: int = 0, what: str = "columns") -> None:
        """Raise MoveFileError unless all rows from `first` on have as many cells."""
        for i in range(first, len(self.rows)):
            if len(self.rows[i]) != width:
                raise MoveFileError(
                    f"{self.where(i)}: expected {width} {what}, found {len(self.rows[i])}"
                )

    def columns(self, names: list[str], first: int = 0) -> list[list[float]]:
        """Return the numbers of the rows from `first` on, by column. Raises MoveFileError."""
        self.require(len(names), first)
        texts = list(zip(*self.rows[first:], strict=True))
        if self.decimal != COMMA and not any("," in text or "_" in text for text in chain(*texts)):
            try:
                return [_plain(column) for column in texts]
            except ValueError:
                pass
        decimal = self.decimal or decimal_of(
            (
                Cell(text, self.where(i, name))
                for i in range(first, len(self.rows))
                for text, name in zip(self.rows[i], names, strict=True)
            ),
            self.path,
        )
        return [
            [number(text, self.where(first + i, name), decimal) for i, text in enumerate(column)]
            for column, name in zip(texts, names, strict=True)
        ]


def _plain(texts: tuple[str, ...]) -> list[float]:
    """Return numbers as Python writes them. Raises ValueError for others."""
    values = list(map(float, texts))
    if not all(abs(value) <= GREATEST for value in values):
        raise ValueError
    return values


def rates_in(comment: str) -> list[str]:
    """Return the numbers of frames per second that a text names, such as "fps: 25" or "24000/1001
    fps"."""
    return [
        (found["after"] or found["before"]).rstrip(".,/+-") for found in _RATE.finditer(comment)
    ]


def rate(text: str) -> float | None:
    """Return a rate such as 25, 23.976 or 24000/1001, or None if it is none that a run can
    have."""
    above, slash, below = text.partition("/")
    try:
        found = float(above) / (float(below) if slash else 1)
    except (ValueError, ZeroDivisionError):
        return None
    return found if SLOWEST <= found <= FASTEST else None


def contents(text: str) -> tuple[list[tuple[int, str]], list[tuple[int, str]]]:
    """Return the lines that are not empty, and the comments, each with its number."""
    lines, comments = [], []
    for at, line in enumerate(text.split("\n"), 1):
        found = _COMMENT.match(line)
        if found:
            comments.append((at, found[1].strip()))
        elif line.strip():
            lines.append((at, line))
    return lines, comments


def separator_of(line: str) -> str:
    """Return the separator of a header's columns: the most frequent of tab, ; and , or a blank if
    it has none of them."""
    most = max("\t;,", key=line.count)
    return most if most in line else " "


def with_header(text: str, path: str, decimal: str | None = None) -> Table:
    """Return a table whose first row is its header; a header may stand behind a #.

    Empty lines at the end and empty columns after the header's are left out. Raises MoveFileError,
    with the line, for wrong quotes.
    """
    lines = text.split("\n")
    separator = ""
    comments, kept, numbers = [], [], []
    for i, line in enumerate(lines, 1):
        comment = _COMMENT.match(line)
        if comment:
            comments.append((i, comment[1].strip()))
        elif not kept and (found := _SEPARATOR_LINE.fullmatch(line.strip())):
            separator = found[1]
        elif kept or line.strip():
            kept.append(line)
            numbers.append(i)
    if not kept:
        return Table(path, [], [], comments, decimal)
    reader = csv.reader(
        kept, delimiter=separator or separator_of(kept[0]), skipinitialspace=True, strict=True
    )
    rows, at = [], []
    before = 0
    try:
        for row in reader:
            rows.append([cell.strip() for cell in row])
            at.append(numbers[before])
            before = reader.line_num
    except csv.Error as error:
        at_end = "unexpected end" in str(error)
        said = "a quote is not closed" if at_end else str(error)
        raise MoveFileError(
            f"{path}, line {numbers[before if at_end else reader.line_num - 1]}: {said}"
        ) from None
    while rows and not any(rows[-1]):
        rows.pop()
    while rows and rows[0] and not rows[0][-1]:
        rows[0].pop()
    for row in rows[1:]:
        while len(row) > len(rows[0]) and not row[-1]:
            row.pop()
    return Table(path, rows, at[: len(rows)], comments, decimal)


def without_header(
    text: str, path: str, width: int = 0, after: int = 0, decimal: str | None = None
) -> Table:
    """Return a table of numbers between blanks, commas or semicolons. Raises MoveFileError if a
    comma may be a decimal sign as well as a separator.

    width: number of columns, 0 if it is not known; after: number of the line before the text.
    """
    lines, comments = contents(text)
    numbers = [at + after for at, _ in lines]
    comments = [(at + after, comment) for at, comment in comments]
    found = [line.strip().rstrip(",;") for _, line in lines]
    if decimal:
        separates = decimal == POINT
    else:
        separates = _commas_separate(found, numbers, path, width)
    between = _ALL_BETWEEN if separates else _BETWEEN
    return Table(path, [between.split(line) for line in found], numbers, comments, decimal)


def _commas_separate(lines: list[str], numbers: list[int], path: str, width: int) -> bool:
    """Return whether commas between digits separate columns, rather than being decimal signs."""
    if not any(_COMMA_BETWEEN_DIGITS.search(line) for line in lines):
        return True
    whole = [_BETWEEN.split(line) for line in lines]
    cells = [cell for row in whole for cell in row if "," in cell]
    grouped = all(_GROUPED.fullmatch(cell) for cell in cells)
    if not grouped and any("." in cell or cell.count(",") > 1 for cell in cells):
        return True
    widths = {len(row) for row in whole}
    parts = {len(_ALL_BETWEEN.split(line)) for line in lines}
    if width and (widths == {width}) != (parts == {width}):
        return parts == {width}
    if not grouped and (widths != {1} or len(parts) != 1):
        return False
    cell = next(cell for row in whole for cell in row if "," in cell)
    line = next(n for n, row in zip(numbers, whole, strict=True) if cell in row)
    one = cell.replace(",", "" if grouped else ".")
    raise ambiguous(
        Cell(cell, f"{path}, line {line}"), one, f"the numbers {cell.replace(',', ' and ')}"
    )
