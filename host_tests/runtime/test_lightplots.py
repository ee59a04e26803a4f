"""The store of light levels and triggers as machine code on 32 bits, with the heap locked, answers
as on CPython."""

from pathlib import Path

from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

from host_tests.moves import lightplots

REPLAY = Path(__file__).parent / "lightplots_replay.py"


# Many scripts for each start of MicroPython. They are not shrunk: host_tests/moves does that, on
# CPython.
@given(st.lists(lightplots.plots(), min_size=5, max_size=10))
@settings(
    max_examples=30, deadline=None, phases=[Phase.generate], suppress_health_check=list(HealthCheck)
)
def test_any_plot(unix32f, scripts):
    script = [step for script in scripts for step in script]
    answers = unix32f.run(
        REPLAY, heap="8m", stdin="".join(line + "\n" for line, _ in script).encode()
    ).split("\n")
    assert len(answers) == len(script) + 1
    for (line, step), answer, wanted in zip(
        script, answers, lightplots.expected(script), strict=False
    ):
        assert answer == wanted, (line[:60], step[:4])


def test_a_range_longer_than_can_be_stored(unix32f):
    answers = unix32f.run(REPLAY, stdin="".join(line + "\n" for line, _ in lightplots.FAR).encode())
    assert answers.split("\n")[:-1] == [answer for _, answer in lightplots.FAR]
