"""Biovision's motion capture (.bvh): a hierarchy of joints with channels, then a line per frame.

    HIERARCHY
    ROOT Camera { OFFSET 0 0 0  CHANNELS 6 Xposition ... Zrotation Xrotation Yrotation ... }
    MOTION
    Frames: 48
    Frame Time: 0.041667
    1.5 0 ...

    ROOT, JOINT    a joint; its channels are axes: "Camera.Zrotation"
    ...position    in a unit that the file does not name
    ...rotation    in degrees, about the joint's own axes
    Frames         number of lines
    Frame Time     seconds from frame to frame, rounded; the first is frame 1

Source: "Motion Capture File Formats Explained", M. Meredith and S. Maddock, University of
Sheffield.
"""

import re

from ...axes.units import factor
from ...text.numerals import number
from ...text.text_file import MoveFileError, shown
from ..frame_times import last_decimal
from ..table import FASTEST, SLOWEST, without_header
from .camera import Camera
from .curves import Samples
from .raw import numbered
from .recording import Channel, Recording, Table

NAME = "bvh"
MEANING = "Biovision: joints with channels, then a line per frame"
ENDINGS = (".bvh",)

CAMERA = Camera(
    ("camera.Xposition", "camera.Yposition", "camera.Zposition"),
    (("camera.Zrotation", "z"), ("camera.Xrotation", "x"), ("camera.Yrotation", "y")),
)
_KINDS = tuple(f"{axis}{kind}" for kind in ("position", "rotation") for axis in "XYZ")
_USUAL = (24, 25, 30, 48, 50, 60, 90, 100, 120, 240, 15, 12)
_FILM = (24000 / 1001, 30000 / 1001, 48000 / 1001, 60000 / 1001, 120000 / 1001)
_NAME = re.compile(rf"(\S+)\.({'|'.join(_KINDS)})")


def recognises(text: str) -> bool:
    """Return whether a file's text looks like this format."""
    return text.split(maxsplit=1)[:1] == ["HIERARCHY"]


def read(text: str, path: str, decimal: str | None = None) -> Recording:
    """Read the channels of all joints. Raises MoveFileError, with the line."""
    lines = text.split("\n")
    at = next((i for i, line in enumerate(lines) if line.strip() == "MOTION"), None)
    if not recognises(text) or at is None:
        raise MoveFileError(f"{path}: expected HIERARCHY, and MOTION below it")
    names = _channels(" ".join(lines[:at]).split(), path)
    head: dict[str, tuple[int, str]] = {}
    below = at + 1
    while below < len(lines) and len(head) < 2:
        key, colon, value = lines[below].partition(":")
        if colon:
            head[key.strip().lower()] = (below + 1, value.strip())
        elif lines[below].strip():
            break
        below += 1
    if set(head) != {"frames", "frame time"}:
        raise MoveFileError(f"{path}, line {below + 1}: expected Frames: and Frame Time:")
    line, value = head["frames"]
    if not value.isdecimal():
        raise MoveFileError(
            f"{path}, line {line}: Frames: expected a whole number, found {shown([value])}"
        )
    table = without_header("\n".join(lines[below:]), path, len(names), below, decimal)
    if not table.rows or len(table.rows) != int(value):
        raise MoveFileError(
            f"{path}: expected {value} lines with positions, as Frames says, "
            f"found {len(table.rows)}"
        )
    columns = table.columns(names)
    line, period = head["frame time"]
    places = numbered(len(table.rows))
    return Recording(
        [
            Channel(name, Samples(places, column), "deg" * name.endswith("rotation"), i)
            for i, (name, column) in enumerate(zip(names, columns, strict=True), 1)
        ],
        step=1.0,
        fps=_rate(period, f"{path}, line {line}"),
        camera=_camera(names),
    )


def _camera(names: list[str]) -> Camera | None:
    """Return the first joint that has a position. Its rotations are in the order of their
    channels, the last one first."""
    position = [name for name in names if name.endswith("position")]
    joint = position[0].rpartition(".")[0] if position else ""
    x, y, z = (f"{joint}.{axis}position" for axis in "XYZ")
    if not {x, y, z} <= set(names):
        return None
    turns = [name for name in names if name in {f"{joint}.{axis}rotation" for axis in "XYZ"}]
    return Camera((x, y, z), tuple((name, name[-9].lower()) for name in reversed(turns)))


def _channels(words: list[str], path: str) -> list[str]:
    """Return the names of the channels in a hierarchy, in their order."""
    found: list[str] = []
    joint = ""
    for i, word in enumerate(words):
        if word in ("ROOT", "JOINT"):
            joint = words[i + 1] if i + 1 < len(words) else ""
        elif word == "CHANNELS":
            count = words[i + 1] if i + 1 < len(words) else ""
            number_of = int(count) if count.isdecimal() and len(count) < 4 else 0
            kinds = words[i + 2 : i + 2 + number_of]
            if len(kinds) != number_of or not kinds or any(kind not in _KINDS for kind in kinds):
                raise MoveFileError(
                    f"{path}, joint {joint}: expected CHANNELS, their number and as many of "
                    f"{', '.join(_KINDS)}, found {shown([' '.join(words[i : i + 5])])}"
                )
            found += [f"{joint}.{kind}" for kind in kinds]
    if not found:
        raise MoveFileError(f"{path}: expected a joint with channels, found none")
    return found


def _rate(period: str, where: str) -> float:
    """Return the frames per second of a rounded time from frame to frame."""
    seconds = number(period, f"{where}, Frame Time")
    if not 1 / FASTEST <= seconds <= 1 / SLOWEST:
        raise MoveFileError(f"{where}: Frame Time: expected seconds, found {shown([period])}")
    rounded = last_decimal([period]) / 2 * (1 + 1e-9)
    for rates in (_USUAL, _FILM):
        nearest = min(rates, key=lambda fps: abs(1 / fps - seconds))
        if abs(1 / nearest - seconds) <= rounded:
            return float(nearest)
    return 1 / seconds


def write(table: Table, fps: float | None) -> str:
    """Return the file's text: a root joint with the axes as channels, at the given frames per
    second, the move's, or 24.

    Raises MoveFileError for names of several joints, or that are no channels.
    """
    names = [_NAME.fullmatch(column.name) for column in table.columns]
    joints = {name[1] if name else None for name in names}
    if None in joints or len(joints) > 1:
        wrong = next((c.name for c, n in zip(table.columns, names, strict=True) if not n), None)
        raise MoveFileError(
            f"BVH's axes are channels of one joint, like camera1.Xrotation; found "
            f'{wrong or ", ".join(c.name for c in table.columns)!r}: name one by "in_file"'
        )
    columns = []
    for column in table.columns:
        if not column.name.endswith("rotation"):
            columns.append(column)
        elif factor(column.unit, "deg") is None:
            raise MoveFileError(f"BVH has {column.name} in deg, not in {column.unit}")
        else:
            columns.append(column.converted("deg"))
    kinds = " ".join(name[2] for name in names if name)
    (joint,) = joints
    lines = [
        "HIERARCHY",
        f"ROOT {joint}",
        "{",
        "\tOFFSET 0 0 0",
        f"\tCHANNELS {len(columns)} {kinds}",
        "\tEnd Site",
        "\t{",
        "\t\tOFFSET 0 0 0",
        "\t}",
        "}",
        "MOTION",
        f"Frames: {len(table.frames)}",
        f"Frame Time: {1 / (fps or table.fps or 24):.9f}",
        *(" ".join(row) for row in zip(*(c.texts() for c in columns), strict=True)),
    ]
    return "\n".join(lines) + "\n"
