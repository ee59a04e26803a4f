"""The firmware on a simulated ESP32 (tools/micropython/esp32), with the interface of boards.Board.

Real MicroPython runs in QEMU with the port's own I2S, timers and pins, in virtual time. The pins
are the outputs of a chain of 74HC595.
"""

import json
import os
import struct
import subprocess
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from framestep.rig import Rig

from .. import paths
from ..building import images
from ..building.board_files import compiled_tree
from ..errors import ToolError
from ..judge.trace import Edge, PinDecoder, pins_of
from . import shift_registers
from .boards import closed_switches

if TYPE_CHECKING:
    from typing_extensions import Self

_CHIP = paths.ROOT / "tools" / "micropython" / "esp32"
_STARTS = _CHIP / "firmware.py"
_BOARD = _CHIP / "board.json"
RATE = 250_000
CHAIN = 64  # pin number of the chain's output 0
_HEAP_KB = 1024
_QEMU = "qemu-riscv32"
_END_S = 5


def board_data() -> dict[str, Any]:
    """Return the simulated board's data, in the form of boards/*/board.json."""
    return json.loads(_BOARD.read_text())


class Esp32Error(ToolError):
    """The firmware has ended."""


class Esp32Board:
    """A simulated board. rig: settings of a rig file; the board is in
    tools/micropython/esp32/board.json."""

    slice_ns = 10_000_000
    repl = None

    def __init__(self, rig: Mapping[str, Any] | None = None):
        data = board_data()
        self.rig = Rig(dict(rig or {}), data)
        motors = enumerate(self.rig.motors, 1)
        inverted = [number for number, motor in motors if motor["invert"]]
        self._folder = tempfile.TemporaryDirectory(prefix="esp32-")
        folder = Path(self._folder.name)
        (folder / "board.json").write_text(json.dumps(data))
        (folder / "rig.json").write_text(json.dumps(rig or {}))
        self._record = folder / "played"
        self._errors = (folder / "errors").open("w+b")
        commands, self._commands = os.pipe()
        self._answers, answers = os.pipe()
        tree = compiled_tree("rv32imc", "stream")
        words = [_QEMU, images.micropython("esp32"), _HEAP_KB, f"{tree}:.frozen", _STARTS]
        words += [folder / "board.json", folder / "rig.json", self._record]
        words += [f"/dev/fd/{commands}", f"/dev/fd/{answers}"]
        self._process = subprocess.Popen(
            [str(word) for word in words],
            pass_fds=(commands, answers),
            stdin=subprocess.DEVNULL,
            stdout=self._errors,
            stderr=self._errors,
        )
        os.close(commands)
        os.close(answers)
        self._now = 0
        self._sent = bytearray()
        self._played_to = 0  # position in the record
        self._before = 0  # the last played bits
        self._last: tuple[int, int] | None = None  # the last word and its time
        self._decoder = PinDecoder(pins_of(data, rig, _BOARD.name), inverted)
        self.protocol = self
        self._answer()  # waits until the firmware is up

    def _answer(self) -> None:
        head = self._take(12)
        self._now, count = struct.unpack("<QI", head)
        self._sent += self._take(count)

    def _take(self, count: int) -> bytes:
        data = b""
        while len(data) < count:
            more = os.read(self._answers, count - len(data))
            if not more:
                self._process.wait()
                self._errors.seek(0)
                said = self._errors.read().decode(errors="replace")
                raise Esp32Error(f"the firmware has ended:\n{said}")
            data += more
        return data

    def _command(self, letter: str, form: str, *values: Any) -> None:
        os.write(self._commands, letter.encode() + struct.pack("<" + form, *values))

    def receive(self, data: bytes) -> None:
        if data:
            self._command("w", "I", len(data))
            os.write(self._commands, data)

    def transmit(self) -> bytes:
        data = bytes(self._sent)
        self._sent.clear()
        return data

    def open_port(self, on: bool) -> None:
        """Do nothing: a UART does not show it."""

    @property
    def pending(self) -> int:
        return 0

    @property
    def now_ns(self) -> int:
        return self._now

    def run_until(self, ns: int, until_output: bool = False) -> None:
        if ns > self._now:
            self._command("r", "QB", ns, until_output)
            self._answer()

    def pause(self, ms: float) -> None:
        """Hold up the main loop once for this long, in its next pass."""
        self._command("s", "Q", round(ms * 1e6))

    def set_pin(self, pin: int, level: int) -> None:
        """Drive a pin of the chip from outside."""
        self._command("p", "BB", pin, level)

    def wire_switches(self) -> None:
        """Connect the rig's stop switches, untouched."""
        for pin in closed_switches(self.rig):
            self.set_pin(pin, 0)

    def edges(self) -> list[Edge]:
        """Return edges of the chain's outputs in what has been played since the last call."""
        with self._record.open("rb") as file:
            file.seek(self._played_to)
            buffers, end = shift_registers.buffers(file.read())
        self._played_to += end
        if not buffers:
            return []
        times, words = shift_registers.outputs(buffers, RATE, self._before)
        self._before = shift_registers.last_bits(buffers[-1][1])
        if self._last is not None:
            times = np.insert(times, 0, self._last[0])
            words = np.insert(words, 0, self._last[1])
        self._last = int(times[-1]), int(words[-1])
        records = shift_registers.records(times, words)
        records["pin"] += CHAIN
        return self._decoder.feed(records)

    def close(self) -> None:
        """End the board."""
        os.close(self._commands)
        os.close(self._answers)
        try:
            self._process.wait(_END_S)
        except subprocess.TimeoutExpired:  # it no longer reads commands
            self._process.kill()
            self._process.wait()
        self._errors.close()
        self._folder.cleanup()

    def __enter__(self) -> "Self":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
