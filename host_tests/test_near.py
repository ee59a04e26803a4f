"""Tests that `make check` runs."""

import os
import subprocess
import sys

import pytest

from framestep_tools.building.board_files import ROOT
from host_tests.selection import distances, importers, nearest

# A project of three files, the first of which is nearest to what has changed
CONFTEST = """
import time
from pathlib import Path
from host_tests import selection as near

near.ROOT = Path(__file__).parent
near.changed = lambda since: set()
near.nearest = lambda files: {tests}

def pytest_collection_finish():
    time.sleep(0.3)  # a busy computer: reading the tests takes longer than all of them may

def pytest_configure(config):
    config.pluginmanager.register(near.Near("main", {seconds}))
"""


def test_imports_are_found_in_each_way_of_writing_them():
    by = importers()
    assert "firmware/framestep/motors/axis.py" in by["firmware/framestep/motors/backlash.py"]
    assert (
        "tools/framestep_tools/simulator/boards.py" in by["tools/framestep_tools/errors.py"]
    )  # relative
    assert "host_tests/selection.py" in by["tools/framestep_tools/building/board_files.py"]
    assert "tools/framestep_emulator/__init__.py" in by["tools/framestep_emulator/emulator.py"]


def test_tests_named_after_a_change_come_first_then_the_nearest():
    tests = nearest({"firmware/framestep/motors/backlash.py"})
    assert set(tests[:2]) == {
        "host_tests/end_to_end/motors/test_backlash.py",
        "host_tests/motors/test_backlash.py",
    }
    far = distances({"firmware/framestep/motors/backlash.py"})
    steps = [far[test] for test in tests[2:]]
    assert steps == sorted(steps)
    assert "host_tests/protocol/test_messages.py" in tests  # by the controller


def test_what_a_change_does_not_reach_is_left_out():
    tests = nearest({"tools/framestep_tools/judge/vcd.py"})
    assert tests
    assert "host_tests/motion/test_ramps.py" not in tests


def test_a_file_of_another_kind_is_reached_by_those_who_name_it():
    assert "host_tests/project/test_setup.py" in nearest({"tools/setup.sh"})
    nobody = "nobody" + "-names-it.bin"
    assert nearest({nobody}) == []


@pytest.fixture
def check(tmp_path):
    """check(tests, seconds, *words): the status and the output of a run with these files near."""
    for name in ("test_a", "test_b", "test_c"):
        (tmp_path / f"{name}.py").write_text("def test_one(): pass\ndef test_two(): pass\n")

    def check(tests, seconds, *words):
        (tmp_path / "conftest.py").write_text(CONFTEST.format(tests=tests, seconds=seconds))
        done = subprocess.run(
            [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", *words, tmp_path],
            cwd=tmp_path,
            env=os.environ | {"PYTHONPATH": str(ROOT)},
            capture_output=True,
            text=True,
        )
        return done.returncode, done.stdout

    return check


ALL = ["test_b.py", "test_a.py", "test_c.py"]


@pytest.mark.parametrize("workers", [(), ("-n", "2")], ids=["alone", "shared"])
def test_the_nearest_file_always_runs(check, workers):
    status, said = check(ALL, 0, *workers)
    assert status == 0
    assert "2 passed" in said
    assert "left out, farther from the change: 4 tests after 0 s" in said


def test_time_counts_from_the_first_test(check):
    status, said = check(ALL, 0.25)
    assert status == 0
    assert "6 passed" in said
    assert "left out" not in said


@pytest.mark.parametrize("workers", [(), ("-n", "2")], ids=["alone", "shared"])
def test_a_run_without_a_test_has_failed(check, workers):
    for tests, words in ([], ()), (ALL, ("-k", "nothing")):
        status, said = check(tests, 45, *workers, *words)
        assert status != 0, said
        assert "no test has run: none is near to what has changed since main" in said
