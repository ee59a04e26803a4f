"""Near the ends of the range of positions: on 32 bits byte by byte as on CPython, with the right
refusals."""

from host_tests.runtime import far_replay
from host_tests.runtime.both import assert_same, frames, said


def test_both_runtimes_say_the_same(runtime):
    assert_same(runtime, far_replay)


def test_what_leaves_the_range_is_refused():
    _, reported = frames(said(far_replay))
    codes = [f.payload[0] for f in reported if f.type & 0x8000]
    for what, _, _, expected in far_replay.cases():
        assert (what, codes[: len(expected)]) == (what, expected)
        del codes[: len(expected)]
    assert not codes
    assert sum(f.type == 0x114 for f in reported) == 4
    assert not any(f.type == 0x39 for f in reported), "no HARD_STOP"
