"""How soon requests get their answers while motors play, by the emulated clock, with the model of
the flash cache."""

import numpy as np
import pytest

from framestep_tools.bench.measure import AT_ONCE, GO_MOVES, Asker, go_times, virtual_replies
from framestep_tools.bench.moves import STEADY_RATES, STEEPEST, mixed_move
from framestep_tools.bench.session import Session
from framestep_tools.judge.trace import Trace
from framestep_tools.payloads import HardStop, MotorSetSpeed, MotorStatus, RtEnd, RtGo
from host_tests.board.chips import on_pico
from host_tests.covering import sweep

WORST_MS = 4
WORST_VIRTUAL_MS = 4
AT_REST_MS = 1.2  # a pass is due each millisecond, but questions do not wait for it
EDGE_MS = 7  # from GO to the first edge, 3 of them until the ramp's first step
APART_NS = 1000  # between the motors' first edges
GO_MS = 4  # from GO to the motion
GO_SPREAD_MS = 0.8


@pytest.fixture(scope="module")
def session(chip):
    with chip.emulated(trace=False) as board:
        session = Session(board)
        yield session
        assert not any(isinstance(event.message, HardStop) for event in session.client.events)


def test_a_question_at_rest_waits_for_no_pass(session):
    session.repl("import gc\ngc.collect()")  # holds up passes for 30 ms
    ask = Asker(session.client, at_once=0)
    for _ in range(30):
        ask()
    kinds = len(ask.KINDS)
    assert max(np.median(ask.ms[kind::kinds]) for kind in range(kinds)) < AT_REST_MS


@on_pico
def test_passes_go_on_after_half_a_turn_of_the_microseconds(session):
    """A board whose firmware starts minutes after its power-on."""
    session.repl("import time\nfrom framestep.boot import runner")
    session.repl("runner._begun_at = time.ticks_add(time.ticks_us(), 300_000_000)")
    session.client.request(MotorSetSpeed(1, 5000, 20_000))


@pytest.mark.parametrize("fps", sweep([25, 60], 60))
def test_right_after_go_and_in_play(session, fps):
    """Eight motors: the first phases are planned right after GO, frames and segments in play."""
    client = session.client
    session.prepare(mixed_move(0.8, fps), max(STEADY_RATES) * 11 // 10, fps)
    ask = Asker(client)
    client.request(RtGo())
    while not client.take_event(RtEnd):
        ask()
    client.wait_idle()
    assert len(ask.ms) > AT_ONCE + 20
    assert max(ask.ms) < WORST_MS


@pytest.mark.parametrize("again", sweep([False, True], True), ids=["first", "again"])
def test_from_go_to_the_first_edge(session, again):
    """After 300 ms in READY everything is prepared: the acknowledgement and the edges come at once,
    with all motors in step."""
    client = session.client
    board = session.board
    session.prepare({motor: np.arange(20) * 2000 for motor in range(1, 9)}, 60_000, 25)
    if again:
        client.request(MotorSetSpeed(1, 70_000, STEEPEST))  # drops what was planned
    client.pump(0.3)
    assert client.request(MotorStatus()).idle
    board.emulator.trace_start(board.pins.pins)
    begun = board.now_ns
    client.request(RtGo())
    acknowledged = board.now_ns
    client.wait_event(RtEnd, 10)
    client.wait_idle()  # on the end frame again (field note 6.11)
    trace = Trace.from_records(board.emulator.trace_stop(), board.pins)
    first = [int(trace.steps(motor)[0][0]) for motor in range(1, 9)]
    assert max(first) - min(first) < APART_NS
    assert begun < acknowledged < min(first) < begun + EDGE_MS * 1_000_000


def test_it_takes_equally_long_from_each_go_to_the_motion(session):
    """Of one to eight motors, wherever between two ticks and two passes it comes."""
    times = go_times(session, 2 * len(GO_MOVES))
    assert max(times) < GO_MS
    assert max(times) - min(times) < GO_SPREAD_MS


@pytest.mark.repeats
def test_while_a_rig_moves_along_lines(session):
    found = virtual_replies(session)
    assert len(found) > 2 * AT_ONCE
    assert max(found) < WORST_VIRTUAL_MS
