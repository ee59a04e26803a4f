"""Formulas of a module in one string: framestep_tools.pooling."""

import re

import pytest

from framestep_tools import files
from framestep_tools.pooling import pooled

_TEXT = '''"""A module."""
_SUM = b"\\x01\\x02\\x03\\x04\\x00\\x00\\x00\\x00"
_LONG = b"\\x05\\x06\\x07\\x08\\x01\\x02\\x03\\x04\\x00\\x00\\x00\\x00"
_OTHER = (
    b"\\x09\\x00"
)
_PASSED = b"\\x0a\\x00"
SHARED = b"\\x0b\\x00"


def _with(formula):
    compute(0, 0, r, formula)


def run():
    compute(0, 0, r, _SUM)
    if compute(0, 0, self.r, _LONG) and not compute(0, 0, r, _OTHER):
        _with(_PASSED)
    compute(0, 0, r, SHARED)
'''


def _run(text):
    """The module's names after run(); "calls": those of compute(), (where, formula)."""
    names = {"r": [], "self": type("Self", (), {"r": []}), "calls": []}

    def compute(at, _, registers, formula):
        names["calls"].append((at, formula))
        return len(names["calls"]) == 2

    names["compute"] = compute
    exec(text, names)
    names["run"]()
    return names


def test_a_call_has_the_bytes_of_its_formula():
    before = [formula for _, formula in _run(_TEXT)["calls"]]
    after = _run(pooled({"a.py": _TEXT})["a.py"])["calls"]
    assert [
        formula[at : at + len(code)] for code, (at, formula) in zip(before, after, strict=True)
    ] == before


def test_one_that_is_part_of_another_takes_nothing():
    names = _run(pooled({"a.py": _TEXT})["a.py"])
    assert len(names["_SUM"]) == 12 + 2 + 2  # _LONG, which has _SUM in it, _OTHER and SHARED
    assert "_LONG" not in names


def test_what_others_use_stays():
    text = pooled({"a.py": _TEXT, "b.py": "from a import SHARED\n"})["a.py"]
    names = _run(text)
    assert names["_PASSED"] == b"\x0a\x00"
    assert names["SHARED"] == b"\x0b\x00"
    assert "compute(0, 0, r, SHARED)" in text


def test_lines_stay():
    text = pooled({"a.py": _TEXT})["a.py"]
    assert len(text.splitlines()) == len(_TEXT.splitlines())
    assert text.splitlines().index("def run():") == _TEXT.splitlines().index("def run():")


@pytest.mark.parametrize("extra", ["x = _OTHER\n", "_OTHER = b''\n"])
def test_a_formula_that_means_something_else_stays(extra):
    text = pooled({"a.py": _TEXT + extra})["a.py"]
    assert "compute(0, 0, r, _OTHER)" in text


def test_one_formula_stays():
    text = "_SUM = b'\\x00'\ncompute(0, 0, r, _SUM)\n"
    assert pooled({"a.py": text})["a.py"] == text


def test_a_board_has_one_string_for_all_moves():
    source = files._copied_sources("pico")["framestep/moves/requests.mpy"].decode()
    formulas = set(re.findall(r"compute\(\d+, 0, \w+, (\w+)\)", source))
    assert len(formulas) <= 3  # but for those that a condition chooses
