"""Flash for framestep.io.position_journal, written without the file system, but in blocks that
belong to it.

A pass of the main loop may come in the middle of the file system's own work, as MicroPython runs
scheduled functions during flash reads. So it must not open a file. Instead, each block is a file of
one block's length, made at boot. The file system never moves it as long as nobody writes to it. The
block is found by its first bytes, which are random, and these are compared again before each write.
If somebody has deleted the file, the block may belong to another file and is left alone.
"""

from framestep.base.native import const, micropython, ptr8

_BLOCKS = const(4)
_BLOCK_BYTES = const(4096)
_PAGE_BYTES = const(256)
_HEAD_BYTES = const(16)
_ERASE = const(6)  # command of a block device


@micropython.viper
def put_head(page: ptr8, head: ptr8):
    """Fill a page with a head; the rest of it is as erased."""
    i = 0
    while i < _PAGE_BYTES:
        page[i + 0] = head[i + 0] if i < _HEAD_BYTES else 0xFF
        i += 1


class Flash:
    """See hal/contract.py. device: the block device of the file system, as MicroPython has it.
    Raises OSError if there is no room for its files."""

    blocks = _BLOCKS
    bytes = _BLOCK_BYTES - _PAGE_BYTES  # the first page has the head

    def __init__(self, device):
        from framestep.hal.flash_blocks import claim

        self._flash = device
        self._look = bytearray(_HEAD_BYTES)
        self._heads = [b""] * _BLOCKS
        self._places = [claim(self._flash, i, self._heads) for i in range(_BLOCKS)]

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

    def erase(self, block, page):
        if not self._ours(block):
            return False
        self._flash.ioctl(_ERASE, self._places[block])
        put_head(page, self._heads[block])
        self._flash.writeblocks(self._places[block], page, 0)
        return True
