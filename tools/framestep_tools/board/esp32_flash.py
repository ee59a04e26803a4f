"""Write MicroPython's own program to an ESP32, by Espressif's esptool.

esptool is a program of its own and no part of this package: pip install framestep[esp32].
"""

import subprocess
import sys
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path

from ..building.board_files import board_chip
from ..errors import ToolError
from .install import read

VERSION = "esptool>=5,<6"  # as in pyproject.toml
MAGIC = 0xE9  # an image of ESP-IDF begins with it
_CHIP_ID = slice(12, 14)  # in its header (ESP-IDF, esp_app_format.h: esp_image_header_t)
PARTITIONS = 0x8000  # place of the table of partitions in flash
TABLE = b"\xaa\x50"  # it begins with these bytes
BAUD = 460800


def check(content: bytes, board: str) -> None:
    """Raise ToolError if this is not all of MicroPython for the board's chip."""
    chip = board_chip(board)
    assert chip.esp
    table = PARTITIONS - chip.esp["offset"]
    if content[:1] != bytes([MAGIC]) or content[table : table + 2] != TABLE:
        raise ToolError(
            f"this is not a whole MicroPython for an {chip.name}: take the .bin file from its page "
            "at https://micropython.org/download"
        )
    if int.from_bytes(content[_CHIP_ID], "little") != chip.esp["image"]:
        raise ToolError(f"this MicroPython is not for an {chip.name}, which {board} has")


def write(board: str, path: str, file: Path, say: Callable[[str], None]) -> None:
    """Erase a board and write MicroPython to it. path: of its serial port. Raises ToolError before
    anything is erased if the file is for another chip or esptool is not installed."""
    content = read(file)
    check(content, board)
    if find_spec("esptool") is None:
        raise ToolError(
            "esptool, which writes to an ESP32, is not installed: "
            f'{sys.executable} -m pip install "{VERSION}" installs it'
        )
    esp = board_chip(board).esp
    assert esp
    say(f"erasing the board on {path} and writing {file.name} ({len(content) // 1024} kB)")
    words = [sys.executable, "-m", "esptool", "--chip", esp["chip"], "--port", path]
    words += ["--baud", str(BAUD), "write-flash", "--erase-all", hex(esp["offset"]), str(file)]
    if subprocess.run(words).returncode != 0:
        raise ToolError(
            "esptool has failed, its messages are above: hold the BOOT button, press RESET, let go "
            "of BOOT, and try again"
        )
