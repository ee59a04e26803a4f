"""Near the ends of the range of positions, for both runtimes; session_replay.py plays this script.

Nothing may pass ±2^31: on the board a sum wraps, and the motor goes the other way.
"""

import struct

from framestep.base.results import ERR_POSTROLL, ERR_PREROLL, ERR_RANGE, OK

try:
    from host_tests.runtime import session_replay as session
    from host_tests.runtime.realtime_replay import axis, run
except ImportError:  # on MicroPython, next to this file
    import session_replay as session
    from realtime_replay import axis, run

frame = session.frame
words = session.words

TOP = 2**31 - 1
BOTTOM = -(2**31)
LOWEST = BOTTOM + 1  # the lowest position of an upload


def reset(position):
    return frame(0x35, b"\x01" + words(position))


def upload(steps, start=1):
    return frame(0x100, words(start, start + len(steps) - 1)) + axis(1, steps) + frame(0x103)


def cases():
    """Return [(what, milliseconds to pass afterwards, bytes, codes of the acknowledgements)]"""
    go, stop = frame(0x113), frame(0x33)
    speed = frame(0x38, b"\x01" + words(500000, 4000000)) + frame(0x37, b"\x01\x03")
    rising = [TOP - 100 * (24 - k) for k in range(25)]
    falling = [LOWEST + 100 * (24 - k) for k in range(25)]
    wild = [0, 100, 200, 300, 400, 500, LOWEST, TOP, LOWEST, TOP]
    jumps = [LOWEST, LOWEST + 100, 0, TOP - 100, TOP]
    shoot, shoot2, jog = 0x112, 0x115, 0x120
    blur = struct.pack("<iBIH", 12, 1, 1000, 1000)

    def pair(a, b):
        return b"\x01" + words(a, b)

    return [
        ("speeds", 3, speed, [OK, OK]),
        # ramps
        ("up to the top", 3, upload(rising), [OK] * 3),
        ("post-roll past the top", 3, run(end=25), [ERR_POSTROLL]),
        ("pre-roll from there", 3, run(start=25, end=1), [ERR_PREROLL]),
        ("rolls of ten minutes", 3, run(end=20, pre=600000, post=600000), [ERR_POSTROLL]),
        ("in a loop", 3, run(end=25, flags=2) + run(end=25, flags=1), [ERR_POSTROLL] * 2),
        ("that fits", 600, reset(rising[0]) + run(end=20, pre=20, post=20), [OK] * 2),
        ("go", 1200, go, [OK]),
        ("down to the bottom", 3, upload(falling), [OK] * 3),
        ("post-roll past the bottom", 3, run(end=25), [ERR_POSTROLL]),
        ("pre-roll from there", 3, run(start=25, end=1), [ERR_PREROLL]),
        ("that fits", 600, reset(falling[0]) + run(end=20, pre=20, post=20), [OK] * 2),
        ("go", 1200, go, [OK]),
        # exposures
        ("window at the top", 3, frame(shoot, blur + pair(TOP - 1000, TOP)), [ERR_POSTROLL]),
        ("from the bottom", 3, frame(shoot, blur + pair(BOTTOM, BOTTOM + 1000)), [ERR_PREROLL]),
        ("across all", 3, frame(shoot, blur + pair(BOTTOM, TOP)), [ERR_RANGE]),
        (
            "a part of all",
            3,
            frame(shoot, struct.pack("<iBIH", 12, 1, 1, 1) + pair(BOTTOM, TOP)),
            [ERR_RANGE],
        ),
        # neighbours
        ("wild", 3, upload(wild) + reset(0), [OK] * 4),
        ("across all", 3, run(end=8) + run(start=7, end=8) + run(start=10, end=7), [ERR_RANGE] * 3),
        ("up to there", 600, run(fps_milli=24000, start=1, end=5), [OK]),
        ("go", 1500, go, [OK]),
        ("slowly", 3, run(fps_milli=1, start=1, end=10), [ERR_RANGE]),
        (
            "half a frame from there",
            3,
            frame(shoot, struct.pack("<iBIH", 7, 1, 1000, 1000)),
            [ERR_RANGE],
        ),
        ("the same", 3, frame(shoot2, struct.pack("<iIhh", 6, 1000, 0, 360)), [ERR_RANGE]),
        ("jog", 3, reset(500) + frame(jog, words(1, 10)), [OK, ERR_RANGE]),
        ("there and back", 4000, frame(jog, words(6000, 1)), [OK]),
        ("end to end", 3, upload(jumps) + reset(LOWEST), [OK] * 4),
        (
            "across all",
            3,
            run(fps_milli=1, start=1, end=5) + frame(jog, words(1, 5)),
            [ERR_RANGE] * 2,
        ),
        ("from the end", 300, run(start=2, end=1), [OK]),
        ("a single frame", 300, run(start=1, end=1), [OK]),
        ("go", 900, go + stop, [OK, OK]),
    ]


def script():
    return [(ms, data) for _, ms, data, _ in cases()]


def replay(say):
    session.script = script
    session.replay(say)
