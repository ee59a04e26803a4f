"""A whole session with the controller, for both runtimes: requests in, all answers and reports out.

Runs unchanged on CPython and on MicroPython. There the heap is locked in every pass of the main
loop and in every tick, so an allocation between a request's first byte and its reply ends the test.
"""

import binascii
import struct
from array import array

from framestep.base.native import CPYTHON, addressof
from framestep.controller import Controller
from framestep.hal.absent import NoDmx, NoWatchdog
from framestep.pulse.kernel import StepKernel
from framestep.pulse.stepper import POSITION
from framestep.rig import Rig

if CPYTHON:

    class lock:
        heap_lock = staticmethod(lambda: None)
        heap_unlock = staticmethod(lambda: None)

else:
    import micropython as lock

BOARD = {"estop": 19, "shutter": 20, "meter": 21, "gio": [22, 26, 27, 28]}
CYCLES = 125000


class Port:
    """Bytes in from `incoming`, bytes out to `outgoing`; both exist before the heap is locked."""

    def __init__(self):
        self.open = True
        self.openings = 1
        self.incoming = bytearray(2048)
        self.begin = self.end = 0
        self.buffer = bytearray(4096)
        self.outgoing = bytearray()
        self.count = 0

    def poll(self, reader):
        taken = (
            reader.feed(self.incoming, self.begin, self.end - self.begin)
            if self.begin < self.end
            else 0
        )
        self.begin += taken
        return taken

    def glance(self):
        pass

    def send(self, writer):
        if not self.count:
            self.count = writer.take(self.buffer, 4096)


class Hal:
    """The contract of framestep.hal without hardware: no engine, no pins."""

    def __init__(self, motors):
        self.motors = motors
        self.board = BOARD
        self.upload_bytes = 16384
        self.port = Port()
        self.dmx = NoDmx()
        self.watchdog = NoWatchdog()
        self.clock = array("i", [0])
        self.sink = array("i", [0] * 4)
        self.kernel = StepKernel(motors, CYCLES, addressof(self.clock))
        for motor in range(motors):
            self.kernel.configure(motor, addressof(self.sink), 1, 625, False)

    def irq_off(self):
        return 0

    def irq_on(self, state):
        pass

    def enable(self, motor, on):
        pass

    def led(self, lit):
        pass

    floats = 0

    def reclaim(self):
        return -1

    def ready(self):
        return True

    def clock_kept(self):
        return True

    def take_lost_commands(self):
        return 0

    def output(self, pin, level):
        return 1 << pin

    def input(self, pin, pull):
        return 1 << pin

    def drive(self, high, low):
        pass

    def levels(self):
        return 0

    def watch(self, bits, handler):
        pass


def checksum(data):
    a = b = 0
    for byte in data:
        a = (a + byte) % 255
        b = (b + a) % 255
    return a, b


def frame(kind, payload=b"", number=1):
    head = b"DF" + struct.pack("<IHH", number, kind, len(payload)) + payload
    a, b = checksum(head)
    first = 255 - (a + b) % 255
    return head + bytes((first, 255 - (a + first) % 255))


def words(*values):
    return b"".join(struct.pack("<i", value) for value in values)


def script():
    """Return [(milliseconds to pass afterwards, bytes)]"""
    big = 0xDEADBEEF  # an ID, and positions, that are no small integers on the board
    far = 2**30 + 12345
    steps = [round(3 * k * k / 8) for k in range(40)]
    section = lambda motor: frame(  # noqa: E731
        0x101, bytes((motor,)) + struct.pack("<I", 0x80000000) + words(*steps)
    )
    run = (
        struct.pack("<IiiII", 24000, 1, 40, 300, 300)
        + struct.pack("<BIHHH", 0, 0, 0, 0, 0x20)
        + words(90 | 270 << 16)
    )
    loop = struct.pack("<IiiII", 24000, 1, 20, 300, 300) + struct.pack("<BIHHH", 0, 1, 3, 200, 1)
    return [
        (3, frame(0x01, number=big)),
        (
            3,
            frame(0x38, b"\x01" + words(20000, 100000))
            + frame(0x38, b"\x02" + words(20000, 100000)),
        ),
        (3, frame(0x38, b"\x03" + words(0, 1)) + frame(0x38, b"\x03" + words(-1, -1))),
        (3, frame(0x35, b"\x03" + words(far), big) + frame(0x35, b"\x04" + words(-(2**31) + 7))),
        (
            120,
            frame(0x31, b"\x01" + words(900))
            + frame(0x31, b"\x03" + words(far + 500))
            + frame(0x34),
        ),
        (60, frame(0x31, b"\x01" + words(-300)) + frame(0x30, number=big)),
        (
            40,
            frame(0x36, b"\x02" + struct.pack("<Hi", 3000, 2**31 - 1))
            + frame(0x36, b"\x02" + struct.pack("<Hi", 9000, 0)),
        ),
        (60, frame(0x32, b"\x03") + frame(0x33) + b"noise DF" + frame(0x33)[:-1] + b"\x00"),
        (
            900,
            frame(0x39, b"\x01\x01" + words(-5000) + b"\x01" + words(5000) + b"\x00") + frame(0x34),
        ),
        (
            3,
            frame(0x31, b"\x01" + words(6000))
            + frame(0x39, b"\x01\x01" + words(5) + b"\x01" + words(1) + b"\x00"),
        ),
        (900, frame(0x31, b"\x01" + words(0)) + frame(0x31, b"\x02" + words(0))),
        (3, frame(0x37, b"\x01\x03") + frame(0x37, b"\x02\x03") + frame(0x37, b"\x05\x11")),
        (3, frame(0x100, words(1, 40)) + section(1) + section(2)),
        (3, frame(0x102, struct.pack("<HI", 7, 0x80000000) + bytes(range(40)))),
        (3, frame(0x104, words(3) + words(2, 1, 5, -1)) + frame(0x103)),
        (
            700,
            frame(0x110, words(12))
            + frame(0x20, b"\x00\x01\x00abc")
            + frame(0x20, b"\x01\x05\x00xyz"),
        ),
        (3, frame(0x120, words(12000, 30))),
        (900, frame(0x30)),
        (2500, frame(0x33)),
        (900, frame(0x111, run)),
        (2600, frame(0x113) + frame(0x111, run)),
        (900, frame(0x111, loop)),
        (3500, frame(0x113)),
        (2500, frame(0x116)),
        (1500, frame(0x112, struct.pack("<iBIH", 12, 1, 250, 500))),
        (2600, frame(0x113)),
        (1500, frame(0x115, struct.pack("<iIhh", 12, 250, -30, 400) + b"\x01" + words(0, 400))),
        (1200, frame(0x113)),
        (500, frame(0x33) + frame(0x33)),
        (
            3,
            frame(0x21, words(3))
            + frame(0x22)
            + frame(0x23, words(3))
            + frame(0x300)
            + frame(0x31, b"\x00"),
        ),
    ]


def replay(say, played=None, settings=None):
    """Play a script; say(text) for each piece of output, and at the end for the positions.
    settings: those of the rig file."""
    motors = 8
    hal = Hal(motors)
    controller = Controller(hal, Rig(settings, BOARD))
    controller.moves.take_memory()
    port = hal.port
    ms = 0
    for wait, data in played or script():
        port.incoming[: len(data)] = data
        port.begin, port.end = 0, len(data)
        for _ in range(wait):
            ms += 1
            hal.clock[0] = ms * 1000
            lock.heap_lock()
            hal.kernel.tick(None)
            controller.poll(ms)
            lock.heap_unlock()
            if port.count:
                say(str(ms) + " " + binascii.hexlify(port.buffer[: port.count]).decode())
                port.count = 0
    say(" ".join(str(controller.axes[i].block[POSITION]) for i in range(motors)))
