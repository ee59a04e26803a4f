"""Which tests a run has: enough of their parameters and of their combinations, or, with `make
check`, those nearest to a change.

Tests that are named after a file that has changed since `main` come first. Then nearness is the
number of imports from a test's file to a changed one, or to a module that names a changed file of
another kind. Tests are started in this order until the time is up, counted from the first one.
Those of the nearest file always run. A run without any test has failed.
"""

import ast
import subprocess
import time
import zlib
from functools import cache
from pathlib import Path

import hypothesis
import pytest

from framestep_tools.building.board_files import ROOT

_MOST_FILES = 50
_SOURCES = {
    "flash_images": "tools/flash_images",
    "framestep": "firmware/framestep",
    "framestep_tools": "tools/framestep_tools",
    "framestep_emulator": "tools/framestep_emulator",
    "host_tests": "host_tests",
}


def changed(since: str) -> set[str]:
    """Return the files of the working tree, relative to the root, that differ from a branch."""

    def git(*words: str) -> list[str]:
        said = subprocess.run(
            ["git", *words, "-z"], cwd=ROOT, capture_output=True, text=True, check=True
        )
        return said.stdout.split("\0")[:-1]

    base = subprocess.run(
        ["git", "merge-base", since, "HEAD"], cwd=ROOT, capture_output=True, text=True, check=True
    )
    return {
        *git("diff", "--name-only", base.stdout.strip()),
        *git("ls-files", "--others", "--exclude-standard"),
    }


@cache
def _modules() -> dict[str, str]:
    """Return {dotted name: file} of all Python modules."""
    found = {}
    for package, folder in _SOURCES.items():
        for path in (ROOT / folder).rglob("*.py"):
            if "node_modules" in path.parts:
                continue
            parts = path.relative_to(ROOT / folder).with_suffix("").parts
            if parts[-1] == "__init__":
                parts = parts[:-1]
            found[".".join((package, *parts))] = path.relative_to(ROOT).as_posix()
    return found


def _named(tree: ast.AST, package: str) -> set[str]:
    """Return the dotted names that a module may import; what follows `from x import` may be a
    module or not."""
    found = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            found.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            parts = package.split(".")[: len(package.split(".")) - node.level + 1]
            base = ".".join(parts) if node.level else ""
            base = ".".join(filter(None, (base, node.module)))
            found.update({base, *(f"{base}.{alias.name}" for alias in node.names)})
    return found


@cache
def importers() -> dict[str, set[str]]:
    """Return {file: the files that import it}."""
    modules = _modules()
    found: dict[str, set[str]] = {file: set() for file in modules.values()}
    for name, file in modules.items():
        package = name if file.endswith("__init__.py") else name.rpartition(".")[0]
        for imported in _named(ast.parse((ROOT / file).read_text()), package):
            if imported in modules:
                found[modules[imported]].add(file)
    return found


def _naming(name: str) -> set[str]:
    """Return the modules with this file's name in their text."""
    return {file for file in _modules().values() if name in (ROOT / file).read_text()}


def distances(files: set[str]) -> dict[str, int]:
    """Return {file: imports from it to the nearest of these files} for all files that reach one."""
    by = importers()
    found = dict.fromkeys(files, 0)
    edge = {file for file in files if file in by}
    for file in files - edge:
        edge.update(_naming(Path(file).name))
    for file in edge:
        found.setdefault(file, 1)
    while edge:
        edge = {after for file in edge for after in by[file]} - found.keys()
        far = max(found.values()) + 1
        found.update(dict.fromkeys(edge, far))
    return found


def nearest(files: set[str]) -> list[str]:
    """Return the tests that reach these files: those named after one first, then by distance."""
    found = distances(files)
    stems = {Path(file).stem for file in files}

    def order(file: str) -> tuple[bool, int, str]:
        named = Path(file).stem.removeprefix("test_") in stems
        return not named, found[file], file

    return sorted((file for file in found if Path(file).name.startswith("test_")), key=order)


class Near:
    """Runs the nearest file of tests to the changes since `since`, then others for `seconds`."""

    def __init__(self, since: str, seconds: float):
        self._since = since
        self._seconds = seconds
        self._begun = 0.0  # when the first test began; 0: none has
        self._nearest = None  # the file that always runs
        self._run = 0  # tests
        self._left = 0
        tests = nearest(changed(since))
        self._order = {ROOT / file: place for place, file in enumerate(tests[:_MOST_FILES])}
        self._other_files = len(tests[_MOST_FILES:])

    def pytest_ignore_collect(self, collection_path):
        """Read only nearby files: reading all takes as long as a minute of tests."""
        if collection_path.suffix == ".py" and collection_path not in self._order:
            return True
        return None

    @pytest.hookimpl(trylast=True)
    def pytest_collection_modifyitems(self, items):
        """Put the nearest first."""
        items.sort(key=lambda item: self._order[item.path])
        self._nearest = items[0].path if items else None

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtest_protocol(self, item):
        """Start no further test once the time is up."""
        now = time.monotonic()
        self._begun = self._begun or now
        if item.path == self._nearest or now - self._begun < self._seconds:
            return None
        self._left += 1
        return True

    def pytest_runtest_logreport(self, report):
        """Count the tests that have run, an xdist worker's as well."""
        self._run += report.when == "setup"

    @pytest.hookimpl(tryfirst=True)
    def pytest_sessionfinish(self, session):
        """Report to the process that prints the summary, and fail there if no test has run."""
        if hasattr(session.config, "workeroutput"):
            session.config.workeroutput["left"] = self._left
        elif not self._run and session.exitstatus == pytest.ExitCode.OK:
            session.exitstatus = pytest.ExitCode.NO_TESTS_COLLECTED

    @pytest.hookimpl(optionalhook=True)
    def pytest_testnodedown(self, node):
        """Add the tests that an xdist worker has left out."""
        self._left += getattr(node, "workeroutput", {}).get("left", 0)

    def pytest_terminal_summary(self, terminalreporter):
        """Print the tests that were not run."""
        if not self._run:
            terminalreporter.write_line(
                f"no test has run: none is near to what has changed since {self._since} "
                "(make test runs them all)"
            )
        if self._left or self._other_files:
            terminalreporter.write_line(
                f"left out, farther from the change: {self._left} tests after {self._seconds:g} s, "
                f"and {self._other_files} files (make test runs them all)"
            )


_SHARE = 5  # each run has one of this many examples that hypothesis draws with --all


def sweep(values, *kept):
    """Return the parameters of a test: each run has those in `kept`, --all has the others, too."""
    return [
        pytest.param(value, marks=() if value in kept else pytest.mark.repeats) for value in values
    ]


def parameters(item):
    """Return {name: value} of a test's case."""
    return item.callspec.params if hasattr(item, "callspec") else {}


def spare(cases, but=()):
    """Return cases of one test that are not needed, because the others have each value of each
    parameter. but: parameters that do not count."""

    def values(item):
        return {(name, repr(value)) for name, value in parameters(item).items() if name not in but}

    left = {item: values(item) for item in cases}
    missing = set().union(*left.values())
    while missing:
        best = max(left, key=lambda item: len(left[item] & missing))
        missing -= left.pop(best)
    return list(left) if len(cases) > 1 else []


def by_test(items):
    """Return {(file, test, chip): its cases}."""
    found = {}
    for item in items:
        name = getattr(item, "originalname", item.name)
        found.setdefault((item.path, name, parameters(item).get("chip")), []).append(item)
    return found


def one_of_each(items):
    """Return a case of each test, if possible one that is in each run."""
    return {
        min(cases, key=lambda item: len(list(item.iter_markers("repeats"))))
        for cases in by_test(items).values()
    }


def left_out_repeats(items, one_in):
    """Return the tests that a run leaves out. All of these repeat what others show. A run plays one
    in `one_in` of such tests, always the same ones; with 0 it plays none."""
    for cases in by_test(items).values():
        for item in spare(cases) if len(parameters(cases[0])) > 1 else ():
            item.add_marker(pytest.mark.repeats)
    return {
        item
        for item in items
        if item.get_closest_marker("repeats")
        and not (one_in and zlib.crc32(item.nodeid.encode()) % one_in == 0)
    }


def fewer_examples(items):
    """Have hypothesis draw the first of its examples only."""
    for function in {getattr(item.obj, "__func__", item.obj) for item in items}:
        # hypothesis' own decorator passes them in this way
        whole = getattr(function, "_hypothesis_internal_use_settings", None)
        if whole is not None:
            function._hypothesis_internal_use_settings = hypothesis.settings(
                whole, max_examples=-(-whole.max_examples // _SHARE)
            )
