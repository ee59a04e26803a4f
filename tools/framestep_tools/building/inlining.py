"""Replaces calls of some functions by what they do, before a module is compiled for a board.

A call costs a board ten times as much as a sum, and a function costs a name and 50 bytes of memory.
So the functions of some modules, each a single `return` or a few assignments, only exist for
readers.

If a function uses a parameter more than once, or only in one of its cases, the argument must be
a name, a number or a word of an array: nothing with a side effect. If it uses one after it has
stored something, the argument must be a name or a number. Line numbers stay the same, so tracebacks
are right.
"""

import ast
from collections.abc import Mapping
from dataclasses import dataclass

from .constants import Edits, FoldError, nodes, shorten


@dataclass(frozen=True)
class _Function:
    parameters: tuple[str, ...]
    body: tuple[ast.AST, ...]  # an expression, or assignments
    once: bool  # each parameter is evaluated once, as in a call
    late: frozenset[str] = frozenset()  # parameters that are used after something was stored

    def fits(self, arguments: list[ast.expr]) -> bool:
        """Return whether a call with these arguments can be replaced."""
        return (
            len(arguments) == len(self.parameters)
            and (
                self.once
                or not any(isinstance(n, ast.Call) for a in arguments for n in ast.walk(a))
            )
            and all(
                isinstance(argument, ast.Name | ast.Constant)
                for name, argument in zip(self.parameters, arguments, strict=True)
                if name in self.late
            )
        )

    def call(self, arguments: list[str]) -> str:
        """Return what the function does with these arguments for the parameters, in one line."""
        given = dict(zip(self.parameters, arguments, strict=True))

        class Put(ast.NodeTransformer):
            def visit_Name(self, node: ast.Name) -> ast.Name:
                return ast.Name(given[node.id]) if node.id in given else node

        done = "; ".join(ast.unparse(Put().visit(ast.parse(ast.unparse(n)))) for n in self.body)
        return done if isinstance(self.body[0], ast.stmt) else f"({done})"


def inline(texts: Mapping[str, str], path: str) -> dict[str, str]:
    """Replace all calls of functions of the module `path`.

    texts: {path: source}, already folded (framestep_tools.building.constants). Raises FoldError if
    a function or its use cannot be inlined.
    """
    functions = _functions(path, texts[path])
    source = path.removesuffix(".py").replace("/", ".")
    return {
        name: text if name == path else _inlined(name, text, source, functions)
        for name, text in texts.items()
    }


def _functions(path: str, text: str) -> dict[str, _Function]:
    constants: dict[str, int] = {}
    functions = {}
    for node in ast.parse(text).body:
        match node:
            case ast.Assign(
                targets=[ast.Name(id=name)],
                value=ast.Call(func=ast.Name(id="const"), args=[ast.Constant(value=int(value))]),
            ):
                constants[name] = value
            case ast.FunctionDef(name=name):
                functions[name] = _function(node, constants, f"{path}, line {node.lineno}: {name}")
    return functions


def _function(node: ast.FunctionDef, constants: Mapping[str, int], where: str) -> _Function:
    parameters = tuple(argument.arg for argument in node.args.args)
    body = node.body[ast.get_docstring(node) is not None :]
    # Its variables get names that the caller has not.
    own = {
        n.id: f"_{node.name}_{n.id}"
        for n in ast.walk(ast.Module(body, []))
        if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Store)
    }

    class Known(ast.NodeTransformer):
        def visit_Name(self, node: ast.Name) -> ast.expr:
            if node.id in constants:
                return ast.Constant(constants[node.id])
            return ast.Name(own.get(node.id, node.id), node.ctx)

    match body:
        case [ast.Return(value=ast.expr() as result)]:
            found: list[ast.AST] = [Known().visit(result)]
        case [_, *_] if (
            all(isinstance(n, ast.Assign) for n in body) and not own.keys() & parameters
        ):
            found = [Known().visit(n) for n in body]
        case _:
            raise FoldError(
                f"{where} has to be one expression, or assignments to its own variables"
            )
    late: set[str] = set()
    used: list[str] = []
    stored = False
    for part in found:
        names = [n.id for n in ast.walk(part) if isinstance(n, ast.Name)]
        used += names
        late |= set(names) if stored else set()
        stored = stored or any(
            isinstance(n, ast.Subscript | ast.Attribute) and isinstance(n.ctx, ast.Store)
            for n in ast.walk(part)
        )
    used = [name for name in used if name not in own.values()]
    if set(used) != set(parameters):
        raise FoldError(f"{where} has to use its parameters, nothing else")
    cases = any(isinstance(n, ast.IfExp | ast.BoolOp) for part in found for n in ast.walk(part))
    once = not cases and len(used) == len(parameters)
    return _Function(parameters, tuple(found), once, frozenset(late))


def _inlined(path: str, text: str, source: str, functions: Mapping[str, _Function]) -> str:
    if source.rpartition(".")[2] not in text:  # most modules; to read one takes long
        return text
    imports = [n for n in nodes(text) if isinstance(n, ast.ImportFrom) and n.module == source]
    here = {alias.asname or alias.name: alias.name for node in imports for alias in node.names}
    here = {name: original for name, original in here.items() if original in functions}
    if not here:
        return text
    edits = Edits(text)
    for node in imports:
        shorten(edits, node, set(here))
    text = edits.text()
    while calls := _innermost(text, here, functions):
        edits = Edits(text)
        for call, arguments, function in calls:
            edits.replace(call, function.call([_source(each) for each in arguments]))
        text = edits.text()
    for left in nodes(text):
        if isinstance(left, ast.Name) and left.id in here:
            raise FoldError(
                f"{path}, line {left.lineno}: {left.id} has to be called, with all arguments"
                ", none of which calls anything if it is used more than once"
            )
    return text


def _innermost(
    text: str, here: Mapping[str, str], functions: Mapping[str, _Function]
) -> list[tuple[ast.AST, list[ast.expr], _Function]]:
    """Return calls of these functions whose arguments contain no such call: what to replace, the
    arguments, the function. Assignments replace a whole statement."""
    found: list[tuple[ast.AST, list[ast.expr], _Function]] = []
    for node in nodes(text):
        match node.value if isinstance(node, ast.Expr) else node:
            case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]) if name in here:
                function = functions[here[name]]
                inner = {
                    n.id
                    for argument in arguments
                    for n in ast.walk(argument)
                    if isinstance(n, ast.Name)
                }
                whole = isinstance(node, ast.Expr) == isinstance(function.body[0], ast.stmt)
                if whole and function.fits(arguments) and not inner & here.keys():
                    found.append((node, arguments, function))
    return found


def _source(node: ast.expr) -> str:
    """Return an argument's source in one line."""
    given = ast.unparse(node)
    return given if isinstance(node, ast.Name | ast.Attribute | ast.Constant) else f"({given})"
