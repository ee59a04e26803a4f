"""Faults of motors that move together: coupled ones, and the motors of an arm."""

import collections
import struct
from collections.abc import Callable

from framestep_tools.client.wire import Frame
from framestep_tools.conform import spec

from .fault_proxy import Behaviour, asked, field
from .faults import Fault

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
    return asked(spec.CONFIGURE, field("BB", 1, change))


def _not_of_motor_2(payload: bytes) -> bytes | None:
    return None if payload[:1] == _byte(2) else payload


FAULTS = tuple(
    Fault(name, subject, behave)
    for name, subject, behave in (
        ("the boom counts downward", "arms", _config(_set(1, lambda spu: -spu), 1)),
        ("the swing counts to the other side", "arms", _config(_set(4, lambda spu: -spu), 1, 3)),
        ("a boom a tenth too long", "arms", _config(_set(_BOOM, lambda n: n * 11 // 10), 1)),
        ("the extension is left out", "arms", _config(_set(_EXT, lambda n: 0), 1, 3)),
        ("`pos` is ignored", "arms", _config(_no_poses, 1, 3, 4)),
        ("the boom table is ignored", "arms",
         _config(lambda f: f[:_TABLE] if len(f) > _TABLE else f, 1)),
        ("a column is taken for a boom", "arms", _OtherType),
        ("X and Z are exchanged", "arms",
         _config(lambda f: f[6:9] + f[3:6] + f[:3] + f[9:], 4)),
        ("the pan of swing-pan turns twice as far", "arms",
         _config(_set(3, lambda spu: spu // 2), 2)),
        ("the nodal offset is ignored", "arms", _config(_nodal(lambda n: [0, 0, 0], 18), 4)),
        ("the nodal offset has y and z exchanged", "arms",
         _config(_nodal(lambda n: [n[0], n[2], n[1]], 18), 4)),
        ("the safe distance is ignored", "arms", _config(lambda f: f[:_TYPE_4], 4)),
        ("one motor lags in a virtual move", "arms", lambda: _Lags(3, 20)),
        ("JOG_ON_LINE the other way", "arms",
         asked(spec.VIRT_JOG_ON_LINE, field("Bh", 1, lambda speed: -speed))),
        ("JOG_ON_LINE along the world's axes", "arms", _WorldLine),
        ("what is out of reach is acknowledged", "arms", lambda: _Granted(spec.VIRT_MOVE)),
        ("motors are never coupled", "couples", _flags(lambda f: f & ~_COUPLED)),
        ("couple reversed does not reverse", "couples",
         _flags(lambda f: f & ~_COUPLED | 0x10 if f & _COUPLED else f)),
        ("motors stay coupled", "couples", _StaysCoupled),
        ("the follower lags", "couples", lambda: _Lags(2, 8)),
        ("STOP of the follower is ignored", "couples", asked(spec.STOP, _not_of_motor_2)),
        ("the follower's speed does not count", "couples", lambda: _LeaderOnly(spec.SET_SPEED)),
        ("the follower's limits do not count", "couples", lambda: _LeaderOnly(spec.SET_LIMITS)),
        ("the follower cannot be switched off", "couples",
         _flags(lambda f: f | 1)),
        ("a MOVE of the follower is acknowledged", "couples", lambda: _Granted(spec.MOVE)),
    )
)  # fmt: skip
