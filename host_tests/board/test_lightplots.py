"""The store of light levels and triggers as machine code of the board: it answers as on CPython,
and in time."""

from pathlib import Path

import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

from host_tests.board.modules import board_modules
from host_tests.moves.upload import lightplots

RUNTIME = Path(__file__).parents[1] / "runtime"
MODULES = (
    "__init__",
    "base/__init__",
    "base/native",
    "base/clock",
    "base/copying",
    "base/results",
    "hal/__init__",
    "io/__init__",
    "io/lights",
)
MODULES += (
    "moves/__init__",
    "moves/upload/__init__",
    "moves/upload/chunks",
    "moves/upload/codec",
    "moves/upload/store",
)
MODULES += ("moves/upload/light_codec", "moves/upload/light_levels", "moves/upload/triggers")
MODULES += ("protocol/__init__", "protocol/messages", "protocol/checksum", "protocol/frames")
ANSWER = """
from lightplots_replay import replay
with open("script.txt") as script:
    for answer in replay(line.strip() for line in script):
        print(answer)
"""
MEASURE = Path(__file__).parent / "lightplots_times.py"


def board_files(**more):
    return {**board_modules(MODULES), **more}


@pytest.mark.repeats  # as runtime/test_lightplots.py, on another processor
@given(st.lists(lightplots.plots(), min_size=12, max_size=12))
@settings(
    max_examples=3,
    derandomize=True,
    database=None,
    phases=[Phase.generate],
    suppress_health_check=list(HealthCheck),
)
def test_any_plot(emulator, scripts):
    script = [step for script in scripts for step in script]
    lines = "".join(line + "\n" for line, _ in script)
    files = board_files(
        **{
            "/lightplots_replay.py": (RUNTIME / "lightplots_replay.py").read_bytes(),
            "/script.txt": lines.encode(),
        }
    )
    answers = emulator(files=files).repl().exec(ANSWER, timeout=60).split("\n")
    for (line, step), answer, wanted in zip(
        script, answers, lightplots.expected(script, answers[: len(script)]), strict=False
    ):
        assert answer.strip() == wanted, (line[:60], step[:4])
    assert len(answers) >= len(script)


def test_times(emulator):
    printed = emulator(files=board_files()).repl().exec(MEASURE.read_text(), timeout=60)
    print(printed)
    measured = {
        line.split()[0]: [int(x) for x in line.split()[1:]] for line in printed.splitlines()
    }
    assert measured["bytes"][0] < 3800
    for stored in ("still", "fades", "noise", "again"):
        assert all(0 < us < 7000 for us in measured[stored]), stored
    assert -5000 < measured["refused"][0] < 0
    for played in ("steps", "apart", "full"):
        assert all(0 < us < 4000 for us in measured[played]), played
