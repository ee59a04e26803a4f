"""Edges of a board's pins, stamped by the board itself.

State machines watch: those of motors that stand, as these wait for a command, and those that nobody
uses. Each watches a pin with a program of eight instructions (watching.py), for which a place is
taken beside what else a PIO block runs: a loop of two cycles counts x down, and at an edge x goes
to the FIFO, from where DMA takes it to memory that the uploaded move leaves free. Then the machines
get back what they had, and never know. All of them begin in the same cycle, so edges of several
pins have one origin of time.

The board keeps running framestep as it is. What is sent to its REPL is small, as there are about
10 kB for it: it reads and writes registers that these modules name.
"""

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from ..errors import ToolError
from .borrowed import BLOCK_MACHINES, Borrowed, Registry, fits, unused
from .chips import Registers
from .watching import times_ns

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


class Instrument:
    """run: runs code on the board's REPL and gives what it printed; chip: its registers; clock_hz:
    of its processor."""

    def __init__(self, run: Callable[[str], str], chip: Registers, clock_hz: int):
        self._chip, self._hz = chip, clock_hz
        self.begun_us = 0  # when the last capture began, by the board's counter of microseconds
        run(_SCRIPT)
        self._registry = Registry(run)

    def now_us(self) -> int:
        """The board's counter of microseconds, which wraps at 2^32."""
        return self._registry.get(self._chip.microseconds)[0]

    def get(self, addresses: Sequence[int]) -> list[int]:
        """What registers of the board hold."""
        return self._registry.get(*addresses)

    def put(self, *pairs: tuple[int, int]) -> None:
        """Write registers of the board: (address, word), in this order."""
        self._registry.put(*pairs)

    def unused(self) -> frozenset[int]:
        """The state machines that nothing has set up since the board's start, numbered from 0 over
        all blocks."""
        blocks = range(self._chip.blocks)
        return frozenset().union(*(unused(self._registry, block) for block in blocks))

    def blocks(self) -> list[int]:
        """The PIO blocks that have room for the program that watches."""
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
        """The edges of up to four pins while `during` runs, stamped by as many of these state
        machines of one PIO block: unused ones, or those of motors that stand meanwhile.

        both: falling edges as well; skip: so many edges of each pin are only counted before the
        first that is kept; most: so many are kept of each, or as many as the memory that the pins
        share out holds. Later ones are only counted.
        CannotCapture if the motor of a machine moves or the block has no room for the program.
        """
        if not 1 <= len(pins) <= min(len(machines), BLOCK_MACHINES):
            raise ValueError(f"one pin for each of {len(machines)} machines, not {len(pins)}")
        if len({machine // BLOCK_MACHINES for machine in machines}) != 1:
            raise ValueError("the machines of one capture are those of one block")
        borrowed = Borrowed(
            self._registry, self._chip, machines[: len(pins)], pins, both, skip, most
        )
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
