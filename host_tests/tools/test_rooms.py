"""Imports between the packages of tools/, and of framestep_tools' rooms: each imports from layers
below only, and no modules in a circle."""

import ast
from collections.abc import Iterator
from graphlib import TopologicalSorter
from pathlib import Path

import framestep_tools
from framestep_tools.paths import FIRMWARE, ROOT

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
    ("prove",),
    ("documents",),
    ("console",),
    ("commands", "site"),
    ("cli",),
    ("__main__",),
)
LAYER = {room: number for number, rooms in enumerate(LAYERS) for room in rooms}
# The project's own packages, and which of them each may import. One that has only itself could be
# released without the rest.
PACKAGES = {
    "framestep": {"framestep"},
    "flash_images": {"flash_images"},
    "framestep_emulator": {"framestep_emulator", "flash_images"},
    "framestep_tools": {"framestep", "flash_images", "framestep_emulator", "framestep_tools"},
}
FOLDERS = {name: ROOT / "tools" / name for name in PACKAGES} | {"framestep": FIRMWARE / "framestep"}
# All that the conformance kit knows of framestep: frames, edges, what a limit allows, and an arm's
# position by the specification's mathematics
FOR_CONFORM = {
    "conform", "client.wire", "judge.motion_limits", "judge.trace", "judge.virtual_reference",
}  # fmt: skip


def modules(folder: Path) -> list[Path]:
    return [path for path in sorted(folder.rglob("*.py")) if "node_modules" not in path.parts]


def imported(path: Path, folder: Path) -> Iterator[tuple[int, str]]:
    """Yield (line, dotted name) for each import of the project's packages, anywhere in a module of
    the package in this folder. What follows `from x import` may be a module or not."""
    package = [folder.name, *path.relative_to(folder).parts[:-1]]
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ImportFrom):
            base = package[: len(package) + 1 - node.level] if node.level else []
            parts = [part for part in (*base, node.module) if part]
            names = [".".join((*parts, alias.name)) for alias in node.names]
        elif isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        else:
            continue
        for name in names:
            if name.split(".")[0] in (*PACKAGES, "host_tests"):
                yield node.lineno, name


def wrong_imports(name: str, folder: Path) -> list[str]:
    """List what a package must not import."""
    return [
        f"{path.relative_to(folder.parent)}:{line} imports {to}"
        for path in modules(folder)
        for line, to in imported(path, folder)
        if to.split(".")[0] not in PACKAGES[name]
    ]


def test_each_package_imports_what_it_may():
    for name, folder in FOLDERS.items():
        assert len(modules(folder)) > 2, name
        assert wrong_imports(name, folder) == []


def test_an_emulator_that_imports_framestep_is_found(tmp_path):
    folder = tmp_path / "framestep_emulator"
    folder.mkdir()
    (folder / "emulator.py").write_text(
        "from flash_images import uf2\nfrom . import image\n"
        "def start():\n    from framestep_tools.building import images\n"
        "import framestep.rig\n"
    )
    assert wrong_imports("framestep_emulator", folder) == [
        "framestep_emulator/emulator.py:5 imports framestep.rig",
        "framestep_emulator/emulator.py:4 imports framestep_tools.building.images",
    ]


def room(path: Path) -> str:
    return path.relative_to(TOOLS).parts[0].removesuffix(".py")


def test_each_room_imports_from_below():
    files = [path for path in TOOLS.rglob("*.py") if path.parent != TOOLS or path.stem[0] != "_"]
    files.append(TOOLS / "__main__.py")
    assert {room(path) for path in files} == set(LAYER)
    arrows = [
        (path, line, parts[1])
        for path in files
        for line, name in imported(path, TOOLS)
        if (parts := name.split("."))[0] == TOOLS.name and parts[1:] and parts[1] != room(path)
    ]
    assert len(arrows) > 300
    wrong = [
        f"{path.relative_to(TOOLS)}:{line} imports {to}"
        for path, line, to in arrows
        if LAYER[to] >= LAYER[room(path)]
    ]
    assert wrong == []


def test_there_is_no_circle():
    """Not even of imports for types only. The error names the modules of one."""
    files = {
        ".".join((TOOLS.name, *path.relative_to(TOOLS).with_suffix("").parts)).removesuffix(
            ".__init__"
        ): path
        for path in modules(TOOLS)
    }
    arrows = {
        module: {
            known
            for _, name in imported(path, TOOLS)
            for known in [name if name in files else name.rpartition(".")[0]]
            if known in files.keys() - {module}
        }
        for module, path in files.items()
    }
    assert len(arrows[f"{TOOLS.name}.console.server"]) > 3, "imports are seen"
    TopologicalSorter(arrows).prepare()


def beyond_conform(folder: Path) -> list[str]:
    """List what the conformance kit in a folder of framestep_tools must not import."""
    allowed = tuple(f"{TOOLS.name}.{module}." for module in FOR_CONFORM)
    return [
        f"{path.relative_to(folder)}:{line} imports {to}"
        for path in modules(folder / "conform")
        for line, to in imported(path, folder)
        if not f"{to}.".startswith(allowed)
    ]


def test_the_conformance_kit_knows_frames_and_edges_only():
    assert len(modules(TOOLS / "conform")) > 20
    assert beyond_conform(TOOLS) == []


def test_a_conformance_kit_that_imports_the_firmware_is_found(tmp_path):
    folder = tmp_path / TOOLS.name
    (folder / "conform/checks").mkdir(parents=True)
    (folder / "conform/checks/moves.py").write_text(
        "from framestep.protocol import messages\nfrom .. import spec\n"
        "from ...client import wire\nfrom ...client.wire import Frame\n"
        "from ...client.client import Client\n"
    )
    assert beyond_conform(folder) == [
        "conform/checks/moves.py:1 imports framestep.protocol.messages",
        "conform/checks/moves.py:5 imports framestep_tools.client.client.Client",
    ]
