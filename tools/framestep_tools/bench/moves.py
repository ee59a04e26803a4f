"""The moves for measurements."""

from collections.abc import Callable

import numpy as np

CLOCK_MHZ = 125  # of measurements at one clock only
MOTORS = 8
FPS = 25  # of the moves below, so their steps per frame are whole numbers
RAMP = 100_000  # steps/s²
STEEPEST = 4_000_000  # steps/s²: the motors' acceleration setting
ROLL_MS = 200
READY_S = 0.15  # from rest to GO; eight motors are planned in 0.1 s
WINDOW = 4  # unanswered sections of an upload
# velocities of the motors in the mixed move
STEADY_RATES = (99_700, 80_000, 61_000, 50_000, 33_325, 20_000, 9_975, 1_000)


def mixed_move(seconds: float = 2.4, fps: int = FPS) -> dict[int, np.ndarray]:
    """Return positions of eight motors that ramp up with RAMP, hold velocities of STEADY_RATES, and
    ramp down.

    Odd motors go up, even ones down. A motor without the time for its velocity begins its ramp down
    in the middle.
    """
    frames = round(seconds * fps) + 1
    t = np.arange(frames) / fps
    total = t[-1]
    moves = {}
    for motor, rate in enumerate(STEADY_RATES, 1):
        begun = min(rate / RAMP, total / 2)
        rate = RAMP * begun
        # in halves of steps per s², exact at the frames
        x = np.minimum(t, begun)
        way = RAMP * x * x / 2 + rate * np.clip(t - begun, 0, total - 2 * begun)
        x = np.clip(t - (total - begun), 0, None)
        way += rate * x - RAMP * x * x / 2
        moves[motor] = np.floor(way + 0.25).astype(np.int64) * (1 if motor % 2 else -1)
    return moves


def steady_move(rate: int, motors: int, frames: int = 11) -> dict[int, np.ndarray]:
    """Return positions of some motors at a constant velocity. rate: steps/s, a multiple of FPS."""
    return {
        motor: rate // FPS * np.arange(frames) * (1 if motor % 2 else -1)
        for motor in range(1, motors + 1)
    }


RIPPLE_FRAMES = 96
RIPPLE_RATES = (12, 24, 60)  # frames per second


Shape = Callable[[np.ndarray], np.ndarray]  # a path before rounding: steps at times in frames


def _ease(steps: float) -> Shape:
    """Return a path from rest to rest, without jumps of velocity and acceleration."""
    return lambda t: steps * np.polyval((6, -15, 10, 0, 0, 0), t / (RIPPLE_FRAMES - 1))


def _line(rate: float) -> Shape:
    return lambda t: rate * t + 0.317


def _sine(steps: float, period: float) -> Shape:
    return lambda t: steps * np.sin(2 * np.pi * t / period + 0.4)


def ripple_paths() -> dict[int, Shape]:
    """Return lines, eases and sines of 0.4 to 500 steps per frame, one for each of eight motors."""
    shapes = (
        *(_line(rate) for rate in (0.4, 7.3, -60.7, 500.3)),
        *(_ease(steps) for steps in (97.3, -5000.7)),
        *(_sine(steps, period) for steps, period in ((40.2, 30), (1000.4, 60))),
    )
    return dict(enumerate(shapes, 1))
