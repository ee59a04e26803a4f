"""Runs on MicroPython: counts wrong check bytes, with the heap locked."""

from micropython import heap_lock, heap_unlock

from framestep.protocol.checksum import check_bytes


def wrong():
    count = 0
    for f1 in range(255):
        for f0 in range(255):
            c0 = 0xFF - (f0 + f1) % 0xFF
            c1 = 0xFF - (f0 + c0) % 0xFF
            if check_bytes(f1 << 8 | f0) != c0 | c1 << 8:
                count += 1
    return count


count = 0
heap_lock()
count = wrong()
heap_unlock()
print(count)
