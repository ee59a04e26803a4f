"""One measurement from its begin to its report."""

from collections.abc import Callable, Mapping
from contextlib import nullcontext
from typing import NamedTuple

from .board import Board
from .measure import Measuring
from .report import Report, folder_of

_MICROPYTHON = "import sys\nprint(sys.version.split('; ')[-1])"


class Options(NamedTuple):
    """with_drivers: whether framestep may switch drivers on; short: fewer moves."""

    with_drivers: bool = False
    short: bool = False


def prove(
    board: Board,
    options: Options,
    emulated: Mapping[str, float],
    say: Callable[[str], None],
) -> Report:
    """Measure a board. emulated: the figures to compare with; say: told what comes next."""
    measuring = Measuring(board, say, options.short)
    with nullcontext() if options.with_drivers else board.drivers_off():
        figures = measuring.everything()
    return Report(
        folder_of(board.data["name"]),
        board.where,
        board.clock_hz,
        board.run(_MICROPYTHON).strip(),
        figures,
        measuring.complaints,
        emulated,
    )
