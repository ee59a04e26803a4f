"""Observers: what must hold in every scenario, on every target, whatever the scenario is about.

The rules are the fuzzer's (fuzz/trial.py): answers and their form, edges within what the requests
allow, positions that match the edges, frames met, outputs safe, no HARD_STOP without a reason. Here
they judge a session that somebody else conducts. `watch(board)` notes what passes a board's port
and pins; `Watch.settle` judges it. timing.py has what only the emulated chip shows: late ticks, the
time with interrupts off, and long passes of the main loop.
"""

import fcntl
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from framestep_tools.building.board_files import ROOT


@dataclass(frozen=True)
class Tolerances:
    """How exactly a target shows when something happens."""

    lag_ms: int = 0  # from a tick to its edges, at most
    report_s: float = 0.0025  # age of the positions in a report, at most
    keeps_unread: bool = False  # what nobody read is read by a host that returns, as by a UART
    earlier_ns: int = 0  # how much earlier than it happens an edge is said to be
    # the latest that a tick may come while a motor moves; from 1813 µs on pulses would break off
    late_us: int = 200
    masked_us: int = 140  # the longest time with interrupts off, except for writing to flash
    # until a request that moves nothing is answered, from when it or the answer before it was sent
    answer_ms: int | None = None
    # passes of the main loop, more than `settled_ms` after a request: the longest, and how many of
    # `long_pass_ms` may end within a second
    settled_ms: int = 200
    longest_pass_ms: float = 8.0
    long_pass_ms: float = 2.8
    long_passes: int = 6


CHIP = Tolerances(lag_ms=5, report_s=0.005, answer_ms=15)  # an emulated RP2040 or RP2350

OBSERVERS = {
    "answers": "each request gets one answer, in time and in its form",
    "limits": "edges keep to velocity and acceleration, and to where the requests allow",
    "jerk": "edges of a motor with a jerk limit keep to that, too",
    "soft limits": "edges stay between them",
    "quiet": "no edge comes while the motors are said to stand",
    "pins": "positions reported in motion match the edges",
    "positions": "positions reported at rest match the edges",
    "goals": "motors come to rest on their targets",
    "frames": "motors pass each frame of a run exactly",
    "couples": "coupled motors go together",
    "stops": "motors rest in time after a stop",
    "outputs": "outputs are safe after a stop",
    "HARD_STOP": "it has a reason",
    "late": "ticks come in time (emulated chips)",
    "masked": "interrupts are on (emulated chips)",
    "passes": "passes of the main loop are short (emulated chips)",
    "replay": "32-bit MicroPython with a locked heap does the same (host)",
}
IN_CHIPS = {"late", "masked", "passes"}  # what only an emulated chip shows
ON_PINS = set(OBSERVERS) - IN_CHIPS - {"replay"}  # what a board's port and pins show
FED_BY_EACH = {"answers", *IN_CHIPS}  # by any share of ten scenarios

watches: list | None = None  # of the boards of a module's sessions, if they are observed


def begin(board) -> None:
    """Watch a board from now on, as it has just started; not one whose pins nobody sees."""
    shows = getattr(board, "shows", Tolerances())
    if watches is None or shows is None or hasattr(board, "watch"):
        return
    from host_tests.observers import timing
    from host_tests.observers.watch import Watch

    rig = board._board.controller.rig
    if not _hidden(rig):
        board.watch = Watch(board, rig, shows)
        # its REPL on a port of its own says where the tick's state is
        if hasattr(board, "emulator") and board.repl:
            board.watch.ticks = timing.watched(board.emulator, f"{board.pins} {board._rig}")
        watches.append(board.watch)


def _hidden(rig) -> bool:
    """Whether motors of a rig move by what neither a request nor a step pulse shows."""
    homes = [motor["home"] for motor in rig.motors if motor["home"]]
    return (
        bool(rig.pendant or rig.shoot_input)
        or any(motor["servo"] for motor in rig.motors)
        or any(home["square_within"] for home in homes)
    )


FILE = ROOT / "build" / "scenarios.md"
SCENARIOS = ROOT / "host_tests" / "end_to_end"
_COLUMNS = ("subject", "target", "scenarios", *OBSERVERS)
_SOME = 10  # scenarios: fewer prove nothing
_HEAD = "".join(f"* {name}: {what}\n" for name, what in OBSERVERS.items())


class Table:
    """A plugin of pytest. It counts scenarios in which an observer had something to compare.

    feeds: the observers that the target can feed. If all scenarios are played, each of them has to
    have watched one; in a share of them, those that any scenarios feed. A chosen part proves
    nothing.
    """

    def __init__(self, target: str, feeds: set[str], share: int = 1, file: Path = FILE):
        self.target, self.feeds, self.share, self.file = target, feeds, share, file
        self.rows: dict[str, Counter[str]] = {}
        self.chosen = True
        self.failure = ""

    def played(self, path: Path) -> None:
        """Count a scenario of this file."""
        self._row(path)["scenarios"] += 1

    def watched(self, path: Path, observers: set[str]) -> None:
        """Count it for these observers."""
        self._row(path).update(observers)

    def _row(self, path: Path) -> Counter[str]:
        return self.rows.setdefault(path.relative_to(SCENARIOS).parts[0], Counter())

    @pytest.hookimpl(tryfirst=True)
    def pytest_collection_modifyitems(self, config: Any, items: list[pytest.Item]) -> None:
        option = config.option
        files = {item.path for item in items}
        part = option.keyword or option.markexpr or option.near
        self.chosen = bool(part) or not files >= set(SCENARIOS.rglob("test_*.py"))

    def unfed(self) -> set[str]:
        """Return the observers that had nothing to watch, though they should."""
        fed = {name for row in self.rows.values() for name, count in row.items() if count}
        if self.chosen or sum(row["scenarios"] for row in self.rows.values()) < _SOME:
            return set()
        return (self.feeds if self.share == 1 else self.feeds & FED_BY_EACH) - fed

    @pytest.hookimpl(tryfirst=True)
    def pytest_sessionfinish(self, session: pytest.Session) -> None:
        if hasattr(session.config, "workeroutput"):
            rows = {subject: dict(row) for subject, row in self.rows.items()}
            session.config.workeroutput["observers"] = rows, self.chosen
        elif self.rows:
            self._write()
            if not session.testsfailed and (unfed := self.unfed()):
                self.failure = f"on {self.target} nothing to watch for: {', '.join(sorted(unfed))}"
                session.exitstatus = pytest.ExitCode.TESTS_FAILED

    @pytest.hookimpl(optionalhook=True)
    def pytest_testnodedown(self, node: Any) -> None:
        rows, chosen = getattr(node, "workeroutput", {}).get("observers", ({}, True))
        for subject, row in rows.items():
            self.rows.setdefault(subject, Counter()).update(row)
        self.chosen &= chosen

    def pytest_terminal_summary(self, terminalreporter: Any) -> None:
        if self.failure:
            terminalreporter.section("observers", red=True)
            terminalreporter.write_line(f"{self.failure} (host_tests/observers)")

    def _write(self) -> None:
        """Write the table: this run's rows, and those that other runs have left."""
        self.file.parent.mkdir(exist_ok=True)
        with self.file.open("a+") as file:
            fcntl.flock(file, fcntl.LOCK_EX)  # other processes play other subjects
            file.seek(0)
            kept = {}
            for line in file.read().splitlines():
                cells = [cell.strip() for cell in line.strip("|").split("|")]
                if len(cells) == len(_COLUMNS) and cells[2].isdigit():
                    kept[cells[0], cells[1]] = cells
            for subject, row in self.rows.items():
                counts = [str(row[name]) for name in _COLUMNS[2:]]
                kept[subject, self.target] = [subject, self.target, *counts]
            lines = [_COLUMNS, ["---"] * len(_COLUMNS), *(kept[key] for key in sorted(kept))]
            file.truncate(0)
            file.write(f"Scenarios in which each observer had something to compare.\n\n{_HEAD}\n")
            file.write("".join(f"| {' | '.join(cells)} |\n" for cells in lines))
