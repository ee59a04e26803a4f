"""The upload store as machine code on 32 bits, with the heap locked, answers as it does on
CPython."""

from pathlib import Path

from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

from host_tests.moves import uploads

REPLAY = Path(__file__).parent / "store_replay.py"


# Many uploads for each start of MicroPython. They are not shrunk: host_tests/moves does that, on
# CPython.
@given(st.lists(uploads.uploads(), min_size=5, max_size=10))
@settings(
    max_examples=12, deadline=None, phases=[Phase.generate], suppress_health_check=list(HealthCheck)
)
def test_any_upload(unix32f, scripts):
    script = [step for script in scripts for step in script]
    answers = unix32f.run(
        REPLAY, heap="8m", stdin="".join(line + "\n" for line, _ in script).encode()
    ).split("\n")
    assert len(answers) == len(script) + 1
    for (line, step), answer, wanted in zip(
        script, answers, uploads.expected(script), strict=False
    ):
        assert answer == wanted, (line[:60], step[:4])
