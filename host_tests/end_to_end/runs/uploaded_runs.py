"""What the tests of uploaded moves share: the move, and a verdict on how it was played."""

import numpy as np

from framestep_tools.judge.judge import judge

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
