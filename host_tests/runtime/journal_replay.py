"""Saved positions on both runtimes: on MicroPython the heap is locked while they are written and
cleared."""

import binascii
from array import array

from framestep.io.position_journal import STILL_MS, PositionJournal
from framestep.io.position_restore import restore
from framestep.motion.reals import copy_word
from framestep.motors.backlash import LOAD, make_backlash
from framestep.motors.positions import Positions
from framestep.pulse import stepper

try:
    from micropython import heap_lock, heap_unlock
except ImportError:

    def heap_lock():
        pass

    heap_unlock = heap_lock

FAR = 2**31 - 1  # no small integer


class Flash:
    """Two blocks of four slots. The test ignores allocations of the flash."""

    blocks = 2
    bytes = 512

    def __init__(self):
        self.content = [bytearray(b"\xff" * 512), bytearray(b"\xff" * 512)]
        self.locked = False

    def lock(self, on):
        self.locked = on
        if on:
            heap_lock()
        else:
            heap_unlock()

    def read(self, block, at, buffer):
        locked = self.locked
        if locked:
            self.lock(False)
        found = array("i", bytes(self.content[block][at : at + 4 * len(buffer)]))
        for i in range(len(buffer)):
            buffer[i] = found[i]
        if locked:
            self.lock(True)

    def program(self, block, at, page):
        self.lock(False)
        for i, byte in enumerate(bytes(page)):
            self.content[block][at + i] &= byte
        self.lock(True)
        return True

    def erase(self, block, page):
        for i in range(512):
            self.content[block][i] = 0xFF
        return True


class Motor:
    def __init__(self):
        self.block = array("i", [0] * stepper.BLOCK_WORDS)
        self.backlash = make_backlash(self.block)


class Motors:
    def __init__(self):
        self.count = 8
        self.positions = Positions(8)
        self.motors = [Motor() for _ in range(8)]

    def __getitem__(self, i):
        return self.motors[i]


def replay(say):
    flash = Flash()
    places = array("i", [0, FAR, -FAR - 1, 5, -5, 2**30, -(2**30), 1])
    for turn in range(11):
        motors = Motors()
        journal = PositionJournal(flash, motors)
        restore(journal)
        say(f"{[motor.backlash[LOAD] for motor in motors.motors]} {bytes(motors.positions.states)}")
        now = 2**30 - 100
        flash.lock(True)
        for i in range(8):
            if i != turn:
                motors.positions.set_known(i)
                copy_word(motors[i].block, stepper.POSITION, places, (i + turn) & 7)
                copy_word(
                    motors[i].backlash, LOAD, places, (i + turn) & 7
                )  # as a motion to that place does
        for _ in range(STILL_MS + 3):
            now = now + 1 if now < 0x3FFFFFFF else 0
            journal.poll(now, False)
        if turn & 1:
            motors.positions.about_to_change()
        flash.lock(False)
        content = binascii.hexlify(bytes(flash.content[0]) + bytes(flash.content[1]))
        say(f"{journal.working} {content.decode()}")
