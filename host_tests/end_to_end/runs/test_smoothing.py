"""Setting `smoothing`: the uploaded steps at each frame's time, and less ripple between them."""

import itertools

import numpy as np
import pytest

from framestep_tools import payloads as p
from framestep_tools.bench.moves import RIPPLE_FRAMES, ripple_paths
from framestep_tools.judge.judge import frame_times_ns
from framestep_tools.judge.ripple import Ripple, origins_ns, ripple
from host_tests.end_to_end.session import run_request, simulated

pytestmark = pytest.mark.needs("short pulses")


def prepared(upload, fps=24, first=1, last=None, rig=None, roll_ms=500):
    """Return a session in which a run of an upload waits for GO."""
    session = simulated(rig)
    for motor in upload:
        session.speed(motor, 400_000, 2_000_000)
    session.upload(upload)
    last = last or len(upload[1])
    return session.ready(run_request(fps, first, last, roll_ms, roll_ms))


def played(session):
    """Return (trace, positions before it)."""
    start = session.positions
    session.forget().accept(p.RtGo()).until(p.RtEnd, 60)
    trace = session.trace()
    session.wait_idle()
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
        session = prepared(upload, fps, rig={"smoothing": smoothing})
        trace, start = played(session)
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
        assert session.positions == session.positions | {m: path[-1] for m, path in upload.items()}
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


def played_by_frame(upload, first, last):
    """Play a part of a move. Return {motor: its edges between frames}."""
    trace, start = played(prepared(upload, first=first, last=last))
    step = 1 if last > first else -1
    index = range(first - 1, last - 1 + step, step)
    origin = common_origin(trace, start, upload, 24, index)
    return {motor: edges_by_frame(trace, motor, origin, 24, len(index)) for motor in upload}


def test_a_section_is_passed_as_the_whole_is():
    upload = rounded(ripple_paths(), 60)
    whole, part = played_by_frame(upload, 1, 60), played_by_frame(upload, 21, 40)
    for motor in upload:
        for (found, ways), (times, same) in zip(part[motor], whole[motor][20:39], strict=True):
            assert ways == same
            assert found == pytest.approx(times, abs=30)


def test_backward_is_the_mirror_image():
    upload = rounded(ripple_paths(), 60)
    there, back = played_by_frame(upload, 1, 60), played_by_frame(upload, 60, 1)
    frame_us = 1e6 / 24
    for motor in upload:
        forward, backward = there[motor], back[motor][::-1]
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
    session = prepared(HARD, 24, order[0] + 1, order[-1] + 1, rig=rig)
    trace, start = played(session)
    if not backlash:
        origin = common_origin(trace, start, HARD, 24, order)
        for motor, steps in HARD.items():
            for k, (_, ways) in enumerate(edges_by_frame(trace, motor, origin, 24, 24)):
                step = steps[order[k + 1]] - steps[order[k]]
                if motor != 3:
                    assert ways == [np.sign(step)] * abs(step)
    assert session.positions == session.positions | {m: HARD[m][order[-1]] for m in HARD}


@pytest.mark.parametrize("reach, period", [(300, 46), (400, 12), (3000, 40), (90, 9)])
def test_a_motor_at_its_limits_is_not_driven_beyond_them(reach, period):
    steps = np.rint(reach * np.sin(np.arange(60) * 2 * np.pi / period)).astype(int).tolist()
    last = period * (59 // period)
    session = prepared({1: steps}, last=last + 1, roll_ms=20)
    trace, start = played(session.accept(p.MotorSetLimits(1, 1, min(steps), 1, max(steps))))
    at = start[1] + np.cumsum(trace.steps(1)[1])
    assert (at.min(), at.max()) == (min(steps), max(steps))
    common_origin(trace, start, {1: steps}, 24, range(last + 1))
