"""Report of `framestep lab prove`: a table, a file for programs, a page to attach to an issue."""

import json
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import date
from pathlib import Path
from typing import Any, NamedTuple

from ..building import board_files
from ..errors import BROKEN_OFF, ToolError
from ..paths import BOARDS, version
from .figures import FIGURES, OF_THE_RIG, WORSE

EMULATED = Path(__file__).with_name("emulated.json")
FORM = 1  # version of the files' format


@dataclass(frozen=True)
class Report:
    """Result of a measurement.

    board: its folder in boards/; where: its port; figures: measured values; complaints: texts about
    faults; emulated: values for comparison; remarks: texts about differences from a board without a
    rig file; broken_off: what ended the measurement before all figures were measured.
    """

    board: str
    where: str
    clock_hz: int
    micropython: str
    figures: Mapping[str, float]
    complaints: Sequence[str]
    emulated: Mapping[str, float]
    remarks: Sequence[str] = ()
    broken_off: BaseException | None = None

    @property
    def faults(self) -> list[str]:
        """Return the complaints, and why the measurement broke off."""
        if self.broken_off is None:
            return list(self.complaints)
        return [*self.complaints, f"the measurement broke off here: {_reason(self.broken_off)}"]

    def raise_broken_off(self, page: Path | None = None) -> None:
        """Raise what broke the measurement off, if it was not completed.

        page: the report with the figures so far, for the error's sentence.
        """
        error = self.broken_off
        if error is None:
            return
        kept = f"; {page} has the figures so far" if page else ""
        text = f"the measurement broke off: {_reason(error)}{kept}"
        if isinstance(error, (ToolError, OSError)):
            broken = ToolError(text)
            broken.status = getattr(error, "status", BROKEN_OFF)
            raise broken from error
        print(text, file=sys.stderr)
        raise error

    @property
    def rows(self) -> list[tuple[str, str, str, str, str]]:
        """Return [(figure, measured, emulated, unit, verdict)]."""
        return [
            (
                figure.key,
                number(self.figures.get(figure.key)),
                number(self.emulated.get(figure.key)),
                figure.unit,
                figure.verdict(self.figures.get(figure.key), self.emulated.get(figure.key)),
            )
            for figure in FIGURES
        ]

    @property
    def worse(self) -> list[str]:
        """Return the figures that are worse than the emulated board's."""
        return [key for key, _, _, _, verdict in self.rows if verdict == WORSE]

    def as_json(self) -> dict[str, Any]:
        """Return the report for programs."""
        return {
            "form": FORM,
            "framestep": version(),
            "board": self.board,
            "where": self.where,
            "clock_hz": self.clock_hz,
            "micropython": self.micropython,
            "date": date.today().isoformat(),
            "figures": dict(self.figures),
            "verdicts": {key: verdict for key, _, _, _, verdict in self.rows},
            "complaints": self.faults,
            "remarks": list(self.remarks),
        }

    def as_markdown(self) -> str:
        """Return the report as Markdown, for an issue."""
        lines = [
            f"# framestep {version()} on {self.board}",
            "",
            f"{date.today().isoformat()}, {self.where}, {self.micropython}, "
            f"{self.clock_hz / 1e6:g} MHz",
            "",
            "| figure | measured | emulated | unit | verdict |",
            "|---|--:|--:|---|---|",
            *("| " + " | ".join(row) + " |" for row in self.rows),
            "",
        ]
        lines += [f"* {text}" for text in self.faults] or ["Every edge is where it should be."]
        lines += [f"* {text}" for text in self.remarks]
        lines += ["", "How each is measured:", ""]
        lines += [f"* {figure.key}: {figure.how}" for figure in FIGURES]
        return "\n".join(lines) + "\n"

    def write(self, folder: Path) -> list[Path]:
        """Write prove-<board>-<date>.json and .md. Return their paths."""
        name = f"prove-{self.board}-{date.today().isoformat()}"
        texts = {".json": json.dumps(self.as_json(), indent=2) + "\n", ".md": self.as_markdown()}
        paths = []
        for ending, text in texts.items():
            path = folder / f"{name}{ending}"
            try:
                folder.mkdir(parents=True, exist_ok=True)
                path.write_text(text, encoding="utf-8")
            except OSError as error:
                raise ToolError(f"cannot write {path}: {error.strerror}") from None
            paths.append(path)
        return paths


def _reason(error: BaseException) -> str:
    """Return an exception as text."""
    if isinstance(error, KeyboardInterrupt):
        return "Ctrl-C"
    return str(error) or type(error).__name__


def number(value: float | None) -> str:
    """Format a figure for a table."""
    if value is None:
        return "–"
    if abs(value) >= 1000:
        return f"{value:,.0f}".replace(",", " ")
    return f"{value:.3g}"


class Emulated(NamedTuple):
    """Figures of an emulated board. motors: number of its measured motors."""

    motors: int
    clock_mhz: int
    figures: Mapping[str, float]

    def beside(self, motors: int, plain: bool) -> dict[str, float]:
        """Return the figures for comparison with a board of this many motors.

        plain: no setting of its rig file costs time or memory, or changes pulses.
        """
        same = plain and motors == self.motors
        return {key: self.figures[key] for key in self.figures if same or key not in OF_THE_RIG}


def emulated_boards() -> dict[str, Emulated]:
    """Return {folder in boards/: figures of that emulated board}. Raises ToolError if the figures
    are of another version."""
    found = json.loads(EMULATED.read_text(encoding="utf-8"))
    if found["framestep"] != version():
        raise ToolError(
            f"the emulated boards' figures are of framestep {found['framestep']}, this is "
            f'{version()}: make prove ARGS="--board all --renew" measures them again'
        )
    return {name: Emulated(**board) for name, board in found["boards"].items()}


def outdated() -> list[str]:
    """List the emulated boards without figures of this version and of their board.json."""
    found = json.loads(EMULATED.read_text(encoding="utf-8"))
    known = emulated_boards() if found["framestep"] == version() else {}
    names = board_files.boards_that_see_steps()
    wanted = {name: board_files.board_data(name) for name in names}
    return [
        name
        for name, data in wanted.items()
        if name not in known
        or (known[name].motors, known[name].clock_mhz) != (data["motors"], data["clock_mhz"])
    ]


def renew(board: str, motors: int, figures: Mapping[str, float]) -> None:
    """Store the figures of an emulated board, and drop those of other versions and of boards that
    are gone."""
    rounded = {key: float(f"{value:.6g}") for key, value in figures.items()}
    found = json.loads(EMULATED.read_text(encoding="utf-8"))
    boards = found["boards"] if found["framestep"] == version() else {}
    boards = {name: boards[name] for name in boards if name in board_files.emulated_boards()}
    clock_mhz = board_files.board_data(board)["clock_mhz"]
    boards[board] = {"motors": motors, "clock_mhz": clock_mhz, "figures": rounded}
    text = json.dumps({"framestep": version(), "boards": dict(sorted(boards.items()))}, indent=2)
    EMULATED.write_text(text + "\n", encoding="utf-8")


def folder_of(name: str) -> str:
    """Return the folder in boards/ of the board with this name."""
    for path in sorted(BOARDS.glob("*/board.json")):
        if json.loads(path.read_text(encoding="utf-8"))["name"] == name:
            return path.parent.name
    raise ToolError(f"this framestep has no board of the name {name!r}")


def show(found: Report) -> None:
    """Print the table and the faults."""
    from rich.console import Console
    from rich.table import Table

    table = Table(title=f"framestep {version()} on {found.board}", title_justify="left")
    for name in ("figure", "measured", "emulated", "unit", "verdict"):
        numbers = name in ("measured", "emulated")
        table.add_column(name, justify="right" if numbers else "left", no_wrap=True)
    for row in found.rows:
        table.add_row(*row)
    Console(highlight=False).print(table)
    for text in (*found.faults, *found.remarks):
        print(text)
