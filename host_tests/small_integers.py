"""Finds numbers that a pass would allocate on a board, on CPython.

`install()`, called before anything of framestep is imported, rewrites the modules of the core while
they are loaded: outside of kernels each number that is computed, read or returned must be within
-2^30 to 2^30 - 1 while `armed` is set, as in a pass of the main loop. Anything beyond is an object
on the heap of a 32-bit board. Otherwise Outside() is raised with the place. Rewritten code takes
longer. Kernels are checked by machine_code.py, with and without this.
"""

import ast
import importlib.abc
import importlib.machinery
import sys

from framestep_tools.building.kernels import is_kernel

from . import machine_code

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


def small(value, line):
    """In passes: refuse what MicroPython would put on the heap."""
    if armed and value.__class__ is int and not -0x40000000 <= value <= 0x3FFFFFFF:
        raise Outside(f"{value:#x} is no small integer, line {line}")
    return value


class _Checks(ast.NodeTransformer):
    """Inserts the checks into functions. Constants and code that runs at import do not change."""

    def __init__(self):
        self.inside = False  # of a function

    def visit_FunctionDef(self, node):
        if is_kernel(node):
            return node
        before, self.inside = self.inside, True
        node.body = [self.visit(statement) for statement in node.body]
        self.inside = before
        return node

    def visit_Lambda(self, node):
        return node

    def _checked(self, node):
        self.generic_visit(node)
        if not self.inside:
            return node
        line = ast.Constant(node.lineno)
        call = ast.Call(ast.Name("_checked_small", ast.Load()), [node, line], [])
        return ast.copy_location(call, node)

    visit_Call = _checked

    def visit_BinOp(self, node):
        if isinstance(node.op, ast.Mod) and isinstance(node.left, ast.Constant):
            return self.generic_visit(node)  # a text
        return self._checked(node)

    def visit_UnaryOp(self, node):
        if isinstance(node.op, ast.USub | ast.Invert) and not isinstance(
            node.operand, ast.Constant
        ):
            return self._checked(node)
        return self.generic_visit(node)

    def visit_If(self, node):
        if isinstance(node.test, ast.Name) and node.test.id == "CPYTHON":
            return node  # not on a board
        return self.generic_visit(node)

    def visit_Subscript(self, node):
        if isinstance(node.ctx, ast.Load) and not isinstance(node.slice, ast.Slice):
            return self._checked(node)
        return self.generic_visit(node)

    def visit_AugAssign(self, node):
        if not isinstance(node.target, ast.Name):
            return self.generic_visit(node)
        total = ast.BinOp(ast.Name(node.target.id, ast.Load()), node.op, node.value)
        return ast.Assign([node.target], self.visit(ast.copy_location(total, node)))


def rewritten(source: str, filename: str):
    """Return the code of a module with the checks."""
    tree = _Checks().visit(ast.parse(source, filename))
    imports = ast.parse("from host_tests.small_integers import small as _checked_small").body
    at = 1 if ast.get_docstring(tree) is not None else 0
    tree.body[at:at] = imports
    return compile(ast.fix_missing_locations(tree), filename, "exec")


class _Loader(machine_code.Loader):
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
        if name.startswith("framestep.")
        and not name.startswith(_ONLY_HERE)
        and name != "framestep.base"  # the package of what is only here
    ]
    if loaded:
        raise RuntimeError(f"already loaded without checks: {', '.join(loaded)}")
    if not any(isinstance(finder, _Finder) for finder in sys.meta_path):
        sys.meta_path.insert(0, _Finder())
