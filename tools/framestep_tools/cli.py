"""The command `framestep`: talk to a motion controller from a shell.

A device is named by its path (/dev/ttyACM1) or as socket://HOST:PORT. The controller stops its motors when its host
leaves, so a command that moves something waits until it stands.
"""

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from framestep import words
from framestep.motion.positions import LOST
from framestep.protocol.messages import CONDITION_EXCEEDED

from . import rig_file
from .client import Client, Event, RequestRefused
from .errors import Command, ToolError
from .files import board_data
from .move_file import read_move
from .payloads import (
    Condition,
    Exceeded,
    GetCondition,
    GetExceeded,
    Hi,
    MotorGetPosition,
    MotorJog,
    MotorMove,
    MotorSetSpeed,
    MotorStatus,
    MotorStop,
    MotorStopAll,
    Positions,
    RtEnd,
    RtGo,
    RtRunMove,
    VirtGetPosition,
    VirtMove,
)
from .serve import PtyLink
from .sniffer import read_capture, relay

JOG_REPEAT_S = 0.2  # a jog ends by itself when it is not repeated (field note 4.2)
UPLOAD_WINDOW = 4
STOP_TIME_S = 60.0

app = Command("framestep", help=__doc__, no_args_is_help=False)

Url = Annotated[str, typer.Argument(help="device path or socket://HOST:PORT", metavar="DEVICE", show_default=False)]
Motor = Annotated[int, typer.Argument(help="motor number, from 1", min=1, max=32, show_default=False)]
Steps = Annotated[int, typer.Argument(help="position in steps", min=-(2**31), max=2**31 - 1, show_default=False)]


class VirtualAxisName(StrEnum):
    """Virtual axes 1 to 6 (field note 9.1)."""

    TRACK = "track"
    EW = "ew"
    NS = "ns"
    PAN = "pan"
    TILT = "tilt"
    ROLL = "roll"


@contextmanager
def _stopping_on_interrupt(client: Client) -> Iterator[None]:
    """Ctrl-C stops the rig before it ends the command."""
    try:
        yield
    except KeyboardInterrupt:
        client.request(MotorStopAll())
        client.wait_idle(STOP_TIME_S)
        raise


@app.command()
def status(device: Url) -> None:
    """Say who the device is, where its motors are and what moves."""
    with Client.open(device) as client:
        info = client.request(Hi())
        print(
            f"{info.name}, firmware {info.major}.{info.minor}.{info.revision}: {info.motors} motors, "
            f"{info.dmx_channels} DMX channels, {info.outputs} outputs, {info.inputs} inputs, "
            f"{info.upload_frames} frames, capabilities 0x{info.capabilities:04X}"
        )
        moving = client.request(MotorStatus())
        positions = client.request(MotorGetPosition())
        condition: Condition | None = None
        exceeded: Exceeded | None = None
        try:
            condition = client.request(GetCondition())
            if condition.bits & CONDITION_EXCEEDED:
                exceeded = client.request(GetExceeded())
        except RequestRefused:
            pass
    trust = [""] * info.motors
    if condition:
        trust = [f", {words.trust(each.state, each.reason)}" for each in condition.positions]
    for motor, (steps, how) in enumerate(zip(positions.steps, trust, strict=False), 1):
        print(f"motor {motor}: {steps}{', moving' if motor in moving.moving else ''}{how}")
    if condition is None:
        print("this device does not tell how far its positions can be trusted")
        return
    for line in words.conditions(condition.bits):
        print(line)
    if exceeded:
        for line in words.exceeded(exceeded.what, exceeded.motor, exceeded.frame, exceeded.by):
            print(line)
    if any(each.state == LOST for each in condition.positions):
        print(words.LIMITS_COUNT)


@app.command()
def move(
    device: Url,
    motor: Motor,
    position: Steps,
    velocity: Annotated[int | None, typer.Option(help="steps/s, with --acceleration", min=1)] = None,
    acceleration: Annotated[int | None, typer.Option(help="steps/s², with --velocity", min=1)] = None,
) -> None:
    """Move a motor to a position and wait until it is there."""
    if (velocity is None) != (acceleration is None):
        raise typer.BadParameter("--velocity and --acceleration go together, give both or neither")
    with Client.open(device) as client, _stopping_on_interrupt(client):
        if velocity is not None and acceleration is not None:
            client.request(MotorSetSpeed(motor, velocity, acceleration))
        client.request(MotorMove(motor, position))
        client.wait_idle(timeout_s=float("inf"))
        print(f"motor {motor}: {client.request(MotorGetPosition()).steps[motor - 1]}")


@app.command()
def jog(
    device: Url,
    motor: Motor,
    destination: Steps,
    speed: Annotated[int, typer.Option(help="1 (inching) to 10000 (the motor's maximum)", min=1, max=10_000)] = 1000,
    seconds: Annotated[float, typer.Option(help="how long", min=0)] = 1.0,
) -> None:
    """Jog a motor toward a position for some time, as if a key were held."""
    with Client.open(device) as client, _stopping_on_interrupt(client):
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0:
            client.request(MotorJog(motor, speed, destination))
            client.pump(min(left, JOG_REPEAT_S))
        client.request(MotorStop(motor))
        client.wait_idle(STOP_TIME_S)
        print(f"motor {motor}: {client.request(MotorGetPosition()).steps[motor - 1]}")


@app.command()
def virtual(
    device: Url,
    axis: Annotated[VirtualAxisName | None, typer.Argument(help="the axis to move", show_default=False)] = None,
    position: Annotated[float | None, typer.Argument(help="units or degrees", show_default=False)] = None,
) -> None:
    """Say where the virtual axes are, or move one of them; the host has configured them."""
    if axis is not None and position is None:
        raise typer.BadParameter("an axis needs a position as well")
    with Client.open(device) as client, _stopping_on_interrupt(client):
        if axis is not None and position is not None:
            number = list(VirtualAxisName).index(axis) + 1
            client.request(VirtMove(number, round(position * 100_000)))
            client.wait_idle(timeout_s=float("inf"))
        found = client.request(VirtGetPosition())
    values = found.track, found.east_west, found.north_south, found.pan, found.tilt, found.roll
    for name, value in zip(VirtualAxisName, values, strict=True):
        print(f"{name.value}: {value / 100_000:.3f}")
    if found.aim_enabled:
        print("aim point:", *(f"{(value or 0) / 1000:g}" for value in (found.aim_x, found.aim_y, found.aim_z)))


@app.command()
def stop(
    device: Url,
    motor: Annotated[int | None, typer.Argument(help="motor number, all if not given", min=1, max=32)] = None,
    hard: Annotated[bool, typer.Option("--hard", help="all motors with the hard stop's deceleration")] = False,
) -> None:
    """Stop one motor or all of them."""
    if hard and motor is not None:
        raise typer.BadParameter("--hard stops all motors, leave the motor number out")
    with Client.open(device) as client:
        client.request(MotorStop(motor) if motor is not None else MotorStopAll())
        if hard:  # a second one within a second is the hard stop (field note 4.4)
            client.request(MotorStopAll())
        client.wait_idle(STOP_TIME_S)


@app.command()
def upload(
    device: Url,
    file: Annotated[Path, typer.Argument(help="CSV: frame, then a column per motor", metavar="CSV")],
) -> None:
    """Upload a move."""
    content = read_move(file)
    with Client.open(device) as client:
        client.upload_move(content.start_frame, content.end_frame, content.positions, UPLOAD_WINDOW)
    print(f"frames {content.start_frame} to {content.end_frame} for {len(content.positions)} motors")


@app.command()
def run(
    device: Url,
    start: Annotated[int, typer.Argument(help="first scene frame", show_default=False)],
    end: Annotated[int, typer.Argument(help="last scene frame; before the first: backward", show_default=False)],
    fps: Annotated[float, typer.Option(help="frames per second", min=0.001)] = 24,
    preroll_ms: Annotated[int, typer.Option(help="time to get up to speed", min=0)] = 1000,
    postroll_ms: Annotated[int, typer.Option(help="time to slow down", min=0)] = 1000,
) -> None:
    """Play the uploaded move, from the pre-roll to rest."""

    def show(event: Event) -> None:
        if isinstance(event.message, Positions) and sys.stdout.isatty():
            print(f"\rframe {event.message.move_time / 1000:9.3f}", end="", flush=True)

    with Client.open(device) as client, _stopping_on_interrupt(client):
        client.request(RtRunMove(round(fps * 1000), start, end, preroll_ms, postroll_ms))
        client.wait_idle(timeout_s=float("inf"))
        client.on_event = show
        client.request(RtGo())
        client.wait_event(RtEnd, timeout_s=float("inf"))
        client.wait_idle(timeout_s=float("inf"))  # on the end frame again
    print(f"{chr(13) if sys.stdout.isatty() else ''}frames {start} to {end} played")


@app.command()
def sniff(
    capture: Annotated[
        Path | None, typer.Argument(help="a capture: hexadecimal digits or the bytes themselves")
    ] = None,
    device: Annotated[str | None, typer.Option(help="listen between a new pseudo-terminal and this device")] = None,
) -> None:
    """Show protocol traffic frame by frame, from a capture or live."""
    if (capture is None) == (device is None):
        raise typer.BadParameter("name either a capture file or a --device to listen to")
    if capture:
        try:
            content = capture.read_bytes()
        except OSError as error:
            raise ToolError(f"cannot read the capture {capture}: {error.strerror}") from None
        for line in read_capture(content):
            print(line)
    elif device:
        with Client.open(device) as client:
            link = PtyLink()
            try:
                print(link.path, "ready", sep="\n", flush=True)
                relay(client.port, link, lambda line: print(line, flush=True), until=lambda: False)
            finally:
                link.close()


rig = typer.Typer(help="The rig file: what a user changes on a board.")
app.add_typer(rig, name="rig")


@rig.command("check")
def rig_check(
    file: Annotated[Path, typer.Argument(help="a rig file", metavar="FILE", show_default=False)],
    board: Annotated[str, typer.Option(help="the board that it is for, a folder of boards/")] = "pico",
) -> None:
    """Read a rig file as a board does; say what is wrong with it."""
    found = rig_file.check(rig_file.read(file), board_data(board), str(file))
    print(f"{file} is right for {board_data(board)['name']}: {found.name.decode()!r}, {len(found.motors)} motors set")


@rig.command("edit")
def rig_edit(
    port: Annotated[str | None, typer.Option(help="port of the REPL; without it the only board on USB")] = None,
    protocol: Annotated[str | None, typer.Option(help="port that Dragonframe uses, where it cannot be told")] = None,
) -> None:
    """Fetch a board's rig file, edit it with $EDITOR, check it, put it back and restart."""
    from .device import Device

    rig_file.edit(Device(port), protocol)


if __name__ == "__main__":
    app()
