"""Runs on MicroPython and on CPython: an upload from a script, each step with the heap locked.

Lines on standard input, each answered by one line:

    NEW motors bytes        a new store: its capacity in frames, or the text of its refusal
    BEGIN start end         the response code, as for the next two
    frame in hex            an MSG_RT_UPLOAD_MOVE_AXIS as received
    FINISH
    CLEAR                   nothing
    READ before after       for each motor its positions, from `before` frames before the range to
                            `after` frames after it
    ONE motor index         a single position
"""

import sys
from array import array

from framestep.moves.upload.store import READY, UploadStore
from framestep.protocol.frames import FRAME, FrameReader
from framestep.protocol.messages import LAST_SECTION

try:
    from micropython import heap_lock, heap_unlock
except ImportError:

    def heap_lock():
        pass

    heap_unlock = heap_lock


def section(store, reader, data):
    heap_lock()
    code = -1
    taken = reader.feed(data, 0, len(data))
    if taken == len(data) and reader.poll() == FRAME:
        index = reader.start_index(1)
        last = reader.u16(3) & LAST_SECTION
        count = (reader.length - 5) >> 2
        code = store.section(
            reader.u8(0) - 1, index, last, reader.buffer, reader.payload + 5, count
        )
    heap_unlock()
    return code


def begin(store, start, end):
    heap_lock()
    code = store.begin(start, end)
    heap_unlock()
    return code


def finish(store):
    heap_lock()
    code = store.finish()
    heap_unlock()
    return code


def read(store, motor, first, count, words, k):
    heap_lock()
    found = store.positions(motor, first, count, words, k)
    heap_unlock()
    return found


def one(store, motor, index, words):
    heap_lock()
    found = store.position(motor, index, words, 1)
    heap_unlock()
    return found


def positions(store, motor, first, count):
    """Return positions as text, read in pieces of several sizes."""
    words = array("i", [7] * 67)
    values = []
    size = 1
    while count > 0:
        piece = min(size, count)
        if not read(store, motor, first, piece, words, 1) or words[0] != 7 or words[piece + 1] != 7:
            return "wrong"
        values += list(words)[1 : piece + 1]
        for i in range(1, piece + 1):
            words[i] = 7
        first += piece
        count -= piece
        size = size * 3 % 65 + 1
    return ",".join(map(str, values))


def replay(lines):
    """Yield the answers."""
    reader = FrameReader()
    words = array("i", [0, 0])
    store = None
    for line in lines:
        what = line.split()
        if what[0] == "NEW":
            try:
                store = UploadStore(int(what[1]), int(what[2]))
                yield str(store.capacity_frames(store.motors))
            except ValueError as refusal:
                yield str(refusal)
        elif what[0] == "BEGIN":
            yield str(begin(store, int(what[1]), int(what[2])))
        elif what[0] == "FINISH":
            yield str(finish(store))
        elif what[0] == "CLEAR":
            store.clear()
            yield ""
        elif what[0] == "READ":
            first = -int(what[1])
            count = store.end - store.start + 1 - first + int(what[2])
            answer = []
            for motor in range(store.motors):
                if store.state == READY and store.has(motor):
                    answer.append(positions(store, motor, first, count))
                else:
                    answer.append("wrong" if read(store, motor, 0, 1, words, 0) else "-")
            yield " ".join(answer)
        elif what[0] == "ONE":
            yield str(words[1]) if one(store, int(what[1]), int(what[2]), words) else "-"
        else:
            yield str(section(store, reader, bytes.fromhex(line)))


if __name__ == "__main__":
    for answer in replay(line.strip() for line in sys.stdin):
        print(answer)
