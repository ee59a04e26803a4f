"""The fuzzer itself: it replays its findings, and its checks find the faults that they are for."""

from pathlib import Path

import pytest

from host_tests.script import parse

from . import fuzz, reader

SCRIPTS = sorted((Path(__file__).parent / "scripts").glob("*.txt"))


@pytest.mark.parametrize("path", SCRIPTS, ids=lambda path: path.stem)
def test_what_was_found_passes(path):
    with path.open() as file:
        fuzz.replay(parse(file))


# ---- the frame reader ----------------------------------------------------------------------------


def test_streams_grown_by_coverage():
    tried, kept, steps = reader.explore("frames", cases=150)
    assert tried == 150
    assert kept > 15
    assert steps > 250


def test_a_difference_between_the_readers_is_reported(monkeypatch):
    monkeypatch.setattr(reader.READER, "drop_partial", lambda self: None)
    with pytest.raises(reader.Mismatch):
        reader.explore("frames", cases=150)


def test_fuzzing_plays_a_session_or_fails(monkeypatch, capsys):
    """However short the time, and however long the frame reader has taken of it."""

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
