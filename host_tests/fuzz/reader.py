"""Streams for the frame reader, mutated toward code that none has reached: fuzzing guided by
coverage.

The expected answers come from the reader written from the specification
(host_tests/protocol/streams.py). Coverage is the set of steps from line to line within
protocol/frames.py, and how often each happens, by powers of two.
"""

import struct
import sys
import time
from array import array
from collections import Counter
from random import Random

from framestep.protocol import frames
from host_tests.protocol.streams import ABANDON, POLL, Case, expected
from host_tests.runtime.frames_echo import echo

from .link import frame

READER = frames.FrameReader
CODES = {
    f.__code__
    for f in (READER.feed, READER.poll, READER.drop_partial, READER.clear, frames._search)
}
MOST_BYTES = 6000  # of a stream; the echo answers all of them


class Mismatch(AssertionError):
    """A case that the two readers answer differently."""


def covered(case: Case) -> tuple[set, bytes]:
    """Return (its steps between lines, the answer)."""
    hits: Counter = Counter()

    def scopes(scope, event, _):
        if scope.f_code not in CODES:
            return None
        last = 0

        def lines(scope, event, _):
            nonlocal last
            hits[last, scope.f_lineno] += 1
            last = scope.f_lineno
            return lines

        return lines

    reader, writer, out = frames.FrameReader(), frames.FrameWriter(40_000), bytearray(40_000)
    before = sys.gettrace()
    sys.settrace(scopes)
    try:
        count = echo(case.stream, case.steps, reader, writer, out, array("i", (0, 0, 0)))
    finally:
        sys.settrace(before)
    return {(step, n.bit_length()) for step, n in hits.items()}, bytes(
        out[:count]
    ) if count >= 0 else b"stuck"


def some_frame(dice: Random) -> bytes:
    """Return a good frame, mostly short; its payload may look like the beginning of others."""
    length = dice.choice((0, 0, 1, 4, 5, 30, 300, 1034, 1035, 1036))
    payload = bytearray(dice.randbytes(length))
    for _ in range(dice.randint(0, 3)):
        if length > 12:
            at = dice.randrange(length - 12)
            payload[at : at + 10] = b"DF" + struct.pack(
                "<IHH", 7, 0x31, dice.choice((0, 1, length, 1036, 1037))
            )
    return frame(
        dice.choice((1, 0x31, 0x101, 0x4644)), bytes(payload), dice.choice((0, 1, 2**30, 2**32 - 1))
    )


def steps_for(dice: Random, length: int) -> tuple[int, ...]:
    """Return the steps in which a stream arrives."""
    steps = []
    while length > 0:
        n = min(length, dice.choice((1, 2, 9, 10, 11, 12, 13, 64, 512, 1036, 1048, 1092, 3000)))
        steps.append(n)
        length -= n
        steps += dice.choices((POLL, ABANDON), (5, 1), k=dice.choice((0, 1, 1, 2)))
    return (*steps, POLL)


def mutated(dice: Random, corpus: list[Case]) -> Case:
    """Return a new case, made from one or two useful ones."""
    case = dice.choice(corpus)
    stream = bytearray(case.stream)
    for _ in range(dice.choice((1, 1, 2, 4))):
        at = dice.randrange(len(stream) + 1)
        kind = dice.randrange(7)
        if kind == 0:
            stream[at:at] = some_frame(dice)
        elif kind == 1 and stream:
            stream[min(at, len(stream) - 1)] ^= 1 << dice.randrange(8)
        elif kind == 2:
            del stream[at : at + dice.choice((1, 2, 5, 12))]
        elif kind == 3:
            stream[at:at] = dice.choice(
                (b"D", b"DF", b"DDF", b"DF" + bytes(6) + b"\x0c\x04", dice.randbytes(3))
            )
        elif kind == 4:
            stream[at:at] = stream[at : at + dice.choice((1, 10, 40))]
        elif kind == 5:
            other = dice.choice(corpus).stream
            stream[at:] = other[dice.randrange(len(other) + 1) :]
        elif len(stream) > 10:
            at = stream.find(b"DF", at)
            if 0 <= at < len(stream) - 10:
                struct.pack_into(
                    "<H", stream, at + 8, dice.choice((0, 1, 1035, 1036, 1037, 0xFFFF))
                )
    if len(stream) > MOST_BYTES:
        del stream[MOST_BYTES:]
    return Case(bytes(stream), steps_for(dice, len(stream)))


def explore(seed: str, seconds: float = 1e9, cases: int = 10**9) -> tuple[int, int, int]:
    """Return (cases tried, cases kept because they reached something new, steps between lines).
    Mismatch for a difference."""
    dice = Random(seed)
    first = some_frame(dice)
    corpus = [Case(b"", (POLL,)), Case(first, (len(first), POLL))]
    seen: set = set()
    until = time.monotonic() + seconds
    tried = 0
    while tried < cases and time.monotonic() < until:
        case = corpus[tried] if tried < 2 else mutated(dice, corpus)
        tried += 1
        reached, answer = covered(case)
        if answer != expected(case):
            raise Mismatch(f"stream {case.stream.hex()} in steps {case.steps}")
        if not reached <= seen:
            seen |= reached
            corpus.append(case)
    return tried, len(corpus), len(seen)
