"""`make image`: the UF2 boots on the emulated board and is framestep, with effect of a user's
files."""

import os
import struct
import subprocess

import pytest

from framestep_emulator import Emulator
from framestep_tools.building.board_files import CACHE, ROOT, board_data, board_sources
from framestep_tools.building.images import flash_left, frozen
from framestep_tools.building.ram_functions import symbols
from framestep_tools.client.client import Client
from framestep_tools.payloads import Hi, MotorGetPosition, MotorMove

FLASH = 0x1000_0000
RP2040 = 0xE48BFF56
BLOCK = 512
RAM, RAM_SIZE = 0x2000_0000, 264 * 1024
CODE_OF_A_FUNCTION = 12  # offset of the pointer to its machine code (py/objfun.h, mp_obj_fun_bc_t)


@pytest.fixture(scope="module")
def firmware(tmp_path_factory):
    """Return what a board's boot ROM makes of the UF2 (github.com/microsoft/uf2): an image from the
    start of the flash."""
    # without ARGS of a `make test ARGS=...`, which make would pass on
    clean = {
        name: value
        for name, value in os.environ.items()
        if name not in ("MAKEFLAGS", "MFLAGS", "MAKEOVERRIDES")
    }
    subprocess.run(["make", "-s", "image", "BOARD=pico"], cwd=ROOT, check=True, env=clean)
    uf2 = (ROOT / "build" / "pico.uf2").read_bytes()
    image, count = bytearray(), len(uf2) // BLOCK
    assert len(uf2) == count * BLOCK
    for number in range(count):
        block = uf2[number * BLOCK : (number + 1) * BLOCK]
        magic, second, flags, address, size, index, blocks, family = struct.unpack_from(
            "<8I", block
        )
        assert (magic, second, struct.unpack_from("<I", block, BLOCK - 4)[0]) == (
            0x0A324655,
            0x9E5D5157,
            0x0AB16F30,
        )
        assert flags == 0x2000, "the boot ROM takes only blocks of its own family"
        assert family == RP2040, "the boot ROM takes only blocks of its own family"
        assert (size, index, blocks) == (256, number, count)
        # A gap would leave a sector behind it with what was there: erratum RP2040-E14
        assert address == FLASH + len(image)
        image += block[32 : 32 + size]
    path = tmp_path_factory.mktemp("image") / "firmware.bin"
    path.write_bytes(image)
    return path


def test_there_is_room_for_more():
    """At least 23 kB between the image and its board's data, for the RP2040 and its boards."""
    for board in ("pico", "skr_pico", "fysetc_erb"):
        assert flash_left(frozen(board).with_name("firmware.bin").read_bytes()) >= 23_000, board


def test_it_boots(firmware):
    """After a drag onto the board framestep runs, the user's rig file counts, and motors move."""
    with Emulator(firmware, files={"/rig.json": '{"name": "my crane"}'}) as emu:
        emu.wait_usb(10_000, ports=2)
        with Client(emu.serial(1)) as client:
            info = client.request(Hi())
            assert (info.name, info.motors) == ("my crane", 8)
            assert info.upload_frames >= 10_000
            client.request(MotorMove(1, 500))
            client.wait_idle()
            assert client.request(MotorGetPosition()).steps[0] == 500
        repl = emu.repl()
        assert not repl.eval("__import__('framestep').__file__").startswith("/lib")
        tick = "id(__import__('framestep.pulse.tick', None, None, ('Header',)).Header.tick)"
        code = repl.eval(f"__import__('machine').mem32[{tick} + {CODE_OF_A_FUNCTION}]")
        assert RAM <= code < RAM + RAM_SIZE, "the tick runs from RAM, not through the flash cache"
        # numbers in a frozen tuple are not objects, or a pass could not calculate with them
        looked = (
            "[id(bits) & 1 for bits, _ in "
            "__import__('framestep.io.tmc2209', None, None, ('WORDS',)).WORDS]"
        )
        assert set(repl.eval(looked)) == {1}
        assert "framestep" in repl.eval("__import__('sys').implementation._machine")
        name = "__import__('framestep.board', None, None, ('BOARD',)).BOARD['name']"
        assert repl.eval(name) == board_data("pico")["name"]
        assert repl.eval("__import__('re').sub('[0-9]+', '#', 'a12b')") == "a#b"
        repl.exec("import micropython\n@micropython.native\ndef double(x):\n return 2 * x\n\n")
        assert repl.eval("double(21)") == 42
        # what neopixel, onewire, ds18x20 and dht need, which `mpremote mip install` adds
        repl.exec("import _onewire; from machine import bitstream, dht_readinto")


def test_a_main_py_on_the_board_goes_first(firmware):
    files = {"/main.py": "print('mine')\nname = __name__\n"}
    with Emulator(firmware, files=files) as emu:
        emu.wait_usb(10_000, ports=1)
        repl = emu.repl()
        assert repl.eval("name") == "__main__"
        assert repl.eval("'framestep.boot' in __import__('sys').modules") is False


def test_kernels_that_run_from_ram(firmware):
    """The kernels of framestep_tools.building.ram_functions, by their addresses in the
    firmware."""
    elf = CACHE / "build" / "image-rp2040" / "firmware.elf"
    said = subprocess.run(["arm-none-eabi-nm", elf], capture_output=True, text=True, check=True)
    places = {line.split()[2]: int(line.split()[0], 16) for line in said.stdout.splitlines()}
    wanted = {f"fun_data_{name}" for name in symbols(board_sources("pico"))}
    in_ram = {name for name, place in places.items() if RAM <= place < RAM + RAM_SIZE}
    assert {name for name in in_ram if name.startswith("fun_data_")} == wanted
