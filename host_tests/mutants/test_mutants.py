"""The driver of `make mutants`, on a small package: what tests notice, what they do not, and that
the files stay as they are. cosmic-ray, which makes the mutants, is not needed here."""

import json
import subprocess
import sys

import pytest

from framestep_tools.files import ROOT
from host_tests.mutants import judging
from host_tests.mutants.__main__ import CORE, EQUIVALENT, equivalents, interval
from host_tests.mutants.judging import KILLED, SURVIVED, TIME_OUT, UNCALLED, Judge, within
from host_tests.mutants.mutations import Mutant, functions

SMALL = """\
def limited(x, most):
    while x > most:
        return most
    return x


def unused():
    return 1
"""
TEST = """\
from framestep.small import limited

def test_limited():
    assert (limited(5, 3), limited(1, 3)) == (3, 1)
"""


@pytest.fixture
def firmware(tmp_path):
    package = tmp_path / "firmware" / "framestep"
    package.mkdir(parents=True)
    (package / "__init__.py").write_text("")
    (package / "small.py").write_text(SMALL)
    (tmp_path / "test_small.py").write_text(TEST)
    return package.parent


def changed(before, after, function=1):
    source = SMALL.replace(before, after)
    assert source != SMALL
    return Mutant("small.py", function + 1, function, "", before, after, source)


def test_what_tests_notice(firmware, tmp_path, monkeypatch):
    calls = {("small.py", 1): [(0.1, str(tmp_path / "test_small.py"))]}
    judge = Judge(tmp_path / "copy", calls, firmware)
    assert judge.judge(changed("return x", "return -x")) == KILLED
    assert judge.judge(changed("x > most", "x >= most")) == SURVIVED
    assert judge.judge(changed("return 1", "return 2", 7)) == UNCALLED
    monkeypatch.setattr(judging, "_START_S", 2.0)
    monkeypatch.setattr(judging, "_FACTOR", 0.0)
    assert judge.judge(changed("return most", "continue")) == TIME_OUT
    for folder in (firmware, tmp_path / "copy"):
        assert (folder / "framestep" / "small.py").read_text() == SMALL


def test_what_a_test_calls(firmware, tmp_path):
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-p"]
    command += ["host_tests.mutants.callers", "--callers", str(tmp_path)]
    subprocess.run(
        [*command, str(tmp_path / "test_small.py")],
        cwd=ROOT,
        check=True,
        env={"PYTHONPATH": f"{firmware}:{ROOT}"},
    )
    (file,) = tmp_path.glob("*.json")
    ((test, (seconds, called)),) = json.loads(file.read_text()).items()
    assert test.endswith("test_small.py::test_limited")
    assert seconds >= 0
    assert called == [["__init__.py", 1], ["small.py", 1]] or called == [["small.py", 1]]
    assert judging.calls_of(tmp_path)["small.py", 1] == [(seconds, test)]


def test_the_quickest_first():
    tests = [(1.0, "a"), (2.0, "b"), (4.0, "c")]
    assert within(tests, 3) == ["a", "b"]
    assert within(tests, 0.5) == ["a"]


def test_functions_begin_at_their_decorators():
    assert functions("@one\n@two\ndef f():\n    def g(): pass\n    return g\n") == [(1, 5), (4, 4)]


def test_interval():
    """Worked by hand: 85 of 100."""
    low, high = interval(85, 100)
    assert (round(low, 3), round(high, 3)) == (0.767, 0.907)
    assert interval(10, 10)[1] == pytest.approx(1)


def test_equivalents_are_told_with_a_reason_and_are_still_there():
    for name in equivalents():
        path, _, rest = name.partition(": ")
        before = rest.partition("  ->  ")[0]
        assert before in {line.strip() for line in (CORE / path).read_text().splitlines()}, name
    lines = EQUIVALENT.read_text().splitlines()
    for line, below in zip(lines, [*lines[1:], ""], strict=True):
        if line and not line.startswith(("#", " ")):
            assert below.startswith(" "), f"no reason is given for {line}"
