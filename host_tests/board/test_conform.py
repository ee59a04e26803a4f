"""`framestep lab conform` against the emulated board through its port, as `make emu` serves it.

They are short, and no clock judges: the computer decides how fast it emulates the board.
"""

import contextlib
import itertools
import signal
import subprocess
import sys

import pytest

from framestep_tools import cli
from framestep_tools.building.board_files import ROOT
from framestep_tools.errors import DONE


@contextlib.contextmanager
def served(rig):
    """Yield the lines that `make emu` prints: its pseudo-terminal, its address."""
    process = subprocess.Popen(
        [sys.executable, "-m", "framestep_tools.commands.emu", "--speed", "1",
         "--tcp", "127.0.0.1:0", "--rig", str(rig)],
        cwd=ROOT, stdout=subprocess.PIPE, text=True,
    )  # fmt: skip
    try:
        lines = map(str.strip, process.stdout)
        said = list(itertools.takewhile(lambda line: line != "ready", lines))
        assert process.poll() is None
        yield said
    finally:
        process.send_signal(signal.SIGTERM)
        process.communicate()
    assert process.returncode == 0


@pytest.fixture
def conform(capsys):
    """Return the command on a device, which gives its last line and its errors."""

    def run(device, *subjects):
        words = [word for subject in subjects for word in ("--subject", subject)]
        status = cli.app.status(["lab", "conform", device, "--yes", *words])
        said = capsys.readouterr()
        assert status == DONE, said
        return said.out.splitlines()[-1], said.err

    return run


@pytest.mark.repeats
def test_no_false_alarm(conform, tmp_path):
    """Over either port, one after the other."""
    rig = tmp_path / "rig.json"
    rig.write_text('{"motor_count": 2}')
    with served(rig) as (terminal, tcp):
        line, err = conform(terminal, "framing")
        assert line == "65 checks: 63 passed, 0 left out, 2 reading, 0 departs, 0 fault"
        assert err == ""
        line, err = conform(tcp.replace("tcp ", "socket://"), "numbers")
        assert line == "62 checks: 55 passed, 7 left out, 0 reading, 0 departs, 0 fault"
        assert err == ""
