"""What plays the end-to-end scenarios: `pytest --target NAME host_tests/end_to_end`.

A target is a module here: its class `Target` takes the place of boards.SimulatedBoard, LACKS is
what it cannot show, FEEDS names the observers that it can feed, and `begin`, if there is one, is
called before each test. The host simulation lacks nothing. A scenario says what it needs of its
target: `@pytest.mark.needs("lights")`.
"""

import importlib
import os
import subprocess
import sys
from collections.abc import Iterable
from types import ModuleType

import pytest

from framestep_tools.building.board_files import ROOT
from framestep_tools.judge.trace import Edge
from host_tests.observers import ON_PINS
from host_tests.observers.__init__ import SCENARIOS, Table

SUBJECTS = sorted(path.name for path in SCENARIOS.iterdir() if list(path.glob("test_*.py")))
NAMES = ("host", "rp2040", "rp2350", "rp2350_595", "esp32", "device")
NEEDS = {
    "inside": "looks or reaches into the host simulation",
    "boards": "is about another board, or about the host simulation's own pins",
    "lights": "finds DMX among the edges",
    "fine edges": "measures edges more finely than 4 µs",
    "prompt": "measures when a request takes effect, to the millisecond",
    "ramped E-stop": "sees motors ramp down after the E-stop",
    "little memory": "fills the memory for uploads of the host simulation",
    "short pulses": "drives a motor faster than pulses of 4 µs allow",
    "cycles": "knows the clock of the pulse engine",
    "120 frames/s": "moves eight motors in more frames a second than a Pico 2 plans in time",
    "150 frames/s": "moves eight motors in more frames a second than a Pico plans in time",
    "instants": "looks for a level of no duration",
    "servos": "moves servos",
    "servo edges": "measures servos more finely than machine.PWM sets them",
    "edges": "looks at the pins",
    "inputs": "sets the level of an input",
}


def _lacking(item: pytest.Item, lacks: set[str]) -> bool:
    """Return whether a test needs something that is lacking."""
    case = item.name.partition("[")[2]
    found = {"inside"} if item.get_closest_marker("inside") else set()
    for mark in item.iter_markers("needs"):
        only = mark.kwargs.get("only", ("",))
        if unknown := set(mark.args) - set(NEEDS):
            raise pytest.UsageError(f"{item.nodeid} needs {unknown}, which is none of NEEDS")
        if case.startswith(tuple(only)):
            found |= set(mark.args)
    return bool(found & lacks)


def _useless(items: list[pytest.Item]) -> set[str]:
    """Return cases named by a mark of which there is none."""
    cases: dict[tuple[str, str], list[str]] = {}
    for item in items:
        name, _, case = item.nodeid.partition("[")
        for mark in item.iter_markers("needs"):
            for only in mark.kwargs.get("only", ()):
                cases.setdefault((name, only), []).append(case)
    return {
        f"{name}[{only}"
        for (name, only), found in cases.items()
        if not any(case.startswith(only) for case in found)
    }


class Scenarios:
    """A plugin of pytest: leaves out what the target cannot show, and keeps the share of the
    rest that `--share` asks for."""

    def __init__(self, target: ModuleType | None, share: int):
        self.target = target
        self.share = share

    @pytest.hookimpl(tryfirst=True)
    def pytest_collection_modifyitems(
        self, config: pytest.Config, items: list[pytest.Item]
    ) -> None:
        whole = not any("::" in word for word in config.args)
        if whole and (useless := _useless(items)):
            raise pytest.UsageError(f"there is no test {', '.join(sorted(useless))}")
        lacks = getattr(self.target, "LACKS", set())
        self._keep(config, items, [item for item in items if not _lacking(item, lacks)])

    @pytest.hookimpl(trylast=True, specname="pytest_collection_modifyitems")
    def pytest_collection_modifyitems_share(
        self, config: pytest.Config, items: list[pytest.Item]
    ) -> None:
        """Keep every n-th, without the long ones. A file with n others or more has one of them."""
        if self.share > 1:
            short = [item for item in items if not item.get_closest_marker("long")]
            self._keep(config, items, short[self.share // 2 :: self.share])

    @staticmethod
    def _keep(config: pytest.Config, items: list[pytest.Item], kept: list[pytest.Item]) -> None:
        chosen = set(kept)
        config.hook.pytest_deselected(items=[item for item in items if item not in chosen])
        items[:] = kept

    def pytest_runtest_setup(self, item: pytest.Item) -> None:
        if begin := getattr(self.target, "begin", None):
            begin(item)


class FirstLevels:
    """Drops a pin's first level from a trace that begins with it: on the host that is no edge. A
    pin that begins high has been set."""

    def __init__(self) -> None:
        self._known: set[str] = set()

    def drop(self, edges: Iterable[Edge]) -> list[Edge]:
        """Return the edges among these."""
        found = []
        for edge in edges:
            if edge[1] in self._known or edge[2]:
                found.append(edge)
            self._known.add(edge[1])
        return found


def install(config: pytest.Config) -> None:
    """Put the target in the host simulation's place, before a test imports that."""
    name = config.getoption("--target")
    target = None
    if name != "host":
        target = importlib.import_module(f"host_tests.targets.{name}")
        if name == "device":
            if not config.getoption("--port"):
                raise pytest.UsageError("--target device needs --port, a board's protocol port")
            os.environ[target.PORT] = config.getoption("--port")
        from framestep_tools.simulator import boards
        from host_tests.end_to_end import session

        boards.SimulatedBoard = session.SimulatedBoard = target.Target  # type: ignore[misc]
    config.pluginmanager.register(Scenarios(target, config.getoption("--share")))
    feeds = getattr(target, "FEEDS", ON_PINS | {"replay"})
    table = Table(name, feeds, config.getoption("--share"))
    config.pluginmanager.register(table, "observers")


# ---- a share of the scenarios of a target, as a test --------------------------------------------


def pytest_run(*words: str) -> subprocess.CompletedProcess[str]:
    """Run pytest on scenarios, in one process."""
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:xdist", "-p", "no:cacheprovider"]
    return subprocess.run([*command, *words], capture_output=True, text=True, cwd=ROOT)


def play(target: str, share: int, subject: str = "") -> None:
    """Play every n-th scenario on a target: of a subject, or of them all."""
    done = pytest_run("--target", target, "--share", str(share), str(SCENARIOS / subject))
    assert done.returncode == 0, done.stdout
    assert " passed" in done.stdout, done.stdout
