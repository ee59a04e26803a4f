"""Frames of the DMC v2 protocol on the host's side: checksum, encoder, decoder.

Written independently of the device's reader and writer (firmware/framestep/protocol), so each
checks the other. They only share constants.
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
    """One message on the line. `id` 0: an unasked message of the device (field note 1.3)."""

    id: int
    type: int
    payload: bytes

    @property
    def is_ack(self) -> bool:
        """Whether this is an acknowledgement; its payload is only a response code."""
        return bool(self.type & messages.MSG_FLAG_ACK)

    @property
    def request_type(self) -> int:
        """Message type without the acknowledgement flag."""
        return self.type & ~messages.MSG_FLAG_ACK


def checksum(data: bytes | bytearray) -> int:
    """Return Fletcher-16, K=8, modulus 255. It is 0 for a whole undamaged message (spec: Computing
    and Validating the Checksum)."""
    return sum(accumulate(data)) % 255 << 8 | sum(data) % 255


def encode(type: int, payload: bytes = b"", id: int = 0) -> bytes:
    """Return the bytes of one message. Raises ValueError for a payload longer than the length field
    allows."""
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
    """Finds the frames in a stream of bytes, however it is divided.

    `skipped` counts bytes outside good frames, `damaged` frames with a wrong checksum. After either
    the search goes on at the byte after the marker, so a good frame inside a damaged one is found.
    An announced payload of more than `max_payload` bytes counts as noise.
    """

    def __init__(self, max_payload: int = 4096):
        self.max_payload = max_payload
        self.skipped = 0
        self.damaged = 0
        self._bytes = bytearray()

    @property
    def pending(self) -> int:
        """Number of bytes of an unfinished frame."""
        return len(self._bytes)

    def reset(self) -> bytes:
        """Drop an unfinished frame. Return its bytes."""
        begun = bytes(self._bytes)
        self._bytes.clear()
        return begun

    def feed(self, data: bytes) -> list[Frame]:
        """Return the frames that these bytes complete."""
        return [frame for _, frame in self.pieces(data) if frame]

    def pieces(self, data: bytes) -> list[tuple[bytes, Frame | None]]:
        """Return what these bytes complete, in the order of the stream.

        Each piece is bytes with their frame, or bytes outside frames with None.
        """
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
