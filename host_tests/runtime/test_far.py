"""Near the ends of the range of positions: on 32 bits byte by byte as on CPython, and refused
rightly."""

from pathlib import Path

from framestep_tools.wire import FrameDecoder
from host_tests.runtime import far_replay

HERE = Path(__file__).parent


def said():
    lines = []
    script = far_replay.session.script
    try:
        far_replay.replay(lines.append)
    finally:
        far_replay.session.script = script
    return lines


def test_both_runtimes_say_the_same(unix32f):
    output = unix32f.run("from far_replay import replay\nreplay(print)\n", path=[HERE], heap="400k")
    assert output.split("\n")[:-1] == said()


def test_what_leaves_the_range_is_refused():
    decoder = FrameDecoder()
    frames = [f for line in said()[:-1] for f in decoder.feed(bytes.fromhex(line.split()[1]))]
    codes = [f.payload[0] for f in frames if f.type & 0x8000]
    for what, _, _, expected in far_replay.cases():
        assert (what, codes[: len(expected)]) == (what, expected)
        del codes[: len(expected)]
    assert not codes
    assert sum(f.type == 0x114 for f in frames) == 4
    assert not any(f.type == 0x39 for f in frames), "no HARD_STOP"
