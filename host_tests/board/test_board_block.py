"""The board's data in an image: one build for all boards with a chip. Without them, or with wrong
ones, the board says so and touches no pin."""

import json
import struct
import zlib

import pytest

from flash_images.uf2 import FLASH, RP2040, RP2350, from_flash
from framestep_emulator import Emulator
from framestep_tools.board import overlay
from framestep_tools.board.repl_device import DeviceError
from framestep_tools.building import board_block, images
from framestep_tools.building.board_block import BlockError

AT = 0x9F800  # in the flash of an RP2040


def block_of(text):
    """Return a block with this text, its sum right."""
    tail = struct.pack("<II", 0, len(text)) + text
    return b"framestp" + struct.pack("<I", zlib.crc32(tail)) + tail


def changed(content, block):
    return content[:AT] + block + content[AT + len(block) :]


def flipped(content):
    return changed(content, bytes([*content[AT : AT + 60], content[AT + 60] ^ 4]))


def with_size(content, size):
    """The number of bytes goes beyond the block."""
    return changed(content, content[AT : AT + 16] + struct.pack("<I", size))


@pytest.mark.parametrize(
    ("change", "said"),
    [
        pytest.param(lambda c: changed(c, b"\xff" * 2048), "has no board's data", id="none"),
        pytest.param(flipped, "are damaged", id="a bit"),
        pytest.param(lambda c: changed(c, struct.pack("<12xI", 64)), "has no board's data",
         id="64 Hz"),
        pytest.param(lambda c: with_size(c, 2029), "are damaged", id="too long"),
        pytest.param(lambda c: with_size(c, 0xFFFFFFFF), "are damaged", id="no number"),
        pytest.param(lambda c: changed(c, block_of(b'["x", {"chip": "rp2350"}]')), "another chip",
         id="chip"),
        pytest.param(
            lambda c: changed(c, block_of(b'["x", {"chip": "rp2040", "engine": "registers"}]')),
            "another chip or engine",
            id="engine",
        ),
    ],
)  # fmt: skip
def test_wrong_data_are_told_and_no_pin_is_touched(tmp_path, change, said):
    firmware = tmp_path / "firmware.bin"
    firmware.write_bytes(change(images.frozen("pico").read_bytes()))
    with Emulator(firmware, boot=False) as emu:
        emu.trace_start(list(range(29)))
        emu.wait_usb(10_000, ports=1)
        repl = emu.repl()
        assert repl.eval("__import__('framestep.boot').boot.hal") is None
        edges = emu.trace_read()
        at_first = {int(pin): int(level) for _, pin, level in edges[:29]}
        assert len(at_first) == 29
        assert all(at_first[int(pin)] == level for _, pin, level in edges)
        printed = repl.exec("import framestep.boot as b\nb.start()")
        assert printed.startswith("framestep: not started, ")
        assert said in printed
        assert printed.count("\n") == 1


def test_a_pico_2_without_data_says_so(tmp_path):
    content = images.frozen("pico2").read_bytes()
    at = board_block.address(from_flash(content, RP2350)) - FLASH
    firmware = tmp_path / "firmware.bin"
    firmware.write_bytes(content[:at] + b"\xff" * board_block.SIZE + content[at + 2048 :])
    with Emulator(firmware, boot=False) as emu:
        emu.wait_usb(10_000, ports=1)
        printed = emu.repl().exec("import framestep.boot as b\nb.start()")
    assert printed == (
        "framestep: not started, the image has no board's data: "
        "put the board's image on it (framestep install --board NAME)\n"
    )


@pytest.mark.parametrize(
    ("board", "motors", "clock_mhz"),
    [("pico", 8, 200), ("skr_pico", 4, 125), ("fysetc_erb", 2, 125)],
)
def test_boards_share_a_build(board, motors, clock_mhz):
    """The same bytes but for the block, and each is its own board."""
    content = images.frozen(board).read_bytes()
    assert content[:AT] == images.frozen("pico").read_bytes()[:AT]
    with Emulator(images.frozen(board)) as emu:
        emu.wait_usb(10_000, ports=2)
        repl = emu.repl()
        repl.exec("from framestep.board import FOLDER, BOARD\nimport machine")
        assert repl.eval("FOLDER") == board
        assert repl.eval("len(BOARD['step'])") == motors
        assert repl.eval("machine.freq()") == clock_mhz * 1_000_000
        divider = repl.eval("machine.mem32[0x18000014]")  # SSI's BAUDR
        assert divider == 2, "the flash's clock is half of the processor's"


def test_data_that_are_too_long_are_refused(monkeypatch):
    data = board_block.board_data("pico")
    monkeypatch.setattr(board_block, "board_data", lambda board: data | {"gio": [*range(2000)]})
    with pytest.raises(
        BlockError, match=r"too much for the board: \d+ bytes, expected at most 2028"
    ):
        board_block.packed("pico")


def test_an_image_of_another_chip_is_refused():
    image = from_flash(images.frozen("pico").read_bytes(), RP2350)
    with pytest.raises(BlockError, match="the image is for an rp2350, pico has an rp2040"):
        board_block.write(image, "pico")
    image = from_flash(b"\0" * 4096, RP2040)
    with pytest.raises(BlockError, match="does not say where its file system is"):
        board_block.write(image, "pico")


def test_what_is_written_is_what_board_json_says():
    image = from_flash(images.frozen("skr_pico").read_bytes(), RP2040)
    assert board_block.address(image) == FLASH + AT
    block = image.read(FLASH + AT, board_block.SIZE)
    (size,) = struct.unpack_from("<I", block, 16)
    folder, data = json.loads(block[20 : 20 + size])
    assert folder == "skr_pico"
    assert data == board_block.data_on_board(board_block.board_data("skr_pico"))


def test_an_overlay_cannot_change_the_board_s_data():
    data = board_block.data_on_board(board_block.board_data("pico"))
    data.pop("hal")  # as on a board that has started
    image = overlay.Image("0", "pico", b"", data | {"estop": 29})
    with pytest.raises(DeviceError, match=r"board\.json differs from the data in the image"):
        overlay.edited(image, {})
    fewer = {key: value for key, value in data.items() if key != "estop"}
    with pytest.raises(DeviceError, match=r"board\.json differs from the data in the image"):
        overlay.edited(image._replace(data=fewer), {})
    with pytest.raises(KeyError):  # goes on to the modules, of which there is none here
        overlay.edited(image._replace(data=data), {})
