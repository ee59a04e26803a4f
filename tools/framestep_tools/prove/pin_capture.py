"""Edges of a board's pins, stamped by the board itself.

State machines watch: unused ones, and those of motors at rest, which wait for a command. Each
watches a pin with a program of eight instructions (stamp_program.py), next to the other programs of
its PIO block. A loop of two cycles counts x down; at an edge x goes to the FIFO, and by DMA to
memory that the uploaded move leaves free. Afterwards the machines get back what they had. All
machines begin in the same cycle, so edges of several pins have one origin of time.

The board keeps running framestep unchanged. Scripts for its REPL are small, because it has about
10 kB: they read and write registers that these modules name.
"""

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from .borrowed_machines import BLOCK_MACHINES, Borrowed, Registry, fits, unused
from .chips import Registers
from .stamp_program import times_ns

_SCRIPT = """
import rp2
from array import array
from binascii import b2a_base64
from machine import mem32
from framestep import boot
from framestep.base.native import addressof
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


@dataclass(frozen=True)
class Edges:
    """Edges of a pin.

    times_ns: times of the kept edges since the start of the capture; level: the pin's level at the
    start; both: whether falling edges were stamped as well; count: number of all edges, kept or
    not.
    """

    times_ns: np.ndarray
    level: int
    both: bool
    count: int

    @property
    def rises_ns(self) -> np.ndarray:
        """Return the times of the kept rising edges."""
        return self.times_ns[self.level :: 2] if self.both else self.times_ns

    @property
    def falls_ns(self) -> np.ndarray:
        """Return the times of the kept falling edges; none if only rising ones were stamped."""
        return self.times_ns[1 - self.level :: 2] if self.both else self.times_ns[:0]


class Instrument:
    """Watches a board's pins. run: runs code on its REPL and returns the output; chip: its
    registers; clock_hz: its processor's clock."""

    def __init__(self, run: Callable[[str], str], chip: Registers, clock_hz: int):
        self._chip, self._hz = chip, clock_hz
        self.begun_us = 0  # start of the last capture, by the board's microsecond counter
        run(_SCRIPT)
        self._registry = Registry(run)

    def now_us(self) -> int:
        """Return the board's microsecond counter, which wraps at 2^32."""
        return self._registry.get(self._chip.microseconds)[0]

    def get(self, addresses: Sequence[int]) -> list[int]:
        """Read registers of the board."""
        return self._registry.get(*addresses)

    def put(self, *pairs: tuple[int, int]) -> None:
        """Write registers of the board, each (address, word), in this order."""
        self._registry.put(*pairs)

    def unused(self) -> frozenset[int]:
        """Return the state machines that nothing has set up since the board's start, numbered from
        0 over all blocks."""
        blocks = range(self._chip.blocks)
        return frozenset().union(*(unused(self._registry, block) for block in blocks))

    def blocks(self) -> list[int]:
        """Return the PIO blocks with room for the watching program."""
        return [block for block in range(self._chip.blocks) if fits(self._registry, block)]

    def capture(
        self,
        machines: Sequence[int],
        pins: Sequence[int],
        during: Callable[[], None],
        both: bool = False,
        skip: int = 0,
        most: int = 1 << 20,
    ) -> list[Edges]:
        """Return the edges of up to four pins while `during` runs.

        machines: one for each pin, all of one PIO block, unused or of motors at rest; both: stamp
        falling edges as well; skip: number of edges of each pin that are only counted at first;
        most: number that is kept of each pin, if the shared memory holds them. Later edges are only
        counted. Raises CannotCapture if the motor of a machine moves, or if the block has no room
        for the program.
        """
        if not 1 <= len(pins) <= min(len(machines), BLOCK_MACHINES):
            raise ValueError(f"one pin for each of {len(machines)} machines, not {len(pins)}")
        if len({machine // BLOCK_MACHINES for machine in machines}) != 1:
            raise ValueError("the machines of one capture must be of one block")
        borrowed = Borrowed(
            self._registry, self._chip, machines[: len(pins)], pins, both, skip, most
        )
        try:
            self.begun_us = borrowed.begin()
            during()
        except BaseException:
            with suppress(Exception):  # the first error says more
                borrowed.end()
            raise
        counts = borrowed.end()
        found = []
        for i, (kept, count) in enumerate(counts):
            stamps = borrowed.read(i, kept)
            times = times_ns(stamps, both, skip, self._hz)
            found.append(Edges(times, borrowed.levels >> pins[i] & 1, both, count))
        return found
