"""The upload store as machine code on 32 bits, with the heap locked, answers as it does on
CPython."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from host_tests.moves.upload import uploads
from host_tests.runtime.both import HERE, assert_answers, many

REPLAY = HERE / "store_replay.py"


@given(st.lists(uploads.uploads(), min_size=5, max_size=10))
@many(12)
def test_any_upload(runtime, scripts):
    assert_answers(runtime, REPLAY, scripts, uploads.expected)


def test_a_change_that_needs_more_bits_wherever_it_is(runtime):
    """Changes are examined in groups of four."""
    lines = ["NEW 4 20000", f"BEGIN 0 {uploads.FRAMES - 1}"]
    for place in range(4):
        changes = np.where(np.arange(uploads.FRAMES) % 4 == place, 150, 0)
        lines.append(uploads.axis(place + 1, 0, 1, np.cumsum(np.cumsum(changes)).tolist()))
    lines += ["FINISH", "READ 0 0"]
    answers = runtime.run(REPLAY, stdin="".join(line + "\n" for line in lines).encode())
    assert answers.splitlines() == uploads.answers(*lines)
