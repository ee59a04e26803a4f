"""The upload store as machine code on 32 bits, with the heap locked, answers as it does on
CPython."""

from hypothesis import given
from hypothesis import strategies as st

from host_tests.moves.upload import uploads
from host_tests.runtime.both import HERE, assert_answers, many

REPLAY = HERE / "store_replay.py"


@given(st.lists(uploads.uploads(), min_size=5, max_size=10))
@many(12)
def test_any_upload(runtime, scripts):
    assert_answers(runtime, REPLAY, scripts, uploads.expected)
