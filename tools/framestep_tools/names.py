"""Takes names out of the source before it is compiled for a board that nothing looks up there.

Each name in a .mpy file is an entry in MicroPython's table of names, which lies in memory where the
file was copied: seven bytes and the text. And the table grows by doubling: the 1261st name of
copied code takes 7.7 kB at once. A name that a module imports is an entry of its dictionary, frozen
or copied. So on a board

* modules do not import what the compiler alone needs: `const`, `micropython` for its decorators,
  the casts of viper;
* parameters are called `_1`, `_2`, ... where no call names them and no function within might see
  them;
* data that the objects of one module alone have for themselves is called so, too: `self._ticks` is
  `self._3`;
* what a module has for itself, and no traceback shows, is called `__1`, `__2`, ...: kernels in
  viper, and data; of modules that only the start needs all functions, of which a traceback then
  gives file and line.

Lines stay where they are, so that tracebacks are right.
"""

import ast
from collections.abc import Iterator, Mapping, Set

from .constants import Edits, drop_imports, is_decorator, live

# loaded for the start alone, but their names remain
_BRIEF = {"framestep/rig.py", "framestep/hal/rp2_code.py"}
_INNER = (
    ast.FunctionDef,
    ast.Lambda,
    ast.ClassDef,
    ast.ListComp,
    ast.SetComp,
    ast.DictComp,
    ast.GeneratorExp,
)


def lean(
    texts: Mapping[str, str], by_hand: tuple[str, ...] = (), kept: Set[str] = frozenset()
) -> dict[str, str]:
    """The same modules, {path: source}, without the names. They have been folded
    (framestep_tools.constants) before.

    by_hand: beginnings of the paths of modules whose functions somebody calls from the REPL, naming
    parameters: those keep theirs. kept: names that modules keep for themselves.
    """
    trees = {path: ast.parse(text) for path, text in texts.items()}
    named = {
        node.arg
        for tree in trees.values()
        for node in ast.walk(tree)
        if isinstance(node, ast.keyword) and node.arg
    }
    looked_up = set(kept).union(*map(_looked_up, trees.values()))
    private = _private(trees)
    found = {}
    for path, text in texts.items():
        edits = Edits(text)
        drop_imports(edits, trees[path])
        _number_attributes(edits, trees[path], private)
        if not path.startswith(by_hand or ("/",)):
            _number_parameters(edits, trees[path], named)
            _number_globals(edits, trees[path], looked_up, path in _BRIEF)
        found[path] = edits.text()
    return found


def _number_parameters(edits: Edits, tree: ast.Module, named: set[str]) -> None:
    """Number the parameters of functions that have nothing nested in them."""
    for function in ast.walk(tree):
        if not isinstance(function, ast.FunctionDef):
            continue
        inside = [node for statement in function.body for node in ast.walk(statement)]
        if any(isinstance(node, (*_INNER, ast.Global, ast.Nonlocal)) for node in inside):
            continue
        bound = {node.name for node in inside if isinstance(node, ast.ExceptHandler)}
        bound |= {node.asname or node.name for node in inside if isinstance(node, ast.alias)}
        given = function.args
        if given.vararg or given.kwarg or given.kwonlyargs or given.posonlyargs:
            continue
        new = {}
        for number, argument in enumerate(given.args):
            if argument.arg != "self" and argument.arg not in named | bound:
                new[argument.arg] = f"_{number}"
                end = argument.col_offset + len(argument.arg.encode())
                edits.edits.append(
                    (argument.lineno - 1, argument.col_offset, end, new[argument.arg].encode())
                )
        for node in inside:
            if isinstance(node, ast.Name) and node.id in new:
                edits.replace(node, new[node.id])


def _private(trees: Mapping[str, ast.Module]) -> set[str]:
    """Attributes that begin with an underscore, hold data, and are met in one module alone: so that
    an object with them has none of another module's."""
    met: dict[str, set[str]] = {}
    stored: set[str] = set()
    other: set[str] = set()  # what is a name as well, or a text
    derived: set[str] = set()  # modules whose objects have attributes of two modules
    for path, tree in trees.items():
        modules = {
            alias.asname or alias.name: {node.module or "", f"{node.module}.{alias.name}"}
            for node in ast.walk(tree)
            if isinstance(node, ast.ImportFrom)
            for alias in node.names
        }
        for node in ast.walk(tree):
            match node:
                case ast.Attribute(attr=name, ctx=context) if name.startswith(
                    "_"
                ) and not name.startswith("__"):
                    met.setdefault(name, set()).add(path)
                    if isinstance(context, ast.Store):
                        stored.add(name)
                case (
                    ast.Name(id=name)
                    | ast.FunctionDef(name=name)
                    | ast.alias(name=name)
                    | ast.arg(arg=name)
                ):
                    other.add(name)
                case ast.Constant(value=str(name)):
                    other.add(name)
                case ast.ClassDef(bases=bases):
                    for base in (
                        n.id for b in bases for n in ast.walk(b) if isinstance(n, ast.Name)
                    ):
                        if base in modules:
                            derived |= {path} | {
                                name.replace(".", "/") + ".py" for name in modules[base]
                            }
    return {
        name
        for name, paths in met.items()
        if name in stored and name not in other and len(paths) == 1 and not paths & derived
    }


def _number_attributes(edits: Edits, tree: ast.Module, private: set[str]) -> None:
    """Number the attributes that a module's objects have for themselves, as parameters are: other
    modules' objects have the same numbers."""
    own: dict[str, str] = {}
    for node in ast.walk(tree):
        match node:
            case ast.Attribute(attr=name, end_lineno=int(line), end_col_offset=int(end)) if (
                name in private
            ):
                own.setdefault(name, f"_{len(own) + 1}")
                edits.edits.append((line - 1, end - len(name.encode()), end, own[name].encode()))


def _looked_up(tree: ast.Module) -> Iterator[str]:
    """Names that are looked up other than in the dictionary of the module that has them."""
    for node in ast.walk(tree):
        match node:
            case (
                ast.Attribute(attr=name)
                | ast.alias(name=name)
                | ast.arg(arg=name)
                | ast.Constant(value=str(name))
            ):
                yield name
            case ast.Global(names=names) | ast.Nonlocal(names=names):
                yield from names


def _number_globals(edits: Edits, tree: ast.Module, looked_up: set[str], brief: bool) -> None:
    """Number a module's own kernels and data, those that begin with an underscore; brief: all its
    functions."""
    own: dict[str, str] = {}
    inner: set[str] = set()  # names that functions and classes have of their own
    for node in live(tree):
        match node:
            case ast.FunctionDef() | ast.ClassDef() if node not in tree.body:
                inner.add(node.name)
            case ast.FunctionDef() | ast.ClassDef() | ast.Lambda():
                inner.update(
                    n.id
                    for n in ast.walk(node)
                    if isinstance(n, ast.Name) and not isinstance(n.ctx, ast.Load)
                )
    for node in tree.body:
        match node:
            case ast.Assign(targets=[ast.Name(id=name)], value=value):
                constant = isinstance(value, ast.Call) and ast.unparse(value.func) == "const"
            case ast.FunctionDef(name=name, decorator_list=decorators) if brief or any(
                map(is_decorator, decorators)
            ):
                constant = False
            case _:
                continue
        if name.startswith("_") and not constant and name not in looked_up | inner:
            own.setdefault(name, f"__{len(own) + 1}")
    for node in ast.walk(tree):
        match node:
            case ast.Name(id=name) if name in own:
                edits.replace(node, own[name])
            case ast.FunctionDef(name=name) if name in own:
                begin = node.col_offset + len("def ")
                edits.edits.append(
                    (node.lineno - 1, begin, begin + len(name.encode()), own[name].encode())
                )
