"""Plays recordings (host_tests/recording.py) on 32-bit MicroPython, with the heap locked in every
tick and every pass.

    micropython recording_replay.py TICKS MILLISECONDS FILE...
                                    (multiples of 2048, the LED's time)

The output is what the recorder wrote down of each controller. TICKS and MILLISECONDS are the values
of the counters at the start, so that they wrap on the way; the output must not depend on them.
"""

import binascii
import gc
import io
import json
import sys
from array import array

import micropython

from framestep.base.clock import WRAP
from framestep.base.copying import copy_bytes
from framestep.base.native import addressof
from framestep.controller import Controller
from framestep.hal import CHANGED, QUESTION
from framestep.hal.absent import NoDmx
from framestep.pulse import stepper
from framestep.pulse.kernel import StepKernel
from framestep.rig import Rig

CYCLES = 125000
LOG = 512
DEEP = 40  # calls: more than any pass has
PIECE = 5 << 16  # bytes; the longest line has INCOMING ones
LINE_FEED = 10
ZEROS = bytes(4096)
INCOMING = 1 << 17
OUTGOING = 1 << 16
OUTPUT, ENABLE, LED, CHOOSE = "oelc"  # notes with two numbers


class Notes:
    """What a pass has done, recorded without allocation and printed after it."""

    def __init__(self):
        self.kinds = [""] * LOG
        self.numbers = array("i", [0] * (2 * LOG))
        self.count = 0
        self.texts = [""] * LOG
        self.text_count = 0
        self.sent = bytearray(OUTGOING)
        self.sent_count = 0
        self.wire = bytearray(4096)
        self.wire_count = 0
        self.lit = None

    def note(self, kind, a, b):
        self.kinds[self.count] = kind
        self.numbers[2 * self.count] = a
        self.numbers[2 * self.count + 1] = b
        self.count += 1

    def reported(self):
        """Return the pass in words, "" for nothing. Allocates."""
        if not (self.count or self.sent_count or self.text_count or self.wire_count or self.lit):
            return ""
        found = []
        for i in range(self.count):
            found.append(f"{self.kinds[i]}{self.numbers[2 * i]},{self.numbers[2 * i + 1]}")
        found += ["s" + text.replace(" ", "_") for text in self.texts[: self.text_count]]
        if self.wire_count:
            found.append("w" + binascii.hexlify(self.wire[: self.wire_count]).decode())
        if self.lit:
            found.append(f"d{binascii.crc32(self.lit)}")
        if self.sent_count:
            found.append("<" + binascii.hexlify(self.sent[: self.sent_count]).decode())
        self.count = self.text_count = self.wire_count = self.sent_count = 0
        self.lit = None
        return " ".join(found)


class Port:
    def __init__(self, notes):
        self.notes = notes
        self.open = False
        self.openings = 0
        self.answer = None
        self.incoming = bytearray(INCOMING)
        self.begin = self.end = 0
        self.buffer = bytearray(512)
        self.full = False

    def receive(self, data):
        copy_bytes(self.incoming, 0, self.incoming, self.begin, self.end - self.begin)
        self.end -= self.begin
        self.begin = 0
        self.incoming[self.end : self.end + len(data)] = data
        self.end += len(data)

    def ask(self):
        size = 1
        while size and self.open and self._has_frame():
            size = self.answer(self.incoming, self.begin, self.buffer)
            if size:
                self.begin += self._size()
                self._note(size)

    def _has_frame(self):
        waiting = self.end - self.begin
        return waiting >= QUESTION and waiting >= self._size()

    def _size(self):
        return QUESTION + self.incoming[self.begin + 8] + (self.incoming[self.begin + 9] << 8)

    def _note(self, count):
        notes = self.notes
        copy_bytes(notes.sent, notes.sent_count, self.buffer, 0, count)
        notes.sent_count += count

    def poll(self, reader):
        before = self.begin
        while self.begin < self.end:
            taken = reader.feed(self.incoming, self.begin, self.end - self.begin)
            if not taken:
                break
            self.begin += taken
        return self.begin - before

    def glance(self):
        pass

    def look_for_stop(self):
        pass

    def send(self, writer):
        while not self.full:
            count = writer.take(self.buffer, 512)
            if not count:
                return
            if self.open:
                self._note(count)


class Dmx:
    channels = 512

    def __init__(self, notes):
        self.notes = notes
        self.levels = bytearray(513)

    def show(self, lights):
        if lights.words[CHANGED]:
            lights.words[CHANGED] = 0
            copy_bytes(self.levels, 0, lights.levels, 0, 513)
            self.notes.lit = self.levels


class Watchdog:
    def __init__(self, caused_reset):
        self.caused_reset = caused_reset

    def arm(self, ms):
        pass

    def feed(self):
        pass

    def disarm(self):
        pass


class Wire:
    def __init__(self, notes):
        self.notes = notes
        self.answers = ()
        self.at = 0

    def select(self, motor):
        self.notes.note(CHOOSE, motor, 0)

    def send(self, buffer, count):
        notes = self.notes
        copy_bytes(notes.wire, notes.wire_count, buffer, 0, count)
        notes.wire_count += count

    def receive(self, buffer, at, limit):
        if self.at == len(self.answers):
            return 0
        answer = self.answers[self.at]
        self.at += 1
        copy_bytes(buffer, at, answer, 0, len(answer))
        return len(answer)


class Flash:
    blocks = 2
    bytes = 1024

    def __init__(self, content):
        self.content = [bytearray(binascii.unhexlify(block)) for block in content]
        self.page = bytearray(256)

    def read(self, block, at, buffer):
        size = len(buffer)
        if isinstance(buffer, array):
            size *= 4
        copy_bytes(buffer, 0, self.content[block], at, size)

    def program(self, block, at, page):
        content = self.content[block]
        copy_bytes(self.page, 0, page, 0, len(self.page))
        for i in range(len(self.page)):
            content[at + i] &= self.page[i]
        return True

    def erase(self, block, page):
        content = self.content[block]
        for i in range(len(content)):
            content[i] = 0xFF
        return True


class Hal:
    """The contract of framestep.hal over nothing."""

    def __init__(self, head, rig):
        self.notes = Notes()
        self.motors = head["motors"]
        self.board = rig.board
        self.upload_bytes = head["memory"]
        self.port = Port(self.notes)
        self.dmx = Dmx(self.notes) if rig.dmx and "dmx" in rig.board else NoDmx()
        self.watchdog = Watchdog(head["caused_reset"])
        self.driver_wire = Wire(self.notes)
        self.failure = None
        self.alive = True
        self.content = head["flash"]
        self.pins = 0
        self.places = {}
        self.driven = 0
        self.watched = 0
        self.handler = None
        self.colour = 0
        self.given = False  # whether `lost`, `taken` or wire.answers has anything
        self.lost = ()  # the answer of take_lost_commands()
        self.lost_at = 0
        self.taken = ()  # the answer of reclaim()
        self.taken_at = 0
        self.clock = array("i", [0])
        self.sink = array("i", [0])
        self.registers = array("i", [-1, -1])
        self.kernel = StepKernel(self.motors, CYCLES, addressof(self.clock))
        self.kernel.outputs(addressof(self.registers), addressof(self.registers) + 4)
        for motor in range(self.motors):
            self.kernel.configure(motor, addressof(self.sink), *head["shapes"][motor])

    def start(self):
        pass

    def flash(self):
        if self.content is None:
            raise OSError("no flash")
        return Flash(self.content)

    def irq_off(self):
        return 0

    def irq_on(self, state):
        pass

    def ticks_ms(self):
        return 0

    def enable(self, motor, on):
        self.notes.note(ENABLE, motor, 1 if on else 0)

    def led(self, colour):
        if colour != self.colour:
            self.colour = colour
            self.notes.note(LED, colour, 0)

    def report_driver(self, motor, text):
        self.notes.texts[self.notes.text_count] = text
        self.notes.text_count += 1

    def align(self):
        pass

    def take_lost_commands(self):
        if self.lost_at == len(self.lost):
            return 0
        self.lost_at += 1
        return self.lost[self.lost_at - 1]

    def reclaim(self):
        if self.taken_at == len(self.taken):
            return -1
        self.taken_at += 1
        return self.taken[self.taken_at - 1]

    def ready(self):
        return True

    def clock_kept(self):
        return True

    def place(self, pin):
        """Return the number of a pin's bit, as in hal/host.py."""
        if "chain" not in self.board:
            return pin
        return self.places.setdefault(pin, len(self.places))

    def output(self, pin, level):
        bit = 1 << self.place(pin)
        self.driven |= bit
        self.drive(bit * level, bit * (1 - level))
        return bit

    def input(self, pin, pull):
        self.set_level(pin, 1 if pull == "up" else 0)
        return 1 << self.place(pin)

    def drive(self, high, low):
        self.notes.note(OUTPUT, high, low)
        levels = (self.pins | high) & ~low
        self.pins ^= (levels ^ self.pins) & self.driven

    def levels(self):
        return self.pins

    def watch(self, bits, handler):
        self.watched = bits
        self.handler = handler

    def set_level(self, pin, level):
        place = self.place(pin)
        if (self.pins >> place & 1) != level:
            self.pins ^= 1 << place
            if self.watched >> place & 1:
                micropython.heap_lock()
                try:
                    self.handler(None)
                finally:
                    micropython.heap_unlock()
                    self.notes.count = 0

    def idle(self):
        pass


def wipe(deep):
    """Overwrite the stack below the caller: remains of earlier calls look like pointers to objects
    that no longer exist."""
    a = b = c = d = e = f = g = h = 0
    if deep:
        wipe(deep - 1)
    return a + b + c + d + e + f + g + h


def numbers_in(thing, seen, found):
    """Add the arrays and bytearrays reachable from a thing to `found`."""
    if id(thing) in seen:
        return
    seen.add(id(thing))
    if isinstance(thing, (array, bytearray)):
        found.append(thing)
        return
    if isinstance(thing, dict):
        parts = thing.values()
    elif isinstance(thing, (list, tuple)):
        parts = thing
    else:  # a new object each time, so `seen` does not have it
        parts = thing.__dict__.values() if hasattr(thing, "__dict__") else ()
    for part in parts:
        numbers_in(part, seen, found)


class Scales:
    """Measures the memory in use on the heap, to the byte.

    A number in memory that looks like an object's address keeps that object alive. So this
    overwrites the remains on the stack, and moves the contents of arrays to a file while it
    measures.
    """

    def __init__(self, path, things):
        self.file = open(path, "w+b")  # noqa: SIM115 -- open as long as this object
        self.arrays = []
        numbers_in(things, set(), self.arrays)

    def weigh(self):
        """Return the bytes of the heap in use. Call it from the outermost function: then nothing of
        a pass is on the stack."""
        self.file.seek(0)
        for each in self.arrays:
            clear(each, self.file.write(each))
        wipe(DEEP)
        gc.collect()
        found = gc.mem_alloc()
        self.file.seek(0)
        for each in self.arrays:
            self.file.readinto(each)
        return found


def clear(numbers, size):
    """Set all its bytes to 0."""
    for at in range(0, size, len(ZEROS)):
        copy_bytes(numbers, at, ZEROS, 0, min(len(ZEROS), size - at))


class Replay:
    def __init__(self, head, ticks, ms):
        rig = Rig(head["rig"], head["board"])
        self.ms = ms
        self.us = ms * 1000
        self.hal = hal = Hal(head, rig)
        hal.kernel.state[stepper.TICKS] = ticks
        hal.kernel.state[stepper.DUE] = self.us & 0x3FFFFFFF
        hal.kernel.state[stepper.CUE_WRITE_INDEX] = hal.kernel.state[stepper.CUE_READ_INDEX] = (
            WRAP - 3 if ticks else 0
        )
        for block in hal.kernel.blocks:
            block[stepper.IDLE_AT] = ticks - 1000
            if ticks:
                block[stepper.READ_INDEX] = block[stepper.WRITE_INDEX] = 0x3FFFFFFF - 40
        self.controller = Controller(hal, rig, head["broken"])
        try:  # noqa: SIM105 - MicroPython has no contextlib
            self.controller.moves.take_memory()
        except ValueError:
            pass
        self.controller.answer_hi_at_once()
        hal.port.answer = self.controller.answer
        hal.notes.reported()
        # The controller begins with the clock at 0
        controller = self.controller
        controller.reports.sent_at = controller.housekept_at = controller.heard_at = ms & WRAP
        controller.watchdog.checked_at = controller.watchdog._heard_at = ms & WRAP

    def tick(self, us):
        hal = self.hal
        word = us + self.us & 0xFFFFFFFF
        hal.clock[0] = word - 0x100000000 if word & 0x80000000 else word
        micropython.heap_lock()
        try:
            hal.kernel.tick(None)
        finally:
            micropython.heap_unlock()
        registers = hal.registers
        if registers[0] != -1:
            print(f"{us}: t{registers[0]},{registers[1]}")
            registers[0] = registers[1] = -1

    def poll(self, ms, between=False):
        hal = self.hal
        now = ms + self.ms & 0x3FFFFFFF
        micropython.heap_lock()
        try:
            if between:
                hal.port.ask()
            else:
                self.controller.poll(now)
        finally:
            micropython.heap_unlock()
        reported = hal.notes.reported()
        if reported:
            print(ms, reported)
        if hal.given:
            hal.given = False
            hal.driver_wire.answers = hal.lost = hal.taken = ()
            hal.driver_wire.at = hal.lost_at = hal.taken_at = 0

    def happen(self, words):
        verb = words[0]
        hal = self.hal
        if verb == b"S":
            for ms in range(int(words[1]), int(words[1]) + int(words[2])):
                self.tick(ms * 1000 + 7)
                self.poll(ms)
        elif verb == b"P":
            self.poll(int(words[1]))
        elif verb == b"A":
            self.poll(int(words[1]), True)
        elif verb == b"T":
            self.tick(int(words[1]))
        elif verb == b"R":
            hal.port.receive(binascii.unhexlify(words[1]))
        elif verb == b"O":
            hal.port.open = True
            hal.port.openings += 1
        elif verb == b"C":
            hal.port.open = False
            hal.port.begin = hal.port.end = 0
        elif verb == b"L":
            hal.set_level(int(words[1]), int(words[2]))
        elif verb == b"F":
            hal.port.full = words[1] == b"1"
        elif verb == b"W":
            hal.given = True
            hal.driver_wire.answers = [
                b"" if word == b"-" else binascii.unhexlify(word) for word in words[1:]
            ]
        elif verb == b"X":
            hal.given = True
            hal.lost = [int(word) for word in words[1:]]
        elif verb == b"Y":
            hal.given = True
            hal.taken = [int(word) for word in words[1:]]
        else:
            raise ValueError(verb)


class Lines:
    """The lines of a file, as bytes, because MicroPython looks up each new str among all names. One
    piece of the file is in memory at a time, always of the same size and in the same place, because
    a heap after long use has no room for a new one; the file's own readline asks the system for
    every byte."""

    def __init__(self):
        self.piece = memoryview(bytearray(PIECE))
        self.lines = io.BytesIO(PIECE)

    def begin(self, file):
        self.file = file
        self.lines.seek(0)
        self.end = 0  # of the last complete line in it
        self.at = 0  # where the next piece begins in the file

    def next(self):
        """Return the next line without its end; None after the last."""
        if self.lines.tell() == self.end and not self._more():
            return None
        return self.lines.readline()[:-1]

    def _more(self):
        self.file.seek(self.at)
        piece = self.piece
        count = end = self.file.readinto(piece)
        while end and piece[end - 1] != LINE_FEED:
            end -= 1
        self.end = end
        self.at += end
        self.lines.seek(0)
        self.lines.write(piece[:count])
        self.lines.seek(0)
        return end > 0


def play(path, lines, ticks, ms):
    with open(path, "rb") as file:
        lines.begin(file)
        replay = Replay(json.loads(lines.next()), ticks, ms)
        scales = None
        while line := lines.next():
            if line == b"G":
                scales = scales or Scales(path + ".kept", replay)
                print("heap", scales.weigh())
            else:
                replay.happen(line.split())
    print("at", *[block[stepper.POSITION] for block in replay.hal.kernel.blocks])


_lines = Lines()
for _path in sys.argv[3:]:
    play(_path, _lines, int(sys.argv[1]), int(sys.argv[2]))
