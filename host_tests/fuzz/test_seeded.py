"""The same random sessions each time; `make fuzz` plays others."""

import subprocess
import sys

import pytest

from framestep_tools.building.board_files import ROOT


@pytest.mark.parametrize(
    "first, sessions", [(0, 11), pytest.param(11, 25, marks=pytest.mark.repeats)]
)
def test_sessions(first, sessions):
    command = [
        sys.executable, "-m", "host_tests.fuzz.fuzz", "--seed", "make test", "--seconds", "inf",
    ]  # fmt: skip
    command += ["--first", str(first), "--sessions", str(sessions)]
    result = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert result.returncode == 0, result.stdout + result.stderr
    assert "nothing found" in result.stdout
    assert f" in {sessions} sessions" in result.stdout
