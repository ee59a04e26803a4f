"""Modules that are one on a board."""

import pytest

from framestep_tools.constants import FoldError
from framestep_tools.files import _copied_sources, sources
from framestep_tools.merging import LINES, groups, merge, where

FIRST = """from array import array
_LIMIT = const(3)
def _help(x): return x + _LIMIT
class Point:
    def __init__(self): self.words = array("i", [_help(1)])
"""
LAST = """from array import array
from p import first
from p.first import Point
_LIMIT = const(4)
def _help(x): return x + _LIMIT
def run(point=None): return (point or Point()).words[0], _help(1), first._help(2)
"""
OTHER = "from p.first import Point as P, _LIMIT\nfrom p import last\nmade = P()\n"


def merged(first: str = FIRST, last: str = LAST, **others: str) -> dict[str, str]:
    texts = {"p/first.py": first, "p/last.py": last} | {
        f"p/{name}.py": text for name, text in others.items()
    }
    return merge(texts, {"p/last.py": ("p/first.py",)})


def test_one_module_does_what_they_did():
    found = merged()
    assert set(found) == {"p/last.py"}
    names: dict[str, object] = {"const": int}
    exec(found["p/last.py"], names)
    run = names["run"]
    assert callable(run)
    assert run() == (4, 5, 5)


def test_imports_stand_once_and_names_of_two_files_get_a_number():
    text = merged()["p/last.py"]
    assert text.count("import") == 1
    assert "_LIMIT_2 = const(4)" in text
    assert "def _help_2(x): return x + _LIMIT_2" in text


def test_a_module_outside_imports_from_where_they_are():
    other = merged(other=OTHER)["p/other.py"].splitlines()
    assert other == [
        "from p.last import Point as P, _LIMIT as _LIMIT",
        "from p import last",
        "made = P()",
    ]


def test_lines_lead_back_to_the_files():
    lines = merged()["p/last.py"].splitlines()
    merges = {"p/last.py": ("p/first.py",)}
    assert lines[LINES + 5].startswith("def run")
    assert where("p/last.py", LINES + 6, merges) == ("p/last.py", 6)
    assert lines[3].startswith("class Point")
    assert where("p/last.py", 4, merges) == ("p/first.py", 4)
    assert where("p/other.py", 2345, merges) == ("p/other.py", 2345)


@pytest.mark.parametrize(
    "first, last, what",
    [
        ("min = 3\n", "", "built-in"),
        ("from array import array\n", "from uarray import array\n", "another thing"),
        ("x = 1\n", "x = 2\ndef f(x): return x\n", "a variable of a function"),
        ("x = 1\n", "x = 2\ndef f(): return f'{x}'\n", "names what is called otherwise"),
        ("x = 1\n", "from p.first import y\n", "not yet there"),
        ("from p.last import x\n", "x = 1\n", "not yet there"),
        ("x = 1\n", "from p import first\nprint(first.y)\n", "has no y"),
        ("x = 1\n", "from p import first\nprint(first)\n", "is no module on a board"),
        ("\n" * (LINES + 1), "", "more than"),
    ],
)
def test_what_cannot_be_merged_is_told(first, last, what):
    with pytest.raises(FoldError, match=what):
        merged(first, last)


def test_a_module_that_is_gone_cannot_be_imported_as_such():
    with pytest.raises(FoldError, match="import from it"):
        merged(other="from p import first\n")


def test_a_package_is_one_module_in_the_order_of_its_imports():
    texts = {
        "p/__init__.py": "",
        "p/a.py": "from p.b import x\n",
        "p/b.py": "from p import c\n",
        "p/c.py": "",
        "p/apart.py": "from p import a",
        "p/last.py": "from p import a",
    }
    assert groups(texts, {"p/last.py": ("apart",)}, {}) == {
        "p/last.py": ["p/c.py", "p/b.py", "p/a.py"]
    }
    assert groups(texts, {}, {"p/a.py": ("b", "c")}) == {"p/a.py": ["p/c.py", "p/b.py"]}
    with pytest.raises(FoldError, match="imports p/last"):
        groups(texts | {"p/a.py": "from p.last import x\n"}, {"p/last.py": ()}, {})


def test_boards_have_them_merged():
    found = _copied_sources("pico")
    for last, others in groups(
        {path: file.read_text() for path, file in sources().items()}
    ).items():
        assert others
        assert last.removesuffix("py") + "mpy" in found
        assert not {path.removesuffix("py") + "mpy" for path in others} & set(found)
