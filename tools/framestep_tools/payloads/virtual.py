"""Virtual axes: requests, and how a rig is described."""

import struct
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from framestep.protocol import messages

from .acks import Ack
from .codec import I16, I32, U8, U16, U32, Payload, Request, pack_field
from .device import VirtPositions

if TYPE_CHECKING:
    from typing_extensions import Self


@dataclass(frozen=True)
class VirtMove(Request[Ack]):
    """Move a virtual motor (1 track, 2 east-west, 3 north-south, 4 pan, 5 tilt, 6 roll) to units ·
    100000."""

    TYPE = messages.MSG_VIRT_MOVE
    motor: U8
    position: I32


@dataclass(frozen=True)
class VirtStop(Request[Ack]):
    """Stop a virtual motor."""

    TYPE = messages.MSG_VIRT_STOP
    motor: U8


@dataclass(frozen=True)
class VirtJog(Request[Ack]):
    """Jog a virtual motor; the destination is a step position of its main motor (field note
    9.6)."""

    TYPE = messages.MSG_VIRT_JOG
    motor: U8
    speed: U16
    destination: I32


@dataclass(frozen=True)
class VirtJogOnLine(Request[Ack]):
    """Jog along the camera's own axes: 0 X, 1 Y, 2 Z, 3 pan, 4 tilt; speed −10000 to 10000."""

    TYPE = messages.MSG_VIRT_JOG_ON_LINE
    axis: U8
    speed: I16


@dataclass(frozen=True)
class VirtGetPosition(Request[VirtPositions]):
    """Ask for the virtual positions."""

    TYPE = messages.MSG_VIRT_GET_POSITION


@dataclass(frozen=True)
class VirtAimPoint(Payload):
    """Aim at a point, in units · 1000; the device answers with the same (field note 9.7)."""

    TYPE = messages.MSG_VIRT_AIM_POINT
    enable: U8
    x: I32 = 0
    y: I32 = 0
    z: I32 = 0


@dataclass(frozen=True)
class SetVirtAimPoint(VirtAimPoint, Request[VirtAimPoint]):
    """The request of that name."""


@dataclass(frozen=True)
class VirtualAxis(Payload):
    """One motor of a virtual configuration: motor 0 where the axis is absent (field note 9.2)."""

    motor: U32
    steps_per_unit_milli: U32
    position: I32 = 0


BOOM_TABLE_SIZE = 121
_ARM_AXES = 6


@dataclass(frozen=True)
class VirtConfig(Request[Ack]):
    """Configure the virtuals; each type has its own data (spec: MSG_VIRT_CONFIG, field notes 2, 9.2
    and 9.3).

    type 0     nothing else
    type 1     six axes, lengths (boom, extension, nodal x, y, z) · 1000, and if wanted the table
               and the safe distance
    type 2     two axes: swing and pan, without positions
    type 3, 4  as type 1 without the table; the two lengths of the arm only in type 3
    """

    TYPE = messages.MSG_VIRT_CONFIG
    type: int = 0
    axes: Sequence[VirtualAxis] = ()
    lengths: Sequence[int] = ()
    boom_table: Sequence[int] = ()
    safe_distance: int | None = None

    def pack(self) -> bytes:
        if self.type == messages.VIRT_SWING_PAN:
            body = b"".join(
                struct.pack("<II", axis.motor, axis.steps_per_unit_milli) for axis in self.axes
            )
        else:
            body = b"".join(axis.pack() for axis in self.axes)
        numbers = [*self.lengths, *self.boom_table]
        if self.safe_distance is not None:
            numbers.append(self.safe_distance)
        return bytes((self.type,)) + body + pack_field("*i", numbers)

    @classmethod
    def unpack(cls, data: bytes) -> "Self":
        if not data:
            raise ValueError("VirtConfig: 0 bytes are too few, type is not there")
        kind, body = data[0], data[1:]
        try:
            if kind == messages.VIRT_NONE:
                return cls(kind)
            if kind == messages.VIRT_SWING_PAN:
                return cls(
                    kind, tuple(VirtualAxis(*struct.unpack_from("<II", body, at)) for at in (0, 8))
                )
            if kind not in (
                messages.VIRT_BOOM_SWING_TRACK,
                messages.VIRT_Y_SWING_TRACK,
                messages.VIRT_X_Y_Z,
            ):
                raise ValueError(f"VirtConfig: type {kind} is not one of 0 to 4")
            size = len(VirtualAxis(0, 0, 0).pack())
            axes = tuple(
                VirtualAxis.unpack(body[i * size : (i + 1) * size]) for i in range(_ARM_AXES)
            )
            rest = body[_ARM_AXES * size :]
            lengths = struct.unpack_from("<3i" if kind == messages.VIRT_X_Y_Z else "<5i", rest)
            rest = rest[4 * len(lengths) : len(rest) & ~3]
            numbers = struct.unpack(f"<{len(rest) // 4}i", rest)
            table = (
                numbers[:BOOM_TABLE_SIZE]
                if kind == messages.VIRT_BOOM_SWING_TRACK and len(numbers) >= BOOM_TABLE_SIZE
                else ()
            )
            numbers = numbers[len(table) :]
            return cls(kind, axes, lengths, table, numbers[0] if numbers else None)
        except struct.error:
            raise ValueError(f"VirtConfig: {len(data)} bytes are too few for type {kind}") from None
