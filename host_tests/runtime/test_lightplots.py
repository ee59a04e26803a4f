"""The store of light levels and triggers as machine code on 32 bits, with the heap locked, answers
as on CPython."""

from hypothesis import given
from hypothesis import strategies as st

from host_tests.moves.upload import lightplots
from host_tests.runtime.both import HERE, many

REPLAY = HERE / "lightplots_replay.py"


@given(st.lists(lightplots.plots(), min_size=5, max_size=10))
@many(30)
def test_any_plot(runtime, scripts):
    script = [step for script in runtime.share(scripts) for step in script]
    lines = "".join(line + "\n" for line, _ in script)
    answers = runtime.run(REPLAY, heap="8m", stdin=lines.encode()).split("\n")[:-1]
    wanted = lightplots.expected(script, answers)
    for (line, step), answer, want in zip(script, answers, wanted, strict=True):
        assert answer == want, (line[:60], step[:4])


def test_a_range_longer_than_can_be_stored(runtime):
    answers = runtime.run(REPLAY, stdin="".join(line + "\n" for line, _ in lightplots.FAR).encode())
    assert answers.split("\n")[:-1] == [answer for _, answer in lightplots.FAR]


def test_a_section_that_fills_the_largest_frame(runtime):
    lines = "".join(line + "\n" for line, _ in lightplots.FULL)
    answers = runtime.run(REPLAY, heap="8m", stdin=lines.encode()).split("\n")[:-1]
    assert answers == list(lightplots.expected(lightplots.FULL, answers))
