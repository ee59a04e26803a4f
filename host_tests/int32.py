"""Finds numbers that do not fit, on CPython: kernels' beyond 32 bits, and passes' that MicroPython
would allocate.

`install()`, called before anything of framestep is imported, rewrites the modules of the core while
they are loaded:

* In a kernel (`@micropython.viper`) each result of an operation must fit 32 bits signed, unless
  `& mask` cuts it at once. That is native.py's contract, of which CPython alone checks only what is
  stored in an array.
* In a line of a kernel that ends in `# wraps`, sums may wrap, and do so as on a board.
* Elsewhere an integer must be within -2^30 to 2^30 - 1 while `armed` is set, as in a pass of the
  main loop: anything beyond is an object on the heap of a 32-bit board.

Otherwise Outside() is raised with the place. Rewritten code takes up to twice as long.
"""

import ast
import importlib.abc
import importlib.machinery
import sys

_ONLY_HERE = (
    "framestep.hal.",
    "framestep.base.native",
    "framestep.rig",
    "framestep.repl",
    "framestep.boot",
    "framestep.protocol.declared",
)
armed = False


class Outside(ArithmeticError):
    """A number that does not fit."""


def word(value, line):
    """In kernels: refuse what does not fit 32 bits."""
    raise Outside(f"{value:#x} leaves 32 bits in a kernel, line {line}")


def wrap(value):
    """In kernels marked `# wraps`: truncate to 32 bits."""
    return (value + 0x80000000 & 0xFFFFFFFF) - 0x80000000


def small(value, line):
    """In passes: refuse what MicroPython would put on the heap."""
    if armed and value.__class__ is int and not -0x40000000 <= value <= 0x3FFFFFFF:
        raise Outside(f"{value:#x} is no small integer, line {line}")
    return value


def _kernel(function: ast.FunctionDef) -> bool:
    return any(
        isinstance(d, ast.Attribute) and d.attr in ("viper", "native")
        for d in function.decorator_list
    )


def _mask(node) -> bool:
    """Return whether it is a constant of only the lower 31 bits, by its value or its name."""
    if isinstance(node, ast.Constant):
        return isinstance(node.value, int) and 0 <= node.value <= 0x7FFFFFFF
    return isinstance(node, ast.Name) and node.id in ("_MASK", "_WRAP", "_ALL_BITS")


class _Checks(ast.NodeTransformer):
    """Inserts the checks into functions. Constants and code that runs at import do not change."""

    def __init__(self, wraps):
        self.wraps = wraps  # numbers of the lines in which sums may wrap
        self.kernel = None  # None outside of functions
        self.masked = False  # the present expression counts only modulo 2^32, as `& mask` follows

    def visit_FunctionDef(self, node):
        before, self.kernel = self.kernel, _kernel(node)
        node.body = [self.visit(statement) for statement in node.body]
        self.kernel = before
        return node

    def visit_Lambda(self, node):
        return node

    def _checked(self, node):
        line = ast.Constant(getattr(node, "lineno", 0))
        if not self.kernel:
            return ast.Call(ast.Name("_int32_small", ast.Load()), [node, line], [])
        if line.value in self.wraps:
            return ast.Call(ast.Name("_int32_wrap", ast.Load()), [node], [])
        # t if -2^31 <= (t := node) <= 2^31 - 1 else _int32_word(t)
        name = "_int32_t"
        fits = ast.Compare(
            ast.Constant(-0x80000000),
            [ast.LtE(), ast.LtE()],
            [ast.NamedExpr(ast.Name(name, ast.Store()), node), ast.Constant(0x7FFFFFFF)],
        )
        wrong = ast.Call(
            ast.Name("_int32_word", ast.Load()), [ast.Name(name, ast.Load()), line], []
        )
        return ast.IfExp(fits, ast.Name(name, ast.Load()), wrong)

    def visit_BinOp(self, node):
        before = self.masked
        ring = isinstance(
            node.op, ast.Add | ast.Sub | ast.Mult | ast.LShift | ast.BitAnd | ast.BitOr | ast.BitXor
        )
        mask = (
            isinstance(node.op, ast.BitAnd)
            and self.kernel
            and (_mask(node.right) or _mask(node.left))
        )
        self.masked = bool(mask) or (before and ring)
        node.left = self.visit(node.left)
        # the count of a shift is a normal number
        self.masked = self.masked and not isinstance(node.op, ast.LShift)
        node.right = self.visit(node.right)
        self.masked = before
        if before and ring:
            return node
        if self.kernel is None or (
            isinstance(node.left, ast.Constant) and isinstance(node.right, ast.Constant)
        ):
            return node
        if isinstance(node.op, ast.Mod) and isinstance(node.left, ast.Constant):
            return node  # a text
        return ast.copy_location(self._checked(node), node)

    def visit_UnaryOp(self, node):
        self.generic_visit(node)
        if (
            self.kernel is None
            or not isinstance(node.op, (ast.USub, ast.Invert))
            or isinstance(node.operand, ast.Constant)
        ):
            return node
        return ast.copy_location(self._checked(node), node)

    def visit_If(self, node):
        if isinstance(node.test, ast.Name) and node.test.id == "CPYTHON":
            return node  # not on a board
        return self.generic_visit(node)

    def visit_Call(self, node):
        before, self.masked = self.masked, False
        self.generic_visit(node)
        self.masked = before
        if self.kernel is False:
            return ast.copy_location(self._checked(node), node)
        return node

    def visit_Subscript(self, node):
        before, self.masked = self.masked, False
        self.generic_visit(node)
        self.masked = before
        if (
            self.kernel is False
            and isinstance(node.ctx, ast.Load)
            and not isinstance(node.slice, ast.Slice)
        ):
            return ast.copy_location(self._checked(node), node)
        return node

    def visit_AugAssign(self, node):
        self.generic_visit(node)
        if self.kernel is None or not isinstance(node.target, ast.Name):
            return node
        value = ast.BinOp(ast.Name(node.target.id, ast.Load()), node.op, node.value)
        checked = self._checked(ast.copy_location(value, node))
        return ast.copy_location(ast.Assign([node.target], checked), node)


def rewritten(source: str, filename: str):
    """Return the code of a module with the checks."""
    wraps = {
        number
        for number, line in enumerate(source.split("\n"), 1)
        if line.rstrip().endswith("# wraps")
    }
    tree = _Checks(wraps).visit(ast.parse(source, filename))
    names = ", ".join(f"{name} as _int32_{name}" for name in ("small", "word", "wrap"))
    imports = ast.parse(f"from host_tests.int32 import {names}").body
    at = 1 if ast.get_docstring(tree) is not None else 0
    tree.body[at:at] = imports
    return compile(ast.fix_missing_locations(tree), filename, "exec")


class _Loader(importlib.machinery.SourceFileLoader):
    def get_code(self, fullname):
        path = self.get_filename(fullname)
        return rewritten(self.get_data(path).decode(), path)


class _Finder(importlib.abc.MetaPathFinder):
    def find_spec(self, name, path=None, target=None):
        if not name.startswith("framestep.") or name.startswith(_ONLY_HERE):
            return None
        spec = importlib.machinery.PathFinder.find_spec(name, path)
        if spec is None or not isinstance(spec.loader, importlib.machinery.SourceFileLoader):
            return None
        spec.loader = _Loader(name, spec.origin)
        return spec


def install() -> None:
    """Load modules of the core with checks from now on. Raises RuntimeError if it is too late."""
    loaded = [
        name
        for name in sys.modules
        if name.startswith("framestep.") and not name.startswith(_ONLY_HERE)
    ]
    if loaded:
        raise RuntimeError(f"already loaded without checks: {', '.join(loaded)}")
    if not any(isinstance(finder, _Finder) for finder in sys.meta_path):
        sys.meta_path.insert(0, _Finder())
