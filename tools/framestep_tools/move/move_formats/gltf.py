"""glTF 2.0: the animated camera of a scene, as .gltf with its data inside or beside it, or as .glb.

    cameras, nodes      the first animated node with a camera, else the first with a camera; the
                        nodes above it move it as well
    animations          translation, rotation (a quaternion) and scale of nodes over seconds
    lengths             metres; x to the right, y up; a camera looks along -z

Needs pygltflib for reading. Source: Khronos' glTF 2.0 specification, sections 3.6, 3.10, 3.11.
"""

import base64
import json
import re
import warnings
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import extra
from ...text.text_file import MoveFileError
from . import quaternions
from .camera import SCENE, of_angles
from .recording import Recording, Table, slots
from .scene_camera import UNITS, Pose, recorded

NAME = "gltf"
MEANING = "a glTF scene's camera"
ENDINGS = (".gltf", ".glb")
CAMERA = SCENE

_BINARY = "glTF"
_ASSET = re.compile(r'"asset"\s*:\s*\{')
_NUMBERS = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", 5126: "<f4"}
_SIZES = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}
_PATHS = {"translation": 3, "rotation": 4, "scale": 3}
_DEPTH = 100  # nodes above a camera
_LONGEST_S = 0.1  # between keys that are a key for each frame, or nearly so
_STEP_S = 0.004


def recognises(text: str) -> bool:
    """Return whether a file's text looks like this format."""
    return text.startswith(_BINARY) or (text.lstrip().startswith("{") and bool(_ASSET.search(text)))


def read(text: str, path: str, decimal: str | None = None) -> Recording:
    """Read the camera's pose. Raises MoveFileError."""
    with extra(f"{path}: glTF"):
        import pygltflib
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            if text.startswith(_BINARY):
                scene = pygltflib.GLTF2.load_from_bytes(text.encode("latin-1"))
            else:
                scene = pygltflib.GLTF2.from_json(text, infer_missing=True)
            return _Scene(scene, path).recording()
    except MoveFileError:
        raise
    except Exception as error:  # the library checks nothing: any error may come of a wrong file
        said = str(error).split("\n")[0][:120]
        raise MoveFileError(
            f"{path}: not a glTF scene that can be read ({type(error).__name__}: {said})"
        ) from None


class _Scene:
    """A camera in a scene. Errors of a wrong file are of any kind."""

    def __init__(self, scene: Any, path: str):
        self._scene = scene
        self._path = path
        self._buffers: dict[int, bytes] = {}
        self._above = {child: i for i, node in enumerate(scene.nodes) for child in node.children}

    def recording(self) -> Recording:
        """Return the pose of the first camera that an animation moves, over seconds."""
        nodes = self._scene.nodes
        cameras = [i for i, node in enumerate(nodes) if node.camera is not None]
        if not cameras:
            raise MoveFileError(f"{self._path}: expected a node with a camera, found none")
        found = [
            (camera, curves)
            for camera in cameras
            for animation in self._scene.animations
            if (curves := self._samplers(animation, self._chain(camera)))
        ]
        if not found:
            raise MoveFileError(f"{self._path}: expected an animated camera, found none")
        camera, samplers = found[0]
        said = (f"{self._path}: of {len(found)} animated cameras the first",) * (len(found) > 1)
        curves = {key: self._curve(key[1], sampler) for key, sampler in samplers.items()}
        times = np.unique(np.concatenate([times for times, _, _ in curves.values()]))

        def pose(places: np.ndarray) -> Pose:
            position = np.zeros((len(places), 3))
            turn = np.tile((0.0, 0.0, 0.0, 1.0), (len(places), 1))
            for node in self._chain(camera):  # from the camera up
                at, by, size = self._local(nodes[node], node, curves, places)
                position = at + quaternions.rotated(by, position * size)
                turn = quaternions.times(by, turn)
            return position, quaternions.matrices(turn)

        return recorded(times, pose, _LONGEST_S, _STEP_S, self._path, seconds=True, said=said)

    @staticmethod
    def _samplers(animation: Any, chain: list[int]) -> dict[tuple[int, str], Any]:
        """Return the samplers of an animation that move these nodes, by node and path."""
        return {
            (channel.target.node, channel.target.path): animation.samplers[channel.sampler]
            for channel in animation.channels
            if channel.target.node in chain and channel.target.path in _PATHS
        }

    def _chain(self, node: int) -> list[int]:
        """Return a node and those above it."""
        found = [node]
        while found[-1] in self._above and len(found) < _DEPTH:
            found.append(self._above[found[-1]])
        return found

    def _local(
        self, node: Any, number: int, curves: dict[tuple[int, str], Any], places: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return a node's translation, rotation and scale at these times."""
        fixed = {
            "translation": node.translation or (0.0, 0.0, 0.0),
            "rotation": node.rotation or (0.0, 0.0, 0.0, 1.0),
            "scale": node.scale or (1.0, 1.0, 1.0),
        }
        if node.matrix:
            matrix = np.array(node.matrix, float).reshape(4, 4).T
            size = np.linalg.norm(matrix[:3, :3], axis=0)
            fixed = {
                "translation": matrix[:3, 3],
                "rotation": quaternions.of_matrices(matrix[None, :3, :3] / size)[0],
                "scale": size,
            }
        found = []
        for name in _PATHS:
            curve = curves.get((number, name))
            values = np.array(fixed[name], float)
            at = _values_at(curve, places, name) if curve else np.tile(values, (len(places), 1))
            found.append(at)
        return found[0], found[1], found[2]

    def _curve(self, name: str, sampler: Any) -> tuple[np.ndarray, np.ndarray, str]:
        """Return times, values and interpolation of a sampler."""
        times = self._numbers(sampler.input, 1)[:, 0]
        way = sampler.interpolation or "LINEAR"
        values = self._numbers(sampler.output, _PATHS[name])
        each = 3 if way == "CUBICSPLINE" else 1
        if way not in ("LINEAR", "STEP", "CUBICSPLINE") or len(values) != each * len(times):
            raise MoveFileError(f"{self._path}: an animation's {name} has no values for its keys")
        if not len(times) or np.any(np.diff(times) <= 0) or not np.all(np.isfinite(values)):
            raise MoveFileError(
                f"{self._path}: expected times that increase and numbers for {name}"
            )
        return times, values, way

    def _numbers(self, index: int, width: int) -> np.ndarray:
        """Return the numbers of an accessor, a row for each."""
        accessor = self._scene.accessors[index]
        if accessor.sparse is not None or _SIZES.get(accessor.type) != width:
            raise MoveFileError(
                f"{self._path}: expected accessor {index} with {width} numbers, not sparse"
            )
        view = self._scene.bufferViews[accessor.bufferView]
        data = self._buffer(view.buffer)
        kind = np.dtype(_NUMBERS[accessor.componentType])
        start = (view.byteOffset or 0) + (accessor.byteOffset or 0)
        stride = view.byteStride or kind.itemsize * width
        if accessor.count < 1 or start < 0 or stride < kind.itemsize * width:
            raise MoveFileError(f"{self._path}: accessor {index} is outside its buffer")
        end = start + stride * (accessor.count - 1) + kind.itemsize * width
        if end > len(data):
            raise MoveFileError(f"{self._path}: accessor {index} is outside its buffer")
        rows = np.ndarray(
            (accessor.count, width), kind, data, start, (stride, kind.itemsize)
        ).astype(float)
        if kind.kind != "f":
            rows = np.maximum(rows / np.iinfo(kind).max, -1.0)
        return rows

    def _buffer(self, index: int) -> bytes:
        if index not in self._buffers:
            uri = self._scene.buffers[index].uri
            if not uri:
                data = self._scene.binary_blob()
            elif uri.startswith("data:"):
                data = base64.b64decode(uri.partition(",")[2])
            else:
                beside = Path(self._path).parent / Path(uri).name
                if Path(uri).name != uri or not beside.is_file():
                    raise MoveFileError(
                        f"{self._path}: its data are in {uri[:80]!r}, which is not beside it: "
                        "export it as .glb"
                    )
                data = beside.read_bytes()
            self._buffers[index] = data or b""
        return self._buffers[index]


def _values_at(curve: tuple[np.ndarray, np.ndarray, str], at: np.ndarray, name: str) -> np.ndarray:
    """Return a curve's values at these times; before its first key and after its last the key's."""
    times, values, way = curve
    if len(times) == 1:
        return np.tile(values[1 if way == "CUBICSPLINE" else 0], (len(at), 1))
    before = np.clip(np.searchsorted(times, at, side="right") - 1, 0, len(times) - 2)
    width = times[before + 1] - times[before]
    t = np.clip((at - times[before]) / width, 0.0, 1.0)[:, None]
    if way == "CUBICSPLINE":
        into, points, out = values[0::3], values[1::3], values[2::3]
        step = width[:, None]
        found = (
            (2 * t**3 - 3 * t**2 + 1) * points[before]
            + step * (t**3 - 2 * t**2 + t) * out[before]
            + (3 * t**2 - 2 * t**3) * points[before + 1]
            + step * (t**3 - t**2) * into[before + 1]
        )
    elif way == "STEP":
        found = values[before + (t[:, 0] >= 1.0)]
    elif name == "rotation":
        return quaternions.slerp(values[before], values[before + 1], t)
    else:
        found = values[before] + t * (values[before + 1] - values[before])
    return quaternions.unit(found) if name == "rotation" else found


def write(table: Table, fps: float | None) -> str:
    """Return the file's text: a camera with a key at each frame, at the given frames per second,
    the move's, or 24. Numbers have single precision. Raises MoveFileError for other axes than x,
    y, z, pan, tilt, roll."""
    columns = slots(table, tuple(UNITS), UNITS, NAME)
    none = [0.0] * len(table.frames)
    rows = np.array([columns[name].values if name in columns else none for name in UNITS]).T
    times = np.arange(len(rows)) / (fps or table.fps or 24)
    turns = quaternions.of_matrices(of_angles(rows[:, 3:]))
    parts = [times[:, None], rows[:, :3], turns]
    data = b"".join(part.astype("<f4").tobytes() for part in parts)
    sizes = [part.size * 4 for part in parts]
    scene = {
        "asset": {"version": "2.0", "generator": "framestep"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"name": "camera", "camera": 0}],
        "cameras": [{"type": "perspective", "perspective": {"yfov": 0.6, "znear": 0.01}}],
        "animations": [
            {
                "channels": [
                    {"sampler": i, "target": {"node": 0, "path": path}}
                    for i, path in enumerate(("translation", "rotation"))
                ],
                "samplers": [{"input": 0, "output": i, "interpolation": "LINEAR"} for i in (1, 2)],
            }
        ],
        "accessors": [
            {
                "bufferView": i,
                "componentType": 5126,
                "count": len(rows),
                "type": kind,
                **({"min": [0.0], "max": [float(np.float32(times[-1]))]} if i == 0 else {}),
            }
            for i, kind in enumerate(("SCALAR", "VEC3", "VEC4"))
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": sum(sizes[:i]), "byteLength": size}
            for i, size in enumerate(sizes)
        ],
        "buffers": [
            {
                "byteLength": len(data),
                "uri": "data:application/octet-stream;base64," + base64.b64encode(data).decode(),
            }
        ],
    }
    return json.dumps(scene, indent=1) + "\n"
