"""Figures of a Pico 2 with shift registers, emulated: `python -m
framestep_tools.bench.shift_registers` (some minutes). docs/internals/many-motors.md has them."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from ..errors import ToolError
from ..judge.judge import Verdict
from ..payloads import MotorStatus
from ..simulator.boards import EmulatedBoard
from .session import Played, Session

BOARD = "pico2_595"
MOTORS = 16
MHZ = 150
INTERRUPT = "irq10"  # DMA's
FPS = (24, 48, 60)
RATES = (1_000, 10_000, 20_000, 40_000)
_SECONDS = 0.7
_SPREAD = 37  # steps/s by which a motor is slower than the one before, so that no two agree
_VELOCITY = 60_000


def waves(rate: int, fps: int, seconds: float = _SECONDS) -> dict[int, np.ndarray]:
    """Return a move in which each motor goes away once, at up to about `rate` steps/s."""
    frames = round(seconds * fps)
    far = seconds / (2 * np.pi) * (1 - np.cos(np.linspace(0, 2 * np.pi, frames)))
    velocities = [max(rate - _SPREAD * motor, rate // 2) for motor in range(MOTORS)]
    return {motor: np.round(v * far).astype(int) for motor, v in enumerate(velocities, 1)}


def edges_us(verdict: Verdict) -> tuple[float, float]:
    """Return how far 99.9 % of all edges are off their ideal at most, and the worst, µs. A delay
    that all share does not count."""
    found = np.concatenate([motor.edge_error_us for motor in verdict.motors])
    off = np.abs(found - np.nanmedian(found))
    return float(np.nanpercentile(off, 99.9)), float(np.nanmax(off))


def interrupt_us(measured: Mapping[str, Any]) -> tuple[float, float]:
    """Return what the interrupt takes of a millisecond on average, and at worst, µs."""
    cost = measured["exceptions"][INTERRUPT]
    return cost["cycles"] / MHZ / measured["ms"], cost["max"] / MHZ


def played(session: Session, rate: int, fps: int) -> Played:
    """Play such a move. Raises ToolError if a motor is off, or something stops them."""
    found = session.play(session.prepare(waves(rate, fps), _VELOCITY, fps))
    if found.complaints:
        raise ToolError(f"{rate} steps/s at {fps} frames/s: {'; '.join(found.complaints)}")
    return found


HEAD = ("frames/s", "steps/s", "interrupt, µs", "worst, µs", "load, %", "99.9 %, µs", "worst, µs")


def figures(say: Callable[[str], None]) -> None:
    """Say the figures, a line each."""
    with EmulatedBoard({}, board=BOARD) as board:
        session = Session(board)
        say(f"frames of {MOTORS} motors: {session.info.upload_frames}")
        say(" ".join(f"{cell:>14}" for cell in HEAD))
        for rate, fps in [(rate, FPS[0]) for rate in RATES] + [(RATES[2], fps) for fps in FPS[1:]]:
            found = played(session, rate, fps)
            mean, worst = interrupt_us(found.measured)
            most, edge = edges_us(found.verdict)
            row = (fps, rate, round(mean), round(worst), round(100 * found.measured["load"]))
            say(" ".join(f"{cell:>14}" for cell in (*row, f"{most:.1f}", f"{edge:.1f}")))
        moved = session.prepare(waves(RATES[2], FPS[-1], 2.0), _VELOCITY, FPS[-1])
        took: list[float] = []

        def ask() -> None:
            begun = session.client.clock()
            session.client.request(MotorStatus())
            took.append(1000 * (session.client.clock() - begun))
            session.client.pump(0.0083)

        session.play(moved, ask)
        say(f"answer in motion, ms: median {np.median(took):.2f}, worst {max(took):.2f}")


if __name__ == "__main__":
    figures(lambda line: print(line, flush=True))
