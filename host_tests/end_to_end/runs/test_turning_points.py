"""Turning points of an uploaded move: the motor makes the last step to them, at the frame's time,
and the step back. In slow moves rounding decides: a motor that turns on a step may end a unit of
the kernel's numbers before it.
"""

import numpy as np
import pytest

from framestep_tools.judge.judge import frame_times_ns
from framestep_tools.judge.ripple import origins_ns
from framestep_tools.payloads import MotorConfigure, Positions, RtGo
from host_tests.end_to_end.session import run_request, simulated
from host_tests.selection import sweep

pytestmark = pytest.mark.needs("short pulses")

SLACK_NS = 30_000


def played(positions, fps, flags=1, motor=1):
    """Return where the motor waits, and the times (s) and directions of its steps."""
    session = simulated()
    session.speed(1, 200_000, 4_000_000).speed(2, 200_000, 4_000_000)
    session.accept(MotorConfigure(1, flags))
    session.upload({1: positions})
    frames = len(positions)
    session.accept(run_request(fps=fps, end=frames, pre=500, post=500)).wait_idle()
    before = session.positions[motor]
    session.forget().accept(RtGo()).run(1.3 + frames / fps)
    times, signs = session.steps(motor)
    return before, times, signs


def on_every_frame(positions, fps, before, times, signs):
    """Return whether the motor is on each frame's position at its time, with one origin of time."""
    due = frame_times_ns(len(positions), round(1000 * fps))
    times = np.rint(times * 1e9).astype(int)
    return bool(origins_ns(times, signs, before, positions, due, SLACK_NS))


@pytest.mark.parametrize("fps", [24, 23.976, 60, 25])
@pytest.mark.parametrize("peak", [1, 5, 100, 300])
@pytest.mark.parametrize("lean", [0, 1])
def test_a_peak_is_reached(fps, peak, lean):
    """Up and down, the turning frame is the highest step, or the lowest."""
    up = [*range(0, peak, max(1, peak // 5)), peak]
    down = [max(0, step - lean) for step in up[-2::-1]]
    positions = [0, *up, *down, *[-step for step in up[1:]], *[-step for step in down], 0]
    before, times, signs = played(positions, fps)
    made = np.cumsum(signs) + before
    assert made.max() == max(positions)
    assert made.min() == min(positions)
    assert on_every_frame(positions, fps, before, times, signs)


@pytest.mark.parametrize("seed", range(4))
def test_any_zigzag(seed):
    rng = np.random.default_rng(seed)
    positions = np.concatenate(([0], np.cumsum(rng.integers(-60, 61, 60)))).tolist()
    before, times, signs = played(positions, 24)
    assert on_every_frame(positions, 24, before, times, signs)


@pytest.mark.parametrize("flag, sense", [(0x10, 1), (0x20, -1)])
def test_coupled_motors_turn_together(flag, sense):
    positions = [0, 0, 40, 80, 100, 80, 40, 0, -40, -41, -40, 0, 0]
    before, times, signs = played(positions, 24, 1 | flag, motor=2)
    assert on_every_frame(sense * np.array(positions), 24, before, times, signs)


# rates of cameras and projectors, slow ones, and some at which frames end within a tick
RATES = [0.5, 1, 5, 8, 10, 12, 12.5, 15, 15.687, 16, 18, 20, 23.976, 24, 25, 29.97, 30, 40, 47.952]
RATES += [48, 50, 59.94, 60, 100, 120, 125, 150, 200]
LATE_NS = 2000


def assert_on_every_frame(upload, fps, rig=None, velocity=400_000, acceleration=2_000_000):
    """Play a move: all motors have made the uploaded steps at each frame's time, by one clock, and
    each frame's message says them. Return the number of frames."""
    session = simulated(rig)
    frames = len(upload[1])
    for motor in upload:
        session.speed(motor, velocity, acceleration)
    session.upload(upload)
    session.client.events.clear()
    before = session.play(run_request(fps=fps, end=frames), 60 + 2 * frames / fps)
    due = frame_times_ns(frames, round(1000 * fps))
    clock = [(-(1 << 62), 1 << 62)]
    for motor, steps in upload.items():
        times, signs = session.trace().steps(motor)
        spans = origins_ns(times, signs, before[motor], steps, due, LATE_NS)
        clock = [
            (max(a, c), min(b, d)) for a, b in clock for c, d in spans if max(a, c) < min(b, d)
        ]
        assert clock, f"at {fps} frames/s motor {motor} is beside a frame of {steps}"
    told = {
        message.move_time // 1000: message.steps
        for _, message in session.events(Positions)
        if message.move_time % 1000 == 0
    }
    for frame in range(2, frames):
        for motor, steps in upload.items() if frame in told else ():
            assert told[frame][motor - 1] == steps[frame - 1], (frame, motor)
    assert len(told) > frames // 2 or fps > 24
    return frames * len(upload)


@pytest.mark.parametrize("smoothing", [True, False])
@pytest.mark.parametrize(
    "positions, fps",
    [
        ([1, 0, 2, 0], 16),
        ([0, -1, 0, -1, 0, -1], 16),
        ([8, 9, 10, 9, 8, 9, 10, 9, 10, 9], 24),
        ([2519, 2556, 2563, 2556], 15.687),
    ],
)
def test_a_slow_peak_is_reached(positions, fps, smoothing):
    up = {1: positions, 2: [-step for step in positions]}
    marks = {8: [400 * frame for frame in range(len(positions))]}
    rig = {"smoothing": smoothing}
    for before in range(3):  # with another share of a tick at the frame
        lead = [positions[0]] * before
        longer = {
            motor: [*(lead if motor == 1 else [-x for x in lead]), *p] for motor, p in up.items()
        }
        longer[8] = [400 * frame for frame in range(before)] + [400 * before + m for m in marks[8]]
        assert_on_every_frame(longer, fps, rig, 10_000, 60_000)


def walks(rng, frames):
    """Return slow random moves of seven motors, and of one that marks the frames."""
    kinds = [
        lambda: np.cumsum(rng.integers(-2, 3, frames)),
        lambda: np.cumsum(rng.integers(-1, 2, frames)),
        lambda: np.cumsum(rng.integers(-5, 6, frames)),
        lambda: np.cumsum(rng.choice([-1, 0, 0, 0, 0, 1], frames)),
        lambda: np.cumsum(rng.integers(-2, 3, frames)) + np.arange(frames),
        lambda: np.rint(rng.uniform(1, 6) * np.sin(np.arange(frames) / rng.uniform(2, 30))),
    ]
    moves = {motor: kinds[rng.integers(len(kinds))]() for motor in range(1, 8)}
    return {m: p.astype(int).tolist() for m, p in moves.items()} | {
        8: [400 * frame for frame in range(frames)]
    }


@pytest.mark.needs("120 frames/s", only=("120-True", "125-True", "150", "200"))
@pytest.mark.needs("150 frames/s", only=("150-True", "200"))
@pytest.mark.parametrize("smoothing", [True, False])
@pytest.mark.parametrize("fps", sweep(RATES, 1, 12, 15.687, 16, 23.976, 24, 25, 60, 125, 200))
def test_slow_random_walks(fps, smoothing):
    """All rates together: a hundred thousand frames."""
    rng = np.random.default_rng(round(1000 * fps))
    frames = int(min(300, max(60, 60 * fps)))
    assert_on_every_frame(walks(rng, frames), fps, {"smoothing": smoothing})


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
def test_turns_and_starts_of_all_motors(smoothing, fps, moves):
    """Also where the frame lies within a tick and the motor turns, or starts with four million
    steps/s²."""
    assert_on_every_frame(moves(160), fps, {"smoothing": smoothing})
