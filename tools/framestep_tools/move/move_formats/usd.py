"""USD: the animated camera of a scene, as text (.usda) or binary (.usdc, .usd).

    Camera                  the first that moves, or that something above it moves
    timeSamples             of its transforms, over frames; timeCodesPerSecond is the rate
    metersPerUnit, upAxis   the scene's lengths and its axis that points up; a camera looks along -z

Needs usd-core for reading. Source: OpenUSD's documentation of UsdGeom (xformable, camera, metrics).
"""

import contextlib
import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import extra
from ...text.text_file import MoveFileError
from ..table import FASTEST, SLOWEST, rate
from .camera import OWN, SCENE
from .recording import Recording, Table, slots
from .scene_camera import UNITS, Pose, recorded

NAME = "usd"
MEANING = "a USD scene's camera"
ENDINGS = (".usda", ".usd", ".usdc")
CAMERA = SCENE

_BINARY = "PXR-USDC"
_CONVERT = "import sys; from pxr import Sdf; Sdf.Layer.FindOrOpen(sys.argv[1]).Export(sys.argv[2])"
_PATIENCE_S = 60
_MISTAKE = re.compile(r"':(\d+):\d+: ([^']*?)(?: matching [^']*)?(?: at '|')")


def recognises(text: str) -> bool:
    """Return whether a file's text looks like this format."""
    return text.lstrip().startswith(("#usda", _BINARY))


def read(text: str, path: str, decimal: str | None = None) -> Recording:
    """Read the camera's pose. Raises MoveFileError."""
    with extra(f"{path}: USD"):
        from pxr import Sdf, Tf, Usd
    if text.startswith(_BINARY):
        text = _as_text(text, path)
    with _silent():
        try:
            layer = Sdf.Layer.CreateAnonymous(".usda")
            layer.ImportFromString(text)
            return _recording(Usd.Stage.Open(layer), path)
        except (Tf.ErrorException, RuntimeError, ValueError) as error:
            found = _MISTAKE.search(str(error))
            where, said = (f", line {found[1]}", found[2]) if found else ("", "its scene is wrong")
            raise MoveFileError(
                f"{path}{where}: not a USD scene that can be read: {said}"
            ) from None


def _as_text(text: str, path: str) -> str:
    """Return a binary scene as text. Another process converts it: the library may crash or hang
    if it is damaged."""
    with tempfile.TemporaryDirectory() as folder:
        binary, out = Path(folder) / "scene.usdc", Path(folder) / "scene.usda"
        binary.write_bytes(text.encode("latin-1"))
        with contextlib.suppress(subprocess.SubprocessError, OSError, UnicodeDecodeError):
            subprocess.run(
                [sys.executable, "-c", _CONVERT, binary, out],
                check=True,
                capture_output=True,
                timeout=_PATIENCE_S,
            )
            return out.read_text(encoding="utf-8")
    raise MoveFileError(f"{path}: not a binary USD scene that can be read: it may be damaged")


def _recording(stage: Any, path: str) -> Recording:
    from pxr import Usd, UsdGeom

    cameras = [prim for prim in stage.Traverse() if prim.IsA(UsdGeom.Camera)]
    if not cameras:
        raise MoveFileError(f"{path}: expected a Camera, found none")
    moving = [(prim, times) for prim in cameras if (times := _times(prim))]
    if not moving:
        raise MoveFileError(f"{path}: expected a camera that moves, found none")
    prim, times = moving[0]
    said = [f"{path}: of {len(moving)} cameras that move {prim.GetPath()}"] * (len(moving) > 1)
    fps = rate(str(stage.GetTimeCodesPerSecond()))
    if fps is None:
        raise MoveFileError(
            f"{path}: timeCodesPerSecond: expected frames per second from {SLOWEST:g} to "
            f"{FASTEST:g}, found {stage.GetTimeCodesPerSecond():g}"
        )
    metres = UsdGeom.GetStageMetersPerUnit(stage)
    up = UsdGeom.GetStageUpAxis(stage)
    world = OWN.changed(None, "z" if up == "Z" else "y").world

    def pose(places: np.ndarray) -> Pose:
        cache = UsdGeom.XformCache()
        found = np.empty((len(places), 4, 4))
        for i, place in enumerate(places.tolist()):
            cache.SetTime(Usd.TimeCode(place))
            found[i] = cache.GetLocalToWorldTransform(prim).RemoveScaleShear()
        matrix = np.swapaxes(found[:, :3, :3], 1, 2)  # USD multiplies rows
        return found[:, 3, :3] * metres @ world.T, world @ matrix

    return recorded(np.array(times), pose, 1.0, 1.0, path, fps=fps, said=tuple(said))


def _times(prim: Any) -> list[float]:
    """Return the places of keys of a prim and those above it."""
    from pxr import UsdGeom

    found: set[float] = set()
    while prim and not prim.IsPseudoRoot():
        if prim.IsA(UsdGeom.Xformable):
            found.update(UsdGeom.Xformable(prim).GetTimeSamples())
        prim = prim.GetParent()
    return sorted(found)


@contextlib.contextmanager
def _silent() -> Iterator[None]:
    """Keep the library from writing its own lines to standard error."""
    try:
        kept = os.dup(2)
    except OSError:  # there is none
        yield
        return
    null = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(null, 2)
        yield
    finally:
        os.dup2(kept, 2)
        os.close(null)
        os.close(kept)


def write(table: Table, fps: float | None) -> str:
    """Return the file's text: a camera with a key at each frame, at the given frames per second,
    the move's, or 24. Raises MoveFileError for other axes than x, y, z, pan, tilt, roll."""
    columns = slots(table, tuple(UNITS), UNITS, NAME)
    none = ["0"] * len(table.frames)
    texts = {name: columns[name].texts() if name in columns else none for name in UNITS}
    roll = [text[1:] if text[0] == "-" else f"-{text}" for text in texts["roll"]]
    places = zip(table.frames, texts["x"], texts["y"], texts["z"], strict=True)
    turns = zip(table.frames, texts["tilt"], texts["pan"], roll, strict=True)
    rate = fps or table.fps or 24
    return "\n".join(
        [
            "#usda 1.0",
            "(",
            '    defaultPrim = "camera"',
            f"    endTimeCode = {table.frames[-1]}",
            "    metersPerUnit = 1",
            f"    startTimeCode = {table.frames[0]}",
            f"    timeCodesPerSecond = {rate:.10g}",
            '    upAxis = "Y"',
            ")",
            "",
            'def Camera "camera"',
            "{",
            "    double3 xformOp:rotateZXY.timeSamples = {",
            *(f"        {frame}: ({a}, {b}, {c})," for frame, a, b, c in turns),
            "    }",
            "    double3 xformOp:translate.timeSamples = {",
            *(f"        {frame}: ({a}, {b}, {c})," for frame, a, b, c in places),
            "    }",
            '    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateZXY"]',
            "}",
            "",
        ]
    )
