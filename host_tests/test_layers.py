"""Imports between modules: a module imports from its own package and from layers below
(ARCHITECTURE.md lists them). Also what parts of the controller may know of each other."""

import ast
from collections.abc import Iterator
from functools import cache

from framestep_tools.building.board_files import ROOT, sources

# A module is in the first layer that names it or its package. Packages of one layer do not import
# each other.
LAYERS = (
    ("base.native_cpython",),
    ("base.native",),
    ("hal.rp2.chip", "hal.rp2.chip_rp2350"),
    ("soft_reset",),
    ("base",),
    ("pulse",),
    ("hal",),
    ("protocol",),
    ("motion",),
    ("motors",),
    ("io", "moves", "virtual_axes"),
    ("rig.drivers",),
    ("rig.settings",),
    ("rig.homes", "rig.servos", "rig.pendants"),
    ("rig.pins",),
    ("rig",),
    ("reports", "interlock"),
    ("answers",),
    ("stops",),
    ("homing", "hand_wheel"),
    ("controller",),
    ("faults",),
    ("texts",),
    ("hal.host_board", "runner"),
    ("boot",),
    ("repl",),
)

_MADE = {"board"}  # by the build


def dotted(path: str) -> str:
    return (
        path.removeprefix("framestep/")
        .removesuffix(".py")
        .removesuffix("/__init__")
        .replace("/", ".")
    )


@cache
def imports() -> dict[str, set[str]]:
    """Return {module: modules of framestep that it imports, anywhere in it}, without `framestep.`
    in front."""
    modules = {dotted(path) for path in sources()} - {"__init__"}
    found: dict[str, set[str]] = {}
    for path, file in sources().items():
        if dotted(path) == "__init__":
            continue
        found[dotted(path)] = set(_of(ast.parse(file.read_text()), modules))
    return found


def _of(tree: ast.AST, modules: set[str]) -> Iterator[str]:
    for node in ast.walk(tree):
        match node:
            case ast.ImportFrom(module=str(module), names=names) if (
                module.split(".")[0] == "framestep"
            ):
                base = module.removeprefix("framestep").removeprefix(".")
                for alias in names:
                    full = f"{base}.{alias.name}".removeprefix(".")
                    if full in modules:
                        yield full
                    elif base:
                        yield base
            case ast.Import(names=names):
                yield from (
                    a.name.removeprefix("framestep.")
                    for a in names
                    if a.name.startswith("framestep.")
                )


def layer(module: str) -> int:
    for names in (module, module.split(".")[0]):
        for i, layer in enumerate(LAYERS):
            if names in layer:
                return i
    raise AssertionError(f"{module} is in no layer")


def edges() -> Iterator[tuple[str, str]]:
    for module, others in imports().items():
        yield from ((module, other) for other in others if other not in _MADE)


def test_nothing_imports_upward():
    for module, other in edges():
        same = module.split(".")[0] == other.split(".")[0]
        assert layer(other) < layer(module) or (layer(other) == layer(module) and same), (
            f"{module} imports {other}"
        )


def test_the_protocol_is_known_to_requests_and_above():
    """Only the controller and above, and modules that read requests, know the protocol."""
    knowing = {module for module, other in edges() if other.startswith("protocol.")}
    below = {
        module
        for module in knowing
        if layer(module) < layer("reports") and not module.startswith("protocol.")
    }
    assert {module for module in below if not module.endswith(".requests")} == set()


def test_payloads_are_taken_apart_and_made_by_requests():
    """Below the controller nothing else has a FrameReader or a FrameWriter, by these names."""
    for path, file in sources().items():
        module = dotted(path)
        if module.split(".")[0] not in (
            "motion",
            "motors",
            "io",
            "moves",
            "virtual_axes",
        ) or module.endswith(".requests"):
            continue
        for node in ast.walk(ast.parse(file.read_text())):
            match node:
                case ast.Name(id=name) | ast.arg(arg=name) | ast.Attribute(attr=name):
                    assert name not in ("reader", "writer"), (
                        f"{module}, line {node.lineno}, has a {name}"
                    )


def test_layers_are_reported():
    """ARCHITECTURE.md lists them."""
    reported = (ROOT / "ARCHITECTURE.md").read_text()
    for names in LAYERS:
        for name in names:
            assert f"`{name}`" in reported, f"ARCHITECTURE.md does not name {name}"


def test_there_is_no_circle():
    """Between modules, within functions or not."""
    done: list[str] = []

    def walk(module: str, path: tuple[str, ...]) -> None:
        assert module not in path, f"a circle: {' -> '.join((*path, module))}"
        if module not in done:
            for other in imports().get(module, ()):
                walk(other, (*path, module))
            done.append(module)

    for module in imports():
        walk(module, ())


MOST_LINES = 600


def test_files_have_one_subject():
    """A longer file has two subjects, or its docstring says why it is one file."""
    for path, file in sources().items():
        text = file.read_text()
        reported = " ".join((ast.get_docstring(ast.parse(text)) or "").split())
        lines = len(text.splitlines())
        assert lines <= MOST_LINES or "one file" in reported or "one viper function" in reported, (
            f"{path} has {lines} lines, more than {MOST_LINES}: make two files of its two subjects,"
            ' or say in its docstring why it is "one file"'
        )


# The parts of a controller. Each is passed by name to those that use it. Io only groups lights,
# inputs and outputs, so it is not listed.
PARTS = {
    "faults", "interlock", "homing", "motors", "moves", "operations", "reports", "safety", "stops",
    "virtuals",
}  # fmt: skip
# Modules that put the parts together, or run or show the whole; answers is a method of the
# controller in a file of its own
WHOLE = ("controller", "answers", "runner", "boot", "texts", "hal.host_board", "repl")


def _part(node: ast.expr) -> str:
    """Return the name of a part: of `interlock` or `self.interlock`; "" for anything else."""
    match node:
        case ast.Attribute(value=ast.Name(id="self"), attr=name) | ast.Name(id=name):
            return name if name in PARTS else ""
    return ""


def test_parts_know_no_controller():
    for path, file in sources().items():
        module = dotted(path)
        if module.startswith(WHOLE):
            continue
        for node in ast.walk(ast.parse(file.read_text())):
            match node:
                case ast.Name(id=name) | ast.arg(arg=name) | ast.Attribute(attr=name):
                    assert name != "controller", f"{module}, line {node.lineno}: {name}"


def test_parts_keep_their_fields_and_what_they_consist_of_to_themselves():
    """A part of another module is called (`interlock.enabled(motor)`), but nobody writes to it or
    reaches through it, not even the controller. Only an operation and its runner, which are one
    state machine, may."""
    for path, file in sources().items():
        module = dotted(path)
        if module != "controller" and module.startswith(WHOLE):
            continue
        is_operation = module.split(".")[0] == "moves" and not module.endswith(".requests")
        for node in ast.walk(ast.parse(file.read_text())):
            match node:
                case ast.Attribute(value=ast.Attribute(value=part)) if _part(part):
                    reached = f"{ast.unparse(node)} reaches through a part"
                case ast.Attribute(value=part, ctx=ast.Store()) if _part(part):
                    reached = f"{ast.unparse(node)} is set from outside"
                case _:
                    continue
            allowed = is_operation and _part(part) == "operations"
            assert allowed, f"{module}, line {node.lineno}: {reached}"


MOST_PARAMETERS = 7


def test_constructors_say_what_they_are_made_of():
    """With more than seven parameters nobody remembers their order: some of them belong together,
    like the port, the reader and the writer of a Link."""
    for path in sorted((ROOT / "firmware").rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text())):
            match node:
                case ast.FunctionDef(name="__init__", args=args):
                    names = args.posonlyargs + args.args + args.kwonlyargs
                    assert len(names) - 1 <= MOST_PARAMETERS, (
                        f"{path.relative_to(ROOT)}, line {node.lineno}: {len(names) - 1} parameters"
                    )
