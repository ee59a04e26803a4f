# Runs on the board: a main loop that answers every frame with itself, on either protocol port.
import time

import micropython

from framestep.protocol.frames import DAMAGED, FRAME, FrameReader


class Echo:
    """Reader and writer of the port. `damaged` counts bad frames, `frames` good ones; above `limit`
    the reader takes no more bytes."""

    def __init__(self, size=4096):
        self.reader = FrameReader()
        self.out = bytearray(size)
        self.view = memoryview(self.out)
        self.fill = 0
        self.frames = self.damaged = 0
        self.turns = self.longest_us = 0

    @property
    def waiting(self):
        return self.reader.waiting

    def feed(self, buffer, start, count):
        return self.reader.feed(buffer, start, count) if self.fill < 2000 else 0

    def answer(self):
        reader = self.reader
        while True:
            found = reader.poll()
            if found == FRAME:
                self.frames += 1
                size = reader.length + 12
                if self.fill + size <= len(self.out):
                    self.view[self.fill : self.fill + size] = memoryview(reader.buffer)[
                        reader.head : reader.head + size
                    ]
                    self.fill += size
            elif found == DAMAGED:
                self.damaged += 1
            else:
                break

    def take(self, to, limit):
        count = min(self.fill, limit)
        if count:
            to[:count] = self.view[:count]
            self.view[: self.fill - count] = self.out[count : self.fill]
            self.fill -= count
        return count

    def turn(self, port):
        begun = time.ticks_us()
        port.poll(self)
        self.answer()
        port.send(self)
        self.longest_us = max(self.longest_us, time.ticks_diff(time.ticks_us(), begun))
        self.turns += 1


class Count:
    """A reader that only counts, and a writer of `left` zeros."""

    waiting = 0

    def __init__(self):
        self.total = self.left = self.refuse = 0

    def feed(self, buffer, start, count):
        if self.refuse:
            return 0
        self.total += count
        return count

    def take(self, to, limit):
        count = self.left if self.left < limit else limit
        self.left -= count
        return count


def loop(port, echo):
    while True:
        echo.turn(port)


def exchange(port, echo, count, frames):
    """Take `frames` frames, and send 70 bytes for each, with the heap locked."""
    reader = echo.reader
    print("go")
    micropython.heap_lock()
    try:
        while frames:
            port.poll(reader)
            if reader.poll() == FRAME:
                frames -= 1
                count.left += 70
            port.send(count)
        while count.left:
            port.send(count)
    finally:
        micropython.heap_unlock()
