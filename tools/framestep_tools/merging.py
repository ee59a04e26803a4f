"""Makes one module of several before they are compiled for a board.

A module takes some 400 bytes of a board's memory: its dictionary, the names that it imports, and in
copied code a table of all names that it uses. So that files can be short nevertheless, those of a
package that are always loaded together are one module there, called like the one that needs all
others. So are the files of one subject in a package of several. Another name that two of them have
gets a number. They have been folded (framestep_tools.constants) before.

Tracebacks: the first file's lines are 1 to 1000, the second's 1001 to 2000, and so on.

    python -m framestep_tools.merging framestep.virtuals.requests 3123   which file and line that is
"""

import ast
import builtins
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import PurePosixPath

from .constants import Edits, FoldError

# What is one module on a board: the last file of each package, which has the name, and the files
# that stay apart.
TOGETHER: Mapping[str, Sequence[str]] = {
    # only where there are drivers, at the start
    "framestep/io/requests.py": ("tmc2209", "tmc2209_setup", "restore"),
    "framestep/motors/requests.py": (),
    "framestep/motion/ramps.py": (  # with phases alone
        *("compute", "formula", "kernel", "reals", "segments", "stepper", "tick"),
    ),
    "framestep/moves/requests.py": ("registers", "smoothing"),  # only where a rig asks for it
    "framestep/virtuals/requests.py": (  # types that a rig may do without, and what they need
        *(
            "absent",
            "registers",
            "kinematics",
            "arm",
            "boom_swing_track",
            "swing_pan",
            "x_y_z",
            "y_swing_track",
        ),
    ),
}
# Where it is not the whole package: the file that has the name, and those that are one with it.
FEW: Mapping[str, Sequence[str]] = {
    "framestep/controller.py": ("reports", "stops"),
    "framestep/rig.py": ("rig_settings", "rig_pins"),
    "framestep/hal/usb_port.py": ("usb_descriptor", "usb_transfers"),
}
LINES = 1000


def groups(
    texts: Mapping[str, str],
    together: Mapping[str, Sequence[str]] = TOGETHER,
    few: Mapping[str, Sequence[str]] = FEW,
) -> dict[str, list[str]]:
    """{last file: the others, each after those that it imports}; texts: the sources as they were
    before folding."""
    found = {}
    for last, named in (*together.items(), *few.items()):
        folder = PurePosixPath(last).parent
        inner = {p: text for p, text in sorted(texts.items()) if PurePosixPath(p).parent == folder}
        ordered = _in_order(inner, last)
        if last in together:
            ordered = [p for p in ordered if PurePosixPath(p).stem not in ("__init__", *named)]
        else:
            ordered = [p for p in ordered if p == last or PurePosixPath(p).stem in named]
        if ordered[-1] != last:
            raise FoldError(f"{ordered[ordered.index(last) + 1]} imports {last}")
        found[last] = ordered[:-1]
    return found


def _in_order(texts: Mapping[str, str], last: str) -> list[str]:
    """The paths, each after those that it imports at its top."""
    modules = {_dotted(path): path for path in texts}
    ordered: list[str] = []
    seen: set[str] = set()

    def add(path: str) -> None:
        if path in seen:
            return
        seen.add(path)
        for node in ast.parse(texts[path]).body:
            if isinstance(node, ast.ImportFrom):
                for module in (
                    node.module or "",
                    *(f"{node.module}.{alias.name}" for alias in node.names),
                ):
                    if module in modules:
                        add(modules[module])
        ordered.append(path)

    for path in (*(p for p in texts if p != last), last):
        add(path)
    return ordered


def merge(texts: Mapping[str, str], merged: Mapping[str, Sequence[str]]) -> dict[str, str]:
    """The modules, {path: source}, with those in `merged`, as groups() gives it, as one. FoldError
    where they cannot be."""
    found = dict(texts)
    # module: where it is now, and its names there
    moved: dict[str, tuple[str, dict[str, str]]] = {}
    for last, others in merged.items():
        group = _Group({path: found.pop(path) for path in (*others, last)})
        found[last] = group.text()
        for path in others:
            moved[_dotted(path)] = _dotted(last), group.names[path]
    return {path: _redirected(path, text, moved) for path, text in found.items()}


def where(path: str, line: int, merged: Mapping[str, Sequence[str]]) -> tuple[str, int]:
    """The file and line of a line of a module on a board."""
    paths = (*merged.get(path, ()), path)
    number = min((line - 1) // LINES, len(paths) - 1)
    return paths[number], line - number * LINES


def _dotted(path: str) -> str:
    return path.removesuffix(".py").replace("/", ".")


def _top(tree: ast.Module) -> Iterator[str]:
    """Names that a module's own statements bind, but for imports."""
    for node in tree.body:
        match node:
            case ast.FunctionDef(name=name) | ast.ClassDef(name=name):
                yield name
            case ast.Import() | ast.ImportFrom() | ast.Expr() | ast.Pass():
                pass
            case _:
                yield from (
                    n.id
                    for n in ast.walk(node)
                    if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Store)
                )


def _local(tree: ast.Module) -> set[str]:
    """Names that functions bind: parameters and variables."""
    found: set[str] = set()
    for function in ast.walk(tree):
        match function:
            case ast.FunctionDef() | ast.Lambda():
                found.update(n.arg for n in ast.walk(function.args) if isinstance(n, ast.arg))
                found.update(
                    n.id
                    for n in ast.walk(function)
                    if isinstance(n, ast.Name) and not isinstance(n.ctx, ast.Load)
                )
            case ast.Import(names=names) | ast.ImportFrom(names=names) if function not in tree.body:
                found.update(alias.asname or alias.name for alias in names)
            case ast.Global(names=names) | ast.Nonlocal(names=names):
                found.update(names)
    return found


class _Group:
    """Modules that become one, in the order of their texts."""

    def __init__(self, texts: Mapping[str, str]):
        self.texts = texts
        self.trees = {path: ast.parse(text) for path, text in texts.items()}
        self.modules = {_dotted(path): path for path in texts}
        # of each file: its own names, and what they are called now
        self.names: dict[str, dict[str, str]] = {}
        self.imports: dict[str, tuple[str, ...]] = {}  # names imported so far: what they are
        self._name_all()

    def _name_all(self) -> None:
        taken: set[str] = set(dir(builtins))
        for path, tree in self.trees.items():
            for node in tree.body:
                match node:
                    case ast.ImportFrom(module=str(module), names=names) if (
                        module not in self.modules
                    ):
                        for alias in names:
                            if f"{module}.{alias.name}" not in self.modules:
                                self._import(
                                    path, node, alias.asname or alias.name, (module, alias.name)
                                )
                    case ast.Import(names=names):
                        for alias in names:
                            self._import(
                                path, node, alias.asname or alias.name.split(".")[0], (alias.name,)
                            )
        taken |= self.imports.keys()
        for path, tree in self.trees.items():
            own = self.names[path] = {}
            for name in _top(tree):
                if name in own:
                    continue
                if name in dir(builtins):
                    raise FoldError(
                        f"{path}: {name} would hide the built-in one "
                        "from the modules merged with it"
                    )
                number = 2
                own[name] = name
                while own[name] in taken:
                    own[name] = f"{name}_{number}"
                    number += 1
            taken.update(own.values())

    def _import(self, path: str, node: ast.stmt, name: str, what: tuple[str, ...]) -> None:
        if self.imports.setdefault(name, what) != what:
            raise FoldError(
                f"{path}, line {node.lineno}: {name} is another thing in a module merged with it"
            )

    def text(self) -> str:
        parts = []
        imported: set[str] = set()
        for number, path in enumerate(self.texts):
            text = self._of(path, imported)
            count = len(text.splitlines())
            if count > LINES and number < len(self.texts) - 1:
                raise FoldError(f"{path} has more than {LINES} lines")
            parts.append(
                text
                if number == len(self.texts) - 1
                else text.rstrip("\n") + "\n" * (LINES - count + 1)
            )
        return "".join(parts)

    def _of(self, path: str, imported: set[str]) -> str:
        """The text of one of them; imported: names that those before it have imported."""
        tree = self.trees[path]
        edits = Edits(self.texts[path])
        new = dict(self.names[path])
        stands_for: dict[str, dict[str, str]] = {}  # name of a module: the names that it has
        for node in ast.walk(tree):
            if not isinstance(node, ast.Import | ast.ImportFrom):
                continue
            kept = []
            for alias in node.names:
                name = alias.asname or alias.name
                module = node.module or "" if isinstance(node, ast.ImportFrom) else ""
                if module in self.modules:
                    new[name] = self._known(path, node, self.modules[module], alias.name)
                elif f"{module}.{alias.name}" in self.modules:
                    stands_for[name] = self.names[self.modules[f"{module}.{alias.name}"]]
                elif node not in tree.body:
                    kept.append(alias)
                elif name not in imported:
                    imported.add(name)
                    kept.append(alias)
            if len(kept) == len(node.names):
                continue
            names = ", ".join(a.name + (f" as {a.asname}" if a.asname else "") for a in kept)
            start = f"from {node.module} import" if isinstance(node, ast.ImportFrom) else "import"
            edits.replace(node, f"{start} {names}" if kept else "pass")
        changed = {old for old, now in new.items() if old != now} | stands_for.keys()
        if hidden := sorted(changed & _local(tree)):
            raise FoldError(
                f"{path}: {', '.join(hidden)} is a variable of a function as well; "
                "give it another name"
            )
        bases = set()
        for node in ast.walk(tree):
            match node:
                case ast.JoinedStr() if any(
                    isinstance(n, ast.Name) and n.id in changed for n in ast.walk(node)
                ):
                    raise FoldError(
                        f"{path}, line {node.lineno}: "
                        f"{ast.unparse(node)} names what is called otherwise"
                    )
                case ast.Attribute(value=ast.Name(id=name) as base, attr=attribute) if (
                    name in stands_for
                ):
                    if attribute not in stands_for[name]:
                        raise FoldError(f"{path}, line {node.lineno}: {name} has no {attribute}")
                    edits.replace(node, stands_for[name][attribute])
                    bases.add(id(base))
                case ast.Name(id=name) if name in changed and id(node) not in bases:
                    if name in stands_for:
                        raise FoldError(
                            f"{path}, line {node.lineno}: {name} is no module on a board"
                        )
                    edits.replace(node, new[name])
                case ast.FunctionDef(name=name) | ast.ClassDef(name=name) if (
                    node in tree.body and name in changed
                ):
                    begin = node.col_offset + len(
                        "def " if isinstance(node, ast.FunctionDef) else "class "
                    )
                    edits.edits.append(
                        (node.lineno - 1, begin, begin + len(name.encode()), new[name].encode())
                    )
        return edits.text()

    def _known(self, path: str, node: ast.stmt, other: str, name: str) -> str:
        if name not in self.names[other] or [*self.texts].index(other) > [*self.texts].index(path):
            raise FoldError(f"{path}, line {node.lineno}: {name} is not yet there")
        return self.names[other][name]


def _redirected(path: str, text: str, moved: Mapping[str, tuple[str, dict[str, str]]]) -> str:
    """A module outside: what it imports from those that are gone comes from where they are."""
    edits = Edits(text)
    for node in ast.walk(ast.parse(text)):
        if not isinstance(node, ast.ImportFrom) or node.module is None:
            continue
        for alias in node.names:
            if f"{node.module}.{alias.name}" in moved:
                raise FoldError(
                    f"{path}, line {node.lineno}: "
                    f"{alias.name} is no module on a board; import from it"
                )
        if node.module in moved:
            there, names = moved[node.module]
            parts = [
                names.get(a.name, a.name)
                + (f" as {a.asname or a.name}" if a.asname or a.name in names else "")
                for a in node.names
            ]
            edits.replace(node, f"from {there} import {', '.join(parts)}")
    return edits.text()


def main() -> None:
    """What the head of this file says."""
    from .files import sources

    if len(sys.argv) != 3:
        sys.exit(__doc__)
    texts = {path: file.read_text() for path, file in sources().items()}
    # an image shows a path, copied code a module
    path = sys.argv[1].removesuffix(".py").replace(".", "/") + ".py"
    print("{}:{}".format(*where(path, int(sys.argv[2]), groups(texts))))


if __name__ == "__main__":
    main()
