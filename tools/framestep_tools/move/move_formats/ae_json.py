"""After Effects' camera as JSON, as two scripts for Blender users write it.

    {"comp": {"frameRate": 24}, "transformsBaked": false, "version": 3, "layers": [
      {"type": "camera", "name": "Camera 1", "parentIndex": null,
       "position": {"numDimensions": 3, "channels": [
         {"isKeyframed": true, "keyframesFormat": "bezier", "keyframes": [
           {"time": 0, "value": 960, "interpolationIn": "bezier", "interpolationOut": "bezier",
            "easeIn": {"speed": 0, "influence": 16.7}, "easeOut": …}, …]},
         {"isKeyframed": true, "keyframesFormat": "calculated", "startFrame": 0,
          "supersampling": 1, "keyframes": [540, 541, …]},
         {"isKeyframed": false, "value": -1800}]},
       "rotationX", "rotationY", "rotationZ", "orientation", "pointOfInterest", "zoom": likewise}]}

With baked transforms a layer has "transform" instead: a 3 × 4 matrix from the layer to the scene at
each frame, row by row. Or, from the other script:

    {"fps": 24, "camera": {"positionKeyframes": [{"time": 0, "value": [960, 540, -1800]}, …],
                           "rotationKeyframes": likewise}}

Sources: after-effects-to-blender-export by adroitwhiz (influence and speed of a key are its
handle's part of the time to the next key, in percent, and its slope in units per second);
AfterEffects-tracking-data-to-Blender by xudxud. Names of properties are those of `ae`.
"""

import json
import re
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np

from ...text.numerals import GREATEST
from ...text.text_file import MoveFileError, shown
from ..table import FASTEST, SLOWEST
from . import ae_keyframes
from .camera import SCENE, going_on, pan_tilt_roll
from .curves import Hold, Keyframes, Piece, Point, Samples, Segment, within
from .recording import Channel, Column, Curve, Recording, Table

NAME = "aejson"
MEANING = "After Effects' camera, exported by scripts"
ENDINGS = (".json",)
CAMERA = ae_keyframes.CAMERA

_MARK = re.compile(r'"(?:transformsBaked|positionKeyframes|keyframesFormat)"')
_PROPERTIES = {
    "position": "Position", "orientation": "Orientation", "pointOfInterest": "Point of Interest",
    "rotationX": "X Rotation", "rotationY": "Y Rotation", "rotationZ": "Rotation", "zoom": "Zoom",
}  # fmt: skip
_STEP = 1e-6  # frames: times are seconds in the file
_MATRIX = 12


def recognises(text: str) -> bool:
    """Return whether a file's text looks like this format."""
    return text.lstrip().startswith("{") and bool(_MARK.search(text))


class _Wrong(Exception):
    """A value is not what it has to be: its place, what was expected, and the value."""


def read(text: str, path: str, decimal: str | None = None) -> Recording:
    """Read the first camera. Raises MoveFileError, with the value's place."""
    try:
        content = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise MoveFileError(f"{path}: not valid JSON: {error}") from None
    try:
        return _recording(content, path)
    except _Wrong as error:
        place, expected, found = error.args
        raise MoveFileError(
            f"{path}, {place}: expected {expected}, found {shown([json.dumps(found)])}"
        ) from None


def _recording(content: Any, path: str) -> Recording:
    content = _of(content, "JSON", dict, "an object")
    if "camera" in content:
        return _of_keys(content)
    comp = content.get("comp", content)
    fps = _rate(_of(comp, "comp", dict, "an object").get("frameRate"), "frameRate")
    layers = _of(content.get("layers"), "layers", list, "a list")
    cameras = [
        (f"layers[{i}]", layer)
        for i, layer in enumerate(layers)
        if isinstance(layer, dict) and layer.get("type", "camera") == "camera"
    ]
    if not cameras:
        raise MoveFileError(f"{path}: expected a camera among the layers, found none")
    place, layer = cameras[0]
    said = (f"{path}: of {len(cameras)} cameras the first",) * (len(cameras) > 1)
    if "transform" in layer:
        return replace(_baked(layer["transform"], f"{place}.transform", fps), said=said)
    if layer.get("parentIndex") is not None:
        raise MoveFileError(
            f"{path}, {place}: the camera hangs on another layer: export with baked transforms"
        )
    moving: list[Channel] = []
    constant: list[Channel] = []
    for key, name in _PROPERTIES.items():
        if key in layer:
            where = f"{place}.{key}.channels"
            of = _of(layer[key], f"{place}.{key}", dict, "an object").get("channels")
            parts = _of(of, where, list, "a list")
            if len(parts) not in (1, 3):
                raise _Wrong(where, "1 or 3 channels", len(parts))
            for i, part in enumerate(parts):
                title = f"{name} {'XYZ'[i]}" if len(parts) > 1 else name
                curve = _curve(part, f"{where}[{i}]", fps)
                column = len(moving) + len(constant) + 1
                (moving if part.get("isKeyframed") else constant).append(
                    Channel(title, curve, _unit(name), column)
                )
    channels = _together(moving, constant)
    if not channels:
        raise MoveFileError(f"{path}, {place}: expected properties of a camera, found none")
    return Recording(channels, False, _STEP, fps, said, ae_keyframes.camera_of(channels))


def _of_keys(content: dict[str, Any]) -> Recording:
    """Read positionKeyframes and rotationKeyframes."""
    fps = _rate(content.get("fps"), "fps")
    camera = _of(content["camera"], "camera", dict, "an object")
    channels: list[Channel] = []
    for key, name in (("positionKeyframes", "Position"), ("rotationKeyframes", "Orientation")):
        keys = _of(camera.get(key), f"camera.{key}", list, "a list")
        rows = []
        for i, each in enumerate(keys):
            where = f"camera.{key}[{i}]"
            each = _of(each, where, dict, "an object")
            value = _of(each.get("value"), f"{where}.value", list, "three numbers")
            if len(value) != 3:
                raise _Wrong(f"{where}.value", "three numbers", value)
            time = _number(each.get("time"), f"{where}.time") * fps
            rows.append((time, *(_number(v, f"{where}.value") for v in value)))
        _increasing([row[0] for row in rows], f"camera.{key}")
        for i in range(3) if rows else ():
            points = [(row[0], row[1 + i]) for row in rows]
            curve = ae_keyframes.keyframes(points, f"camera.{key}")
            channels.append(Channel(f"{name} {'XYZ'[i]}", curve, _unit(name), len(channels) + 1))
    if not channels:
        raise _Wrong("camera.positionKeyframes", "keyframes", [])
    return Recording(channels, False, _STEP, fps, camera=ae_keyframes.camera_of(channels))


def _together(channels: list[Channel], constant: list[Channel]) -> list[Channel]:
    """Return all channels; the constant ones begin where the others do."""
    begin = min((channel.curve.first for channel in channels), default=0.0)
    placed = [replace(c, curve=Samples([begin], [c.curve.at(0.0)])) for c in constant]
    return sorted([*channels, *placed], key=lambda channel: channel.column)


def _unit(name: str) -> str:
    return "deg" if name.endswith(("Rotation", "Orientation")) else ""


def _curve(part: Any, where: str, fps: float) -> Curve:
    """Return the curve of a channel over frames."""
    part = _of(part, where, dict, "an object")
    if not part.get("isKeyframed"):
        return Samples([0.0], [_number(part.get("value"), f"{where}.value")])
    keys = _of(part.get("keyframes"), f"{where}.keyframes", list, "a list")
    if not keys:
        raise _Wrong(f"{where}.keyframes", "keyframes", [])
    if part.get("keyframesFormat") == "calculated":
        places = _places(part, where, len(keys))
        return Samples(places, [_number(v, f"{where}.keyframes[{i}]") for i, v in enumerate(keys)])
    if part.get("keyframesFormat") != "bezier":
        raise _Wrong(
            f"{where}.keyframesFormat", "bezier or calculated", part.get("keyframesFormat")
        )
    found = [_of(k, f"{where}.keyframes[{i}]", dict, "an object") for i, k in enumerate(keys)]
    points: list[Point] = [
        (
            _number(key.get("time"), f"{where}.keyframes[{i}].time") * fps,
            _number(key.get("value"), f"{where}.keyframes[{i}].value"),
        )
        for i, key in enumerate(found)
    ]
    _increasing([x for x, _ in points], f"{where}.keyframes")
    pieces: list[Piece] = [
        _piece(points[i], before, points[i + 1], after, f"{where}.keyframes[{i}]", fps)
        for i, (before, after) in enumerate(pairwise(found))
    ]
    return Keyframes(points, pieces)


def _piece(
    start: Point, before: dict[str, Any], end: Point, after: dict[str, Any], where: str, fps: float
) -> Piece:
    """Return the curve between two keys: a Bézier curve with handles by speed and influence."""
    if before.get("interpolationOut") == "hold":
        return Hold(start[1])
    handles = []
    for key, ease, way in (
        (before, "easeOut", before.get("interpolationOut")),
        (after, "easeIn", after.get("interpolationIn")),
    ):
        if way == "linear":
            handles.append(((end[0] - start[0]) / 3, (end[1] - start[1]) / 3))
            continue
        found = _of(key.get(ease), f"{where}.{ease}", dict, "an object")
        influence = _number(found.get("influence"), f"{where}.{ease}.influence") / 100
        speed = _number(found.get("speed"), f"{where}.{ease}.speed")
        if not 0 <= influence <= 1:
            raise _Wrong(f"{where}.{ease}.influence", "0 to 100", influence * 100)
        reach = (end[0] - start[0]) * influence
        handles.append((reach, speed * reach / fps))
    (x, y), (other_x, other_y) = handles
    return Segment(
        start,
        within((start[0] + x, start[1] + y), start, end[0]),
        within((end[0] - other_x, end[1] - other_y), end, start[0]),
        end,
    )


def _baked(transform: Any, where: str, fps: float) -> Recording:
    """Return the pose of a camera with a matrix at each frame, in pixels with y up and z back."""
    transform = _of(transform, where, dict, "an object")
    keys = _of(transform.get("keyframes"), f"{where}.keyframes", list, "a list")
    for i, key in enumerate(keys):
        if not isinstance(key, list) or len(key) != _MATRIX:
            raise _Wrong(f"{where}.keyframes[{i}]", f"{_MATRIX} numbers", key)
        for value in key:
            _number(value, f"{where}.keyframes[{i}]")
    if not keys:
        raise _Wrong(f"{where}.keyframes", "matrices", [])
    places = _places(transform, where, len(keys))
    matrix = np.array(keys, float).reshape(-1, 3, 4)
    size = np.linalg.norm(matrix[:, :, :3], axis=1, keepdims=True)
    if not np.all(size > 0):
        raise _Wrong(f"{where}.keyframes", "matrices that turn", "one that does not")
    world = CAMERA.world
    angles = going_on(pan_tilt_roll(world @ (matrix[:, :, :3] / size) @ world.T))
    columns = np.hstack([matrix[:, :, 3] @ world.T, angles])
    return Recording(
        [
            Channel(name, Samples(places, column.tolist()), "deg" if i > 3 else "", i)
            for i, (name, column) in enumerate(
                zip(("x", "y", "z", "pan", "tilt", "roll"), columns.T, strict=True), 1
            )
        ],
        False,
        _STEP,
        fps,
        camera=SCENE,
    )


def _places(part: dict[str, Any], where: str, count: int) -> list[float]:
    """Return the frames of values that were calculated."""
    first = _number(part.get("startFrame"), f"{where}.startFrame")
    each = _number(part.get("supersampling", 1), f"{where}.supersampling")
    if not 1 <= each <= 1000:
        raise _Wrong(f"{where}.supersampling", "1 to 1000", each)
    return [first + i / each for i in range(count)]


def _increasing(places: Sequence[float], where: str) -> None:
    for i, (before, after) in enumerate(pairwise(places), 1):
        if after <= before:
            raise _Wrong(f"{where}[{i}].time", "a time after the one before", after)


def _of(value: Any, where: str, kind: type, what: str) -> Any:
    if not isinstance(value, kind):
        raise _Wrong(where, what, value)
    return value


def _number(value: Any, where: str) -> float:
    if type(value) not in (int, float) or not abs(value) <= GREATEST:
        raise _Wrong(where, "a number", value)
    return float(value)


def _rate(value: Any, where: str) -> float:
    fps = _number(value, where)
    if not SLOWEST <= fps <= FASTEST:
        raise _Wrong(where, f"frames per second from {SLOWEST:g} to {FASTEST:g}", value)
    return fps


def write(table: Table, fps: float | None) -> str:
    """Return the file's text: a camera with a value at each frame, at the given frames per second,
    the move's, or 24. Raises MoveFileError for another name than those of `ae`."""
    columns = ae_keyframes.properties(table)

    def channel(column: Column | None) -> dict[str, Any]:
        if column is None:
            return {"isKeyframed": False, "value": 0}
        return {
            "isKeyframed": True,
            "keyframesFormat": "calculated",
            "startFrame": table.start_frame,
            "supersampling": 1,
            "keyframes": [float(text) for text in column.texts()],
        }

    layer: dict[str, Any] = {"name": "camera", "type": "camera", "parentIndex": None}
    for key, name in _PROPERTIES.items():
        names = ae_keyframes.parts(name)
        if any(part in columns for part in names):
            channels = [channel(columns.get(part)) for part in names]
            layer[key] = {"numDimensions": len(names), "channels": channels}
    comp = {"width": 1920, "height": 1080, "frameRate": fps or table.fps or 24.0}
    content = {"layers": [layer], "sources": [], "comp": comp}
    return json.dumps({**content, "transformsBaked": False, "version": 3}) + "\n"
