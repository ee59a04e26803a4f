"""A port that puts one fault between the host and a correct device: in the requests, in the
messages and their times, or in the pins' edges."""

import struct
from collections.abc import Callable, Iterable
from typing import Any

from framestep_tools.client.wire import Frame, FrameDecoder, encode
from framestep_tools.conform import spec
from framestep_tools.judge.trace import Edge

_OWN = 0xEE00_0000  # IDs of the fault's own requests
_GRAIN_S = 1e-6


class Behaviour:
    """How the device behaves. This one has no fault; a fault overrides the methods it changes.

    `port` is the FaultProxy that uses it.
    """

    port: "FaultProxy"

    def asked(self, frame: Frame) -> Frame | None:
        """Return the request for the device. None: acknowledge it, and send the device none."""
        return frame

    def said(self, frame: Frame) -> Frame | None:
        """Return the message for the host. None: send none."""
        return frame

    def edges(self, edges: list[Edge]) -> list[Edge]:
        """Return the edges that the judge sees on the pins."""
        return edges


class FaultProxy:
    """A port that passes another port's data on, with a behaviour's changes."""

    def __init__(self, port: Any, behaviour: Behaviour):
        self.port = port
        self.clock = port.clock
        self.timeout: float | None = 1.0
        self.behaviour = behaviour
        behaviour.port = self
        self._decoder = FrameDecoder()
        self._out = bytearray()
        self._own = _OWN
        self._to_host: list[tuple[float, Frame]] = []
        self._to_device: list[tuple[float, Frame]] = []

    # ---- for a fault

    def tell(self, frame: Frame, after_s: float = 0) -> None:
        """Send this frame to the host, `after_s` from now."""
        self._to_host.append((self.clock() + after_s, frame))

    def ask(self, request: spec.Request, after_s: float = 0) -> None:
        """Send the fault's own request; the host does not see the answer."""
        self._own += 1
        self._to_device.append((self.clock() + after_s, Frame(self._own, *request)))
        if not after_s:
            self._due()

    # ---- a port

    def write(self, data: bytes) -> int:
        """Pass requests on as the fault changes them. Data that are not whole, valid frames pass
        unchanged."""
        decoder = FrameDecoder()
        frames = list(decoder.feed(data))
        if decoder.skipped or decoder.pending or not frames:
            return self.port.write(data)
        for frame in frames:
            asked = self.behaviour.asked(frame)
            if asked is None:
                self.tell(Frame(frame.id, frame.type | 0x8000, bytes((spec.OK, 0))))
            else:
                self.port.write(encode(asked.type, asked.payload, asked.id))
        return len(data)

    def read(self, size: int = 1) -> bytes:
        """Return the device's messages as the fault changes them; meanwhile send frames now due."""
        end = self.clock() + (self.timeout or 0)
        while True:
            self._due()
            if len(self._out) >= size:
                break
            now = self.clock()
            if now >= end - _GRAIN_S:
                break
            self._take(max(0.0, min((end, *self._times())) - now))
        if self.timeout == 0:
            self._take(0)
            self._due()
        taken = bytes(self._out[:size])
        del self._out[:size]
        return taken

    def _times(self) -> Iterable[float]:
        return [time for time, _ in self._to_host + self._to_device]

    def _take(self, seconds: float) -> None:
        self.port.timeout = seconds
        data = self.port.read(1)
        self.port.timeout = 0
        data += self.port.read(4096)
        for frame in self._decoder.feed(data):
            if frame.id & 0xFFFF_0000 == _OWN:
                continue
            if said := self.behaviour.said(frame):
                self._out += encode(said.type, said.payload, said.id)

    def _due(self) -> None:
        now = self.clock() + _GRAIN_S
        for time, frame in [one for one in self._to_device if one[0] <= now]:
            self._to_device.remove((time, frame))
            self.port.write(encode(frame.type, frame.payload, frame.id))
        for time, frame in [one for one in self._to_host if one[0] <= now]:
            self._to_host.remove((time, frame))
            self._out += encode(frame.type, frame.payload, frame.id)


def field(layout: str, index: int, change: Callable[[int], int]) -> Callable[[bytes], bytes]:
    """Change one field of a payload that is long enough."""
    form = struct.Struct("<" + layout)

    def changed(payload: bytes) -> bytes:
        if len(payload) < form.size:
            return payload
        fields = list(form.unpack_from(payload))
        fields[index] = change(fields[index])
        return form.pack(*fields) + payload[form.size :]

    return changed


class _Asked(Behaviour):
    """Changes or withholds requests of a type."""

    def __init__(self, type: int, change: Callable[[bytes], bytes | None]):
        self.type, self.change = type, change

    def asked(self, frame: Frame) -> Frame | None:
        if frame.type != self.type:
            return frame
        payload = self.change(frame.payload)
        return None if payload is None else frame._replace(payload=payload)


def asked(type: int, change: Callable[[bytes], bytes | None]) -> Callable[[], Behaviour]:
    """Return a maker of behaviours that change requests of this type.

    Where change() returns None, the host gets an acknowledgement and the device no request.
    """
    return lambda: _Asked(type, change)
