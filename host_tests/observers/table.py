"""Which scenarios each observer has watched, by subject and target: build/scenarios.md, kept by
every run of scenarios."""

import fcntl
from collections import Counter
from pathlib import Path
from typing import Any

import pytest

from framestep_tools.building.board_files import ROOT
from host_tests.observers import FED_BY_EACH, OBSERVERS

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
            terminalreporter.write_line(f"{self.failure} (observers/table.py)")

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
