"""Real-time operations as machine code on 32 bits, with the heap locked: byte by byte as on
CPython."""

from host_tests.runtime import realtime_replay
from host_tests.runtime.both import assert_same, frames, said


def test_both_runtimes_say_the_same(runtime):
    assert_same(runtime, realtime_replay)


def test_the_script_goes_through_everything():
    """Much happens in the session that the other test compares."""
    decoder, reported = frames(said(realtime_replay))
    assert decoder.skipped == 0
    assert sum(f.type == 0x114 for f in reported) == 9, "five runs and four exposures"
    codes = [f.payload[0] for f in reported if f.type & 0x8000]
    refused = {code: codes.count(code) for code in (0x12, 0x14, 0x15, 0x16)}
    # moving; 3 runs, 2 exposures, a jog; GO of a dropped operation; too early
    assert refused == {0x12: 1, 0x14: 6, 0x15: 1, 0x16: 2}
