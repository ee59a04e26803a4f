"""Streams of bytes as a bad line or a bad program would send them, and what a reader must find in
them.

`Reference` is a second reader, written from the specification and field notes 1.1 to 1.8 without
regard for speed or memory. `cases()` draws streams with the steps in which they arrive;
`expected()` is what the echo of host_tests/runtime/frames_echo.py must answer to such a case.
"""

import struct
from dataclasses import dataclass

from hypothesis import strategies as st

from framestep_tools.client import wire

ERR_CHECKSUM = 0x0011
WAITING = 0x7777  # type of the echo's frames that report `waiting`
LARGEST_PAYLOAD = 1036

# Steps of a case: a number above 0 feeds that many bytes
POLL = 0
ABANDON = -1


@dataclass(frozen=True)
class Case:
    stream: bytes
    steps: tuple[int, ...]

    def line(self) -> str:
        """Return the case as frames_echo.py reads it from its standard input."""
        return f"{self.stream.hex()} {' '.join(map(str, self.steps))}\n"


class Reference:
    """A reader of frames: simple, and with endless memory."""

    def __init__(self):
        self.stream = b""
        self.at = 0

    @property
    def waiting(self) -> int:
        return len(self.stream) - self.at

    def poll(self):
        """Return the next frame as (good, ID bytes, type, payload), or None."""
        while True:
            found = self.stream.find(b"DF", self.at)
            if found < 0:
                self.at = len(self.stream) - self.stream.endswith(b"D", self.at)
                return None
            self.at = found
            if self.waiting < 10:
                return None
            number, kind, length = struct.unpack_from("<4sHH", self.stream, found + 2)
            if length > LARGEST_PAYLOAD:
                self.at += 2
                continue
            if self.waiting < 12 + length:
                return None
            frame = self.stream[found : found + 12 + length]
            if fletcher(frame) == 0:
                self.at += len(frame)
                return True, number, kind, frame[10:-2]
            self.at += 2
            return False, number, kind, None

    def drop_partial(self):
        self.at += min(2, self.waiting)


def fletcher(data: bytes) -> int:
    """The specification's computeChecksum() in its simplest form."""
    sum1 = sum2 = 0
    for byte in data:
        sum1 = (sum1 + byte) % 255
        sum2 = (sum2 + sum1) % 255
    return sum2 << 8 | sum1


def expected(case: Case) -> bytes:
    """Return the echo's answer: good frames unchanged, ERR_CHECKSUM for damaged ones, `waiting`
    after each POLL."""
    reader = Reference()
    out = []

    def drain():
        while frame := reader.poll():
            good, number, kind, payload = frame
            number = int.from_bytes(number, "little")
            if good:
                out.append(wire.encode(kind, payload, number))
            else:
                out.append(wire.encode(kind | 0x8000, struct.pack("<H", ERR_CHECKSUM), number))

    fed = 0
    for step in case.steps:
        if step > 0:
            reader.stream += case.stream[fed : fed + step]
            fed += step
            continue
        drain()
        if step == ABANDON:
            reader.drop_partial()
            drain()
        else:
            out.append(wire.encode(WAITING, struct.pack("<H", reader.waiting)))
    drain()
    return b"".join(out)


def _payloads():
    markers = st.sampled_from([b"D", b"F", b"DF", b"DDF", b"DFD", b"\x00", b"\xff"])
    short = st.lists(st.one_of(markers, st.binary(max_size=12)), max_size=8).map(b"".join)
    long = st.builds(
        lambda part, size: (part * (size // len(part) + 1))[:size],
        st.binary(min_size=1, max_size=40),
        st.one_of(
            st.integers(0, LARGEST_PAYLOAD), st.integers(LARGEST_PAYLOAD - 3, LARGEST_PAYLOAD)
        ),
    )
    return st.one_of(short, short, long)


_numbers = st.one_of(
    st.integers(0, 0xFFFF_FFFF),
    st.sampled_from([0, 0x3FFF_FFFF, 0x4000_0000, 0x8000_0000, 0xFFFF_FFFF]),
)
_kinds = st.one_of(
    st.integers(0, 0xFFFF), st.sampled_from([0x0001, 0x0031, 0x0101, 0x4644, 0x8001, 0xFFFF])
)


def frames(payloads=None):
    """Draw good frames with any ID, type and payload."""
    return st.builds(wire.encode, _kinds, _payloads() if payloads is None else payloads, _numbers)


@st.composite
def _damaged(draw, frame):
    data = bytearray(draw(frame))
    for _ in range(draw(st.integers(1, 3))):
        data[draw(st.integers(2, len(data) - 1))] ^= draw(st.integers(1, 255))
    return bytes(data)


@st.composite
def _truncated(draw, frame):
    data = draw(frame)
    return data[: draw(st.integers(1, len(data) - 1))]


@st.composite
def _around_another(draw):
    """Draw a damaged frame that contains a good one."""
    payload = (
        draw(st.binary(max_size=20))
        + draw(frames(st.binary(max_size=20)))
        + draw(st.binary(max_size=20))
    )
    data = bytearray(wire.encode(draw(_kinds), payload, draw(_numbers)))
    data[-1] ^= draw(st.integers(1, 254))
    return bytes(data)


def _header(length):
    return st.builds(
        lambda number, kind, size, rest: b"DF" + struct.pack("<IHH", number, kind, size) + rest,
        _numbers, _kinds, length, st.binary(max_size=30),
    )  # fmt: skip


def streams():
    """Draw anything that may arrive on the line."""
    piece = st.one_of(
        frames(),
        frames(),
        _damaged(frames()),
        _truncated(frames()),
        _around_another(),
        _header(st.one_of(st.integers(LARGEST_PAYLOAD + 1, 0xFFFF), st.just(LARGEST_PAYLOAD + 1))),
        _header(st.integers(0, LARGEST_PAYLOAD)),
        st.builds(
            bytes.__add__,
            _header(st.integers(200, LARGEST_PAYLOAD)),
            frames(st.binary(max_size=20)),
        ),
        st.binary(max_size=30),
        st.sampled_from([b"D", b"DF", b"DFDF", b"F", b"\x03", b"D" * 20]),
    )
    return st.lists(piece, max_size=10).map(b"".join)


@st.composite
def cases(draw):
    """Draw a stream and the steps in which it arrives: all of it, in pieces of any size, with any
    polls between them."""
    stream = draw(streams())
    steps = []
    left = len(stream)
    sizes = st.one_of(st.integers(1, 3), st.integers(1, 64), st.integers(1, 3000))
    while left:
        # few large steps at the end, because hypothesis cannot draw enough small ones for a long
        # stream
        size = left if len(steps) > 60 else min(left, draw(sizes))
        steps.append(size)
        left -= size
        steps += draw(
            st.sampled_from(
                [(), (), (POLL,), (POLL,), (POLL, POLL), (ABANDON,), (POLL, ABANDON, POLL)]
            )
        )
    steps += draw(st.sampled_from([(), (ABANDON, POLL), (ABANDON, ABANDON, POLL)]))
    return Case(stream, tuple(steps))
