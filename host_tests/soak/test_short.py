"""The short form of `make soak`: three rounds; and faults that it has to find."""

from dataclasses import replace

import pytest

from host_tests.end_to_end.session import simulated
from host_tests.recording import REPLAY
from host_tests.soak import on_board, stretch
from host_tests.soak.rounds import MOTORS, RIG, Rounds


@pytest.fixture(scope="module")
def recorded():
    return stretch.record(0, 1)


def test_three_rounds(recorded, unix32f, tmp_path):
    found = replace(recorded[0])
    stretch.replay(unix32f, found, *recorded[1:], tmp_path / "soak.recording")
    assert not found.wrong, found.wrong
    assert (found.rounds, len(found.heap)) == (3, 3)
    assert found.motions >= 45


def test_a_leak_of_16_bytes_a_round_is_found(recorded, unix32f, tmp_path):
    """The least that the heap gives, kept at every second opening of the port, of which a round has
    two."""
    opened = "            hal.port.openings += 1\n"
    source = REPLAY.read_text()
    assert source.count(opened) == 1
    leak = opened + (
        "            if hal.port.openings & 1:\n"
        "                hal.kept = (getattr(hal, 'kept', None),)\n"
    )
    script = tmp_path / "leaks.py"
    script.write_text(source.replace(opened, leak))
    found = replace(recorded[0])
    stretch.replay(unix32f, found, *recorded[1:], tmp_path / "soak.recording", script)
    first, second, third = found.heap
    assert (second - first, third - second) == (16, 16)
    assert "the heap is not as full" in found.wrong


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
        ([7000, 7000, 7000], True),
        ([7000, 7016, 7032], False),
        ([7000, 7000, 7016], False),
        ([7000, 7016, 7000], False),
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


def test_a_late_tick_is_told():
    """And a figure that says nothing, as no motor has moved."""
    assert on_board.late(136) == ""
    assert f"was {on_board.LATE_US + 1} µs late" in on_board.late(on_board.LATE_US + 1)
    assert on_board.late(0)
