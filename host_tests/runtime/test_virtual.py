"""Virtual axes as machine code on 32 bits, with the heap locked, behave byte by byte as on
CPython."""

import sys
from pathlib import Path

import pytest

from framestep_tools.client.wire import FrameDecoder

HERE = Path(__file__).parent


def said(monkeypatch, backlash):
    monkeypatch.syspath_prepend(str(HERE))
    import virtual_replay

    lines = []
    virtual_replay.replay(lines.append, backlash)
    for name in ("virtual_replay", "session_replay"):
        sys.modules.pop(name, None)
    return lines


@pytest.mark.parametrize("backlash", [0, 150])
def test_both_runtimes_say_the_same(backlash, runtime, monkeypatch):
    output = runtime.run(
        f"from virtual_replay import replay\nreplay(print, {backlash})\n", path=[HERE], heap="440k"
    )
    lines = said(monkeypatch, backlash)
    assert output.split("\n")[:-1] == lines
    # and much happens in the session
    frames = [f for line in lines[:-1] for f in FrameDecoder().feed(bytes.fromhex(line.split()[1]))]
    assert len({f.payload for f in frames if f.type == 0x205}) > 20
    assert lines[-1].split()[3] != "0"
