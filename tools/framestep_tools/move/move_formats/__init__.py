"""Formats of moves: a module per format, with NAME, MEANING, ENDINGS (of file names), and
`recognises`, `read` and `write`."""

from pathlib import Path
from typing import Protocol

from ..move_file import MoveFileError
from . import arc, csv_table, kuper, maya_anim, raw
from .recording import Recording, Table


class Format(Protocol):
    """What a module of a format has."""

    NAME: str
    MEANING: str
    ENDINGS: tuple[str, ...]

    def recognises(self, text: str) -> bool:
        """Whether a file's text looks like this format."""
        ...

    def read(self, text: str, path: str) -> Recording:
        """The axes in a file's text; MoveFileError, with `path` and the line, if it is wrong."""
        ...

    def write(self, table: Table, fps: float | None) -> str:
        """The text of a file with this move. fps: frames per second, for a file in seconds."""
        ...


# Those that need more signs to be recognised first
FORMATS: dict[str, Format] = {
    module.NAME: module for module in (arc, maya_anim, kuper, csv_table, raw)
}


def of_content(text: str, path: str) -> Format:
    """The format of a file's text; MoveFileError if it looks like none."""
    for candidate in FORMATS.values():
        if candidate.recognises(text):
            return candidate
    raise MoveFileError(
        f"{path}: not recognised as any of {', '.join(FORMATS)}; "
        f"name its format by --format to hear what is wrong"
    )


def of_name(path: Path) -> Format:
    """The format that a file's ending stands for; MoveFileError if it stands for none."""
    for candidate in FORMATS.values():
        if path.suffix.lower() in candidate.ENDINGS:
            return candidate
    raise MoveFileError(
        f"{path}: no format has the ending {path.suffix or '(none)'}; "
        f"name one by --format: {', '.join(FORMATS)}"
    )
