"""Real-time operations of every kind, for both runtimes; session_replay.py plays this script."""

import struct

try:
    from host_tests.runtime import session_replay as session
except ImportError:  # on MicroPython, next to this file
    import session_replay as session

frame = session.frame
words = session.words

BIG = 0xDEADBEEF  # no small integer on the board, nor are:
MASK = 0x7FFFFFFF
VALUES = 0x40000001
OUTPUTS = 0xC0000002


def run(
    fps_milli=24000,
    start=1,
    end=40,
    pre=200,
    post=200,
    sync=1,
    outputs=0,
    channel=0,
    ms=0,
    flags=None,
    angles=None,
):
    data = struct.pack("<IiiIIBIHH", fps_milli, start, end, pre, post, sync, outputs, channel, ms)
    if flags is not None:
        data += struct.pack("<H", flags)
    if angles:
        data += struct.pack("<HH", *angles)
    return frame(0x111, data, BIG)


def axis(motor, steps):
    return frame(0x101, bytes((motor,)) + struct.pack("<I", 0x80000000) + words(*steps))


def script():
    """Return [(milliseconds to pass afterwards, bytes)]"""
    go, stop_all, stop_loop, status = frame(0x113, b"", BIG), frame(0x33), frame(0x116), frame(0x30)
    far = 2**30 + 4000  # positions that are no small integers
    pairs = b"\x01" + words(far, far + 400) + b"\x02" + words(90, -30)
    levels = b"".join(
        frame(0x102, struct.pack("<HI", 7 + c, 0x80000000) + bytes(range(c, 40 + c)))
        for c in range(4)
    )
    triggers = struct.pack("<III", MASK, 0, VALUES) + struct.pack("<IIII", 3, 0xFFFFFFFF, 39, 2)
    return [
        (
            3,
            frame(0x38, b"\x01" + words(20000, 100000))
            + frame(0x38, b"\x02" + words(20000, 100000)),
        ),
        (
            3,
            frame(0x35, b"\x01" + words(far)) + frame(0x37, b"\x01\x03") + frame(0x37, b"\x02\x03"),
        ),
        (3, frame(0x100, words(1, 40)) + axis(1, [far + 50 * k for k in range(40)])),
        (3, axis(2, [3 * k * k // 8 for k in range(40)]) + levels),
        (3, frame(0x104, triggers) + frame(0x103)),
        # loops: stopped in a lap, on the way back, in the post-roll; with everything that
        # accompanies them
        (900, run(flags=0x02, outputs=OUTPUTS, channel=300, ms=250)),
        (3000, go + status),
        (2500, stop_loop + status),
        (900, run(start=30, end=4, pre=0, post=0, flags=0x21, angles=(0, 180))),
        (2700, go),
        (2500, stop_loop),
        (900, run(29970, 1, 12, 300, 0, flags=0x10)),
        (1500, go),
        (900, run(12000, 12, 1, 300, 300, flags=0x30)),
        (800, go),
        (900, stop_all + status),
        (900, run(500, 1, 2, flags=0x20)),
        (1500, go),
        (300, stop_all + stop_all),
        # refused: too early, while moving, dropped
        (3, run(0) + run(flags=0x40) + run(channel=513)),
        (10, run(pre=900) + go + run()),
        (900, frame(0x110, words(3)) + go),
        # go-motion
        (1500, frame(0x112, struct.pack("<iBIH", 12, 0, 250, 1), BIG)),
        (2600, go + status),
        (1500, frame(0x112, struct.pack("<iBIH", 40, 1, 400, 1000) + pairs, BIG)),
        (1300, go),
        (900, stop_all),
        (1500, frame(0x115, struct.pack("<iIhh", 12, 500, -90, 450) + pairs)),
        (3400, go),
        (1500, frame(0x115, struct.pack("<iIhh", 1, 400, 0, 360))),
        (2400, go),
        (
            3,
            frame(0x115, struct.pack("<iIhh", 1, 60000, 0, 1))
            + frame(0x112, struct.pack("<iBIH", 1, 1, BIG, 1)),
        ),
        # jog-all: on, farther, back, slower, landing
        (900, frame(0x110, words(5))),
        (700, frame(0x120, words(12000, 30))),
        (500, frame(0x120, words(12000, 38)) + status),
        (2600, frame(0x120, words(6000, 2))),
        (900, frame(0x120, words(1000, 2))),
        (2500, stop_all),
        (900, frame(0x120, words(200000, 39))),
        (900, stop_all + stop_all),
        (3, frame(0x120, words(24000, 39)) + frame(0x120, words(BIG - 2**32, 39))),
        # slow: a stop lands at a frame per second, a second STOP_ALL is the hard one
        (900, frame(0x110, words(7))),
        (1200, frame(0x120, words(100, 30))),
        (2300, stop_all + status),
        (1200, frame(0x120, words(700, 2))),
        (1300, frame(0x32, b"\x02")),
        (900, stop_all + stop_all),
    ]


def replay(say):
    session.script = script
    session.replay(say)
