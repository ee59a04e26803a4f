"""Saved positions as machine code on 32 bits: byte by byte the same flash as on CPython, and no
allocation."""

from pathlib import Path

from host_tests.runtime import journal_replay

REPLAY = Path(__file__).parent / "journal_replay.py"


def test_both_runtimes_write_the_same(runtime):
    lines = []
    journal_replay.replay(lines.append)
    output = runtime.run("from journal_replay import replay\nreplay(print)\n", path=[REPLAY.parent])
    assert output.split("\n")[:-1] == lines
    assert "-2147483648" in lines[2]
    assert len({line.split()[-1] for line in lines[1::2]}) == 11
