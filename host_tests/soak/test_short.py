"""The short form of `make soak`: three rounds; and faults that it has to find."""

import pytest

from host_tests.end_to_end.session import simulated
from host_tests.soak import stretch
from host_tests.soak.rounds import MOTORS, RIG, Rounds


def test_three_rounds(unix32f, tmp_path):
    found = stretch.play(unix32f, 0, 1, tmp_path / "soak.recording")
    assert not found.wrong, found.wrong
    assert (found.rounds, len(found.heap)) == (3, 3)
    assert found.motions >= 45


def test_a_lost_edge_is_found():
    session = simulated(RIG, MOTORS)
    rounds = Rounds(session, 1)
    edges = session.board.edges
    lost = []

    def without_one():
        found = edges()
        step = next((edge for edge in found if edge[1] == "m2"), None)
        if step and not lost:
            lost.append(step)
            found.remove(step)
        return found

    session.board.edges = without_one
    with pytest.raises(AssertionError, match="by the edges"):
        rounds.round()
    assert lost


@pytest.mark.parametrize(
    ("heap", "flat"),
    [
        ([7000, 7080, 7064], True),
        ([7000, 7160, 7320], False),
        ([7000, 7016 + 256, 7000], False),
        ([7000, 7000], False),  # too few to tell
    ],
)
def test_a_heap_that_grows_is_told(heap, flat):
    assert (stretch._growth(heap) == "") is flat


def test_what_another_runtime_does_otherwise_is_told():
    assert stretch._difference(["1 <44", "2 <46"], ["1 <44", "2 <46"]) == ""
    assert "line 1" in stretch._difference(["1 <44", "2 <46"], ["1 <44", "2 <47"])
    assert "line 1" in stretch._difference(["1 <44", "2 <46"], ["1 <44"])


def test_the_counters_wrap_inside_the_run():
    assert stretch._inside((0.1, 3.6)) == 2048
    assert stretch._inside((2.1, 5.6)) == 4096
    with pytest.raises(AssertionError, match="no such moment"):
        stretch._inside((0.1, 2.2))
