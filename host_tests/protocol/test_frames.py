"""The frame reader against a second reader written from the field notes, and the writer against a
list."""

import runpy
import struct
from array import array
from pathlib import Path

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from framestep.protocol import messages
from framestep.protocol.frames import DAMAGED, FRAME, NOT_SMALL, NOTHING, FrameReader, FrameWriter
from framestep_tools.client import wire
from host_tests.protocol import streams

echo = runpy.run_path(str(Path(__file__).parents[1] / "runtime" / "frames_echo.py"))["echo"]


def echoed(case, reader_size=2 * 1048):
    out = bytearray(60_000)
    count = echo(
        case.stream,
        case.steps,
        FrameReader(reader_size),
        FrameWriter(60_000),
        out,
        array("i", [0, 0]),
    )
    assert count >= 0, "the reader took no more bytes, or the writer had no room"
    return bytes(out[:count])


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


@given(streams.cases())
@settings(max_examples=600, deadline=None)
def test_any_stream_in_any_pieces(case):
    assert echoed(case) == streams.expected(case)


@given(streams.cases())
@settings(max_examples=100, deadline=None)
def test_the_smallest_buffer_will_do(case):
    assert echoed(case, 1048) == streams.expected(case)


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


def test_a_good_frame_inside_a_damaged_one():
    damaged = bytearray(wire.encode(0x31, b"x" + HI + b"yz", 7))
    damaged[-1] ^= 1
    assert found(bytes(damaged) + HI) == [
        (DAMAGED, 7, 0x31, None),
        (FRAME, 1, 1, b""),
        (FRAME, 1, 1, b""),
    ]


def test_a_length_that_does_not_fit_is_no_frame():
    too_long = b"DF" + struct.pack("<IHH", 1, 1, messages.LARGEST_PAYLOAD + 1)
    assert found(too_long + HI) == [(FRAME, 1, 1, b"")]


@pytest.mark.parametrize("second", [0x00, 0x44, 0x45, 0x47, 0x80, 0xFF])
def test_half_a_marker_is_no_frame(second):
    """A D with anything but an F after it."""
    reader = FrameReader(2000)
    assert found(bytes((0x44, second)), reader) == []
    assert reader.waiting == (second == 0x44)
    assert found(HI, reader) == [(FRAME, 1, 1, b"")]
    assert reader.waiting == 0


def test_the_largest_frame():
    payload = bytes(range(256)) * 4 + bytes(12)
    frame = wire.encode(0x101, payload, 3)
    assert len(frame) == messages.LARGEST_FRAME
    assert found(frame * 3) == [(FRAME, 3, 0x101, payload)] * 3


def test_a_frame_that_stops_half_way_is_given_up():
    reader = FrameReader()
    assert found(VIRT_MOVE[:12], reader) == []
    assert reader.waiting == 12
    reader.drop_partial()
    assert reader.poll() == NOTHING
    assert reader.waiting == 0
    assert found(HI, reader) == [(FRAME, 1, 1, b"")]


def test_a_good_frame_inside_one_given_up():
    reader = FrameReader()
    assert found(b"DF" + struct.pack("<IHH", 1, 1, 1000) + HI + VIRT_MOVE[:3], reader) == []
    reader.drop_partial()
    assert found(b"", reader) == [(FRAME, 1, 1, b"")]
    assert reader.waiting == 3


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
