"""Positions that survive a power cut: a journal of records in flash.

A record has the positions of all motors. It is written once they have been at rest for STILL_MS and
no operation is under way, never in motion. The newest record with a correct checksum counts.

Before anything makes a record untrue (the first motion, RESET_POSITION) its mark is cleared. Flash
can do that without erasing, in half a millisecond, and nothing moves meanwhile. So after a power
cut or any reset the newest record shows the state. If its mark is set, the motors were at rest, and
the positions are HELD. If it is cleared, they moved, and the positions are LOST; the numbers date
from before the motion. A record that a power cut leaves unfinished has a wrong checksum. Then the
record before it counts, whose mark was cleared when the motion began.

Wear. A block takes `slots` records until it is erased, and the blocks take turns. With four blocks
of 30 slots, and flash good for 100 000 erasures, that is 12 million records: 2000 a day for 16
years; half as many on a chip with more than twelve motors. A block is erased (46 ms without
interrupts) when a record is written, never before a motion.

Nothing allocates after construction.
"""

from array import array

from framestep.base.clock import elapsed
from framestep.base.native import const, micropython, ptr8, ptr32
from framestep.motion.reals import copy_word
from framestep.motors.backlash import LOAD
from framestep.motors.positions import LOST
from framestep.pulse import stepper
from framestep.pulse.engine import MOTORS

STILL_MS = const(2000)
_ROOM = const(12 << MOTORS // 13)  # motors in a record: 12, or 24 on chips with more
SLOT_BYTES = const(128 << MOTORS // 13)
PAGE_BYTES = const(256)

# Words of a record
NUMBER = const(0)  # counts up from record to record
FORM = const(1)  # LAYOUT and the number of motors
LOST_ONES = const(2)  # motors whose position was lost, one bit each
LOAD_POSITIONS = const(3)  # positions of the loads
STEPS = const(LOAD_POSITIONS + _ROOM)  # positions of the motors; the difference is the offset
CHECK = const(SLOT_BYTES // 4 - 2)  # CRC-32 of the words before it
MARK = const(SLOT_BYTES // 4 - 1)  # -1 while the record is true
_WORDS = const(SLOT_BYTES // 4)
LAYOUT = const(0x100)
_CRC = const(-306674912)  # 0xEDB88320, the polynomial of CRC-32, reflected


@micropython.viper
def checksum(data: ptr8, count: int, out: ptr32, i: int):
    """out[i] = CRC-32 of the first `count` bytes, as in zlib (a return value would be an object)"""
    crc = -1
    top = 1
    top <<= 30
    top += top - 1  # 2^31 - 1; as a constant it would be an object
    at = 0
    while at < count:
        crc ^= data[at + 0]
        bit = 0
        while bit < 8:
            odd = crc & 1
            crc = (crc >> 1) & top
            if odd:
                crc ^= _CRC
            bit += 1
        at += 1
    out[i + 0] = crc ^ -1


@micropython.viper
def _fill(page: ptr32):
    """Set all bytes to 0xFF, as in erased flash."""
    i = 0
    while i < PAGE_BYTES // 4:
        page[i + 0] = -1
        i += 1


@micropython.viper
def _copy(page: ptr32, at: int, record: ptr32):
    i = 0
    while i < _WORDS:
        page[at + i] = record[i + 0]
        i += 1


@micropython.viper
def _same(page: ptr32, at: int, record: ptr32) -> bool:
    i = 0
    while i < _WORDS:
        if page[at + i] != record[i + 0]:
            return False
        i += 1
    return True


@micropython.viper
def _erased(page: ptr32, at: int) -> bool:
    i = 0
    while i < _WORDS:
        if page[at + i] != -1:
            return False
        i += 1
    return True


class PositionJournal:
    """Keeps the positions of `axes` in a Flash, see hal/contract.py."""

    def __init__(self, flash, axes):
        self.flash = flash
        self.axes = axes
        self.positions = axes.positions
        self.record = array("i", [0] * _WORDS)
        self.bytes = (
            memoryview(self.record).cast("B") if hasattr(memoryview, "cast") else self.record
        )
        self.page = array("i", [0] * (PAGE_BYTES // 4))
        self.slots = flash.bytes // SLOT_BYTES
        self.block = flash.blocks - 1  # block of the newest record
        self.slot = self.slots - 1
        self.number = 0
        self.working = True
        self._still = False
        self._since = 0
        self.positions.journal = self

    # ---------------------------------------------------------------- while it runs

    def invalidate(self):
        """Clear the mark of the newest record, before anything moves."""
        self._still = False
        if self.working:
            _fill(self.page)
            at = self.slot * SLOT_BYTES
            self.page[((at & (PAGE_BYTES - 1)) >> 2) + MARK] = 0
            self.working = self.flash.program(self.block, at & ~(PAGE_BYTES - 1), self.page)

    def poll(self, now, busy):
        """Do one pass: write a record if it is time.

        now: milliseconds modulo 2^29. busy: something moves, or an operation is prepared.
        """
        if self.positions.saved or not self.working:
            return
        if busy or not self._still:
            self._still = not busy
            self._since = now
        elif elapsed(now, self._since) >= STILL_MS:
            self._still = False
            if self._has_known_position():
                self.working = self._write()
                self.positions.saved = self.working

    def _has_known_position(self):
        """Return whether any position is not lost."""
        states = self.positions.states
        for motor in range(self.axes.count):
            if states[motor] != LOST:
                return True
        return False

    def _write(self):
        """Write the motors' positions. Return False if the flash fails."""
        record = self.record
        axes = self.axes
        for i in range(_WORDS):
            record[i] = 0
        self.number += 1
        record[NUMBER] = self.number
        record[FORM] = LAYOUT + axes.count
        for motor in range(axes.count):
            axis = axes[motor]
            axis.backlash.refresh()
            copy_word(record, LOAD_POSITIONS + motor, axis.backlash, LOAD)
            copy_word(record, STEPS + motor, axis.block, stepper.POSITION)
            if self.positions.states[motor] == LOST:
                record[LOST_ONES] |= 1 << motor
        checksum(self.bytes, 4 * CHECK, record, CHECK)
        record[MARK] = -1
        for _ in range(2 * self.slots):  # skips slots that are worn or half written
            if not self._advance():
                return False
            at = self.slot * SLOT_BYTES
            _fill(self.page)
            _copy(self.page, (at & (PAGE_BYTES - 1)) >> 2, record)
            if not self.flash.program(self.block, at & ~(PAGE_BYTES - 1), self.page):
                return False
            self.flash.read(self.block, at & ~(PAGE_BYTES - 1), self.page)
            if _same(self.page, (at & (PAGE_BYTES - 1)) >> 2, record):
                return True
        return False

    def _advance(self):
        """Go to the next free slot. Return False if the flash does not erase."""
        while True:
            self.slot += 1
            if self.slot >= self.slots:
                self.slot = 0
                self.block = (self.block + 1) % self.flash.blocks
                return self.flash.erase(self.block, self.page)
            at = self.slot * SLOT_BYTES
            self.flash.read(self.block, at & ~(PAGE_BYTES - 1), self.page)
            if _erased(self.page, (at & (PAGE_BYTES - 1)) >> 2):
                return True
