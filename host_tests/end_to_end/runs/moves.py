"""The moves that tests of runs and of JOG_ALL share, and verdicts on how they were played."""

import numpy as np

from framestep_tools import payloads as p
from framestep_tools.judge.judge import judge
from host_tests.end_to_end.session import assert_within

# ---- a run

FRAMES = 25
# A motor at constant speed, one that swings, one that holds in the middle
MOVE = {
    1: 100 + 60 * np.arange(FRAMES),
    2: np.round(400 * np.sin(np.arange(FRAMES) * 0.3)).astype(int),
    4: np.concatenate((np.zeros(8, int), 20 * np.arange(9), np.full(8, 160))),
}


def section(first, last, start_frame=1):
    """Return the positions of MOVE from one scene frame to another, in the order of play."""
    step = 1 if last >= first else -1
    return {
        m: steps[np.arange(first, last + step, step) - start_frame] for m, steps in MOVE.items()
    }


def assert_played(rig, before, positions, fps, **more):
    verdict = judge(rig.trace(), positions, round(fps * 1000), before, rig.positions, **more)
    assert verdict.good, verdict.complaints
    return verdict


# ---- JOG_ALL

PATH_FRAMES = 241
K = np.arange(PATH_FRAMES)
PATH = {1: 100 * K, 2: np.round(3000 * np.sin(K * 0.05)).astype(int)}
PER_FRAME = 100
ACCELERATION = 4.0  # frames/s²


def indices(session):
    """Return the frame, as a fraction, where motor 1 is: it makes PER_FRAME steps from one to the
    next."""
    return session.position(1) / PER_FRAME


def assert_followed(session, start, fps):
    """Assert that all edges since then are on the path, one axis within its limits."""
    times, signs = session.steps(1)
    assert_within(times, signs, fps * PER_FRAME * 1.002, ACCELERATION * PER_FRAME, window=0.2)
    frames = start + np.cumsum(signs) / PER_FRAME
    at, turned = session.steps(2)
    places = int(PATH[2][start]) + np.concatenate(([0], np.cumsum(turned)))
    for time, frame in zip(
        times[frames == np.round(frames)], frames[frames == np.round(frames)], strict=True
    ):
        # when motor 1 makes the frame's step
        near = places[np.searchsorted(at, time - 2e-5) : np.searchsorted(at, time + 2e-5) + 1]
        assert np.abs(near - PATH[2][round(frame)]).min() <= 1, frame
    assert not session.events(p.RtEnd), "JOG_ALL has no RT_END"


def assert_on_frame(session, index):
    assert indices(session) == index
    assert session.position(2) == PATH[2][index]
    assert session.ask_positions().move_time == (index + 1) * 1000
