"""Maya's animation curves (.anim): text with keys and tangents for each attribute of a node.

    anim rotate.rotateY rotateY camera1 0 0 0;
    animData {
      input time;
      output angular;
      weighted 0;
      keys {
        1 0 linear linear 1 1 0;      time, value, tangents before and after, and more
      }
    }

An axis's name is the node and its attribute: camera1.rotateY. docs/use/formats.md says which
tangents are read.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import pairwise

from ...axes.units import UNITS
from ...text.numerals import number
from ...text.text_file import MoveFileError, shown
from ..frame_times import last_decimal
from .camera import Camera
from .curves import Hold, Keyframes, Piece, Point, Segment, Unreadable
from .recording import Channel, Column, Recording, Table

NAME = "anim"
MEANING = "Maya's animation curves"
ENDINGS = (".anim",)

# Maya's names for frames per second
_RATES = {"game": 15, "film": 24, "pal": 25, "ntsc": 30, "show": 48, "palf": 50, "ntscf": 60}
_SECONDS = {"hour": 3600.0, "min": 60.0, "sec": 1.0, "millisec": 0.001}
_FRAME_RATE = re.compile(
    r"(\d+(?:\.\d+)?)(?:fps|df)"
)  # later versions write 23.976fps, and df for drop frames
_FILM = (24000 / 1001, 30000 / 1001, 48000 / 1001, 60000 / 1001, 120000 / 1001)  # written rounded
_COMMENT = re.compile(r"(//|#).*")
_KEY = re.compile(r"\s*([^\s{};#/][^{};#/]*);\s*")
_WORD = re.compile(r"[{};]|[^\s{};]+")
_ATTRIBUTE = re.compile(r"([\w:|]+)\.([\w.\[\]]+)")
_LINEAR, _ANGULAR = ("mm", "cm", "m", "in", "ft"), ("deg", "rad")
_SLOPED = ("linear", "flat")  # tangents whose slope does not depend on Maya's own calculation


@dataclass
class _Data:
    """An animData while it is read."""

    line: int
    settings: dict[str, str] = field(default_factory=dict)
    keys: list[Point] = field(default_factory=list)
    times: list[str] = field(default_factory=list)
    tangents: list[tuple[str, str]] = field(default_factory=list)


def recognises(text: str) -> bool:
    """Return whether a file's text looks like this format."""
    for _, words in _statements(text):
        return words[0] == "animVersion"
    return False


def read(text: str, path: str, decimal: str | None = None) -> Recording:
    """Read the file's curves over time. Raises MoveFileError, with the line."""
    header: dict[str, str] = {}
    curves: list[tuple[str, _Data]] = []
    name = ""
    data: _Data | None = None
    in_keys = False
    line = open_ = 0
    for line, words in _statements(text):
        open_ += {"{": 1, "}": -1}.get(words[-1], 0)
        match words:
            case ["anim", *about]:
                # a node without an attribute has no curve
                name = f"{about[2]}.{about[1]}" if len(about) > 4 else ""
            case ["animData", "{"]:
                data = _Data(line)
                curves.append((name, data))
            case ["keys", "{"] | ["}"]:
                in_keys = words[0] == "keys"
            case [key, value, before, after, *_] if data and in_keys:
                where = f"{path}, line {line}, {name}"
                data.times.append(key)
                data.keys.append((number(key, where), number(value, where)))
                data.tangents.append((before, after))
            case [key, value, *_] if not in_keys:
                (data.settings if data else header)[key] = value
            case _:
                raise MoveFileError(f"{path}, line {line}: not understood: {shown(words)}")
    if open_ > 0:
        raise MoveFileError(
            f"{path}, line {line}: expected }} at the end: a part of the file is missing"
        )
    if "animVersion" not in header:
        raise MoveFileError(f"{path}: expected animVersion at the beginning, found none")
    unit = header.get("timeUnit", "film")
    fps, times = _clock(unit, path)
    read = [
        (name, data)
        for name, data in curves
        if data.keys and data.settings.get("input", "time") == "time"
    ]
    channels = [
        _channel(name, data, header, times, path, i) for i, (name, data) in enumerate(read, 1)
    ]
    if not channels:
        raise MoveFileError(f"{path}: expected a curve with keys over time, found none")
    step = last_decimal(time for _, data in read for time in data.times) * times
    return Recording(channels, fps is None, step, fps, camera=_camera(channels))


def _camera_of(node: str) -> Camera:
    """Return a node with Maya's usual order of rotations: about x first, then y, then z."""
    x, y, z = (f"{node}.translate{axis}" for axis in "XYZ")
    return Camera((x, y, z), tuple((f"{node}.rotate{axis}", axis.lower()) for axis in "XYZ"))


CAMERA = _camera_of("camera1")


def _camera(channels: list[Channel]) -> Camera | None:
    """Return the first node that moves along x, y and z, if there is one."""
    names = {channel.name for channel in channels}
    nodes = (channel.name.rpartition(".")[0] for channel in channels)
    return next((c for c in map(_camera_of, nodes) if set(c.position) <= names), None)


def _statements(text: str) -> Iterator[tuple[int, list[str]]]:
    """Yield line and words of each statement; a { ends its statement, and a } is one."""
    words: list[str] = []
    for line, content in enumerate(text.splitlines(), 1):
        key = _KEY.fullmatch(content) if not words else None  # most lines of a long file
        if key:
            yield line, key[1].split()
            continue
        for word in _WORD.findall(_COMMENT.sub("", content)):
            if word != ";":
                words.append(word)
            if word in "{};" and words:
                yield line, words
                words = []
    if words:
        yield line, words


def _clock(unit: str, path: str) -> tuple[float | None, float]:
    """Return frames per second, None if keys are at times, and then the seconds of their unit."""
    if unit in _RATES:
        return float(_RATES[unit]), 1.0
    if named := _FRAME_RATE.fullmatch(unit):
        fps = float(named[1])
        if fps > 0:
            return next((film for film in _FILM if abs(film - fps) < 0.005), fps), 1.0
    if unit in _SECONDS:
        return None, _SECONDS[unit]
    raise MoveFileError(
        f"{path}: timeUnit: expected one of {', '.join((*_RATES, *_SECONDS))}, found {unit}"
    )


def _channel(
    name: str, data: _Data, header: dict[str, str], times: float, path: str, column: int
) -> Channel:
    where = f"{path}, line {data.line}, {name}"
    clock = header.get("timeUnit", "film")
    if data.settings.get("inputUnit", clock) != clock:
        raise MoveFileError(
            f"{where}: inputUnit: expected the file's timeUnit {clock}, "
            f"found {data.settings['inputUnit']}"
        )
    keys = [(x * times, y) for x, y in data.keys]
    for key, following in pairwise(keys):
        if following[0] <= key[0]:
            raise MoveFileError(
                f"{where}: expected a key after {key[0]:g}, found one at {following[0]:g}"
            )
    weighted = data.settings.get("weighted", "0") != "0"
    pieces = [
        _piece(keys[i], data.tangents[i][1], keys[i + 1], data.tangents[i + 1][0], weighted, where)
        for i in range(len(keys) - 1)
    ]
    return Channel(name, Keyframes(keys, pieces), _unit(data, header, where), column)


def _unit(data: _Data, header: dict[str, str], where: str) -> str:
    """Return the unit of a curve's values; empty if the file does not name it."""
    kind = data.settings.get("output", "unitless")
    if kind not in ("linear", "angular"):
        return ""
    unit = data.settings.get("outputUnit", header.get(f"{kind}Unit", ""))
    if unit and unit not in UNITS:
        known = _LINEAR if kind == "linear" else _ANGULAR
        raise MoveFileError(f"{where}: its {kind} unit: expected {', '.join(known)}, found {unit}")
    return unit


def _piece(start: Point, out: str, end: Point, into: str, weighted: bool, where: str) -> Piece:
    """Return the curve between two keys: a cubic with the slopes of the tangents, if these are
    known."""
    if out == "step":
        return Hold(start[1])
    if out not in _SLOPED or into not in _SLOPED or (weighted and {out, into} != {"linear"}):
        return Unreadable(
            f"{where}: between the keys at {start[0]:g} and {end[0]:g} are tangents that only Maya "
            f"can calculate ({out}, {into}{', weighted' if weighted else ''}): bake the curve "
            "there, with a key at each frame"
        )
    third, rise = (end[0] - start[0]) / 3, (end[1] - start[1]) / 3
    return Segment(
        start,
        (start[0] + third, start[1] + (rise if out == "linear" else 0)),
        (end[0] - third, end[1] - (rise if into == "linear" else 0)),
        end,
    )


def write(table: Table, fps: float | None) -> str:
    """Return the file's text: a key at each frame.

    Raises MoveFileError if an axis's name is not an attribute of a node, or if Maya has no name for
    these frames per second (None: the move's, else 24).
    """
    fps = fps or table.fps or 24
    names = {**_RATES, **{f"{round(film, 3):g}fps": film for film in _FILM}}
    rate = next((name for name, rate in names.items() if abs(rate - fps) < 0.005), None)
    if rate is None:
        rates = ", ".join(map(str, _RATES.values()))
        raise MoveFileError(f"anim: expected {rates} frames per second, found {fps:g}")
    lines = [
        "animVersion 1.1;",
        "mayaVersion 2016;",
        f"timeUnit {rate};",
        "linearUnit cm;",
        "angularUnit deg;",
        f"startTime {table.frames[0]};",
        f"endTime {table.frames[-1]};",
    ]
    for column in table.columns:
        lines += _curve(column, table.frames)
    return "\n".join(lines) + "\n"


def _curve(column: Column, frames: range) -> list[str]:
    name = _ATTRIBUTE.fullmatch(column.name)
    if not name:
        raise MoveFileError(
            f"Maya's axes are attributes of nodes, like camera1.rotateY; found {column.name!r}: "
            'name one by "in_file"'
        )
    node, attribute = name.groups()
    kind = "unitless"
    if column.unit in _LINEAR:
        kind, column = "linear", column.converted("cm")
    elif column.unit in _ANGULAR:
        kind, column = "angular", column.converted("deg")
    # translateX is a part of translate, and so on
    whole = re.sub(r"(translate|rotate|scale)[XYZ]", r"\1.\g<0>", attribute)
    return [
        f"anim {whole} {attribute} {node} 0 0 0;",
        "animData {",
        "  input time;",
        f"  output {kind};",
        "  weighted 0;",
        "  preInfinity constant;",
        "  postInfinity constant;",
        "  keys {",
        *(
            f"    {frame} {text} linear linear 1 1 0;"
            for frame, text in zip(frames, column.texts(), strict=True)
        ),
        "  }",
        "}",
    ]
