"""Keeps the last frames that came and went, for trace().

A Tracer puts itself between the controller and its reader and writer, so a board without one spends
nothing on tracing. It makes all that it needs at once: in a pass it allocates nothing. While it is
on, passes answer HI, store sections and carry out GO, so that it sees these as well.
"""

from array import array

from framestep.answers import HI_SIZE, TRACED
from framestep.base.copying import copy_bytes
from framestep.base.native import const
from framestep.protocol import messages as m
from framestep.protocol.frames import END, FRAME

ENTRIES = const(40)
BYTES = const(28)  # of a frame: from its type on, so with type and length, and 24 of the payload
_TYPE_AT = const(6)  # in a frame


active = None  # the Tracer, while trace() is on


class Tracer:
    """Each entry is a time, in ms, times two, plus 1 for a frame that was sent; and its bytes."""

    def __init__(self, controller):
        self.count = 0  # frames so far
        self.times = array("i", bytes(4 * ENTRIES))
        self.frames = bytearray(BYTES * ENTRIES)
        self._answers = controller.answers
        self._hi_size = self._answers[HI_SIZE]
        self._answers[HI_SIZE] = 0
        self._answers[TRACED] = 1
        self._reader = reader = controller.reader
        self._writer = writer = controller.writer
        self._poll = reader.poll
        self._end = writer.end
        self._ack = writer.ack
        reader.poll = self._received
        writer.end = self._ended
        writer.ack = self._acknowledged

    def remove(self):
        """End tracing."""
        self._answers[HI_SIZE] = self._hi_size
        self._answers[TRACED] = 0
        reader = self._reader
        writer = self._writer
        reader.poll = writer.end = writer.ack = None  # a deleted entry would keep its value alive
        del reader.poll, writer.end, writer.ack

    def copy(self, number):
        """Return the time and the bytes of a frame, counted from 0; None if a later one has taken
        its place."""
        if self.count - number > ENTRIES:
            return None
        place = number % ENTRIES
        return self.times[place], self.frames[place * BYTES : place * BYTES + BYTES]

    def _received(self):
        found = self._poll()
        if found == FRAME:
            reader = self._reader
            self._note(reader.buffer, reader.head, 0)
        return found

    def _ended(self):
        start = self._writer._state[END]
        done = self._end()
        if done:
            self._note(self._writer._buffer, start, 1)
        return done

    def _acknowledged(self, reader, code, dword_acks):
        done = self._ack(reader, code, dword_acks)
        if done:
            size = m.FRAME_OVERHEAD + (4 if dword_acks else 2)
            self._note(self._writer._buffer, self._writer._state[END] - size, 1)
        return done

    def _note(self, buffer, at, sent):
        """Keep a frame. Questions for status and positions, and their answers, come several times a
        second: they would push out all others."""
        at += _TYPE_AT
        kind = buffer[at] | buffer[at + 1] << 8
        if (
            kind == m.MSG_MOTOR_STATUS
            or kind == m.MSG_MOTOR_GET_POSITION
            or kind == m.MSG_VIRT_GET_POSITION
        ):
            return
        place = self.count % ENTRIES
        self.count += 1
        self.times[place] = self._reader.now << 1 | sent
        size = 4 + (buffer[at + 2] | buffer[at + 3] << 8)
        copy_bytes(self.frames, place * BYTES, buffer, at, min(size, BYTES))
