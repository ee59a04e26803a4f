"""How much ripple `smoothing` removes from a run: edges on the pins of two boards, with and
without it."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from ..errors import ToolError
from ..judge.judge import frame_times_ns, judge
from ..judge.ripple import Ripple, origins_ns, ripple
from ..judge.trace import Trace
from ..payloads import RtEnd, RtGo
from ..simulator.boards import EmulatedBoard
from .moves import RIPPLE_FRAMES, RIPPLE_RATES, ripple_paths
from .session import Session


def ripple_ratios(
    rig: dict[str, Any], args: Sequence[str], say: Callable[[str], None]
) -> tuple[float, float]:
    """Return the ripple of velocity and of acceleration with `smoothing`, divided by the one
    without."""
    found = []
    for smoothing in (True, False):
        say(f"ripple of rounding, {'with' if smoothing else 'without'} smoothing")
        with EmulatedBoard({**rig, "smoothing": smoothing}, trace=False, args=args) as board:
            session = Session(board)
            found.append(sum((_played(session, fps, smoothing) for fps in RIPPLE_RATES), Ripple()))
    smooth, rough = found
    return (
        smooth.velocity_rms / rough.velocity_rms,
        smooth.acceleration_rms / rough.acceleration_rms,
    )


def _played(session: Session, fps: int, smoothing: bool) -> Ripple:
    """Return the ripple of all paths at this rate. Raises ToolError if a motor missed a
    position."""
    paths = ripple_paths()
    at = np.arange(RIPPLE_FRAMES)
    rounded = {motor: np.rint(path(at)).astype(int) for motor, path in paths.items()}
    stands = session.positions
    moved = session.prepare(rounded, 100_000, fps)
    start = session.positions
    emulator = session.board.emulator
    emulator.trace_start(session.board.pins.pins)
    session.client.events.clear()
    session.client.request(RtGo())
    begun = session.client.clock()
    while not session.client.take_event(RtEnd):
        if session.client.clock() - begun > 60:
            raise ToolError("the run did not end: no RT_END came from the board")
        session.client.pump(0.05)
    trace = Trace.from_records(emulator.trace_stop(), session.board.pins)
    session.client.wait_idle()
    if smoothing:
        origin = _origin(trace, start, moved, fps)
    else:
        origin = judge(trace, moved, 1000 * fps, start).origin_ns
    result = Ripple()
    for motor, path in paths.items():
        times, ways = trace.steps(motor)
        frames = (times - origin) * fps / 1e9
        begins = start[motor] - stands[motor]
        result += ripple(frames, ways, begins, path, RIPPLE_FRAMES - 1)
    return result


def _origin(trace: Trace, start: dict[int, int], moved: dict[int, np.ndarray], fps: int) -> float:
    """Return the time of the first frame in ns: with it, each motor is at its position at each
    frame's time."""
    due = frame_times_ns(RIPPLE_FRAMES, 1000 * fps)
    low, high = -(1 << 62), 1 << 62
    for motor, positions in moved.items():
        spans = origins_ns(*trace.steps(motor), start[motor], positions.tolist(), due)
        fitting = [(max(low, a), min(high, b)) for a, b in spans if max(low, a) < min(high, b)]
        if not fitting:
            raise ToolError(
                f"motor {motor} missed an uploaded position at a frame's time, at {fps} "
                "frames/s with smoothing"
            )
        if len(fitting) == 1:
            low, high = fitting[0]
    return (low + high) / 2
