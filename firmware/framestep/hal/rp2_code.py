"""Functions of copied modules that run from where they lie in flash.

Copied .mpy files have placeholders for most functions. The functions themselves are in one file,
code.bin (framestep_tools.code_file describes it). The blocks of a file stay where they are as long
as nobody writes to it, and code in flash can be run in place. So a module with placeholders calls
`forward` in its last line: it searches memory for pointers to placeholders and makes them point
into flash. The placeholders then are garbage.
"""

from array import array
from binascii import crc32

import rp2
import vfs
from uctypes import bytearray_at

from framestep.native import addressof, const, micropython, ptr32

_FILE = "/lib/framestep/code.bin"
_MAGIC = b"framestp"
_COUNT = const(4)  # command of a block device
_PAGE = const(4096)
_MOST_PAGES = const(127)
_HEAD = const(32)
_INDEX = const(2048)
_MARK = const(0x1AF2C0DE)
_RAM = const(0x2000_0000)
_RAM_END = const(0x2004_0000)  # the stack lies behind
# bits in which what the heap gives out is like _RAM: all but those of _RAM_END - 16
_NO_BLOCK = const(-0x3_FFF1)
# bits that are 0 in the first word of what MicroPython loads for a function
_NO_CODE = const(-0x106_0001)
_AGAIN = ": run make flash again"


class _Flash:
    """The board's flash, read only, as a block device that remembers which block was read last."""

    def __init__(self, flash):
        self.flash = flash
        self.block = 0

    def readblocks(self, block, buffer, offset=0):
        self.block = block
        self.flash.readblocks(block, buffer, offset)

    def ioctl(self, command, argument):
        return self.flash.ioctl(command, argument)


def _word(data, at):
    return data[at] | (data[at + 1] << 8) | (data[at + 2] << 16) | (data[at + 3] << 24)


def _find():
    """Returns the addresses of the file's pages, and the number of functions in it.

    RuntimeError, with what to do, if the file is not there or damaged.
    """
    flash = rp2.Flash()
    device = _Flash(flash)
    try:
        files = vfs.VfsLfs2(device)  # type: ignore[arg-type]
    except OSError:
        raise RuntimeError(
            "copied code needs a littlefs file system: put an image on the board (make image)"
        )
    try:
        file = files.open(_FILE, "rb")
    except OSError:
        raise RuntimeError("there is no " + _FILE + _AGAIN)
    with file:
        head = file.read(_HEAD)
        count = _word(head, 8) if len(head) == _HEAD and head[: len(_MAGIC)] == _MAGIC else 0
        file.seek(max(file.seek(0, 2) - 1, 0))
        file.read(1)  # it is in the last block
    block = device.block
    start = addressof(flash)
    blocks = flash.ioctl(_COUNT, 0) or 0
    memory = memoryview(bytearray_at(start, blocks * _PAGE))
    pages = array("i", range(count if count <= _MOST_PAGES else 0))
    for i in range(len(pages) - 1, -1, -1):
        if 0 <= block < blocks:
            pages[i] = block * _PAGE
            # a block of littlefs but the first begins with where the one before is
            block = _word(memory, pages[i])
    check = 0
    for at in pages:
        check = crc32(memory[at + _HEAD : at + _PAGE], check)
    if not pages or check != _word(head, 16):
        raise RuntimeError(_FILE + " is damaged" + _AGAIN)
    for i in range(len(pages)):
        pages[i] += start
    return pages, _word(head, 12)


@micropython.viper
def _address(pages: ptr32, count: int, key: int) -> int:
    """Returns the address of the function with this key, 0 if it is not in the file."""
    low = 0
    while low < count:
        middle = (low + count) >> 1
        entry = ptr32(pages[middle >> 8] + _INDEX + ((middle & 255) << 3))
        if entry[0] == key:
            return pages[entry[1] >> 12] + (entry[1] & (_PAGE - 1))
        if entry[0] < key:
            low = middle + 1
        else:
            count = middle
    return 0


@micropython.viper
def _forward(at: int, no_block: int, mark: int, pages, count: int) -> int:
    """Make all pointers to placeholders point at functions in flash. Returns how many functions are
    not in the file.

    Checks each 16 bytes of memory, the units of the heap: they may begin a function (py/objfun.h:
    its code is the fourth word, and its type, in flash, the first), or what was loaded to make
    functions of (py/emitglue.h).
    """
    unknown = 0
    while at < _RAM_END:
        if not (ptr32(at)[3] ^ _RAM) & no_block:
            words = ptr32(at)
            code = ptr32(words[3])
            if code[4] == mark:
                if words[0] >> 28 == 1:
                    address = int(_address(pages, count, code[5]))
                    if address:
                        words[3] = address
                    else:
                        unknown += 1
        if not (ptr32(at)[1] ^ _RAM) & no_block:
            words = ptr32(at)
            code = ptr32(words[1])
            if code[4] == mark:
                if not words[0] & _NO_CODE:
                    address = int(_address(pages, count, code[5]))
                    if address:
                        words[1] = address
                    else:
                        unknown += 1
        at += 16
    return unknown


@micropython.viper
def _forget(at: int, mark: int):
    """Take the mark from all placeholders. They are garbage now: where another object got the first
    16 bytes of one, a pointer to it would look like one to the placeholder."""
    while at < _RAM_END:
        words = ptr32(at)
        if words[0] == mark:
            words[0] = 0
        at += 16


def _wipe():
    """Take all memory that is free, and so fill it with zeros."""
    taken = None  # type: list | None
    size = 16384
    while size >= 16:
        try:
            taken = [bytearray(size), taken]
        except MemoryError:
            size >>= 1
    while taken:  # unchained: a pointer left on the stack then holds one piece, not all memory
        rest = taken[1]
        taken.clear()
        taken = rest


def forward():
    """Make the functions of modules that have been loaded run from flash. Allocates; RuntimeError
    in words."""
    # The mark is handed over, since machine code that has it in a word would look like one.
    if _forward(_RAM, _NO_BLOCK, _MARK, _pages, _count):
        # what has been half overwritten since it was free may look like a placeholder
        _wipe()
        if _forward(_RAM, _NO_BLOCK, _MARK, _pages, _count):
            raise RuntimeError(_FILE + " is of another version" + _AGAIN)
    _forget(_RAM, _MARK)


_pages, _count = _find()
del _find, _word, _Flash
