"""What a kernel is: a function that MicroPython's viper compiler turns into machine code.

The build, the type checks and the tests that translate kernels ask here. This module knows only
syntax trees, and imports nothing of framestep.
"""

import ast
from collections.abc import Iterator

CASTS = {"ptr8", "ptr16", "ptr32"}  # of viper: a kernel's pointers


def is_decorator(node: ast.AST) -> bool:
    """Return whether this is the decorator of a kernel, `@micropython.viper`."""
    match node:
        case ast.Attribute(value=ast.Name(id="micropython"), attr="viper"):
            return True
    return False


def is_kernel(node: ast.AST) -> bool:
    """Return whether this is the definition of a kernel."""
    return isinstance(node, ast.FunctionDef) and any(map(is_decorator, node.decorator_list))


def kernels(module: ast.Module) -> Iterator[tuple[str, ast.FunctionDef]]:
    """Yield ("" or the name of its class, definition) of each kernel of a module, in the order of
    the text. Of an `if` both ways are compiled."""
    yield from _within(module.body, "")


def _within(body: list[ast.stmt], owner: str) -> Iterator[tuple[str, ast.FunctionDef]]:
    for node in body:
        match node:
            case ast.ClassDef():
                yield from _within(node.body, node.name)
            case ast.If():
                yield from _within([*node.body, *node.orelse], owner)
            case ast.FunctionDef() if is_kernel(node):
                yield owner, node
