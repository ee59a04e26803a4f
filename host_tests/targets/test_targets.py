"""Which scenarios a target plays."""

import importlib
import re

import pytest

from host_tests.targets import NAMES, NEEDS, SCENARIOS, FirstLevels, pytest_run


def chosen(*words: str) -> set[str]:
    """Return the names of the scenarios that would be played."""
    done = pytest_run("--all", "--collect-only", *words, str(SCENARIOS))
    assert done.returncode == 0, done.stdout + done.stderr
    return {line for line in done.stdout.splitlines() if "::" in line}


@pytest.mark.parametrize("name", NAMES[1:])
def test_what_it_lacks_has_a_meaning(name):
    lacks = importlib.import_module(f"host_tests.targets.{name}").LACKS
    assert lacks
    assert lacks <= set(NEEDS)


def test_each_need_is_a_tests():
    """A need that no scenario has would leave nothing out."""
    texts = "".join(path.read_text() for path in SCENARIOS.rglob("test_*.py"))
    named = set(re.findall(r'mark\.needs\(\s*"([^"]+)"', texts))
    assert named <= set(NEEDS)
    assert {need for need in NEEDS if need not in ("edges", "inputs")} <= named


def test_the_host_plays_all_and_others_leave_out_what_they_lack():
    whole = chosen()
    board = chosen("--target", "rp2040")
    assert board < whole
    assert "test_any_move" in {name.rpartition("::")[2] for name in board}
    # about DMX, and about the inside
    for file in ("test_lights_and_triggers.py", "test_led.py"):
        assert any(f"/{file}::" in name for name in whole - board)


def test_the_level_that_a_trace_begins_with_is_no_edge():
    first = FirstLevels()
    assert first.drop([(0, "gio1", 0), (5, "gio1", 1)]) == [(5, "gio1", 1)]
    assert first.drop([(9, "gio1", 0), (9, "m1", 1)]) == [(9, "gio1", 0), (9, "m1", 1)]


def test_a_share():
    short = chosen("--target", "esp32", "-m", "not long")
    part = chosen("--target", "esp32", "--share", "10")
    assert part < short < chosen("--target", "esp32")
    assert len(part) == pytest.approx(len(short) / 10, abs=1)


@pytest.mark.parametrize(
    "mark, said",
    [
        ('needs("wings")', "needs {'wings'}, which is none of NEEDS"),
        ('needs("edges", only=("9",))', "there is no test"),
    ],
)
def test_a_mark_that_means_nothing_is_refused(tmp_path, mark, said):
    file = tmp_path / "test_marked.py"
    file.write_text(
        "import pytest\n\n\n"
        f"@pytest.mark.{mark}\n"
        '@pytest.mark.parametrize("value", [1, 2])\n'
        "def test_it(value):\n    pass\n"
    )
    folder = SCENARIOS.parent.parent
    done = pytest_run(
        "--collect-only", f"--rootdir={folder}", "-c", str(folder / "pyproject.toml"),
        f"--confcutdir={folder}", "-p", "host_tests.conftest", str(file),
    )  # fmt: skip
    assert done.returncode != 0
    assert said in done.stdout + done.stderr


def test_a_device_needs_a_port():
    done = pytest_run("--collect-only", "--target", "device", str(SCENARIOS))
    assert "--target device needs --port" in done.stdout + done.stderr
