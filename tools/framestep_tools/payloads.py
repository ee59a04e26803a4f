"""The protocol's messages as typed values: what a request says and what its reply holds.

Each class stands for one message type and lists its data section field by field, in the order of
the specification. `pack` makes the data section, `unpack` reads one; both raise ValueError with the
expected and the found when something does not fit. Motor numbers count from 1. An argument that
ends the list and may be left out of the message is None when it is.

    MotorMove(motor=1, position=-500).pack()        # b'\\x01\\x0c\\xfe\\xff\\xff'
    Status.unpack(b'\\x01\\x00\\x00\\x00\\x00').moving   # [1]
"""

import operator
import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields
from enum import IntEnum
from typing import (
    TYPE_CHECKING,
    Annotated,
    Any,
    ClassVar,
    Generic,
    Protocol,
    TypeVar,
    get_args,
    get_origin,
    get_type_hints,
)

from framestep.protocol import messages

if TYPE_CHECKING:
    from typing_extensions import Self


class Numbers(Protocol):
    """Whole numbers one after the other: a list, a range, a numpy array."""

    def __len__(self) -> int: ...
    def __iter__(self) -> Iterator[Any]: ...
    def __getitem__(self, at: Any, /) -> Any: ...


U8 = Annotated[int, "B"]
U16 = Annotated[int, "H"]
I16 = Annotated[int, "h"]
U32 = Annotated[int, "I"]
I32 = Annotated[int, "i"]
Text32 = Annotated[str, "32s"]
# The rest of the data section, as many as there are
Levels = Annotated[Sequence[int], "*B"]
Steps = Annotated[Numbers, "*i"]

# The high bit of START INDEX: these are the channel's last values, repeat the final one (spec:
# MSG_RT_UPLOAD_MOVE_AXIS)
LAST_SECTION = messages.LAST_SECTION << 16


class Ack(IntEnum):
    """Response codes. A code that the specification does not know gets a name of its own, such as
    UNKNOWN_0x0042."""

    OK = messages.OK
    ERR_CHECKSUM = messages.ERR_CHECKSUM
    ERR_MOVING = messages.ERR_MOVING
    ERR_UNSUPPORTED = messages.ERR_UNSUPPORTED
    ERR_RANGE = messages.ERR_RANGE
    ERR_GENERAL = messages.ERR_GENERAL
    ERR_NOT_IN_POSITION = messages.ERR_NOT_IN_POSITION
    ERR_PREROLL = messages.ERR_PREROLL
    ERR_POSTROLL = messages.ERR_POSTROLL
    ERR_AIM_COD = messages.ERR_AIM_COD
    ERR_SOFT_UP = messages.ERR_SOFT_UP
    ERR_SOFT_LOW = messages.ERR_SOFT_LOW
    ERR_HARD_UP = messages.ERR_HARD_UP
    ERR_HARD_LOW = messages.ERR_HARD_LOW

    @classmethod
    def _missing_(cls, value: object) -> "Self | None":
        if not isinstance(value, int) or not 0 <= value <= 0xFFFF_FFFF:
            return None
        unknown = int.__new__(cls, value)
        unknown._name_, unknown._value_ = f"UNKNOWN_0x{value:04X}", value
        return unknown

    @property
    def words(self) -> str:
        """What it means for whoever asked."""
        return _ACK_WORDS.get(self, "the specification has no such code")

    @classmethod
    def unpack(cls, data: bytes) -> "Ack":
        """Either dialect: the code is a WORD, or a DWORD with the code in its low word (field note
        1.4)."""
        if len(data) not in (2, 4):
            raise ValueError(f"a response code has 2 or 4 bytes, this one has {len(data)}")
        return cls(int.from_bytes(data[:2], "little"))


_ACK_WORDS = {
    Ack.OK: "it is done or begun",
    Ack.ERR_CHECKSUM: "it arrived damaged",
    Ack.ERR_MOVING: "something moves that must stand for it",
    Ack.ERR_UNSUPPORTED: "the device does not know it",
    Ack.ERR_RANGE: (
        "there is no such motor, frame or value, "
        "or it needs more velocity or acceleration than is set"
    ),
    Ack.ERR_GENERAL: (
        "E-stop held, motor off, driver failed, rig file wrong, "
        "or a request missing that goes before"
    ),
    Ack.ERR_NOT_IN_POSITION: "the motors are not where it begins",
    Ack.ERR_PREROLL: "in its pre-roll a motor would pass a limit, or needs a longer one",
    Ack.ERR_POSTROLL: "in its post-roll a motor would pass a limit, or needs a longer one",
    Ack.ERR_AIM_COD: "the aim point is too near",
    Ack.ERR_SOFT_UP: "it leads past the upper soft limit",
    Ack.ERR_SOFT_LOW: "it leads past the lower soft limit",
    Ack.ERR_HARD_UP: "the upper limit switch is hit",
    Ack.ERR_HARD_LOW: "the lower limit switch is hit",
}


_layouts: dict[type, list[tuple[str, Any, bool]]] = {}


def _layout(cls: type) -> list[tuple[str, Any, bool]]:
    """(name, code, may be left out) of each field. The code is struct's, with '*' before it where
    values repeat to the end of the data, or the class of records that do."""
    if cls in _layouts:
        return _layouts[cls]
    hints = get_type_hints(cls, include_extras=True)
    layout = _layouts[cls] = []
    for field in fields(cls):  # type: ignore[arg-type]
        hint, optional = hints[field.name], False
        if get_origin(hint) is not Annotated:  # X | None
            hint, optional = next(a for a in get_args(hint) if a is not type(None)), True
        layout.append((field.name, get_args(hint)[1], optional))
    return layout


@dataclass(frozen=True)
class Payload:
    """The data section of one message."""

    TYPE: ClassVar[int]

    def pack(self) -> bytes:
        """The data section's bytes. Allocates freely, as does everything on the host."""
        parts, left_out = [], None
        for name, code, _ in _layout(type(self)):
            value = getattr(self, name)
            if value is None:
                left_out = left_out or name
                continue
            if left_out:
                raise ValueError(
                    f"{type(self).__name__}: {name} is given, so {left_out} before it is needed too"
                )
            try:
                parts.append(_pack_field(code, value))
            except (struct.error, OverflowError) as error:
                raise ValueError(
                    f"{type(self).__name__}: {name}={value!r} does not fit: {error}"
                ) from None
        return b"".join(parts)

    @classmethod
    def unpack(cls, data: bytes) -> "Self":
        """Read a data section; ValueError where it is not of this layout."""
        said, rest = cls.unpack_known(data)
        if rest:
            raise ValueError(f"{cls.__name__}: {rest} of {len(data)} bytes are left over")
        return said

    @classmethod
    def unpack_known(cls, data: bytes) -> "tuple[Self, int]":
        """Read the known fields of a data section, and how many bytes follow them (field note
        1.8)."""
        values, rest = {}, memoryview(data)
        for name, code, optional in _layout(cls):
            if optional and not rest:
                continue
            try:
                values[name], rest = _unpack_field(code, rest)
            except struct.error:
                raise ValueError(
                    f"{cls.__name__}: {len(data)} bytes are too few, {name} is not there"
                ) from None
        return cls(**values), len(rest)


def _pack_field(code: str, value: Any) -> bytes:
    if isinstance(code, type):
        return b"".join(record.pack() for record in value)
    if code[0] == "*":
        return _pack_values(code[1], value)
    if code[-1] == "s":
        value = value.encode()
        if len(value) > int(code[:-1]):
            raise OverflowError(f"at most {code[:-1]} bytes of UTF-8")
    return struct.pack("<" + code, value)


def _pack_values(code: str, values: Numbers) -> bytes:
    """Values one after the other; OverflowError if one of them is no whole number or outside the
    type's range."""
    try:
        numbers = [operator.index(value) for value in values]
    except TypeError as error:
        raise OverflowError(f"whole numbers are expected: {error}") from None
    try:
        return struct.pack(f"<{len(numbers)}{code}", *numbers)
    except struct.error:
        bits = 8 * struct.calcsize("<" + code)
        least, most = (
            (0, 2**bits - 1) if code.isupper() else (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1)
        )
        raise OverflowError(
            f"{least} to {most} are allowed, found {min(numbers)} to {max(numbers)}"
        ) from None


def _unpack_field(code: str, rest: memoryview) -> tuple[Any, memoryview]:
    if isinstance(code, type):
        size = sum(struct.calcsize("<" + c) for _, c, _ in _layout(code))
        if len(rest) % size:
            raise struct.error
        return tuple(
            code.unpack(bytes(rest[i : i + size])) for i in range(0, len(rest), size)
        ), rest[:0]
    if code[0] == "*":
        count, left = divmod(len(rest), struct.calcsize("<" + code[1]))
        if left:
            raise struct.error
        return struct.unpack(f"<{count}{code[1]}", rest), rest[:0]
    size = struct.calcsize("<" + code)
    (value,) = struct.unpack("<" + code, rest[:size])
    if code[-1] == "s":
        value = value.rstrip(b"\0").decode(errors="replace")
    return value, rest[size:]


R = TypeVar("R")


class Request(Payload, Generic[R]):
    """A message for the device. `REPLY` is the class of its answer; Ack where there is only a
    response code."""

    REPLY: ClassVar[Any]

    def __init_subclass__(cls) -> None:
        for base in cls.__dict__.get("__orig_bases__", ()):
            if get_origin(base) is Request:
                (cls.REPLY,) = get_args(base)


# ---- what the device sends ----------------------------------------------------------------------


@dataclass(frozen=True)
class DeviceInfo(Payload):
    """Who the device is and what it can do (spec: MSG_HI)."""

    TYPE = messages.MSG_HI
    name: Text32
    major: U8
    minor: U8
    revision: U8
    motors: U8
    dmx_channels: U16
    outputs: U8
    inputs: U8
    limit_sets: U8
    upload_frames: U32
    capabilities: U32
    protocol_version: U16 | None = None


@dataclass(frozen=True)
class InputLevels(Payload):
    """General inputs, bit 0 the first (spec: MSG_GIO_IN)."""

    TYPE = messages.MSG_GIO_IN
    levels: U32


@dataclass(frozen=True)
class Status(Payload):
    """What moves: a bit per motor, and whether any DMX channel ramps (spec: MSG_MOTOR_STATUS)."""

    TYPE = messages.MSG_MOTOR_STATUS
    motor_bits: U32
    dmx: U8

    @property
    def moving(self) -> list[int]:
        """The numbers of the motors that move."""
        return [bit + 1 for bit in range(32) if self.motor_bits >> bit & 1]

    @property
    def idle(self) -> bool:
        """True when neither a motor nor a light is on its way."""
        return not self.motor_bits and not self.dmx


@dataclass(frozen=True)
class Moving(Payload):
    """Whether the motor moves (spec: MSG_MOTOR_MOVE); a device of the dmc-lite dialect acknowledges
    instead."""

    TYPE = messages.MSG_MOTOR_MOVE
    moving: U8


@dataclass(frozen=True)
class Positions(Payload):
    """Where the motors are, in steps; `move_time` in thousandths of a frame (spec:
    MSG_MOTOR_GET_POSITION)."""

    TYPE = messages.MSG_MOTOR_GET_POSITION
    move_time: I32
    steps: Steps = ()


@dataclass(frozen=True)
class HardStop(Payload):
    """The device stopped on its own: 0 E-stop, 1 upper limit, 2 lower limit, 100 fault (spec:
    MSG_MOTOR_HARD_STOP)."""

    TYPE = messages.MSG_MOTOR_HARD_STOP
    reason: U8
    motor: U8 | None = None


@dataclass(frozen=True)
class Trust(Payload):
    """How far a motor's position can be trusted: numbers of framestep.motors.positions."""

    state: U8
    reason: U8


@dataclass(frozen=True)
class Condition(Payload):
    """What the specification has no message for: CONDITION_ bits, and how far each position can be
    trusted."""

    TYPE = messages.MSG_CONDITION
    bits: U32
    positions: Annotated[Sequence[Trust], Trust] = ()


@dataclass(frozen=True)
class Exceeded(Payload):
    """What the last move asks too much of: a number of framestep.protocol.messages EXCEEDED_ (0: of
    nothing), the motor, the scene frame, and by how many steps/s or steps/s². Then what is set for
    a motor, that one or the one that was named (bits: SET_), and limit sets with an active switch,
    a bit each; older devices do not tell these."""

    TYPE = messages.MSG_EXCEEDED
    what: U8
    motor: U8
    frame: I32
    by: U32
    of: U8 | None = None
    velocity: U32 | None = None
    acceleration: U32 | None = None
    lower: I32 | None = None
    upper: I32 | None = None
    bits: U8 | None = None
    upper_active: U16 | None = None
    lower_active: U16 | None = None


@dataclass(frozen=True)
class VirtPositions(Payload):
    """Virtual axes in units · 100000, aim point · 1000 where the device has one (spec:
    MSG_VIRT_GET_POSITION)."""

    TYPE = messages.MSG_VIRT_GET_POSITION
    track: I32
    east_west: I32
    north_south: I32
    pan: I32
    tilt: I32
    roll: I32
    aim_enabled: U8 | None = None
    aim_x: I32 | None = None
    aim_y: I32 | None = None
    aim_z: I32 | None = None


# ---- what the host sends ------------------------------------------------------------------------


@dataclass(frozen=True)
class Hi(Request[DeviceInfo]):
    """Ask who is there."""

    TYPE = messages.MSG_HI


@dataclass(frozen=True)
class Dmx(Request[Ack]):
    """Set light levels from a channel (1 to 512) on; ramp 1 fades to them."""

    TYPE = messages.MSG_DMX
    ramp: U8
    channel: U16
    levels: Levels


@dataclass(frozen=True)
class GioOut(Request[Ack]):
    """Set the general outputs, bit 0 the first."""

    TYPE = messages.MSG_GIO_OUT
    outputs: U32


@dataclass(frozen=True)
class GioIn(Request[InputLevels]):
    """Ask for the general inputs."""

    TYPE = messages.MSG_GIO_IN


@dataclass(frozen=True)
class GioCam(Request[Ack]):
    """Test the camera outputs: 1 shutter, 2 meter."""

    TYPE = messages.MSG_GIO_CAM
    flags: U32


@dataclass(frozen=True)
class MotorStatus(Request[Status]):
    """Ask what moves."""

    TYPE = messages.MSG_MOTOR_STATUS


@dataclass(frozen=True)
class GetCondition(Request[Condition]):
    """Ask what the specification has no message for; only framestep answers."""

    TYPE = messages.MSG_CONDITION


@dataclass(frozen=True)
class GetExceeded(Request[Exceeded]):
    """Ask what the last move asked too much of, and what is set for a motor; only framestep
    answers."""

    TYPE = messages.MSG_EXCEEDED
    motor: U8 | None = None


@dataclass(frozen=True)
class MotorMove(Request[Moving]):
    """Move a motor to a position in steps."""

    TYPE = messages.MSG_MOTOR_MOVE
    motor: U8
    position: I32


@dataclass(frozen=True)
class MotorStop(Request[Ack]):
    """Slow a motor down to a stop."""

    TYPE = messages.MSG_MOTOR_STOP
    motor: U8


@dataclass(frozen=True)
class MotorStopAll(Request[Ack]):
    """Slow all motors down to a stop; a second one soon after is the hard stop. Flag 1: without
    warning lights."""

    TYPE = messages.MSG_MOTOR_STOP_ALL
    flags: U32 | None = None


@dataclass(frozen=True)
class MotorGetPosition(Request[Positions]):
    """Ask where the motors are."""

    TYPE = messages.MSG_MOTOR_GET_POSITION


@dataclass(frozen=True)
class MotorResetPosition(Request[Ack]):
    """Call the place where a motor stands `position`, in steps; nothing moves."""

    TYPE = messages.MSG_MOTOR_RESET_POSITION
    motor: U8
    position: I32


@dataclass(frozen=True)
class MotorJog(Request[Ack]):
    """Jog toward a position: speed 1 (inching) to 10000 (the motor's own velocity and
    acceleration)."""

    TYPE = messages.MSG_MOTOR_JOG
    motor: U8
    speed: U16
    destination: I32


@dataclass(frozen=True)
class MotorConfigure(Request[Ack]):
    """Set a motor's flags: 1 enabled, 2 blur, and those of field note 3.1."""

    TYPE = messages.MSG_MOTOR_CONFIGURE
    motor: U8
    flags: U8


@dataclass(frozen=True)
class MotorSetSpeed(Request[Ack]):
    """Set a motor's maxima: velocity in steps/s, acceleration in steps/s²."""

    TYPE = messages.MSG_MOTOR_SET_SPEED
    motor: U8
    velocity: U32
    acceleration: U32


@dataclass(frozen=True)
class MotorSetLimits(Request[Ack]):
    """Set a motor's software limits in steps, and its hardware limit set (0 none, 0x80 swaps high
    and low)."""

    TYPE = messages.MSG_MOTOR_SET_LIMITS
    motor: U8
    lower_enable: U8
    lower: I32
    upper_enable: U8
    upper: I32
    limit_set: U8 = 0


@dataclass(frozen=True)
class MotorHardStop(Request[Ack]):
    """A message that only the device sends by rights; here to see what it answers."""

    TYPE = messages.MSG_MOTOR_HARD_STOP


@dataclass(frozen=True)
class RtUploadMoveBegin(Request[Ack]):
    """Forget the uploaded move and begin one over these scene frames, both included."""

    TYPE = messages.MSG_RT_UPLOAD_MOVE_BEGIN
    start_frame: I32
    end_frame: I32


@dataclass(frozen=True)
class RtUploadMoveAxis(Request[Ack]):
    """Positions of a motor, frame by frame from an index (0 is the start frame; | LAST_SECTION for
    the last ones)."""

    TYPE = messages.MSG_RT_UPLOAD_MOVE_AXIS
    motor: U8
    start_index: U32
    positions: Steps


@dataclass(frozen=True)
class RtUploadMoveDmx(Request[Ack]):
    """Levels of a DMX channel, frame by frame from an index, as for a motor."""

    TYPE = messages.MSG_RT_UPLOAD_MOVE_DMX
    channel: U16
    start_index: U32
    levels: Levels


@dataclass(frozen=True)
class Trigger(Payload):
    """Outputs that are on at one frame (its index, 0 is the start frame)."""

    index: U32
    outputs: U32


@dataclass(frozen=True)
class RtUploadMoveTriggers(Request[Ack]):
    """Outputs of the move, frame by frame; those outside the mask are left alone."""

    TYPE = messages.MSG_RT_UPLOAD_MOVE_TRIGGERS
    mask: U32
    triggers: Annotated[Sequence[Trigger], Trigger] = ()


@dataclass(frozen=True)
class RtUploadMoveEnd(Request[Ack]):
    """The upload is complete."""

    TYPE = messages.MSG_RT_UPLOAD_MOVE_END


@dataclass(frozen=True)
class RtPositionFrame(Request[Ack]):
    """Send all motors to an uploaded frame."""

    TYPE = messages.MSG_RT_POSITION_FRAME
    frame: I32


@dataclass(frozen=True)
class RtRunMove(Request[Ack]):
    """Go to the pre-roll position of a run and wait for RtGo.

    `fps_milli` is frames per second · 1000, times are in ms. Flags: 1 ping-pong, 2 loop, 0x10
    camera at start and stop, 0x20 camera at each frame, between the two shutter angles (0 to 360).
    """

    TYPE = messages.MSG_RT_RUN_MOVE
    fps_milli: U32
    start_frame: I32
    end_frame: I32
    preroll_ms: U32 = 0
    postroll_ms: U32 = 0
    sync_dmx: U8 = 0
    bloop_outputs: U32 = 0
    bloop_channel: U16 = 0
    bloop_ms: U16 = 0
    flags: U16 | None = None
    open_angle: U16 | None = None
    close_angle: U16 | None = None


@dataclass(frozen=True)
class BlurMotor(Payload):
    """Where a motor is at shutter angle 0 and at 360, in steps."""

    motor: U8
    position_a: I32
    position_b: I32


@dataclass(frozen=True)
class RtShootFrame(Request[Ack]):
    """Get ready to shoot one frame in motion: direction 1 forward, exposure in ms, blur in tenths
    of a percent."""

    TYPE = messages.MSG_RT_SHOOT_FRAME
    frame: I32
    direction: U8
    exposure_ms: U32
    blur: U16
    motors: Annotated[Sequence[BlurMotor], BlurMotor] = ()


@dataclass(frozen=True)
class RtShootFrame2(Request[Ack]):
    """Get ready to shoot one frame in motion; the shutter opens and closes at these angles (field
    note 7.2)."""

    TYPE = messages.MSG_RT_SHOOT_FRAME2
    frame: I32
    exposure_ms: U32
    open_angle: I16
    close_angle: I16
    motors: Annotated[Sequence[BlurMotor], BlurMotor] = ()


@dataclass(frozen=True)
class RtGo(Request[Ack]):
    """Start what RtRunMove or RtShootFrame made ready."""

    TYPE = messages.MSG_RT_GO


@dataclass(frozen=True)
class RtEnd(Request[Ack]):
    """Unasked from the device: the run or the shot is over."""

    TYPE = messages.MSG_RT_END


@dataclass(frozen=True)
class RtStopLoop(Request[Ack]):
    """Let the loop end at its next end point."""

    TYPE = messages.MSG_RT_STOP_LOOP


@dataclass(frozen=True)
class RtJogAll(Request[Ack]):
    """Jog all motors along the uploaded path toward a frame; fps · 1000."""

    TYPE = messages.MSG_RT_JOG_ALL
    fps_milli: U32
    destination: I32


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
        return bytes((self.type,)) + body + _pack_field("*i", numbers)

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


def _table(*classes: type[Payload]) -> dict[int, type[Payload]]:
    return {cls.TYPE: cls for cls in classes}


REQUESTS: dict[int, type[Payload]] = _table(*Request.__subclasses__())
# What comes without the acknowledgement flag, asked for or not
REPORTS = _table(
    DeviceInfo,
    InputLevels,
    Status,
    Moving,
    Positions,
    HardStop,
    Condition,
    Exceeded,
    VirtPositions,
    VirtAimPoint,
    RtEnd,
    RtGo,
)
TYPE_NAMES = {
    value: name.removeprefix("MSG_")
    for name, value in vars(messages).items()
    if name.startswith("MSG_") and name != "MSG_FLAG_ACK"
}


def type_name(type: int) -> str:
    """The specification's name of a message type, without its MSG_."""
    return TYPE_NAMES.get(type, f"0x{type:04X}")
