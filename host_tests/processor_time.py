"""Processor time of the tests: of this process, and of its descendants, ended or running.
Printed at the end of a run, all of it in build/processor_time.txt; not a verdict, as computers
differ by half."""

import contextlib
import os
import time
from pathlib import Path

import pytest

from framestep_tools.building.board_files import ROOT

_LIST = ROOT / "build" / "processor_time.txt"
_SLOWEST = 10
_LARGE_SHARE = 0.03  # of the sum: such files are named
# After a shorter test nobody looks at other processes: a look at a browser's takes as long as many
# a test. What they did is then part of the next longer one.
_LOOK_S = 0.05


def _seconds():
    """Return the time so far; running children, such as emulated boards, and theirs, such as a
    browser's, count only with /proc."""
    return sum(os.times()[:4]) + _running("self")


def _running(process):
    """Return the time of a process's running children and of theirs."""
    found = 0
    for children in Path("/proc", process, "task").glob("*/children"):
        pids = []
        with contextlib.suppress(OSError):  # the thread has just ended
            pids = children.read_text().split()
        for child in pids:
            with contextlib.suppress(OSError):  # the process has just ended
                status = Path("/proc", child, "stat").read_text().rpartition(")")[2].split()
                found += sum(map(int, status[11:15])) / os.sysconf("SC_CLK_TCK")
                found += _running(child)
    return found


class ProcessorTime:
    """Collects {test: seconds}, also from xdist's workers, and prints a summary."""

    def __init__(self):
        self.taken = {}
        self._before = 0.0

    def pytest_runtestloop(self):
        self._before = _seconds()  # without the collection

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item):
        begun, own = time.monotonic(), time.process_time()
        try:
            return (yield)
        finally:
            if time.monotonic() - begun < _LOOK_S:
                now = self._before + time.process_time() - own
            else:
                now = _seconds()
            # less than 0: the end of a browser, whose processes do not wait for one another
            self.taken[item.nodeid] = max(now - self._before, 0)
            self._before = now

    def pytest_sessionfinish(self, session):
        if hasattr(session.config, "workeroutput"):
            session.config.workeroutput["processor_time"] = self.taken

    @pytest.hookimpl(optionalhook=True)
    def pytest_testnodedown(self, node):
        self.taken |= getattr(node, "workeroutput", {}).get("processor_time", {})

    def pytest_terminal_summary(self, terminalreporter):
        if not self.taken:
            return
        files = {}
        for test, seconds in self.taken.items():
            name = test.partition("::")[0]
            files[name] = files.get(name, 0) + seconds
        total = sum(files.values())
        write = terminalreporter.write_line
        terminalreporter.section("processor time")
        write(f"{total:.0f} s in all; the {_SLOWEST} tests that take most:")
        tests = sorted(self.taken, key=self.taken.get, reverse=True)
        for test in tests[:_SLOWEST]:
            write(f"{self.taken[test]:7.1f} s  {test}")
        write(f"files that take more than {_LARGE_SHARE:.0%}:")
        for name in sorted(files, key=files.get, reverse=True):
            if files[name] > _LARGE_SHARE * total:
                write(f"{files[name]:7.1f} s  {name}")
        _LIST.parent.mkdir(exist_ok=True)
        _LIST.write_text("".join(f"{self.taken[test]:.2f} {test}\n" for test in tests))
        write(f"each test: {_LIST.relative_to(ROOT)}")
