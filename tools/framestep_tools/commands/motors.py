"""Commands for single motors: status, move, jog, zero, stop, and others for the first hour with a
rig."""

import sys
import time
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..errors import ToolError
from .common import (
    STOP_TIME_S,
    Json,
    Motor,
    Steps,
    Url,
    moving,
    put,
    say_json,
    stopped,
    talking,
)
from .homing import home

if TYPE_CHECKING:
    from ..client.client import Client

JOG_REPEAT_S = 0.2  # a jog ends by itself when it is not repeated (field note 4.2)
WATCH_S = 0.2  # from one update to the next
LEAVE_S = 10.0  # time for another program to close the port


def status(
    device: Url = None,
    json: Json = False,
    watch: Annotated[
        bool, typer.Option("--watch", "-w", help="go on as a live table, until Ctrl-C")
    ] = False,
) -> None:
    """Show the device, the positions of its motors, and what moves."""
    from ..client import state

    with talking(device) as client:
        _show(client, json, watch, state.ask, state.for_programs, state.lines, state.table)


def switches(
    device: Url = None,
    json: Json = False,
    watch: Annotated[
        bool, typer.Option("--watch", "-w", help="go on as a live table, until Ctrl-C")
    ] = False,
) -> None:
    """Show E-stop, limit switches and inputs as the board sees them."""
    from ..client import switches

    with talking(device) as client:
        _show(
            client, json, watch, switches.ask, switches.for_programs, switches.lines, switches.table
        )


def _show(
    client: "Client", json: bool, watch: bool, ask: Any, for_programs: Any, lines: Any, table: Any
) -> None:
    """Ask once and print the answer; with `watch`, repeat until Ctrl-C."""

    def say() -> None:
        found = ask(client)
        say_json(for_programs(found)) if json else print(*lines(found), sep="\n", flush=True)

    if not watch:
        say()
        return
    try:
        if not json and sys.stdout.isatty():
            _live(lambda: table(ask(client)), client)
        while True:
            say()
            client.pump(WATCH_S)
    except KeyboardInterrupt:
        return


def _live(render: Any, client: "Client") -> None:
    """Update the output of `render` until Ctrl-C."""
    from rich.live import Live

    with Live(render(), refresh_per_second=10, transient=False) as live:
        while True:
            client.pump(WATCH_S)
            live.update(render())


def move(
    motor: Motor,
    position: Steps,
    device: Url = None,
    velocity: Annotated[
        int | None, typer.Option(help="steps/s, with --acceleration", min=1)
    ] = None,
    acceleration: Annotated[
        int | None, typer.Option(help="steps/s², with --velocity", min=1)
    ] = None,
) -> None:
    """Move a motor to a position and wait until it is there."""
    from ..payloads import MotorMove, MotorSetSpeed

    if (velocity is None) != (acceleration is None):
        raise typer.BadParameter("--velocity and --acceleration go together, give both or neither")
    with moving(device) as client:
        if velocity is not None and acceleration is not None:
            client.request(MotorSetSpeed(motor, velocity, acceleration))
        client.request(MotorMove(motor, position))
        client.wait_idle(timeout_s=float("inf"))
        _arrived(client, motor, position)


def _arrived(client: "Client", motor: int, position: int | None = None) -> None:
    """Print a motor's position. Raises Stopped, with the reason, if it is not at `position`."""
    from ..client import state

    found = state.position(client, motor)
    if position is not None and found != position:
        raise state.Stopped(
            f"motor {motor} stopped at {found}, short of {position}: {state.why_stopped(client)}"
        )
    print(f"motor {motor}: {found}")


def jog(
    motor: Motor,
    destination: Steps,
    device: Url = None,
    speed: Annotated[
        int, typer.Option(help="1 (inching) to 10000 (the motor's maximum)", min=1, max=10_000)
    ] = 1000,
    seconds: Annotated[float, typer.Option(help="how long", min=0)] = 1.0,
) -> None:
    """Jog a motor toward a position for a time, as a held key does."""
    from ..payloads import MotorStop

    with moving(device) as client:
        _stands(client, motor)
        _jog(client, motor, destination, speed, seconds)
        client.request(MotorStop(motor))
        client.wait_idle(STOP_TIME_S)
        _arrived(client, motor)


def _stands(client: "Client", motor: int) -> int:
    """Return a motor's position, and forget earlier stops."""
    from ..client import state

    found = state.position(client, motor)
    client.events.clear()
    return found


def _jog(client: "Client", motor: int, destination: int, speed: int, seconds: float) -> None:
    """Jog until a motor is there or the time is over. Raises Stopped if something else stops it."""
    from ..client import state
    from ..payloads import MotorJog, MotorStop

    end = time.monotonic() + seconds
    while (left := end - time.monotonic()) > 0 and state.position(client, motor) != destination:
        if not state.is_stopped(client):
            client.request(MotorJog(motor, speed, destination))
            client.pump(min(left, JOG_REPEAT_S))
        if state.is_stopped(client):
            client.request(MotorStop(motor))  # the last jog may have come after the stop
            client.wait_idle(STOP_TIME_S)
            raise state.Stopped(
                f"motor {motor} stopped at {state.position(client, motor)}: "
                f"{state.why_stopped(client)}"
            )


def zero(
    motor: Motor,
    position: Annotated[
        int, typer.Argument(help="its position from now on", min=-(2**31), max=2**31 - 1)
    ] = 0,
    device: Url = None,
) -> None:
    """Set a motor's position to 0, or to another value. Nothing moves."""
    from ..payloads import MotorResetPosition

    with talking(device) as client:
        client.request(MotorResetPosition(motor, position))
        _arrived(client, motor)


def stop(
    motor: Annotated[
        int | None, typer.Argument(help="motor number, all if not given", min=1, max=32)
    ] = None,
    device: Url = None,
    hard: Annotated[
        bool, typer.Option("--hard", help="all motors with the hard stop's deceleration")
    ] = False,
) -> None:
    """Stop one motor or all, also while another command moves them."""
    if hard and motor is not None:
        raise typer.BadParameter("--hard stops all motors, leave the motor number out")
    try:
        print(_stop(device, motor, hard))
    except ToolError as error:
        raise NotStopped(error) from error


class NotStopped(ToolError):
    """Motors may still be moving; the text says so first."""

    def __init__(self, error: ToolError):
        super().__init__(
            f"NOT STOPPED: {error}. Press the E-stop, or switch the motors' supply off"
        )
        self.status = error.status


def _stop(device: str | None, motor: int | None, hard: bool) -> str:
    """Stop one motor or all and wait until they are at rest. Return their positions as text."""
    from ..client.client import BrokenOff
    from ..payloads import MotorStatus, MotorStop, MotorStopAll

    moved: set[int] = set()
    asked = False
    try:
        with talking(device) as client:
            before = client.send(
                MotorStatus()
            )  # does not delay the stop: nobody waits for the answer
            client.request(MotorStop(motor) if motor is not None else MotorStopAll())
            if hard:  # a second one within a second is the hard stop (field note 4.4)
                client.request(MotorStopAll())
            asked = True
            moved.update(client.answer_to(before).moving)
            if motor is not None:
                moved &= {motor}
            client.wait_idle(STOP_TIME_S, motor=motor)
            return stopped(client, moved)
    except BrokenOff:
        if not asked:
            raise
    return _stopped_after_the_other(device, moved)


def _stopped_after_the_other(device: str | None, moved: set[int]) -> str:
    """Return the positions once the program that had the port has ended.

    It ends when its motors have stopped, and may take a moment to close the port.
    """
    from ..client.client import BrokenOff
    from ..client.open_port import PortBusy

    end = time.monotonic() + LEAVE_S
    while True:
        try:
            with talking(device) as client:
                client.wait_idle(STOP_TIME_S)
                return stopped(client, moved)
        except (BrokenOff, PortBusy):
            if time.monotonic() > end:
                raise
        time.sleep(WATCH_S)


def buzz(
    motor: Motor,
    device: Url = None,
    steps: Annotated[int, typer.Option(help="distance to each side", min=1, max=100_000)] = 200,
    times: Annotated[int, typer.Option(help="how often", min=1, max=1000)] = 5,
    speed: Annotated[
        int, typer.Option(help="1 (inching) to 10000 (the motor's maximum)", min=1, max=10_000)
    ] = 1000,
) -> None:
    """Move a motor a few steps to and fro, to see whether it turns."""
    with moving(device) as client:
        home = _stands(client, motor)
        for k in range(2 * times + 1):
            target = home if k == 2 * times else home + (steps if k % 2 == 0 else -steps)
            _jog(client, motor, target, speed, STOP_TIME_S)
            client.wait_idle(STOP_TIME_S)
        _arrived(client, motor, home)


def add(app: typer.Typer) -> None:
    """Put these commands into the command line."""
    put(app, status, move, jog, zero, home, stop, buzz, switches)
