"""How long an ESP32 takes to build a millisecond of its stream: instructions of a Xtensa processor
in QEMU.

A plugin (tools/micropython/bare/count.c) counts them; the difference between a long and a short run
leaves the start out. At one instruction per cycle the result is a lower bound: a chip also waits
for memory, most of all for PSRAM.
"""

import subprocess
import tempfile
from functools import cache
from pathlib import Path

from .. import paths
from ..building import images
from ..building.board_files import compiled_tree
from ..errors import ToolError

MHZ = 240
_QEMU = ("qemu-xtensa", "-cpu", "dc233c")
_HEAP_KB = 1000
_SHORT_MS, _LONG_MS = 300, 600  # after the ramp
_VERSIONS = range(1, 8)  # of QEMU's interface for plugins
_COUNTER = paths.ROOT / "tools" / "micropython" / "bare" / "count.c"
_SCRIPT = Path(__file__).with_name("stream_on_board.py")


@cache
def _counter() -> tuple[tempfile.TemporaryDirectory, Path]:
    """Compile the plugin for the installed QEMU."""
    folder = tempfile.TemporaryDirectory(prefix="count-")
    for version in _VERSIONS:
        plugin = Path(folder.name, f"count{version}.so")
        words = ["gcc", "-O2", "-shared", "-fPIC", f"-DVERSION={version}", "-o"]
        subprocess.run([*words, plugin, _COUNTER], check=True)
        tried = subprocess.run(
            [*_QEMU, "-plugin", plugin, images.micropython("xtensa")],
            capture_output=True,
            text=True,
        )
        if "instructions " in tried.stderr:
            return folder, plugin
    raise ToolError(f"{_QEMU[0]} takes no plugin that counts instructions: {tried.stderr.strip()}")


def _instructions(rate: int, ms: int) -> int:
    tree = compiled_tree("xtensawin", "stream")
    program = [images.micropython("xtensa"), _HEAP_KB, tree, _SCRIPT, rate, ms]
    ran = subprocess.run(
        [*_QEMU, "-plugin", str(_counter()[1]), *map(str, program)], capture_output=True, text=True
    )
    if ran.returncode != 0:
        raise ToolError(f"the stream was not built: {ran.stdout}{ran.stderr}")
    if ran.stdout.strip() != f"speed {rate}":
        raise ToolError(f"the motors did not reach {rate} steps/s: {ran.stdout}")
    return int(ran.stderr.rsplit("instructions ", 1)[1])


def us(rate: int) -> float:
    """Return the microseconds for each millisecond of eight motors at this rate, steps/s."""
    more = _instructions(rate, _LONG_MS) - _instructions(rate, _SHORT_MS)
    return more / (_LONG_MS - _SHORT_MS) / MHZ
