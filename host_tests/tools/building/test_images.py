"""A build is made once, by whoever needs it first."""

import subprocess
import sys

import pytest

from framestep_tools.building import images
from host_tests.tools.board.test_uf2 import firmware


def test_two_builds_at_once_are_one(tmp_path):
    """Of two processes that need the image, one waits (here the build only records when it
    runs)."""
    log = tmp_path / "log"
    script = f"""
import time
from pathlib import Path
from framestep_tools.building import images
from host_tests.tools.board.test_uf2 import firmware
images.CACHE = Path({str(tmp_path)!r})
images.image_files = lambda board: {{"a.mpy": b"1"}}
images._frozen_files = lambda board, show: {{}}
def run(*command, **environment):
    with open({str(log)!r}, "a") as f: f.write("begin\\n")
    time.sleep(0.5)
    Path(environment["IMAGE"]).mkdir(parents=True, exist_ok=True)
    Path(environment["IMAGE"], "firmware.bin").write_bytes(firmware())
    with open({str(log)!r}, "a") as f: f.write("end\\n")
images._run = run
print(images.frozen("pico"))
"""
    both = [
        subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE, text=True)
        for _ in range(2)
    ]
    made = [process.communicate(timeout=1000)[0] for process in both]
    assert made[0] == made[1] != ""
    assert log.read_text() == "begin\nend\n", "the second one finds it made"


def test_an_image_ends_before_the_board_s_data():
    """2 kB before its file system."""
    image = firmware(at=0x1000_2000)
    assert images.flash_left(image) == 0x1800 - len(image)
    images.flash_left(image.ljust(0x1800, b"x"))
    with pytest.raises(images.BuildError, match="4 bytes too large"):
        images.flash_left(image.ljust(0x1804, b"x"))
