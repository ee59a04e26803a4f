"""The same random sessions each time, some with every number checked; `make fuzz` plays others."""

import subprocess
import sys

import pytest

from framestep_tools.building.board_files import ROOT


@pytest.mark.parametrize(
    "first, sessions, checks",
    [
        (0, 8, []),
        pytest.param(8, 16, [], marks=pytest.mark.repeats),
        (24, 3, ["--integers"]),
        pytest.param(27, 9, ["--integers"], marks=pytest.mark.repeats),
    ],
)
def test_sessions(first, sessions, checks):
    command = [
        sys.executable,
        "-m",
        "host_tests.fuzz.fuzz",
        "--seed",
        "make test",
        "--seconds",
        "inf",
    ]
    command += ["--first", str(first), "--sessions", str(sessions), *checks]
    result = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert result.returncode == 0, result.stdout + result.stderr
    assert "nothing found" in result.stdout
    assert f" in {sessions} sessions" in result.stdout
