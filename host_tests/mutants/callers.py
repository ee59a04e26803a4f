"""A plugin for pytest that writes down which functions of the firmware each test calls.

    python -m pytest -p host_tests.mutants.callers --callers FOLDER …

A file of JSON for each process: {test: [seconds, [[path, line], …]]}, a path below firmware/, the
line that of the function's `def`, or of its first decorator. A test has what its own fixtures call,
too.
"""

import json
import os
import sys
import threading
import time
from pathlib import Path

import pytest

PACKAGE = f"{os.sep}framestep{os.sep}"


def pytest_addoption(parser):
    parser.addoption("--callers", metavar="FOLDER", help="write down what each test calls")


def pytest_configure(config):
    if config.getoption("--callers"):
        config.pluginmanager.register(Callers(Path(config.getoption("--callers"))))


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

        begun = time.monotonic()
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
        self.found[item.nodeid] = time.monotonic() - begun, sorted(calls)

    def pytest_sessionfinish(self):
        (self.folder / f"{os.getpid()}.json").write_text(json.dumps(self.found))
