"""Requests about the device, its motors, lights, and general inputs and outputs."""

from dataclasses import dataclass

from framestep.protocol import messages

from .acks import Ack
from .codec import I32, U8, U16, U32, Levels, Request
from .device import Condition, DeviceInfo, Exceeded, InputLevels, Moving, Positions, Status


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
class Home(Request[Ack]):
    """Home motors; none: all that the rig file has set up for it. Only framestep answers (field
    note 4.9)."""

    TYPE = messages.MSG_HOME
    motors: Levels = b""


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
    """Sent by devices only; a request so that tests can send it and check the refusal."""

    TYPE = messages.MSG_MOTOR_HARD_STOP
