"""Runs on MicroPython: checksums of pieces of the bytes on standard input, with the heap locked."""

import sys

from micropython import heap_lock, heap_unlock

from framestep.protocol.checksum import fletcher16

data = bytes.fromhex(sys.stdin.readline().strip())


def sums(start, count):
    heap_lock()
    try:
        return fletcher16(data, start, count)
    finally:
        heap_unlock()


for start in range(9):
    for count in list(range(70)) + [255, 256, 257, 271, 272, 511, 512, 513, 1030, 1045, 1046]:
        print(sums(start, count))
