"""The protocol as machine code on 32 bits, with the heap locked, answers as it does on CPython."""

from pathlib import Path

from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

from host_tests.protocol import streams

ECHO = Path(__file__).parent / "frames_echo.py"


# Many cases with each start of MicroPython. They are not shrunk: host_tests/protocol does that on
# CPython.
@given(st.lists(streams.cases(), min_size=20, max_size=40))
@settings(
    max_examples=8, deadline=None, phases=[Phase.generate], suppress_health_check=list(HealthCheck)
)
def test_any_stream_in_any_pieces(runtime, cases):
    cases = runtime.share(cases)
    answers = runtime.run(ECHO, stdin="".join(case.line() for case in cases).encode()).split("\n")
    for case, answer in zip(cases, answers, strict=False):
        assert answer == streams.expected(case).hex(), case
    assert len(answers) == len(cases) + 1
