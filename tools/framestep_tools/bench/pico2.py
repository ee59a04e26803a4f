"""Figures of an emulated Pico 2: those of a Pico with eight motors, and of all twelve."""

from collections.abc import Callable
from dataclasses import replace

from ..errors import ToolError
from ..simulator.boards import EmulatedBoard
from .figures import FIGURES as OF_A_PICO
from .figures import Figure
from .measure import PULSE_US, measure
from .moves import steady_move
from .rates import top_rate
from .session import Session

BOARD = "pico2"
TITLE = "Pico 2, emulated, 150 MHz; its computing times are right to 20 %"
MHZ = 150
ALL = 12
_GOALS = {
    "steps_per_s_8": 500_000,
    "pulses_steps_per_s_8": 250_000,
    "tick_us_8": 38,
    "upload_frames_8": 20_000,
    "rx_bytes_per_s": 800_000,
    "rx_bytes_per_s_small": 220_000,
    "reply_ms_median": 0.8,
    "reply_ms_max": 3,
}


def _of(figure: Figure) -> Figure:
    goal = _GOALS.get(figure.key)
    key = f"{figure.key}_pico2"
    if goal is None:
        return replace(figure, key=key)
    if figure.at_least is None:
        return replace(figure, key=key, at_most=goal)
    return replace(figure, key=key, at_least=goal)


FIGURES = (
    *map(_of, OF_A_PICO),
    Figure(
        "steps_per_s_12_pico2",
        "steps/s",
        300_000,
        None,
        "as steps_per_s_8, with all twelve motors",
    ),
    Figure(
        "tick_us_12_pico2",
        "µs",
        None,
        45,
        "as tick_us_8, while twelve motors move at 20 000 steps/s",
    ),
    Figure(
        "upload_frames_12_pico2", "frames", 20_000, None, "as upload_frames_8, for twelve motors"
    ),
)


def all_twelve(say: Callable[[str], None]) -> dict[str, float]:
    """Measure what depends on the number of motors, with all of them."""
    with EmulatedBoard({"motors": [{"pulse_us": PULSE_US}] * ALL}, False, board=BOARD) as board:
        session = Session(board)
        played = session.play(session.prepare(steady_move(20_000, ALL), 20_200))
        if played.complaints:
            raise ToolError("a move of twelve motors: " + "; ".join(played.complaints))
        ticks = played.measured["exceptions"]["irq3"]
        return {
            "upload_frames_12": session.info.upload_frames,
            "tick_us_12": ticks["cycles"] / MHZ / played.measured["ms"],
            "steps_per_s_12": top_rate(session, ALL, say),
        }


def measured(say: Callable[[str], None]) -> dict[str, float]:
    """Measure all figures, with the flash-cache model."""
    found = measure(MHZ, True, say, BOARD) | all_twelve(say)
    return {figure.key: found[figure.key.removesuffix("_pico2")] for figure in FIGURES}
