"""TMC2209 driver chips on one wire, simulated: their answers, their timing, and their faults.

Written from the TMC2209 datasheet's "UART single wire interface" and the maker's register reference
(analogdevicesinc/TMC-API, tmc/ic/TMC2209), not from the firmware's code, so each checks the other.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

BAUD = 115200
SYNC, MASTER, WRITE = 0x05, 0xFF, 0x80
GCONF, GSTAT, IFCNT, NODECONF = 0x00, 0x01, 0x02, 0x03
IHOLD_IRUN, TPOWERDOWN, TPWMTHRS, TCOOLTHRS, VACTUAL, COOLCONF = 0x10, 0x11, 0x13, 0x14, 0x22, 0x42
CHOPCONF, DRV_STATUS, PWMCONF = 0x6C, 0x6F, 0x70
STANDSTILL = 1 << 31  # bit of DRV_STATUS
_READABLE = {GCONF, GSTAT, IFCNT, 0x06, CHOPCONF, DRV_STATUS, PWMCONF}
_AFTER_RESET = {
    GCONF: 0x101,
    NODECONF: 0,
    IHOLD_IRUN: 0x11F00,
    TPOWERDOWN: 20,
    CHOPCONF: 0x10000053,
    PWMCONF: 0xC10D0024,
}
_BIT_NS = 1_000_000_000 / BAUD
_BYTE_NS = 10 * _BIT_NS
_IDLE_BITS = 63  # a telegram that pauses for this long is dropped


def crc8(data: Iterable[int]) -> int:
    """Return the datasheet's CRC: bit by bit, the lowest bit of each byte first, polynomial
    0x07."""
    crc = 0
    for byte in data:
        for i in range(8):
            feedback = crc >> 7 ^ byte >> i & 1
            crc = crc << 1 & 0xFF ^ (0x07 if feedback else 0)
    return crc


@dataclass
class Chip:
    """One driver. `writes`: all registers written since power-up, in order: (register, value)."""

    address: int
    powered: bool = True
    registers: dict[int, int] = field(default_factory=dict)
    writes: list[tuple[int, int]] = field(default_factory=list)
    count: int = 0  # IFCNT
    gstat: int = 1
    status: int = STANDSTILL
    damaged: int = 0  # telegrams with a wrong CRC

    def __post_init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Cut the supply and restore it."""
        self.registers = dict(_AFTER_RESET)
        self.writes = []
        self.count = 0
        self.gstat = 1

    def take(self, telegram: bytes) -> tuple[bytes, float]:
        """Receive a telegram. Return the answer, b"" for none, and the pause before it in ns."""
        if not self.powered or telegram[0] & 0x0F != SYNC or telegram[1] != self.address:
            return b"", 0
        if crc8(telegram[:-1]) != telegram[-1]:
            self.damaged += 1
            return b"", 0
        register = telegram[2] & 0x7F
        if telegram[2] & WRITE:
            value = int.from_bytes(telegram[3:7], "big")
            self.writes.append((register, value))
            self.count = self.count + 1 & 0xFF
            if register == GSTAT:
                self.gstat &= ~value
            else:
                self.registers[register] = value
            return b"", 0
        if register not in _READABLE:
            return b"", 0
        now = {GSTAT: self.gstat, IFCNT: self.count, DRV_STATUS: self.status}
        value = now.get(register, self.registers.get(register, 0))
        head = bytes([SYNC, MASTER, register]) + value.to_bytes(4, "big")
        delay = 8 * (self.registers[NODECONF] >> 8 & 0xF | 1)  # 0, 1: 8 bit times; 2, 3: 24 …
        return head + bytes([crc8(head)]), delay * _BIT_NS

    # ---- settings, in the datasheet's terms

    @property
    def bridges_on(self) -> bool:
        """Whether the chip would drive the motor if it were enabled."""
        return self.registers[CHOPCONF] & 0xF != 0

    @property
    def microsteps(self) -> int:
        """Steps for a full step."""
        return 256 >> (self.registers[CHOPCONF] >> 24 & 0xF)

    def run_ma(self, sense_mohm: float = 110) -> float:
        """Return the run current in mA, root mean square."""
        full_scale = 180 if self.registers[CHOPCONF] >> 17 & 1 else 320
        irun = self.registers[IHOLD_IRUN] >> 8 & 0x1F
        return (irun + 1) / 32 * full_scale / (sense_mohm + 20) / 2**0.5 * 1000


def of(board: Mapping[str, Any]) -> list[Chip]:
    """Return a chip for each address in a board's data, for motors 1, 2, … board: data from
    framestep.rig.pins.fitted."""
    return [Chip(address) for address in board.get("drivers", {}).get("address", [])]


class Chips:
    """A wire with drivers, with the interface of framestep.hal's `wire`. Bytes take their time.

    clock: nanoseconds; spoil(direction, data) -> data: may change or drop telegrams ("to") and
    answers ("from"); echo: sent bytes come back; apart: each chip has its own wire, in the order of
    the motors.
    """

    def __init__(
        self,
        chips: Iterable[Chip],
        clock: Callable[[], float],
        echo: bool = True,
        apart: bool = False,
    ):
        self.chips = list(chips)
        self.apart = apart
        self.chosen = 0
        self.clock = clock
        self.echo = echo
        self.spoil: Callable[[str, bytes], bytes] = lambda direction, data: data
        self.telegrams: list[tuple[float, bytes]] = []  # (time of the first bit, bytes)
        self._partial = bytearray()
        self._last_ns = 0.0  # end of the last byte on the wire
        self._arrived: list[tuple[float, int]] = []  # (time of arrival, byte)

    # ---- the board's end

    def select(self, motor: int) -> None:
        """See framestep.hal."""
        self.chosen = motor

    def send(self, buffer: bytes, count: int) -> None:
        """See framestep.hal."""
        now = self.clock()
        start = max(now, self._last_ns)
        if self._arrived and self._arrived[-1][0] > now:
            raise AssertionError("the board talks into an answer")
        for i in range(count):
            self.byte(buffer[i], start + i * _BYTE_NS)

    def receive(self, buffer: bytearray, at: int, limit: int) -> int:
        """See framestep.hal."""
        now, count = self.clock(), 0
        while self._arrived and self._arrived[0][0] <= now and count < limit:
            buffer[at + count] = self._arrived.pop(0)[1]
            count += 1
        return count

    # ---- the wire

    def byte(self, value: int, start_ns: float) -> None:
        """Receive a byte from the board whose first bit came at this moment."""
        if start_ns - self._last_ns > _IDLE_BITS * _BIT_NS:
            self._partial.clear()
        if not self._partial:
            self.telegrams.append((start_ns, b""))
        self._last_ns = end = start_ns + _BYTE_NS
        self._partial.append(value)
        at, sent = self.telegrams[-1]
        self.telegrams[-1] = (at, sent + bytes([value]))
        if self.echo:
            self._arrived.append((end, value))
        if len(self._partial) < 4 or len(self._partial) < (8 if self._partial[2] & WRITE else 4):
            return
        telegram = self.spoil("to", bytes(self._partial))
        self._partial.clear()
        if len(telegram) not in (4, 8):
            return
        for chip in self.chips[self.chosen : self.chosen + 1] if self.apart else self.chips:
            answer, delay = chip.take(telegram)
            if answer:
                self._answer(self.spoil("from", answer), end + delay)

    def _answer(self, data: bytes, start: float) -> None:
        for value in data:
            start += _BYTE_NS
            self._arrived.append((start, value))
            self._last_ns = start

    def take_answers(self) -> bytes:
        """Return all bytes on their way to the board, for a board with its own time."""
        data = bytes(value for _, value in self._arrived)
        self._arrived.clear()
        return data
