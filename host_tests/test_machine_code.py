"""Kernels as machine code of this computer do what they do in Python (machine_code.py)."""

import ast
import importlib.util
import textwrap
import types
from array import array

import pytest
from hypothesis import given
from hypothesis import strategies as st

from framestep_tools.building.board_files import sources
from framestep_tools.building.kernels import kernels
from host_tests import machine_code

KERNELS = """
from framestep.base.clock import elapsed
from framestep.base.native import addressof, micropython, ptr8, ptr16, ptr32
FAR = 2**30

@micropython.viper
def operators(a: int, b: int, out: ptr32) -> int:
    out[0] = (a + b) & 0xFFFF
    out[1] = (a - b) >> 3
    out[2] = (a ^ b) | (a & 3)
    out[3] = a // (b or 1) if a < b else a % (b or 1)
    out[4] = (a << 2) & FAR | (~b & 15)
    out[5] = 1 if not a or b >= 5 and a != 7 else -b
    out[6] = elapsed(a, b)
    i = 7
    while True:
        out[i] += a > i
        i += 1
        if i == 10:
            break
        elif i == 8:
            continue
        out[i] -= 1
    return a * b

@micropython.viper
def divided(a: int, b: int) -> int:
    return a // b

@micropython.viper
def shifted(a: int, b: int) -> int:
    return (a >> b) + (1 << b)

@micropython.viper
def stored(a: int, at: int, words: ptr32, halves: ptr16, bytes_: ptr8):
    if at & 1:
        words[at] = a
    elif at & 2:
        halves[at] = a
    else:
        bytes_[at] = a

@micropython.viper
def counted(words: ptr32) -> int:
    words[0] = words[0] + 1
    return words[0]

@micropython.viper
def in_order(words: ptr32) -> int:
    return 10 * int(counted(words)) + words[0] + 100 * int(counted(words))

@micropython.viper
def linked(table, at: int) -> int:
    w = ptr32(table[at])
    w = ptr32(w[0])
    bytes_ = ptr8(w)
    w[1] = w[1] - 1
    return bytes_[4]

@micropython.viper
def truth(a: int) -> bool:
    return bool(a)

@micropython.viper
def changes(rig, memory: ptr32) -> int:
    before = after = 0
    if rig.on and not rig.off:
        before = int(rig.count)
        rig.count = before + len(rig.words)
        memory[0] = int(rig.doubled(memory[0], 3)) + int(python(rig))
    return before - after + (1 if rig.words else 0)

def python(rig):
    return rig.words[0]

@micropython.viper
def stays(a):
    return [a]
"""
SMALL = st.integers(-9, 9)
WORDS = st.integers(-(2**31), 2**31 - 1)
HALVES = st.integers(-(2**15), 2**15)  # all results of `operators` are words


def loaded(path, text):
    """Return a module with this text in Python, and the same as machine code."""
    assert not (missing := machine_code.missing()), f"install {missing}, to compile kernels"
    path.write_text(text)
    modules = []
    for _ in range(2):
        spec = importlib.util.spec_from_file_location(path.stem, path)
        modules.append(importlib.util.module_from_spec(spec))
        spec.loader.exec_module(modules[-1])
    machine_code.replace(modules[1])
    return modules


@pytest.fixture(scope="module")
def both(tmp_path_factory):
    """Return the module in Python and the same as machine code."""
    modules = loaded(tmp_path_factory.mktemp("kernels") / "kernels.py", KERNELS)
    assert not isinstance(modules[1].operators, types.FunctionType)
    assert isinstance(modules[1].stays, types.FunctionType)
    return modules


def outcomes(both, name, make):
    """Return what a kernel returns, the type of an exception, and what it has changed, of each."""
    found = []
    for module in both:
        given = make(module)
        try:
            result = getattr(module, name)(*given)
        except Exception as error:
            result = ValueError if isinstance(error, OverflowError) else type(error)
        found.append((result, type(result), [list(g) for g in given if hasattr(g, "__len__")]))
    return found


@given(st.one_of(SMALL, HALVES), st.one_of(SMALL, HALVES))
def test_operators(both, a, b):
    here, there = outcomes(both, "operators", lambda _: (a, b, array("i", range(12))))
    assert here == there


@given(st.one_of(SMALL, HALVES), st.integers(-2, 29))
@pytest.mark.parametrize("name", ["divided", "shifted"])
def test_what_has_no_result(both, name, a, b):
    here, there = outcomes(both, name, lambda _: (a, b))
    assert here == there


@given(st.one_of(SMALL, WORDS, st.sampled_from([-1, 255, 256, 65535, 65536])), st.integers(0, 7))
def test_what_fits_an_item(both, a, at):
    def make(_):
        return a, at, array("i", [0] * 6), array("H", [0] * 6), bytearray(6)

    here, there = outcomes(both, "stored", make)
    assert here == there


def test_what_an_item_does_not_hold(both):
    with pytest.raises(OverflowError):
        both[1].stored(2**31, 1, array("i", [0, 0]), array("H"), bytearray())


def test_operands_in_order(both):
    here, there = outcomes(both, "in_order", lambda _: (array("i", [0]),))
    assert here == there
    assert here[0] == 10 + 1 + 200


def test_addresses(both):
    def make(module):
        end = array("i", [0, 0x1234])
        return [array("i", [module.addressof(end)])], 0

    assert [found[:2] for found in outcomes(both, "linked", make)] == [(0x33, int)] * 2
    assert [found[0] for found in outcomes(both, "linked", lambda _: ([array("i", [5])], 0))] == [
        KeyError
    ] * 2


def test_numbers_beyond_a_word(both):
    here, there = outcomes(both, "divided", lambda _: (2**70, 3))
    assert here == there == (2**70 // 3, int, [])


ONE = """
from framestep.base.native import micropython
MASK = 0x3FFFFFFF
@micropython.viper
def kernel(a: int, b: int) -> int:
"""


def one(tmp_path, lines):
    """Return a kernel of these lines as machine code."""
    text = ONE + textwrap.indent(lines, "    ") + "\n"
    kernel = loaded(tmp_path / "one.py", text)[1].kernel
    assert not isinstance(kernel, types.FunctionType)
    return kernel


@pytest.mark.parametrize(
    "lines, a, b",
    [
        ("return a + b", 2**31 - 1, 1),
        ("return a - b", -(2**31), 1),
        ("return a * b >> 16", 2**20, 2**11),
        ("return -a", -(2**31), 0),
        ("a <<= b\nreturn a", 1, 31),
        ("a -= b\nreturn 0", -(2**31), 1),
        ("return (a + b) // 2", 2**31 - 1, 1),
        ("return a // b", -(2**31), -1),
        ("return (a >> (a + b)) & MASK", 2**31 - 1, 1),
        ("return (1 << (a + b)) & MASK", 2**31 - 1, 1),
        ("return ((a + b) // 2) & MASK", 2**31 - 1, 1),
    ],
)
def test_what_leaves_a_word(tmp_path, lines, a, b):
    with pytest.raises(OverflowError, match="leaves 32 bits in a kernel, line 6"):
        one(tmp_path, lines)(a, b)


@pytest.mark.parametrize(
    "lines, a, b, result",
    [
        ("return a + b", 2**31 - 2, 1, 2**31 - 1),
        ("return a - b", -(2**31) + 1, 1, -(2**31)),
        ("return -2147483648 + b", 0, 0, -(2**31)),
        ("return (a + b) & MASK", 2**31 - 1, 1, 0),
        ("return a + b  # wraps", 2**31 - 1, 1, -(2**31)),
        ("a -= b  # wraps\nreturn a", -(2**31), 1, 2**31 - 1),
        ("return (a << b) & 255", 2**30 + 1, 4, 16),
        ("return (a * b + 1) & 0x7FFFFFFF", 2**20, 2**11, 1),
    ],
)
def test_what_fits_is_cut_or_wraps(tmp_path, lines, a, b, result):
    assert one(tmp_path, lines)(a, b) == result


class Rig:
    off = 0

    def __init__(self, on, count, words):
        self.on, self.count, self.words = on, count, words

    def doubled(self, value, more):
        return 2 * value + more

    def __len__(self):
        return self.count

    def __iter__(self):
        return iter((self.count, *self.words))


@pytest.mark.parametrize("on, words", [(True, [7]), (False, [7]), (1, array("i")), (None, [])])
def test_objects(both, on, words):
    """Attributes, methods and functions in Python; an error in one of these passes through."""
    here, there = outcomes(both, "changes", lambda _: (Rig(on, 4, words), array("i", [5])))
    assert here == there
    assert (here[0] is IndexError) == (on == 1 and not words)


def test_truth(both):
    assert both[1].truth(3) is True
    assert both[1].truth(0) is False


def test_devices(both):
    written = []

    class Device:
        def __setitem__(self, index, value):
            if value > 6:
                raise BufferError
            written.append((index, value))

    both[1].stored(5, 1, Device(), array("H"), bytearray())
    assert written == [(1, 5)]
    with pytest.raises(BufferError):
        both[1].stored(7, 1, Device(), array("H"), bytearray())


def test_the_core_runs_as_machine_code():
    assert not (missing := machine_code.missing()), f"install {missing}, to compile kernels"
    in_python, compiled = set(), 0
    for path, file in sources().items():
        name = path.removesuffix(".py").removesuffix("/__init__").replace("/", ".")
        if not name.startswith(machine_code._NAMES):
            continue
        module = importlib.import_module(name)
        for owner, kernel in kernels(ast.parse(file.read_text())):
            found = vars(getattr(module, owner) if owner else module)[kernel.name]
            if isinstance(found, types.FunctionType):
                in_python.add(kernel.name)
            else:
                compiled += 1
    assert compiled > 150
    # CPython has other versions of them
    assert in_python == {"_changes", "fletcher16"}
