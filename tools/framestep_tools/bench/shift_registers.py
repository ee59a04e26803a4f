"""Figures of a Pico 2 with shift registers, emulated, with all its motors. `python -m
framestep_tools.bench.shift_registers` measures them alone."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from rich.console import Console

from ..errors import ToolError
from ..simulator.boards import EmulatedBoard
from .figures import Figure, plain_table
from .lateness import worst_late_us
from .measure import ARM, ARM_SPEED, AT_ONCE, GO_RUNS, Asker, go_times, upload_rate
from .rates import top_rate
from .session import Played, Session
from .stops import stops_in_moves, stops_in_run

BOARD = "pico2_595"
TITLE = "Pico 2 with shift registers, emulated, 150 MHz; its computing times are right to 20 %"
MHZ = 150
ALL = 16
GRID_US = 4
_RATES = (125_000, 100_000, 80_000, 60_000, 50_000, 40_000, 30_000, 20_000, 10_000)
_INTERRUPT = "irq10"  # DMA's
_FPS = (24, 48, 60)
_RATE = 20_000
_SPREAD = 37  # steps/s by which a motor is slower than the one before, so that no two agree
_VELOCITY = 60_000
_END = "_pico2_595"


def _edge_error(fps: int) -> Figure:
    return Figure(
        f"edge_error_us_{fps}{_END}",
        "µs",
        None,
        GRID_US,
        f"registers' outputs: worst distance of a rising edge from its ideal at {fps} frames/s, "
        f"all sixteen motors on the way there and back within 0.7 s at up to {_RATE} steps/s; "
        "half of the grid is in it",
    )


FIGURES = (
    Figure(
        f"steps_per_s_16{_END}",
        "steps/s",
        20_000,
        None,
        "rising edges of each motor over the time of a move at constant velocity, for the slowest "
        "of the sixteen, in the fastest one with every edge within the grid of "
        f"{GRID_US} µs around the ideal and no fault; the highest setting is 125 000",
    ),
    Figure(f"steps_per_s_1{_END}", "steps/s", 20_000, None, "the same for one motor"),
    *map(_edge_error, _FPS),
    Figure(
        f"tick_us_16{_END}",
        "µs",
        None,
        None,
        "emulated clock: cycles spent in DMA's interrupt, the tick and its words, per millisecond "
        f"of that move at {_FPS[-1]} frames/s",
    ),
    Figure(f"tick_us_16_worst{_END}", "µs", None, None, "the longest of these interrupts"),
    Figure(
        f"cpu_load_16_percent{_END}",
        "%",
        None,
        None,
        "share of that move in which the processor did not sleep",
    ),
    Figure(
        f"upload_frames_16{_END}", "frames", 10_000, None, "as upload_frames_8, for sixteen motors"
    ),
    Figure(
        f"rx_bytes_per_s{_END}",
        "bytes/s",
        800_000,
        None,
        "as on a Pico, for sixteen motors, while they all move",
    ),
    Figure(
        f"reply_ms_median{_END}",
        "ms",
        None,
        0.8,
        f"as on a Pico, while all move at {_FPS[-1]} frames/s",
    ),
    Figure(f"reply_ms_max{_END}", "ms", None, 3, "the slowest of these"),
    Figure(f"go_ms_median{_END}", "ms", None, 4, "as on a Pico; a pulse comes 1 ms later"),
    Figure(
        f"go_ms_spread{_END}",
        "ms",
        None,
        None,
        "the longest of these minus the shortest; GO cannot move the tick, which comes with words",
    ),
    Figure(f"stop_ms_worst{_END}", "ms", None, 2, "as on a Pico, of sixteen motors"),
    Figure(
        f"tick_late_us_worst{_END}",
        "µs",
        None,
        None,
        "as on a Pico, with requests for sixteen motors; up to 1 300 nothing is lost",
    ),
)


def waves(rate: int, fps: int, seconds: float = 0.7) -> dict[int, np.ndarray]:
    """Return a move in which each motor goes away once, at up to about `rate` steps/s."""
    frames = round(seconds * fps)
    far = seconds / (2 * np.pi) * (1 - np.cos(np.linspace(0, 2 * np.pi, frames)))
    return {
        motor: np.round((rate - _SPREAD * (motor - 1)) * far).astype(int)
        for motor in range(1, ALL + 1)
    }


def interrupt_us(measured: Mapping[str, Any]) -> tuple[float, float]:
    """Return what the interrupt takes of a millisecond on average, and at worst, µs."""
    cost = measured["exceptions"][_INTERRUPT]
    return cost["cycles"] / MHZ / measured["ms"], cost["max"] / MHZ


def _edge_errors(played: Played) -> np.ndarray:
    """Return how far each edge is off its ideal, µs. A delay that all share does not count."""
    found = np.concatenate([motor.edge_error_us for motor in played.verdict.motors])
    return np.abs(found - np.nanmedian(found))


def _played(session: Session, fps: int, ask: Callable[[], None] | None = None) -> Played:
    seconds = 2.0 if ask else 0.7
    moved = session.prepare(waves(_RATE, fps, seconds), _VELOCITY, fps)
    found = session.play(moved, ask)
    if found.complaints:
        raise ToolError(f"waves at {fps} frames/s: {'; '.join(found.complaints)}")
    return found


def measured(say: Callable[[str], None]) -> dict[str, float]:
    """Measure all figures, with the flash-cache model."""
    figures: dict[str, float] = {}
    with EmulatedBoard({}, trace=False, board=BOARD) as board:
        session = Session(board)
        figures["upload_frames_16"] = session.info.upload_frames
        say("upload")
        figures["rx_bytes_per_s"] = upload_rate(session, session.info.upload_frames)
        for fps in _FPS:
            say(f"waves at {fps} frames/s")
            played = _played(session, fps)
            figures[f"edge_error_us_{fps}"] = float(np.nanmax(_edge_errors(played)))
        figures["tick_us_16"], figures["tick_us_16_worst"] = interrupt_us(played.measured)
        figures["cpu_load_16_percent"] = 100 * played.measured["load"]
        say("answers")
        ask = Asker(session.client)
        _played(session, _FPS[-1], ask)
        figures["reply_ms_median"] = float(np.median(ask.ms[AT_ONCE:]))
        figures["reply_ms_max"] = max(ask.ms)
        say(f"GO, {GO_RUNS} times")
        times = go_times(session)
        figures["go_ms_median"] = float(np.median(times))
        figures["go_ms_spread"] = max(times) - min(times)
        say("stops")
        times = stops_in_moves(session)
        times += stops_in_run(session, waves(_RATE, _FPS[-1], 2.4), _VELOCITY, _FPS[-1])
        figures["stop_ms_worst"] = max(times)
        say("requests in motion")
        figures["tick_late_us_worst"] = worst_late_us(session, ARM, ARM_SPEED)
        for motors in (ALL, 1):
            say(f"{motors} motors at constant velocity")
            rate = top_rate(session, motors, say, _RATES, GRID_US, _RATES[0])
            figures[f"steps_per_s_{motors}"] = rate
    return {figure.key: figures[figure.key.removesuffix(_END)] for figure in FIGURES}


def main() -> None:
    console = Console(highlight=False)
    console.print(plain_table(TITLE, FIGURES, measured(console.print)))


if __name__ == "__main__":
    main()
