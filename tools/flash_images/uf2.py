"""UF2 files, as they are copied onto a board's drive.

The format (https://github.com/microsoft/uf2) is blocks of 512 bytes, each with up to 256 bytes for
an address in flash. The firmware itself says where its file system is (pico-sdk's "binary info"),
so this module needs no numbers of boards.
"""

import struct
from collections.abc import Iterator
from dataclasses import dataclass, field

from . import FlashImageError

# Families; the second is ARM, secure (RP2350 datasheet, 5.5.3)
RP2040, RP2350 = 0xE48BFF56, 0xE48BFF59
_ABSOLUTE = 0xE48BFF57  # any of them, by the addresses of the flash
CHIPS = {RP2040: "rp2040", RP2350: "rp2350"}
FLASH = 0x1000_0000
PAGE = 256

_BLOCK = struct.Struct("<8I476sI")
_MAGIC = (0x0A324655, 0x9E5D5157, 0x0AB16F30)
_HAS_FAMILY = 0x2000
_HAS_EXTENSION = 0x8000
_NOT_FOR_FLASH = 0x0001
_TO_BE_IGNORED = 0x9957E304  # an extension: the boot ROM writes nothing
_INFO_START, _INFO_END = 0x7188EBF2, 0xE71AA390  # markers around the addresses of the binary info
_INFO_WITHIN = 0x1000  # distance from the start of the flash
_DEVICE = 7  # kind of binary info: a block device
_FILES = "MicroPython"  # the name of its file system; ROMFS is another
_LONGEST_TEXT = 100


class Uf2Error(FlashImageError):
    """A file is not UF2, or not suitable. The text says why."""


@dataclass(frozen=True)
class DeviceArea:
    """The place of a file system in flash."""

    address: int
    size: int


@dataclass
class Image:
    """Content of a UF2 file for the flash, {address: up to 256 bytes}. `others`: blocks for another
    family."""

    family: int
    pages: dict[int, bytes] = field(default_factory=dict)
    others: list[bytes] = field(default_factory=list)

    @property
    def chip(self) -> str:
        """The image's chip. Raises Uf2Error for a chip that framestep does not know."""
        if self.family not in CHIPS:
            raise Uf2Error(f"it is for family 0x{self.family:08X}, expected RP2040 or RP2350 (ARM)")
        return CHIPS[self.family]

    def read(self, address: int, size: int) -> bytes:
        """Return the bytes at an address; 0xFF where the image has none."""
        data = bytearray()
        while len(data) < size:
            at = (address + len(data)) & -PAGE
            page = self.pages.get(at, b"").ljust(PAGE, b"\xff")
            data += page[address + len(data) - at :]
        return bytes(data[:size])

    def put(self, address: int, data: bytes) -> None:
        """Put whole pages of data at an address."""
        for at in range(0, len(data), PAGE):
            self.pages[address + at] = data[at : at + PAGE]

    def flash(self) -> bytes:
        """Return the flash's content from its start to the image's last byte."""
        return self.read(FLASH, max(self.pages, default=FLASH) + PAGE - FLASH)

    def packed(self) -> bytes:
        """Return the image as a UF2 file.

        It has no gap, because the RP2040's boot ROM counts blocks to know which sectors are still
        to be erased (erratum RP2040-E14).
        """
        blocks = list(self.others)
        pages = range(min(self.pages), max(self.pages) + PAGE, PAGE)
        for i, address in enumerate(pages):
            data = self.pages.get(address, b"\xff" * PAGE)
            head = (*_MAGIC[:2], _HAS_FAMILY, address, len(data), i, len(pages), self.family)
            blocks.append(_BLOCK.pack(*head, data, _MAGIC[2]))
        return b"".join(blocks)

    # ---- the firmware's description of itself

    def _infos(self) -> Iterator[tuple[int, int, int]]:
        """Yield address, kind and tag of each piece of binary info."""
        start = self.read(FLASH, _INFO_WITHIN)
        words = struct.unpack(f"<{_INFO_WITHIN // 4}I", start)
        for i, word in enumerate(words[:-4]):
            if word == _INFO_START and words[i + 4] == _INFO_END:
                for at in range(words[i + 1], words[i + 2], 4):
                    (place,) = struct.unpack("<I", self.read(at, 4))
                    yield (place, *struct.unpack("<HH", self.read(place, 4)))
                return

    def _text(self, address: int) -> str:
        return self.read(address, _LONGEST_TEXT).split(b"\0")[0].decode(errors="replace")

    def file_system(self) -> DeviceArea | None:
        """Return the place of MicroPython's file system, or None for other firmware."""
        for place, kind, _ in self._infos():
            if kind == _DEVICE:
                name, address, size = struct.unpack("<III", self.read(place + 4, 12))
                if self._text(name) == _FILES:
                    return DeviceArea(address, size)
        return None


def parse(content: bytes, name: str) -> Image:
    """Parse a UF2 file's content. Raises Uf2Error if it is not UF2, is cut short, or is for several
    chips at once."""
    if not content or len(content) % _BLOCK.size:
        raise Uf2Error(
            f"{name} is not a UF2 file: it has {len(content)} bytes, "
            f"expected a multiple of {_BLOCK.size}"
        )
    images: dict[int, Image] = {}
    raw: list[tuple[int, bytes]] = []
    blocks: dict[int, set[int]] = {}
    totals: dict[int, int] = {}
    for at in range(0, len(content), _BLOCK.size):
        block = content[at : at + _BLOCK.size]
        magic, magic2, flags, address, size, number, total, family, data, end = _BLOCK.unpack(block)
        if (magic, magic2, end) != _MAGIC or size > len(data):
            raise Uf2Error(f"{name} is not a UF2 file: block {at // _BLOCK.size} is not one of UF2")
        raw.append((family, block))
        if flags & _NOT_FOR_FLASH or not flags & _HAS_FAMILY:
            continue
        images.setdefault(family, Image(family)).pages[address] = data[:size]
        blocks.setdefault(family, set()).add(number)
        totals[family] = max(total, totals.get(family, 0))
    mine = [family for family in images if family in CHIPS]
    if len(mine) != 1:
        found = ", ".join(f"0x{family:08X}" for family in images) or "none"
        raise Uf2Error(
            f"{name}: expected a UF2 file for RP2040 or RP2350 (ARM), found families {found}"
        )
    image = images[mine[0]]
    there, wanted = len(blocks[image.family]), totals[image.family]
    if there < wanted:
        raise Uf2Error(
            f"{name} is cut short: it has {there} of {wanted} blocks; download or copy it again"
        )
    image.others = [block for family, block in raw if family != image.family]
    return image


def from_flash(data: bytes, family: int) -> Image:
    """Return the image of a flash's content from its start."""
    return Image(
        family,
        {FLASH + at: data[at : at + PAGE].ljust(PAGE, b"\0") for at in range(0, len(data), PAGE)},
        [_before_rp2350()] if family == RP2350 else [],
    )


def _before_rp2350() -> bytes:
    """Return the block that files for an RP2350 begin with, as picotool makes it: without one, the
    first versions of the chip may take no file (erratum RP2350-E10). It is for any flash, at the
    end of the first 16 MB, and says itself that it is to be ignored."""
    data = b"\xef" * PAGE + struct.pack("<I", _TO_BE_IGNORED)
    flags = _HAS_FAMILY | _HAS_EXTENSION
    at = FLASH + (1 << 24) - PAGE
    return _BLOCK.pack(*_MAGIC[:2], flags, at, PAGE, 0, 2, _ABSOLUTE, data, _MAGIC[2])
