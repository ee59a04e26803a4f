"""After Effects' keyframes as text, as they are copied there and pasted into an editor.

    Adobe After Effects 8.0 Keyframe Data
            Units Per Second    24
            ...
    Transform       Position
            Frame   X pixels    Y pixels    Z pixels
            0       960         540         -1800
    ...
    End of Keyframe Data

    Units Per Second    frames per second
    a line at the left  a property; its last word is its name, before it come its groups
    Frame               the frame, from 0 on
    X, Y, Z             a component: "Position X"
    degrees             the unit; pixels and percent are no units of a rig
    no frame            the property's value throughout

The text does not say how values go on between keyframes. Source: texts that exporters of others
write (Fusion's to After Effects, openFrameworks' ofxAEKeyframe).
"""

import re
from dataclasses import replace
from itertools import pairwise

from ...axes.units import factor
from ...text.numerals import number
from ...text.text_file import MoveFileError, shown
from ..table import rate
from .camera import Camera
from .curves import Hold, Keyframes, Piece, Unreadable
from .recording import Channel, Column, Recording, Table, check_increasing

NAME = "ae"
MEANING = "After Effects' keyframes, copied as text"
ENDINGS = (".aetxt",)

_TURNS = (("Rotation", "z"), ("Y Rotation", "y"), ("X Rotation", "x"))
# After Effects' axes: x to the right, y down, z ahead, in the scene and of the camera
CAMERA = Camera(
    ("Position X", "Position Y", "Position Z"),
    _TURNS,
    right="x",
    up="-y",
    back="-z",
    own=True,
    fixed=True,
)
# All that a camera may have; that with a point of interest is turned toward it first
_ORIENTED = replace(CAMERA, rotations=(*_TURNS, *((f"Orientation {a}", a.lower()) for a in "ZYX")))
_POINT = ("Point of Interest X", "Point of Interest Y", "Point of Interest Z")
_AIMED = replace(_ORIENTED, target=_POINT)

_FIRST = re.compile(r"\s*Adobe After Effects \S+ Keyframe Data")
_END = "End of Keyframe Data"
_AXIS = re.compile(r"([XYZ])\b")


def recognises(text: str) -> bool:
    """Return whether a file's text looks like this format."""
    return bool(_FIRST.match(text))


def read(text: str, path: str, decimal: str | None = None) -> Recording:
    """Read the file's properties. Raises MoveFileError, with the line."""
    if not recognises(text):
        raise MoveFileError(
            f"{path}: expected a first line like Adobe After Effects 8.0 Keyframe Data, "
            f"found {shown(text.strip().splitlines()[:1])}"
        )
    fps: float | None = None
    groups: list[str] = []
    heading: list[str] = []
    names: list[tuple[str, ...]] = []  # of the columns below a heading
    curves: dict[tuple[str, ...], list[tuple[float, float]]] = {}
    constant: dict[tuple[str, ...], float] = {}
    units: dict[tuple[str, ...], str] = {}
    at_left = False
    for line, content in enumerate(text.split("\n"), 1):
        cells = content.rstrip().split("\t")
        where = f"{path}, line {line}"
        if line == 1 or not content.strip():
            continue
        if content.startswith(_END):
            break
        if cells[0].strip():
            groups, heading, at_left = [cell.strip() for cell in cells if cell.strip()], [], True
            continue
        cells = [cell.strip() for cell in cells[1:]]
        if not at_left:
            if cells[0] == "Units Per Second":
                fps = rate(cells[1]) if len(cells) > 1 else None
                if fps is None:
                    raise MoveFileError(
                        f"{where}: expected frames per second, found {shown(cells[1:])}"
                    )
            continue
        if not heading:
            if cells[0] != "Frame":
                raise MoveFileError(f"{where}: expected Frame, found {shown(cells[:1])}")
            heading = cells[1:] or [""]
            names = [(*groups, *_component(title, heading)) for title in heading]
            units |= {
                name: "deg" if "degrees" in title else ""
                for name, title in zip(names, heading, strict=True)
            }
            continue
        if len(cells) - 1 != len(heading):
            raise MoveFileError(f"{where}: expected {len(heading) + 1} columns, found {len(cells)}")
        frame = number(cells[0], f"{where}, Frame") if cells[0] else None
        for name, title, cell in zip(names, heading, cells[1:], strict=True):
            value = number(cell, f"{where}, {title or 'value'}")
            if frame is None:
                constant[name] = value
                continue
            keys = curves.setdefault(name, [])
            check_increasing(keys[-1][0] if keys else None, frame, f"{where}, Frame")
            keys.append((frame, value))
    else:
        raise MoveFileError(
            f"{path}, line {len(text.rstrip().splitlines())}: expected {_END} at the end: a part "
            "of the text is missing, copy and paste all of it"
        )
    if not curves:
        raise MoveFileError(f"{path}: expected a property with keyframes, found none")
    begin = min(keys[0][0] for keys in curves.values())
    for name, value in constant.items():
        curves.setdefault(name, [(begin, value)])
    shorts = [_short(name) for name in curves]
    channels = []
    for i, (name, keys) in enumerate(curves.items(), 1):
        short = _short(name)
        title = short if shorts.count(short) == 1 else " ".join(name)
        channels.append(Channel(title, keyframes(keys, f"{path}, {title}"), units[name], i))
    return Recording(channels, step=1e-3, fps=fps, camera=camera_of(channels))


def _component(title: str, heading: list[str]) -> tuple[str, ...]:
    """Return the name of a column of a property with several, else nothing."""
    if len(heading) < 2:
        return ()
    component = _AXIS.match(title)
    return (component[1] if component else title,)


def camera_of(channels: list[Channel]) -> Camera:
    """Return the camera with these properties."""
    aimed = any(channel.name.startswith("Point of Interest") for channel in channels)
    return _AIMED if aimed else _ORIENTED


def _short(name: tuple[str, ...]) -> str:
    """Return a property's name and its component."""
    return " ".join(name[-2:]) if name[-1] in ("X", "Y", "Z") else name[-1]


def keyframes(keys: list[tuple[float, float]], where: str) -> Keyframes:
    """Return keyframes without anything known between those with other values."""
    pieces: list[Piece] = [
        Hold(before)
        if before == after
        else Unreadable(
            f"{where}: the text does not say how it goes on between the keyframes at {start:g} and "
            f"{end:g}: set one at each frame (Animation > Keyframe Assistant > Convert Expression "
            "to Keyframes)"
        )
        for (start, before), (end, after) in pairwise(keys)
    ]
    return Keyframes(keys, pieces)


_PROPERTIES = {
    "Position": ("X pixels", "Y pixels", "Z pixels"),
    "Orientation": ("X degrees", "Y degrees", "Z degrees"),
    "Point of Interest": ("X pixels", "Y pixels", "Z pixels"),
    "X Rotation": ("degrees",),
    "Y Rotation": ("degrees",),
    "Rotation": ("degrees",),
    "Zoom": ("pixels",),
}


def parts(name: str) -> list[str]:
    """Return the names of a property's components."""
    titles = _PROPERTIES[name]
    return [f"{name} {title[0]}" if len(titles) > 1 else name for title in titles]


NAMES = tuple(part for name in _PROPERTIES for part in parts(name))


def properties(table: Table) -> dict[str, Column]:
    """Return the columns by their names, angles in degrees. Raises MoveFileError for another name
    than NAMES."""
    columns: dict[str, Column] = {}
    for column in table.columns:
        if column.name not in NAMES:
            raise MoveFileError(
                f"After Effects' properties are {', '.join(NAMES)}; found {column.name!r}: "
                'name one by "in_file"'
            )
        angle = "degrees" in _PROPERTIES.get(column.name, _PROPERTIES.get(column.name[:-2], ()))[0]
        if angle and factor(column.unit, "deg") is None:
            raise MoveFileError(f"After Effects has {column.name} in deg, not in {column.unit}")
        columns[column.name] = column.converted("deg") if angle else column
    return columns


def write(table: Table, fps: float | None) -> str:
    """Return the file's text: a keyframe at each frame, at the given frames per second, the move's,
    or 24. Raises MoveFileError for another name than NAMES."""
    columns = properties(table)
    lines = [
        "Adobe After Effects 8.0 Keyframe Data",
        "",
        f"\tUnits Per Second\t{fps or table.fps or 24:.10g}",
        "\tSource Width\t1920",
        "\tSource Height\t1080",
        "\tSource Pixel Aspect Ratio\t1",
        "\tComp Pixel Aspect Ratio\t1",
        "",
    ]
    for name, titles in _PROPERTIES.items():
        names = parts(name)
        if not any(part in columns for part in names):
            continue
        lines += ["\t".join(["Transform", name]), "\t".join(["", "Frame", *titles, ""])]
        texts = [columns[p].texts() if p in columns else ["0"] * len(table.frames) for p in names]
        for i, frame in enumerate(table.frames):
            lines.append("\t".join(["", str(frame), *(text[i] for text in texts), ""]))
        lines.append("")
    return "\n".join([*lines, "", "End of Keyframe Data", ""])
