"""Imports between the packages of framestep_tools: each imports from layers below only."""

import ast
from collections.abc import Iterator
from pathlib import Path

import framestep_tools

TOOLS = Path(framestep_tools.__file__).parent
# Packages of one layer do not import each other
LAYERS = (
    ("errors", "paths", "payloads"),
    ("chips", "text"),
    ("axes", "building"),
    ("client", "judge"),
    ("board", "conform", "traffic"),
    ("simulator",),
    ("move",),
    ("bench", "demo"),
    ("documents", "prove"),
    ("console",),
    ("commands", "site"),
    ("cli",),
    ("__main__",),
)
LAYER = {room: number for number, rooms in enumerate(LAYERS) for room in rooms}


def room(path: Path) -> str:
    return path.relative_to(TOOLS).parts[0].removesuffix(".py")


def imported(path: Path) -> Iterator[tuple[int, str]]:
    """Yield (line, room) for each import of another room, anywhere in a module."""
    package = [TOOLS.name, *path.relative_to(TOOLS).parts[:-1]]
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ImportFrom):
            base = package[: len(package) + 1 - node.level] if node.level else []
            modules = [[*base, *(node.module or "").split("."), a.name] for a in node.names]
        elif isinstance(node, ast.Import):
            modules = [a.name.split(".") for a in node.names]
        else:
            continue
        for names in modules:
            found = [name for name in names if name]
            if found[0] == TOOLS.name and len(found) > 1 and found[1] != room(path):
                yield node.lineno, found[1]


def test_each_room_imports_from_below():
    files = [path for path in TOOLS.rglob("*.py") if path.parent != TOOLS or path.stem[0] != "_"]
    files.append(TOOLS / "__main__.py")
    assert {room(path) for path in files} == set(LAYER)
    arrows = [(path, line, to) for path in files for line, to in imported(path)]
    assert len(arrows) > 300
    wrong = [
        f"{path.relative_to(TOOLS)}:{line} imports {to}"
        for path, line, to in arrows
        if LAYER[to] >= LAYER[room(path)]
    ]
    assert wrong == []
