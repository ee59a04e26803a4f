"""The store of light levels and triggers as machine code of the board: it answers in time."""

from pathlib import Path

from host_tests.board.modules import board_modules

MODULES = (
    "__init__", "base/__init__", "base/native", "base/clock", "base/copying", "base/results",
    "hal/__init__", "io/__init__", "io/lights",
)  # fmt: skip
MODULES += (
    "moves/__init__", "moves/upload/__init__", "moves/upload/chunks", "moves/upload/codec",
    "moves/upload/store",
)  # fmt: skip
MODULES += ("moves/upload/light_codec", "moves/upload/light_levels", "moves/upload/triggers")
MODULES += ("protocol/__init__", "protocol/messages", "protocol/checksum", "protocol/frames")
MEASURE = Path(__file__).parent / "lightplots_times.py"


def test_times(emulator):
    printed = emulator(files=board_modules(MODULES)).repl().exec(MEASURE.read_text(), timeout=60)
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
