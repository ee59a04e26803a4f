"""LOAD: how busy the board has been (field note 4.10). Shares of the time are measured on the
emulated board, board/test_repl.py."""

import pytest

from framestep.protocol.messages import CONDITION_LOAD
from framestep.pulse.stepper import UNSTRAINED
from framestep_tools.payloads import GetCondition, GetLoad, MotorMove
from host_tests.end_to_end.session import simulated


def strained(session):
    return session.ask(GetCondition()).bits & CONDITION_LOAD != 0


def test_at_rest():
    session = simulated({})
    session.ask(GetLoad())
    session.run(0.5)
    load = session.ask(GetLoad())
    assert load.ms == pytest.approx(500, abs=5)
    assert load.late_us < 100 < load.latest_us
    assert load.queued_ms == UNSTRAINED
    assert not strained(session)


@pytest.mark.needs("inside")
@pytest.mark.inside
@pytest.mark.parametrize("left, warned", [(40, False), (8, True)])
def test_little_queued_is_a_warning_until_it_has_been_asked_for(left, warned):
    """The main loop comes back to a moving motor that has `left` milliseconds queued."""
    session = simulated({})
    session.accept(MotorMove(1, 100_000)).run(0.5)
    board = session.board._board
    kernel = board.controller.axes.kernel
    block = kernel.blocks[0]
    from framestep.motors.queue_cut import queued

    while queued(block, 1, 1000) > left:
        board.hal.now_ns += 1_000_000
        board.hal.tick()
    session.run(0.1)
    assert strained(session) == warned
    load = session.ask(GetLoad())
    assert left - 10 <= load.queued_ms <= left
    assert not strained(session)
    assert session.ask(GetLoad()).queued_ms == UNSTRAINED
    session.wait_idle()
