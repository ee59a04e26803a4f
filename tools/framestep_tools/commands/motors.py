"""Commands for single motors: status, move, jog, zero, stop, and others for the first hour with a
rig."""

import re
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..errors import ToolError
from .common import (
    STOP_TIME_S,
    AxesFile,
    Json,
    Motor,
    Position,
    Url,
    load_axes,
    moving,
    note,
    put,
    say_json,
    set_speed,
    shown,
    stopped,
    talking,
)
from .homing import home

if TYPE_CHECKING:
    from ..axes.rig_axes import Axes
    from ..client.client import Client

JOG_REPEAT_S = 0.2  # a jog ends by itself when it is not repeated (field note 4.2)
WATCH_S = 0.2  # from one update to the next
LEAVE_S = 10.0  # time for another program to close the port
_BUZZ = 100_000  # steps: the farthest
_PERCENT = re.compile(r"(\d+(?:\.\d*)?|\.\d+) ?%")
_USUAL_SPEED = 1000  # of 10000


def _share(text: str) -> int:
    """Return ten thousandths, as a jog has them, of a share such as 5%. Raises BadParameter."""
    if not isinstance(text, str):
        return text  # the default
    found = _PERCENT.fullmatch(text.strip())
    share = round(float(found[1]) * 100) if found else 0
    if not 1 <= share <= 10_000:
        raise typer.BadParameter(
            f"expected a part of the motor's velocity from 0.01% to 100%, such as 5%, "
            f"found {text[:40]!r}"
        )
    return share


Speed = Annotated[
    int,
    typer.Option(
        help="part of the motor's velocity, from 0.01% to 100%; without it 10%",
        parser=_share,
        metavar="PERCENT",
        show_default=False,
    ),
]


def status(
    device: Url = None,
    json: Json = False,
    watch: Annotated[
        bool, typer.Option("--watch", "-w", help="go on as a live table, until Ctrl-C")
    ] = False,
    axes: AxesFile = None,
) -> None:
    """Show the device, the positions of its motors, and what moves."""
    from ..client import state

    with talking(device, load_axes(axes)) as client:
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
    position: Position,
    device: Url = None,
    velocity: Annotated[
        str | None,
        typer.Option(help="steps/s, or with a unit: 20deg/s; with --acceleration", metavar="N"),
    ] = None,
    acceleration: Annotated[
        str | None,
        typer.Option(help="steps/s², or with a unit: 40deg/s²; with --velocity", metavar="N"),
    ] = None,
    axes: AxesFile = None,
) -> None:
    """Move a motor to a position and wait until it is there."""
    from ..payloads import MotorMove, MotorSetSpeed

    if (velocity is None) != (acceleration is None):
        raise typer.BadParameter("--velocity and --acceleration go together, give both or neither")
    known = load_axes(axes)
    number = known.motor(motor)
    target = known.steps(number, position)
    _hint(known, number, position)
    speed = None
    if velocity is not None and acceleration is not None:
        speed = MotorSetSpeed(
            number, known.rate(number, velocity, "s"), known.rate(number, acceleration, "s²")
        )
    with moving(device, known) as client:
        if speed:
            set_speed(client, speed)
        with shown(client, number):
            client.request(MotorMove(number, target))
            client.wait_idle(timeout_s=float("inf"), motor=number)
        _arrived(client, number, target)


def _hint(axes: "Axes", motor: int, text: str) -> None:
    if hint := axes.hint(motor, text):
        note(hint)


def _arrived(client: "Client", motor: int, position: int | None = None) -> None:
    """Print a motor's position. Raises Stopped, with the reason, if it is not at `position`."""
    from ..client import state

    found, axes = state.position(client, motor), client.axes
    if position is not None and found != position:
        raise state.Stopped(
            f"{axes.name(motor)} stopped at {axes.position(motor, found)}, short of "
            f"{axes.position(motor, position)}: {state.why_stopped(client)}"
        )
    print(f"{axes.name(motor)}: {axes.position(motor, found)}")


def jog(
    motor: Motor,
    destination: Position,
    device: Url = None,
    speed: Speed = _USUAL_SPEED,
    seconds: Annotated[float, typer.Option(help="how long", min=0, max=86400)] = 1.0,
    axes: AxesFile = None,
) -> None:
    """Jog a motor toward a position for a time, as a held key does."""
    from ..payloads import MotorStop

    known = load_axes(axes)
    number = known.motor(motor)
    target = known.steps(number, destination)
    _hint(known, number, destination)
    with moving(device, known) as client:
        _position(client, number)
        with shown(client, number):
            _jog(client, number, target, speed, seconds)
            client.request(MotorStop(number))
            client.wait_idle(STOP_TIME_S, motor=number)
        _arrived(client, number)


def _position(client: "Client", motor: int) -> int:
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
            client.wait_idle(STOP_TIME_S, motor=motor)
            at = client.axes.position(motor, state.position(client, motor))
            raise state.Stopped(
                f"{client.axes.name(motor)} stopped at {at}: {state.why_stopped(client)}"
            )


def zero(
    motor: Motor,
    position: Annotated[
        str, typer.Argument(help="its position from now on, in steps or with a unit")
    ] = "0",
    device: Url = None,
    axes: AxesFile = None,
) -> None:
    """Set a motor's position to step 0, or to another value. Nothing moves."""
    from ..payloads import MotorResetPosition

    known = load_axes(axes)
    number = known.motor(motor)
    steps = known.steps(number, position)
    _hint(known, number, position)
    with talking(device, known) as client:
        client.request(MotorResetPosition(number, steps))
        _arrived(client, number)


def stop(
    motor: Annotated[
        str | None,
        typer.Argument(help="motor number, or name in axes.toml; all if not given"),
    ] = None,
    device: Url = None,
    hard: Annotated[
        bool, typer.Option("--hard", help="all motors with the hard stop's deceleration")
    ] = False,
    axes: AxesFile = None,
) -> None:
    """Stop one motor or all, also while another command moves them."""
    if hard and motor is not None:
        raise typer.BadParameter("--hard stops all motors, leave the motor out")
    try:
        known = _axes_if_any(axes, needed=motor is not None and not motor.isdecimal())
        print(_stop(device, None if motor is None else known.motor(motor), hard, known))
    except ToolError as error:
        raise NotStopped(error) from error


def _axes_if_any(given: Path | None, needed: bool) -> "Axes":
    """Read the names of motors. A mistake in the file does not keep motors from being stopped."""
    from ..axes.rig_axes import Axes

    try:
        return load_axes(given)
    except ToolError:
        if needed:
            raise
        return Axes()


class NotStopped(ToolError):
    """Motors may still be moving; the text says so first."""

    def __init__(self, error: ToolError):
        super().__init__(
            f"NOT STOPPED: {error}. Press the E-stop, or switch the motors' supply off"
        )
        self.status = error.status


def _stop(device: str | None, motor: int | None, hard: bool, axes: "Axes") -> str:
    """Stop one motor or all and wait until they are at rest. Return their positions as text."""
    from ..client.client import BrokenOff
    from ..payloads import MotorStatus, MotorStop, MotorStopAll

    moved: set[int] = set()
    asked = False
    try:
        with talking(device, axes) as client:
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
    return _stopped_after_the_other(device, moved, axes)


def _stopped_after_the_other(device: str | None, moved: set[int], axes: "Axes") -> str:
    """Return the positions once the program that had the port has ended.

    It ends when its motors have stopped, and may take a moment to close the port.
    """
    from ..client.client import BrokenOff
    from ..client.open_port import PortBusy

    end = time.monotonic() + LEAVE_S
    while True:
        try:
            with talking(device, axes) as client:
                client.wait_idle(STOP_TIME_S)
                return stopped(client, moved)
        except (BrokenOff, PortBusy):
            if time.monotonic() > end:
                raise
        time.sleep(WATCH_S)


def buzz(
    motor: Motor,
    device: Url = None,
    steps: Annotated[
        str, typer.Option(help="distance to each side, in steps or with a unit", metavar="N")
    ] = "200",
    times: Annotated[int, typer.Option(help="how often", min=1, max=1000)] = 5,
    speed: Speed = _USUAL_SPEED,
    axes: AxesFile = None,
) -> None:
    """Move a motor a few steps to and fro, to see whether it turns."""
    known = load_axes(axes)
    number = known.motor(motor)
    far = known.distance(number, steps, _BUZZ)
    with moving(device, known) as client:
        home = _position(client, number)
        for k in range(2 * times + 1):
            target = home if k == 2 * times else home + (far if k % 2 == 0 else -far)
            _jog(client, number, target, speed, STOP_TIME_S)
            client.wait_idle(STOP_TIME_S, motor=number)
        _arrived(client, number, home)


def add(app: typer.Typer) -> None:
    """Put these commands into the command line."""
    put(app, status, move, jog, zero, home, stop, buzz, switches)
