"""Where the builds of MicroPython lie, made by tools/micropython/build.sh when they are missing."""

import shutil
import subprocess
from pathlib import Path

from framestep_tools.files import CACHE, ROOT

_PRODUCTS = {
    "rp2": "build/rp2/firmware.bin",
    "unix32f": "build/unix32f/micropython",
    "unix32": "build/unix32/micropython",
    "unix64": "build/unix64/micropython",
}


class BuildError(Exception):
    """A build is missing and cannot be made here; the text says why."""


def _run(*command: str) -> None:
    result = subprocess.run(command, cwd=ROOT, stdin=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    if result.returncode != 0:
        raise BuildError(f"{' '.join(command)} failed:\n{result.stderr.strip()}")


def micropython(target: str) -> Path:
    """The product of a target of build.sh ("rp2", "unix32f", ...), built first if it is not there."""
    product = CACHE / _PRODUCTS[target]
    if not product.exists():
        _run("tools/micropython/build.sh", target)
    return product


def emulator_ready() -> Path:
    """What the emulated board needs: node, its package, and the RP2040 firmware, whose path is given back."""
    if not (ROOT / "tools/emulator/board/node_modules/rp2040js/package.json").exists() or not shutil.which("node"):
        _run("tools/setup.sh", "node")
    return micropython("rp2")
