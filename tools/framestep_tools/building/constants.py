"""Replaces imported constants by their numbers, before a module is compiled for a board.

MicroPython's compiler replaces a `const()` only within its own module. In another module
`messages.OK` takes two dictionary look-ups, and each constant takes a name and a dictionary entry
in the board's memory: some 30 bytes. `fold` does for all modules together what the compiler does
for one. It also hides the constants from the board by an underscore, so the compiler stores no
name. Line numbers stay the same, so tracebacks are right.

Bytes made of constants, `bytes((A, 1) + (B, 2))`, become a literal too, because the board would
also keep the tuples. So do formulas, `formula(registers, "...")`, which framestep.motion.formula
compiles, wherever their name is mentioned.

A constant is a name that a module assigns once, at its top level, as `NAME = const(...)`.
"""

import ast
import operator
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from types import MappingProxyType
from typing import Any, cast

from framestep.motion.formula import Formula, FormulaError, formula

from .kernels import CASTS, is_decorator

_FORMULA = "framestep.motion.formula"
_COMPUTE = "framestep.motion.compute"
_NATIVE = "framestep.base.native"

_OPERATORS: dict[type, Callable[..., int]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.FloorDiv: operator.floordiv,
    ast.Mod: operator.mod,
    ast.LShift: operator.lshift,
    ast.RShift: operator.rshift,
    ast.BitOr: operator.or_,
    ast.BitAnd: operator.and_,
    ast.BitXor: operator.xor,
    ast.USub: operator.neg,
    ast.Invert: operator.invert,
}


class FoldError(Exception):
    """Constants of a source cannot be distinguished from other names. The text says where, and what
    to change."""


@lru_cache(maxsize=512)
def nodes(text: str) -> tuple[ast.AST, ...]:
    """Return all nodes of a source's syntax tree, the module first. Nobody changes them: the build
    reads a source many times, and to parse it and walk through it is most of its time."""
    return tuple(ast.walk(ast.parse(text)))


def tree(text: str) -> ast.Module:
    """Return a source's syntax tree, the same one each time."""
    return cast(ast.Module, nodes(text)[0])


@dataclass
class _Module:
    name: str  # dotted
    path: str
    text: str
    constants: dict[str, int] = field(default_factory=dict)  # its own
    formulas: dict[str, Formula] = field(default_factory=dict)  # those that have a name
    given: dict[str, int] = field(default_factory=dict)
    # name here -> module and name there
    imported: dict[str, tuple[str, str]] = field(default_factory=dict)
    modules: dict[str, str] = field(default_factory=dict)  # name here -> module

    @property
    def tree(self) -> ast.Module:
        return tree(self.text)

    @property
    def nodes(self) -> tuple[ast.AST, ...]:
        return nodes(self.text)

    @property
    def public(self) -> dict[str, int]:
        """Return the constants that other modules may use."""
        return self.given | {
            name: value for name, value in self.constants.items() if not name.startswith("_")
        }


def fold(
    sources: Mapping[str, str],
    hide: bool = True,
    given: Mapping[str, Mapping[str, int]] = MappingProxyType({}),
) -> dict[str, str]:
    """Replace constants of other modules by numbers.

    sources: {path: source}; the path of framestep.motors.axes is "framestep/motors/axes.py". hide:
    give constants without an underscore one; else they remain for scripts that import them. given:
    {module: {name: number}} of names that count as constants although the module does not define
    them so, or defines another number; "MotorJog.speed" is an attribute of a class.
    """
    modules = _modules_of(sources, given)
    return {m.path: _rewritten(m, modules, hide) for m in modules.values()}


def _modules_of(
    sources: Mapping[str, str], given: Mapping[str, Mapping[str, int]]
) -> dict[str, _Module]:
    """Read modules and compute their constants."""
    modules = {
        m.name: m for m in (_Module(_dotted(path), path, text) for path, text in sources.items())
    }
    for module in modules.values():
        module.given = dict(given.get(module.name, {}))
        _read_imports(module, modules)
    waiting = list(modules.values())
    while waiting:  # a constant may depend on another module's
        left = [m for m in waiting if not _read_constants(m, modules)]
        if len(left) == len(waiting):
            raise FoldError(f"constants that need one another: {', '.join(m.path for m in left)}")
        waiting = left
    return modules


def formulas_of(
    sources: Mapping[str, str], given: Mapping[str, Mapping[str, int]] = MappingProxyType({})
) -> dict[str, dict[str, Formula]]:
    """Compile the formulas that have a name: {path: {name: formula}}. Their `space` is the module
    whose registers they use. sources, given: as for fold()."""
    modules = _modules_of(sources, given)
    for module in modules.values():
        _compile(module, modules)
    return {module.path: module.formulas for module in modules.values()}


def _dotted(path: str) -> str:
    return path.removesuffix(".py").removesuffix("/__init__").replace("/", ".")


def _read_imports(module: _Module, modules: Mapping[str, _Module]) -> None:
    for node in module.nodes:
        if not isinstance(node, ast.ImportFrom) or node.level or node.module is None:
            continue
        for alias in node.names:
            name = alias.asname or alias.name
            if f"{node.module}.{alias.name}" in modules:
                module.modules[name] = f"{node.module}.{alias.name}"
            elif node.module in modules:
                module.imported[name] = (node.module, alias.name)


def _definitions(module: _Module) -> Iterator[tuple[str, ast.expr, ast.Name]]:
    """Yield name, value and target of each constant of the module."""
    for node in module.tree.body:
        match node:
            case ast.Assign(
                targets=[ast.Name(id=name) as target],
                value=ast.Call(func=ast.Name(id="const"), args=[value]),
            ):
                yield name, value, target


def _read_constants(module: _Module, modules: Mapping[str, _Module]) -> bool:
    """Compute the module's constants. Return False if it needs an unknown one of another module."""
    known: dict[str, int] = {}

    def compute(node: ast.expr) -> int:
        match node:
            case ast.Constant(value=int(value)):
                return value
            case ast.Name(id=name) if name in known:
                return known[name]
            case ast.Name(id=name) if name in module.imported:
                return _value(modules, *module.imported[name])
            case ast.Attribute() if of := _mentioned(module, node):
                return _value(modules, *of)
            case ast.BinOp(left=left, op=op, right=right) if type(op) in _OPERATORS:
                return _OPERATORS[type(op)](compute(left), compute(right))
            case ast.UnaryOp(op=op, operand=operand) if type(op) in _OPERATORS:
                return _OPERATORS[type(op)](compute(operand))
        raise FoldError(
            f"{module.path}, line {node.lineno}: const() of something that is not a whole number"
        )

    try:
        for name, value, target in _definitions(module):
            if name in known:
                raise FoldError(
                    f"{module.path}, line {target.lineno}: {name} is a constant already"
                )
            known[name] = module.given[name] if name in module.given else compute(value)
    except LookupError:
        return False
    module.constants = known
    return True


def _mentioned(module: _Module, node: ast.Attribute) -> tuple[str, str] | None:
    """Return (module, name there) of m.NAME and of m.Class.name."""
    match node:
        case ast.Attribute(value=ast.Name(id=base), attr=name):
            pass
        case ast.Attribute(value=ast.Attribute(value=ast.Name(id=base), attr=cls), attr=field):
            name = f"{cls}.{field}"
        case _:
            return None
    return (module.modules[base], name) if base in module.modules else None


def _value(modules: Mapping[str, _Module], module: str, name: str) -> int:
    """Return a constant. Raises LookupError if it is not known, or not yet."""
    return modules[module].public[name]


class Edits:
    """Replacements of syntax tree nodes in a source text."""

    def __init__(self, text: str):
        self.lines = [line.encode() for line in text.splitlines(keepends=True)]
        self.edits: list[tuple[int, int, int, bytes]] = []

    def replace(self, node: Any, text: str) -> None:
        """Replace a node by `text`. Its other lines stay, empty."""
        first, last = node.lineno - 1, node.end_lineno - 1
        for line in range(first, last + 1):
            begin = node.col_offset if line == first else 0
            end = node.end_col_offset if line == last else len(self.lines[line].rstrip(b"\r\n"))
            self.edits.append((line, begin, end, text.encode() if line == first else b""))

    def insert(self, node: Any, text: str) -> None:
        """Insert `text` in front of a node."""
        self.edits.append((node.lineno - 1, node.col_offset, node.col_offset, text.encode()))

    def text(self) -> str:
        """Return the source with the replacements."""
        for line, begin, end, text in sorted(self.edits, reverse=True):
            self.lines[line] = self.lines[line][:begin] + text + self.lines[line][end:]
        return b"".join(self.lines).decode()


def _literal(value: int) -> str:
    return str(value) if value >= 0 else f"({value})"


def _rewritten(module: _Module, modules: Mapping[str, _Module], hide: bool) -> str:
    edits = Edits(module.text)
    foreign = {  # names here that are constants elsewhere
        name: modules[source].public[original]
        for name, (source, original) in module.imported.items()
        if original in modules[source].public
    }
    folded = {name for name, stands_for in module.modules.items() if modules[stands_for].public}
    hidden = _hidden(module) if hide else {}
    targets = {id(target) for _, _, target in _definitions(module)}
    attributes = set()  # the X of X.name, where name is a constant
    for name, value, _ in _definitions(module):
        if name in module.given:
            edits.replace(value, _literal(module.given[name]))
            attributes.update(map(id, ast.walk(value)))
    # A name of a module takes memory on a board, and looking it up takes time. So each mention of a
    # formula's own name becomes its bytes, which are in flash.
    owners = {id(node.value): node for node in module.tree.body if isinstance(node, ast.Assign)}
    literals = {}
    for call, made in _compile(module, modules):
        owner = owners.get(id(call))
        match owner:
            case ast.Assign(targets=[ast.Name(id=name) as target]) if name.startswith("_"):
                literals[name] = repr(bytes(made))
                targets.add(id(target))
                edits.replace(owner, "pass")
                attributes.update(id(n) for n in ast.walk(owner))
            case _:
                edits.replace(call, repr(bytes(made)))
                attributes.update(id(n) for n in ast.walk(call))
    computes = module.imported.get("compute") == (_COMPUTE, "compute")
    for node in module.nodes:
        if id(node) in attributes:
            continue
        match node:
            case ast.Call(func=ast.Name(id="compute") as called, args=[registers, _]) if computes:
                edits.replace(called, "execute")
                edits.insert(registers, "0, 0, ")
            case ast.alias(name="compute", asname=None) if computes:
                edits.replace(node, "execute")
            case ast.Attribute(value=ast.Name(id=name), attr=attr) if name in module.formulas:
                edits.replace(node, _literal(_place(module, node, module.formulas[name], attr)))
                attributes.update(map(id, ast.walk(node)))
            case ast.Attribute() if of := _mentioned(module, node):
                if of[1] in modules[of[0]].public:
                    edits.replace(node, _literal(_value(modules, *of)))
                    attributes.update(map(id, ast.walk(node)))
            case ast.Name(id=name, ctx=ast.Load()) if name in literals:
                edits.replace(node, literals[name])
            case ast.Name(id=name, ctx=ast.Load()) if name in foreign:
                edits.replace(node, _literal(foreign[name]))
            case ast.Name(id=name) if name in hidden and (
                isinstance(node.ctx, ast.Load) or id(node) in targets
            ):
                edits.replace(node, hidden[name])
    needed = {n.id for n in module.nodes if isinstance(n, ast.Name) and id(n) not in attributes}
    _refuse_other_meanings(module, {*foreign, *hidden, *folded, *literals}, targets)
    for node in module.nodes:
        if isinstance(node, ast.ImportFrom):
            gone = {"formula"} if node.module == _FORMULA else set()
            shorten(edits, node, {*foreign, *(folded - needed), *gone})
    text = _with_bytes(
        edits.text(), {hidden.get(name, name): value for name, value in module.constants.items()}
    )
    return _with_hidden_literals(text) if hide else text


def _assignments(module: ast.Module) -> Iterator[tuple[str, ast.expr]]:
    """Yield name and value of each assignment of a module."""
    for node in module.body:
        match node:
            case ast.Assign(targets=[ast.Name(id=name)], value=value):
                yield name, value


def _place(module: _Module, node: ast.expr, made: Formula, name: str) -> int:
    if name not in made.places:
        raise FoldError(
            f"{module.path}, line {node.lineno}: {name} is no parameter or result of this formula"
        )
    return made.places[name]


def _calls_of_formula(module: _Module) -> Iterator[ast.Call]:
    for node in module.nodes:
        match node:
            case ast.Call(func=ast.Name(id="formula")) if _imports_formula(module):
                yield node


def _imports_formula(module: _Module) -> bool:
    return any(
        isinstance(node, ast.ImportFrom) and node.module == _FORMULA for node in module.nodes
    )


def _compile(module: _Module, modules: Mapping[str, _Module]) -> list[tuple[ast.Call, Formula]]:
    """Compile a module's formulas; those with a name are in `formulas` afterwards."""
    named = {id(value): name for name, value in _assignments(module.tree)}
    found = []
    for call in _calls_of_formula(module):
        made = _compiled(module, modules, call)
        if id(call) in named:
            module.formulas[named[id(call)]] = made
        match call.args[0]:
            case ast.Name(id=name):
                made.space = module.modules[name]
            case _:
                made.space = module.name
        found.append((call, made))
    return found


def _compiled(module: _Module, modules: Mapping[str, _Module], call: ast.Call) -> Formula:
    """Compile a call of formula(). Its registers are constants of a module, or, with globals(), all
    constants known in this module."""
    names: dict[str, int]
    match call.args:
        case [ast.Name(id=name), *texts] if name in module.modules:
            names = modules[module.modules[name]].public
        case [ast.Call(func=ast.Name(id="globals"), args=[]), *texts]:
            names = module.constants | {
                name: modules[source].public[original]
                for name, (source, original) in module.imported.items()
                if original in modules[source].public
            }
        case _:
            texts = []
    found = [text.value for text in texts if isinstance(text, ast.Constant)]
    if not 1 <= len(found) == len(texts) <= 2 or not all(isinstance(t, str) for t in found):
        raise FoldError(
            f"{module.path}, line {call.lineno}: formula() takes a module, or globals(), "
            "the names of parameters and results, and a text"
        )
    places: dict[str, int] = {}
    for keyword in call.keywords:
        match keyword.value:
            case ast.Attribute(value=ast.Name(id=name), attr=attr) if name in module.formulas:
                places[str(keyword.arg)] = _place(
                    module, keyword.value, module.formulas[name], attr
                )
            case _:
                raise FoldError(
                    f"{module.path}, line {keyword.value.lineno}: the place of {keyword.arg} has "
                    "to be that of another formula's parameter or result"
                )
    try:
        return formula(names, *found, **places)
    except FormulaError as error:
        raise FoldError(
            f"{module.path}, line {texts[-1].lineno + error.line - 1}: {error.reason}"
        ) from None


def _with_bytes(text: str, constants: Mapping[str, int]) -> str:
    """Replace bytes((...)) of known numbers by literals."""

    def numbers(node: ast.expr) -> list[int]:
        match node:
            case ast.Tuple(elts=elements):
                return [number(element) for element in elements]
            case ast.BinOp(left=left, op=ast.Add(), right=right):
                return numbers(left) + numbers(right)
        raise LookupError

    def number(node: ast.expr) -> int:
        match node:
            case ast.Constant(value=int(value)):
                return value
            case ast.Name(id=name):
                return constants[name]
            case ast.BinOp(left=left, op=op, right=right) if type(op) in _OPERATORS:
                return _OPERATORS[type(op)](number(left), number(right))
        raise LookupError

    if "bytes(" not in text:  # most modules; to read one takes long
        return text
    edits = Edits(text)
    for node in nodes(text):
        match node:
            case ast.Call(func=ast.Name(id="bytes"), args=[argument]):
                try:
                    edits.replace(node, repr(bytes(numbers(argument))))
                except LookupError:
                    continue
    return edits.text()


def _with_hidden_literals(text: str) -> str:
    """Turn hidden bytes, strings and tuples into `_NAME = const(b"...")` too.

    The compiler then inserts them where the name is used, and the board stores no name.
    """
    edits = Edits(text)
    stored = Counter(
        node.id
        for node in nodes(text)
        if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)
    )
    for node in tree(text).body:
        match node:
            case ast.Assign(targets=[ast.Name(id=name)], value=value) if (
                name.startswith("_") and stored[name] == 1 and _is_literal(value)
            ):
                edits.replace(value, f"const({ast.unparse(value)})")
    return edits.text()


def _is_literal(node: ast.expr) -> bool:
    try:
        return isinstance(ast.literal_eval(node), bytes | str | tuple)
    except ValueError:
        return False


def _hidden(module: _Module) -> dict[str, str]:
    """Return names with an underscore for the constants, or with more if such a name exists."""
    used = {node.id for node in module.nodes if isinstance(node, ast.Name)}
    hidden = {}
    for name in module.public.keys() - module.given.keys():
        hidden[name] = "_" + name
        while hidden[name] in used:
            hidden[name] = "_" + hidden[name]
    return hidden


def _refuse_other_meanings(module: _Module, names: set[str], targets: set[int]) -> None:
    """Raise FoldError if one of the names also has another meaning."""
    for node in module.nodes:
        match node:
            case ast.Name(id=name, ctx=ast.Store() | ast.Del()) if id(node) not in targets:
                pass
            case ast.arg(arg=name) | ast.FunctionDef(name=name) | ast.ClassDef(name=name):
                pass
            case _:
                continue
        if name in names:
            raise FoldError(
                f"{module.path}, line {node.lineno}: "
                f"{name} is a constant or a module here; give it another name"
            )


def shorten(edits: Edits, node: ast.ImportFrom, gone: set[str]) -> None:
    """Remove names from an import."""
    kept = [alias for alias in node.names if (alias.asname or alias.name) not in gone]
    if len(kept) == len(node.names):
        return
    if not kept:
        edits.replace(node, "pass")
        return
    names = ", ".join(
        alias.name + (f" as {alias.asname}" if alias.asname else "") for alias in kept
    )
    edits.replace(node, f"from {node.module} import {names}")


def live(node: ast.AST) -> Iterator[ast.AST]:
    """Yield a node and all nodes in it that are compiled: nothing behind `if 0:`."""
    yield node
    match node:
        case ast.If(test=ast.Constant(value=value)):
            inner: list[ast.AST] = [*(node.body if value else node.orelse)]
        case _:
            inner = list(ast.iter_child_nodes(node))
    for child in inner:
        yield from live(child)


def drop_imports(edits: Edits, module: ast.Module) -> None:
    """Import from framestep.base.native only the names that the board looks up.

    The compiler alone needs the others: `const`, `micropython` for decorators, viper's casts. Each
    name that a module imports is an entry of its dictionary.
    """
    for_compiler: set[int] = set()  # ids of Name nodes
    for node in live(module):
        match node:
            case ast.Assign(targets=[ast.Name(id=name)], value=ast.Call(func=function)) if (
                name.startswith("_")
            ):
                if node in module.body:
                    for_compiler.add(id(function))
            case ast.FunctionDef(decorator_list=decorators):
                for decorator in decorators:
                    if is_decorator(decorator):
                        for_compiler.update(map(id, ast.walk(decorator)))
                        for_compiler.update(
                            id(n)
                            for n in ast.walk(node)
                            if isinstance(n, ast.Name) and n.id in CASTS
                        )
    needed = {
        node.id
        for node in live(module)
        if isinstance(node, ast.Name) and id(node) not in for_compiler
    }
    for node in ast.walk(module):
        if isinstance(node, ast.ImportFrom) and node.module == _NATIVE:
            shorten(edits, node, {"const", "micropython", *CASTS} - needed)


def without_compiler_imports(text: str) -> str:
    """Return a module's source after drop_imports()."""
    edits = Edits(text)
    drop_imports(edits, tree(text))
    return edits.text()
