"""Runs on MicroPython and on CPython: frames of a smoothed run, each with the heap locked.

A line on standard input: the lower and the upper limit, whether there is play, how many frames of
the upload come before and after, and seventeen positions. The answer is one line: how far beyond
its position the path passes the frame, and the two words of its velocity.
"""

import sys
from array import array

from framestep.motion.reals import put
from framestep.moves.path import path, smoothing

try:
    from micropython import heap_lock, heap_unlock
except ImportError:

    def heap_lock():
        pass

    heap_unlock = heap_lock

SCALE, TOP, TO = 0, 2, 4


def replay(lines):
    """Yield the answers."""
    numbers = array("i", [0] * 8)
    put(numbers, SCALE, 715827883, -33)  # a twelfth
    put(numbers, TOP, 0x10000000, 0)
    window = array("i", [0] * path.SMOOTH_WORDS)
    bounds = array("i", [0, 0, 0])
    for line in lines:
        values = [int(word) for word in line.split()]
        for i in range(3):
            bounds[i] = values[i]
        for i in range(2 * path.BESIDE + 1):
            window[i] = values[5 + i]
        before = values[3]
        after = values[4]
        heap_lock()
        smoothing.velocity(numbers, TO, window, bounds, before, after, SCALE, TOP)
        heap_unlock()
        yield f"{window[path.PART]} {numbers[TO]} {numbers[TO + 1]}"


if __name__ == "__main__":
    for answer in replay(sys.stdin):
        print(answer)
