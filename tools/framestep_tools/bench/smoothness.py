"""How much ripple `smoothing` removes from a run, and its load: edges on the pins of two boards,
with and without it."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from ..errors import ToolError
from ..judge.judge import Limits, judge
from ..judge.ripple import Ripple, ripple
from ..judge.trace import Trace
from ..payloads import RtEnd, RtGo
from ..simulator.boards import EmulatedBoard
from .moves import RIPPLE_FRAMES, RIPPLE_RATES, ripple_paths
from .session import Session


def smoothing_figures(
    rig: dict[str, Any], args: Sequence[str], say: Callable[[str], None], board: str = "pico"
) -> dict[str, float]:
    """Return the ripple of velocity and of acceleration with `smoothing`, divided by the one
    without, and what it adds to the load at the fastest rate, percent."""
    ripples, loads = [], []
    for smoothing in (True, False):
        say(f"ripple of rounding, {'with' if smoothing else 'without'} smoothing")
        settings = {**rig, "smoothing": smoothing}
        with EmulatedBoard(settings, trace=False, board=board, args=args) as emulated:
            session = Session(emulated)
            played = [_played(session, fps, smoothing) for fps in RIPPLE_RATES]
            ripples.append(sum((ripple for ripple, _ in played), Ripple()))
            loads.append(played[-1][1])
    smooth, rough = ripples
    return {
        "velocity_ripple": smooth.velocity_rms / rough.velocity_rms,
        "acceleration_ripple": smooth.acceleration_rms / rough.acceleration_rms,
        "smoothing_load_percent": 100 * (loads[0] - loads[1]),
    }


def _played(session: Session, fps: int, smoothing: bool) -> tuple[Ripple, float]:
    """Return the ripple of all paths at this rate, and the load (0 to 1). Raises ToolError if a
    motor missed a position."""
    paths = ripple_paths()
    at = np.arange(RIPPLE_FRAMES)
    rounded = {motor: np.rint(path(at)).astype(int) for motor, path in paths.items()}
    stands = session.positions
    moved = session.prepare(rounded, 100_000, fps)
    start = session.positions
    emulator = session.board.emulator
    emulator.trace_start(session.board.pins.pins)
    session.client.events.clear()
    with emulator.measure() as measured:
        session.client.request(RtGo())
        begun = session.client.clock()
        while not session.client.take_event(RtEnd):
            if session.client.clock() - begun > 60:
                raise ToolError("the run did not end: no RT_END came from the board")
            session.client.pump(0.05)
    trace = Trace.from_records(emulator.trace_stop(), session.board.pins)
    session.client.wait_idle()
    verdict = judge(
        trace, moved, 1000 * fps, start, limits=Limits(velocity_share=1), smooth=smoothing
    )
    if not verdict.good:
        raise ToolError(f"the move was not played as uploaded: {'; '.join(verdict.complaints)}")
    origin = verdict.origin_ns
    result = Ripple()
    for motor, path in paths.items():
        times, ways = trace.steps(motor)
        frames = (times - origin) * fps / 1e9
        begins = start[motor] - stands[motor]
        result += ripple(frames, ways, begins, path, RIPPLE_FRAMES - 1)
    return result, measured["load"]
