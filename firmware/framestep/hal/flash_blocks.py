"""Claims blocks of flash for hal/flash.py. A module of its own, because only power-up needs it."""

import os

from framestep.base.native import const

_BLOCK_BYTES = const(4096)
_PIECE = const(256)
_HEAD_BYTES = const(16)
_COUNT = const(4)  # command of a block device
_NAME = "/positions.%d"
_KIND = b"framestp"


def claim(flash, i, heads):
    """Return the number of block i, and put its first bytes into heads[i]. Raises OSError if there
    is no room for it."""
    look = bytearray(_HEAD_BYTES)
    for _ in range(2):
        heads[i] = head = _head(i)
        found = []
        for place in range(flash.ioctl(_COUNT, 0)):
            flash.readblocks(place, look, 0)
            if look == head:
                found.append(place)
        if len(found) == 1:
            return found[0]
        os.remove(_NAME % i)  # make it again, with another head
    raise OSError("a block of flash could not be found again")


def _head(i):
    """Return the first bytes of a file. Make the file unless it is intact."""
    path = _NAME % i
    try:
        if os.stat(path)[6] == _BLOCK_BYTES:
            with open(path, "rb") as file:
                head = file.read(_HEAD_BYTES)
            if head[: len(_KIND)] == _KIND:
                return head
    except OSError:
        pass
    head = _KIND + os.urandom(_HEAD_BYTES - len(_KIND))
    with open(path, "wb") as file:
        file.write(head + b"\xff" * (_PIECE - _HEAD_BYTES))
        for _ in range(_BLOCK_BYTES // _PIECE - 1):
            file.write(b"\xff" * _PIECE)
    return head
