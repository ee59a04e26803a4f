"""Virtual axes: requests, and the description of a rig."""

import struct
from collections.abc import Sequence
from typing import TYPE_CHECKING

from . import codes
from .acks import Ack
from .device import VirtPositions
from .payload import I16, I32, U8, U16, U32, Payload, Request, pack_field

if TYPE_CHECKING:
    from typing_extensions import Self


MSG_VIRT_MOVE = 0x0201


class VirtMove(Request[Ack], number=MSG_VIRT_MOVE, moves=True):
    """Move a virtual motor (1 track, 2 east-west, 3 north-south, 4 pan, 5 tilt, 6 roll) to units ·
    100000."""

    motor: U8
    position: I32


MSG_VIRT_STOP = 0x0202


class VirtStop(Request[Ack], number=MSG_VIRT_STOP, stops=True):
    """Stop a virtual motor."""

    motor: U8


MSG_VIRT_JOG = 0x0203


class VirtJog(Request[Ack], number=MSG_VIRT_JOG, moves=True, jogs=True):
    """Jog a virtual motor; the destination is a step position of its main motor (field note
    9.6)."""

    motor: U8
    speed: U16
    destination: I32

    def stop(self) -> VirtStop:
        return VirtStop(self.motor)


MSG_VIRT_JOG_ON_LINE = 0x0206
_OF_LINE = {  # the virtual motor whose stop ends a jog along this axis
    codes.LINE_X: codes.VIRT_MOTOR_EW,
    codes.LINE_Y: codes.VIRT_MOTOR_NS,
    codes.LINE_Z: codes.VIRT_MOTOR_TRACK,
    codes.LINE_PAN: codes.VIRT_MOTOR_PAN,
    codes.LINE_TILT: codes.VIRT_MOTOR_TILT,
}


class VirtJogOnLine(Request[Ack], number=MSG_VIRT_JOG_ON_LINE, moves=True, jogs=True):
    """Jog along the camera's own axes: 0 X, 1 Y, 2 Z, 3 pan, 4 tilt; speed −10000 to 10000."""

    axis: U8
    speed: I16

    def stop(self) -> VirtStop:
        """VIRT_STOP of the matching virtual motor (field note 9.6)."""
        return VirtStop(_OF_LINE.get(self.axis, 0))


MSG_VIRT_GET_POSITION = 0x0205


class VirtGetPosition(Request[VirtPositions], number=MSG_VIRT_GET_POSITION, keeps_plan=True):
    """Ask for the virtual positions."""


class VirtAimPoint(Payload):
    """Aim at a point, in units · 1000; the device repeats it in its answer (field note 9.7)."""

    enable: U8
    x: I32 = 0
    y: I32 = 0
    z: I32 = 0


MSG_VIRT_AIM_POINT = 0x0207


class SetVirtAimPoint(VirtAimPoint, Request[VirtAimPoint], number=MSG_VIRT_AIM_POINT):
    """The request of that name."""


class VirtualAxis(Payload):
    """One motor of a virtual configuration; motor 0 if the axis is absent (field note 9.2)."""

    motor: U32
    steps_per_unit_milli: U32
    position: I32 = 0


BOOM_TABLE_SIZE = 121
_ARM_AXES = 6


MSG_VIRT_CONFIG = 0x0200


class VirtConfig(Request[Ack], number=MSG_VIRT_CONFIG):
    """Configure the virtual axes; each type has its own data (spec: MSG_VIRT_CONFIG, field notes 2,
    9.2 and 9.3).

    type 0     nothing else
    type 1     six axes, lengths (boom, extension, nodal x, y, z) · 1000, and optionally the table
               and the safe distance
    type 2     two axes: swing and pan, without positions
    type 3, 4  like type 1 without the table; the two lengths of the arm only in type 3
    """

    type: U8 = 0
    axes: Sequence[VirtualAxis] = ()
    lengths: Sequence[int] = ()
    boom_table: Sequence[int] = ()
    safe_distance: int | None = None

    def pack(self) -> bytes:
        if self.type == codes.VIRT_SWING_PAN:
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
            if kind == codes.VIRT_NONE:
                return cls(kind)
            if kind == codes.VIRT_SWING_PAN:
                return cls(
                    kind, tuple(VirtualAxis(*struct.unpack_from("<II", body, at)) for at in (0, 8))
                )
            if kind not in (
                codes.VIRT_BOOM_SWING_TRACK,
                codes.VIRT_Y_SWING_TRACK,
                codes.VIRT_X_Y_Z,
            ):
                raise ValueError(f"VirtConfig: type {kind} is not one of 0 to 4")
            size = len(VirtualAxis(0, 0, 0).pack())
            axes = tuple(
                VirtualAxis.unpack(body[i * size : (i + 1) * size]) for i in range(_ARM_AXES)
            )
            rest = body[_ARM_AXES * size :]
            lengths = struct.unpack_from("<3i" if kind == codes.VIRT_X_Y_Z else "<5i", rest)
            rest = rest[4 * len(lengths) : len(rest) & ~3]
            numbers = struct.unpack(f"<{len(rest) // 4}i", rest)
            table = (
                numbers[:BOOM_TABLE_SIZE]
                if kind == codes.VIRT_BOOM_SWING_TRACK and len(numbers) >= BOOM_TABLE_SIZE
                else ()
            )
            numbers = numbers[len(table) :]
            return cls(kind, axes, lengths, table, numbers[0] if numbers else None)
        except struct.error:
            raise ValueError(f"VirtConfig: {len(data)} bytes are too few for type {kind}") from None
