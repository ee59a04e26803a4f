"""How soon requests are answered while motors play, by the emulated clock, with the model of the flash cache."""

import pytest

from framestep_tools import bench
from framestep_tools.boards import EmulatedBoard
from framestep_tools.payloads import HardStop, RtEnd, RtGo

WORST_MS = 10  # design.md's goal
WORST_VIRTUAL_MS = 15


@pytest.fixture(scope="module")
def session():
    with EmulatedBoard(trace=False, frozen=True) as board:
        session = bench.Session(board)
        yield session
        assert not any(isinstance(event.message, HardStop) for event in session.client.events)


@pytest.mark.parametrize("fps", [25, 60])
def test_right_after_go_and_in_play(session, fps):
    """Eight motors: the first phases are planned right after GO, frames and segments in play."""
    client = session.client
    session.prepare(bench.mixed_move(0.8, fps), max(bench.STEADY_RATES) * 11 // 10, fps)
    ask = bench.Asker(client)
    client.request(RtGo())
    while not client.take_event(RtEnd):
        ask()
    client.wait_idle()
    assert len(ask.ms) > bench.AT_ONCE + 20
    assert max(ask.ms) < WORST_MS


def test_while_a_rig_moves_along_lines(session):
    found = bench.virtual_replies(session)
    assert len(found) > 2 * bench.AT_ONCE
    assert max(found) < WORST_VIRTUAL_MS
