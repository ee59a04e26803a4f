"""A simulated ESP32 (tools/micropython/esp32), with the interface of boards.Board.

Real MicroPython runs with the port's own I2S, timers, pins and file system, in virtual
time, from power-up on. The pins are the outputs of a chain of 74HC595.
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

from flash_images import littlefs_image
from framestep.rig import Rig

from ..board.file_install import LIST, MAIN, listing, main_py
from ..building import images
from ..building.board_files import board_data, board_sources, compiled_modules
from ..client.port_finder import BAUD
from ..errors import ToolError
from ..judge.trace import Edge, PinDecoder, pins_of
from . import shift_registers
from .boards import Channel, closed_switches
from .driver_chips import Chips
from .usb_host import SerialPort, UsbHost

if TYPE_CHECKING:
    from typing_extensions import Self

BOARD = "esp32_595"
RATE = 250_000
CHAIN = 64  # pin number of the chain's output 0
PROCESSOR, RISC_V = "x86", "rv32imc"  # as mpy-cross calls them
_HEAP_KB = 1024
_FLASH_BYTES = 2 << 20  # of the file system
_ERASED = b"\xff" * _FLASH_BYTES
_PROG_SIZE = 32  # as MicroPython's port for ESP32 formats it
_PROGRAMS = {PROCESSOR: ("esp32", ()), RISC_V: ("rv32", ("qemu-riscv32",))}
_END_S = 5
_START_NS = 10_000_000_000  # until the protocol's own port is there
_RUNS, _RESET, _NO_POWER, _WATCHDOG = range(4)  # states in an answer: chip.h
_CAUSES = {_NO_POWER: 1, _RESET: 2, _WATCHDOG: 3}  # machine.reset_cause() after each
# struct line_byte in chip.h: a byte on a TX pin, with the time of its first bit; a bit takes
# divider · 25/32 ns. With 0 bits: a level of a servo's pin.
LINE_BYTE = np.dtype(
    [("t", "<u8"), ("divider", "<u4"), ("pin", "u1"), ("byte", "u1"), ("bits", "u1"), ("-", "u1")]
)
_NO_PIN = 255
_MOST_PLAYED = 16 << 20  # bytes of the record that are decoded at once
_MOST_LINE_BYTES = 2_000_000  # of the other UARTs; when there are more, the older half goes


def modules(board: str = BOARD, processor: str = PROCESSOR) -> dict[str, bytes]:
    """Return a board's modules, {"framestep/motors/axis.mpy": content}."""
    return compiled_modules(board_sources(board), processor)


def installed(board: str = BOARD, processor: str = PROCESSOR) -> dict[str, bytes]:
    """Return the files of a board with framestep, {path: content}."""
    found = modules(board, processor)
    files = {f"/{name}": content for name, content in found.items()}
    return files | {LIST: listing(board, found), MAIN: main_py()}


class Esp32Error(ToolError):
    """The simulated chip has stopped."""


class Esp32Board:
    """A simulated board. rig: settings of a rig file; board: its name in boards/; files: the
    content of its file system (None: framestep and the rig file; {}: erased flash); heap_kb: size
    of MicroPython's heap, without the machine code of modules; baud: the host's rate; processor:
    RISC_V runs in QEMU and takes six times as long."""

    slice_ns = 10_000_000

    def __init__(
        self,
        rig: Mapping[str, Any] | None = None,
        board: str = BOARD,
        files: Mapping[str, bytes] | None = None,
        heap_kb: int = _HEAP_KB,
        baud: int = BAUD,
        processor: str = PROCESSOR,
    ):
        data = board_data(board)
        self.rig = Rig(dict(rig or {}), data)
        motors = enumerate(self.rig.motors, 1)
        inverted = [number for number, motor in motors if motor["invert"]]
        self._folder = tempfile.TemporaryDirectory(prefix="esp32-")
        folder = Path(self._folder.name)
        self._record = folder / "played"
        self._flash = folder / "flash"
        if files is None:
            files = installed(board, processor) | {"/rig.json": json.dumps(rig or {}).encode()}
        blocks = _FLASH_BYTES // littlefs_image.BLOCK_SIZE
        image = littlefs_image.make_image(files, blocks, _PROG_SIZE) if files else _ERASED
        self._flash.write_bytes(image)
        self._errors = (folder / "errors").open("w+b")
        self._heap_kb = heap_kb
        self._target, self._emulator = _PROGRAMS[processor]
        self._now = 0
        self.host = UsbHost(self) if data["ports"] == 2 else None
        self._cause = _CAUSES[_NO_POWER]
        self._baud = baud
        self._sent = bytearray()
        self._lines: list[np.ndarray] = []  # bytes on the other UARTs
        self._chips: Chips | None = None  # drivers on one of them
        self._played = bytearray()  # bytes of records that have not been parsed
        self._played_to = 0  # position in the present record
        self._edges: list[Edge] = []
        self._before = 0  # the last played bits
        self._last: tuple[int, int] | None = None  # the last word and its time
        self._decoder = PinDecoder(pins_of(data, rig, board), inverted)
        self._driven: dict[int, int] = {}
        self.protocol: Channel = self
        self.repl: Channel | None = None
        self.powered = False
        self.power_on()
        if self.rig.ports == 2 and "/framestep/modules" in files:
            self._find_port()

    def power_on(self) -> None:
        """Start the chip, and wait until its program waits for something."""
        commands, self._commands = os.pipe()
        self._answers, answers = os.pipe()
        words = [*self._emulator, images.micropython(self._target), self._heap_kb, "board"]
        words += [self._flash, self._record, f"/dev/fd/{commands}", f"/dev/fd/{answers}", self._now]
        words += [self._cause, self._baud, int(self.host is not None)]
        self._process = subprocess.Popen(
            [str(word) for word in words],
            pass_fds=(commands, answers),
            stdin=subprocess.DEVNULL,
            stdout=self._errors,
            stderr=self._errors,
        )
        os.close(commands)
        os.close(answers)
        self.powered = True
        self._answer()
        for pin, level in self._driven.items():
            self._command("p", "BB", pin, level)

    def _find_port(self) -> None:
        """Wait for the protocol's own port."""
        assert self.host
        end = self._now + _START_NS
        while len(self.host.ports) < 2:
            if self._now > end:
                said = self.transmit().decode(errors="replace")
                raise Esp32Error(f"no port of the protocol appears; the REPL says:\n{said}")
            self.run_until(self._now + self.slice_ns)
        self.protocol, self.repl = self.host.ports[1], self

    def usb(self, letter: str, form: str, *values: Any, data: bytes = b"") -> None:
        """Send a command for USB."""
        self._command("u" + letter, form, *values)
        if data:
            os.write(self._commands, data)

    def step(self, ns: int) -> None:
        """Let time pass until then, as the USB host needs it."""
        while ns > self._now and self.powered:
            self._command("r", "QBB", ns, 0, _NO_PIN)
            self._answer()

    def _read_record(self) -> None:
        with self._record.open("rb") as file:
            file.seek(self._played_to)
            more = file.read()
        self._played_to += len(more)
        self._played += more

    def power_off(self) -> None:
        """Cut the power; the flash keeps its content."""
        if self.powered:
            self._end()
            self._cause = _CAUSES[_NO_POWER]
            self._sent.clear()

    def cut_power_after(self, count: int) -> None:
        """Cut the power when this many bytes of flash have been written or erased."""
        self._command("c", "I", count)

    def files(self) -> dict[str, bytes]:
        """Return {path: content} of its file system."""
        return littlefs_image.read_image(self._flash.read_bytes(), _PROG_SIZE)

    def _answer(self) -> None:
        self._now, state, count = struct.unpack("<QBI", self._take(13))
        self._sent += self._take(count)
        (count,) = struct.unpack("<I", self._take(4))
        if count:
            self._lines.append(np.frombuffer(self._take(count * LINE_BYTE.itemsize), LINE_BYTE))
            if sum(map(len, self._lines)) > _MOST_LINE_BYTES:
                del self._lines[: len(self._lines) // 2]
        usb = struct.unpack("<B6II", self._take(29))
        records = self._take(usb[-1])
        if self.host:
            self.host.take(usb[0], usb[1:7], records)
        if self._record.stat().st_size - self._played_to > _MOST_PLAYED:
            self._edges += self._decode()
        if state != _RUNS:
            self._end()
            self._cause = _CAUSES[state]
        if state in (_RESET, _WATCHDOG):
            self.power_on()

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
        if not self.powered:
            raise Esp32Error("the board has no power")
        os.write(self._commands, letter.encode() + struct.pack("<" + form, *values))

    def receive(self, data: bytes) -> None:
        if data:
            self._command("w", "I", len(data))
            os.write(self._commands, data)

    def transmit(self) -> bytes:
        data = bytes(self._sent)
        self._sent.clear()
        return data

    @property
    def baud(self) -> int:
        """The host's rate at the board's port. Nothing gets across at another one than the
        board's."""
        return self._baud

    @baud.setter
    def baud(self, rate: int) -> None:
        self._baud = rate
        self._command("b", "I", rate)

    def open_port(self, on: bool) -> None:
        """Do nothing: a UART does not show it."""

    @property
    def pending(self) -> int:
        return 0

    @property
    def now_ns(self) -> int:
        return self._now

    def run_until(self, ns: int, until_output: bool = False) -> None:
        pin = self.rig.board["drivers"]["tx"] if self._chips else _NO_PIN
        while ns > self._now:
            self._command("r", "QBB", ns, until_output, pin)
            self._answer()
            if self._chips:
                self._talk(self._chips)
            if self.host and self.powered:
                self.host.attend()
            if not self.powered or (until_output and self._said()):
                return

    def _said(self) -> bool:
        """Return whether the protocol's port has sent something."""
        own = self.protocol
        return bool(own.arrived if isinstance(own, SerialPort) else self._sent)

    def connect(self, chips: Chips) -> None:
        """Connect drivers to the board's UART for them."""
        self._chips = chips
        self._lines.clear()

    def _talk(self, chips: Chips) -> None:
        """Pass on what the board has said to the drivers, and their answers, which come back
        together, after the last byte on the wire."""
        line = self.rig.board["drivers"]
        for byte in self.line(line["tx"]):
            chips.byte(int(byte["byte"]), int(byte["t"]))
        answers = chips.take_answers()
        if answers:
            self._command("l", "BQI", line["rx"], self._now, len(answers))
            os.write(self._commands, answers)

    def line(self, pin: int) -> np.ndarray:
        """Return the bytes that a UART has sent on a pin since the last call: an array of
        LINE_BYTE."""
        sent = np.concatenate([np.zeros(0, LINE_BYTE), *self._lines])
        self._lines = [sent[sent["pin"] != pin]]
        return sent[sent["pin"] == pin]

    def line_edges(self, pin: int) -> tuple[np.ndarray, np.ndarray]:
        """Return the same as edges: their times in ns, and the level after each. The pin may also
        be a servo's."""
        times, levels = [], []
        for byte in self.line(pin):
            if not byte["bits"]:
                times.append(np.array([byte["t"]], np.int64))
                levels.append(np.array([byte["byte"]], np.int64))
                continue
            bits = [0, *np.unpackbits(byte["byte"], bitorder="little"), 1]
            changed = np.flatnonzero(np.diff([1, *bits]))
            times.append(int(byte["t"]) + changed * int(byte["divider"]) * 25 // 32)
            levels.append(np.array(bits)[changed])
        nothing = np.zeros(0, np.int64)
        return np.concatenate([nothing, *times]), np.concatenate([nothing, *levels])

    def pause(self, ms: float) -> None:
        """Hold up the main loop once for this long, in its next pass."""
        self._command("s", "Q", round(ms * 1e6))

    def set_pin(self, pin: int, level: int) -> None:
        """Drive a pin of the chip from outside."""
        self._driven[pin] = level
        self._command("p", "BB", pin, level)

    def wire_switches(self) -> None:
        """Connect the rig's stop switches, untouched."""
        for pin in closed_switches(self.rig):
            self.set_pin(pin, 0)

    def edges(self) -> list[Edge]:
        """Return the edges of the chain's outputs since the last call."""
        found = self._edges + self._decode()
        self._edges = []
        return found

    def _decode(self) -> list[Edge]:
        self._read_record()
        buffers, end = shift_registers.buffers(bytes(self._played))
        del self._played[:end]
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

    def _end(self) -> None:
        self.powered = False
        if self.host:
            self.host.lose()
        os.close(self._commands)
        os.close(self._answers)
        try:
            self._process.wait(_END_S)
        except subprocess.TimeoutExpired:  # it no longer reads commands
            self._process.kill()
            self._process.wait()
        self._read_record()
        self._played_to = 0  # a new process writes a new record

    def close(self) -> None:
        """End the board."""
        self.power_off()
        self._errors.close()
        self._folder.cleanup()

    def __enter__(self) -> "Self":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
