"""Runs on MicroPython and on CPython: answers every frame of a case, with the heap always
locked.

A case is a line on standard input, `stream in hex, steps`; a step above 0 feeds that many bytes, 0
polls until nothing is left and prints `waiting`, -1 drops an unfinished frame. What the writer has
taken is printed in hex.
"""

import sys
from array import array

from framestep.protocol.frames import FRAME, NOTHING, FrameReader, FrameWriter
from framestep.protocol.messages import ERR_CHECKSUM

try:
    from micropython import heap_lock, heap_unlock
except ImportError:

    def heap_lock():
        pass

    heap_unlock = heap_lock

WAITING = 0x7777


def answer(reader, writer, words):
    """Echo the frame in the reader, field by field."""
    writer.begin(reader.type, reader)
    at = 0
    left = reader.length
    while left >= 4:
        reader.copy_i32_to(at, words, 1)
        writer.put_i32s_from(words, 1, 1)
        at += 4
        left -= 4
    if left >= 2:
        writer.u16(reader.u16(at) if left & 1 else reader.i16(at))
        at += 2
        left -= 2
    if left:
        writer.u8(reader.u8(at))
    return writer.end()


def drain(reader, writer, words):
    while True:
        found = reader.poll()
        if found == NOTHING:
            return True
        if found == FRAME:
            if not answer(reader, writer, words):
                return False
        elif not writer.ack(reader, ERR_CHECKSUM, False):
            return False


def replay(stream, steps, reader, writer, words):
    """Do the steps; False if the reader takes no more bytes or the writer has no room."""
    at = 0
    end = 0
    for step in steps:
        if step > 0:
            end += step
            while at < end:
                taken = reader.feed(stream, at, end - at)
                if taken == 0:
                    if not drain(reader, writer, words):
                        return False
                    taken = reader.feed(stream, at, end - at)
                    if taken == 0:
                        return False
                at += taken
            continue
        if not drain(reader, writer, words):
            return False
        if step < 0:
            reader.drop_partial()
            if not drain(reader, writer, words):
                return False
        else:
            writer.begin(WAITING, None)
            writer.u16(reader.waiting)
            writer.end()
    return drain(reader, writer, words)


def echo(stream, steps, reader, writer, out, words):
    """Write the answer to `out`; return its bytes, or -1 if something went wrong."""
    reader.clear()
    writer.clear()
    heap_lock()
    good = replay(stream, steps, reader, writer, words)
    count = writer.take(out, len(out)) if good else -1
    heap_unlock()
    return count


def main(lines):
    reader = FrameReader()
    writer = FrameWriter(40000)
    out = bytearray(40000)
    words = array("i", (0, 0, 0))
    for line in lines:
        stream, _, steps = line.rstrip("\n").partition(" ")
        steps = [int(step) for step in steps.split()]
        count = echo(bytes.fromhex(stream), steps, reader, writer, out, words)
        # MicroPython's b"".hex() is not a string
        print(bytes(memoryview(out)[:count]).hex() if count > 0 else "stuck" if count < 0 else "")


if __name__ == "__main__":
    main(sys.stdin)
