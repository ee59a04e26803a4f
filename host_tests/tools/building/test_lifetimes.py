"""The build refuses a formula's result that is read after another one has taken its register."""

import pytest

from framestep_tools.building import board_files, lifetimes
from framestep_tools.building.constants import FoldError

HEAD = """
from framestep.motion import reals
from framestep.motion.compute import compute
from framestep.motion.formula import formula
from framestep import registers

_HALF = formula(registers, "whole -> half", "half = whole / 2")
_TWICE = formula(registers, "whole -> twice", "twice = whole * 2")
_AFTER = formula(registers, "half -> more", "more = half + 1", half=_HALF.half)
"""
REFUSED = "# refused: "  # a comment on the line that is, with the reason
REGISTERS = """
from framestep.base.native import const
ARGUMENTS = const(4)
ARGUMENTS_END = const(12)
SCRATCH = const(20)
SCRATCH_END = const(30)
"""


def check(body, other=""):
    return lifetimes.check(
        {
            "framestep/registers.py": REGISTERS,
            "framestep/user.py": HEAD + body,
            "framestep/other.py": HEAD + other,
            "framestep/base/native.py": "",
            "framestep/motion/formula.py": "",
            "framestep/motion/compute.py": "",
            "framestep/motion/reals.py": "",
        }
    )


GOOD = """
def halved(r):
    reals.put(r, _HALF.whole, 4, 0)
    compute(r, _HALF)
    return reals.floor(r, _HALF.half, 9)
"""


def test_what_is_right_is_counted():
    assert check(GOOD) == 2
    assert check(GOOD + GOOD.replace("halved", "again")) == 4


@pytest.mark.parametrize(
    "body",
    [
        # a parameter that another formula has left, by its declaration
        """
def f(r):
    reals.put(r, _HALF.whole, 4, 0)
    compute(r, _HALF)
    compute(r, _AFTER)
    return reals.floor(r, _AFTER.more, 9)
""",
        # both ways set it
        """
def f(r, n):
    if n:
        reals.put(r, _HALF.whole, 4, 0)
    else:
        reals.put(r, _HALF.whole, 5, 0)
    compute(r, _HALF)
""",
        # a loop that is left when it has been computed
        """
def f(r, n):
    while n:
        reals.put(r, _HALF.whole, n, 0)
        if compute(r, _HALF):
            break
    else:
        return -1
    return reals.floor(r, _HALF.half, 9)
""",
        # a call that computes nothing
        """
def g(r):
    reals.put(r, 40, 1, 0)

def f(r):
    reals.put(r, _HALF.whole, 4, 0)
    g(r)
    compute(r, _HALF)
""",
    ],
)
def test_what_is_right_passes(body):
    assert check(body) >= 1


@pytest.mark.parametrize(
    "body",
    [
        """
def f(r):
    reals.put(r, _HALF.whole, 4, 0)
    compute(r, _HALF)
    reals.put(r, _TWICE.whole, 4, 0)
    compute(r, _TWICE)
    return reals.floor(r, _HALF.half, 9)  # refused: _HALF.half is read
""",
        """
def f(r):
    compute(r, _HALF)  # refused: _HALF is computed, but nothing has set whole
""",
        """
def f(r):
    reals.put(r, _HALF.whole, 4, 0)
    reals.put(r, _TWICE.whole, 4, 0)
    compute(r, _HALF)  # refused: _HALF is computed, but nothing has set whole
""",
        """
def f(r, n):
    if n:
        reals.put(r, _HALF.whole, 4, 0)
    compute(r, _HALF)  # refused: _HALF is computed, but nothing has set whole
""",
        """
def f(r):
    reals.put(r, _HALF.whole, 4, 0)
    compute(r, _HALF)
    deep(r)
    return reals.floor(r, _HALF.half, 9)  # refused: _HALF.half is read
""",
        """
def f(r, n):
    reals.put(r, _HALF.whole, 4, 0)
    compute(r, _HALF)
    reals.put(r, _TWICE.whole, 4, 0)
    compute(r, _HALF if n else _TWICE)
    return reals.floor(r, _HALF.half, 9)  # refused: _HALF.half is read
""",
        """
def f(r, n):
    reals.put(r, _HALF.whole, 4, 0)
    for k in range(n):
        compute(r, _HALF)  # refused: _HALF is computed, but nothing has set whole
        reals.put(r, _TWICE.whole, k, 0)
        compute(r, _TWICE)
""",
    ],
)
def test_what_is_wrong_is_refused_with_its_place(body):
    other = """
def deep(r):
    deeper(r)

def deeper(r):
    reals.put(r, _TWICE.whole, 4, 0)
    compute(r, _TWICE)
"""
    (place,) = (
        f"line {line}: {text.partition(REFUSED)[2]}"
        for line, text in enumerate((HEAD + body).splitlines(), 1)
        if REFUSED in text
    )
    with pytest.raises(FoldError, match=rf"framestep/user\.py, {place}"):
        check(body, other)


def test_the_firmware_s_formulas_are_checked(monkeypatch):
    counts = []
    original = lifetimes.check
    monkeypatch.setattr(lifetimes, "check", lambda *args: counts.append(original(*args)))
    board_files.folded.__wrapped__({}, True, next(iter(board_files.ENGINES)))
    assert counts[0] > 50
