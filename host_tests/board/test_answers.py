"""How soon requests get their answers while motors play, by the emulated clock, with the model of
the flash cache."""

import numpy as np
import pytest

from framestep.protocol import messages as m
from framestep_tools import payloads as p
from framestep_tools.bench import measure
from framestep_tools.bench.measure import AT_ONCE, GO_MOVES, Asker, go_times, virtual_replies
from framestep_tools.bench.moves import STEADY_RATES, STEEPEST, mixed_move
from framestep_tools.bench.session import Session
from framestep_tools.bench.stops import (
    SURVEYED_NS,
    planned_stops,
    stops_amid_requests,
    stops_beside,
    stops_in_jogs,
    stops_in_run,
    stops_in_shot,
)
from framestep_tools.judge.trace import Trace
from host_tests.board.conftest import on_both, on_pico
from host_tests.selection import sweep

WORST_MS = 3
AT_REST_MS = 1.2  # a pass is due each millisecond, but questions do not wait for it
EDGE_MS = 7  # from GO to the first edge, 3 of them until the ramp's first step
APART_NS = 1000  # between the motors' first edges
GO_MS = 4  # from GO to the motion
GO_SPREAD_MS = 0.8
STOP_MS = 2  # to the first slower tick
MOMENTS_NS = 930_000  # between two moments of a planned stop
HOME = {
    "limit": 1,
    "travel": 30_000,
    "speed": 3000,
    "slow_speed": 500,
    "back_off": 150,
    "position": 1000,
}


@pytest.fixture(scope="module")
def session(chip):
    with chip.emulated(trace=False) as board:
        session = Session(board)
        yield session
        assert not any(isinstance(event.message, p.HardStop) for event in session.client.events)


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
    session.client.request(p.MotorSetSpeed(1, 5000, 20_000))


@pytest.mark.parametrize("fps", sweep([25, 60], 60))
def test_right_after_go_and_in_play(session, fps):
    """Eight motors: the first phases are planned right after GO, frames and segments in play."""
    client = session.client
    session.prepare(mixed_move(0.8, fps), max(STEADY_RATES) * 11 // 10, fps)
    ask = Asker(client)
    client.request(p.RtGo())
    while not client.take_event(p.RtEnd):
        ask()
    client.wait_idle()
    assert len(ask.ms) > AT_ONCE + 20
    assert max(ask.ms) < WORST_MS


def test_at_the_end_of_a_run(session):
    """Without a pause: RT_END goes out, and eight motors leave for the end frame."""
    client = session.client
    session.prepare({motor: np.arange(8) * 200 for motor in range(1, 9)}, 20_000, 60)
    ask = Asker(client, at_once=2000)
    client.request(p.RtGo())
    while not client.take_event(p.RtEnd):
        ask()
    for _ in range(3 * len(ask.KINDS)):
        ask()
    client.wait_idle()
    assert len(ask.ms) > 100
    assert max(ask.ms) < WORST_MS


@pytest.mark.parametrize("again", sweep([False, True], True), ids=["first", "again"])
def test_from_go_to_the_first_edge(session, again):
    """After 300 ms in READY everything is prepared: the acknowledgement and the edges come at once,
    with all motors in step."""
    client = session.client
    board = session.board
    session.prepare({motor: np.arange(20) * 2000 for motor in range(1, 9)}, 60_000, 25)
    if again:
        client.request(p.MotorSetSpeed(1, 70_000, STEEPEST))  # drops what was planned
    client.pump(0.3)
    assert client.request(p.MotorStatus()).idle
    board.emulator.trace_start(board.pins.pins)
    begun = board.now_ns
    client.request(p.RtGo())
    acknowledged = board.now_ns
    client.wait_event(p.RtEnd, 10)
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


def test_a_stop_in_any_pass(chip):
    """Also while it reports, plans a frame of eight motors, or checks the board."""
    with chip.emulated({"clock_mhz": chip.slow_mhz}, trace=False) as board:
        velocity = max(STEADY_RATES) * 11 // 10
        times = stops_in_run(Session(board), mixed_move(), velocity, requests=(p.MotorStopAll(),))
    assert len(times) > 300
    assert max(times) < STOP_MS


def test_a_stop_amid_other_requests(chip):
    """In each moment of a pass that carries out a MOVE, a JOG, a SET_SPEED or a POSITION_FRAME, and
    behind five requests in the same packet."""
    with chip.emulated({"clock_mhz": chip.slow_mhz}, trace=False) as board:
        times = stops_amid_requests(Session(board), MOMENTS_NS)
    assert len(times) > 100
    assert max(times) < STOP_MS


@on_both
def test_a_stop_of_a_motor_beside_a_rig_that_sets_out(chip):
    """Also while its line is surveyed, for tens of milliseconds."""
    with chip.emulated({"clock_mhz": chip.slow_mhz}, trace=False) as board:
        session = Session(board)
        measure._take_arm(session)
        requests = [start for start, _ in measure._ON_LINE]
        beside = len(measure.ARM_STANDS) + 1
        times = stops_beside(session, requests, beside, SURVEYED_NS, MOMENTS_NS)
    assert len(times) > 80
    assert max(times) < STOP_MS


def test_a_stop_of_motors_beside_one_that_is_homed(chip):
    rig = {"clock_mhz": chip.slow_mhz, "limits": [{"low": 22}], "motors": [{"home": HOME}]}
    with chip.emulated(rig, trace=False) as board:
        board.wire_switches()
        times = stops_beside(Session(board), [p.Home()], 2, 10_000_000, MOMENTS_NS // 3)
    assert len(times) > 30
    assert max(times) < STOP_MS


@on_both
def test_a_stop_before_the_first_tick(chip):
    """Queues are filled in the same pass, and the stop empties them as often as it is looked for:
    of a jog far away without an end, unless something else ends that."""
    rig = {"clock_mhz": chip.slow_mhz, "limits": [{"low": 22}], "motors": [{"home": HOME}]}
    path = {motor: np.arange(200) * 10 * motor for motor in range(1, 6)}
    with chip.emulated(rig, trace=False) as board:
        board.wire_switches()
        session = Session(board)
        session.prepare(path, 20_000)
        client = session.client
        for begins in (
            p.MotorJog(1, 1000, 2**31 - 1),
            p.MotorMove(2, -(2**30)),
            p.Home(),
            p.RtPositionFrame(150),
            p.RtJogAll(24_000, 200),
        ):
            for after_ns in range(0, 5_000_000, 100_000):
                with board.undone():
                    client.send(begins)
                    board.run_until(board.now_ns + after_ns)
                    begun = board.now_ns
                    client.request(p.MotorStopAll())
                    assert board.now_ns - begun < 50_000_000, f"{begins}, {after_ns} ns"
                    client.wait_idle()


def test_a_stop_of_a_shot(chip):
    with chip.emulated({"clock_mhz": chip.slow_mhz}, trace=False) as board:
        times = stops_in_shot(Session(board), max(STEADY_RATES), (1.5,))
    assert len(times) > 300
    assert max(times) < STOP_MS


def test_a_stop_of_a_rig_on_a_line(chip):
    """Also while a knot of the line is computed, or a jog is surveyed further on."""
    with chip.emulated({"clock_mhz": chip.slow_mhz}, trace=False) as board:
        times = measure.virtual_stops(Session(board), MOMENTS_NS)
    assert len(times) > 400
    assert max(times) < STOP_MS


def test_a_stop_of_a_jog_of_all_motors(chip):
    with chip.emulated({"clock_mhz": chip.slow_mhz}, trace=False) as board:
        times = stops_in_jogs(Session(board), max(STEADY_RATES), (3,), MOMENTS_NS)
    assert len(times) > 200
    assert max(times) < STOP_MS


@pytest.mark.parametrize("motion", ["on a line", "a jog of all motors"])
def test_a_planned_stop_comes_to_rest_without_a_fault(chip, motion):
    """Also where it comes while queues are filled."""
    with chip.emulated({"clock_mhz": chip.slow_mhz}, trace=False) as board:
        session = Session(board)
        client = session.client
        if motion == "on a line":
            measure._take_arm(session)
            client.request(p.VirtJogOnLine(m.LINE_X, -8000))
            rests_s = 0.15
        else:
            session.prepare(mixed_move(), max(STEADY_RATES) * 11 // 10)
            client.request(p.RtPositionFrame(1))
            client.wait_idle()
            client.request(p.RtJogAll(24_000, 61))
            client.pump(0.6)
            rests_s = 0.9
        client.pump(0.2)
        for _ in range(60):
            with board.undone():
                client.send(p.MotorStopAll())
                client.pump(rests_s)
                assert not client.take_event(p.HardStop)
            board.run_until(board.now_ns + 2_370_000)


@on_both
def test_stops_of_jogs_on_paths_with_corners(chip):
    """Eight motors at the limits of their accelerations, so that one way to slow down after another
    is too steep: that takes longer, within a callback of the USB port."""
    frames = 120
    corners = np.random.default_rng(3).integers(-300, 300, (8, frames - 1))
    with chip.emulated({"clock_mhz": chip.slow_mhz}, trace=False) as board:
        session = Session(board)
        client = session.client
        paths = {motor: np.cumsum([0, *corners[motor - 1]]) for motor in range(1, 9)}
        session.prepare(paths, 30_000)
        for motor in range(1, 9):
            client.request(p.MotorSetSpeed(motor, 30_000, 20_000))
        client.request(p.RtPositionFrame(1))
        client.wait_idle()
        for i in range(10):
            client.request(p.RtJogAll(24_000, 1 if i % 2 else frames))
            client.pump(1.2 + 0.0131 * i)
            client.request(p.MotorStopAll())
            client.wait_idle()
            client.pump(1)  # or the next STOP_ALL is a hard one
            assert not client.take_event(p.HardStop)


@pytest.mark.parametrize(("after_s", "jerk"), [(0.1, 4000), (0.7, 400)])
def test_a_stop_within_jerk_limits(chip, after_s, jerk):
    """Eight motors that accelerate, or at full speed; two are coupled, in opposite senses."""
    rig = {"clock_mhz": chip.slow_mhz, "motors": [{"jerk": jerk}] * 8}
    moves = [p.MotorMove(motor, 30_000) for motor in range(1, 9) if motor != 4]
    with chip.emulated(rig, trace=False) as board:
        session = Session(board)
        for motor in range(1, 9):
            session.client.request(p.MotorSetSpeed(motor, 20_000, 60_000))
            session.client.request(p.MotorResetPosition(motor, 0))
        session.client.request(p.MotorConfigure(3, m.MOTOR_ENABLED | m.MOTOR_COUPLE_REVERSED))
        times = planned_stops(session, moves, after_s, MOMENTS_NS)
        assert not session.client.take_event(p.HardStop)
    assert len(times) > 200
    assert max(times) < STOP_MS


def test_a_stop_of_a_motor_that_is_homed(chip):
    rig = {"clock_mhz": chip.slow_mhz, "limits": [{"low": 22}], "motors": [{"home": HOME}]}
    with chip.emulated(rig, trace=False) as board:
        board.wire_switches()
        times = planned_stops(Session(board), [p.Home()], 0.7, MOMENTS_NS)
    assert len(times) > 200
    assert max(times) < STOP_MS


@on_both
def test_an_answer_does_not_wait_for_a_survey(chip):
    """A move of a rig that comes behind a request, in the same packet, is surveyed for tens of
    milliseconds before its own answer."""
    with chip.emulated({"clock_mhz": chip.slow_mhz}, trace=False) as board:
        session = Session(board)
        client = session.client
        measure._take_arm(session)
        (move, _), _ = measure._ON_LINE
        for after_ns in range(0, 110_000_000, 5_500_000):  # a report may be on its way
            with board.undone():
                board.run_until(board.now_ns + after_ns)
                begun = client.clock()
                ids = [client.send(request) for request in (p.MotorStopAll(), move)]
                client.answer_to(ids[0])
                assert 1000 * (client.clock() - begun) < 3 * WORST_MS
                client.answer_to(ids[1])
                assert 1000 * (client.clock() - begun) > 4 * WORST_MS


def test_passes_go_on_while_a_host_uploads_in_small_sections(session):
    """These could keep MicroPython's scheduler busy for good: no report of moving motors came, and
    after half a second they had nothing left to do."""
    measure.upload_rate(session, measure.SMALL_FRAMES, section_bytes=measure.SMALL_BYTES)


@pytest.mark.repeats
def test_while_a_rig_moves_along_lines(session):
    found = virtual_replies(session)
    assert len(found) > 2 * AT_ONCE
    assert max(found) < WORST_MS
