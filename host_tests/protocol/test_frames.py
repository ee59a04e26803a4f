"""The frame reader against a second reader, and the writer against a list.

`Reference` is the second reader, written from the specification and field notes 1.1 to 1.8 without
regard for speed or memory. `cases()` draws streams of bytes as a bad line or a bad program would
send them, with the steps in which they arrive; `expected()` is what `echo()` must answer to such a
case.
"""

import struct
from array import array
from dataclasses import dataclass

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from framestep.protocol import messages
from framestep.protocol.frames import DAMAGED, FRAME, NOT_SMALL, FrameReader, FrameWriter
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


def echo(case, reader_size=2 * 1048):
    """Return the answer to a case: each good frame field by field, ERR_CHECKSUM to damaged ones,
    `waiting` after each POLL."""
    reader, writer, words = FrameReader(reader_size), FrameWriter(60_000), array("i", [0, 0])

    def drain():
        while kind := reader.poll():
            if kind == DAMAGED:
                assert writer.ack(reader, messages.ERR_CHECKSUM, False)
                continue
            writer.begin(reader.type, reader)
            length = reader.length
            for at in range(0, length - 3, 4):
                reader.copy_i32_to(at, words, 1)
                writer.put_i32s_from(words, 1, 1)
            at = length & ~3
            if length & 2:
                writer.u16(reader.u16(at) if length & 1 else reader.i16(at))
            if length & 1:
                writer.u8(reader.u8(length - 1))
            assert writer.end()

    at = end = 0
    for step in case.steps:
        if step > 0:
            end += step
            while at < end:
                if not (taken := reader.feed(case.stream, at, end - at)):
                    drain()
                    taken = reader.feed(case.stream, at, end - at)
                    assert taken
                at += taken
            continue
        drain()
        if step == ABANDON:
            reader.drop_partial()
            drain()
        else:
            writer.begin(WAITING, None)
            writer.u16(reader.waiting)
            assert writer.end()
    drain()
    out = bytearray(60_000)
    return bytes(out[: writer.take(out, len(out))])


def found(stream, reader=None):
    """Return everything that the reader finds in a stream given at once: (FRAME or DAMAGED, ID,
    type, payload)."""
    reader = reader or FrameReader(70_000)
    assert reader.feed(stream, 0, len(stream)) == len(stream)
    events = []
    while kind := reader.poll():
        number = bytes(reader.buffer[reader.head + 2 : reader.head + 6])
        payload = (
            bytes(reader.buffer[reader.payload : reader.payload + reader.length])
            if kind == FRAME
            else None
        )
        events.append((kind, int.from_bytes(number, "little"), reader.type, payload))
    return events


@given(cases())
@settings(max_examples=600, deadline=None)
def test_any_stream_in_any_pieces(case):
    assert echo(case) == expected(case)


@given(cases())
@settings(max_examples=100, deadline=None)
def test_the_smallest_buffer_will_do(case):
    assert echo(case, 1048) == expected(case)


# field note 10
HI = bytes.fromhex("44 46 01 00 00 00 01 00 00 00 44 2F")
VIRT_MOVE = bytes.fromhex("44 46 78 56 34 12 01 02 05 00 02 A0 86 01 00 DA 53")
DMX = bytes.fromhex("44 46 78 56 34 12 20 00 04 00 00 01 02 03 BD 78")
REFUSED = bytes.fromhex("44 46 00 00 00 00 01 02 00 00 00 00")


def test_frame_vectors_are_read():
    assert found(HI + VIRT_MOVE + DMX + REFUSED + HI) == [
        (FRAME, 1, messages.MSG_HI, b""),
        (FRAME, 0x1234_5678, messages.MSG_VIRT_MOVE, b"\x02\xa0\x86\x01\x00"),
        (FRAME, 0x1234_5678, messages.MSG_DMX, b"\x00\x01\x02\x03"),
        (DAMAGED, 0, messages.MSG_VIRT_MOVE, None),
        (FRAME, 1, messages.MSG_HI, b""),
    ]


@pytest.mark.parametrize(
    ("dword_acks", "answer"),
    [
        (False, "44 46 01 00 00 00 31 80 02 00 10 00 9C 14"),
        (True, "44 46 01 00 00 00 31 80 04 00 10 00 00 00 EF BE"),
    ],
)
def test_acknowledgements(dword_acks, answer):
    reader, writer, out = FrameReader(), FrameWriter(), bytearray(64)
    request = wire.encode(messages.MSG_MOTOR_MOVE, bytes(5), 1)
    reader.feed(request, 0, len(request))
    assert reader.poll() == FRAME
    assert writer.ack(reader, messages.OK, dword_acks)
    assert bytes(out[: writer.take(out, 64)]) == bytes.fromhex(answer)


def test_back_pressure():
    reader = FrameReader(2 * 1048)
    source = bytearray(1000) + HI * 400
    at = 1000
    frames = 0
    while at < len(source):
        taken = reader.feed(source, at, len(source) - at)
        assert 0 < taken <= 2 * 1048
        at += taken
        while reader.poll():
            frames += 1
    assert frames == 400


_EDGES = [
    sign * 2**bits + more
    for sign in (-1, 1)
    for bits in (7, 8, 15, 16, 24, 29, 30)
    for more in (-1, 0, 1)
]
_EDGES += [0, -(2**31), 2**31 - 1]


@given(
    st.one_of(
        st.binary(min_size=4, max_size=4), st.sampled_from(_EDGES).map(struct.Struct("<i").pack)
    ),
    st.integers(0, 3),
)
@example(struct.pack("<i", 2**30), 1)
@example(struct.pack("<i", -(2**30)), 1)
def test_fields(dword, at):
    reader, words = FrameReader(), array("i", [11, 22, 33])
    frame = wire.encode(0x31, bytes(at) + dword, 1)
    reader.feed(frame, 0, len(frame))
    assert reader.poll() == FRAME
    (unsigned,), (signed,) = struct.unpack("<I", dword), struct.unpack("<i", dword)
    assert reader.u8(at) == dword[0]
    assert reader.u16(at) == unsigned & 0xFFFF
    assert reader.i16(at + 2) == signed >> 16
    assert reader.u30(at) == (unsigned if unsigned < 2**30 else -1)
    index = unsigned & 0x7FFF_FFFF
    assert reader.start_index(at) == (index if index < 2**30 else -1)
    assert reader.i32(at) == (signed if abs(signed) < 2**30 else NOT_SMALL)
    reader.copy_i32_to(at, words, 1)
    assert list(words) == [11, signed, 33]


# One step of writing: begin a frame with these fields, take this many bytes, or forget everything
_field = st.one_of(
    st.tuples(st.just("u8"), st.integers(-128, 255)),
    st.tuples(st.just("u16"), st.integers(-0x8000, 0xFFFF)),
    st.tuples(st.just("u32"), st.integers(-(2**30), 2**30 - 1)),
    st.tuples(st.just("word"), st.integers(-(2**31), 2**31 - 1)),
    st.tuples(st.just("words"), st.lists(st.sampled_from(_EDGES), max_size=12)),
    st.tuples(st.just("text"), st.binary(max_size=1000), st.integers(0, 1036)),
)
_writing = st.lists(
    st.one_of(
        st.tuples(st.just("frame"), st.integers(0, 0xFFFF), st.lists(_field, max_size=5)),
        st.tuples(st.just("take"), st.integers(0, 1500)),
        st.tuples(st.just("forget")),
    ),
    max_size=40,
)
_WIDTHS = {"u8": 1, "u16": 2, "u32": 4, "word": 4}


def _encoded(field):
    if field[0] == "text":
        return field[1][: field[2]].ljust(field[2], b"\0")
    if field[0] == "words":
        return struct.pack(f"<{len(field[1])}i", *field[1])
    width = _WIDTHS[field[0]]
    return (field[1] & (1 << 8 * width) - 1).to_bytes(width, "little")


def _write(writer, field):
    if field[0] == "word":
        writer.put_i32s_from(array("i", [0, field[1]]), 1, 1)
    elif field[0] == "words":
        writer.put_i32s_from(array("i", [5, *field[1], 6]), 1, len(field[1]))
    else:
        getattr(writer, field[0])(*field[1:])


@given(_writing, st.booleans())
@settings(max_examples=300, deadline=None)
def test_writer_holds_whole_frames_or_none(steps, take_inside):
    writer, out = FrameWriter(2000), bytearray(1500)
    held = b""
    for step in steps:
        if step[0] == "take":
            count = writer.take(out, step[1])
            assert bytes(out[:count]) == held[: step[1]]
            held = held[count:]
        elif step[0] == "forget":
            writer.clear()
            held = b""
        else:
            payload = b"".join(map(_encoded, step[2]))
            fits = (
                len(payload) <= messages.LARGEST_PAYLOAD and len(held) + len(payload) + 12 <= 2000
            )
            if len(payload) <= messages.LARGEST_PAYLOAD:
                assert (len(payload) <= writer.room()) == fits
            writer.begin(step[1], None)
            for field in step[2]:
                _write(writer, field)
                if take_inside:
                    count = writer.take(out, 50)
                    assert bytes(out[:count]) == held[:50]
                    held = held[count:]
            if len(payload) <= messages.LARGEST_PAYLOAD:
                assert writer.end() == fits
                if fits:
                    held += wire.encode(step[1], payload)
            else:
                writer.clear()
                held = b""
        assert writer.pending == len(held)


@pytest.mark.parametrize("left", range(14))
def test_the_last_bytes_of_the_buffer(left):
    """A frame without a payload has twelve bytes. With less room the writer writes none of it."""
    writer, out = FrameWriter(2000), bytearray(2000)
    held = b""
    for size in (1000, 2000 - 1000 - left):
        payload = bytes(range(250)) * 4
        payload = payload[: size - 12]
        writer.begin(1, None)
        writer.text(payload, len(payload))
        assert writer.end()
        held += wire.encode(1, payload)
    assert writer.room() == left - 12
    writer.begin(0x203, None)
    assert writer.end() == (left >= 12)
    if left >= 12:
        held += wire.encode(0x203)
    assert writer.pending == len(held)
    assert writer.take(out, 2000) == writer.taken == len(held)
    assert bytes(out[: len(held)]) == held


def test_room_is_that_of_a_payload():
    writer = FrameWriter(4096)
    assert (writer.room(), writer.taken) == (messages.LARGEST_PAYLOAD, 0)
    assert FrameWriter(1048).room() == messages.LARGEST_PAYLOAD


def test_a_cleared_frame_is_not_sent():
    writer, out = FrameWriter(), bytearray(64)
    writer.begin(1, None)
    writer.u8(1)
    writer.clear()
    writer.u8(2)
    assert not writer.end()
    assert writer.take(out, 64) == 0


def test_buffers_below_1048_bytes_are_refused():
    for kind in FrameReader, FrameWriter:
        with pytest.raises(ValueError, match="at least 1048 bytes, not 1047"):
            kind(1047)
