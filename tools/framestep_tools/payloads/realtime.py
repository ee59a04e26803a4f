"""Uploads, real-time moves and go-motion."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

from framestep.protocol import messages

from .acks import Ack
from .codec import I16, I32, U8, U16, U32, Levels, Payload, Request, Steps

# The high bit of START INDEX: these are the channel's last values, repeat the final one (spec:
# MSG_RT_UPLOAD_MOVE_AXIS)
LAST_SECTION = messages.LAST_SECTION << 16


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
