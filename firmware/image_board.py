"""framestep/board.py of an image: the board's data, from a block of flash.

All boards with one chip have the same image. The block lies between it and the file system, and
holds what boards/<board>/board.json says of the pins; framestep_tools/building/board_block.py
writes it into the built image. ValueError: there is no block, or a damaged one.
"""

import json
import struct
import sys
from binascii import crc32

from uctypes import bytearray_at

_MEND = ": put the board's image on it (framestep install --board NAME)"
_machine = sys.implementation._machine
_head = bytearray_at(0x100FF800 if "RP2350" in _machine else 0x1009F800, 2048)
_magic, _sum, _flash_hz, _size = struct.unpack("<8sIII", _head)
if _magic != b"framestp":
    raise ValueError("the image has no board's data" + _MEND)
if _size > 2028 or crc32(memoryview(_head)[12 : 20 + _size]) != _sum:
    raise ValueError("the board's data in the image are damaged" + _MEND)
FOLDER, BOARD = json.loads(memoryview(_head)[20 : 20 + _size])  # type: ignore[arg-type]  # any buffer will do
_ENGINE = ""  # the build puts the image's engine here, if it is not that of the chip
if BOARD["chip"].upper() not in _machine or BOARD.get("engine", "") != _ENGINE:
    raise ValueError("the board's data in the image are those of another chip or engine")
