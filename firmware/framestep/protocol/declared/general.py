"""Requests about the device, its motors, lights, and general inputs and outputs."""

from .acks import Ack
from .device import (
    MSG_MOTOR_HARD_STOP,
    Condition,
    DeviceInfo,
    Exceeded,
    InputLevels,
    Load,
    Moving,
    Positions,
    Status,
)
from .payload import I32, U8, U16, U32, Levels, Request

MSG_HI = 0x0001


class Hi(Request[DeviceInfo], number=MSG_HI, keeps_plan=True):
    """Ask what the device is."""


MSG_DMX = 0x0020


class Dmx(Request[Ack], number=MSG_DMX, keeps_plan=True):
    """Set light levels from a channel (1 to 512) on; ramp 1 fades to them."""

    ramp: U8
    channel: U16
    levels: Levels


MSG_GIO_OUT = 0x0021


class GioOut(Request[Ack], number=MSG_GIO_OUT, keeps_plan=True):
    """Set the general outputs, bit 0 the first."""

    outputs: U32


MSG_GIO_IN = 0x0022


class GioIn(Request[InputLevels], number=MSG_GIO_IN, keeps_plan=True):
    """Ask for the general inputs."""


MSG_GIO_CAM = 0x0023


class GioCam(Request[Ack], number=MSG_GIO_CAM, keeps_plan=True):
    """Test the camera outputs: 1 shutter, 2 meter."""

    flags: U32


MSG_MOTOR_STATUS = 0x0030


class MotorStatus(Request[Status], number=MSG_MOTOR_STATUS, keeps_plan=True):
    """Ask what moves."""


MSG_CONDITION = 0x4600


class GetCondition(Request[Condition], number=MSG_CONDITION, keeps_plan=True):
    """Ask for the board's state, for which the specification has no message; only framestep
    answers."""


MSG_EXCEEDED = 0x4601  # which limit the last move exceeded (field note 5.5)


class GetExceeded(Request[Exceeded], number=MSG_EXCEEDED, keeps_plan=True):
    """Ask which limit the last move exceeded, and for the settings of a motor; only framestep
    answers."""

    motor: U8 | None = None


MSG_HOME = 0x4602  # homes motors (field note 4.9)


class Home(Request[Ack], number=MSG_HOME, moves=True):
    """Home motors; none: all that the rig file has set up for homing. Only framestep answers (field
    note 4.9)."""

    motors: Levels = b""


MSG_LOAD = 0x4603  # how busy the board is (field note 4.10)


class GetLoad(Request[Load], number=MSG_LOAD, keeps_plan=True):
    """Ask how busy the board has been since the last of these requests; only framestep answers
    (field note 4.10)."""


MSG_MOTOR_MOVE = 0x0031


class MotorMove(Request[Moving], number=MSG_MOTOR_MOVE, moves=True):
    """Move a motor to a position in steps."""

    motor: U8
    position: I32


MSG_MOTOR_STOP = 0x0032


class MotorStop(Request[Ack], number=MSG_MOTOR_STOP, stops=True):
    """Slow a motor down to a stop."""

    motor: U8


MSG_MOTOR_STOP_ALL = 0x0033


class MotorStopAll(Request[Ack], number=MSG_MOTOR_STOP_ALL, stops=True):
    """Slow all motors down to a stop; a second one soon after is the hard stop. Flag 1: without
    warning lights."""

    flags: U32 | None = None


MSG_MOTOR_GET_POSITION = 0x0034


class MotorGetPosition(Request[Positions], number=MSG_MOTOR_GET_POSITION, keeps_plan=True):
    """Ask for the motors' positions."""


MSG_MOTOR_RESET_POSITION = 0x0035


class MotorResetPosition(Request[Ack], number=MSG_MOTOR_RESET_POSITION):
    """Define a motor's present position as `position`, in steps; nothing moves."""

    motor: U8
    position: I32


MSG_MOTOR_JOG = 0x0036


class MotorJog(Request[Ack], number=MSG_MOTOR_JOG, moves=True, jogs=True):
    """Jog toward a position, at a speed of 1 (inching) to 10000 (the motor's own velocity and
    acceleration)."""

    motor: U8
    speed: U16
    destination: I32


MSG_MOTOR_CONFIGURE = 0x0037


class MotorConfigure(Request[Ack], number=MSG_MOTOR_CONFIGURE):
    """Set a motor's flags: 1 enabled, 2 blur, and those of field note 3.1."""

    motor: U8
    flags: U8


MSG_MOTOR_SET_SPEED = 0x0038


class MotorSetSpeed(Request[Ack], number=MSG_MOTOR_SET_SPEED):
    """Set a motor's greatest velocity in steps/s and acceleration in steps/s²."""

    motor: U8
    velocity: U32
    acceleration: U32


MSG_MOTOR_SET_LIMITS = 0x0039


class MotorSetLimits(Request[Ack], number=MSG_MOTOR_SET_LIMITS):
    """Set a motor's soft limits in steps, and its limit switch set (0 none, 0x80 swaps high and
    low)."""

    motor: U8
    lower_enable: U8
    lower: I32
    upper_enable: U8
    upper: I32
    limit_set: U8 = 0


class MotorHardStop(Request[Ack], number=MSG_MOTOR_HARD_STOP, only_sent=True):
    """Only sent by devices; a request so that tests can send it and check that it is refused."""
