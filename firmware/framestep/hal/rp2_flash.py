"""Flash for framestep.io.memory, written past the file system but in blocks that belong to it.

A pass of the main loop may strike in the middle of the file system's own work (MicroPython runs scheduled functions
from within flash reads), so it must not open a file. Instead each block is a file of just one block's length, made at
boot, of which the file system knows that it is in use and which it never moves as long as nobody writes to it. The
block is found by its first bytes, which are random; they are looked at again before each write, so that a block whose
file somebody has deleted, and which has become part of another, is left alone.
"""

import os

import rp2

from framestep.native import const

_BLOCKS = const(4)
_BLOCK_BYTES = const(4096)
_PAGE_BYTES = const(256)
_HEAD_BYTES = const(16)
_COUNT = const(4)  # commands of a block device
_ERASE = const(6)
_NAME = "/positions.%d"


class Flash:
    """See framestep.hal. OSError where there is no room for its files."""

    blocks = _BLOCKS
    bytes = _BLOCK_BYTES - _PAGE_BYTES  # the first page has the head

    def __init__(self):
        self._flash = rp2.Flash()
        self._look = bytearray(_HEAD_BYTES)
        self._first = bytearray(b"\xff" * _PAGE_BYTES)
        self._heads = [b""] * _BLOCKS
        self._places = [self._claim(i) for i in range(_BLOCKS)]

    def _claim(self, i):
        """The number of a block of our own."""
        for _ in range(2):
            head = self._head(i)
            found = []
            for place in range(self._flash.ioctl(_COUNT, 0) or 0):
                self._flash.readblocks(place, self._look, 0)
                if self._look == head:
                    found.append(place)
            if len(found) == 1:
                self._heads[i] = head
                return found[0]
            os.remove(_NAME % i)  # made anew with another head
        raise OSError("a block of flash could not be found again")

    def _head(self, i):
        """The first bytes of a file, which is made if it is not as it should be."""
        path = _NAME % i
        try:
            if os.stat(path)[6] == _BLOCK_BYTES:
                with open(path, "rb") as file:
                    head = file.read(_HEAD_BYTES)
                if head[:8] == b"framestp":
                    return head
        except OSError:
            pass
        with open(path, "wb") as file:
            self._first[:_HEAD_BYTES] = head = b"framestp" + os.urandom(8)
            file.write(self._first)
            self._first[:_HEAD_BYTES] = b"\xff" * _HEAD_BYTES
            for _ in range(_BLOCK_BYTES // _PAGE_BYTES - 1):
                file.write(self._first)
        return head

    def _ours(self, block):
        self._flash.readblocks(self._places[block], self._look, 0)
        return self._look == self._heads[block]

    def read(self, block, at, buffer):
        self._flash.readblocks(self._places[block], buffer, _PAGE_BYTES + at)

    def program(self, block, at, page):
        if not self._ours(block):
            return False
        self._flash.writeblocks(self._places[block], page, _PAGE_BYTES + at)
        return True

    def erase(self, block):
        if not self._ours(block):
            return False
        self._first[:_HEAD_BYTES] = self._heads[block]
        self._flash.ioctl(_ERASE, self._places[block])
        self._flash.writeblocks(self._places[block], self._first, 0)
        return True
