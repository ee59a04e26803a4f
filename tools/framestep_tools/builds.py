"""Where the builds of MicroPython lie, made by tools/micropython/build.sh when they are missing."""

import hashlib
import os
import shutil
import subprocess
from pathlib import Path

from framestep_tools.files import CACHE, ROOT, board_files

_PRODUCTS = {
    "rp2": "build/rp2/firmware.bin",
    "unix32f": "build/unix32f/micropython",
    "unix32": "build/unix32/micropython",
    "unix64": "build/unix64/micropython",
}


class BuildError(Exception):
    """A build is missing and cannot be made here; the text says why."""


def _run(*command: str, **environment: str) -> str:
    """What the command prints on standard output."""
    result = subprocess.run(
        command, cwd=ROOT, env={**os.environ, **environment}, stdin=subprocess.DEVNULL, capture_output=True, text=True
    )
    if result.returncode != 0:
        raise BuildError(f"{' '.join(command)} failed:\n{result.stderr.strip()}")
    return result.stdout


def micropython(target: str) -> Path:
    """The product of a target of build.sh ("rp2", "unix32f", ...), built first if it is not there."""
    product = CACHE / _PRODUCTS[target]
    if not product.exists():
        _run("tools/micropython/build.sh", target)
    return product


def frozen(board: str = "pico") -> Path:
    """Firmware with everything that a board gets in it, main.py too; made anew when a source has changed.

    Two minutes the first time, then some twenty seconds. Frozen code is the .mpy files that a board would get copied.
    """
    files = {name.removeprefix("/lib"): data for name, data in board_files(board=board).items()}
    folder = CACHE / "frozen" / board
    manifest = folder / "manifest.py"
    files["/manifest.py"] = b'freeze("modules")\n'
    stamp, digest = folder / "stamp", hashlib.sha256(repr(sorted(files.items())).encode()).hexdigest()
    product = (
        CACHE / "build" / f"rp2-{hashlib.sha256(str(manifest.resolve()).encode()).hexdigest()[:8]}" / "firmware.bin"
    )
    if product.exists() and stamp.exists() and stamp.read_text() == digest:
        return product
    stamp.unlink(missing_ok=True)
    kept = set()
    for name, data in files.items():
        path = folder / ("" if name == "/manifest.py" else "modules") / name.lstrip("/")
        kept.add(path)
        if not path.exists() or path.read_bytes() != data:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(data)
    for path in folder.rglob("*"):
        if path.is_file() and path not in kept:
            path.unlink()
    _run("tools/micropython/build.sh", "rp2", FROZEN=str(manifest))
    stamp.write_text(digest)
    return product


def emulator_ready() -> Path:
    """What the emulated board needs: node, its package, and the RP2040 firmware, whose path is given back."""
    if not (ROOT / "tools/emulator/board/node_modules/rp2040js/package.json").exists() or not shutil.which("node"):
        _run("tools/setup.sh", "node")
    return micropython("rp2")
