"""Runs on MicroPython: counts wrong copies from and to any place in a word, with the heap
locked."""

from micropython import heap_lock, heap_unlock

from framestep.base.copying import copy_bytes

source = bytes((i * 73 + 5) & 0xFF for i in range(64))
target = bytearray(64)
wrong = 0


def copy(to, to_at, source, at, count):
    heap_lock()
    copy_bytes(to, to_at, source, at, count)
    heap_unlock()


for at in range(8):
    for to_at in range(8):
        for count in range(48):
            for i in range(64):
                target[i] = 0xA5
            copy(target, to_at, source, at, count)
            rest = b"\xa5" * (64 - to_at - count)
            if target != b"\xa5" * to_at + source[at : at + count] + rest:
                wrong += 1
            both = bytearray(source)  # towards the front of one buffer
            copy(both, at, both, at + to_at, count)
            if both[at : at + count] != source[at + to_at : at + to_at + count]:
                wrong += 1
            if both[:at] != source[:at] or both[at + count :] != source[at + count :]:
                wrong += 1
print(wrong)
