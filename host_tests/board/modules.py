"""Modules of the core for boards under test: single ones on a board with little else, overlays of
an image, and what tests of a port on such a board share."""

import itertools
import random
import struct
from collections.abc import Iterable, Mapping
from pathlib import Path

import pytest

from framestep.protocol.checksum import check_bytes, fletcher16
from framestep_emulator import ReplError
from framestep_tools.board import overlay
from framestep_tools.board.module_files import dotted
from framestep_tools.building import board_files, images
from framestep_tools.building.board_files import board_sources, compiled, folded


def board_modules(names: Iterable[str]) -> dict[str, bytes]:
    """Return {device path: content} of the core's modules with these names ("io/lights"), compiled
    for an RP2040.

    Their constants keep their names: the tests' own programs import them.
    """
    sources = folded({}, hide=False)
    return {
        f"/lib/framestep/{name}.mpy": compiled(
            f"framestep/{name}.py", sources[f"framestep/{name}.py"], "armv6m"
        )
        for name in names
    }


def edited(name, more="", old="", new=""):
    """Return a module with a text replaced, and lines added at its end."""
    source = board_sources("pico")[name].decode()
    assert not old or source.count(old) == 1
    text = (source.replace(old, new) + more).encode()
    return compiled(name.replace(".mpy", ".py"), text, "armv6m")


def ident_of(board: str) -> str:
    """Return the ID of a board's image, as in framestep_image."""
    return images.image_module(board_files.board_modules("armv6m", board)).split("'")[1]


def on_board(ident: str, modules: Mapping[str, bytes]) -> dict[str, bytes]:
    """Return the files of a board with this overlay. ident: of its image."""
    listing = " ".join([ident, *map(dotted, modules)]).encode()
    files = {f"{overlay.FOLDER}/{name}": content for name, content in modules.items()}
    return {**files, overlay.LIST: listing}


MODULES = (
    "base/__init__", "base/native", "base/copying", "hal/__init__", "hal/rp2/stack", "hal/rp2/usb",
    "hal/ports/usb_descriptor", "hal/ports/usb_transfers", "hal/ports/usb_port",
    "hal/ports/stdin_port", "protocol/__init__", "protocol/messages", "protocol/checksum",
    "protocol/frames", "__init__",
)  # fmt: skip


def port_files():
    """Return the core's files for the ports, and a main loop that echoes each frame."""
    return {
        **board_modules(MODULES),
        "/ports_echo.py": Path(__file__).with_name("ports_echo.py").read_bytes(),
    }


def power_cycle(emu):
    """Return a board fresh from its start, and a host that has opened nothing, in the time of a
    chip's start instead of an emulator's."""
    emu.cmd("usb", plugged=True)
    for port in range(2):
        emu.cmd("hold", port=port, on=False)
        emu.cmd("dtr", port=port, on=True)
        emu.cmd("open", port=port, on=False)
    emu.reset()
    for port in range(2):
        emu.cmd("read", port=port)  # what the test before did not read
    return emu


def sealed(number, payload):
    """Return a good frame with this payload."""
    data = struct.pack("<2sIHH", b"DF", number, 0x0123, len(payload)) + payload
    return data + struct.pack("<H", check_bytes(fletcher16(data, 0, len(data))))


def frame(size, number, last=None):
    """Return a good frame of `size` bytes in total, its payload random; its last byte is `last`, if
    given."""
    for seed in itertools.count(number):
        data = sealed(number, random.Random(seed).randbytes(size - 12))
        if last in (None, data[-1]):
            return data


def run(repl, code="loop(port, echo)"):
    repl.start(f"echo.longest_us = 0\nprint('go')\n{code}", until="go")


def stop(repl):
    """Send Ctrl-C to the running program."""
    repl.serial.write(b"\x03")
    with pytest.raises(ReplError, match="KeyboardInterrupt"):
        repl.finish(2)


def answered(port, data, ms=20):
    port.timeout = ms / 1000
    port.write(data)
    return port.read(len(data)) == data
