"""Real-time operations as machine code on 32 bits, the heap locked: byte by byte what they say on
CPython."""

from pathlib import Path

from framestep_tools.wire import FrameDecoder
from host_tests.runtime import realtime_replay

HERE = Path(__file__).parent


def said():
    lines = []
    script = realtime_replay.session.script
    try:
        realtime_replay.replay(lines.append)
    finally:
        realtime_replay.session.script = script
    return lines


def test_both_runtimes_say_the_same(unix32f):
    output = unix32f.run(
        "from realtime_replay import replay\nreplay(print)\n", path=[HERE], heap="400k"
    )
    assert output.split("\n")[:-1] == said()


def test_the_script_goes_through_everything():
    """What is compared above is a session in which things happen."""
    decoder = FrameDecoder()
    frames = [f for line in said()[:-1] for f in decoder.feed(bytes.fromhex(line.split()[1]))]
    assert decoder.skipped == 0
    assert sum(f.type == 0x114 for f in frames) == 9, "five runs and four exposures"
    codes = [f.payload[0] for f in frames if f.type & 0x8000]
    refused = {code: codes.count(code) for code in (0x12, 0x14, 0x15, 0x16)}
    # moving; 3 runs, 2 exposures, a jog; GO of what was dropped; too early
    assert refused == {0x12: 1, 0x14: 6, 0x15: 1, 0x16: 2}
