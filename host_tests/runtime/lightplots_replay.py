"""Runs on MicroPython and on CPython: light levels and triggers from a script, each step with the
heap locked.

Lines on standard input, each answered by one line:

    NEW bytes               new stores that share that much memory; no answer
    BEGIN frames            no answer
    frame in hex            an MSG_RT_UPLOAD_MOVE_DMX or _TRIGGERS as received: the
                            response code
    FINISH, CLEAR           no answer
    HAS                     channels with data, whether there are levels, whether there are
                            triggers
    SEEK index              the levels set, as channel=level
    PLAY from to            seek to the first, then step to the other, in any direction; what each
                            frame sets
    FREE                    free units of memory
    TRIGGERS from to        the mask; then frame:values for each of these frames that has some
"""

import sys
from array import array

from framestep.io.lights import MARK, Lights
from framestep.moves.upload.chunks import room
from framestep.moves.upload.light_levels import LightLevels
from framestep.moves.upload.store import UploadStore
from framestep.moves.upload.triggers import Triggers
from framestep.protocol.frames import FRAME, FrameReader
from framestep.protocol.messages import LAST_SECTION, MSG_RT_UPLOAD_MOVE_DMX

try:
    from micropython import heap_lock, heap_unlock
except ImportError:

    def heap_lock():
        pass

    heap_unlock = heap_lock


class Recorder:
    """Records the levels, and passes them on to real lights."""

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


def frame(levels, triggers, reader, data):
    mask = array("i", [0])
    heap_lock()
    code = -1
    taken = reader.feed(data, 0, len(data))
    if taken == len(data) and reader.poll() == FRAME:
        if reader.type == MSG_RT_UPLOAD_MOVE_DMX:
            last = reader.u16(4) & LAST_SECTION
            at = reader.payload + 6
            code = levels.store(
                reader.u16(0), reader.start_index(2), last, reader.buffer, at, reader.length - 6
            )
        else:
            reader.copy_i32_to(0, mask, 0)
            code = triggers.store(mask, reader.buffer, reader.payload + 4, (reader.length - 4) >> 3)
    heap_unlock()
    return code


def begin(store, levels, triggers, frames):
    heap_lock()
    store.clear()
    levels.begin(frames)
    triggers.begin(frames)
    heap_unlock()


def finish(levels, triggers):
    heap_lock()
    levels.finish()
    triggers.finish()
    heap_unlock()


def clear(store, levels, triggers):
    heap_lock()
    store.clear()
    levels.clear()
    triggers.clear()
    heap_unlock()


def seek(levels, index, lights):
    heap_lock()
    levels.seek(index, lights)
    heap_unlock()


def step(levels, index, lights):
    heap_lock()
    levels.step(index, lights)
    heap_unlock()


def read(triggers, index, words):
    heap_lock()
    triggers.mask_to(words, 1)
    triggers.values_to(index, words, 2)
    heap_unlock()


def play(levels, lights, start, end):
    seek(levels, start, lights)
    answer = [lights.text()]
    way = 1 if end >= start else -1
    while start != end:
        start += way
        step(levels, start, lights)
        answer.append(lights.text())
    return ";".join(answer)


def all_triggers(triggers, start, end):
    words = array("i", [7, 7, 7, 7])
    answer = ["-"]
    for index in range(start, end + 1):
        read(triggers, index, words)
        answer[0] = str(words[1])
        if words[2]:
            answer.append(f"{index}:{words[2]}")
        if words[0] != 7 or words[3] != 7:
            return "wrong"
    return " ".join(answer)


def replay(lines):
    """Yield the answers."""
    reader = FrameReader()
    lights = Recorder()
    store = levels = triggers = None
    for line in lines:
        what = line.split()
        answer = ""
        if what[0] == "NEW":
            store = UploadStore(1, int(what[1]))
            levels = LightLevels(store)
            triggers = Triggers(store)
        elif what[0] == "BEGIN":
            begin(store, levels, triggers, int(what[1]))
        elif what[0] == "FINISH":
            finish(levels, triggers)
        elif what[0] == "CLEAR":
            clear(store, levels, triggers)
        elif what[0] == "HAS":
            answer = f"{levels.channels} {int(levels.ready)} {int(triggers.ready)}"
        elif what[0] == "FREE":
            answer = str(room(store.words))
        elif what[0] == "SEEK":
            seek(levels, int(what[1]), lights)
            answer = lights.text()
        elif what[0] == "PLAY":
            answer = play(levels, lights, int(what[1]), int(what[2]))
        elif what[0] == "TRIGGERS":
            answer = all_triggers(triggers, int(what[1]), int(what[2]))
        else:
            answer = str(frame(levels, triggers, reader, bytes.fromhex(line)))
        yield answer


if __name__ == "__main__":
    for answer in replay(line.strip() for line in sys.stdin):
        print(answer)
