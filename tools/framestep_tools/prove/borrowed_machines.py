"""State machines, DMA channels and memory of a board, borrowed for one capture and given back.

Addresses and bits: RP2040 datasheet 2.3.1.7 (pins), 2.5.7 (DMA), 3.7 (PIO); the RP2350 has the same
except for what chips.py names.
"""

import ast
from base64 import b64decode
from collections.abc import Callable, Sequence

import numpy as np

from ..errors import ToolError
from .chips import Registers
from .stamp_program import HIGH, LENGTH, LOW, program

BLOCK_MACHINES = 4

_PIO = (0x50200000, 0x50300000, 0x50400000)
_SET, _CLEAR = 0x2000, 0x3000  # aliases of registers that set or clear bits
_RXF, _MACHINE, _MACHINE_BYTES = 0x20, 0xC8, 0x18
_CLKDIV, _EXECCTRL, _SHIFTCTRL, _ADDR, _INSTR, _PINCTRL = 0, 4, 8, 12, 16, 20
_SETTINGS = (_CLKDIV, _EXECCTRL, _SHIFTCTRL, _PINCTRL)
_RESET = [1 << 16, 0x1F000, 0xC0000, 5 << 26]  # values in a machine that nothing has set up
_RESTART, _CLKDIV_RESTART = 4, 8  # first bits of the machines' fields
_WHOLE_CLOCK = 1 << 16
_JOIN_TX, _JOIN_RX = 1 << 30, 1 << 31
_JMP, _X_ONES, _PULL = 0x0000, 0xA02B, 0x80A0

_DMA, _CHANNEL_BYTES = 0x50000000, 0x40
_READ, _WRITE, _COUNT, _CONTROL_QUIET = 0x0, 0x4, 0x8, 0x10
_ENABLED, _WORDS = 1, 2 << 2
_LEVELS = 0xD0000004

_CHUNK = 128  # stamps in one read: the board has little memory
# Half words of the store's regions and units, see moves/upload/chunks.py
_ROOM = (
    "w = words()\nprint(addressof(store()), 2 * w[{BOTTOM}], 2 * (w[{SIZE}] - {UNIT} * w[{USED}]))"
)
_CLAIM = "prove_dma = [rp2.DMA() for _ in range({count})]\nprint([d.channel for d in prove_dma])"
_RELEASE = "for d in prove_dma: d.close()\nprove_dma = None"
_DUMP = "print(b2a_base64(memoryview(store())[{begin}:{end}]).decode(), end='')"
# A program is a list; only its instructions differ from the motors' program
_LOAD = """
from framestep.hal.rp2.pulses import step_pulses
prove_code = list(step_pulses)
prove_code[0] = array("H", {words})
try:
    rp2.PIO({block}).add_program(prove_code)
    print(prove_code[1 + {block}])
except OSError:
    prove_code = None
    print(-1)
"""
_UNLOAD = "rp2.PIO({block}).remove_program(prove_code)\nprove_code = None"


class CannotCapture(ToolError):
    """The board's state machines cannot be borrowed. The text says why."""


class Registry:
    """A board's registers, through its REPL. run: runs code there and returns its output."""

    def __init__(self, run: Callable[[str], str]):
        self.run = run

    def put(self, *pairs: tuple[int, int]) -> None:
        """Write words, each (address, word), in this order."""
        for i in range(0, len(pairs), 8):
            words = ",".join(f"{address},{value}" for address, value in pairs[i : i + 8])
            self.run(f"put({words})")

    def get(self, *addresses: int) -> list[int]:
        """Read words."""
        return ast.literal_eval(self.run(f"get({','.join(map(str, addresses))})"))


def unused(registers: Registry, block: int) -> set[int]:
    """Return the state machines of a block that nothing has set up."""
    enabled = registers.get(_PIO[block])[0]
    found = set()
    for i in range(BLOCK_MACHINES):
        at = _PIO[block] + _MACHINE + i * _MACHINE_BYTES
        if registers.get(*(at + k for k in _SETTINGS)) == _RESET and not enabled >> i & 1:
            found.add(BLOCK_MACHINES * block + i)
    return found


def fits(registers: Registry, block: int) -> bool:
    """Return whether a block has room for the watching program."""
    if _load(registers, block, False) < 0:
        return False
    registers.run(_UNLOAD.format(block=block))
    return True


def _load(registers: Registry, block: int, both: bool) -> int:
    return int(registers.run(_LOAD.format(words=program(0, both), block=block)))


class Borrowed:
    """One capture. machines: one of the same block for each pin; see Instrument.capture for the
    others."""

    def __init__(
        self,
        registers: Registry,
        chip: Registers,
        machines: Sequence[int],
        pins: Sequence[int],
        both: bool,
        skip: int,
        most: int,
    ):
        self._run, self._put, self._get = registers.run, registers.put, registers.get
        self._registers, self._chip = registers, chip
        self._block = machines[0] // BLOCK_MACHINES
        self._base = _PIO[self._block]
        self._machines = [machine % BLOCK_MACHINES for machine in machines]
        self._bits = sum(1 << i for i in self._machines)
        self._pins, self._both, self._skip, self._most = pins, both, skip, most
        self._channels: list[tuple[int, int]] = []
        self._origin = -1
        self.levels = 0

    def _machine(self, i: int, register: int) -> int:
        return self._base + _MACHINE + i * _MACHINE_BYTES + register

    def begin(self) -> int:
        """Borrow everything and start it. Return the board's microsecond of the start."""
        self._measure_room()
        self._save()
        self._origin = _load(self._registers, self._block, self._both)
        if self._origin < 0:
            raise CannotCapture(
                f"PIO block {self._block} has no room for the eight instructions that watch"
            )
        channels = ast.literal_eval(self._run(_CLAIM.format(count=2 * len(self._pins))))
        self._channels = list(zip(channels[::2], channels[1::2], strict=True))
        self.levels = self._get(_LEVELS)[0]
        self._put((self._base + _CLEAR, self._bits))
        for i in range(len(self._pins)):
            self._put(*self._machine_words(i), *self._channel_words(i))
        first = sum(1 << (drop if self._skip else keep) for keep, drop in self._channels)
        self._put(
            (_DMA + self._chip.trigger, first),
            # for their next start, when all wanted stamps have been kept
            *((_DMA + d * _CHANNEL_BYTES + _COUNT, self._chip.count) for _, d in self._channels),
        )
        start = f"put({self._base + _SET},{self._bits})"
        return ast.literal_eval(self._run(f"{start};get({self._chip.microseconds})"))[0]

    def _measure_room(self) -> None:
        from framestep.moves.upload import chunks

        names = {name: getattr(chunks, name) for name in ("BOTTOM", "SIZE", "UNIT", "USED")}
        self._store, begin, end = map(int, self._run(_ROOM.format(**names)).split())
        self._at = -(-(self._store + begin) // 4) * 4
        room = (self._store + end - self._at) // 4 - 1
        self._size = min(self._most, room // len(self._pins))

    def _save(self) -> None:
        self._enabled = self._get(self._base)[0] & self._bits
        self._saved = {}
        for i in self._machines:
            *settings, at, word = self._get(
                *(self._machine(i, k) for k in (*_SETTINGS, _ADDR, _INSTR))
            )
            if self._enabled >> i & 1 and word != _PULL:
                raise CannotCapture(
                    "the state machines that would watch belong to moving motors: stop all motors"
                )
            self._saved[i] = settings, at

    def _machine_words(self, i: int) -> list[tuple[int, int]]:
        pin, machine = self._pins[i], self._machines[i]
        start = self._origin + (HIGH if self.levels >> pin & 1 else LOW)
        wraps = (self._origin + LENGTH - 1) << 12 | (self._origin + LOW) << 7
        return [
            (self._machine(machine, _CLKDIV), _WHOLE_CLOCK),
            (self._machine(machine, _EXECCTRL), pin << 24 | wraps),
            (self._machine(machine, _PINCTRL), 0),
            (self._machine(machine, _SHIFTCTRL), _JOIN_RX),
            (self._machine(machine, _INSTR), _X_ONES),
            (self._machine(machine, _INSTR), _JMP | start),
        ]

    def _channel_words(self, i: int) -> list[tuple[int, int]]:
        keep, drop = self._channels[i]
        chip, machine = self._chip, self._machines[i]
        request = 8 * self._block + 4 + machine
        common = _ENABLED | _WORDS | chip.silent | request << chip.request
        words = []
        for channel, other, at, count, control in (
            (keep, drop, self._place(i), self._size, common | chip.increment),
            (drop, keep, self._sink, self._skip or chip.count, common),
        ):
            registers = _DMA + channel * _CHANNEL_BYTES
            words += [
                (registers + _READ, self._base + _RXF + 4 * machine),
                (registers + _WRITE, at),
                (registers + _COUNT, count),
                (registers + _CONTROL_QUIET, control | other << chip.chain),
            ]
        return words

    @property
    def _sink(self) -> int:
        return self._place(len(self._pins))

    def _place(self, i: int) -> int:
        return self._at + 4 * self._size * i

    def end(self) -> list[tuple[int, int]]:
        """Give everything back. Return for each pin the number of kept stamps and of edges."""
        if self._origin < 0:
            return []
        counts = []
        if self._channels:
            self._put((self._base + _CLEAR, self._bits))
            counts = [self._count(keep, drop) for keep, drop in self._channels]
            self._stop_channels()
            self._give_back()
        self._run(_UNLOAD.format(block=self._block))
        self._origin = -1
        return counts

    def _stop_channels(self) -> None:
        channels = [channel for pair in self._channels for channel in pair]
        self._put(
            # chained to itself means to none
            *(
                (_DMA + c * _CHANNEL_BYTES + _CONTROL_QUIET, c << self._chip.chain)
                for c in channels
            ),
            (_DMA + self._chip.abort, sum(1 << c for c in channels)),
        )
        self._channels = []
        self._run(_RELEASE)

    def _give_back(self) -> None:
        for i, (settings, at) in self._saved.items():
            shift = settings[_SETTINGS.index(_SHIFTCTRL)]
            self._put(
                *((self._machine(i, k), word) for k, word in zip(_SETTINGS, settings, strict=True)),
                (
                    self._machine(i, _SHIFTCTRL),
                    shift ^ _JOIN_TX,
                ),  # changing this bit empties the FIFOs
                (self._machine(i, _SHIFTCTRL), shift),
                (self._machine(i, _INSTR), _JMP | at),
            )
        restart = self._bits << _RESTART | self._bits << _CLKDIV_RESTART
        self._put((self._base + _SET, restart), (self._base + _SET, self._enabled))

    def _count(self, keep: int, drop: int) -> tuple[int, int]:
        """Return the numbers of kept stamps and of edges, from the counters of the two channels.
        The counter of a channel that has not begun means nothing."""
        registers = _DMA + keep * _CHANNEL_BYTES, _DMA + drop * _CHANNEL_BYTES
        left, dropped, state = self._get(
            *(at + _COUNT for at in registers), registers[0] + _CONTROL_QUIET
        )
        if state & self._chip.busy:
            kept = self._size - left
            return kept, self._skip + kept
        if self._skip and dropped <= self._skip:
            return 0, self._skip - dropped  # nothing had to be kept yet
        return self._size, self._skip + self._size + self._chip.count - dropped

    def read(self, i: int, count: int) -> np.ndarray:
        """Read the first stamps of the i-th pin."""
        data = b""
        first = self._place(i) - self._store
        for begin in range(0, count, _CHUNK):
            end = min(begin + _CHUNK, count)
            data += b64decode(self._run(_DUMP.format(begin=first + 4 * begin, end=first + 4 * end)))
        return np.frombuffer(data, "<u4")
