"""Every edge of a run is where the ideal path crosses its step, also at turns between frames."""

import numpy as np
import pytest

from framestep_tools.judge.judge import Limits, judge
from framestep_tools.judge.reference import Reference
from framestep_tools.payloads import RtEnd, RtGo
from host_tests.end_to_end.session import run_request, simulated

LIMITS = Limits(path_us=5)


def swing(fps, frames):
    """Return a move with turns between frames: the path has its peaks there and passes the frames
    on either side."""
    time = np.arange(frames) / fps
    period = max(1.3, 6.3 / fps)
    reach = min(0.5 * 20_000 * period, 0.5 * 100_000 * period**2 / (2 * np.pi)) / (2 * np.pi)
    return np.rint(reach * np.sin(2 * np.pi * time / period + 0.4)).astype(int)


@pytest.mark.parametrize("smooth", [True, False], ids=["smooth", "exact"])
@pytest.mark.parametrize("backward", [False, True], ids=["forward", "backward"])
@pytest.mark.parametrize("fps", [1, 12, 23.976, 24, 29.97, 60])
def test_every_edge_is_on_the_path(fps, backward, smooth):
    frames = max(7, min(40, round(1.6 * fps)))
    index = np.arange(frames)
    steps = {
        1: swing(fps, frames),
        2: np.rint(0.4 * 20_000 / fps * index),
        4: np.rint(
            0.1
            * np.where(index < frames // 2, 0, swing(fps, frames) - swing(fps, frames)[frames // 2])
        ),
    }
    upload = {motor: positions.astype(int) for motor, positions in steps.items()}
    session = simulated({"smoothing": smooth})
    for motor in upload:
        session.speed(motor, 20_000, 100_000)
    session.upload(upload)
    first, last = (frames - 1, 1) if backward else (0, frames - 1)
    session.ready(run_request(fps, first + 1, last + 1, 400, 600))
    start = session.positions
    session.forget().accept(RtGo()).until(RtEnd, 60)
    ended = session.now
    session.wait_idle().run(0.1)
    end = session.positions
    path = Reference(upload, round(fps * 1000), 400, 600, first, last, smooth=smooth)
    index = index[:0:-1] if backward else index
    played = {motor: positions[index] for motor, positions in upload.items()}
    verdict = judge(
        session.trace(), played, round(fps * 1000), start, end, path, limits=LIMITS, smooth=smooth
    )
    assert verdict.complaints == []
    assert all(path(motor, -1.0) == start[motor] for motor in upload)  # waits where the path begins
    for motor in upload:
        times, signs = session.steps(motor)
        # comes to rest where it ends
        assert path(motor, 1000.0) == start[motor] + signs[times < ended].sum()
        assert end[motor] == upload[motor][last]  # and goes back to the end frame
    assert any(len(m.edge_error_us) > 1000 for m in verdict.motors)
