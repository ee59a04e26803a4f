"""Formats of moves: a module per format, with NAME, MEANING, ENDINGS (of file names), CAMERA, and
`recognises`, `read` and `write`."""

from pathlib import Path
from typing import Protocol

from ...text.text_file import MoveFileError
from . import (
    ae_json,
    ae_keyframes,
    arc,
    bvh,
    chan,
    csv_table,
    flair,
    gltf,
    kuper,
    maya_anim,
    raw,
    usd,
)  # fmt: skip
from .camera import Camera
from .recording import Recording, Table


class Format(Protocol):
    """Interface of a format's module."""

    NAME: str
    MEANING: str
    ENDINGS: tuple[str, ...]
    CAMERA: Camera  # how `write` writes a camera's pose

    def recognises(self, text: str) -> bool:
        """Return whether a file's text looks like this format."""
        ...

    def read(self, text: str, path: str, decimal: str | None = None) -> Recording:
        """Read the axes in a file's text. Raises MoveFileError, with `path` and the line.

        decimal: the sign before the fraction of numbers (numerals.py); None: the file decides."""
        ...

    def write(self, table: Table, fps: float | None) -> str:
        """Return the text of a file with this move. fps: frames per second, for a file in
        seconds."""
        ...


# Formats with more distinctive marks come first. Nothing but its ending tells chan from raw.
FORMATS: dict[str, Format] = {
    module.NAME: module
    for module in (
        gltf,
        usd,
        arc,
        maya_anim,
        ae_keyframes,
        ae_json,
        bvh,
        flair,
        kuper,
        csv_table,
        raw,
        chan,
    )
}

# formats whose files name frames per second
WITH_RATE = ("csv", "anim", "ae", "aejson", "bvh", "flair", "gltf", "usd")

# {begin of a text: what it is, and the way out}
_OTHERS = {
    "; FBX": "an FBX scene",
}
_WAY_OUT = (
    "which framestep does not read: export the camera's curves as .chan (Nuke), .anim (Maya), BVH, "
    "or CSV by a script (docs/use/formats.md)"
)


def refuse_others(text: str, path: str) -> None:
    """Raise MoveFileError if a file's text is of a known format that is not read."""
    for begin, what in _OTHERS.items():
        if "".join(text[:200].split()).startswith("".join(begin.split())):
            raise MoveFileError(f"{path}: it is {what}, {_WAY_OUT}")


def of_content(text: str, path: str) -> Format:
    """Recognise the format of a file's text. Raises MoveFileError if it looks like none."""
    if not text.strip():
        raise MoveFileError(f"{path}: the file is empty")
    refuse_others(text, path)
    ending = Path(path).suffix.lower()
    for candidate in sorted(FORMATS.values(), key=lambda each: ending not in each.ENDINGS):
        if candidate.recognises(text):
            return candidate
    raise MoveFileError(
        f"{path}: not recognised as any of {', '.join(FORMATS)}; "
        f"name its format by --format to hear what is wrong"
    )


def of_name(path: Path) -> Format:
    """Return the format of a file's ending. Raises MoveFileError for an unknown ending."""
    for candidate in FORMATS.values():
        if path.suffix.lower() in candidate.ENDINGS:
            return candidate
    raise MoveFileError(
        f"{path}: no format has the ending {path.suffix or '(none)'}; "
        f"name one by --format: {', '.join(FORMATS)}"
    )
