"""The compiler of an image's modules (tools/micropython/patches/compiler): functions return what
Python's own arithmetic does."""

import ast
import random

import pytest

from framestep_tools.building import images
from framestep_tools.building.board_files import board_chip, compiled
from host_tests.board.conftest import PICO, PICO2

WORDS, BYTES, HALVES = 32, 32, 16  # sizes of the arrays of a function's arguments
_NAMES = "abcdefghijklm"
_CONSTANTS = (0, 1, 2, 7, 8, 31, 100, 255, 256, 65535, 65536, -1, -7, -8, -255, -256, -4096)
_TRUTHS = ("<", ">", "==", "!=", "<=", ">=")


def wrap(number):
    """Return the word that this number is in 32 bits with a sign."""
    return ((number + (1 << 31)) & 0xFFFFFFFF) - (1 << 31)


class _Writer:
    """Writes a function of three numbers and pointers to words, bytes and half-words."""

    def __init__(self, seed):
        self.random = random.Random(seed)
        self.names = _NAMES[: self.random.randint(3, len(_NAMES))]
        self.loops = 0

    def name(self):
        return self.random.choice(self.names)

    def value(self, constants):
        index = f"{self.name()} & {{}}"
        return self.random.choice(
            [self.name()] * 6
            + [f"p[{self.random.choice((0, 3, 30, 31))}]"] * 2
            + [f"p[{index.format(31)}]", f"q[{index.format(31)}]", f"w[{index.format(15)}]"]
            + [str(self.random.choice(_CONSTANTS))] * (3 * constants)
        )

    def number(self, depth, constants=True):
        """Write an expression. Of two constants the compiler would make one, perhaps too large."""
        draw = self.random.random()
        if depth == 0 or draw < 0.2:
            return self.value(constants)
        left = self.number(depth - 1, False)
        if draw < 0.75:
            return f"({left} {self.random.choice('+-*&|^')} {self.number(depth - 1)})"
        if draw < 0.9:
            by = self.random.choice((str(self.random.randint(0, 31)), f"({self.name()} & 15)"))
            return f"({left} {self.random.choice(('<<', '>>'))} {by})"
        if draw < 0.95:
            return f"({self.random.choice(('-', '~', '0 - ', '255 & ', '-8 + '))}{self.name()})"
        return f"({left} // (({self.name()} & 255) + 1))"

    def truth(self):
        draw = self.random.random()
        if draw < 0.5:
            return f"{self.number(1)} {self.random.choice(_TRUTHS)} {self.number(1)}"
        if draw < 0.8:
            return self.number(2)
        return f"{self.truth()} {self.random.choice(('and', 'or'))} {self.truth()}"

    def block(self, depth, size):
        lines = []
        for _ in range(size):
            draw = self.random.random()
            if draw < 0.5 or depth == 0:
                lines.append(f"{self.name()} = {self.number(3)}")
            elif draw < 0.58:
                lines.append(f"{self.name()} {self.random.choice('+-*&|^')}= {self.number(2)}")
            elif draw < 0.66:
                lines.append(f"p[{self.name()} & 31] = {self.number(2)}")
            elif draw < 0.72:
                lines.append(f"{self.random.choice('qw')}[{self.name()} & 15] = {self.number(2)}")
            elif draw < 0.76:
                one, other = self.name(), self.name()
                lines.append(f"{one}, {other} = {other}, {one}")
            elif draw < 0.92:
                lines += [f"if {self.truth()}:", *self.inner(depth)]
                if self.random.random() < 0.5:
                    lines += [f"elif {self.truth()}:", *self.inner(depth)]
                if self.random.random() < 0.5:
                    lines += ["else:", *self.inner(depth)]
            else:
                self.loops += 1
                count = f"n{self.loops}"
                lines += [f"{count} = 0", f"while {count} < 4:", f"    {count} += 1"]
                lines += [*self.inner(depth), f"    if {self.truth()}:", "        break"]
        return lines

    def inner(self, depth):
        return [f"    {line}" for line in self.block(depth - 1, self.random.randint(1, 3))]

    def function(self, name):
        names, self.names = self.names, self.names[:3]
        lines = []
        # a name is used only after it has a value
        for each in names[3:]:
            lines.append(f"{each} = {self.number(1)}")
            self.names += each
        lines += self.block(3, self.random.randint(3, 10))
        lines.append("return " + " ^ ".join(f"({n} * {7 + 2 * i})" for i, n in enumerate(names)))
        head = f"def {name}(p: ptr32, q: ptr8, w: ptr16, a: int, b: int, c: int) -> int:"
        return "\n".join([head, *(f"    {line}" for line in lines)])


def function(name, seed):
    """Return the source of a function, without its decorator."""
    return _Writer(seed).function(name)


def conditions(name):
    """Return the source of a function with many conditions, each of two parts: the second one
    follows the first one's jump after few instructions."""
    small = [
        "a - b", "a & 7", "p[3]", "p[a & 3] - c", "(a ^ b) & 31", "q[1] + a", "b", "-c", "a - 300",
    ]  # fmt: skip
    lines, bit = ["n = m = 0"], 1
    for first in ("a < b", "a & 1", "b == c", "-a > 7"):
        for second in (*small, "a - 300", "c >= a", "b - 1 < a"):
            for word in ("and", "or"):
                lines += [f"if {first} {word} {second}:", f"    n += {bit}", "else:", "    m -= n"]
                lines += ["m += a", "if n:", "    n -= 3", "n = m - n", "if a:", "    m ^= n"]
                bit = bit * 5 & 0xFFFF
    lines.append("return n ^ m << 3")
    head = f"def {name}(p: ptr32, q: ptr8, w: ptr16, a: int, b: int, c: int) -> int:"
    return "\n".join([head, *(f"    {line}" for line in lines)])


class _Wrapping(ast.NodeTransformer):
    """Wraps the result of each operation to 32 bits."""

    def _wrapped(self, node):
        return ast.Call(ast.Name("wrap", ast.Load()), [node], [])

    def visit_BinOp(self, node):
        return self._wrapped(self.generic_visit(node))

    visit_UnaryOp = visit_BinOp

    def visit_AugAssign(self, node):
        self.generic_visit(node)
        value = ast.BinOp(ast.Name(node.target.id, ast.Load()), node.op, node.value)
        return ast.Assign([node.target], self._wrapped(value))

    def visit_arg(self, node):
        return ast.arg(node.arg)


class _Bytes(list):
    """Items that keep the lowest bits of what they are given, as in memory."""

    def __init__(self, values, bits):
        super().__init__(values)
        self.bits = bits

    def __setitem__(self, index, value):
        super().__setitem__(index, value & ((1 << self.bits) - 1))


def expected(source, name, words, data, halves, numbers):
    """Return (result, words, bytes, half-words) of a call."""
    tree = ast.fix_missing_locations(_Wrapping().visit(ast.parse(source)))
    tree.body[0].returns = None
    scope = {"wrap": wrap}
    exec(compile(tree, name, "exec"), scope)
    p, q, w = list(words), _Bytes(data, 8), _Bytes(halves, 16)
    result = scope[name](p, q, w, *numbers)
    return result, p, list(q), list(w)


def arguments(seed):
    """Draw arguments for a call."""
    draw = random.Random(seed)

    def number():
        return draw.choice((draw.randint(-(1 << 29), 1 << 29), draw.randint(-50, 50)))

    return (
        [number() for _ in range(WORDS)],
        [draw.randrange(256) for _ in range(BYTES)],
        [draw.randrange(65536) for _ in range(HALVES)],
        [number() for _ in range(3)],
    )


DRAWN = 16  # functions in a module
CALL = """
import sys
from array import array
from functions import {name}
words, data, halves, numbers = {arguments!r}
p, q, w = array("i", words), bytearray(data), array("H", halves)
print(({name}(p, q, w, *numbers), list(p), list(q), list(w)))
"""

chips = pytest.mark.parametrize("on", [PICO, PICO2], ids=lambda chip: chip.board)


def check(chip, sources, calls):
    """Call each of these functions with drawn arguments on a board without framestep."""
    text = "".join(f"@micropython.viper\n{source}\n" for source in sources.values())
    march = board_chip(chip.board).processor
    module = compiled("functions.py", text.encode(), march, images.compiler())
    with chip.bare({"/functions.mpy": module, "/main.py": b""}) as emulator:
        repl = emulator.repl()
        for name, source in sources.items():
            for seed in range(calls):
                given = arguments(seed)
                found = eval(repl.exec(CALL.format(name=name, arguments=given)))
                assert found == expected(source, name, *given), f"{source}\n{given}"


@chips
@pytest.mark.parametrize("part", range(3))
def test_random_functions(on, part):
    seeds = range(part * DRAWN, (part + 1) * DRAWN)
    check(on, {f"f{seed}": function(f"f{seed}", seed) for seed in seeds}, 3)


@chips
def test_conditions(on):
    check(on, {"conditions": conditions("conditions")}, 12)
