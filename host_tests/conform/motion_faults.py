"""Faults of behaviour: the device moves, plays, lights or switches otherwise than requested.

They change the requests that reach a sound device, send requests of their own, hold answers back,
or change what its pins show. The list was made from the specification and the names of its
messages, before these subjects had checks.
"""

import collections
import struct
from collections.abc import Callable

from framestep_tools.client.wire import Frame
from framestep_tools.conform import spec
from framestep_tools.judge.trace import Edge

from .faults import Behaviour, Fault, data, lost, says
from .faults import asked as _asked
from .faults import field as _field

_FPS, _FIRST, _LAST, _PRE, _POST, _SYNC, _BLOOP, _CHANNEL, _BLOOP_MS, _FLAGS = range(10)


def _run(index: int, change: Callable[[int], int]) -> Callable[[], Behaviour]:
    return _changed(spec.RUN, "IiiIIBIHHH", index, change)


def _changed(
    type: int, layout: str, index: int, change: Callable[[int], int]
) -> Callable[[], Behaviour]:
    return _asked(type, _field(layout, index, change))


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


class _Instead(Behaviour):
    """A request is acknowledged, and another one carried out."""

    def __init__(self, type: int, other: spec.Request):
        self.type, self.other = type, other

    def asked(self, frame: Frame) -> Frame | None:
        if frame.type != self.type:
            return frame
        self.port.ask(self.other)
        return None


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


def _limits(index: int, change: Callable[[int], int]) -> Callable[[], Behaviour]:
    return _changed(spec.SET_LIMITS, "BBiBiB", index, change)


# ---- coupled motors, and the motors of an arm

_COUPLED = 0x30
_BOOM, _EXT = 18, 19  # fields of VIRT_CONFIG after the type, in types 1 and 3
_TABLE = 23  # fields of type 1 before its boom table
_TYPE_4 = 21  # fields of type 4: six axes of three, the nodal offset


class _Config(Behaviour):
    """Changes fields of VIRT_CONFIG in these types, if they are complete."""

    def __init__(self, change: Callable[[list[int]], list[int]], *kinds: int):
        self.change, self.kinds = change, kinds

    def asked(self, frame: Frame) -> Frame | None:
        data = frame.payload
        if frame.type != spec.VIRT_CONFIG or data[:1] not in map(_byte, self.kinds):
            return frame
        if len(data) % 4 != 1:
            return frame
        count = (len(data) - 1) // 4
        fields = self.change(list(struct.unpack_from(f"<{count}i", data, 1)))
        return frame._replace(payload=data[:1] + struct.pack(f"<{len(fields)}i", *fields))


def _byte(number: int) -> bytes:
    return bytes((number,))


def _config(change: Callable[[list[int]], list[int]], *kinds: int) -> Callable[[], Behaviour]:
    return lambda: _Config(change, *kinds)


def _set(at: int, change: Callable[[int], int]) -> Callable[[list[int]], list[int]]:
    return lambda fields: [change(v) if i == at else v for i, v in enumerate(fields)]


def _no_poses(fields: list[int]) -> list[int]:
    return [0 if i < 18 and i % 3 == 2 else v for i, v in enumerate(fields)]


def _nodal(change: Callable[[list[int]], list[int]], at: int) -> Callable[[list[int]], list[int]]:
    return lambda fields: fields[:at] + change(fields[at : at + 3]) + fields[at + 3 :]


class _OtherType(Behaviour):
    """Takes a column for a boom: the two layouts have the same fields."""

    def asked(self, frame: Frame) -> Frame | None:
        if frame.type == spec.VIRT_CONFIG and frame.payload[:1] == _byte(3):
            return frame._replace(payload=_byte(1) + frame.payload[1:])
        return frame


class _Lags(Behaviour):
    """While it moves, a motor is some steps behind."""

    def __init__(self, motor: int, answers: int):
        self.at = 4 * motor
        self.before: collections.deque[bytes] = collections.deque(maxlen=answers)

    def said(self, frame: Frame) -> Frame | None:
        if frame.type != spec.GET_POSITION or not frame.id:
            return frame
        data = frame.payload
        self.before.append(data[self.at : self.at + 4])
        behind = self.before[0] if len(self.before) == self.before.maxlen else self.before[-1]
        return frame._replace(payload=data[: self.at] + behind + data[self.at + 4 :])


class _WorldLine(Behaviour):
    """JOG_ON_LINE follows the axes of the world, wherever the camera looks."""

    def asked(self, frame: Frame) -> Frame | None:
        if frame.type != spec.VIRT_JOG_ON_LINE or len(frame.payload) != 3:
            return frame
        line, speed = struct.unpack("<Bh", frame.payload)
        axis, far = {0: 2, 1: 3, 2: 1}.get(line, 4), 2**30 if speed > 0 else -(2**30)
        jog = struct.pack("<BHi", axis, abs(speed), far)
        return frame._replace(type=spec.VIRT_JOG, payload=jog)

    def said(self, frame: Frame) -> Frame | None:
        if frame.id and frame.request_type == spec.VIRT_JOG:
            return frame._replace(type=frame.type & 0x8000 | spec.VIRT_JOG_ON_LINE)
        return frame


class _Granted(Behaviour):
    """Acknowledges a request that it refuses, and moves nothing."""

    def __init__(self, type: int):
        self.type = type

    def said(self, frame: Frame) -> Frame | None:
        if frame.id and frame.request_type == self.type and frame.is_ack:
            return frame._replace(payload=_byte(spec.OK) + frame.payload[1:])
        return frame


class _LeaderOnly(Behaviour):
    """Forgets settings of motor 2 while it is coupled."""

    coupled = False

    def __init__(self, type: int):
        self.type = type

    def asked(self, frame: Frame) -> Frame | None:
        if frame.type == spec.CONFIGURE and frame.payload[:1] == _byte(1):
            self.coupled = bool(frame.payload[1] & _COUPLED)
        dropped = self.coupled and frame.type == self.type and frame.payload[:1] == _byte(2)
        return None if dropped else frame


class _StaysCoupled(Behaviour):
    """Motors that were coupled once remain so."""

    flags = 0

    def asked(self, frame: Frame) -> Frame | None:
        if frame.type == spec.CONFIGURE and frame.payload[:1] == _byte(1):
            self.flags = frame.payload[1] & _COUPLED or self.flags
            return frame._replace(payload=bytes((1, frame.payload[1] | self.flags)))
        return frame


def _flags(change: Callable[[int], int]) -> Callable[[], Behaviour]:
    return _changed(spec.CONFIGURE, "BB", 1, change)


def _not_of_motor_2(payload: bytes) -> bytes | None:
    return None if payload[:1] == _byte(2) else payload


FAULTS = tuple(
    Fault(name, subject, behave)
    for name, subject, behave in (
        # speeds and ramps
        ("ramps twice as steep", "ramps", _changed(spec.SET_SPEED, "BII", 2, lambda a: 2 * a)),
        ("no ramps", "ramps", _changed(spec.SET_SPEED, "BII", 2, lambda a: 400_000)),
        ("a fifth faster than MAX VELOCITY", "ramps",
         _changed(spec.SET_SPEED, "BII", 1, lambda v: v * 6 // 5)),
        ("SET_SPEED is ignored", "ramps", _ignored(spec.SET_SPEED)),
        ("STOP acts 0.3 s late", "ramps", lambda: _Held(spec.STOP, 0.3)),
        ("STOP_ALL acts 0.3 s late", "ramps", lambda: _Held(spec.STOP_ALL, 0.3)),
        ("STOP_ALL stops motor 1 only", "ramps", lambda: _Instead(spec.STOP_ALL, spec.stop(1))),
        ("STOP does not stop", "ramps", _ignored(spec.STOP)),
        ("stops without a ramp", "ramps", _Abrupt),
        ("the second STOP_ALL does nothing", "ramps", _SecondIgnored),
        ("the first STOP_ALL is a hard stop", "ramps", lambda: _Twice(spec.STOP_ALL, False)),
        # single motors
        ("MOVE ends a step short", "motors", _changed(spec.MOVE, "Bi", 1, lambda p: p - 1)),
        ("MOVE overshoots", "motors", _Overshoot),
        ("the lower limit is ignored", "motors", _limits(1, lambda on: 0)),
        ("the upper limit is ignored", "motors", _limits(3, lambda on: 0)),
        ("the upper limit is a step further", "motors", _limits(4, lambda p: p + 1)),
        ("limits are those of the next motor", "motors",
         _changed(spec.SET_LIMITS, "B", 0, lambda m: m % 8 + 1 if 0 < m < 9 else m)),
        ("JOG is always at full speed", "motors", _changed(spec.JOG, "BHi", 1, lambda s: 10000)),
        ("JOG goes past its destination", "motors", _changed(spec.JOG, "BHi", 2, lambda p: 2 * p)),
        ("JOG goes the other way", "motors", _changed(spec.JOG, "BHi", 2, lambda p: -p)),
        ("RESET_POSITION moves the motor", "motors", _ResetMoves),
        ("a disabled motor moves", "ramps", _changed(spec.CONFIGURE, "BB", 1, lambda f: f | 1)),
        # uploads
        ("POSITION_FRAME goes to the next frame", "uploads",
         _changed(spec.POSITION_FRAME, "i", 0, lambda f: f + 1)),
        ("START INDEX counts from 1", "uploads",
         _changed(spec.AXIS, "BI", 1, lambda i: i - 1 if i & 0x7FFFFFFF else i)),
        ("the last position is not repeated", "uploads", _NotRepeated),
        ("an upload does not clear the one before", "uploads", _KeepsOldMove),
        ("JOG_ALL at twice its rate", "ramps", _changed(spec.JOG_ALL, "Ii", 0, lambda f: 2 * f)),
        ("JOG_ALL leaves the path", "ramps", _StraightJog),
        ("JOG_ALL stops a frame early", "uploads",
         _changed(spec.JOG_ALL, "Ii", 1, lambda f: f - 1)),
        # runs
        ("runs 5 % too slow", "runs", _run(_FPS, lambda f: f * 95 // 100)),
        ("NTSC rates are rounded", "runs", _run(_FPS, lambda f: round(f / 1000) * 1000)),
        ("no pre-roll", "runs", _run(_PRE, lambda t: 0)),
        ("the pre-roll takes twice as long", "runs", _run(_PRE, lambda t: 2 * t)),
        ("no post-roll", "runs", _run(_POST, lambda t: 0)),
        ("a run does not wait for GO", "runs", _NoWait),
        ("a run begins 0.5 s after GO", "runs", lambda: _Held(spec.GO, 0.5)),
        ("backward runs play forward", "runs", _asked(spec.RUN, _swap_runs)),
        ("runs end a frame early", "runs", _run(_LAST, lambda f: f - 1 if f > 1 else f)),
        ("runs begin a frame late", "runs", _run(_FIRST, lambda f: f + 1)),
        ("RT_END comes 1 s late", "runs", lambda: _Late(spec.END, 1.0)),
        ("RT_END comes before the post-roll", "runs", _EarlyEnd),
        ("RT_END comes twice", "runs", lambda: _Twice(spec.END, True)),
        ("no RT_END after STOP_ALL", "runs", lambda: _NoEndAfter(spec.STOP_ALL)),
        ("every other frame is reported", "runs", _HalfReports),
        ("reports come 0.2 s late", "runs", lambda: _Late(spec.GET_POSITION, 0.2)),
        # loops
        ("a loop ends after one pass", "loops", _run(_FLAGS, lambda f: f & ~2)),
        ("ping-pong ends after one pass", "loops", _run(_FLAGS, lambda f: f & ~1)),
        ("ping-pong loops", "loops", _run(_FLAGS, lambda f: f & ~3 | 2 if f & 1 else f)),
        ("a loop is played as ping-pong", "loops",
         _run(_FLAGS, lambda f: f & ~3 | 1 if f & 2 else f)),
        ("every run loops", "runs", _run(_FLAGS, lambda f: f | 2)),
        ("STOP_LOOP stops at once", "loops",
         lambda: _Instead(spec.STOP_LOOP, spec.Request(spec.STOP_ALL))),
        ("STOP_LOOP is ignored", "loops", _ignored(spec.STOP_LOOP)),
        ("a loop runs once too often", "loops", lambda: _Held(spec.STOP_LOOP, 1.6)),
        # go-motion
        ("half the exposure", "shoot", _changed(spec.SHOOT, "iBIH", 2, lambda t: t // 2)),
        ("half the exposure of SHOOT_FRAME2", "shoot",
         _changed(spec.SHOOT2, "iIhh", 1, lambda t: t // 2)),
        ("DIRECTION is ignored", "shoot", _changed(spec.SHOOT, "iB", 1, lambda d: 1)),
        ("BLUR PERCENT is ignored", "shoot", _changed(spec.SHOOT, "iBIH", 3, lambda b: 1000)),
        ("A and B are exchanged", "shoot", _asked(spec.SHOOT, _exchange(11))),
        ("A and B of SHOOT_FRAME2 are exchanged", "shoot", _asked(spec.SHOOT2, _exchange(12))),
        ("CLOSE ANGLE is ignored", "shoot", _changed(spec.SHOOT2, "iIhh", 3, lambda a: 360)),
        ("pairs are left out", "shoot", _asked(spec.SHOOT2, lambda p: p[:12])),
        ("the next frame is shot", "shoot", _changed(spec.SHOOT, "i", 0, lambda f: f + 1)),
        ("no RT_END after SHOOT_FRAME", "shoot", lambda: _NoEndAfter(spec.SHOOT, spec.SHOOT2)),
        ("motors without the blur flag blur", "shoot",
         _changed(spec.CONFIGURE, "BB", 1, lambda f: f | 2)),
        # lights and outputs
        ("RAMP is ignored", "lights", _changed(spec.DMX, "B", 0, lambda r: 0)),
        ("lights always ramp", "lights", _changed(spec.DMX, "B", 0, lambda r: 1)),
        ("START CHANNEL counts from 0", "lights", _changed(spec.DMX, "BH", 1, lambda c: c + 1)),
        ("uploaded lights play without SYNC DMX", "lights", _run(_SYNC, lambda s: 1)),
        ("uploaded lights do not play", "lights", _run(_SYNC, lambda s: 0)),
        ("outputs are shifted by a bit", "lights",
         _changed(spec.GIO_OUT, "I", 0, lambda bits: bits << 1 & 0xFFFFFFFF)),
        ("no bloop", "lights", _run(_BLOOP, lambda mask: 0)),
        ("triggers a frame late", "lights",
         _changed(spec.TRIGGERS, "II", 1, lambda frame: frame + 1)),
        # pins
        ("a step is lost every 200", "edges", lambda: _LostStep(200)),
        ("a DMX channel off by one", "lights", lambda: _Edges(_next_channel)),
        ("the shutter comes 50 ms late", "shoot", lambda: _Edges(_shifted("shutter", 50_000_000))),
        ("shutter and meter are exchanged", "lights", lambda: _Edges(_renamed("shutter", "meter"))),
        # inputs, limit switches
        ("inputs are not reported unasked", "inputs",
         says(lost(spec.GIO_IN, report=True))),
        ("inputs are inverted", "inputs",
         says(data(spec.GIO_IN, lambda d: bytes(b ^ 0xFF for b in d[:1]) + d[1:]))),
        ("inputs are reported three times", "inputs", lambda: _Twice(spec.GIO_IN, True)),
        ("HARD_STOP is not sent", "inputs", says(lost(spec.HARD_STOP, report=True))),
        ("HARD_STOP: upper and lower are exchanged", "inputs",
         says(data(spec.HARD_STOP,
                   lambda d: bytes((3 - d[0],)) + d[1:] if d[0] in (1, 2) else d))),
        ("HARD_STOP without a motor", "inputs",
         says(data(spec.HARD_STOP, lambda d: d[:1]))),
        ("HW SET is ignored", "inputs", _limits(5, lambda hw: 0)),
        # virtual axes
        ("virtual positions a tenth", "virtuals",
         _changed(spec.VIRT_MOVE, "Bi", 1, lambda p: p // 10)),
        ("virtual axes go the other way", "virtuals",
         _changed(spec.VIRT_MOVE, "Bi", 1, lambda p: -p)),
        ("pan and tilt are exchanged", "virtuals",
         _changed(spec.VIRT_MOVE, "Bi", 0, lambda m: {4: 5, 5: 4}.get(m, m))),
        ("VIRT_STOP does not stop", "virtuals", _ignored(spec.VIRT_STOP)),
        ("the aim point is answered switched off", "virtuals",
         says(data(spec.AIM, lambda d: b"\0" + d[1:]))),
        ("VIRT_GET_POSITION in thousandths", "virtuals",
         says(data(spec.VIRT_GET_POSITION, lambda d: b"".join(
             struct.pack("<i", v // 100) for v in struct.unpack("<6i", d[:24])) + d[24:]))),
        # motors that move together
        ("the boom counts downward", "arms", _config(_set(1, lambda spu: -spu), 1)),
        ("the swing counts to the other side", "arms", _config(_set(4, lambda spu: -spu), 1, 3)),
        ("a boom a tenth too long", "arms", _config(_set(_BOOM, lambda n: n * 11 // 10), 1)),
        ("the extension is left out", "arms", _config(_set(_EXT, lambda n: 0), 1, 3)),
        ("`pos` is ignored", "arms", _config(_no_poses, 1, 3, 4)),
        ("the boom table is ignored", "arms",
         _config(lambda f: f[:_TABLE] if len(f) > _TABLE else f, 1)),
        ("a column is taken for a boom", "arms", _OtherType),
        ("X and Z are exchanged", "arms", _config(lambda f: f[6:9] + f[3:6] + f[:3] + f[9:], 4)),
        ("the pan of swing-pan turns twice as far", "arms",
         _config(_set(3, lambda spu: spu // 2), 2)),
        ("the nodal offset is ignored", "arms", _config(_nodal(lambda n: [0, 0, 0], 18), 4)),
        ("the nodal offset has y and z exchanged", "arms",
         _config(_nodal(lambda n: [n[0], n[2], n[1]], 18), 4)),
        ("the safe distance is ignored", "arms", _config(lambda f: f[:_TYPE_4], 4)),
        ("one motor lags in a virtual move", "arms", lambda: _Lags(3, 20)),
        ("JOG_ON_LINE the other way", "arms",
         _changed(spec.VIRT_JOG_ON_LINE, "Bh", 1, lambda speed: -speed)),
        ("JOG_ON_LINE along the world's axes", "arms", _WorldLine),
        ("what is out of reach is acknowledged", "arms", lambda: _Granted(spec.VIRT_MOVE)),
        ("motors are never coupled", "couples", _flags(lambda f: f & ~_COUPLED)),
        ("couple reversed does not reverse", "couples",
         _flags(lambda f: f & ~_COUPLED | 0x10 if f & _COUPLED else f)),
        ("motors stay coupled", "couples", _StaysCoupled),
        ("the follower lags", "couples", lambda: _Lags(2, 8)),
        ("STOP of the follower is ignored", "couples", _asked(spec.STOP, _not_of_motor_2)),
        ("the follower's speed does not count", "couples", lambda: _LeaderOnly(spec.SET_SPEED)),
        ("the follower's limits do not count", "couples", lambda: _LeaderOnly(spec.SET_LIMITS)),
        ("the follower cannot be switched off", "couples", _flags(lambda f: f | 1)),
        ("a MOVE of the follower is acknowledged", "couples", lambda: _Granted(spec.MOVE)),
    )
)  # fmt: skip
