"""Single motors: where they are, move, jog, stop."""

import time
from typing import Annotated

import typer

from .common import STOP_TIME_S, Motor, Steps, Url, stopping_on_interrupt

JOG_REPEAT_S = 0.2  # a jog ends by itself when it is not repeated (field note 4.2)


def status(device: Url) -> None:
    """Say who the device is, where its motors are and what moves."""
    from framestep import words
    from framestep.motion.positions import LOST
    from framestep.protocol.messages import CONDITION_EXCEEDED

    from ..client import Client, RequestRefused
    from ..payloads import Condition, Exceeded, GetCondition, GetExceeded, Hi, MotorGetPosition, MotorStatus

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


def move(
    device: Url,
    motor: Motor,
    position: Steps,
    velocity: Annotated[int | None, typer.Option(help="steps/s, with --acceleration", min=1)] = None,
    acceleration: Annotated[int | None, typer.Option(help="steps/s², with --velocity", min=1)] = None,
) -> None:
    """Move a motor to a position and wait until it is there."""
    from ..client import Client
    from ..payloads import MotorGetPosition, MotorMove, MotorSetSpeed

    if (velocity is None) != (acceleration is None):
        raise typer.BadParameter("--velocity and --acceleration go together, give both or neither")
    with Client.open(device) as client, stopping_on_interrupt(client):
        if velocity is not None and acceleration is not None:
            client.request(MotorSetSpeed(motor, velocity, acceleration))
        client.request(MotorMove(motor, position))
        client.wait_idle(timeout_s=float("inf"))
        print(f"motor {motor}: {client.request(MotorGetPosition()).steps[motor - 1]}")


def jog(
    device: Url,
    motor: Motor,
    destination: Steps,
    speed: Annotated[int, typer.Option(help="1 (inching) to 10000 (the motor's maximum)", min=1, max=10_000)] = 1000,
    seconds: Annotated[float, typer.Option(help="how long", min=0)] = 1.0,
) -> None:
    """Jog a motor toward a position for some time, as if a key were held."""
    from ..client import Client
    from ..payloads import MotorGetPosition, MotorJog, MotorStop

    with Client.open(device) as client, stopping_on_interrupt(client):
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0:
            client.request(MotorJog(motor, speed, destination))
            client.pump(min(left, JOG_REPEAT_S))
        client.request(MotorStop(motor))
        client.wait_idle(STOP_TIME_S)
        print(f"motor {motor}: {client.request(MotorGetPosition()).steps[motor - 1]}")


def stop(
    device: Url,
    motor: Annotated[int | None, typer.Argument(help="motor number, all if not given", min=1, max=32)] = None,
    hard: Annotated[bool, typer.Option("--hard", help="all motors with the hard stop's deceleration")] = False,
) -> None:
    """Stop one motor or all of them."""
    from ..client import Client
    from ..payloads import MotorStop, MotorStopAll

    if hard and motor is not None:
        raise typer.BadParameter("--hard stops all motors, leave the motor number out")
    with Client.open(device) as client:
        client.request(MotorStop(motor) if motor is not None else MotorStopAll())
        if hard:  # a second one within a second is the hard stop (field note 4.4)
            client.request(MotorStopAll())
        client.wait_idle(STOP_TIME_S)


def add(app: typer.Typer) -> None:
    """Put these commands into the command line."""
    for command in (status, move, jog, stop):
        app.command()(command)
