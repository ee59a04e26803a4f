"""Frames of the DMC v2 protocol on the host's side: checksum, encoder, decoder.

Written apart from the device's own reader and writer (firmware/framestep/protocol), so that each
checks the other. Only the constants are shared.
"""

import struct
from collections.abc import Iterator
from itertools import accumulate
from typing import NamedTuple

from framestep.protocol import messages

MARKER = b"DF"
_HEADER = struct.Struct("<2sIHH")
CHECK_SIZE = 2
OVERHEAD = _HEADER.size + CHECK_SIZE
MAX_PAYLOAD = 0xFFFF


class Frame(NamedTuple):
    """One message as it travels: `id` 0 is an unasked message of the device (field note 1.3)."""

    id: int
    type: int
    payload: bytes

    @property
    def is_ack(self) -> bool:
        """True for an acknowledgement, whose payload is a response code and nothing else."""
        return bool(self.type & messages.MSG_FLAG_ACK)

    @property
    def request_type(self) -> int:
        """The type without the acknowledgement flag."""
        return self.type & ~messages.MSG_FLAG_ACK


def checksum(data: bytes | bytearray) -> int:
    """Fletcher-16, K=8, modulus 255: 0 over a whole undamaged message (spec: Computing and
    Validating the Checksum)."""
    return sum(accumulate(data)) % 255 << 8 | sum(data) % 255


def encode(type: int, payload: bytes = b"", id: int = 0) -> bytes:
    """The bytes of one message; ValueError for a payload that the length field cannot hold."""
    if len(payload) > MAX_PAYLOAD:
        raise ValueError(
            f"a payload holds at most {MAX_PAYLOAD} bytes, "
            f"this one has {len(payload)}: send it in sections"
        )
    body = _HEADER.pack(MARKER, id, type, len(payload)) + payload
    sum2, sum1 = divmod(checksum(body), 256)
    check1 = 255 - (sum1 + sum2) % 255
    check2 = 255 - (sum1 + check1) % 255
    return body + bytes((check1, check2))


class FrameDecoder:
    """Finds the frames in a stream of bytes, however it is cut up.

    `skipped` counts bytes that belonged to no good frame and `damaged` the frames with a wrong
    checksum. After either the search goes on at the byte behind the marker, so that a good frame
    inside a damaged one is found. An announced payload of more than `max_payload` bytes is taken
    for noise.
    """

    def __init__(self, max_payload: int = 4096):
        self.max_payload = max_payload
        self.skipped = 0
        self.damaged = 0
        self._bytes = bytearray()

    @property
    def pending(self) -> int:
        """Bytes of a frame that has begun and not ended."""
        return len(self._bytes)

    def reset(self) -> bytes:
        """Forget a frame that has begun; its bytes."""
        begun = bytes(self._bytes)
        self._bytes.clear()
        return begun

    def feed(self, data: bytes) -> list[Frame]:
        """The frames that these bytes complete."""
        return [frame for _, frame in self.pieces(data) if frame]

    def pieces(self, data: bytes) -> list[tuple[bytes, Frame | None]]:
        """What these bytes complete, in the order of the stream: a frame with its bytes, or None
        with bytes that belong to no frame."""
        self._bytes += data
        return list(self._pieces())

    def _pieces(self) -> Iterator[tuple[bytes, Frame | None]]:
        waiting = self._bytes
        while True:
            start = waiting.find(MARKER)
            if start < 0:
                start = len(waiting) - waiting.endswith(MARKER[:1])
            if start:
                yield self._skip(start), None
            if len(waiting) < _HEADER.size:
                return
            _, id, type, length = _HEADER.unpack_from(waiting)
            if length > self.max_payload:
                yield self._skip(len(MARKER)), None
                continue
            size = length + OVERHEAD
            if len(waiting) < size:
                return
            if checksum(waiting[:size]):
                self.damaged += 1
                yield self._skip(len(MARKER)), None
                continue
            whole = bytes(waiting[:size])
            del waiting[:size]
            yield whole, Frame(id, type, whole[_HEADER.size : -CHECK_SIZE])

    def _skip(self, count: int) -> bytes:
        self.skipped += count
        gone = bytes(self._bytes[:count])
        del self._bytes[:count]
        return gone
