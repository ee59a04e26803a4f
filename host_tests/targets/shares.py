"""A share of the scenarios of a target, as a test."""

import subprocess
import sys

from framestep_tools.building.board_files import ROOT
from host_tests.observers.table import SCENARIOS

SUBJECTS = sorted(path.name for path in SCENARIOS.iterdir() if list(path.glob("test_*.py")))


def pytest_run(*words: str) -> subprocess.CompletedProcess[str]:
    """Run pytest on scenarios, in one process."""
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:xdist", "-p", "no:cacheprovider"]
    return subprocess.run([*command, *words], capture_output=True, text=True, cwd=ROOT)


def play(target: str, share: int, subject: str = "") -> None:
    """Play every n-th scenario on a target: of a subject, or of them all."""
    done = pytest_run("--target", target, "--share", str(share), str(SCENARIOS / subject))
    assert done.returncode == 0, done.stdout
    assert " passed" in done.stdout, done.stdout
