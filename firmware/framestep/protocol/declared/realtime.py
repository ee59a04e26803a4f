"""Uploads, real-time moves and go-motion."""

from collections.abc import Sequence
from typing import Annotated

from .acks import Ack
from .payload import I16, I32, U8, U16, U32, Levels, Payload, Request, Steps

MSG_RT_UPLOAD_MOVE_BEGIN = 0x0100


class RtUploadMoveBegin(Request[Ack], number=MSG_RT_UPLOAD_MOVE_BEGIN):
    """Drop the uploaded move and begin one with these scene frames, both included."""

    start_frame: I32
    end_frame: I32


MSG_RT_UPLOAD_MOVE_AXIS = 0x0101


class RtUploadMoveAxis(Request[Ack], number=MSG_RT_UPLOAD_MOVE_AXIS):
    """Positions of a motor, frame by frame from an index; 0 is the start frame. The index' high bit
    marks the last ones: the final one repeats to the end."""

    motor: U8
    start_index: U32
    positions: Steps


MSG_RT_UPLOAD_MOVE_DMX = 0x0102


class RtUploadMoveDmx(Request[Ack], number=MSG_RT_UPLOAD_MOVE_DMX):
    """Levels of a DMX channel, frame by frame from an index, as for a motor."""

    channel: U16
    start_index: U32
    levels: Levels


class Trigger(Payload):
    """Outputs that are on at one frame (its index; 0 is the start frame)."""

    index: U32
    outputs: U32


MSG_RT_UPLOAD_MOVE_TRIGGERS = 0x0104


class RtUploadMoveTriggers(Request[Ack], number=MSG_RT_UPLOAD_MOVE_TRIGGERS):
    """Outputs of the move, frame by frame; outputs outside of the mask do not change."""

    mask: U32
    triggers: Annotated[Sequence[Trigger], Trigger] = ()


MSG_RT_UPLOAD_MOVE_END = 0x0103


class RtUploadMoveEnd(Request[Ack], number=MSG_RT_UPLOAD_MOVE_END):
    """End the upload: it is complete."""


MSG_RT_POSITION_FRAME = 0x0110


class RtPositionFrame(Request[Ack], number=MSG_RT_POSITION_FRAME, moves=True):
    """Move all motors to an uploaded frame."""

    frame: I32


MSG_RT_RUN_MOVE = 0x0111


class RtRunMove(Request[Ack], number=MSG_RT_RUN_MOVE, moves=True):
    """Move to the pre-roll position of a run and wait for RtGo.

    `fps_milli` is frames per second · 1000, times are in ms. Flags: 1 ping-pong, 2 loop, 0x10
    camera at start and stop, 0x20 camera at each frame, between the two shutter angles (0 to 360).
    """

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


class BlurMotor(Payload):
    """Positions of a motor at shutter angles 0 and 360, in steps."""

    motor: U8
    position_a: I32
    position_b: I32


MSG_RT_SHOOT_FRAME = 0x0112


class RtShootFrame(Request[Ack], number=MSG_RT_SHOOT_FRAME, moves=True):
    """Prepare to shoot one frame in motion: direction 1 forward, exposure in ms, blur in tenths of
    a percent."""

    frame: I32
    direction: U8
    exposure_ms: U32
    blur: U16
    motors: Annotated[Sequence[BlurMotor], BlurMotor] = ()


MSG_RT_SHOOT_FRAME2 = 0x0115


class RtShootFrame2(Request[Ack], number=MSG_RT_SHOOT_FRAME2, moves=True):
    """Prepare to shoot one frame in motion; the shutter opens and closes at these angles (field
    note 7.2)."""

    frame: I32
    exposure_ms: U32
    open_angle: I16
    close_angle: I16
    motors: Annotated[Sequence[BlurMotor], BlurMotor] = ()


MSG_RT_GO = 0x0113


class RtGo(Request[Ack], number=MSG_RT_GO, moves=True, keeps_plan=True):
    """Start what RtRunMove or RtShootFrame has prepared."""


MSG_RT_END = 0x0114  # only sent, never requested


class RtEnd(Request[Ack], number=MSG_RT_END, only_sent=True):
    """Report from the device, unasked: the run or the shot is over."""


MSG_RT_STOP_LOOP = 0x0116


class RtStopLoop(Request[Ack], number=MSG_RT_STOP_LOOP):
    """End the loop at its next end point."""


MSG_RT_JOG_ALL = 0x0120


class RtJogAll(Request[Ack], number=MSG_RT_JOG_ALL, moves=True, jogs=True):
    """Jog all motors along the uploaded path toward a frame; fps · 1000."""

    fps_milli: U32
    destination: I32
