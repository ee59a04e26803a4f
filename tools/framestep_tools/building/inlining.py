"""Replaces calls of some functions by their expressions, before a module is compiled for a board.

A call costs a board ten times as much as a sum, and a function costs a name and 50 bytes of memory.
So the functions of some modules, each a single `return`, only exist for readers.

If the expression uses a parameter more than once, or only in one of its cases, the argument must be
a name, a number or a word of an array: nothing with a side effect. Line numbers stay the same, so
tracebacks are right.
"""

import ast
from collections.abc import Mapping
from dataclasses import dataclass

from .constants import Edits, FoldError, shorten


@dataclass(frozen=True)
class _Function:
    parameters: tuple[str, ...]
    result: ast.expr
    once: bool  # each parameter is evaluated once, as in a call

    def fits(self, arguments: list[ast.expr]) -> bool:
        """Return whether a call with these arguments can be replaced."""
        return len(arguments) == len(self.parameters) and (
            self.once or not any(isinstance(n, ast.Call) for a in arguments for n in ast.walk(a))
        )

    def call(self, arguments: list[str]) -> str:
        """Return the expression with these arguments for the parameters."""
        given = dict(zip(self.parameters, arguments, strict=True))

        class Put(ast.NodeTransformer):
            def visit_Name(self, node: ast.Name) -> ast.Name:
                return ast.Name(given[node.id]) if node.id in given else node

        return f"({ast.unparse(Put().visit(ast.parse(ast.unparse(self.result), mode='eval')))})"


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

    class Number(ast.NodeTransformer):
        def visit_Name(self, node: ast.Name) -> ast.expr:
            return ast.Constant(constants[node.id]) if node.id in constants else node

    for node in ast.parse(text).body:
        match node:
            case ast.Assign(
                targets=[ast.Name(id=name)],
                value=ast.Call(func=ast.Name(id="const"), args=[ast.Constant(value=int(value))]),
            ):
                constants[name] = value
            case ast.FunctionDef(
                name=name, args=arguments, body=[*_, ast.Return(value=ast.expr() as result)]
            ):
                parameters = tuple(argument.arg for argument in arguments.args)
                used = [
                    n.id
                    for n in ast.walk(result)
                    if isinstance(n, ast.Name) and n.id not in constants
                ]
                if set(used) != set(parameters):
                    raise FoldError(
                        f"{path}, line {node.lineno}: "
                        f"{name} has to use its parameters, nothing else"
                    )
                cases = any(isinstance(n, ast.IfExp | ast.BoolOp) for n in ast.walk(result))
                once = not cases and len(used) == len(parameters)
                functions[name] = _Function(parameters, Number().visit(result), once)
    return functions


def _inlined(path: str, text: str, source: str, functions: Mapping[str, _Function]) -> str:
    tree = ast.parse(text)
    imports = [n for n in ast.walk(tree) if isinstance(n, ast.ImportFrom) and n.module == source]
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
        for call, function in calls:
            edits.replace(call, function.call([_source(text, argument) for argument in call.args]))
        text = edits.text()
    for left in ast.walk(ast.parse(text)):
        if isinstance(left, ast.Name) and left.id in here:
            raise FoldError(
                f"{path}, line {left.lineno}: {left.id} has to be called, with all arguments"
                ", none of which calls anything if it is used more than once"
            )
    return text


def _innermost(
    text: str, here: Mapping[str, str], functions: Mapping[str, _Function]
) -> list[tuple[ast.Call, _Function]]:
    """Return calls of these functions whose arguments contain no such call."""
    found = []
    for node in ast.walk(ast.parse(text)):
        match node:
            case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]) if name in here:
                function = functions[here[name]]
                inner = {
                    n.id
                    for argument in arguments
                    for n in ast.walk(argument)
                    if isinstance(n, ast.Name)
                }
                if function.fits(arguments) and not inner & here.keys():
                    found.append((node, function))
    return found


def _source(text: str, node: ast.expr) -> str:
    """Return an argument's source in one line."""
    given = " ".join((ast.get_source_segment(text, node) or "").split())
    return given if isinstance(node, ast.Name | ast.Attribute | ast.Constant) else f"({given})"
