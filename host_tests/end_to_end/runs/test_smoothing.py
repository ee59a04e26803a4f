"""Setting `smoothing`: the uploaded steps at each frame's time, and less ripple between them."""

import itertools

import numpy as np
import pytest

from framestep_tools import payloads as p
from framestep_tools.bench.moves import RIPPLE_FRAMES, ripple_paths
from framestep_tools.client.client import Client
from framestep_tools.judge.judge import frame_times_ns
from framestep_tools.judge.ripple import Ripple, origins_ns, ripple
from framestep_tools.judge.trace import Trace
from framestep_tools.simulator.boards import LockstepPort, SimulatedBoard

pytestmark = pytest.mark.needs("short pulses")


def prepared(upload, fps, first=None, last=None, rig=None, flags=0, velocity=400_000, roll_ms=500):
    board = SimulatedBoard({"smoothing": True, **(rig or {})})
    client = Client(LockstepPort(board))
    for motor in upload:
        client.request(p.MotorSetSpeed(motor, velocity, 2_000_000))
    count = len(next(iter(upload.values())))
    client.upload_move(1, count, upload)
    first = 1 if first is None else first
    last = count if last is None else last
    client.request(p.RtRunMove(round(1000 * fps), first, last, roll_ms, roll_ms, flags=flags))
    client.wait_idle()
    return board, client


def positions(client):
    return dict(enumerate(client.request(p.MotorGetPosition()).steps, 1))


def played(board, client, seconds=60):
    """Return (trace, positions before it)."""
    start = positions(client)
    board.edges()
    client.request(p.RtGo())
    client.wait_event(p.RtEnd, seconds)
    trace = Trace.from_edges(board.edges())
    client.wait_idle()
    return trace, start


def common_origin(trace, start, upload, fps, index):
    """Return the one time of the first frame, ns, with all motors on their uploaded positions.

    index: the frames in the order of play.
    """
    due = frame_times_ns(len(index), round(1000 * fps))
    low, high = -(1 << 62), 1 << 62
    for motor, steps in upload.items():
        times, ways = trace.steps(motor)
        spans = origins_ns(times, ways, start[motor], [steps[i] for i in index], due)
        fitting = [(max(low, a), min(high, b)) for a, b in spans if max(low, a) < min(high, b)]
        assert fitting, f"motor {motor} is beside a position at a frame's time"
        low, high = fitting[0] if len(fitting) == 1 else (low, high)
    assert high - low < 1_000_000
    return (low + high) // 2


def rounded(paths, frames=RIPPLE_FRAMES):
    return {
        motor: np.rint(path(np.arange(frames))).astype(int).tolist()
        for motor, path in paths.items()
    }


@pytest.mark.parametrize("fps", [12, 24, 60])
def test_the_uploaded_positions_at_each_frame_and_less_ripple(fps):
    paths = ripple_paths()
    upload = rounded(paths)
    due = frame_times_ns(RIPPLE_FRAMES, 1000 * fps)
    found = {}
    for smoothing in (False, True):
        board, client = prepared(upload, fps, rig={"smoothing": smoothing})
        trace, start = played(board, client)
        if smoothing:
            origin = common_origin(trace, start, upload, fps, range(RIPPLE_FRAMES))
        sums = Ripple()
        for motor, path in paths.items():
            times, ways = trace.steps(motor)
            if not smoothing:  # the fastest motor's edge onto the second frame's position
                fast = max(upload, key=lambda m: abs(upload[m][9] - upload[m][8]))
                edges, turns = trace.steps(fast)
                at = start[fast] + np.cumsum(turns)
                origin = edges[np.flatnonzero(at == upload[fast][8])[0]] - due[8]
            sums += ripple(
                (times - origin) * fps / 1e9, ways, start[motor], path, RIPPLE_FRAMES - 1
            )
        found[smoothing] = sums
        assert positions(client) == {
            **positions(client),
            **{m: path[-1] for m, path in upload.items()},
        }
    assert found[True].velocity_rms < 0.25 * found[False].velocity_rms
    assert found[True].acceleration_rms < 0.15 * found[False].acceleration_rms


def edges_by_frame(trace, motor, origin, fps, frames):
    """Return the motor's edges between frames, µs after the frame before them."""
    times, ways = trace.steps(motor)
    due = frame_times_ns(frames, round(1000 * fps))
    at = times - origin
    return [
        (
            ((at[(at >= a) & (at < b)] - a) / 1000).round(1).tolist(),
            ways[(at >= a) & (at < b)].tolist(),
        )
        for a, b in itertools.pairwise(due)
    ]


def test_a_section_is_passed_as_the_whole_is():
    upload = rounded(ripple_paths(), 60)
    board, client = prepared(upload, 24)
    trace, start = played(board, client)
    whole = common_origin(trace, start, upload, 24, range(60))
    board, client = prepared(upload, 24, 21, 40)
    part, begin = played(board, client)
    origin = common_origin(part, begin, upload, 24, range(20, 40))
    for motor in upload:
        expected = edges_by_frame(trace, motor, whole, 24, 60)[20:39]
        for (found, ways), (times, same) in zip(
            edges_by_frame(part, motor, origin, 24, 20), expected, strict=True
        ):
            assert ways == same
            assert found == pytest.approx(times, abs=30)


def test_backward_is_the_mirror_image():
    upload = rounded(ripple_paths(), 60)
    board, client = prepared(upload, 24)
    trace, start = played(board, client)
    origin = common_origin(trace, start, upload, 24, range(60))
    board, client = prepared(upload, 24, 60, 1)
    back, begin = played(board, client)
    other = common_origin(back, begin, upload, 24, range(59, -1, -1))
    frame_us = 1e6 / 24
    for motor in upload:
        forward = edges_by_frame(trace, motor, origin, 24, 60)
        backward = edges_by_frame(back, motor, other, 24, 60)[::-1]
        changes = np.diff(upload[motor])
        compared = 0
        for k in range(1, 58):
            (times, ways), (found, same) = forward[k], backward[k]
            assert [-way for way in reversed(ways)] == same
            if all(changes[k - 1 : k + 2] > 0) or all(changes[k - 1 : k + 2] < 0):
                compared += len(ways)
                assert found == pytest.approx([frame_us - t for t in reversed(times)], abs=60)
        assert compared > 50 or motor == 1


HARD = {
    1: [0, 0, 0, 0, 0, 0, 0, 0, 0, 40, 80, 120, 120, 120, 120, 120, 120, 120, 120, 60, 0, 0, 0, 0],
    2: [0, 1, 0, 1, 0, 1, 1, 0, 0, 1, 1, 1, 0, 0, 0, 0, 1, 1, 1, 1, 0, 0, 0, 0],
    3: [0, 9, 19, 27, 30, 29, 22, 12, 1, -9, -17, -20, -17, -9, 0, 9, 17, 20, 17, 9, 0, -9, -17, 0],
    4: [0, 0, 1, 1, 1, 2, 2, 3, 3, 3, 2, 2, 1, 1, 1, 0, 0, -1, -1, -2, -3, -5, -8, -13],
}


@pytest.mark.parametrize("backlash", [0, 7])
@pytest.mark.parametrize("backward", [False, True])
def test_turns_corners_and_holds(backward, backlash):
    """Smoothing adds no step: a hold has no edge, and between frames steps go one way if the path
    does."""
    rig = {"motors": [{"backlash": backlash}] * 4}
    order = list(range(24))[:: -1 if backward else 1]
    board, client = prepared(HARD, 24, order[0] + 1, order[-1] + 1, rig=rig)
    trace, start = played(board, client)
    if not backlash:
        origin = common_origin(trace, start, HARD, 24, order)
        for motor, steps in HARD.items():
            for k, (_, ways) in enumerate(edges_by_frame(trace, motor, origin, 24, 24)):
                step = steps[order[k + 1]] - steps[order[k]]
                if motor != 3:
                    assert ways == [np.sign(step)] * abs(step)
    assert {m: positions(client)[m] for m in HARD} == {m: HARD[m][order[-1]] for m in HARD}


def test_loops_come_to_where_they_begin():
    upload = rounded(ripple_paths(), 30)
    _, client = prepared(upload, 24, flags=2)
    start = positions(client)
    client.request(p.RtGo())
    client.pump(12)
    client.request(p.RtStopLoop())
    client.wait_event(p.RtEnd, 60)
    client.wait_idle()
    found = positions(client)
    assert all(found[motor] in (upload[motor][0], upload[motor][-1]) for motor in upload)
    assert start.keys() == found.keys()


@pytest.mark.parametrize("reach, period", [(300, 46), (400, 12), (3000, 40), (90, 9)])
def test_a_motor_at_its_limits_is_not_driven_beyond_them(reach, period):
    steps = np.rint(reach * np.sin(np.arange(60) * 2 * np.pi / period)).astype(int).tolist()
    last = period * (59 // period)
    board, client = prepared({1: steps}, 24, 1, last + 1, roll_ms=20)
    client.request(p.MotorSetLimits(1, 1, min(steps), 1, max(steps)))
    trace, start = played(board, client)
    at = start[1] + np.cumsum(trace.steps(1)[1])
    assert (at.min(), at.max()) == (min(steps), max(steps))
    common_origin(trace, start, {1: steps}, 24, range(last + 1))


def turning(frames):
    """Return a move of slow and fast motors that turn often, and one motor that marks each
    frame."""
    x = np.arange(frames)
    swings = [(31, 14.3, 2.4), (50.5, 6.02, 1.1), (36, 11.7, 4.7), (3.2, 38, 0.3), (57, 22.1, 3.2)]
    upload = {
        motor: np.rint(reach * np.sin(2 * np.pi * x / period + phase)).astype(int)
        for motor, (reach, period, phase) in enumerate(swings, 1)
    }
    # some frames' positions are wrong by one, as by rounding
    upload[6] = np.cumsum(np.random.default_rng(5).choice([-1, 0, 0, 0, 1, 1], frames))
    return upload | {8: 400 * x}


def cornered(frames):
    """Motors that go a step or none from frame to frame, and now and then up to 45 at once."""
    random = np.random.default_rng(1)
    upload = {}
    for motor in range(1, 8):
        steps = random.choice([-2, -1, 0, 0, 0, 1, 2], frames)
        jumps = random.random(frames) < 0.12
        steps[jumps] = random.integers(-45, 46, jumps.sum())
        upload[motor] = np.cumsum(steps)
    return upload | {8: 400 * np.arange(frames)}


@pytest.mark.parametrize("smoothing", [False, True])
@pytest.mark.parametrize(
    ("fps", "moves"),
    [(13.7, turning), (23.976, turning), (24, turning), (59.94, turning), (132, cornered)],
)
def test_the_count_of_steps_at_each_frame(smoothing, fps, moves):
    """Exactly the uploaded one: a step that leads there has come by then, within two microseconds,
    and none that leads away, also where the frame lies within a tick and the motor turns, or
    starts with four million steps/s²."""
    upload = moves(160)
    due = frame_times_ns(160, round(1000 * fps))
    board, client = prepared(upload, fps, rig={"smoothing": smoothing})
    trace, start = played(board, client)
    times, ways = trace.steps(8)
    at = start[8] + np.cumsum(ways)
    origin = np.median([times[np.argmax(at == upload[8][k])] - due[k] for k in range(2, 159)])
    if smoothing:  # the path passes a frame half a step beyond the position
        origin += 0.5e9 / fps / 400
    for motor, steps in upload.items():
        times, ways = trace.steps(motor)
        counts = start[motor] + np.concatenate(([0], np.cumsum(ways)))
        for k in range(1, 159):
            early, late = (
                counts[np.searchsorted(times, origin + due[k] + off)] for off in (-2000, 2000)
            )
            assert min(early, late) <= steps[k] <= max(early, late), (
                motor,
                k,
                steps[k - 3 : k + 4],
            )
