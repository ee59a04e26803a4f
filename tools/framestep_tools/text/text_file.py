"""Text files that other programs write: their encoding, their line ends, and texts for errors."""

import os
from pathlib import Path
from typing import NamedTuple

from ..errors import ToolError

_MOST_NAMES = 50
_LONGEST = 80  # characters of a line in an error text
_MARKS = (
    (b"\xef\xbb\xbf", "utf-8"),
    (b"\xff\xfe\x00\x00", "utf-32-le"),
    (b"\xff\xfe", "utf-16-le"),
    (b"\xfe\xff", "utf-16-be"),
)
_END = "\x1a"  # Ctrl-Z: programs for DOS end a text with it
_CONTROLS = {chr(i) for i in range(32)} - set("\t\n\f\v")
# {first bytes of a file that is no text: what it is, and what to do}
_OTHERS = {
    b"PK\x03\x04": "it is a ZIP archive: save an Excel sheet as CSV, unpack a .usdz",
    b"\xd0\xcf\x11\xe0": "it is an Excel or Word file of an old kind: save the sheet as CSV",
    b"Kaydara FBX Binary": "it is a binary FBX file: export the camera to another format instead, "
    "such as .chan, BVH or CSV",
    b"\x1f\x8b": "it is compressed by gzip: decompress it first",
    b"%PDF": "it is a PDF",
}

BINARY = ("glTF", "PXR-USDC")  # formats of bytes begin like this


class MoveFileError(ToolError):
    """A file is not a move. The text names the line."""


class Text(NamedTuple):
    """A file's text, with \\n at the end of each line, and what its user should be told.

    Of a BINARY file a character is a byte, as in Latin-1.
    """

    text: str
    said: tuple[str, ...] = ()


def read_text(path: str | os.PathLike[str], what: str = "the move") -> Text:
    """Read a text of any usual encoding. Raises MoveFileError. what: kind of the file, for errors.

    A byte order mark names the encoding. Without one it is UTF-8, or else Latin-1.
    """
    try:
        data = Path(path).read_bytes()
    except OSError as error:
        raise MoveFileError(f"cannot read {what} {path}: {error.strerror or error}") from None
    return decoded(data, f"cannot read {what} {path}")


def decoded(data: bytes, failed: str) -> Text:
    """Return the text in these bytes. Raises MoveFileError, which begins with `failed`."""
    for begin, is_one in _OTHERS.items():
        if data.startswith(begin):
            raise MoveFileError(f"{failed}: {is_one}")
    if data.startswith(tuple(begin.encode() for begin in BINARY)):
        return Text(data.decode("latin-1"))
    mark, encoding = next(((m, e) for m, e in _MARKS if data.startswith(m)), (b"", "utf-8"))
    content = data[len(mark) :]
    said: tuple[str, ...] = ()
    try:
        text = content.decode(encoding)
    except UnicodeDecodeError as error:
        if mark:
            raise MoveFileError(
                f"{failed}: its mark says {encoding[:6].upper()}, "
                f"which it is not, see byte {len(mark) + error.start}"
            ) from None
        text = content.decode("latin-1")
        said = (
            f"byte {error.start} is not UTF-8, so the text is read as Latin-1: "
            "see whether letters beyond ASCII are right",
        )
    text = text.replace("\r\n", "\n").replace("\r", "\n")
    if _END in text[-1000:]:
        text = text.rstrip(_END + "\0 \t\n") + "\n"
    for i, sign in enumerate(text) if not text.isprintable() else ():
        if sign in _CONTROLS:
            wide = sign == "\0" and not mark
            raise MoveFileError(
                f"{failed}: it is not text, see character {i + 1}"
                + (" (if it is UTF-16 without a mark, save it as UTF-8)" if wide else "")
            )
    return Text(text, said)


def write_text(path: str | os.PathLike[str], text: str) -> None:
    """Write a move's file completely or not at all. Raises MoveFileError.

    A path that is not a file, such as /dev/stdout, is written to and not replaced.
    """
    target = Path(path).resolve()
    plain = target.is_file() or not target.exists()
    written = target.with_name(f".{target.name}.part") if plain else target
    try:
        with open(written, "w", newline="", encoding="utf-8") as file:
            file.write(text)
        if plain:
            os.replace(written, target)
    except OSError as error:
        if plain:
            written.unlink(missing_ok=True)
        raise MoveFileError(f"cannot write {path}: {error.strerror or error}") from None


def listed(names: list[str]) -> str:
    """Return names for a line of limited length."""
    more = len(names) - _MOST_NAMES
    return ", ".join(names[:_MOST_NAMES]) + (f" and {more} more" if more > 0 else "")


def shown(row: list[str]) -> str:
    """Return a row for an error text: one line of limited length."""
    text = ",".join(row)
    return repr(text if len(text) <= _LONGEST else text[:_LONGEST] + "…")
