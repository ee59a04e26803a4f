"""Uploads within the motors' limits, at every frame rate, judged from the edges.

At each frame's time each motor has made exactly the uploaded position's steps (± 1 while moving, 0
at rest) within 20 µs, and between frames velocity is continuous (field note 5.6).
"""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from framestep_tools.judge.judge import Limits, judge
from framestep_tools.move.move_file import read_move
from framestep_tools.payloads import MotorResetPosition
from host_tests.end_to_end.session import run_request, simulated

RATES = (1, 12, 23.976, 24, 25, 29.97, 30, 60)
VELOCITY, ACCELERATION = 20_000, 100_000


def smooth(fps, frames, swing, phase):
    """Return a sine on a slope that uses the share `swing` of the motor's limits."""
    # seconds of one swing, within velocity and acceleration
    time = np.arange(frames) / fps
    period = max(1.0, 6 / fps)
    amplitude = swing * min(
        VELOCITY * period / (2 * np.pi), ACCELERATION * (period / (2 * np.pi)) ** 2
    )
    slope = 0.1 * VELOCITY / fps
    return np.round(
        amplitude * np.sin(2 * np.pi * time / period + phase) + slope * np.arange(frames)
    ).astype(int)


def played(session, positions, fps, first=1, pre=500, post=500, limits=None, smooth=True):
    """Upload and play; return the verdict."""
    for motor in positions:
        session.speed(motor, VELOCITY, ACCELERATION)
    session.upload(positions, first)
    frames = max(len(steps) for steps in positions.values())
    before = session.play(run_request(fps, first, first + frames - 1, pre, post), 300)
    return judge(
        session.trace(), positions, round(fps * 1000), before, session.positions,
        limits=limits or Limits(), smooth=smooth,
    )  # fmt: skip


@pytest.mark.needs("fine edges", only=tuple(f"{fps}-exact" for fps in RATES))
@pytest.mark.parametrize("smoothed", [True, False], ids=["smooth", "exact"])
@pytest.mark.parametrize("fps", RATES)
def test_every_rate(fps, smoothed):
    frames = max(5, min(40, round(1.6 * fps)))
    positions = {
        1: smooth(fps, frames, 0.6, 0.0),
        3: smooth(fps, frames, 0.4, 2.0),
        5: np.round(0.6 * VELOCITY / fps * np.arange(frames)).astype(int),
        # slow, then at rest
        8: np.minimum(np.round(3 * np.arange(frames)), 3 * frames // 2).astype(int),
    }
    verdict = played(simulated({"smoothing": smoothed}), positions, fps, smooth=smoothed)
    assert verdict.good, verdict.complaints
    steady = {m.motor: m.worst_time_us for m in verdict.motors}
    assert steady[5] < 1
    assert steady[8] < 2


def test_the_camera_move():
    move = read_move()
    frames = slice(0, 60)
    positions = {motor: steps[frames] for motor, steps in move.positions.items()}
    verdict = played(simulated(), positions, 24)
    assert verdict.good, verdict.complaints


@st.composite
def moves(draw):
    """Draw a frame rate and positions of three motors that use up to 0.8 of velocity and
    acceleration at each frame."""
    fps = draw(st.sampled_from(RATES[1:]))
    frames = draw(st.integers(5, 16))
    fastest = 0.8 * VELOCITY / fps
    steepest = 0.8 * ACCELERATION / fps**2
    positions = {1: np.round(draw(st.floats(0.02, 1)) * fastest * np.arange(frames)).astype(int)}
    for motor in (2, 6):
        rate, place, steps = draw(st.sampled_from((0.0, 0.3, -0.7))) * fastest, 0.0, []
        changes = st.lists(
            st.sampled_from((-1, -0.5, 0, 0, 0.25, 1, "rest")), min_size=frames, max_size=frames
        )
        for change in draw(changes):
            steps.append(round(place))
            if change == "rest":
                rate = 0.0 if abs(rate) <= steepest else rate
            else:
                rate = max(-fastest, min(fastest, rate + change * steepest))
            place += rate
        positions[motor] = np.array(steps) + draw(st.sampled_from((0, -(2**20), 2**30)))
    return fps, positions


@settings(max_examples=25)
@given(moves(), st.integers(-100, 100))
@example((60, {1: np.arange(6), 2: np.zeros(6, int), 6: -np.arange(6)}), 1)
def test_any_move(move, first):
    fps, positions = move
    session = simulated()
    for motor, steps in positions.items():
        if abs(int(steps[0])) > 2**19:  # otherwise it takes minutes to get there
            session.accept(MotorResetPosition(motor, int(steps[0])))
    # A motor that creeps through a frame is wrong by 0.01 step for longer than 20 µs.
    verdict = played(session, positions, fps, first, limits=Limits(time_steps=0.01))
    assert verdict.good, verdict.complaints
