"""The fuzzer itself: it replays its findings, and its checks find the faults that they are for."""

from pathlib import Path

import pytest

from host_tests.int32 import Outside, rewritten
from host_tests.script import parse

from . import fuzz, reader

SCRIPTS = sorted((Path(__file__).parent / "scripts").glob("*.txt"))


@pytest.mark.parametrize("path", SCRIPTS, ids=lambda path: path.stem)
def test_what_was_found_passes(path):
    with path.open() as file:
        fuzz.replay(parse(file))


# ---- numbers -------------------------------------------------------------------------------------

KERNEL = """
from framestep.base.native import micropython, ptr32
_MASK = 0x3FFFFFFF
@micropython.viper
def kernel(a: int, b: int) -> int:
    {}
def python(a, b):
    {}
"""


def outcome(line, a, b, name="kernel"):
    """Return the result of a function of one line, or Outside."""
    from host_tests import int32

    space: dict = {}
    exec(rewritten(KERNEL.format(line, line), "test"), space)
    int32.armed = True
    try:
        return space[name](a, b)
    except Outside:
        return Outside
    finally:
        int32.armed = False


@pytest.mark.parametrize(
    "line, a, b",
    [
        ("return a + b", 2**31 - 1, 1),
        ("return a - b", -(2**31), 1),
        ("return a * b >> 16", 2**20, 2**11),
        ("return -a", -(2**31), 0),
        ("a <<= b; return a", 1, 31),
        ("a -= b; return 0", -(2**31), 1),
        ("return (a + b) // 2", 2**31 - 1, 1),
        ("return (a >> (a + b)) & _MASK", 2**31 - 1, 1),
        ("return [0, 1][(a + b) >> 31]", 2**31 - 1, 1),
    ],
)
def test_a_kernel_that_leaves_a_word_is_reported(line, a, b):
    assert outcome(line, a, b) is Outside


@pytest.mark.parametrize(
    "line, a, b, result",
    [
        ("return a + b", 2**31 - 2, 1, 2**31 - 1),
        ("return a - b", -(2**31) + 1, 1, -(2**31)),
        ("return (a + b) & _MASK", 2**31 - 1, 1, 0),
        ("return a + b  # wraps", 2**31 - 1, 1, -(2**31)),
        ("a -= b  # wraps\n    return a", -(2**31), 1, 2**31 - 1),
        ("return (a << b) & 255", 2**30 + 1, 4, 16),
        ("return (a * b + 1) & 0x7FFFFFFF", 2**20, 2**11, 1),
    ],
)
def test_what_fits_or_is_masked_passes(line, a, b, result):
    assert outcome(line, a, b) == result


@pytest.mark.parametrize(
    "line, a, b",
    [("return a + b", 2**30 - 1, 1), ("return [a][b]", 2**30, 0), ("return abs(a)", -(2**30), 0)],
)
def test_a_pass_that_makes_a_large_number_is_reported(line, a, b):
    assert outcome(line, a, b, "python") is Outside
    assert outcome(line, 5, 0, "python") == 5


# ---- the frame reader ----------------------------------------------------------------------------


def test_streams_grown_by_coverage():
    tried, kept, steps = reader.explore("frames", cases=150)
    assert tried == 150
    assert kept > 15
    assert steps > 250


def test_a_difference_between_the_readers_is_reported(monkeypatch):
    monkeypatch.setattr(reader.READER, "drop_partial", lambda self: None)
    with pytest.raises(reader.Mismatch):
        reader.explore("frames", cases=150)


def test_fuzzing_plays_a_session_or_fails(monkeypatch, capsys):
    """However short the time, and however long the frame reader has taken of it."""

    def run(*words):
        monkeypatch.setattr("sys.argv", ["fuzz", "--seed", "7", "--requests", "20", *words])
        status = fuzz.main()
        return status, capsys.readouterr().out

    status, said = run("--seconds", "0")
    assert status == 0
    assert "requests in 1 sessions" in said
    status, said = run("--sessions", "0")
    assert status == 1
    assert "no request was played" in said
