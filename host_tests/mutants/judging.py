"""Whether tests notice a mutant."""

import json
import os
import resource
import shutil
import subprocess
import sys
from pathlib import Path

from framestep_tools.files import FIRMWARE, ROOT

from .mutations import Mutant

KILLED, TIME_OUT, SURVIVED, UNCALLED = "killed", "killed by time-out", "survived", "never called"
_SHORT_S, _LONG_S = 8.0, 90.0  # of tests, as they took when nothing was changed
_START_S = 30.0  # for pytest to begin, on a busy computer
_FACTOR = 10.0  # how much longer tests may take
_MOST_BYTES = 4 << 30  # of memory
Calls = dict[tuple[str, int], list[tuple[float, str]]]


def calls_of(folder: Path) -> Calls:
    """{function: [(seconds, test)], the quickest first} of what the plugin `callers` has
    written."""
    found: Calls = {}
    for file in folder.glob("*.json"):
        for test, (seconds, called) in json.loads(file.read_text()).items():
            for path, line in called:
                found.setdefault((path, line), []).append((seconds, test))
    return {function: sorted(tests) for function, tests in found.items()}


def within(tests: list[tuple[float, str]], seconds: float) -> list[str]:
    """As many of the quickest as take so long in all; at least one."""
    chosen, total = [], 0.0
    for took, test in tests:
        total += took
        if chosen and total > seconds:
            break
        chosen.append(test)
    return chosen


def learn(folder: Path, tests: list[str], jobs: int) -> None:
    """Run the tests once as they are and write down what they call. RuntimeError if one fails."""
    command = [*_pytest(), "-p", "host_tests.mutants.callers", "--callers", str(folder)]
    done = subprocess.run([*command, "-n", str(jobs), *tests], cwd=ROOT, stdout=subprocess.PIPE)
    if done.returncode:
        raise RuntimeError(done.stdout.decode()[-2000:])


class Judge:
    """Runs tests against a copy of the firmware that has one change. The working tree stays as it
    is. folder: for the copy."""

    def __init__(self, folder: Path, calls: Calls, firmware: Path = FIRMWARE):
        self._folder = folder
        self._calls = calls
        shutil.copytree(
            firmware / "framestep",
            folder / "framestep",
            ignore=shutil.ignore_patterns("__pycache__"),
        )

    def judge(self, mutant: Mutant) -> str:
        """One of KILLED, TIME_OUT, SURVIVED, UNCALLED. Of the tests that call the function the
        quickest are tried first, then all that take a minute and a half in all."""
        tests = self._calls.get((mutant.path, mutant.function), [])
        if not tests:
            return UNCALLED
        file = self._folder / "framestep" / mutant.path
        before = file.read_text()
        file.write_text(mutant.source)
        try:
            few = within(tests, _SHORT_S)
            verdict = self._run(few, _SHORT_S)
            more = within(tests, _LONG_S)[len(few) :]
            if verdict == SURVIVED and more:
                verdict = self._run(more, _LONG_S)
            return verdict
        finally:
            file.write_text(before)

    def _run(self, tests: list[str], seconds: float) -> str:
        environment = os.environ | {
            "PYTHONPATH": str(self._folder),
            "PYTHONDONTWRITEBYTECODE": "1",  # a changed file may have the time of the one before
        }
        try:
            done = subprocess.run(
                [*_pytest(), "-x", "-p", "no:xdist", *tests],
                cwd=ROOT,
                env=environment,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                timeout=_START_S + _FACTOR * seconds,
                preexec_fn=_limit_memory,
            )
        except subprocess.TimeoutExpired:
            return TIME_OUT
        return KILLED if done.returncode else SURVIVED


def _pytest() -> list[str]:
    return [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "--hypothesis-seed=0"]


def _limit_memory() -> None:
    resource.setrlimit(resource.RLIMIT_AS, (_MOST_BYTES, _MOST_BYTES))
