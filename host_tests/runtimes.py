"""MicroPython with 32-bit words and single-precision floats, as a program of this computer, for
each processor for which framestep's kernels are compiled."""

import os
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import pytest

from framestep_tools.building import images
from framestep_tools.building.board_files import CACHE, compiled_tree

T = TypeVar("T")

# Heap: about what MicroPython leaves free on an RP2040 (233 to 242 kB).
_HEAP = "240k"
_BYTES = {"k": 1 << 10, "m": 1 << 20}


@dataclass(frozen=True)
class Processor:
    """target: of tools/micropython/build.sh; march: mpy-cross's name for it; emulator: command that
    runs its programs if this computer cannot; share: of many similar cases one in this many is run,
    as QEMU takes 15 (rv32) or 60 (xtensa) times as long as this computer."""

    target: str
    march: str
    emulator: tuple[str, ...] = ()
    share: int = 1


PROCESSORS = {
    "x86": Processor("unix32f", "x86"),
    "xtensa": Processor("xtensa", "xtensawin", ("qemu-xtensa", "-cpu", "dc233c"), 6),
    "rv32": Processor("rv32", "rv32imc", ("qemu-riscv32",), 2),
}
# Processors with the peripherals of a chip, in virtual time
CHIPS = {"esp32": Processor("esp32", "x86")}


class Runtime:
    """Runs scripts on MicroPython, with the core compiled as for a board.

    run("print(1)") or run(Path("script.py"), "argument") returns what the script printed. A script
    that ends with an exception or an exit status fails the test with its traceback. It can import
    modules from its folder. On an emulated processor no argument may have a blank.
    """

    def __init__(self, name: str, scratch: Path, engine: str = "pio"):
        self.name = name
        self._processor = (PROCESSORS | CHIPS)[name]
        self._executable = images.micropython(self._processor.target)
        self._scratch = scratch
        self._core = compiled_tree(self._processor.march, engine)  # once: it takes long

    @staticmethod
    def missing(name: str) -> str:
        """Return why this computer cannot build MicroPython for a processor; "" if it can. In CI it
        must."""
        why = CACHE / "build" / f"{name}.missing"
        return why.read_text().strip() if why.exists() and not os.environ.get("CI") else ""

    @property
    def emulated(self) -> bool:
        """Whether QEMU runs it."""
        return bool(self._processor.emulator)

    def share(self, cases: Sequence[T]) -> Sequence[T]:
        """Return the cases, of many, that run on this processor."""
        return cases[:: self._processor.share]

    def _command(self, script: Path, args, heap: str, search: str) -> list[str]:
        if self._processor.target == "unix32f":
            return [str(self._executable), "-X", f"heapsize={heap}", str(script), *map(str, args)]
        kilobytes = int(heap[:-1]) * _BYTES[heap[-1].lower()] >> 10
        words = (*self._processor.emulator, self._executable, kilobytes, search, script, *args)
        return [str(word) for word in words]

    def run(
        self,
        script,
        *args,
        heap: str = _HEAP,
        path=(),
        stdin: bytes | None = None,
        timeout: float = 1000,
    ) -> str:
        if not isinstance(script, Path):
            script_file = self._scratch / "script.py"
            script_file.write_text(script)
            script = script_file
        search = ":".join(map(str, [self._core, *path, ".frozen"]))
        try:
            result = subprocess.run(
                self._command(script, args, heap, search),
                env={**os.environ, "MICROPYPATH": search},
                input=b"" if stdin is None else stdin,
                capture_output=True,
                timeout=timeout,
            )
        except subprocess.TimeoutExpired as late:
            out = (late.stdout or b"").decode(errors="replace")
            pytest.fail(
                f"{script} ran on {self.name} for more than {timeout} s; it had printed:\n{out}",
                pytrace=False,
            )
        out = result.stdout.decode(errors="replace")
        if result.returncode != 0:
            # Depending on its version, MicroPython prints tracebacks of uncaught exceptions on
            # standard output or error.
            err = result.stderr.decode(errors="replace")
            pytest.fail(
                f"{script} on {self.name}, exit status {result.returncode}:\n{out}\n{err}",
                pytrace=False,
            )
        return out
