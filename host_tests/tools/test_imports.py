"""Imports between modules of the tools go in no circle."""

import ast
from collections.abc import Iterator

from framestep_tools.building.board_files import ROOT

TOOLS = ROOT / "tools"


def modules() -> dict[str, ast.Module]:
    """Return {dotted name: syntax tree} of the package's modules."""
    return {
        ".".join(path.relative_to(TOOLS).with_suffix("").parts).removesuffix(".__init__"): (
            ast.parse(path.read_text())
        )
        for path in (TOOLS / "framestep_tools").rglob("*.py")
    }


def imported(module: str, is_package: bool, tree: ast.Module, known: set[str]) -> Iterator[str]:
    """Yield the modules of `known` that a module imports, anywhere in it: for types only, too."""
    package = module.split(".") if is_package else module.split(".")[:-1]
    for node in ast.walk(tree):
        match node:
            case ast.ImportFrom(module=name, level=level, names=names):
                above = package[: len(package) - level + 1] if level else []
                base = ".".join([*above, *([name] if name else [])])
                for alias in names:
                    full = f"{base}.{alias.name}"
                    if full in known:
                        yield full
                    elif base in known:
                        yield base
            case ast.Import(names=names):
                yield from (alias.name for alias in names if alias.name in known)


def circle(edges: dict[str, set[str]]) -> list[str]:
    """Return the modules of a circle, or [] if there is none."""
    done: set[str] = set()

    def walk(module: str, path: list[str]) -> list[str]:
        if module in path:
            return [*path[path.index(module) :], module]
        if module not in done:
            for other in sorted(edges[module]):
                if found := walk(other, [*path, module]):
                    return found
            done.add(module)
        return []

    return next((found for module in edges if (found := walk(module, []))), [])


def test_a_circle_is_found():
    assert circle({"a": {"b"}, "b": {"c"}, "c": {"b"}}) == ["b", "c", "b"]
    assert circle({"a": {"b", "c"}, "b": {"c"}, "c": set()}) == []


def test_there_is_no_circle():
    trees = modules()
    packages = {name.rpartition(".")[0] for name in trees}
    edges = {
        name: set(imported(name, name in packages, tree, trees.keys() - {name}))
        for name, tree in trees.items()
    }
    assert len(edges["framestep_tools.console.server"]) > 3  # imports are seen
    assert circle(edges) == []
