"""A test that fails says what was sent, came and was expected, when, and where its log is."""

import os
import re
import subprocess
import sys

import pytest

from framestep_tools.building import images
from framestep_tools.building.board_files import ROOT
from framestep_tools.payloads import Ack, MotorMove, MotorStop
from framestep_tools.traffic import log
from host_tests.end_to_end.session import logs_of, simulated

FAILING = """
from framestep_tools.building import images
from framestep_tools.payloads import Ack, MotorMove
from host_tests.end_to_end.session import assert_within, simulated

def test_one():
    session = simulated(motors=2)
    session.run(0.35)
    session.refuse(Ack.ERR_SOFT_UP, MotorMove(7, -101))

def test_helper():
    assert_within([1.0], [1], 1, 1)

def test_two():
    images._run("sh", "-c", "echo making something for minutes >&2")
"""


@pytest.fixture(scope="module")
def failed(tmp_path_factory):
    """Return the result of a run in which tests fail."""
    folder = tmp_path_factory.mktemp("failing")
    (folder / "test_failing.py").write_text(FAILING)
    words = ["-q", "-c", ROOT / "pyproject.toml", "-p", "host_tests.conftest"]
    result = subprocess.run(
        [sys.executable, "-m", "pytest", *words, "--rootdir", folder, folder],
        cwd=folder,
        env=os.environ | {"PYTHONPATH": str(ROOT), "CI": ""},
        capture_output=True,
        text=True,
    )
    assert "2 failed, 1 passed" in result.stdout, result.stdout
    return result


def test_the_answer_that_came_is_shown_and_where_the_log_is(failed):
    assert re.search(
        r"sent at 0\.3\d\d s of the board's time: MotorMove\(motor=7, position=-101\); "
        r"came: ERR_RANGE \(0x0014\); expected: ERR_SOFT_UP \(0x",
        failed.stdout,
    )
    (path,) = re.findall(r"^all of it: (.+\.log)$", failed.stdout, re.MULTILINE)
    entries = log.read(path)
    os.unlink(path)
    assert entries[0].who == log.OPEN
    assert MotorMove(7, -101).pack() in [entry.frame.payload for entry in entries if entry.frame]


def test_an_assertion_of_a_helper_shows_its_values(failed):
    assert "assert 1 > 2" in failed.stdout


def test_a_build_is_reported_past_the_capture_of_pytest(failed):
    assert "making something for minutes" in failed.stderr


def test_a_log_has_each_frame_with_its_time(request, tmp_path):
    session = simulated(motors=2)
    session.run(0.2).accept(MotorStop(1))
    said = logs_of(request.node.nodeid, tmp_path)
    (path,) = tmp_path.glob("*.log")
    assert f"all of it: {path}" in said
    sent = [entry for entry in log.read(path) if entry.who == log.HOST]
    assert sent[-1].frame.payload == MotorStop(1).pack()
    assert sent[-1].time_s == pytest.approx(session.now, abs=0.1)
    with pytest.raises(AssertionError, match=r"came: OK \(0x0010\); expected: ERR_RANGE"):
        session.refuse(Ack.ERR_RANGE, MotorStop(1))
    assert images.reporting is not None
