"""A few of the end-to-end sessions on the simulated ESP32-S3; `make test-sessions` plays all
of them."""

import subprocess
import sys

import pytest

from framestep_tools.building.board_files import ROOT

SESSIONS = ROOT / "host_tests" / "end_to_end"
FILES = ["hosts/test_sessions.py", "io/test_io.py"]


@pytest.mark.repeats
def test_some_sessions():
    words = [sys.executable, "-m", "pytest", "-q", "-p", "no:xdist", "-p", "no:cacheprovider"]
    words += ["--target", "esp32", *(str(SESSIONS / name) for name in FILES)]
    done = subprocess.run(words, capture_output=True, text=True, cwd=ROOT)
    assert done.returncode == 0, done.stdout
    assert " passed" in done.stdout
