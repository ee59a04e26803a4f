"""Nuke's camera file (.chan), which trackers write as well: a line per frame, without a header.

    column   name        meaning
    1        –           the frame
    2 to 4   tx ty tz    position, in the scene's unit, which the file does not name
    5 to 7   rx ry rz    rotation in degrees
    8        vfov        vertical field of view in degrees; may be missing

The camera looks along -z, y is up. Nuke turns it about z first, then x, then y (its rotation order
ZXY), unless the user has chosen otherwise.

Source: Foundry's reference of nukescripts.import_boujou, which names these columns.
"""

from ...text.text_file import MoveFileError
from ..table import without_header
from . import raw
from .camera import Camera
from .curves import Samples
from .recording import Channel, Recording, Table, check_frames, frame_rows, slots

NAME = "chan"
MEANING = "Nuke's camera: a line per frame, position, rotation, field of view"
ENDINGS = (".chan",)

NAMES = ("tx", "ty", "tz", "rx", "ry", "rz", "vfov")
CAMERA = Camera(("tx", "ty", "tz"), (("rz", "z"), ("rx", "x"), ("ry", "y")))
_UNITS = {"rx": "deg", "ry": "deg", "rz": "deg", "vfov": "deg"}


def recognises(text: str) -> bool:
    """Return whether a file's text looks like this format. Only its ending tells it from `raw`."""
    return raw.recognises(text)


def read(text: str, path: str, decimal: str | None = None) -> Recording:
    """Read the file's axes. Raises MoveFileError, with line and column."""
    table = without_header(text, path, 0, 0, decimal)
    if not table.rows:
        raise MoveFileError(f"{path}: expected a line for each frame, found none")
    width = len(table.rows[0])
    if width not in (len(NAMES), len(NAMES) + 1):
        raise MoveFileError(
            f"{table.where(0)}: expected {len(NAMES)} or {len(NAMES) + 1} columns, the frame and "
            f"{' '.join(NAMES)}, found {width}"
        )
    names = NAMES[: width - 1]
    frames, *columns = table.columns(["frame", *names])
    check_frames(table, 0, frames, "frame")
    return Recording(
        [
            Channel(name, Samples(frames, column), _UNITS.get(name, ""), i)
            for i, (name, column) in enumerate(zip(names, columns, strict=True), 2)
        ],
        step=1.0,
        fps=table.fps,
        camera=CAMERA,
    )


def write(table: Table, fps: float | None) -> str:
    """Return the file's text; what no axis moves is 0. Raises MoveFileError for another name than
    NAMES."""
    columns = slots(table, NAMES, _UNITS, "chan")
    given = [name for name in NAMES if name in columns]
    names = NAMES if "vfov" in given else NAMES[:-1]
    return frame_rows(table.frames, [columns.get(name) for name in names])
