"""One measurement, from its start to its report."""

from collections.abc import Callable, Mapping
from contextlib import nullcontext
from typing import NamedTuple

from . import report
from .board import Board, emulated
from .measure import Measuring
from .report import Emulated, Report

_MICROPYTHON = "import sys\nprint(sys.version.split('; ')[-1])"
_PLAIN = {
    "motors",
    "motor_count",
    "name",
    "dialect",
    "ports",
}  # settings that cost no time or memory
_PLAIN_MOTOR = {"invert", "enable_high", "pulse_us"}


class Options(NamedTuple):
    """with_drivers: whether framestep may switch drivers on; short: fewer moves."""

    with_drivers: bool = False
    short: bool = False


def prove(
    board: Board,
    options: Options,
    beside: Mapping[str, Emulated],
    say: Callable[[str], None],
) -> Report:
    """Measure a board. beside: boards to compare it with; say: called with what comes next.

    If the measurement breaks off, by Ctrl-C as well, the report has the figures so far and the
    reason in `broken_off`. Raises the reason if there are no figures.
    """
    micropython = board.run(_MICROPYTHON).strip()
    measuring = Measuring(board, say, options.short)
    broken_off = None
    try:
        with nullcontext() if options.with_drivers else board.drivers_off():
            measuring.everything()
    except (Exception, KeyboardInterrupt) as error:
        if "upload_frames" not in measuring.figures:  # the first figure
            raise
        broken_off = error
    known = beside.get(board.folder)
    count, plain = len(board.layout.measured), is_plain(board)
    remarks = _remarks(board, known, count, plain)
    if broken_off:
        remarks.append("the board may not be as it was before: reset it before its motors are used")
    return Report(
        board.folder,
        board.where,
        board.clock_hz,
        micropython,
        measuring.figures,
        measuring.complaints,
        known.beside(count, plain) if known else {},
        remarks,
        broken_off,
    )


def renew(board: str, say: Callable[[str], None]) -> None:
    """Measure an emulated board and store its figures, with which reports are compared."""
    with emulated(board=board) as measured:
        found = prove(measured, Options(), {}, say)
        found.raise_broken_off()
        report.renew(board, len(measured.layout.measured), found.figures)
    say(f"{report.EMULATED} has {len(found.figures)} figures of {board}")


def is_plain(board: Board) -> bool:
    """Return whether the board runs its image without an overlay, and no setting of its rig file
    costs time or memory."""
    motors = range(1, board.layout.motors + 1)
    return (
        not board.overlay
        and set(board.rig) <= _PLAIN
        and all(set(board.settings(m)) <= _PLAIN_MOTOR for m in motors)
    )


def _remarks(board: Board, known: Emulated | None, count: int, plain: bool) -> list[str]:
    """Return the report's remarks about the board and its rig file."""
    found = [f"motor {m} was left out: it {why}" for m, why in board.layout.left_out.items()]
    if board.layout.servos:
        servos = ", ".join(map(str, sorted(board.layout.servos)))
        found.append(f"servos were left out: {servos}")
    if board.overlay:
        found.append("an overlay is in use: edited modules replace the image's")
    if known is None:
        found.append(
            "no emulated board is of this kind, so these figures are compared with nothing"
        )
    elif not plain or count != known.motors:
        found.append(
            "figures that depend on the rig file are not compared: the emulated board runs the "
            f"image, with {known.motors} motors and no settings that take time"
        )
    return found
