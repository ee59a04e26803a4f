import pytest

from framestep_tools.building.board_files import folded, sources
from framestep_tools.building.constants import FoldError, fold, without_compiler_imports

CODES = """from framestep.base.native import const

OK = const(0x10)
LOWEST = const(-4)
_OWN = const(3)
TABLE = {OK: "ok"}


def known(code):
    return code in TABLE or code == OK + _OWN
"""


def folded_one(text: str, **options) -> str:
    return fold({"a/codes.py": CODES, "a/user.py": text}, **options)["a/user.py"]


def test_names_of_a_module_and_imported_names_become_numbers():
    """An import that is not needed any more goes."""
    user = folded_one(
        "from a import codes as c\n"
        "from a.codes import LOWEST as low\n"
        "x = [c.OK, low, c.known(c.LOWEST)]\n"
    )
    assert user == "from a import codes as c\npass\nx = [16, (-4), c.known((-4))]\n"
    assert folded_one("from a import codes\nx = codes.OK\n") == "pass\nx = 16\n"


def test_lines_stay_where_they_are():
    user = folded_one("from a.codes import (\n    OK,\n    known,\n)\ny = known(\n    OK\n)\n")
    assert user.splitlines() == [
        "from a.codes import known", "", "", "", "y = known(", "    16", ")",
    ]  # fmt: skip


def test_constants_lose_their_public_name_unless_they_are_to_stay():
    hidden = fold({"a/codes.py": CODES})["a/codes.py"]
    assert "_OK = const(0x10)" in hidden
    assert "{_OK: " in hidden
    assert "code == _OK + _OWN" in hidden
    assert fold({"a/codes.py": CODES}, hide=False)["a/codes.py"] == CODES


def test_a_free_name_is_found():
    text = "A = const(1)\n_A = const(2)\nx = A, _A\n"
    assert fold({"a.py": text})["a.py"] == "__A = const(1)\n_A = const(2)\nx = __A, _A\n"


def test_constants_made_of_those_of_others():
    a = "from b import N\nM = const(N << 2 | 1)\n"
    b = "import sys\nN = const(2 + 3)\n"
    c = "from a import M\nx = M\n"
    assert fold({"c.py": c, "a.py": a, "b.py": b})["c.py"] == "pass\nx = 21\n"


def test_what_is_given_is_folded_for_others():
    a = "try:\n    import micropython\n    CPYTHON = False\nexcept ImportError:\n    CPYTHON = 1\n"
    b = "from a import CPYTHON\nif CPYTHON:\n    pass\n"
    texts = fold({"a.py": a, "b.py": b}, given={"a": {"CPYTHON": 0}})
    assert texts == {"a.py": a, "b.py": "pass\nif 0:\n    pass\n"}


@pytest.mark.parametrize(
    "text",
    [
        "from a import codes\ndef f(codes):\n    return codes.OK\n",
        "from a.codes import OK\nOK = 5\n",
        "from a.codes import OK\ndef f():\n    OK = 1\n",
        "from a import codes as c\nfor c in range(3):\n    pass\n",
        "N = const(1)\nclass N:\n    pass\n",
    ],
)
def test_a_name_with_two_meanings_is_refused(text):
    with pytest.raises(FoldError, match=r"a/user.py, line \d+: \w+ is a constant or a module here"):
        folded_one(text)


@pytest.mark.parametrize(
    ("texts", "what"),
    [
        (["N = const('x')\n"], "not a whole number"),
        (["N = const(1)\nN = const(2)\n"], "constant already"),
        (["from b import N\nM = const(N)\n", "from a import M\nN = const(M)\n"],
         "need one another"),
    ],
)  # fmt: skip
def test_odd_constants_are_refused(texts, what):
    with pytest.raises(FoldError, match=what):
        fold(dict(zip(("a.py", "b.py"), texts, strict=False)))


def test_the_core_folds_line_by_line():
    for name, text in folded({}, hide=True).items():
        source = sources()[name].read_text()
        assert len(text.decode().splitlines()) == len(source.splitlines()), name


def test_bytes_of_numbers_become_a_literal():
    user = folded_one(
        "from a import codes as c\nfrom framestep.base.native import const\n_A = const(2)\n"
        "x = bytes(\n    (c.OK, _A + 1)\n    + (c.OK + _A, 255)\n)\ny = bytes((1, z))\n"
    )
    assert user.splitlines()[3:] == [r"x = b'\x10\x03\x12\xff'", "", "", "", "y = bytes((1, z))"]


def test_imports_for_the_compiler_alone_are_dropped():
    text = """from framestep.base.native import addressof, const, micropython, ptr8, ptr32

_N = const(3)


@micropython.viper
def f(data: ptr8, words: ptr32) -> int:
    return data[_N] + ptr32(words)[0]


x = addressof
"""
    first = without_compiler_imports(text).splitlines()[0]
    assert first == "from framestep.base.native import addressof"
    text = text.replace(" addressof,", "").replace("x = addressof\n", "")
    assert without_compiler_imports(text).splitlines()[0] == "pass"


def test_imports_that_the_board_looks_up_stay():
    text = "from framestep.base.native import const, micropython, ptr8\n"
    for use, kept in (
        ("x = const(3)\n", "const"),
        ("_X = {1: const(3)}\n", "const"),
        ("def f():\n    micropython.kbd_intr(3)\n", "micropython"),
        ("def f(x):\n    return ptr8(x)\n", "ptr8"),
        ("if 1:\n    def f(x):\n        return ptr8(x)\n", "ptr8"),
    ):
        first = without_compiler_imports(text + use).splitlines()[0]
        assert first == f"from framestep.base.native import {kept}"
    hidden = "if 0:\n    def f(x):\n        return ptr8(x)\n"
    assert without_compiler_imports(text + hidden).splitlines()[0] == "pass"


def test_bytes_strings_and_tuples_with_an_underscore_are_hidden():
    """The compiler inserts them where they are used; names of other modules stay."""
    text = "_A = b'ab'\n_B = (\n    1,\n    2,\n)\nC = b'c'\n_D = [1]\n_E = b'e'\n_E = b'f'\n"
    hidden = fold({"framestep/a.py": text})["framestep/a.py"]
    assert hidden.splitlines() == [
        "_A = const(b'ab')", "_B = const((1, 2))", "", "", "", "C = b'c'", "_D = [1]", "_E = b'e'",
        "_E = b'f'",
    ]  # fmt: skip
    assert fold({"framestep/a.py": text}, hide=False)["framestep/a.py"] == text
