"""A session with virtual axes, for both runtimes: see session_replay.py."""

import struct

import session_replay
from session_replay import frame, words


def _config(kind, positions, lengths):
    axes = b"".join(words(i + 1, 1000000 + 1000 * i, p) for i, p in enumerate(positions))
    return frame(0x200, bytes((kind,)) + axes + words(*lengths))


def _speeds():
    return b"".join(frame(0x38, bytes((i + 1,)) + words(20000, 50000)) for i in range(6))


def script():
    """Return [(milliseconds to pass afterwards, bytes)]"""
    move = lambda axis, position: frame(0x201, bytes((axis,)) + words(round(position * 100000)))  # noqa: E731
    stop = lambda axis: frame(0x202, bytes((axis,)))  # noqa: E731
    places = (1000000, 15000000, -2000000, 500000, -300000, 0)
    return [
        (3, frame(0x205) + move(1, 0) + _speeds()),
        (3, frame(0x35, b"\x01" + words(2**30 + 12345))),
        (3, _config(4, places, (20000, 35500, -12000)) + frame(0x205)),
        (5, _config(4, places, (20000, 35500)) + _config(4, (1,), ()) + frame(0x200, b"\x05")),
        (900, move(4, 15)),
        (400, move(1, 17) + move(9, 0) + frame(0x31, b"\x01" + words(0)) + frame(0x30)),
        (700, stop(1) + frame(0x205)),
        (300, move(2, 4.5)),
        (600, frame(0x33)),
        (300, move(3, 155.25)),
        (300, frame(0x33) + frame(0x33)),
        (3, frame(0x39, b"\x01\x01" + words(0) + b"\x01" + words(5) + b"\x00") + move(2, 60)),
        (3, frame(0x200, b"\x00") + frame(0x205)),
        (3, frame(0x200, struct.pack("<BIiIi", 2, 1, 500000, 2, 100000)) + frame(0x205)),
        (1200, move(4, 20)),
        (3, frame(0x33) + frame(0x200, b"\x00")),
        (
            3,
            _config(
                1,
                (300000, 1000000, 40000000, -1000000, -300000, 0),
                (857700, 78000, 20000, 35500, 0, 5000),
            ),
        ),
        (600, frame(0x203, b"\x02" + struct.pack("<Hi", 9000, 2**31 - 1))),
        (700, frame(0x203, b"\x02" + struct.pack("<Hi", 9000, 2**31 - 1)) + move(1, 3)),
        (300, frame(0x206, b"\x02" + struct.pack("<h", -7000))),
        (300, frame(0x206, b"\x02" + struct.pack("<h", 3000))),
        (900, frame(0x203, b"\x03" + struct.pack("<Hi", 5000, -(2**31)))),
        (900, stop(1)),
        (3, frame(0x207, b"\x01" + words(30000, 50000, 200000)) + frame(0x205)),
        (800, frame(0x31, b"\x03" + words(5000))),
        (900, move(1, -600) + frame(0x205)),
        (
            400,
            frame(0x36, b"\x02" + struct.pack("<Hi", 5000, -(2**31)))
            + frame(0x207, b"\x00" + words(1, 2, 3)),
        ),
        (400, stop(5) + frame(0x32, b"\x02")),
        (3, frame(0x207, b"\x00" + words(1, 2, 3)) + frame(0x205)),
    ]


def replay(say, backlash=0):
    settings = {"motors": [{"backlash": backlash}] * 6} if backlash else None
    session_replay.replay(say, script(), settings)
