"""Faults of behaviour: the device moves, plays, lights or switches otherwise than requested.

They change the requests that reach a sound device, send requests of their own, hold answers back,
or change what its pins show. The list was made from the specification and the names of its
messages, before these subjects had checks.
"""

import struct
from collections.abc import Callable

from framestep_tools.client.wire import Frame
from framestep_tools.conform import spec
from framestep_tools.judge.trace import Edge

from .fault_proxy import Behaviour
from .fault_proxy import asked as _asked
from .fault_proxy import field as _field
from .faults import Fault

_FPS, _FIRST, _LAST, _PRE, _POST, _SYNC, _BLOOP, _CHANNEL, _BLOOP_MS, _FLAGS = range(10)
_RUN = struct.Struct("<IiiIIBIHHH")


def _run(index: int, change: Callable[[int], int]) -> Callable[[bytes], bytes]:
    return _field("IiiIIBIHHH", index, change)


def _ignored(type: int) -> Callable[[], Behaviour]:
    return _asked(type, lambda payload: None)


class _Late(Behaviour):
    """Unasked messages of a type come late."""

    def __init__(self, type: int, after_s: float, test: Callable[[Frame], bool] = lambda f: True):
        self.type, self.after_s, self.test = type, after_s, test

    def said(self, frame: Frame) -> Frame | None:
        if frame.type == self.type and not frame.id and self.test(frame):
            self.port.tell(frame, self.after_s)
            return None
        return frame


class _Held(Behaviour):
    """A request is acknowledged at once and carried out late."""

    def __init__(self, type: int, after_s: float):
        self.type, self.after_s = type, after_s

    def asked(self, frame: Frame) -> Frame | None:
        if frame.type != self.type:
            return frame
        self.port.ask(spec.Request(frame.type, frame.payload), self.after_s)
        return None


class _Unasked(Behaviour):
    """A rule changes, doubles or drops unasked messages."""

    def __init__(self, type: int, change: Callable[[Frame], Frame | None]):
        self.type, self.change = type, change

    def said(self, frame: Frame) -> Frame | None:
        return self.change(frame) if frame.type == self.type and not frame.id else frame


class _Twice(Behaviour):
    def __init__(self, type: int, unasked: bool):
        self.type, self.unasked = type, unasked

    def asked(self, frame: Frame) -> Frame | None:
        if frame.type == self.type and not self.unasked:
            self.port.ask(spec.Request(frame.type, frame.payload))
        return frame

    def said(self, frame: Frame) -> Frame | None:
        if frame.type == self.type and self.unasked and not frame.id:
            self.port.tell(frame)
        return frame


class _SecondIgnored(Behaviour):
    """Ignores a STOP_ALL soon after another."""

    last = -10.0

    def asked(self, frame: Frame) -> Frame | None:
        if frame.type != spec.STOP_ALL:
            return frame
        soon = self.port.clock() - self.last < 1
        self.last = self.port.clock()
        return None if soon else frame


class _Abrupt(Behaviour):
    """Motors stop at many times their acceleration."""

    def __init__(self) -> None:
        self.speeds: dict[int, bytes] = {}

    def asked(self, frame: Frame) -> Frame | None:
        if frame.type == spec.SET_SPEED and len(frame.payload) == 9:
            self.speeds[frame.payload[0]] = frame.payload
        if frame.type in (spec.STOP, spec.STOP_ALL):
            for payload in self.speeds.values():
                motor, velocity, _ = struct.unpack("<BII", payload)
                self.port.ask(spec.speed(motor, velocity, 400_000))
            for payload in self.speeds.values():
                self.port.ask(spec.Request(spec.SET_SPEED, payload), 0.5)
        return frame


class _Overshoot(Behaviour):
    """A MOVE passes its target and comes back."""

    def __init__(self) -> None:
        self.back: list[bytes] = []

    def asked(self, frame: Frame) -> Frame | None:
        if frame.type == spec.MOVE and len(frame.payload) == 5:
            self.back = [frame.payload]
            return frame._replace(payload=_field("Bi", 1, lambda p: p + 6)(frame.payload))
        return frame

    def said(self, frame: Frame) -> Frame | None:
        if frame.type == spec.STATUS and frame.id and not any(frame.payload[:4]) and self.back:
            payload = self.back.pop()
            self.port.ask(spec.Request(spec.MOVE, payload))
            bit = (1 << payload[0] - 1).to_bytes(4, "little")
            return frame._replace(payload=bit + frame.payload[4:])
        return frame


class _StopsOnlyFirst(Behaviour):
    """STOP_ALL stops motor 1 only."""

    def asked(self, frame: Frame) -> Frame | None:
        if frame.type != spec.STOP_ALL:
            return frame
        self.port.ask(spec.stop(1))
        return None


class _ResetMoves(Behaviour):
    """RESET_POSITION moves the motor as well."""

    def asked(self, frame: Frame) -> Frame | None:
        if frame.type == spec.RESET and len(frame.payload) == 5:
            motor, position = struct.unpack("<Bi", frame.payload)
            self.port.ask(spec.move(motor, position + 3), 0.01)
        return frame


class _NoWait(Behaviour):
    """A run begins by itself as soon as its motors are in position."""

    ready = False

    def asked(self, frame: Frame) -> Frame | None:
        if frame.type == spec.RUN:
            self.ready = True
        if frame.type == spec.GO and not self.ready:
            return None
        return frame

    def said(self, frame: Frame) -> Frame | None:
        if self.ready and frame.type == spec.STATUS and not any(frame.payload[:4]):
            self.ready = False
            self.port.ask(spec.Request(spec.GO))
        return frame


class _NotRepeated(Behaviour):
    """After the last uploaded position of a motor everything is 0."""

    count = 0

    def asked(self, frame: Frame) -> Frame | None:
        if frame.type == spec.BEGIN and len(frame.payload) == 8:
            first, last = struct.unpack("<ii", frame.payload)
            self.count = last - first + 1
        if frame.type == spec.AXIS and len(frame.payload) >= 5:
            index = struct.unpack_from("<I", frame.payload, 1)[0]
            behind = (index & 0x7FFFFFFF) + (len(frame.payload) - 5) // 4
            if index & spec.LAST and behind < self.count:
                zeros = bytes(4 * (self.count - behind))
                return frame._replace(payload=frame.payload + zeros)
        return frame


class _KeepsOldMove(Behaviour):
    """Motors without data in an upload keep the data of the upload before."""

    def __init__(self) -> None:
        self.axes: dict[int, list[bytes]] = {}
        self.fresh: dict[int, list[bytes]] = {}

    def asked(self, frame: Frame) -> Frame | None:
        if frame.type == spec.BEGIN:
            self.axes |= self.fresh
            self.fresh = {}
        if frame.type == spec.AXIS and frame.payload:
            self.fresh.setdefault(frame.payload[0], []).append(frame.payload)
        if frame.type == spec.UPLOAD_END:
            for motor, sections in self.axes.items():
                for section in sections if motor not in self.fresh else ():
                    self.port.ask(spec.Request(spec.AXIS, section))
        return frame


class _EarlyEnd(Behaviour):
    """RT_END comes with the end frame, before the post-roll."""

    last = None
    reported = False

    def asked(self, frame: Frame) -> Frame | None:
        if frame.type == spec.RUN and len(frame.payload) >= 12:
            self.last = struct.unpack_from("<i", frame.payload, 8)[0]
            self.reported = False
        return frame

    def said(self, frame: Frame) -> Frame | None:
        if frame.id:
            return frame
        if frame.type == spec.END:
            return None if self.reported else frame
        if frame.type == spec.GET_POSITION and not self.reported and self.last is not None:
            self.reported = struct.unpack_from("<i", frame.payload)[0] == 1000 * self.last
            if self.reported:
                self.port.tell(Frame(0, spec.END, b""))
        return frame


class _NoEndAfter(Behaviour):
    """No RT_END for an operation of this type, or one that STOP_ALL ended."""

    wanted = True

    def __init__(self, *types: int):
        self.types = types

    def asked(self, frame: Frame) -> Frame | None:
        if frame.type in (spec.RUN, spec.SHOOT, spec.SHOOT2, spec.STOP_ALL):
            self.wanted = frame.type not in self.types
        return frame

    def said(self, frame: Frame) -> Frame | None:
        return None if frame.type == spec.END and not self.wanted else frame


class _HalfReports(Behaviour):
    """Every other whole frame of a run is not reported."""

    def said(self, frame: Frame) -> Frame | None:
        if frame.type == spec.GET_POSITION and not frame.id:
            time = struct.unpack_from("<i", frame.payload)[0]
            if time % 2000 == 0 and time:
                return None
        return frame


class _OncePassMore(Behaviour):
    """After STOP_LOOP a loop plays one pass too many."""

    def __init__(self, seconds: float = 1.6):
        self.seconds = seconds

    def asked(self, frame: Frame) -> Frame | None:
        if frame.type == spec.STOP_LOOP:
            self.port.ask(spec.Request(spec.STOP_LOOP), self.seconds)
            return None
        return frame


class _LoopStopsAtOnce(Behaviour):
    """STOP_LOOP stops at once."""

    def asked(self, frame: Frame) -> Frame | None:
        if frame.type == spec.STOP_LOOP:
            self.port.ask(spec.Request(spec.STOP_ALL))
            return None
        return frame


class _StraightJog(Behaviour):
    """JOG_ALL goes straight to the frame."""

    def asked(self, frame: Frame) -> Frame | None:
        if frame.type == spec.JOG_ALL and len(frame.payload) == 8:
            return frame._replace(type=spec.POSITION_FRAME, payload=frame.payload[4:])
        return frame

    def said(self, frame: Frame) -> Frame | None:
        if frame.id and frame.request_type == spec.POSITION_FRAME:
            return frame._replace(type=frame.type & 0x8000 | spec.JOG_ALL)
        return frame


class _Edges(Behaviour):
    """Changes what the pins show."""

    def __init__(self, change: Callable[[list[Edge]], list[Edge]]):
        self.change = change

    def edges(self, edges: list[Edge]) -> list[Edge]:
        return self.change(edges)


class _LostStep(Behaviour):
    """In each direction a motor loses one step, after so many."""

    def __init__(self, every: int) -> None:
        self.every, self.count = every, 0

    def edges(self, edges: list[Edge]) -> list[Edge]:
        kept = []
        for edge in edges:
            if edge[1] == "m1":
                self.count += 1
                if self.count % self.every == 0:
                    continue
            kept.append(edge)
        return kept


class _Answer(Behaviour):
    """Changes the data of answers to a type."""

    def __init__(self, type: int, change: Callable[[bytes], bytes]):
        self.type, self.change = type, change

    def said(self, frame: Frame) -> Frame | None:
        if frame.type == self.type:
            return frame._replace(payload=self.change(frame.payload))
        return frame


def _swap_runs(payload: bytes) -> bytes:
    if len(payload) < 12:
        return payload
    fps, first, last = struct.unpack_from("<Iii", payload)
    return struct.pack("<Iii", fps, min(first, last), max(first, last)) + payload[12:]


def _exchange(at: int) -> Callable[[bytes], bytes]:
    """Exchange A and B of every pair."""

    def change(payload: bytes) -> bytes:
        out = bytearray(payload)
        for i in range(at, len(out) - 8, 9):
            out[i + 1 : i + 5], out[i + 5 : i + 9] = out[i + 5 : i + 9], out[i + 1 : i + 5]
        return bytes(out)

    return change


def _shifted(signal: str, by_ns: int) -> Callable[[list[Edge]], list[Edge]]:
    return lambda edges: [
        (time + by_ns if name == signal else time, name, value) for time, name, value in edges
    ]


def _renamed(old: str, new: str) -> Callable[[list[Edge]], list[Edge]]:
    names = {old: new, new: old}
    return lambda edges: [(time, names.get(name, name), value) for time, name, value in edges]


def _next_channel(edges: list[Edge]) -> list[Edge]:
    return [
        (time, f"dmx{int(name[3:]) + 1}" if name.startswith("dmx") else name, value)
        for time, name, value in edges
    ]


def _hard_stop(change: Callable[[bytes], bytes | None]) -> Callable[[Frame], Frame | None]:
    def changed(frame: Frame) -> Frame | None:
        payload = change(frame.payload)
        return None if payload is None else frame._replace(payload=payload)

    return changed


def _limits(index: int, change: Callable[[int], int]) -> Callable[[], Behaviour]:
    return _asked(spec.SET_LIMITS, _field("BBiBiB", index, change))


FAULTS = tuple(
    Fault(name, subject, behave)
    for name, subject, behave in (
        # speeds and ramps
        ("ramps twice as steep", "ramps",
         _asked(spec.SET_SPEED, _field("BII", 2, lambda a: 2 * a))),
        ("no ramps", "ramps", _asked(spec.SET_SPEED, _field("BII", 2, lambda a: 400_000))),
        ("a fifth faster than MAX VELOCITY", "ramps",
         _asked(spec.SET_SPEED, _field("BII", 1, lambda v: v * 6 // 5))),
        ("SET_SPEED is ignored", "ramps", _ignored(spec.SET_SPEED)),
        ("STOP acts 0.3 s late", "ramps", lambda: _Held(spec.STOP, 0.3)),
        ("STOP_ALL acts 0.3 s late", "ramps", lambda: _Held(spec.STOP_ALL, 0.3)),
        ("STOP_ALL stops motor 1 only", "ramps", _StopsOnlyFirst),
        ("STOP does not stop", "ramps", _ignored(spec.STOP)),
        ("stops without a ramp", "ramps", _Abrupt),
        ("the second STOP_ALL does nothing", "ramps", _SecondIgnored),
        ("the first STOP_ALL is a hard stop", "ramps", lambda: _Twice(spec.STOP_ALL, False)),
        # single motors
        ("MOVE ends a step short", "motors",
         _asked(spec.MOVE, _field("Bi", 1, lambda p: p - 1))),
        ("MOVE overshoots", "motors", _Overshoot),
        ("the lower limit is ignored", "motors", _limits(1, lambda on: 0)),
        ("the upper limit is ignored", "motors", _limits(3, lambda on: 0)),
        ("the upper limit is a step further", "motors", _limits(4, lambda p: p + 1)),
        ("limits are those of the next motor", "motors",
         _asked(spec.SET_LIMITS, _field("B", 0, lambda m: m % 8 + 1 if 0 < m < 9 else m))),
        ("JOG is always at full speed", "motors",
         _asked(spec.JOG, _field("BHi", 1, lambda s: 10000))),
        ("JOG goes past its destination", "motors",
         _asked(spec.JOG, _field("BHi", 2, lambda p: 2 * p))),
        ("JOG goes the other way", "motors", _asked(spec.JOG, _field("BHi", 2, lambda p: -p))),
        ("RESET_POSITION moves the motor", "motors", _ResetMoves),
        ("a disabled motor moves", "ramps",
         _asked(spec.CONFIGURE, _field("BB", 1, lambda f: f | 1))),
        # uploads
        ("POSITION_FRAME goes to the next frame", "uploads",
         _asked(spec.POSITION_FRAME, _field("i", 0, lambda f: f + 1))),
        ("START INDEX counts from 1", "uploads",
         _asked(spec.AXIS, _field("BI", 1, lambda i: i - 1 if i & 0x7FFFFFFF else i))),
        ("the last position is not repeated", "uploads", _NotRepeated),
        ("an upload does not clear the one before", "uploads", _KeepsOldMove),
        ("JOG_ALL at twice its rate", "ramps",
         _asked(spec.JOG_ALL, _field("Ii", 0, lambda f: 2 * f))),
        ("JOG_ALL leaves the path", "ramps", _StraightJog),
        ("JOG_ALL stops a frame early", "uploads",
         _asked(spec.JOG_ALL, _field("Ii", 1, lambda f: f - 1))),
        # runs
        ("runs 5 % too slow", "runs", _asked(spec.RUN, _run(_FPS, lambda f: f * 95 // 100))),
        ("NTSC rates are rounded", "runs",
         _asked(spec.RUN, _run(_FPS, lambda f: round(f / 1000) * 1000))),
        ("no pre-roll", "runs", _asked(spec.RUN, _run(_PRE, lambda t: 0))),
        ("the pre-roll takes twice as long", "runs",
         _asked(spec.RUN, _run(_PRE, lambda t: 2 * t))),
        ("no post-roll", "runs", _asked(spec.RUN, _run(_POST, lambda t: 0))),
        ("a run does not wait for GO", "runs", _NoWait),
        ("a run begins 0.5 s after GO", "runs", lambda: _Held(spec.GO, 0.5)),
        ("backward runs play forward", "runs", _asked(spec.RUN, _swap_runs)),
        ("runs end a frame early", "runs",
         _asked(spec.RUN, _run(_LAST, lambda f: f - 1 if f > 1 else f))),
        ("runs begin a frame late", "runs", _asked(spec.RUN, _run(_FIRST, lambda f: f + 1))),
        ("RT_END comes 1 s late", "runs", lambda: _Late(spec.END, 1.0)),
        ("RT_END comes before the post-roll", "runs", _EarlyEnd),
        ("RT_END comes twice", "runs", lambda: _Twice(spec.END, True)),
        ("no RT_END after STOP_ALL", "runs", lambda: _NoEndAfter(spec.STOP_ALL)),
        ("every other frame is reported", "runs", _HalfReports),
        ("reports come 0.2 s late", "runs", lambda: _Late(spec.GET_POSITION, 0.2)),
        # loops
        ("a loop ends after one pass", "loops",
         _asked(spec.RUN, _run(_FLAGS, lambda f: f & ~2))),
        ("ping-pong ends after one pass", "loops",
         _asked(spec.RUN, _run(_FLAGS, lambda f: f & ~1))),
        ("ping-pong loops", "loops",
         _asked(spec.RUN, _run(_FLAGS, lambda f: f & ~3 | 2 if f & 1 else f))),
        ("a loop is played as ping-pong", "loops",
         _asked(spec.RUN, _run(_FLAGS, lambda f: f & ~3 | 1 if f & 2 else f))),
        ("every run loops", "runs", _asked(spec.RUN, _run(_FLAGS, lambda f: f | 2))),
        ("STOP_LOOP stops at once", "loops", _LoopStopsAtOnce),
        ("STOP_LOOP is ignored", "loops", _ignored(spec.STOP_LOOP)),
        ("a loop runs once too often", "loops", _OncePassMore),
        # go-motion
        ("half the exposure", "shoot",
         _asked(spec.SHOOT, _field("iBIH", 2, lambda t: t // 2))),
        ("half the exposure of SHOOT_FRAME2", "shoot",
         _asked(spec.SHOOT2, _field("iIhh", 1, lambda t: t // 2))),
        ("DIRECTION is ignored", "shoot", _asked(spec.SHOOT, _field("iB", 1, lambda d: 1))),
        ("BLUR PERCENT is ignored", "shoot",
         _asked(spec.SHOOT, _field("iBIH", 3, lambda b: 1000))),
        ("A and B are exchanged", "shoot", _asked(spec.SHOOT, _exchange(11))),
        ("A and B of SHOOT_FRAME2 are exchanged", "shoot", _asked(spec.SHOOT2, _exchange(12))),
        ("CLOSE ANGLE is ignored", "shoot",
         _asked(spec.SHOOT2, _field("iIhh", 3, lambda a: 360))),
        ("pairs are left out", "shoot", _asked(spec.SHOOT2, lambda p: p[:12])),
        ("the next frame is shot", "shoot",
         _asked(spec.SHOOT, _field("i", 0, lambda f: f + 1))),
        ("no RT_END after SHOOT_FRAME", "shoot", lambda: _NoEndAfter(spec.SHOOT, spec.SHOOT2)),
        ("motors without the blur flag blur", "shoot",
         _asked(spec.CONFIGURE, _field("BB", 1, lambda f: f | 2))),
        # lights and outputs
        ("RAMP is ignored", "lights", _asked(spec.DMX, _field("B", 0, lambda r: 0))),
        ("lights always ramp", "lights", _asked(spec.DMX, _field("B", 0, lambda r: 1))),
        ("START CHANNEL counts from 0", "lights",
         _asked(spec.DMX, _field("BH", 1, lambda c: c + 1))),
        ("uploaded lights play without SYNC DMX", "lights",
         _asked(spec.RUN, _run(_SYNC, lambda s: 1))),
        ("uploaded lights do not play", "lights", _asked(spec.RUN, _run(_SYNC, lambda s: 0))),
        ("outputs are shifted by a bit", "lights",
         _asked(spec.GIO_OUT, _field("I", 0, lambda bits: bits << 1 & 0xFFFFFFFF))),
        ("no bloop", "lights", _asked(spec.RUN, _run(_BLOOP, lambda mask: 0))),
        ("triggers a frame late", "lights",
         _asked(spec.TRIGGERS, _field("II", 1, lambda frame: frame + 1))),
        # pins
        ("a step is lost every 200", "edges", lambda: _LostStep(200)),
        ("a DMX channel off by one", "lights", lambda: _Edges(_next_channel)),
        ("the shutter comes 50 ms late", "shoot",
         lambda: _Edges(_shifted("shutter", 50_000_000))),
        ("shutter and meter are exchanged", "lights",
         lambda: _Edges(_renamed("shutter", "meter"))),
        # inputs, limit switches
        ("inputs are not reported unasked", "inputs",
         lambda: _Unasked(spec.GIO_IN, lambda f: None)),
        ("inputs are inverted", "inputs",
         lambda: _Answer(spec.GIO_IN, lambda d: bytes(b ^ 0xFF for b in d[:1]) + d[1:])),
        ("inputs are reported three times", "inputs", lambda: _Twice(spec.GIO_IN, True)),
        ("HARD_STOP is not sent", "inputs", lambda: _Unasked(spec.HARD_STOP, lambda f: None)),
        ("HARD_STOP: upper and lower are exchanged", "inputs",
         lambda: _Unasked(spec.HARD_STOP, _hard_stop(
             lambda d: bytes((3 - d[0],)) + d[1:] if d[0] in (1, 2) else d))),
        ("HARD_STOP without a motor", "inputs",
         lambda: _Unasked(spec.HARD_STOP, _hard_stop(lambda d: d[:1]))),
        ("HW SET is ignored", "inputs", _limits(5, lambda hw: 0)),
        # virtual axes
        ("virtual positions a tenth", "virtuals",
         _asked(spec.VIRT_MOVE, _field("Bi", 1, lambda p: p // 10))),
        ("virtual axes go the other way", "virtuals",
         _asked(spec.VIRT_MOVE, _field("Bi", 1, lambda p: -p))),
        ("pan and tilt are exchanged", "virtuals",
         _asked(spec.VIRT_MOVE, _field("Bi", 0, lambda m: {4: 5, 5: 4}.get(m, m)))),
        ("VIRT_STOP does not stop", "virtuals", _ignored(spec.VIRT_STOP)),
        ("the aim point is answered switched off", "virtuals",
         lambda: _Answer(spec.AIM, lambda d: b"\0" + d[1:])),
        ("VIRT_GET_POSITION in thousandths", "virtuals",
         lambda: _Answer(spec.VIRT_GET_POSITION, lambda d: b"".join(
             struct.pack("<i", v // 100) for v in struct.unpack("<6i", d[:24])) + d[24:])),
    )
)  # fmt: skip
