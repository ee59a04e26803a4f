"""Installation on an emulated board as a user does it: by the command `framestep` of the package,
unpacked from its wheel, without the sources, a compiler or the modules that only Unix has. It drops
an image onto a folder in place of the board's drive; then comes a move."""

import contextlib
import os
import socket
import threading
import time

import pytest

from flash_images import uf2
from framestep_emulator import Emulator
from framestep_tools.building import images
from framestep_tools.move.move_file import CAMERA_MOVE
from host_tests.project.test_package import installed  # noqa: F401 -- a fixture
from host_tests.tools.board.test_install import drive_in


def free_port():
    """Return a free port that the system does not give to other tests meanwhile."""
    for port in range(20_000 + os.getpid() % 10_000, 32_768):
        with contextlib.suppress(OSError), socket.socket() as probe:
            probe.bind(("127.0.0.1", port))
            return port
    raise OSError("no port is free")


@pytest.fixture
def bare_board(tmp_path):
    """Yield a board with BOOTSEL held: its drive, and where its protocol port will be after a UF2
    file has come."""
    drive, port = drive_in(tmp_path / "RPI-RP2"), free_port()
    stop, started = threading.Event(), []

    def start():
        while not stop.is_set():
            for path in drive.glob("*.uf2"):
                try:
                    image = uf2.parse(path.read_bytes(), path.name)
                except uf2.Uf2Error:  # the rest is still to come
                    break
                flash = tmp_path / "flash.bin"
                flash.write_bytes(image.flash())
                for file in drive.iterdir():
                    file.unlink()
                emulator = Emulator(flash, lockstep=False, speed=1, tcp=(0, port))
                started.append(emulator.start())
                return
            time.sleep(0.05)

    thread = threading.Thread(target=start)
    thread.start()
    yield drive, f"socket://127.0.0.1:{port}"
    stop.set()
    thread.join()
    for emulator in started:
        emulator.close()


@pytest.mark.repeats
def test_from_an_image_to_a_move(bare_board, installed):  # noqa: F811
    drive, port = bare_board
    image = images.frozen().with_suffix(".uf2")
    framestep = installed.run
    assert f"framestep on {port}, firmware 0.1.0: 8 motors" in framestep(
        "install", "--drive", drive, "--image", image, "--device", port
    )
    for motor in range(1, 5):
        framestep("move", port, motor, 0, "--velocity", 20_000, "--acceleration", 100_000)
    said = framestep("play", port, CAMERA_MOVE, "--from", 1, "--to", 12)
    assert "frames 1 to 12 played" in said
    assert "motor 1: " in framestep("status", port)
