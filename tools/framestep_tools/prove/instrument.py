"""Edges of a board's pins, stamped by the board itself.

Four motors of a PIO block stand and their state machines wait for a command; meanwhile they can do
something else. Each watches a pin with a program of eight instructions: a loop of two cycles counts
x down, and at an edge x goes to the FIFO, from where DMA takes it to memory that the uploaded move
leaves free. Then the machines get back what they had, and never know. All of them begin in the same
cycle, so edges of several pins have one origin of time.

The board keeps running framestep as it is. What is sent to its REPL is small, as there are about
10 kB for it: it reads and writes registers that this module names.

Addresses and bits: RP2040 datasheet 2.3.1.7 (pins), 2.5.7 (DMA), 3.7 (PIO).
"""

import ast
from base64 import b64decode
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from ..errors import ToolError

BLOCK_MACHINES = 4
CYCLES = 2  # of the loop: the resolution of a stamp

_PIO = (0x50200000, 0x50300000)
_SET, _CLEAR = 0x2000, 0x3000  # aliases of registers: these bits are set, cleared
_RXF, _INSTRUCTIONS, _MACHINE, _MACHINE_BYTES = 0x20, 0x48, 0xC8, 0x18
_CLKDIV, _EXECCTRL, _SHIFTCTRL, _ADDR, _INSTR, _PINCTRL = 0, 4, 8, 12, 16, 20
_SETTINGS = (_CLKDIV, _EXECCTRL, _SHIFTCTRL, _PINCTRL)
_ALL = 15
_RESTART, _CLKDIV_RESTART = _ALL << 4, _ALL << 8
_WHOLE_CLOCK = 1 << 16
_JOIN_TX, _JOIN_RX = 1 << 30, 1 << 31
_MOST_INSTRUCTIONS = 32

_DMA, _CHANNEL_BYTES = 0x50000000, 0x40
_READ, _WRITE, _COUNT, _CONTROL, _CONTROL_QUIET = 0x0, 0x4, 0x8, 0xC, 0x10
_TRIGGER, _ABORT = 0x430, 0x444
_ENABLED, _WORDS, _INCREMENT, _SILENT, _BUSY = 1, 2 << 2, 1 << 5, 1 << 21, 1 << 24
_CHAIN, _REQUEST = 11, 15
_LEVELS = 0xD0000004
_COUNT_ONLY = 0x7FFFFFFF
_MICROSECONDS = 0x40054028  # TIMERAWL, 4.6.5

# instructions; jumps get the program's origin added
_JMP, _JMP_X, _JMP_PIN = 0x0000, 0x0040, 0x00C0
_ISR_X, _PUSH, _NOP, _X_ONES = 0xA0C1, 0x8000, 0xA042, 0xA02B
_HIGH, _LOW, _LENGTH = 2, 6, 8
_STAMP, _PASS_BY = (_ISR_X, _PUSH), (_NOP, _NOP)

_CHUNK = 256  # stamps read at a time: the board has little memory
_SCRIPT = """
import rp2
from array import array
from binascii import b2a_base64
from machine import mem32
from framestep import boot
from framestep.native import addressof
def put(*w):
    for i in range(0, len(w), 2):
        mem32[w[i]] = w[i + 1]
def get(*w):
    print([mem32[x] & 0xFFFFFFFF for x in w])
def words():
    for x in boot.controller.moves.store.__dict__.values():
        if isinstance(x, array): return x
def store():
    for x in boot.controller.moves.store.__dict__.values():
        if isinstance(x, bytearray): return x
"""
# Half words that regions and units take of the store, see moves/upload_chunks.py
_ROOM = (
    "w = words()\nprint(addressof(store()), 2 * w[{BOTTOM}], 2 * (w[{SIZE}] - {UNIT} * w[{USED}]))"
)
_CLAIM = "prove_dma = [rp2.DMA() for _ in range({count})]\nprint([d.channel for d in prove_dma])"
_RELEASE = "for d in prove_dma: d.close()\nprove_dma = None"
_DUMP = "print(b2a_base64(memoryview(store())[{begin}:{end}]).decode(), end='')"


@dataclass(frozen=True)
class Edges:
    """What was seen of a pin.

    times_ns: of the edges that were kept, from the begin of the capture; level: that of the pin at
    the begin; both: whether falling edges were stamped as well; count: of all edges that there
    were, kept or not.
    """

    times_ns: np.ndarray
    level: int
    both: bool
    count: int

    @property
    def rises_ns(self) -> np.ndarray:
        """The rising edges that were kept."""
        return self.times_ns[self.level :: 2] if self.both else self.times_ns

    @property
    def falls_ns(self) -> np.ndarray:
        """The falling edges that were kept; none where only rising ones were stamped."""
        return self.times_ns[1 - self.level :: 2] if self.both else self.times_ns[:0]


class CannotCapture(ToolError):
    """The board's state machines cannot be borrowed; the text says why."""


def program(origin: int, both: bool) -> list[int]:
    """The instructions that stamp a pin's edges, or its rising edges alone, from `origin` on."""
    return [
        *_STAMP,
        _JMP_X | origin + _HIGH + 1,
        _JMP_PIN | origin + _HIGH,
        *(_STAMP if both else _PASS_BY),
        _JMP_X | origin + _LOW + 1,
        _JMP_PIN | origin,
    ]


def times_ns(stamps: np.ndarray, both: bool, skip: int, clock_hz: int) -> np.ndarray:
    """Times of the edges of consecutive stamps, ns since the begin. skip: stamps before the first.

    A pass of the loop takes two cycles and counts one; an edge takes two more, counted by none, and
    so does a falling edge that is passed by.
    """
    before = np.append(0xFFFFFFFF, stamps[:-1]).astype(np.int64)
    passes = np.cumsum((before - stamps) & 0xFFFFFFFF)
    edges = (np.arange(len(stamps)) + skip) * (1 if both else 2)
    return (passes + edges) * (CYCLES * 1e9 / clock_hz)


class Instrument:
    """run: runs code on the board's REPL and gives what it printed; clock_hz: of its processor."""

    def __init__(self, run: Callable[[str], str], clock_hz: int = 125_000_000):
        self._run = run
        self._hz = clock_hz
        self.begun_us = 0  # when the last capture began, by the board's counter of microseconds
        run(_SCRIPT)

    def now_us(self) -> int:
        """The board's counter of microseconds, which wraps at 2^32."""
        return self._get(_MICROSECONDS)[0]

    def _put(self, *pairs: tuple[int, int]) -> None:
        for i in range(0, len(pairs), 8):
            words = ",".join(f"{address},{value}" for address, value in pairs[i : i + 8])
            self._run(f"put({words})")

    def _get(self, *addresses: int) -> list[int]:
        return ast.literal_eval(self._run(f"get({','.join(map(str, addresses))})"))

    def capture(
        self,
        block: int,
        pins: Sequence[int],
        during: Callable[[], None],
        both: bool = False,
        skip: int = 0,
        most: int = 1 << 20,
    ) -> list[Edges]:
        """The edges of up to four pins while `during` runs, stamped by the state machines of a PIO
        block whose motors stand meanwhile.

        both: falling edges as well; skip: so many edges of each pin are only counted before the
        first that is kept; most: so many are kept of each, or as many as the memory that the pins
        share out holds. Later ones are only counted.
        CannotCapture if these motors move.
        """
        if not 1 <= len(pins) <= BLOCK_MACHINES:
            raise ValueError(f"one pin for each state machine: 1 to 4, not {len(pins)}")
        borrowed = _Borrowed(self, block, pins, both, skip, most)
        try:
            self.begun_us = borrowed.begin()
            during()
        except BaseException:
            with suppress(ToolError):  # the error that is under way tells more
                borrowed.end()
            raise
        counts = borrowed.end()
        found = []
        for i, (kept, count) in enumerate(counts):
            stamps = borrowed.read(i, kept)
            times = times_ns(stamps, both, skip, self._hz)
            found.append(Edges(times, borrowed.levels >> pins[i] & 1, both, count))
        return found


class _Borrowed:
    """State machines, DMA channels and memory, for one capture."""

    def __init__(
        self,
        instrument: Instrument,
        block: int,
        pins: Sequence[int],
        both: bool,
        skip: int,
        most: int,
    ):
        self._run, self._put, self._get = instrument._run, instrument._put, instrument._get
        self._base, self._block = _PIO[block], block
        self._pins, self._both, self._skip, self._most = pins, both, skip, most
        self._channels: list[tuple[int, int]] = []
        self._saved: list[int] = []
        self._origin = 0
        self.levels = 0

    def _machine(self, i: int, register: int) -> int:
        return self._base + _MACHINE + i * _MACHINE_BYTES + register

    def begin(self) -> int:
        """Borrow all of it and let it run; the board's microsecond in which it began."""
        from framestep.moves import upload_chunks

        names = {name: getattr(upload_chunks, name) for name in ("BOTTOM", "SIZE", "UNIT", "USED")}
        self._store, begin, end = map(int, self._run(_ROOM.format(**names)).split())
        self._at = -(-(self._store + begin) // 4) * 4
        room = (self._store + end - self._at) // 4 - 1
        self._size = min(self._most, room // len(self._pins))
        machines = range(BLOCK_MACHINES)
        origins = set(self._get(*(self._machine(i, _ADDR) for i in machines)))
        self._origin = max(origins)
        if len(origins) != 1 or self._origin < _LENGTH:
            raise CannotCapture(
                "the state machines that would watch are not those of motors at rest: "
                "let all motors stand"
            )
        self._saved = self._get(*(self._machine(i, k) for i in machines for k in _SETTINGS))
        channels = ast.literal_eval(self._run(_CLAIM.format(count=2 * len(self._pins))))
        self._channels = list(zip(channels[::2], channels[1::2], strict=True))
        self.levels = self._get(_LEVELS)[0]
        self._put(
            (self._base + _CLEAR, _ALL),
            *(
                (self._base + _INSTRUCTIONS + 4 * k, word)
                for k, word in enumerate(program(0, self._both))
            ),
        )
        for i in range(len(self._pins)):
            self._put(*self._machine_words(i), *self._channel_words(i))
        first = sum(1 << (drop if self._skip else keep) for keep, drop in self._channels)
        self._put(
            (_DMA + _TRIGGER, first),
            # for the next time that they begin, when all that is to be kept has been
            *((_DMA + d * _CHANNEL_BYTES + _COUNT, _COUNT_ONLY) for _, d in self._channels),
        )
        start = f"put({self._base + _SET},{(1 << len(self._pins)) - 1})"
        return ast.literal_eval(self._run(f"{start};get({_MICROSECONDS})"))[0]

    def _machine_words(self, i: int) -> list[tuple[int, int]]:
        pin = self._pins[i]
        start = _HIGH if self.levels >> pin & 1 else _LOW
        return [
            (self._machine(i, _CLKDIV), _WHOLE_CLOCK),
            (self._machine(i, _EXECCTRL), pin << 24 | (_LENGTH - 1) << 12 | _LOW << 7),
            (self._machine(i, _PINCTRL), 0),
            (self._machine(i, _SHIFTCTRL), _JOIN_RX),
            (self._machine(i, _INSTR), _X_ONES),
            (self._machine(i, _INSTR), _JMP | start),
        ]

    def _channel_words(self, i: int) -> list[tuple[int, int]]:
        keep, drop = self._channels[i]
        fifo = self._base + _RXF + 4 * i
        request = 8 * self._block + 4 + i
        common = _ENABLED | _WORDS | _SILENT | request << _REQUEST
        words = []
        for channel, other, at, count, control in (
            (keep, drop, self._place(i), self._size, common | _INCREMENT),
            (drop, keep, self._sink, self._skip or _COUNT_ONLY, common),
        ):
            registers = _DMA + channel * _CHANNEL_BYTES
            words += [
                (registers + _READ, fifo),
                (registers + _WRITE, at),
                (registers + _COUNT, count),
                (registers + _CONTROL_QUIET, control | other << _CHAIN),
            ]
        return words

    @property
    def _sink(self) -> int:
        return self._place(len(self._pins))

    def _place(self, i: int) -> int:
        return self._at + 4 * self._size * i

    def end(self) -> list[tuple[int, int]]:
        """Give all of it back; for each pin how many stamps were kept and how many edges there
        were."""
        if not self._channels:
            return []
        self._put((self._base + _CLEAR, _ALL))
        counts = []
        for keep, drop in self._channels:
            registers = _DMA + keep * _CHANNEL_BYTES, _DMA + drop * _CHANNEL_BYTES
            kept, dropped, state = self._get(
                *(at + _COUNT for at in registers), registers[0] + _CONTROL_QUIET
            )
            counts.append(self._counted(kept, dropped, bool(state & _BUSY)))
        channels = [channel for pair in self._channels for channel in pair]
        self._put(
            *((_DMA + c * _CHANNEL_BYTES + _CONTROL_QUIET, 0) for c in channels),
            (_DMA + _ABORT, sum(1 << c for c in channels)),
        )
        self._channels = []
        self._run(_RELEASE)
        settings = len(_SETTINGS)
        for i in range(BLOCK_MACHINES):
            saved = self._saved[i * settings : (i + 1) * settings]
            shift = saved[_SETTINGS.index(_SHIFTCTRL)]
            self._put(
                *((self._machine(i, k), word) for k, word in zip(_SETTINGS, saved, strict=True)),
                (self._machine(i, _SHIFTCTRL), shift ^ _JOIN_TX),  # a change empties the FIFOs
                (self._machine(i, _SHIFTCTRL), shift),
                (self._machine(i, _INSTR), _JMP | self._origin),
            )
        self._put((self._base + _SET, _RESTART | _CLKDIV_RESTART), (self._base + _SET, _ALL))
        return counts

    def _counted(self, keep: int, drop: int, keeping: bool) -> tuple[int, int]:
        """Stamps kept, and edges, by what the two channels had left to do; keeping: whether it was
        the turn of the first. The counter of a channel that has not begun means nothing."""
        if keeping:
            kept = self._size - keep
            return kept, self._skip + kept
        if self._skip and drop <= self._skip:
            return 0, self._skip - drop  # where nothing was to be kept yet
        return self._size, self._skip + self._size + _COUNT_ONLY - drop

    def read(self, i: int, count: int) -> np.ndarray:
        """The first stamps of the i-th pin."""
        data = b""
        first = self._place(i) - self._store
        for begin in range(0, count, _CHUNK):
            end = min(begin + _CHUNK, count)
            data += b64decode(self._run(_DUMP.format(begin=first + 4 * begin, end=first + 4 * end)))
        return np.frombuffer(data, "<u4")
