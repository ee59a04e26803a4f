"""Runs on MicroPython and on CPython: light levels and triggers from a script, each step with the heap locked.

Lines on standard input, each answered by one line:

    NEW changes triggers    a new store; no answer
    BEGIN frames            no answer
    frame in hex            an MSG_RT_UPLOAD_MOVE_DMX or _TRIGGERS as it comes down the line: the response code
    FINISH, CLEAR           no answer
    HAS                     channels that have data, whether there are levels, whether there are triggers
    SEEK index              what is set, as channel=level
    PLAY from to            seek to the one, then steps to the other, in either direction; what each frame sets
    TRIGGERS from to        the mask; then frame:values, if there are any, for each of these frames
"""

import sys
from array import array

from framestep.io.lights import MARK, Lights
from framestep.moves.cues import CueStore
from framestep.protocol.frames import FRAME, FrameReader
from framestep.protocol.messages import LAST_SECTION, MSG_RT_UPLOAD_MOVE_DMX

try:
    from micropython import heap_lock, heap_unlock
except ImportError:

    def heap_lock():
        pass

    heap_unlock = heap_lock


class Recorder:
    """Writes down what is set, and lets real lights have it."""

    def __init__(self):
        self.lights = Lights(512, 500)
        self.channels = array("h", [0] * 600)
        self.values = bytearray(600)
        self.count = 0

    def put(self, channel, source, at, count):
        self.lights.put(channel, source, at, count)
        n = self.count
        for i in range(count):
            self.channels[n + i] = channel + i
            self.values[n + i] = source[at + i]
        self.count = n + count

    def put_marked(self, first, last, source, marks):
        n = self.count
        for channel in range(first, last + 1):
            if marks[channel] & MARK:
                self.channels[n] = channel
                self.values[n] = source[channel]
                n += 1
        self.count = n
        self.lights.put_marked(first, last, source, marks)

    def text(self):
        set_ = [f"{self.channels[i]}={self.values[i]}" for i in range(self.count)]
        for i in range(self.count):
            if self.lights.level(self.channels[i]) != self.values[i]:
                set_.append("lost")
        self.count = 0
        return ",".join(set_)


def frame(store, reader, data):
    heap_lock()
    code = -1
    taken = reader.feed(data, 0, len(data))
    if taken == len(data) and reader.poll() == FRAME:
        if reader.type == MSG_RT_UPLOAD_MOVE_DMX:
            last = reader.u16(4) & LAST_SECTION
            code = store.levels(reader.u16(0), reader.start_index(2), last, reader, 6, reader.length - 6)
        else:
            code = store.triggers(reader, 4, (reader.length - 4) >> 3)
    heap_unlock()
    return code


def begin(store, frames):
    heap_lock()
    store.begin(frames)
    heap_unlock()


def finish(store):
    heap_lock()
    store.finish()
    heap_unlock()


def clear(store):
    heap_lock()
    store.clear()
    heap_unlock()


def seek(store, index, lights):
    heap_lock()
    store.seek(index, lights)
    heap_unlock()


def step(store, index, backward, lights):
    heap_lock()
    store.step(index, backward, lights)
    heap_unlock()


def triggers(store, index, words):
    heap_lock()
    store.trigger_mask_to(words, 1)
    store.trigger_values_to(index, words, 2)
    heap_unlock()


def play(store, lights, start, end):
    seek(store, start, lights)
    answer = [lights.text()]
    way = 1 if end >= start else -1
    while start != end:
        start += way
        step(store, start, way < 0, lights)
        answer.append(lights.text())
    return ";".join(answer)


def all_triggers(store, start, end):
    words = array("i", [7, 7, 7, 7])
    answer = ["-"]
    for index in range(start, end + 1):
        triggers(store, index, words)
        answer[0] = str(words[1])
        if words[2]:
            answer.append(f"{index}:{words[2]}")
        if words[0] != 7 or words[3] != 7:
            return "wrong"
    return " ".join(answer)


def replay(lines):
    """The answers, one by one."""
    reader = FrameReader()
    lights = Recorder()
    store = None
    for line in lines:
        what = line.split()
        answer = ""
        if what[0] == "NEW":
            store = CueStore(int(what[1]), int(what[2]))
        elif what[0] == "BEGIN":
            begin(store, int(what[1]))
        elif what[0] == "FINISH":
            finish(store)
        elif what[0] == "CLEAR":
            clear(store)
        elif what[0] == "HAS":
            answer = f"{store.channels} {int(store.has_levels)} {int(store.has_triggers)}"
        elif what[0] == "SEEK":
            seek(store, int(what[1]), lights)
            answer = lights.text()
        elif what[0] == "PLAY":
            answer = play(store, lights, int(what[1]), int(what[2]))
        elif what[0] == "TRIGGERS":
            answer = all_triggers(store, int(what[1]), int(what[2]))
        else:
            answer = str(frame(store, reader, bytes.fromhex(line)))
        yield answer


if __name__ == "__main__":
    for answer in replay(line.strip() for line in sys.stdin):
        print(answer)
