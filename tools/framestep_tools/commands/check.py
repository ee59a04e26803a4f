"""`framestep check`: judge a move before anything moves."""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..errors import extra
from .common import AxesFile, Json, load_axes, put, put_once, say_json, talking
from .moves import (
    FirstFrame,
    Fps,
    LastFrame,
    MoveFile,
    Postroll,
    Preroll,
    Reverse,
    fits,
    fps_for,
    read_content,
    section,
)

if TYPE_CHECKING:
    from ..axes.rig_axes import Axes
    from ..move.move_check import Device, Setting

_ENDINGS = (".png", ".svg", ".pdf")


def check(
    file: MoveFile,
    device: Annotated[
        str | None,
        typer.Option(
            "--device", "-d", envvar="FRAMESTEP_DEVICE", metavar="DEVICE", show_default=False,
            help="use this board's settings; without it no board is needed",
        ),
    ] = None,
    fps: Fps = None,
    first: FirstFrame = None,
    last: LastFrame = None,
    reverse: Reverse = False,
    preroll: Preroll = 1,
    postroll: Postroll = 1,
    loop: Annotated[bool, typer.Option("--loop", help="as for play")] = False,
    ping_pong: Annotated[bool, typer.Option("--ping-pong", help="as for play")] = False,
    rig: Annotated[
        Path | None, typer.Option(help="the rig file of the board", metavar="FILE")
    ] = None,
    board: Annotated[str, typer.Option(help="the kind of board", metavar="NAME")] = "pico",
    velocity: Annotated[
        list[str] | None,
        typer.Option(
            metavar="[MOTOR=]N", help="steps/s of all motors, or of one: 2=8000, pan=20deg/s"
        ),
    ] = None,
    acceleration: Annotated[
        list[str] | None,
        typer.Option(
            metavar="[MOTOR=]N", help="steps/s² of all motors, or of one: 2=40000, pan=40deg/s²"
        ),
    ] = None,
    limits: Annotated[
        list[str] | None,
        typer.Option(
            metavar="MOTOR=LOWER:UPPER",
            help="soft limits of a motor in steps, or with a unit: pan=-90deg:90deg; either may "
            "be left out",
        ),
    ] = None,
    plot: Annotated[
        Path | None, typer.Option(help="draw the path: a png, svg or pdf", metavar="FILE")
    ] = None,
    json: Json = False,
    axes: AxesFile = None,
) -> int:  # fmt: skip
    """Judge a move before anything moves.

    Compare what a move asks of each motor with its settings, and say whether the board would play
    it. Exit status: 0 if all fits, 7 if the board would refuse it, 1 if it would play it although a
    motor needs more than its acceleration.
    """
    from framestep.protocol.messages import RUN_LOOP, RUN_PING_PONG
    from framestep.rig import RigError

    from ..board.rig_file import with_suggestion
    from ..building.board_files import board_data
    from ..errors import DONE, FAILED, REFUSED, ToolError
    from ..payloads import RtRunMove

    if loop and ping_pong:
        raise typer.BadParameter("--loop and --ping-pong do not go together")
    if plot and plot.suffix.lower() not in _ENDINGS:
        raise ToolError(f"{plot}: a picture is one of {', '.join(_ENDINGS)}")
    from ..move import check_plot, move_check
    from ..simulator.boards import read_rig

    if plot:
        with extra("a picture"):
            import matplotlib  # noqa: F401
    known = load_axes(axes)
    content = read_content(file, known, fps)
    begin, end = section(content, first, last, reverse)
    run = RtRunMove(
        fps_milli=round(fps_for(content, fps) * 1000), start_frame=begin, end_frame=end,
        preroll_ms=round(preroll * 1000), postroll_ms=round(postroll * 1000),
        flags=(RUN_LOOP if loop else 0) | (RUN_PING_PONG if ping_pong else 0),
    )  # fmt: skip
    fits(run)
    board_data(board)
    asked = move_check.Device(read_rig(rig), board, axes=known)
    motors = list(content.positions)
    settings = {motor: move_check.Setting() for motor in motors}
    if device:
        settings, asked = _of_device(device, motors, settings, asked)
    _take(settings, "velocity", velocity, known)
    _take(settings, "acceleration", acceleration, known)
    _take_limits(settings, limits, known)
    try:
        found = move_check.check(content, run, settings, asked)
    except RigError as error:
        raise ToolError(f"{rig}: {with_suggestion(str(error))}") from None
    without_rig_file = bool(device) and rig is None
    if json:
        left = move_check.NOT_REPORTED if without_rig_file else ()
        say_json({**move_check.for_programs(found), "not_considered": left})
    else:
        print(*move_check.lines(found, known), sep="\n")
        if without_rig_file:
            print(move_check.OF_RIG_FILE)
    if plot:
        try:
            check_plot.plot(found, plot)
            if not json:
                print(f"the picture is {plot}")
        except OSError as error:
            raise ToolError(f"cannot write {plot}: {error.strerror}") from None
    return REFUSED if found.refused else DONE if found.fits else FAILED


def _of_device(
    url: str, motors: list[int], settings: "dict[int, Setting]", asked: "Device"
) -> "tuple[dict[int, Setting], Device]":
    """Read a device's settings of motors, its number of motors and of frames."""
    from ..move.move_check import settings_of

    with talking(url) as client:
        info = client.info or client.greet()
        found = settings_of(client, motors)
    return settings | found, replace(asked, motors=info.motors, frames=info.upload_frames)


def _take(settings: "dict[int, Setting]", name: str, given: list[str] | None, axes: "Axes") -> None:
    """Put velocities or accelerations from the command line into the settings: first values for all
    motors, then values for single ones."""
    per = "s" if name == "velocity" else "s²"
    seen: dict[str, str] = {}
    for text in sorted(given or [], key=lambda text: "=" in text):
        one, _, value = text.rpartition("=")
        put_once(seen, f"motor {axes.motor(one)}" if one else "every motor", value, f"--{name}")
        for motor in [axes.motor(one)] if one else list(settings):
            _has(settings, motor, name)
            settings[motor] = replace(settings[motor], **{name: axes.rate(motor, value, per)})


def _take_limits(settings: "dict[int, Setting]", given: list[str] | None, axes: "Axes") -> None:
    seen: dict[str, str] = {}
    for text in given or []:
        one, _, ends = text.partition("=")
        if ends.count(":") != 1 or not one:
            raise typer.BadParameter(
                "--limits: expected MOTOR=LOWER:UPPER such as 2=-500:9000, or 2=:9000 for no lower "
                f"one, found {text!r}"
            )
        motor = axes.motor(one)
        _has(settings, motor, "limits")
        put_once(seen, f"motor {motor}", ends, "--limits")
        lower, upper = axes.limits(motor, *ends.split(":"))
        if lower is not None and upper is not None and lower > upper:
            raise typer.BadParameter(f"--limits: {lower} is above {upper}, found {text!r}")
        settings[motor] = replace(settings[motor], lower=lower, upper=upper)


def _has(settings: "dict[int, Setting]", motor: int, name: str) -> None:
    if motor not in settings:
        raise typer.BadParameter(
            f"--{name}: the move has no motor {motor}, it has motors "
            f"{', '.join(map(str, settings))}"
        )


def add(app: typer.Typer) -> None:
    """Put this command into the command line."""
    put(app, check)
