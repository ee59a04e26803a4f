"""Each check of the Makefile covers what it says, and fails if it finds nothing to check. What
`make check` runs is in test_near.py."""

import importlib.util
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from framestep_tools.building.board_files import ROOT

_SPEC = importlib.util.spec_from_file_location("check_types", ROOT / "tools/check_types.py")
check_types = importlib.util.module_from_spec(_SPEC)
_SPEC.loader.exec_module(check_types)


IMAGES = "framestep_tools.building.images"


def modules(folder):
    """Return the Python files of a folder of the project, without what was built or installed."""
    inside = (path.relative_to(ROOT) for path in (ROOT / folder).rglob("*.py"))
    made = {".cache", "build", "node_modules"}
    return {ROOT / path for path in inside if not made.intersection(path.parts)}


def test_types_are_those_of_all_the_firmware():
    assert set(check_types.board_files()) == modules("firmware")


def test_types_without_a_module_have_failed(tmp_path, capsys):
    assert check_types.check_board(tmp_path) == 1
    assert f"no module to check in {tmp_path}" in capsys.readouterr().out
    (tmp_path / "tools" / "framestep_tools").mkdir(parents=True)
    (tmp_path / "tools" / "framestep_emulator").mkdir()
    assert check_types.check_host(tmp_path) != 0


def test_a_name_that_micropython_lacks_is_found(tmp_path, capsys):
    (tmp_path / "board.py").write_text("import machine\nmachine.unknown()\nmachine.freq()\n")
    assert check_types.check_board(tmp_path) == 1
    (said,) = capsys.readouterr().out.splitlines()
    assert 'board.py:2: error: Module has no attribute "unknown"' in said


def test_style_is_that_of_all_modules():
    shown = subprocess.run(
        [sys.executable, "-m", "ruff", "check", "--show-files"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    )
    assert {str(path) for path in modules(".")} <= set(shown.stdout.splitlines())


OXLINT = [Path(sys.executable).with_name("oxlint"), "-c", ROOT / ".oxlintrc.json"]


def test_style_of_scripts_is_that_of_all_of_them():
    tracked = subprocess.run(
        ["git", "ls-files", "--", "*.js", "*.mjs"], cwd=ROOT, capture_output=True, text=True
    )
    shown = subprocess.run(OXLINT, cwd=ROOT, capture_output=True, text=True, check=True)
    assert f" on {len(tracked.stdout.split())} files" in shown.stdout


@pytest.mark.parametrize(
    ("text", "rule"),
    [
        ("export const f = () => known;\n", "no-undef"),
        ("export function f() {\n  const unused = 1;\n}\n", "no-unused-vars"),
        ("export const f = (a) => a == 1;\n", "eqeqeq"),
    ],
)
def test_a_mistake_in_a_script_is_found(tmp_path, text, rule):
    (tmp_path / "page.js").write_text(text)
    shown = subprocess.run(OXLINT, cwd=tmp_path, capture_output=True, text=True)
    assert shown.returncode == 1
    assert f"eslint({rule})" in shown.stdout


@pytest.mark.parametrize("target", ["lint", "test LAYER=core", "test LAYER=emulator"])
def test_a_target_without_files_has_failed(tmp_path, target):
    """Pytest's targets are alike; two stand for all."""
    shutil.copy(ROOT / "Makefile", tmp_path)
    nothing = tmp_path / "tools"
    for script in (nothing / "setup.sh", nothing / "micropython" / "build.sh"):
        script.parent.mkdir(exist_ok=True)
        script.write_text("#!/bin/sh\n")
        script.chmod(0o755)
    # makes no images
    python = tmp_path / "python"
    python.write_text(f'#!/bin/sh\n[ "$2" = {IMAGES} ] || exec "{sys.executable}" "$@"\n')
    python.chmod(0o755)
    result = subprocess.run(
        ["make", "-C", tmp_path, *target.split(), f"PYTHON_VENV={python}", "PROCESSES=1"],
        capture_output=True,
        text=True,
    )
    assert result.returncode != 0
    assert ("no Python file" if target == "lint" else "no tests ran") in result.stdout


def test_a_test_of_each_file_of_an_empty_folder_has_failed(tmp_path):
    (tmp_path / "test_none.py").write_text(
        "import pytest\n\n"
        "@pytest.mark.parametrize('path', [])\n"
        "def test_each(path): pass\n"
        "def test_other(): pass\n"
    )
    words = ["-q", "-c", ROOT / "pyproject.toml", "--rootdir", tmp_path, tmp_path]
    result = subprocess.run(
        [sys.executable, "-m", "pytest", *words], cwd=tmp_path, capture_output=True, text=True
    )
    assert result.returncode != 0
    assert "Empty parameter set in 'test_each'" in result.stdout


@pytest.mark.parametrize(
    ("words", "target"), [([], []), (["TARGET=rp2350"], ["--target", "rp2350"])]
)
def test_the_fuzzer_plays_on_the_host_unless_a_target_is_given(words, target):
    """It has to reach faults of the link and pauses, which no chip shows."""
    command = ["make", "-n", "-C", ROOT, "fuzz", *words]
    outside = {name: value for name, value in os.environ.items() if not name.startswith("MAKE")}
    shown = subprocess.run(command, capture_output=True, text=True, check=True, env=outside)
    (line,) = [line for line in shown.stdout.splitlines() if "host_tests.fuzz.fuzz" in line]
    assert line.split()[line.split().index("60") + 1 :] == target
