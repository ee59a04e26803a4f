"""tools/setup.sh and the Makefile: a clone that was moved or copied gets its own virtual
environment, also in a folder with a blank in its name."""

import os
import shutil
import subprocess

import pytest

from framestep_tools.building.board_files import ROOT

# A Python that only makes environments from itself, and logs its arguments
PYTHON = """#!/bin/bash
echo "$0 $*" >>"{log}"
if [ "$1 $2" = "-m venv" ]; then
    mkdir -p "$3/bin" && cp "$0" "$3/bin/python" && echo "VIRTUAL_ENV=\\"$3\\"" >"$3/bin/activate"
fi
"""


@pytest.fixture
def clone(tmp_path):
    """Return a clone with only the files that setup.sh reads."""
    made = tmp_path / "one"
    (made / "tools").mkdir(parents=True)
    for name in ("tools/setup.sh", "tools/steps.sh", "tools/constraints.txt", "pyproject.toml"):
        shutil.copy(ROOT / name, made / name)
    python = tmp_path / "python"
    python.write_text(PYTHON.format(log=tmp_path / "log"))
    python.chmod(0o755)
    return made


def set_up(clone):
    """Return what setup.sh says, and what Pythons were asked for."""
    log = clone.parent / "log"
    log.write_text("")
    environment = {key: value for key, value in os.environ.items() if key != "FRAMESTEP_CACHE"}
    result = subprocess.run(
        ["bash", clone / "tools/setup.sh"],
        env={**environment, "PYTHON": str(clone.parent / "python")},
        capture_output=True,
        text=True,
    )
    assert result.returncode == 0, result.stderr
    return result.stderr, log.read_text()


def test_a_second_time_nothing_is_done(clone):
    assert "-m venv" in set_up(clone)[1]
    assert set_up(clone) == ("", "")


@pytest.mark.parametrize("how", [shutil.move, shutil.copytree], ids=["moved", "copied"])
def test_a_clone_that_was_moved_or_copied_makes_its_environment_again(clone, how):
    set_up(clone)
    other = clone.with_name("two")
    how(clone, other)
    said, asked = set_up(other)
    assert f"{other}/.cache/venv was made for another folder; it is made again" in said
    assert f"-m venv {other}/.cache/venv" in asked
    assert f"{clone}/" not in asked
    assert set_up(other) == ("", "")


def test_new_packages_come_into_the_environment_that_is_there(clone):
    set_up(clone)
    (clone / "pyproject.toml").write_text("# changed")
    asked = set_up(clone)[1]
    assert "-m pip install" in asked
    assert "-m venv" not in asked


def test_make_takes_a_blank_in_the_path(clone):
    there = clone.with_name("my things")
    shutil.move(clone, there)
    shutil.copy(ROOT / "Makefile", there)
    (clone.parent / "log").write_text("")
    environment = {key: value for key, value in os.environ.items() if key != "FRAMESTEP_CACHE"}
    result = subprocess.run(
        ["make", "-C", there, "sim", "ARGS=--speed max"],
        env={**environment, "PYTHON": str(clone.parent / "python")},
        capture_output=True,
        text=True,
    )
    assert result.returncode == 0, result.stderr
    asked = (clone.parent / "log").read_text()
    assert f"{there}/.cache/venv/bin/python -m framestep_tools sim --speed max" in asked


def test_a_build_of_micropython_says_that_it_takes_none(clone):
    there = clone.with_name("my things")
    shutil.move(clone, there)
    shutil.copytree(ROOT / "tools/micropython", there / "tools/micropython")
    result = subprocess.run(
        ["bash", there / "tools/micropython/build.sh", "rp2"], capture_output=True, text=True
    )
    assert result.returncode == 1
    assert f"takes no blank in a path: move this folder to one without ({there})" in result.stderr
