"""Devices with one fault each: a port between host and correct device changes the requests, the
messages and their times, or the edges on the pins. The faults here are mostly in what a device
says; motion_faults.py has the others."""

import struct
from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

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


class Fault(NamedTuple):
    """A fault: the subject whose checks should find it, and the behaviour that it gives the
    device."""

    name: str
    subject: str
    behave: Callable[[], Behaviour]


class _Says(Behaviour):
    """`spoil` changes a frame of the device, or drops it (None)."""

    def __init__(self, spoil: "Spoil"):
        self.spoil = spoil

    def said(self, frame: Frame) -> Frame | None:
        return self.spoil(frame)


Spoil = Callable[[Frame], Frame | None]


def says(spoil: Spoil) -> Callable[[], Behaviour]:
    """Return a maker of behaviours that change what the device says."""
    return lambda: _Says(spoil)


def _fault(name: str, subject: str, spoil: Spoil) -> Fault:
    return Fault(name, subject, says(spoil))


def _code(old: int, new: int, type: int = 0):
    def spoil(frame: Frame) -> Frame:
        if (
            frame.is_ack
            and frame.payload[:1] == bytes((old,))
            and (not type or frame.request_type == type)
        ):
            return frame._replace(payload=struct.pack("<H", new))
        return frame

    return spoil


def lost(type: int, report: bool) -> Spoil:
    """Drop the reports, or the answers, of a type."""

    def spoil(frame: Frame) -> Frame | None:
        return None if frame.request_type == type and (frame.id == 0) == report else frame

    return spoil


def data(type: int, change: Callable[[bytes], bytes], report: bool | None = None) -> Spoil:
    """Change the data of messages of a type: of all, of reports, or of answers."""

    def spoil(frame: Frame) -> Frame:
        if frame.type != type or report not in (None, frame.id == 0):
            return frame
        return frame._replace(payload=change(frame.payload))

    return spoil


def _id(change: Callable[[int], int]):
    return lambda frame: frame._replace(id=change(frame.id)) if frame.id else frame


def _time(change: Callable[[int], int]):
    return lambda data: struct.pack("<i", change(struct.unpack("<i", data[:4])[0])) + data[4:]


def _steps(change: Callable[[int], int]):
    return lambda data: (
        data[:4] + struct.pack("<i", change(struct.unpack_from("<i", data, 4)[0])) + data[8:]
    )


_HI = {
    "HI of 50 bytes": lambda d: d[:50],
    "protocol version 1": lambda d: d[:49] + b"\1\0",
    "40 motors": lambda d: d[:35] + b"\x28" + d[36:],
    "600 lights": lambda d: d[:36] + struct.pack("<H", 600) + d[38:],
    "40 outputs": lambda d: d[:38] + b"\x28" + d[39:],
    "40 inputs": lambda d: d[:39] + b"\x28" + d[40:],
    "a name without text": lambda d: bytes(32) + d[32:],
    "an unknown capability": lambda d: d[:47] + b"\1" + d[48:],
}

FAULTS = (
    *(_fault(f"HI: {name}", "framing", data(spec.HI, change)) for name, change in _HI.items()),
    _fault("IDs of 16 bits", "framing", _id(lambda id: id & 0xFFFF)),
    _fault("IDs of 31 bits", "framing", _id(lambda id: id & 0x7FFFFFFF)),
    _fault("no answer to MOTOR_STATUS", "framing", lost(spec.STATUS, False)),
    _fault("unknown types are accepted", "framing", _code(spec.ERR_UNSUPPORTED, spec.OK)),
    _fault("unknown types: general error", "framing",
           _code(spec.ERR_UNSUPPORTED, spec.ERR_GENERAL)),
    _fault("a wrong checksum is accepted", "framing", _code(spec.ERR_CHECKSUM, spec.OK)),
    _fault("a wrong checksum: range", "framing", _code(spec.ERR_CHECKSUM, spec.ERR_RANGE)),
    _fault("range is reported as OK", "numbers", _code(spec.ERR_RANGE, spec.OK)),
    _fault("range: general error", "numbers", _code(spec.ERR_RANGE, spec.ERR_GENERAL)),
    _fault("short messages are accepted", "lengths", _code(spec.ERR_RANGE, spec.OK)),
    *(_fault(f"{spec.NAMES[type]} out of range is accepted", "numbers",
             _code(spec.ERR_RANGE, spec.OK, type))
      for type in (spec.MOVE, spec.STOP, spec.RESET, spec.JOG, spec.CONFIGURE, spec.SET_SPEED,
                   spec.SET_LIMITS)),
    *(_fault(f"{spec.NAMES[type]}: OK is reported as 0", "numbers", _code(spec.OK, 0, type))
      for type in (spec.STOP, spec.RESET, spec.CONFIGURE, spec.SET_SPEED, spec.SET_LIMITS)),
    *(_fault(f"no answer to {spec.NAMES[type]}", "motors", lost(type, False))
      for type in (spec.STOP, spec.STOP_ALL, spec.RESET, spec.JOG, spec.MOVE)),
    _fault("upper limit reported as lower", "motors", _code(spec.ERR_SOFT_UP, spec.ERR_SOFT_LOW)),
    _fault("lower limit reported as upper", "motors", _code(spec.ERR_SOFT_LOW, spec.ERR_SOFT_UP)),
    _fault("a limit is reported as OK", "motors", _code(spec.ERR_SOFT_UP, spec.OK)),
    _fault("moving is reported as range", "motors", _code(spec.ERR_MOVING, spec.ERR_RANGE)),
    _fault("never moving", "motors", data(spec.STATUS, lambda d: bytes(5))),
    _fault("moving bits of the next motor", "motors",
           data(spec.STATUS, lambda d: bytes((d[0] << 1 & 0xFF,)) + d[1:])),
    _fault("unsigned positions", "motors", data(spec.GET_POSITION, _steps(abs))),
    _fault("positions of 16 bits", "motors",
           data(spec.GET_POSITION, _steps(lambda p: (p + 0x8000 & 0xFFFF) - 0x8000))),
    _fault("positions a step off below zero", "motors",
           data(spec.GET_POSITION, _steps(lambda p: p - (p < 0)))),
    _fault("no positions unasked", "motors", lost(spec.GET_POSITION, True)),
    _fault("positions unasked are all zero", "motors",
           data(spec.GET_POSITION, _steps(lambda p: 0), True)),
    _fault("MOVE TIME a frame early", "uploads",
           data(spec.GET_POSITION, _time(lambda t: t - 1000))),
    _fault("MOVE TIME in frames", "uploads", data(spec.GET_POSITION, _time(lambda t: t // 1000))),
    _fault("upload: range reported as OK", "uploads", _code(spec.ERR_RANGE, spec.OK)),
    _fault("not in position reported as OK", "uploads", _code(spec.ERR_NOT_IN_POSITION, spec.OK)),
    _fault("no answer to UPLOAD_END", "uploads", lost(spec.UPLOAD_END, False)),
    _fault("no answer to AXIS", "uploads", lost(spec.AXIS, False)),
    _fault("no RT_END", "runs", lost(spec.END, True)),
    _fault("reports a frame late", "runs",
           data(spec.GET_POSITION, _time(lambda t: t + 1000), True)),
    _fault("reports without positions", "runs",
           data(spec.GET_POSITION, _steps(lambda p: 0), True)),
    _fault("reports 3 steps off", "runs", data(spec.GET_POSITION, _steps(lambda p: p + 3), True)),
    _fault("no frame is reported", "runs", lost(spec.GET_POSITION, True)),
    _fault("GO too early is accepted", "runs", _code(spec.ERR_NOT_IN_POSITION, spec.OK)),
    _fault("a pre-roll past a limit: range", "runs", _code(spec.ERR_PREROLL, spec.ERR_RANGE)),
    _fault("during a run: OK", "runs", _code(spec.ERR_MOVING, spec.OK)),
)  # fmt: skip
