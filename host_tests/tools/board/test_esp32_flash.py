"""MicroPython's own program for an ESP32: what is written is checked before the board is erased."""

import subprocess
import sys
from types import SimpleNamespace

import pytest

from framestep_tools.board import esp32_flash
from framestep_tools.client.port_finder import PortError, esp32_port
from framestep_tools.errors import ToolError


def image(chip=0, begins=0x1000, first=0xE9, table=b"\xaa\x50"):
    """Return the beginning of an image as ESP-IDF makes it, up to its table of partitions."""
    content = bytearray(b"\xff" * 0x9000)
    content[0] = first
    content[12:14] = chip.to_bytes(2, "little")
    content[0x8000 - begins : 0x8002 - begins] = table
    return bytes(content)


@pytest.fixture
def ran(monkeypatch, tmp_path):
    """Return the `commands` that are run instead of esptool, and the `status` with which they end.
    write(content) writes a file with it onto a board, and returns its path."""
    found = SimpleNamespace(commands=[], status=0, there=True)
    file = tmp_path / "micropython.bin"

    def run(words):
        found.commands.append(words)
        return SimpleNamespace(returncode=found.status)

    def write(content, board="esp32_595"):
        file.write_bytes(content)
        esp32_flash.write(board, "/dev/ttyUSB7", file, lambda line: None)
        return file

    found.write = write

    monkeypatch.setattr(subprocess, "run", run)
    monkeypatch.setattr(esp32_flash, "find_spec", lambda name: found if found.there else None)
    return found


@pytest.mark.parametrize(
    ("board", "content", "chip", "at"),
    [
        ("esp32_595", image(), "esp32", "0x1000"),
        ("esp32_s3_595", image(9, 0), "esp32s3", "0x0"),
    ],
)
def test_it_is_written_by_esptool(ran, board, content, chip, at):
    file = ran.write(content, board)
    (words,) = ran.commands
    assert words[:3] == [sys.executable, "-m", "esptool"]
    assert words[words.index("--chip") + 1] == chip
    assert words[words.index("--port") + 1] == "/dev/ttyUSB7"
    assert words[-4:] == ["write-flash", "--erase-all", at, str(file)]


@pytest.mark.parametrize(
    ("board", "content", "why"),
    [
        ("esp32_595", image(9, 0x1000), "this MicroPython is not for an ESP32, which esp32_595"),
        ("esp32_s3_595", image(0, 0), "not for an ESP32-S3"),
        ("esp32_s3_595", image(9, 0x1000), "not a whole MicroPython for an ESP32-S3"),
        ("esp32_595", image(first=0), "not a whole MicroPython for an ESP32"),
        ("esp32_595", b"", "not a whole MicroPython"),
    ],
)
def test_another_file_is_refused(ran, board, content, why):
    with pytest.raises(ToolError, match=why):
        ran.write(content, board)
    assert not ran.commands


def test_without_esptool_a_command_installs_it(ran):
    ran.there = False
    with pytest.raises(ToolError, match=r'-m pip install "esptool>=5,<6" installs it'):
        ran.write(image())
    assert not ran.commands


def test_esptool_that_fails_says_what_to_press(ran):
    ran.status = 2
    with pytest.raises(ToolError, match="hold the BOOT button"):
        ran.write(image())


def port(device, vid):
    return SimpleNamespace(device=device, vid=vid)


def test_its_port_is_found():
    bridge, pico = port("/dev/ttyUSB0", 0x1A86), port("/dev/ttyACM0", 0x2E8A)
    assert esp32_port([pico, bridge, port("/dev/ttyS0", None)]) == "/dev/ttyUSB0"
    with pytest.raises(PortError, match="--port /dev/ttyACM1 or /dev/ttyUSB0"):
        esp32_port([bridge, port("/dev/ttyACM1", 0x303A)])
    with pytest.raises(PortError, match="no ESP32 is on USB"):
        esp32_port([pico])
