"""What io/memory.py has kept, given back to the motors. Needed once at power-up, so a module of its own."""

from framestep.io.memory import CHECK, FORM, LAYOUT, LOST_ONES, MARK, NUMBER, PLACES, SLOT_BYTES, STEPS, checksum
from framestep.motion import stepper
from framestep.motion.reals import copy_word, equal_words
from framestep.motors.positions import BEFORE, BROKEN_OFF, HELD, LOST, RESTORED


def restore(memory):
    """Find the newest record and take what it says: to be called before anything moves. Allocates."""
    record = memory.record
    newest = 0
    for block in range(memory.flash.blocks):
        for slot in range(memory.slots):
            memory.flash.read(block, slot * SLOT_BYTES, record)
            checksum(memory.bytes, 4 * CHECK, memory.page, 0)
            if equal_words(record, CHECK, memory.page, 0) and record[FORM] >> 8 == LAYOUT >> 8:
                if record[NUMBER] > newest:
                    newest = record[NUMBER]
                    memory.block = block
                    memory.slot = slot
    if not newest:
        return
    memory.number = newest
    memory.flash.read(memory.block, memory.slot * SLOT_BYTES, record)
    axes = memory.axes
    if record[FORM] != LAYOUT + axes.count:
        return  # of another rig
    moved = record[MARK] != -1
    for motor in range(axes.count):
        axis = axes[motor]
        copy_word(axis.place, 0, record, PLACES + motor)
        copy_word(axis.block, stepper.POSITION, record, STEPS + motor)
        if moved:
            memory.positions.put(motor, LOST, BROKEN_OFF)
        elif record[LOST_ONES] >> motor & 1:
            memory.positions.put(motor, LOST, BEFORE)
        else:
            memory.positions.put(motor, HELD, RESTORED)
    memory.positions.settled = not moved
