"""UF2 files and their contents."""

import struct

import pytest

from flash_images import uf2
from flash_images.littlefs_image import make_image, read_image

FILES_AT, FILES_SIZE = 0x100A0000, 1408 * 1024  # a Raspberry Pi Pico's


def firmware(name=b"MicroPython", board=b"Raspberry Pi Pico", at=FILES_AT, size=FILES_SIZE):
    """Return the flash of a firmware with pico-sdk's binary info, which has a block device."""
    flash = bytearray(3000)
    struct.pack_into("<5I", flash, 0x100, 0x7188EBF2, 0x10000200, 0x10000208, 0, 0xE71AA390)
    struct.pack_into("<2I", flash, 0x200, 0x10000300, 0x10000320)
    struct.pack_into("<HHII", flash, 0x300, 6, 0x5052, 0x11A9BC3A, 0x10000400)
    struct.pack_into("<HHIIIIH", flash, 0x320, 7, 0x504D, 0x10000420, at, size, 0, 0)
    for place, text in ((0x400, b"v1.26.1"), (0x420, name), (0x440, board)):
        flash[place : place + len(text) + 1] = text + b"\0"
    return bytes(flash)


def uf2_file(flash=None, family=uf2.RP2040):
    return uf2.from_flash(firmware() if flash is None else flash, family).packed()


def test_what_is_read_is_what_was_packed():
    flash = firmware()
    file = uf2_file(flash)
    assert len(file) == 512 * 12
    image = uf2.parse(file, "x.uf2")
    assert image.chip == "rp2040"
    assert image.flash()[: len(flash)] == flash
    assert image.packed() == file


def test_the_firmware_says_what_it_is():
    image = uf2.parse(uf2_file(), "x.uf2")
    assert image.file_system() == uf2.DeviceArea(FILES_AT, FILES_SIZE)
    other = uf2.from_flash(bytes(3000), uf2.RP2040)
    assert other.file_system() is None
    assert uf2.from_flash(firmware(name=b"ROMFS"), uf2.RP2040).file_system() is None


def test_a_file_for_an_rp2350_begins_with_the_block_of_its_erratum():
    file = uf2_file(family=uf2.RP2350)
    assert len(file) == 512 * 13
    words = struct.unpack("<8I", file[:32])
    with_family_and_extension = 0xA000
    assert words[2:] == (with_family_and_extension, 0x10FFFF00, 0x100, 0, 2, 0xE48BFF57)
    assert file[32 : 32 + 256] == b"\xef" * 256
    assert file[32 + 256 : 32 + 260] == struct.pack("<I", 0x9957E304)
    image = uf2.parse(file, "x.uf2")
    assert image.chip == "rp2350"
    assert image.flash()[: len(firmware())] == firmware()
    assert image.packed() == file


@pytest.mark.parametrize(
    ("content", "complaint"),
    [
        (b"", "not a UF2 file"),
        (uf2_file()[: 512 * 9], "is cut short: it has 9 of 12 blocks"),
        (b"x" * 512, "block 0 is not one of UF2"),
        (uf2_file()[:-1], "a multiple of 512"),
        (uf2_file(family=0x12345678), "found families 0x12345678"),
    ],
)
def test_files_that_are_none(content, complaint):
    with pytest.raises(uf2.Uf2Error, match=complaint):
        uf2.parse(content, "x.uf2")


def test_a_file_system_takes_what_it_was_given():
    files = {"/a/b/c.bin": bytes(range(256)) * 40, "/main.py": b"print(1)"}
    assert read_image(make_image(files, 100)) == files
