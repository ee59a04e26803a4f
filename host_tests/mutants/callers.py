"""A plugin for pytest that writes down which functions of the firmware each test calls.

    python -m pytest -p host_tests.mutants.callers --callers FOLDER …

A file of JSON for each process: {test: [seconds, [[path, line], …]]}: seconds of a processor, a
path below firmware/, the line of the function's `def` or of its first decorator. A test has what
its own fixtures call, too.
"""

import json
import os
import sys
import threading
from pathlib import Path

import pytest

PACKAGE = f"{os.sep}framestep{os.sep}"


def pytest_addoption(parser):
    parser.addoption("--callers", metavar="FOLDER", help="write down what each test calls")


def pytest_configure(config):
    if config.getoption("--callers"):
        config.pluginmanager.register(Callers(Path(config.getoption("--callers"))))


def _processor_s() -> float:
    """Seconds of a processor that this process and those it has waited for have taken."""
    return sum(os.times()[:4])


class Callers:
    """Watches calls while a test is set up and run."""

    def __init__(self, folder: Path):
        self.folder = folder
        self.found: dict[str, tuple[float, list[tuple[str, int]]]] = {}

    @pytest.hookimpl(hookwrapper=True)
    def pytest_runtest_protocol(self, item):
        seen = set()

        def look(frame, event, _):
            if event == "call":
                seen.add(frame.f_code)

        begun = _processor_s()
        threading.setprofile(look)
        sys.setprofile(look)
        yield
        sys.setprofile(None)
        threading.setprofile(None)
        calls = {
            (code.co_filename.rpartition(PACKAGE)[2], code.co_firstlineno)
            for code in seen
            if PACKAGE in code.co_filename
        }
        self.found[item.nodeid] = _processor_s() - begun, sorted(calls)

    def pytest_sessionfinish(self):
        (self.folder / f"{os.getpid()}.json").write_text(json.dumps(self.found))
