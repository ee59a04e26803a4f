"""The block of an image that holds a board's data: all boards with one chip have one build.

It lies in the last 2 kB before the file system. firmware/image_board.py reads the data,
boards/framestep.h how fast the flash may be.
"""

import json
import struct
import zlib

from flash_images.uf2 import CHIPS, Image

from ..errors import ToolError
from .board_files import board_data, data_on_board

SIZE = 2048
_HEAD = struct.Struct("<8sIII")  # what it is, a checksum of all that follows, Hz, bytes of JSON
_MAGIC = b"framestp"


class BlockError(ToolError):
    """The image cannot be made a board's. The text says why."""


def address(image: Image) -> int:
    """Return where an image's block is. Raises BlockError if the image has no file system."""
    area = image.file_system()
    if area is None:
        raise BlockError("the image does not say where its file system is")
    return area.address - SIZE


def packed(board: str) -> bytes:
    """Return a board's block."""
    data = board_data(board)
    text = json.dumps([board, data_on_board(data)], separators=(",", ":")).encode()
    room = SIZE - _HEAD.size
    if len(text) > room:
        raise BlockError(
            f"boards/{board}/board.json has too much for the board: {len(text)} bytes, "
            f"expected at most {room}"
        )
    tail = struct.pack("<II", data.get("flash_mhz", 0) * 1_000_000, len(text)) + text
    return (_MAGIC + struct.pack("<I", zlib.crc32(tail)) + tail).ljust(SIZE, b"\xff")


def write(image: Image, board: str) -> None:
    """Write a board's block into an image. Raises BlockError if the image is for another chip."""
    chip = board_data(board)["chip"]
    if CHIPS.get(image.family) != chip:
        raise BlockError(
            f"the image is for an {CHIPS.get(image.family, 'unknown chip')}, {board} has an {chip}"
        )
    image.put(address(image), packed(board))
