"""The line to the device under test: sent and received frames, and their times."""

import time
from typing import Any, NamedTuple

from ..client.wire import Frame, FrameDecoder, encode

_READ = 4096
_GRAIN_S = 1e-6


class Failed(Exception):
    """A check has failed. The text says what was expected and what came."""


class Reply(NamedTuple):
    """The answer to one request: its frame, its code or None, and its delay."""

    frame: Frame
    code: int | None
    after_s: float


class Report(NamedTuple):
    """A message with ID 0, and its time in seconds of the port's clock."""

    time_s: float
    frame: Frame


class Link:
    """Sends frames and bytes, and sorts received messages. `strange` counts answers without a
    request."""

    def __init__(self, port: Any, patience_s: float = 1.0):
        self.port = port
        self.patience_s = patience_s
        self.clock = getattr(port, "clock", time.monotonic)
        self.decoder = FrameDecoder()
        self.reports: list[Report] = []
        self.answers: list[Report] = []
        self.id = 100

    def write(self, data: bytes) -> None:
        """Send raw bytes."""
        self.port.write(data)

    def send(self, type: int, payload: bytes = b"", id: int | None = None) -> int:
        """Send a good frame. Return its ID."""
        if id is None:
            self.id = id = self.id + 1
        self.write(encode(type, payload, id))
        return id

    def pump(self, seconds: float) -> None:
        """Receive messages for some seconds."""
        end = self.clock() + seconds
        while (left := end - self.clock()) > _GRAIN_S:
            self._read(left)

    def _read(self, seconds: float) -> None:
        self.port.timeout = seconds
        data = self.port.read(1)
        self.port.timeout = 0
        if data:
            data += self.port.read(_READ)
        now = self.clock()
        for frame in self.decoder.feed(data):
            (self.answers if frame.id else self.reports).append(Report(now, frame))

    def answer(self, id: int, patience_s: float | None = None) -> Reply | None:
        """Return the first answer with this ID, or None if none comes in time."""
        start = self.clock()
        end = start + (self.patience_s if patience_s is None else patience_s)
        while True:
            for report in self.answers:
                if report.frame.id == id:
                    self.answers.remove(report)
                    return Reply(report.frame, _code(report.frame), report.time_s - start)
            left = end - self.clock()
            if left <= _GRAIN_S:
                return None
            self._read(left)

    def ask(self, type: int, payload: bytes = b"", id: int | None = None) -> Reply:
        """Return the answer to a request. Raises Failed if none comes or it is of another type."""
        reply = self.answer(self.send(type, payload, id))
        if reply is None:
            raise Failed(f"no answer to 0x{type:04X} within {self.patience_s:g} s")
        if reply.frame.request_type != type:
            raise Failed(f"0x{type:04X} was answered with type 0x{reply.frame.type:04X}")
        return reply


def _code(frame: Frame) -> int | None:
    """Return the response code: a WORD, or the low word of a DWORD (devices use both)."""
    if not frame.is_ack:
        return None
    if len(frame.payload) not in (2, 4) or any(frame.payload[2:]):
        raise Failed(f"a response code is a WORD, found the bytes {frame.payload.hex() or 'none'}")
    return int.from_bytes(frame.payload[:2], "little")
