"""Puts the formulas of a module into one string of bytes before it is compiled for a board.

Each formula (framestep.motion.formula) is an object of its own: its head, what is left over of the
last 16 bytes, and an entry of the module's dictionary, some 35 bytes beside what it says. A module
has up to a hundred of them. So on a board

    _LATER = b"..."
    _SUM = b"..."
    compute(0, 0, r, _SUM)

is one string, `_LATER`, and the call `compute(8, 0, r, _LATER)` says where in it the formula
begins. One that is part of another takes nothing. A formula that anything but such calls uses stays
as it is. Lines stay where they are, so that tracebacks are right.
"""

import ast
from collections.abc import Mapping
from dataclasses import dataclass, field

from .constants import Edits

_COMPUTE = "compute"


@dataclass
class _Formula:
    name: str
    node: ast.Assign
    code: bytes
    calls: list[ast.Call] = field(default_factory=list)


def pooled(texts: Mapping[str, str]) -> dict[str, str]:
    """The same modules, {path: source}. They have been folded (framestep_tools.constants) and
    merged (framestep_tools.merging) before."""
    trees = {path: ast.parse(text) for path, text in texts.items()}
    shared = {
        alias.name
        for tree in trees.values()
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    } | {n.attr for tree in trees.values() for n in ast.walk(tree) if isinstance(n, ast.Attribute)}
    return {path: _pooled(text, trees[path], shared) for path, text in texts.items()}


def _pooled(text: str, tree: ast.Module, shared: set[str]) -> str:
    formulas = [f for f in _formulas(tree).values() if f.calls and f.name not in shared]
    if len(formulas) < 2:
        return text
    pool = b""
    for formula in sorted(formulas, key=lambda f: -len(f.code)):
        if formula.code not in pool:
            pool += formula.code
    edits = Edits(text)
    first = formulas[0]
    for formula in formulas:
        edits.replace(formula.node, f"{first.name} = {pool!r}" if formula is first else "pass")
        for call in formula.calls:
            edits.replace(call.args[0], str(pool.index(formula.code)))
            edits.replace(call.args[3], first.name)
    return edits.text()


def _formulas(tree: ast.Module) -> dict[str, _Formula]:
    """What the module gives compute() and nobody else, in the order of the text."""
    found: dict[str, _Formula] = {}
    again: set[str] = set()
    for statement in tree.body:
        match statement:
            case ast.Assign(targets=[ast.Name(id=name)], value=ast.Constant(value=bytes(code))):
                if name in found:
                    again.add(name)
                found[name] = _Formula(name, statement, code)
    passed: set[int] = set()
    for node in ast.walk(tree):
        match node:
            case ast.Call(
                func=ast.Name(id=function),
                args=[ast.Constant(value=0), _, _, ast.Name(id=name) as argument],
            ) if function == _COMPUTE and name in found:
                found[name].calls.append(node)
                passed.add(id(argument))
    for node in ast.walk(tree):
        match node:
            case ast.Name(id=name, ctx=ast.Load()) if name in found and id(node) not in passed:
                again.add(name)
    return {name: formula for name, formula in found.items() if name not in again}
