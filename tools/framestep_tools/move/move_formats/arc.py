"""Dragonframe's Arc move (.arcm): XML with keyframes and Bézier handles for each axis.

    <scen:scene xmlns:scen="http://caliri.com/motion/scene" endframe="48">
      <scen:axis name="Pan" units="deg">
        <scen:points x="1" y="0"/> …                a keyframe: frame and position
        <scen:controlPoints x="9" y="0"/> …         the handle after each keyframe but the last and
                                                    the one before each but the first, in order

docs/use/formats.md has the sources.
"""

import json
import re
import xml.etree.ElementTree as ET
from itertools import pairwise
from typing import NamedTuple
from xml.parsers import expat

from ...axes.units import UNITS
from ...text.numerals import GREATEST, number
from ...text.text_file import MoveFileError, shown
from ..frame_times import last_decimal
from .camera import OWN
from .curves import Keyframes, Point, Samples, Segment, within
from .recording import Channel, Column, Recording, Table

NAME = "arc"
MEANING = "Dragonframe's Arc move, XML with keyframes"
ENDINGS = (".arcm", ".xml")
CAMERA = OWN

# The text is decoded already, whatever its declaration says.
_DECLARATION = re.compile(r"\s*<\?xml[^>]*\?>")
_NAMESPACE = "http://caliri.com/motion/scene"


def recognises(text: str) -> bool:
    """Return whether a file's text looks like this format."""
    return text.lstrip().startswith("<")


def read(text: str, path: str, decimal: str | None = None) -> Recording:
    """Read the file's axes that have keyframes. Raises MoveFileError, with the axis."""
    axes = _axes(text, path)
    channels = []
    for i, axis in enumerate(axes, 1):
        name = axis.attributes.get("name", "")
        channel = _channel(axis, name, f"{path}, axis {name or i}", i)
        if channel:
            channels.append(channel)
    if not channels and any("stepsPerUnit" in axis.attributes for axis in axes):
        raise MoveFileError(
            f"{path}: it is an Arc scene, the set-up of a rig, and not a move: export the move "
            "(.arcm), or make an axes.toml of the scene by -o axes.toml"
        )
    if not channels:
        raise MoveFileError(f"{path}: expected an axis with keyframes, found none")
    texts = (x for axis in axes for x, _ in axis.points)
    return Recording(channels, step=last_decimal(texts))


class _Axis(NamedTuple):
    """An axis's attributes, and x and y of the elements in it, as they are written."""

    attributes: dict[str, str]
    points: list[tuple[str, str]]
    handles: list[tuple[str, str]]


def _axes(text: str, path: str) -> list[_Axis]:
    """Return the axes of a scene. Raises MoveFileError."""
    axes: list[_Axis] = []
    above: list[str] = []  # elements that are open

    def start(name: str, attributes: dict[str, str]) -> None:
        name = name.rpartition("}")[2]
        if not above and name != "scene":
            raise MoveFileError(f"{path}: expected <scene> as the outermost element, found {name}")
        if len(above) == 1 and name == "axis":
            axes.append(_Axis(attributes, [], []))
        elif len(above) == 2 and above[1] == "axis":
            of = {"points": axes[-1].points, "controlPoints": axes[-1].handles}.get(name)
            if of is not None:
                of.append((attributes.get("x", ""), attributes.get("y", "")))
        above.append(name)

    # not a tree of elements: for a long move it would take several times as long
    parser = expat.ParserCreate(namespace_separator="}")
    parser.StartElementHandler = start
    parser.EndElementHandler = lambda _: above.pop()
    try:
        parser.Parse(_DECLARATION.sub("", text, count=1).strip(), True)
    except expat.ExpatError as error:
        raise MoveFileError(f"{path}: not valid XML: {error}") from None
    return axes


def axes_toml(text: str, path: str) -> str:
    """Return the axes.toml of a scene's rig: its axes with steps per unit and a connection's
    channel, which is the motor. Raises MoveFileError if there is none."""
    found = []
    for axis in (each.attributes for each in _axes(text, path)):
        channel = axis.get("connectionChannel", "")
        if "stepsPerUnit" not in axis or channel in ("", "0", "-1"):
            continue
        where = f"{path}, axis {axis.get('name') or len(found) + 1}"
        steps = number(axis.get("stepsPerUnit", ""), f"{where}, stepsPerUnit")
        if not channel.isdecimal():
            raise MoveFileError(
                f"{where}: connectionChannel: expected a motor's number, found {shown([channel])}"
            )
        lines = [
            "[[axis]]",
            f"name = {json.dumps(axis.get('name') or f'motor {channel}', ensure_ascii=False)}",
            f"motor = {int(channel)}",
            f"steps_per_unit = {abs(steps)!r}",
        ]
        unit = axis.get("units", "").strip().lower()
        lines += [f'unit = "{unit}"'] * (unit in UNITS)
        lines += ["invert = true"] * (steps < 0)
        for key, what in (("runMaxVelocity", "s"), ("runMaxAcceleration", "s²")):
            if key in axis:
                lines.append(f"# {key} in Arc: {shown([axis[key]])[1:-1]} units/{what}")
        found.append("\n".join(lines) + "\n")
    if not found:
        raise MoveFileError(f"{path}: expected an axis with stepsPerUnit, found none")
    return "\n".join(found)


def _channel(axis: _Axis, name: str, where: str, column: int) -> Channel | None:
    """Return an axis, or None if it has no keyframes."""
    unit = axis.attributes.get("units", "").strip().lower()
    if unit and unit not in UNITS:
        raise MoveFileError(f"{where}: expected units of {', '.join(UNITS)}, found {shown([unit])}")
    keys = _points(axis.points, f"{where}, keyframe")
    if not keys:
        return None
    for i, (key, following) in enumerate(pairwise(keys), 1):
        if following[0] <= key[0]:
            raise MoveFileError(
                f"{where}, keyframe {i + 1}: expected a frame after {key[0]:g}, "
                f"found {following[0]:g}"
            )
    handles = _points(axis.handles, f"{where}, control point")
    if len(handles) != 2 * (len(keys) - 1):
        raise MoveFileError(
            f"{where}: expected {2 * (len(keys) - 1)} control points for {len(keys)} keyframes, "
            f"found {len(handles)}"
        )
    segments = [
        _segment(keys[i], handles[2 * i], handles[2 * i + 1], keys[i + 1], where)
        for i in range(len(keys) - 1)
    ]
    return Channel(name, Keyframes(keys, segments), unit, column)


def _segment(start: Point, handle: Point, other: Point, end: Point, where: str) -> Segment:
    if handle[0] < start[0] or other[0] > end[0]:
        raise MoveFileError(
            f"{where}: a control point between the keyframes at {start[0]:g} and {end[0]:g} "
            f"points away from the other keyframe"
        )
    return Segment(start, within(handle, start, end[0]), within(other, end, start[0]), end)


def _points(texts: list[tuple[str, str]], where: str) -> list[Point]:
    try:
        found = [(float(x), float(y)) for x, y in texts]
    except ValueError:
        found = []
    plain = len(found) == len(texts) and not any("_" in x or "_" in y for x, y in texts)
    if plain and all(abs(x) <= GREATEST and abs(y) <= GREATEST for x, y in found):
        return found
    return [
        (number(x, f"{where} {i}, x"), number(y, f"{where} {i}, y"))
        for i, (x, y) in enumerate(texts, 1)
    ]


def write(table: Table, fps: float | None) -> str:
    """Return the file's text: a keyframe at each frame, with handles that make the path smooth."""
    ET.register_namespace("scen", _NAMESPACE)
    root = ET.Element(_tag("scene"), {"endframe": str(table.frames[-1])})
    for column in table.columns:
        axis = ET.SubElement(root, _tag("axis"), {"name": column.name})
        if column.unit in ("mm", "cm", "m", "in", "ft", "deg"):
            axis.set("units", column.unit)
        for frame, text in zip(table.frames, column.texts(), strict=True):
            ET.SubElement(axis, _tag("points"), {"x": str(frame), "y": text})
        for x, y in _handles(table.frames, column):
            ET.SubElement(
                axis, _tag("controlPoints"), {"x": f"{x:.6f}", "y": f"{y:.{column.decimals}f}"}
            )
    ET.indent(root)
    return ET.tostring(root, encoding="unicode", xml_declaration=True) + "\n"


def _handles(frames: range, column: Column) -> list[Point]:
    """Return the control points of keyframes at every frame: a third of a frame from their
    keyframe, on its tangent."""
    curve = Samples([float(frame) for frame in frames], column.values)
    found = []
    for i in range(len(frames) - 1):
        found.append((frames[i] + 1 / 3, column.values[i] + curve.slope(i) / 3))
        found.append((frames[i + 1] - 1 / 3, column.values[i + 1] - curve.slope(i + 1) / 3))
    return found


def _tag(name: str) -> str:
    return f"{{{_NAMESPACE}}}{name}"
