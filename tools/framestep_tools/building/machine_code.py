"""Compiles C functions of an image, as functions of MicroPython's assembler."""

import re
import subprocess
import tempfile
from collections.abc import Mapping
from functools import cache
from pathlib import Path

from ..errors import ToolError
from .board_files import FIRMWARE, board_chip, board_engine

# What is made of C for an engine: {module: (C file, the function, its parameters)}
_PAINT = ("framestep/hal/rp2/paint.c", "paint", "r0, r1, r2, r3")
_OF_ENGINE: Mapping[str, Mapping[str, tuple[str, str, str]]] = {
    "registers": {"framestep/hal/rp2/painted.py": _PAINT}
}
_PROCESSORS = {"armv7emsp": "cortex-m33"}
_FLAGS = ("-mthumb", "-O2", "-ffreestanding", "-fPIC", "-Wall", "-Werror")
# bl skips the return into the function's own epilogue
_MODULE = '''"""{name}() of {file}, compiled."""


@micropython.asm_thumb
def {name}({parameters}):
    bl(CODE)
    b(END)
    align(4)
    label(CODE)
{words}
    label(END)
'''


@cache
def _compiled(file: str, processor: str) -> bytes:
    """Return the machine code of a C file with one function. Raises ToolError."""
    with tempfile.TemporaryDirectory(prefix="machine-code-") as folder:
        made, code = Path(folder, "made.o"), Path(folder, "made.bin")
        tool = "arm-none-eabi-"
        steps = (
            [f"{tool}gcc", f"-mcpu={_PROCESSORS[processor]}", *_FLAGS]
            + ["-c", str(FIRMWARE / file), "-o", str(made)],
            [f"{tool}objcopy", "-O", "binary", "-j", ".text", str(made), str(code)],
            [f"{tool}objdump", "-r", str(made)],
        )
        for step in steps:
            try:
                found = subprocess.run(step, capture_output=True, text=True)
            except FileNotFoundError:
                raise ToolError(f"{step[0]} is missing: apt install gcc-arm-none-eabi") from None
            if found.returncode:
                raise ToolError(f"{file}: {found.stderr.strip()}")
        if re.search(r"^[0-9a-f]{8} R_ARM", found.stdout, re.MULTILINE):
            raise ToolError(f"{file}: the code refers to something outside of it")
        return code.read_bytes()


def modules(board: str) -> dict[str, str]:
    """Return {"framestep/hal/rp2/painted.py": source} of what a board's image has from C."""
    found = {}
    for module, (file, name, parameters) in _OF_ENGINE.get(board_engine(board), {}).items():
        code = _compiled(file, board_chip(board).processor)
        halves = [int.from_bytes(code[i : i + 2], "little") for i in range(0, len(code), 2)]
        words = "\n".join(f"    data(2, {half})" for half in halves)
        found[module] = _MODULE.format(name=name, file=file, parameters=parameters, words=words)
    return found
