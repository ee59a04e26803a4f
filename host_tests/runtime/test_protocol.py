"""The protocol as machine code on 32 bits, with the heap locked, answers as it does on CPython."""

import random
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


SUMS = Path(__file__).parent / "checksums.py"


def test_checksum(runtime):
    for data in (
        b"\xff" * 1100,
        bytes(1100),
        random.Random(1).randbytes(1100),
        b"\xff\0" * 550,
        b"\0\xff" * 550,
    ):
        expected = [
            streams.fletcher(data[start : start + count])
            for start in range(9)
            for count in [*range(70), 255, 256, 257, 271, 272, 511, 512, 513, 1030, 1045, 1046]
        ]
        assert (
            list(map(int, runtime.run(SUMS, stdin=data.hex().encode() + b"\n").split())) == expected
        )


CHECK = Path(__file__).parent / "check_bytes.py"


def test_check_bytes(runtime):
    assert runtime.run(CHECK) == "0\n"


COPIES = Path(__file__).parent / "copies.py"


def test_copies(runtime):
    """Copies from and to any place in a word, and within one buffer."""
    assert runtime.run(COPIES) == "0\n"
