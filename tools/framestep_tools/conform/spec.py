"""Numbers of the specification, by its sections, and hand-packed requests."""

import struct
from typing import NamedTuple

HI, DMX, GIO_OUT, GIO_IN, GIO_CAM = 0x01, 0x20, 0x21, 0x22, 0x23
STATUS, MOVE, STOP, STOP_ALL, GET_POSITION = 0x30, 0x31, 0x32, 0x33, 0x34
RESET, JOG, CONFIGURE, SET_SPEED, SET_LIMITS = 0x35, 0x36, 0x37, 0x38, 0x39
HARD_STOP = 0x3A
BEGIN, AXIS, UPLOAD_DMX, UPLOAD_END, TRIGGERS = 0x100, 0x101, 0x102, 0x103, 0x104
POSITION_FRAME, RUN, SHOOT, GO, END = 0x110, 0x111, 0x112, 0x113, 0x114
SHOOT2, STOP_LOOP, JOG_ALL = 0x115, 0x116, 0x120
VIRT_CONFIG, VIRT_MOVE, VIRT_STOP, VIRT_JOG = 0x200, 0x201, 0x202, 0x203
VIRT_GET_POSITION, VIRT_JOG_ON_LINE, AIM = 0x205, 0x206, 0x207

OK, ERR_CHECKSUM, ERR_MOVING, ERR_UNSUPPORTED, ERR_RANGE = 0x10, 0x11, 0x12, 0x13, 0x14
ERR_GENERAL, ERR_NOT_IN_POSITION, ERR_PREROLL, ERR_POSTROLL = 0x15, 0x16, 0x17, 0x18
ERR_SOFT_UP, ERR_SOFT_LOW, ERR_HARD_UP, ERR_HARD_LOW = 0x20, 0x21, 0x22, 0x23
CODES = (*range(0x10, 0x1A), *range(0x20, 0x24))

CAN_RUN, CAN_SHOOT, CAN_VIRTUAL, CAN_AIM = 0x01, 0x02, 0x3C, 0x40
CAN_SHOOT2, CAN_COUPLE, CAN_LOOP, CAN_CAMERA = 0x80, 0x100, 0x200, 0x400
PING_PONG, LOOP = 1, 2
LAST = 0x8000_0000

NAMES = {
    number: name
    for name, number in list(globals().items())
    if isinstance(number, int) and name.isupper() and number < 0x300
    and not name.startswith(("OK", "ERR", "CAN", "LOOP", "PING"))
}  # fmt: skip


class Request(NamedTuple):
    """A request's type and payload."""

    type: int
    payload: bytes = b""


def move(motor: int, position: int) -> Request:
    """Return MSG_MOTOR_MOVE."""
    return Request(MOVE, struct.pack("<Bi", motor, position))


def reset(motor: int, position: int) -> Request:
    """Return MSG_MOTOR_RESET_POSITION."""
    return Request(RESET, struct.pack("<Bi", motor, position))


def jog(motor: int, speed: int, destination: int) -> Request:
    """Return MSG_MOTOR_JOG."""
    return Request(JOG, struct.pack("<BHi", motor, speed, destination))


def stop(motor: int) -> Request:
    """Return MSG_MOTOR_STOP."""
    return Request(STOP, bytes((motor,)))


def configure(motor: int, flags: int) -> Request:
    """Return MSG_MOTOR_CONFIGURE."""
    return Request(CONFIGURE, bytes((motor, flags)))


def speed(motor: int, velocity: int, acceleration: int) -> Request:
    """Return MSG_MOTOR_SET_SPEED."""
    return Request(SET_SPEED, struct.pack("<BII", motor, velocity, acceleration))


def limits(motor: int, lower: int | None = None, upper: int | None = None) -> Request:
    """MSG_MOTOR_SET_LIMITS; None leaves a limit off."""
    return Request(
        SET_LIMITS,
        struct.pack(
            "<BBiBiB", motor, lower is not None, lower or 0, upper is not None, upper or 0, 0
        ),
    )


def begin(first: int, last: int) -> Request:
    """Return MSG_RT_UPLOAD_MOVE_BEGIN."""
    return Request(BEGIN, struct.pack("<ii", first, last))


def axis(motor: int, index: int, positions: list[int]) -> Request:
    """Return MSG_RT_UPLOAD_MOVE_AXIS."""
    return Request(AXIS, struct.pack(f"<BI{len(positions)}i", motor, index, *positions))


def frame(number: int) -> Request:
    """Return MSG_RT_POSITION_FRAME."""
    return Request(POSITION_FRAME, struct.pack("<i", number))


def run(
    fps: float, first: int, last: int, pre_ms: int = 200, post_ms: int = 200, flags: int | None = 0
) -> Request:
    """MSG_RT_RUN_MOVE without lights and bloop; flags None: the form of before 2022."""
    head = struct.pack("<IiiIIBIHH", round(fps * 1000), first, last, pre_ms, post_ms, 0, 0, 0, 0)
    return Request(RUN, head if flags is None else head + struct.pack("<H", flags))


def jog_all(fps: float, destination: int) -> Request:
    """Return MSG_RT_JOG_ALL."""
    return Request(JOG_ALL, struct.pack("<Ii", round(fps * 1000), destination))
