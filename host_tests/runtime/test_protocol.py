"""The protocol as machine code on 32 bits, with the heap locked, answers as it does on CPython."""

import random
from pathlib import Path

from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

from host_tests.protocol import streams

ECHO = Path(__file__).parent / "frames_echo.py"


# Many cases for each start of MicroPython. They are not shrunk: host_tests/protocol does that, on CPython.
@given(st.lists(streams.cases(), min_size=20, max_size=40))
@settings(max_examples=8, deadline=None, phases=[Phase.generate], suppress_health_check=list(HealthCheck))
def test_any_stream_in_any_pieces(unix32f, cases):
    answers = unix32f.run(ECHO, stdin="".join(case.line() for case in cases).encode()).split("\n")
    for case, answer in zip(cases, answers, strict=False):
        assert answer == streams.expected(case).hex(), case
    assert len(answers) == len(cases) + 1


SUMS = """
import sys
from micropython import heap_lock, heap_unlock
from framestep.protocol.checksum import fletcher16
data = bytes.fromhex(sys.stdin.readline().strip())
def sums(start, count):
    heap_lock()
    try:
        return fletcher16(data, start, count)
    finally:
        heap_unlock()
for start in range(9):
    for count in list(range(70)) + [255, 256, 257, 271, 272, 511, 512, 513, 1030, 1045, 1046]:
        print(sums(start, count))
"""


def test_checksum(unix32f):
    for data in b"\xff" * 1100, bytes(1100), random.Random(1).randbytes(1100), b"\xff\0" * 550, b"\0\xff" * 550:
        expected = [
            streams.fletcher(data[start : start + count])
            for start in range(9)
            for count in [*range(70), 255, 256, 257, 271, 272, 511, 512, 513, 1030, 1045, 1046]
        ]
        assert list(map(int, unix32f.run(SUMS, stdin=data.hex().encode() + b"\n").split())) == expected


CHECK = """
from micropython import heap_lock, heap_unlock
from framestep.protocol.checksum import check_bytes
def wrong():
    count = 0
    for f1 in range(255):
        for f0 in range(255):
            c0 = 0xFF - (f0 + f1) % 0xFF
            c1 = 0xFF - (f0 + c0) % 0xFF
            if check_bytes(f1 << 8 | f0) != c0 | c1 << 8:
                count += 1
    return count
count = 0
heap_lock()
count = wrong()
heap_unlock()
print(count)
"""


def test_check_bytes(unix32f):
    assert unix32f.run(CHECK) == "0\n"


COPIES = """
from micropython import heap_lock, heap_unlock
from framestep.copying import copy_bytes
source = bytes((i * 73 + 5) & 0xFF for i in range(64))
target = bytearray(64)
wrong = 0
def copy(to, to_at, source, at, count):
    heap_lock()
    copy_bytes(to, to_at, source, at, count)
    heap_unlock()
for at in range(8):
    for to_at in range(8):
        for count in range(48):
            for i in range(64):
                target[i] = 0xA5
            copy(target, to_at, source, at, count)
            rest = b"\\xA5" * (64 - to_at - count)
            if target != b"\\xA5" * to_at + source[at : at + count] + rest:
                wrong += 1
            both = bytearray(source)  # towards the front of one buffer
            copy(both, at, both, at + to_at, count)
            if both[at : at + count] != source[at + to_at : at + to_at + count]:
                wrong += 1
            if both[:at] != source[:at] or both[at + count :] != source[at + count :]:
                wrong += 1
print(wrong)
"""


def test_copies(unix32f):
    """From and to any place in a word, and within one buffer."""
    assert unix32f.run(COPIES) == "0\n"
