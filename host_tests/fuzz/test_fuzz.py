"""The fuzzer itself: it replays its findings, and its checks find the faults that they are for."""

from pathlib import Path

import pytest

from framestep.rig import Rig
from framestep_tools.building.board_files import board_data
from host_tests.script import parse

from . import fuzz

SCRIPTS = sorted((Path(__file__).parent / "scripts").glob("*.txt"))


@pytest.mark.parametrize("path", SCRIPTS, ids=lambda path: path.stem)
def test_what_was_found_passes(path):
    with path.open() as file:
        script = parse(file)
    Rig(script.rig, board_data(script.board))  # with a mistake in it nothing would move
    fuzz.replay(script)


def test_fuzzing_plays_a_session_or_fails(monkeypatch, capsys):
    """However short the time."""

    def run(*words):
        monkeypatch.setattr("sys.argv", ["fuzz", "--seed", "7", "--requests", "20", *words])
        status = fuzz.main()
        return status, capsys.readouterr().out

    status, said = run("--seconds", "0")
    assert status == 0
    assert "requests in 1 sessions" in said
    status, said = run("--sessions", "0")
    assert status == 1
    assert "no request was played" in said
