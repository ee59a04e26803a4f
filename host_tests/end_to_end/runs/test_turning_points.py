"""Turning points of an uploaded move: the motor makes the last step to them, at the frame's time,
and the step back."""

import numpy as np
import pytest

from framestep_tools.judge.judge import frame_times_ns
from framestep_tools.judge.ripple import origins_ns
from framestep_tools.payloads import MotorConfigure, RtGo
from host_tests.end_to_end.session import run_request, simulated

SLACK_NS = 30_000


def played(positions, fps, flags=1, motor=1):
    """Return where the motor waits, and the times (s) and directions of its steps."""
    session = simulated()
    session.speed(1, 200_000, 4_000_000)
    session.speed(2, 200_000, 4_000_000)
    session.accept(MotorConfigure(1, flags))
    session.upload({1: positions})
    frames = len(positions)
    session.accept(run_request(fps=fps, end=frames, pre=500, post=500))
    session.wait_idle()
    before = session.positions[motor]
    session.forget()
    session.accept(RtGo())
    session.run(1.3 + frames / fps)
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
