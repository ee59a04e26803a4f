"""Frames on the host's side, against the vectors of the field notes and hypothesis."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from framestep_tools.client.wire import OVERHEAD, Frame, FrameDecoder, checksum, encode

# Field notes, section 10: (bytes, id, type, payload)
VECTORS = [
    ("44 46 01 00 00 00 01 00 00 00 44 2F", 1, 0x0001, ""),
    ("44 46 01 00 00 00 31 80 02 00 10 00 9C 14", 1, 0x8031, "10 00"),
    ("44 46 01 00 00 00 31 80 04 00 10 00 00 00 EF BE", 1, 0x8031, "10 00 00 00"),
    ("44 46 78 56 34 12 01 02 05 00 02 A0 86 01 00 DA 53", 0x12345678, 0x0201, "02 A0 86 01 00"),
    ("44 46 78 56 34 12 20 00 04 00 00 01 02 03 BD 78", 0x12345678, 0x0020, "00 01 02 03"),
]

frames = st.builds(
    Frame,
    id=st.integers(0, 0xFFFF_FFFF),
    type=st.integers(0, 0xFFFF),
    payload=st.binary(max_size=60),
)


def spec_checksum(data: bytes) -> int:
    """The specification's C code, byte by byte."""
    sum1 = sum2 = 0
    for byte in data:
        sum1 = (sum1 + byte) % 255
        sum2 = (sum2 + sum1) % 255
    return sum2 << 8 | sum1


@pytest.mark.parametrize(("text", "id", "type", "payload"), VECTORS)
def test_known_frames(text, id, type, payload):
    data, payload = bytes.fromhex(text), bytes.fromhex(payload)
    assert encode(type, payload, id) == data
    assert FrameDecoder().feed(data) == [Frame(id, type, payload)]


def test_a_wrong_checksum_is_no_frame():
    decoder = FrameDecoder()
    assert decoder.feed(bytes.fromhex("44 46 00 00 00 00 01 02 00 00 00 00")) == []
    assert decoder.damaged == 1
    assert decoder.skipped == 12


@given(st.binary(max_size=3000))
def test_checksum_is_the_specifications(data):
    assert checksum(data) == spec_checksum(data)


@given(frames)
def test_check_bytes_make_the_sum_zero(frame):
    assert spec_checksum(encode(frame.type, frame.payload, frame.id)) == 0


@given(st.lists(frames, max_size=6), st.data())
def test_frames_survive_any_cutting(sent, data):
    stream = b"".join(encode(f.type, f.payload, f.id) for f in sent)
    cuts = sorted(data.draw(st.lists(st.integers(0, len(stream)), max_size=8)))
    decoder, got = FrameDecoder(), []
    for begin, end in zip([0, *cuts], [*cuts, len(stream)], strict=True):
        got += decoder.feed(stream[begin:end])
    assert got == sent
    assert decoder.skipped == decoder.damaged == decoder.pending == 0


@given(st.binary(max_size=40), frames, st.binary(max_size=40))
def test_a_frame_is_found_in_noise(before, frame, behind):
    # Noise that ends in a marker could announce a payload; as many bytes as one more frame has
    # settle it.
    decoder = FrameDecoder(max_payload=60)
    stream = before + encode(frame.type, frame.payload, frame.id) + behind + bytes(60 + OVERHEAD)
    assert frame in decoder.feed(stream)


@given(frames, st.data())
def test_every_flipped_bit_is_noticed(frame, data):
    good = bytearray(encode(frame.type, frame.payload, frame.id))
    bit = data.draw(st.integers(0, 8 * len(good) - 1))
    good[bit // 8] ^= 1 << bit % 8
    assert frame not in FrameDecoder().feed(bytes(good))


@given(frames, st.integers(1, 50))
def test_a_good_frame_inside_a_damaged_one_is_found(frame, more):
    inner = encode(frame.type, frame.payload, frame.id)
    outer = encode(0x0101, inner + bytes(more), 7)
    damaged = outer[:-2] + bytes((outer[-2] ^ 0x55, outer[-1]))
    decoder = FrameDecoder()
    assert frame in decoder.feed(damaged)
    assert decoder.damaged >= 1


def test_too_long_a_payload_is_refused():
    with pytest.raises(ValueError, match="65536"):
        encode(1, bytes(65536))
