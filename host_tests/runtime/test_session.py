"""The whole controller as machine code on 32 bits, with the heap locked: its output is byte by byte
as on CPython."""

import struct
from pathlib import Path

from framestep_tools.client.wire import FrameDecoder
from host_tests.runtime import session_replay

REPLAY = Path(__file__).parent / "session_replay.py"


def said():
    lines = []
    session_replay.replay(lines.append)
    return lines


def test_both_runtimes_say_the_same(runtime):
    output = runtime.run(
        "from session_replay import replay\nreplay(print)\n", path=[REPLAY.parent], heap="400k"
    )
    assert output.split("\n")[:-1] == said()


def test_the_script_goes_through_everything():
    """Much happens in the session that the other test compares."""
    lines = said()
    decoder = FrameDecoder()
    frames = [f for line in lines[:-1] for f in decoder.feed(bytes.fromhex(line.split()[1]))]
    assert decoder.skipped == 0
    ends = [f for f in frames if f.type == 0x114]
    assert len(ends) == 4, "two runs and two exposures"
    refused = {struct.unpack_from("<H", f.payload)[0] for f in frames if f.type & 0x8000}
    assert refused >= {0x10, 0x11, 0x12, 0x13, 0x14, 0x20}
    assert lines[-1].split()[2] == str(2**30 + 12345 + 500) or int(lines[-1].split()[2]) > 2**30
