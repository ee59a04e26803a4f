import ast

from framestep_tools.files import _STAYS, folded, sources
from framestep_tools.merging import groups
from framestep_tools.names import lean


def leaned(text: str, **options) -> str:
    return lean({"a.py": text}, **options)["a.py"]


def test_what_the_compiler_alone_needs_is_not_imported():
    text = """from framestep.native import addressof, const, micropython, ptr8, ptr32

_N = const(3)


@micropython.viper
def f(data: ptr8, words: ptr32) -> int:
    return data[_N] + ptr32(words)[0]


x = addressof
"""
    assert leaned(text).splitlines()[0] == "from framestep.native import addressof"
    assert (
        leaned(text.replace(" addressof,", "").replace("x = addressof\n", "")).splitlines()[0]
        == "pass"
    )


def test_what_is_used_at_work_is_imported():
    text = "from framestep.native import const, micropython, ptr8\n"
    for use, kept in (
        ("x = const(3)\n", "const"),
        ("_X = {1: const(3)}\n", "const"),
        ("def f():\n    micropython.kbd_intr(3)\n", "micropython"),
        ("def f(x):\n    return ptr8(x)\n", "ptr8"),
        ("if 1:\n    def f(x):\n        return ptr8(x)\n", "ptr8"),
    ):
        assert leaned(text + use).splitlines()[0] == f"from framestep.native import {kept}"
    assert leaned(text + "if 0:\n    def f(x):\n        return ptr8(x)\n").splitlines()[0] == "pass"


def test_parameters_are_numbered():
    assert leaned("def f(self, first, second=first):\n    first.second = [second, first]\n") == (
        "def f(self, _1, _2=first):\n    _1.second = [_2, _1]\n"
    )


def test_parameters_that_something_names_keep_their_names():
    for text in (
        "def f(x):\n    return [x for y in x]\n",
        "def f(x):\n    return lambda: x\n",
        "def f(*x):\n    return x\n",
        "def f(x):\n    return x\n\n\nf(x=3)\n",
        "def f(x):\n    try:\n        pass\n    except OSError as x:\n        pass\n",
        "def f(x):\n    from y import x\n",
        "def f(x):\n    global y\n",
    ):
        assert leaned(text) == text
    assert leaned("def f(x):\n    return x\n", by_hand=("a",)) == "def f(x):\n    return x\n"


def test_kernels_and_data_of_a_module_are_numbered():
    text = """_N = const(3)
_WORDS = [_N]


@micropython.viper
def _kernel(x: int) -> int:
    return x


def _kept(x):
    return _kernel(x) + _WORDS[0]
"""
    assert leaned(text) == text.replace("_WORDS", "__1").replace("_kernel", "__2").replace(
        "(x", "(_0"
    ).replace("return x", "return _0")
    for use in (
        "a._WORDS = 3\n",
        "from b import _WORDS\n",
        "x = '_WORDS'\n",
        "def f():\n    _WORDS = 3\n",
    ):
        assert "_WORDS" in leaned(text + use)
    assert "_kernel" in leaned(text, kept={"_kernel"})


def test_data_of_objects_is_numbered():
    text = (
        "class A:\n"
        "    def f(self, x):\n"
        "        self._one = x._two = self.three\n"
        "        x.y(self)._two = 1\n"
    )
    assert leaned(text) == (
        "class A:\n"
        "    def f(self, _1):\n"
        "        self._1 = _1._2 = self.three\n"
        "        _1.y(self)._2 = 1\n"
    )


def test_objects_keep_data_that_others_may_look_up():
    text = "class A:\n    def f(self):\n        self._one = 1\n"
    for more in (
        "    def _one(self): pass\n",  # a method has a name in tracebacks
        "    _one = 2\n",
        "x = getattr(A(), '_one')\n",
    ):
        assert leaned(text + more) == text + more
    assert leaned("import sys\nx = sys._one\n") == "import sys\nx = sys._one\n"


def test_objects_of_two_modules_keep_their_data():
    """Numbers of the one would be those of the other."""
    base = "class A:\n    def f(self):\n        self._one = 1\n"
    own = "class B({0}):\n    def g(self):\n        self._two = 1\n"
    for derived in (
        "from a import A\n" + own.format("A"),
        "from c import a as b\n" + own.format("b.A"),
    ):
        found = lean({"a.py": base, "c/a.py": base.replace("one", "three"), "d.py": derived})
        assert found["d.py"] == derived
        assert "_one" in found["a.py"] or "_three" in found["c/a.py"]
    alike = lean({"a.py": base, "d.py": "def h(x):\n    x._one += 1\n"})
    assert "self._one" in alike["a.py"]
    assert "._one" in alike["d.py"]
    apart = lean({"a.py": base, "d.py": own.replace("({0})", "")})
    assert "self._1" in apart["a.py"]
    assert "self._1" in apart["d.py"]


def test_a_module_for_a_board_is_the_same_but_for_the_names():
    """Line for line: as many nodes of each kind."""
    whole = folded({}, hide=True)
    short = lean({name: text.decode() for name, text in whole.items()})

    def kinds(text):
        return [
            (type(node).__name__, node.lineno)
            for node in ast.walk(ast.parse(text))
            if isinstance(node, ast.stmt) and not isinstance(node, ast.ImportFrom | ast.Pass)
        ]

    for name, text in short.items():
        assert kinds(text) == kinds(whole[name].decode())


def test_functions_that_stay_in_ram_are_there():
    texts = {name: path.read_text() for name, path in sources().items()}
    merged = groups(texts)
    for module, names in _STAYS.items():
        path = module.removesuffix(".mpy") + ".py"
        trees = [ast.parse(texts[each]) for each in (*merged.get(path, ()), path)]
        functions = [n for tree in trees for n in ast.walk(tree) if isinstance(n, ast.FunctionDef)]
        assert names <= {function.name for function in functions}
