"""Messages from the device, asked for or not."""

from collections.abc import Sequence
from typing import Annotated

from .payload import I32, U8, U16, U32, Payload, Steps, Text32


class DeviceInfo(Payload):
    """What the device is and what it can do (spec: MSG_HI)."""

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


class InputLevels(Payload):
    """General inputs, bit 0 the first (spec: MSG_GIO_IN)."""

    levels: U32


class Status(Payload):
    """What moves: a bit per motor, and whether any DMX channel ramps (spec: MSG_MOTOR_STATUS)."""

    motor_bits: U32
    dmx: U8

    @property
    def moving(self) -> list[int]:
        """The numbers of the motors that move."""
        return [bit + 1 for bit in range(32) if self.motor_bits >> bit & 1]

    @property
    def idle(self) -> bool:
        """Whether neither a motor moves nor a light ramps."""
        return not self.motor_bits and not self.dmx


class Moving(Payload):
    """Whether the motor moves (spec: MSG_MOTOR_MOVE). A device of the dmc-lite dialect acknowledges
    instead."""

    moving: U8


class Positions(Payload):
    """Positions of the motors, in steps; `move_time` in thousandths of a frame (spec:
    MSG_MOTOR_GET_POSITION)."""

    move_time: I32
    steps: Steps = ()


MSG_MOTOR_HARD_STOP = 0x003A  # only sent, never requested


class HardStop(Payload, number=MSG_MOTOR_HARD_STOP):
    """The device stopped on its own: 0 E-stop, 1 upper limit, 2 lower limit, 100 fault (spec:
    MSG_MOTOR_HARD_STOP)."""

    reason: U8
    motor: U8 | None = None


class PositionTrust(Payload):
    """How far a motor's position can be trusted: numbers of framestep.motors.positions."""

    state: U8
    reason: U8


class Condition(Payload):
    """The board's state, for which the specification has no message: CONDITION_ bits, and how far
    each position can be trusted."""

    bits: U32
    positions: Annotated[Sequence[PositionTrust], PositionTrust] = ()


class Load(Payload):
    """How busy the board has been. ms: since the last GetLoad (0: this is the first); interrupt_us,
    passes_us: time in ticks, and in passes of the main loop without ticks (modulo 2^30; 0: not
    measured); late_us: worst lateness of a tick in motion; latest_us: lateness that is a fault;
    queued_ms: the least that a moving motor had queued (1000: never little)."""

    ms: U32
    interrupt_us: U32
    passes_us: U32
    late_us: U16
    latest_us: U16
    queued_ms: U16


class Exceeded(Payload):
    """The limit that the last move exceeded: a number of framestep.protocol.messages EXCEEDED_ (0:
    none), the motor, the scene frame, and by how many steps/s or steps/s². Then the settings of a
    motor, that one or the one in the request (bits: SET_), and limit sets with an active switch, a
    bit each. With EXCEEDED_MEMORY `by` is the bytes needed, `room` the bytes that were free, and
    motor and frame are meaningless. Older devices send fewer fields."""

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
    room: U32 | None = None


class VirtPositions(Payload):
    """Virtual axes in units · 100000, and the aim point · 1000 if the device has one (spec:
    MSG_VIRT_GET_POSITION)."""

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
