"""Lights, inputs, outputs and stop inputs as machine code on 32 bits, with the heap locked, behave
as on CPython."""

import contextlib
import io
import sys
from pathlib import Path
from unittest import mock

from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

from host_tests.runtime import io_replay

REPLAY = Path(__file__).parent / "io_replay.py"
INPUT_PINS = (28, 4, 27, 10, 11, 12, 13, 19)
STEPS = st.one_of(
    st.tuples(st.just("poll"), st.integers(1, 60), st.just(0)),
    st.tuples(st.just("poll"), st.integers(1, 3), st.just(0)),
    st.tuples(st.just("pin"), st.sampled_from(INPUT_PINS), st.integers(0, 1)),
    st.tuples(st.just("pin"), st.sampled_from(INPUT_PINS), st.integers(0, 1)),
    st.tuples(st.just("clock"), st.integers(2**30 - 600, 2**30 - 1), st.just(0)),
    st.tuples(st.just("data"), st.integers(0, 255), st.integers(0, 255)),
    st.tuples(st.just("light"), st.integers(1, 512), st.integers(0, 255)),
    st.integers(1, 512).flatmap(
        lambda first: st.tuples(
            st.sampled_from(("lights", "ramp")), st.just(first), st.integers(0, 513 - first)
        )
    ),
    st.tuples(
        st.sampled_from(("put", "cue")), st.integers(0, 2**30 - 1), st.integers(0, 2**30 - 1)
    ),
    st.tuples(st.just("safe"), st.just(0), st.just(0)),
    st.tuples(st.just("camera"), st.integers(0, 1), st.integers(0, 1)),
    st.tuples(st.just("assign"), st.integers(0, 7), st.sampled_from((0, 1, 2, 0x81, 0x82))),
    st.tuples(st.just("moves"), st.integers(0, 7), st.integers(-(2**31), 2**31 - 1)),
    st.tuples(st.just("stands"), st.integers(0, 7), st.integers(-(2**31), 2**31 - 1)),
    st.tuples(st.just("target"), st.just(0), st.integers(-(2**31), 2**31 - 1)),
    st.tuples(st.just("bars"), st.integers(0, 7), st.just(0)),
)


def on_cpython(text):
    out = io.StringIO()
    with mock.patch.object(sys, "stdin", io.StringIO(text)), contextlib.redirect_stdout(out):
        io_replay.main()
    return out.getvalue()


@given(st.lists(STEPS, min_size=200, max_size=300))
@settings(
    max_examples=8, deadline=None, phases=[Phase.generate], suppress_health_check=list(HealthCheck)
)
def test_any_operations(runtime, steps):
    steps = runtime.share(steps)
    text = "".join(f"{kind} {a} {b}\n" for kind, a, b in steps)
    answers = runtime.run(REPLAY, stdin=text.encode()).split("\n")
    expected = on_cpython(text).split("\n")
    assert len(answers) == len(expected)
    wrong = [pair for pair in zip(answers, expected, strict=True) if pair[0] != pair[1]]
    assert not wrong, wrong[0]
