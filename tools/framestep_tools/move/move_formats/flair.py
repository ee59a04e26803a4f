"""Flair's ASCII files (MRMC): Cartesians of a camera, or the positions of axes.

    DATA_TYPE  CARTS_RAW  MRMC_COORDS  IN_CENTIMETRES
    POINTS 48  SPEED 25
    FRAME   XV   YV   ZV   XT   YT   ZT   ROLL
       1  ...

    DATA_TYPE           CARTS_RAW, or another word for axes; the unit of lengths
    POINTS n            number of lines with positions; what follows them is left out
    SPEED n             frames per second
    FRAME               the frame, counting by one
    XV YV ZV            the camera's position
    XT YT ZT            the point that it looks at
    ROLL                in degrees
    any other heading   an axis, in a unit that the file does not name

Source: the Blender add-on Moco, by Nicolas Lemery Nantel, for CARTS_RAW. Files of axes follow by
analogy; none was at hand.
"""

import re
from itertools import pairwise

from ...text.text_file import MoveFileError, shown
from ..table import Table as Text
from ..table import contents, rate
from .camera import Camera
from .curves import Samples
from .recording import Channel, Column, Recording, Table, check_frames, frame_rows, slots

NAME = "flair"
MEANING = "Flair (MRMC): DATA_TYPE, POINTS and SPEED, then headings and a line per frame"
ENDINGS = (".fla", ".cart")

# MRMC's axes: x forward, y to the left, z up; positive roll is counterclockwise
CAMERA = Camera(
    ("XV", "YV", "ZV"),
    (("ROLL", "z"),),
    ("XT", "YT", "ZT"),
    right="-y",
    up="z",
    back="-x",
    fixed=True,
)
NAMES = ("XV", "YV", "ZV", "XT", "YT", "ZT", "ROLL")
_LENGTHS = NAMES[:6]
_UNITS = {
    "IN_METRES": "m", "IN_METERS": "m", "IN_CENTIMETRES": "cm", "IN_CENTIMETERS": "cm",
    "IN_MILLIMETRES": "mm", "IN_MILLIMETERS": "mm", "IN_INCHES": "in", "IN_FEET": "ft",
}  # fmt: skip
_BETWEEN = re.compile(r"[\s,]+")


def recognises(text: str) -> bool:
    """Return whether a file's text looks like this format."""
    lines, _ = contents(text)
    return bool(lines) and lines[0][1].split()[0].upper() == "DATA_TYPE"


def read(text: str, path: str, decimal: str | None = None) -> Recording:
    """Read the file's axes. Raises MoveFileError, with the line."""
    lines, comments = contents(text)
    if len(lines) < 3 or not recognises(text):
        raise MoveFileError(
            f"{path}: expected the lines DATA_TYPE, POINTS and SPEED, and headings, found "
            f"{shown([line for _, line in lines[:1]])}"
        )
    kind = lines[0][1].upper().split()[1:]
    count, fps = _about(lines[1][1].upper().split(), f"{path}, line {lines[1][0]}")
    names = lines[2][1].split()
    if names[0].upper() != "FRAME" or len(names) < 2:
        raise MoveFileError(
            f"{path}, line {lines[2][0]}: expected headings that begin with FRAME, "
            f"found {shown([lines[2][1].strip()])}"
        )
    rows = lines[3:]
    if count is not None and len(rows) < count:
        raise MoveFileError(
            f"{path}: expected {count} lines with positions, as POINTS says, found {len(rows)}"
        )
    rows = rows[:count]
    if not rows:
        raise MoveFileError(f"{path}: expected a line for each frame, found none")
    cells = [_BETWEEN.split(line.strip().rstrip(",")) for _, line in rows]
    table = Text(path, cells, [at for at, _ in rows], comments, decimal)
    frames, *columns = table.columns(names)
    check_frames(table, 0, frames, names[0])
    length = next((_UNITS[word] for word in kind if word in _UNITS), "")
    units = {**dict.fromkeys(_LENGTHS, length), "ROLL": "deg"} if "CARTS_RAW" in kind else {}
    return Recording(
        [
            Channel(name, Samples(frames, column), units.get(name.upper(), ""), i)
            for i, (name, column) in enumerate(zip(names[1:], columns, strict=True), 2)
        ],
        step=1.0,
        fps=fps or table.fps,
        camera=CAMERA if "CARTS_RAW" in kind else None,
    )


def _about(words: list[str], where: str) -> tuple[int | None, float | None]:
    """Return the number of points and the rate that a line such as POINTS 48 SPEED 25 names."""
    found = dict(pairwise(words))
    count = found.get("POINTS")
    if count is not None and not count.isdecimal():
        raise MoveFileError(f"{where}: POINTS: expected a whole number, found {shown([count])}")
    speed = found.get("SPEED")
    fps = rate(speed) if speed else None
    if speed and fps is None:
        raise MoveFileError(f"{where}: SPEED: expected frames per second, found {shown([speed])}")
    return int(count) if count else None, fps


def write(table: Table, fps: float | None) -> str:
    """Return the file's text: Cartesians if all axes have their names, else axes.

    Raises MoveFileError for an axis's name with a blank or a comma.
    """
    names: tuple[str, ...] = NAMES
    if all(column.name.upper() in NAMES for column in table.columns):
        lengths = dict.fromkeys(_LENGTHS, "cm")
        columns = slots(table, NAMES, {**lengths, "ROLL": "deg"}, "flair")
        kind = "CARTS_RAW  MRMC_COORDS  IN_CENTIMETRES"
        shown_columns: list[Column | None] = [columns.get(name) for name in names]
    else:
        for column in table.columns:
            if _BETWEEN.search(column.name):
                raise MoveFileError(
                    f"Flair's headings have no blanks and commas; found {column.name!r}: "
                    'name another one by "in_file"'
                )
        names, kind = tuple(column.name for column in table.columns), "AXES_RAW"
        shown_columns = list(table.columns)
    speed = f"  SPEED {fps or table.fps:.10g}" if fps or table.fps else ""
    head = f"DATA_TYPE  {kind}\nPOINTS {len(table.frames)}{speed}\nFRAME  {'  '.join(names)}\n"
    return head + frame_rows(table.frames, shown_columns)
