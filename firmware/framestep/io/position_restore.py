"""Restores positions from the journal. A module of its own, as it is needed only at power-up."""

from framestep.io.position_journal import (
    CHECK,
    FORM,
    LAYOUT,
    LOAD_POSITIONS,
    LOST_ONES,
    MARK,
    NUMBER,
    SLOT_BYTES,
    STEPS,
    checksum,
)
from framestep.motion.reals import copy_word, equal_words
from framestep.motors.backlash import LOAD
from framestep.motors.positions import BEFORE, BROKEN_OFF, HELD, LOST, RESTORED
from framestep.pulse import stepper


def restore(journal):
    """Set the motors' positions from the newest record. Call it before anything moves.

    journal: a PositionJournal. Allocates.
    """
    record = journal.record
    newest = 0
    for block in range(journal.flash.blocks):
        for slot in range(journal.slots):
            journal.flash.read(block, slot * SLOT_BYTES, record)
            checksum(journal.bytes, 4 * CHECK, journal.page, 0)
            if equal_words(record, CHECK, journal.page, 0) and record[FORM] >> 8 == LAYOUT >> 8:
                if record[NUMBER] > newest:
                    newest = record[NUMBER]
                    journal.block = block
                    journal.slot = slot
    if not newest:
        return
    journal.number = newest
    journal.flash.read(journal.block, journal.slot * SLOT_BYTES, record)
    axes = journal.axes
    if record[FORM] != LAYOUT + axes.count:
        return  # the rig had a different number of motors
    moved = record[MARK] != -1
    for motor in range(axes.count):
        axis = axes[motor]
        if not axis.ends[0] <= record[STEPS + motor] <= axis.ends[1]:
            continue  # no pulse of this servo means that position
        copy_word(axis.backlash, LOAD, record, LOAD_POSITIONS + motor)
        copy_word(axis.block, stepper.POSITION, record, STEPS + motor)
        if moved:
            journal.positions.put(motor, LOST, BROKEN_OFF)
        elif (record[LOST_ONES] >> motor) & 1:
            journal.positions.put(motor, LOST, BEFORE)
        else:
            journal.positions.put(motor, HELD, RESTORED)
    journal.positions.saved = not moved
