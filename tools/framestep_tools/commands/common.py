"""Common parts of commands: the device, negative numbers, Ctrl-C, output for programs."""

import json
import re
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.core import TyperCommand

if TYPE_CHECKING:
    from ..axes.rig_axes import Axes
    from ..client.client import Client
    from ..payloads import MotorSetSpeed

STOP_TIME_S = 60.0

Url = Annotated[
    str | None,
    typer.Option(
        "--device", "-d", envvar="FRAMESTEP_DEVICE", metavar="DEVICE", show_default=False,
        help=(
            "path of a port or socket://HOST:PORT; --device itself may be left out. "
            "Without it: the only board on USB"
        ),
    ),
]  # fmt: skip
Motor = Annotated[
    str, typer.Argument(help="motor number, from 1, or name in axes.toml", show_default=False)
]
Position = Annotated[
    str,
    typer.Argument(help="in steps, or with a unit if axes.toml has one: 10deg", show_default=False),
]
AxesFile = Annotated[
    Path | None,
    typer.Option(
        "--axes", envvar="FRAMESTEP_AXES", metavar="FILE", show_default=False,
        help=(
            "names, units and limits of the motors, as TOML. Without it: axes.toml in this folder, "
            "else the user's"
        ),
    ),
]  # fmt: skip


def fps_of(text: str) -> float:
    """Return a rate such as 25, 23.976 or 24000/1001. Raises BadParameter."""
    from ..move.table import FASTEST, SLOWEST, rate

    found = rate(text)
    if found is None:
        raise typer.BadParameter(
            f"expected frames per second from {SLOWEST:g} to {FASTEST:g}, such as 25 or "
            f"24000/1001, found {text[:40]!r}"
        )
    return found


def put_once(found: dict[Any, Any], key: Any, value: Any, option: str) -> None:
    """Put a value of a repeated option into `found`. Raises BadParameter if it has another one."""
    if found.setdefault(key, value) != value:
        raise typer.BadParameter(f"{option}: {key} has two values: give one")


Json = Annotated[bool, typer.Option("--json", help="as JSON, for programs")]

_NUMBER = re.compile(r"-(\d|\.\d)")
_ADDRESS = re.compile(r"[A-Za-z0-9.-]+:\d{1,5}")
_DEVICE = re.compile(r"/dev/|COM\d+$|\\\\\.\\|[A-Za-z][\w+]*://")


class SpokenCommand(TyperCommand):
    """A command that accepts negative numbers as typed, and a device before other arguments."""

    under_way = "framestep"  # the running command, for other programs that want its port

    def invoke(self, ctx: Any) -> Any:
        """Note which command this is, then run it."""
        SpokenCommand.under_way = ctx.command_path
        return super().invoke(ctx)

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Parse the arguments, after bringing them into an order that the library understands."""
        options = [p for p in self.params if p.param_type_name == "option"]
        takes = {name for p in options if not getattr(p, "is_flag", False) for name in p.opts}
        needed = sum(p.param_type_name == "argument" and p.required for p in self.params)
        return super().parse_args(
            ctx, arranged(args, takes, needed if any(p.name == "device" for p in options) else None)
        )


def arranged(args: list[str], takes: set[str], needed: int | None) -> list[str]:
    """Return the arguments as options, "--", and the rest, including negative numbers.

    takes: options with a value; needed: minimum number of arguments without a device, or None if
    the command takes no device.
    """
    options: list[str] = []
    rest: list[str] = []
    left = list(args)
    while left:
        word = left.pop(0)
        if word == "--":
            rest += left
            break
        if word[:1] != "-" or word == "-" or _NUMBER.match(word):
            rest.append(word)
            continue
        options.append(word)
        if word in takes and left:
            options.append(left.pop(0))
    at = next((i for i, word in enumerate(rest) if _DEVICE.match(word)), None)
    if needed is not None and len(rest) > needed:
        if at is not None:
            options += ["--device", rest.pop(at)]
        elif address := next((word for word in rest if _ADDRESS.fullmatch(word)), None):
            raise typer.BadParameter(f"{address} is no device: write socket://{address}")
    return [*options, "--", *rest]


def put(app: typer.Typer, *commands: Callable[..., Any]) -> None:
    """Put commands into a command line under their functions' names."""
    for command in commands:
        app.command(cls=SpokenCommand)(command)


def say_json(found: Any) -> None:
    """Print a line of JSON."""
    print(json.dumps(found, ensure_ascii=False), flush=True)


def note(*said: str) -> None:
    """Print sentences that a user should know, on standard error."""
    for sentence in said:
        print(sentence, file=sys.stderr, flush=True)


def load_axes(given: Path | None) -> "Axes":
    """Read the names and units of the motors. Raises AxesFileError if the file has a mistake."""
    from ..axes import rig_axes

    return rig_axes.load(given)


@contextmanager
def talking(device: str | None, axes: "Axes | None" = None) -> "Iterator[Client]":
    """Yield a client that has greeted the device, or the only board. axes: for its texts."""
    from ..client.connection import connected

    with connected(device, SpokenCommand.under_way, axes) as client:
        yield client


def stopped(client: "Client", moved: Iterable[int]) -> str:
    """Return a sentence with the positions of the motors that have moved."""
    from ..payloads import MotorGetPosition

    steps, axes = client.request(MotorGetPosition()).steps, client.axes
    found = ", ".join(
        f"{axes.name(motor)} is at {axes.position(motor, steps[motor - 1])}"
        for motor in sorted(moved)
    )
    return f"stopped: {found}" if found else "nothing was moving"


@contextmanager
def moving(device: str | None, axes: "Axes | None" = None) -> "Iterator[Client]":
    """Yield a client for a command that moves motors. Ctrl-C stops them before the command ends.

    What other programs move through this one would stop with the port, so it stays open until then.
    """
    from ..client.state import Stopped

    with talking(device, axes) as client:
        try:
            try:
                yield client
            except Stopped:
                _outlast_guests(client)
                raise
            _outlast_guests(client)
        except KeyboardInterrupt:
            _stop(client)
            raise


def _outlast_guests(client: "Client") -> None:
    """Wait while other programs use the port of this one, and motors move."""
    from ..client.client import POLL_INTERVAL_S
    from ..payloads import MotorStatus

    port = client.shared_port
    while port and port.used and client.request(MotorStatus()).moving:
        client.pump(POLL_INTERVAL_S)


@contextmanager
def shown(client: "Client", motor: int) -> Iterator[None]:
    """Show a motor's position in a terminal while it moves."""
    from ..payloads import Positions

    def show(event: Any) -> None:
        report = event.message
        if isinstance(report, Positions) and motor <= len(report.steps):
            at = client.axes.position(motor, report.steps[motor - 1])
            print(f"\r{client.axes.name(motor)}: {at}\x1b[K", end="", file=sys.stderr, flush=True)

    if not sys.stderr.isatty():
        yield
        return
    client.on_event = show
    try:
        yield
    finally:
        client.on_event = None
        print("\r\x1b[K", end="", file=sys.stderr, flush=True)


def set_speed(client: "Client", request: "MotorSetSpeed") -> None:
    """Set a motor's speed, and report a value that the board has limited."""
    from ..client.client import ClientError
    from ..payloads import GetExceeded

    client.request(request)
    try:
        found = client.request(GetExceeded(request.motor))
    except ClientError:  # only framestep reports it
        return
    axes = client.axes
    for what, per, asked, is_set in (
        ("velocity", "s", request.velocity, found.velocity),
        ("acceleration", "s²", request.acceleration, found.acceleration),
    ):
        if is_set is not None and is_set != asked:
            print(
                f"{axes.name(request.motor)}: the board limits its {what} to "
                f"{axes.length(request.motor, is_set, per)}",
                file=sys.stderr,
                flush=True,
            )


def _stop(client: "Client") -> None:
    """Bring all motors to rest and print their positions.

    Another Ctrl-C stops them harder. One more ends the command; the controller then stops them.
    """
    from ..client.client import NoAnswer
    from ..payloads import MotorStatus, MotorStopAll

    for text, times in (("stopping; Ctrl-C once more stops harder", 1), ("stopping harder", 2)):
        print(text, file=sys.stderr, flush=True)
        try:
            for _ in range(times):  # twice within a second: hard stop (field note 4.4)
                try:
                    client.request(MotorStopAll())
                except NoAnswer:  # these bytes have completed the frame that Ctrl-C cut short
                    client.request(MotorStopAll())
            moved = client.request(MotorStatus()).moving
            client.wait_idle(STOP_TIME_S)
            print(stopped(client, moved), file=sys.stderr, flush=True)
            return
        except KeyboardInterrupt:
            continue
