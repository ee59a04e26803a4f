"""Whole moves: upload, play, shoot."""

import sys
from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from .common import AxesFile, Url, fps_of, load_axes, moving, note, put, set_speed, talking

if TYPE_CHECKING:
    from collections.abc import Iterable

    from ..axes.rig_axes import Axes
    from ..client.client import Client
    from ..move.light_file import Lights
    from ..move.move_file import Move
    from ..move.shoot import Shots
    from ..payloads import MotorSetSpeed, Request, RtRunMove

UPLOAD_WINDOW = 4

MoveFile = Annotated[
    Path,
    typer.Argument(
        help="CSV in steps: frame, then a column per motor, headed by its axis or number; or what "
        "framestep import reads; camera_move.csv is an example to try",
        metavar="CSV",
        show_default=False,
    ),
]
LightFile = Annotated[
    Path | None,
    typer.Option(
        "--dmx",
        help="light levels and triggers to play with it, as CSV: frame, then a column per DMX "
        "channel (5) or output (output 2)",
        metavar="FILE",
    ),
]
Fps = Annotated[
    float | None,
    typer.Option(
        help="frames per second, such as 23.976 or 24000/1001; else the file's own, else 24",
        parser=fps_of,
        metavar="N",
        show_default=False,
    ),
]
USUAL_FPS = 24.0
LONGEST_ROLL_S = 600  # the board's LONGEST_ROLL
FirstFrame = Annotated[
    int | None, typer.Option("--from", help="first scene frame played, else the move's first")
]
LastFrame = Annotated[
    int | None, typer.Option("--to", help="last scene frame played, else the move's last")
]
Reverse = Annotated[
    bool, typer.Option("--reverse", help="backward, whichever of --from and --to is later")
]
Preroll = Annotated[
    float,
    typer.Option(
        help="seconds to get up to speed; 0: the shortest that each motor can",
        min=0,
        max=LONGEST_ROLL_S,
    ),
]
Postroll = Annotated[
    float,
    typer.Option(
        help="seconds to slow down; 0: the shortest that each motor can", min=0, max=LONGEST_ROLL_S
    ),
]
Velocity = Annotated[
    str | None,
    typer.Option(help="steps/s for all motors of the move, with --acceleration", metavar="N"),
]
Acceleration = Annotated[
    str | None,
    typer.Option(help="steps/s² for all motors of the move, with --velocity", metavar="N"),
]


class Camera(str, Enum):
    """When the shutter output releases a camera."""

    VIDEO = "video"
    STILLS = "stills"


def upload(
    file: MoveFile, device: Url = None, dmx: LightFile = None, axes: AxesFile = None
) -> None:
    """Upload a move, for `framestep shoot` or another program to use."""
    known = load_axes(axes)
    content, lights = read_files(file, dmx, known)
    with talking(device, known) as client:
        send(client, content, lights)
    count = len(content.positions)
    print(
        f"frames {content.start_frame} to {content.end_frame} for {count} motor{'s' * (count > 1)}"
    )


def read_files(
    file: Path, dmx: Path | None, axes: "Axes", fps: float | None = None
) -> "tuple[Move, Lights | None]":
    """Read a move, or the example of that name, and its lights. fps: for a file in seconds. Raises
    ToolError."""
    from ..move.light_file import read_lights

    return read_content(file, axes, fps), read_lights(dmx) if dmx else None


def read_content(file: Path, axes: "Axes", fps: float | None = None) -> "Move":
    """Read a move, or the example of that name, and print what its user should know. fps: for a
    file in seconds. Raises ToolError."""
    from ..move.any_file import read_any
    from ..move.move_file import or_example

    content = read_any(or_example(file), axes, fps)
    note(*content.said)
    return content


def fps_for(content: "Move", asked: float | None) -> float:
    """Return the frames per second of a run: those asked for, else the move's, else USUAL_FPS. Say
    so if the first two differ."""
    from ..move.move_conversion import same_rate

    if asked and content.fps and not same_rate(asked, content.fps):
        note(
            f"the move is at {content.fps:.10g} frames/s, --fps says {asked:.10g}: it takes "
            f"{content.fps / asked:.3g} times as long"
        )
    return asked or content.fps or USUAL_FPS


def send(client: "Client", content: "Move", lights: "Lights | None") -> None:
    """Upload a move with its lights, and print which motors its columns are if only their order
    says so. Raises MoveFileError if the frames do not match."""
    from ..move.turns import said_of

    first, last = content.start_frame, content.end_frame
    if lights:
        lights.check(first, last, client.info or client.greet())
    if content.counted:
        print(content.counted, flush=True)
    for motor, steps in content.positions.items():
        note(*said_of(steps, client.axes.axis(motor), content.start_frame))
    client.upload_move(
        first, last, content.positions, UPLOAD_WINDOW, lights=lights.requests() if lights else ()
    )


def speeds(
    axes: "Axes", content: "Move | None", velocity: str | None, acceleration: str | None
) -> "list[MotorSetSpeed]":
    """Return requests that set the speed of all motors of a move, if given. Raises AxesError."""
    from ..payloads import MotorSetSpeed

    if content is None or velocity is None or acceleration is None:
        return []
    return [
        MotorSetSpeed(motor, axes.rate(motor, velocity, "s"), axes.rate(motor, acceleration, "s²"))
        for motor in content.positions
    ]


def both_or_neither(velocity: str | None, acceleration: str | None) -> None:
    """Raise BadParameter for one without the other."""
    if (velocity is None) != (acceleration is None):
        raise typer.BadParameter("--velocity and --acceleration go together, give both or neither")


def fits(request: "Request") -> None:
    """Raise BadRequest if a value does not fit into its message, before anything is sent."""
    from ..client.client import BadRequest

    try:
        request.pack()
    except ValueError as error:
        raise BadRequest(str(error)) from None


def section(content: "Move", first: int | None, last: int | None, reverse: bool) -> tuple[int, int]:
    """Return the first and the last scene frame to play; with `reverse` the later one first.
    Raises MoveFileError for one outside the move."""
    from ..text.text_file import MoveFileError

    begin = content.start_frame if first is None else first
    end = content.end_frame if last is None else last
    for frame in (begin, end):
        if not content.start_frame <= frame <= content.end_frame:
            raise MoveFileError(
                f"the move has frames {content.start_frame} to {content.end_frame}, not {frame}"
            )
    return (max(begin, end), min(begin, end)) if reverse else (begin, end)


def play(
    file: MoveFile,
    device: Url = None,
    fps: Fps = None,
    first: FirstFrame = None,
    last: LastFrame = None,
    reverse: Reverse = False,
    preroll: Preroll = 1,
    postroll: Postroll = 1,
    loop: Annotated[
        bool, typer.Option("--loop", help="again and again, until Ctrl-C or framestep stop")
    ] = False,
    ping_pong: Annotated[
        bool, typer.Option("--ping-pong", help="there and back, until Ctrl-C or framestep stop")
    ] = False,
    velocity: Velocity = None,
    acceleration: Acceleration = None,
    camera: Annotated[
        Camera | None,
        typer.Option(
            help="shutter output: at the beginning and end (video) or at each frame (stills)"
        ),
    ] = None,
    shutter_angle: Annotated[
        int | None,
        typer.Option(
            help="stills: degrees of a frame, from its start, with the shutter open",
            min=1,
            max=360,
        ),
    ] = None,
    dmx: LightFile = None,
    bloop: Annotated[
        int, typer.Option(help="output that is on for a moment at the first frame", min=0, max=32)
    ] = 0,
    bloop_channel: Annotated[
        int, typer.Option(help="DMX channel that is on for that moment", min=0, max=512)
    ] = 0,
    bloop_ms: Annotated[
        int, typer.Option(help="how long that moment lasts", min=1, max=65535)
    ] = 100,
    axes: AxesFile = None,
) -> None:
    """Upload a move and play it.

    It runs from the pre-roll to rest on its last frame. Ctrl-C brings the motors to rest softly, a
    second one harder.
    """
    from framestep.protocol.messages import RUN_LOOP, RUN_PING_PONG, RUN_STILLS, RUN_VIDEO

    from ..errors import ToolError
    from ..payloads import RtRunMove

    both_or_neither(velocity, acceleration)
    if loop and ping_pong:
        raise typer.BadParameter("--loop and --ping-pong do not go together")
    if shutter_angle is not None and camera is not Camera.STILLS:
        raise typer.BadParameter("--shutter-angle needs --camera stills")
    known = load_axes(axes)
    content, lights = read_files(file, dmx, known, fps)
    begin, end = section(content, first, last, reverse)
    run = RtRunMove(
        fps_milli=round(fps_for(content, fps) * 1000),
        start_frame=begin,
        end_frame=end,
        preroll_ms=round(preroll * 1000),
        postroll_ms=round(postroll * 1000),
        sync_dmx=1 if lights else 0,
        bloop_outputs=1 << (bloop - 1) if bloop else 0,
        bloop_channel=bloop_channel,
        bloop_ms=bloop_ms if bloop or bloop_channel else 0,
        flags=(
            (RUN_LOOP if loop else 0)
            | (RUN_PING_PONG if ping_pong else 0)
            | (RUN_VIDEO if camera is Camera.VIDEO else 0)
            | (RUN_STILLS if camera is Camera.STILLS else 0)
        ),
        open_angle=0,  # without an angle to close at: 90 to 180 degrees (field note 6.9)
        close_angle=shutter_angle or 0,
    )
    fits(run)
    set_speeds = speeds(known, content, velocity, acceleration)
    with moving(device, known) as client:
        _has_output(client, bloop)
        if camera and not _has_camera(client):
            raise ToolError("the device has no camera outputs: its board's page says why")
        for each in set_speeds:
            set_speed(client, each)
        send(client, content, lights)
        _run(client, content, run)
    print(f"frames {begin} to {end} played")


def _has_camera(client: "Client") -> bool:
    """Return whether the device says that it can release a camera in a run."""
    from framestep.protocol.messages import CAP_CAMERA

    return bool((client.info or client.greet()).capabilities & CAP_CAMERA)


def _has_output(client: "Client", output: int) -> None:
    """Raise ToolError if the device has no such general output; 0 means none."""
    from ..errors import ToolError

    there = (client.info or client.greet()).outputs
    if output > there:
        has = f"outputs 1 to {there}" if there else "no outputs"
        raise ToolError(f"there is no output {output}: the device has {has} (set in its rig file)")


def _run(client: "Client", content: "Move", run: "RtRunMove") -> None:
    from rich.console import Console

    from ..move.move_display import MoveDisplay
    from ..move.play import play

    console = Console(highlight=False)
    names, axes = content.names, client.axes
    display = MoveDisplay(names, run.start_frame, run.end_frame, console, quiet=True, axes=axes)
    with display.running():
        play(client, run, content.positions, display)


def shoot(
    frames: Annotated[
        list[str],
        typer.Argument(
            help="scene frames: 7, 1-48, 48-1 (backward), 1-5,9",
            metavar="FRAMES...",
            show_default=False,
        ),
    ],
    device: Url = None,
    move: Annotated[
        Path | None,
        typer.Option(
            help="upload this move first; without it, shoot the last upload, with the motors that "
            "Dragonframe has set to blur",
            metavar="CSV",
        ),
    ] = None,
    motors: Annotated[
        str | None,
        typer.Option(
            help="motors that move while the shutter is open, such as 1,3 or pan,tilt; default: "
            "all of the move; none: all rest. Needs --move",
            metavar="MOTORS",
        ),
    ] = None,
    exposure: Annotated[
        float, typer.Option(help="seconds that the shutter is open", min=0.001, max=3600)
    ] = 1,
    shutter_angle: Annotated[
        int,
        typer.Option(
            help="degrees of the frame's motion, around its middle, that are exposed",
            min=1,
            max=360,
        ),
    ] = 180,
    settle: Annotated[
        float, typer.Option(help="seconds to wait before each shot", min=0, max=3600)
    ] = 0,
    pause: Annotated[
        float, typer.Option(help="seconds to wait after each shot", min=0, max=3600)
    ] = 0,
    every: Annotated[
        float,
        typer.Option(
            help="seconds from shot to shot, whatever the exposure; 0: as soon as possible",
            min=0,
            max=86400,
        ),
    ] = 0,
    velocity: Velocity = None,
    acceleration: Acceleration = None,
    dmx: LightFile = None,
    axes: AxesFile = None,
) -> None:
    """Shoot frames one by one, in motion (go-motion).

    The shutter and meter outputs release the camera. Ctrl-C brings the motors to rest softly, a
    second one harder, and reports which frames are shot.
    """
    from ..move.shoot import Shots, frames_of, spans

    both_or_neither(velocity, acceleration)
    for option, given in (
        ("--motors", motors is not None),
        ("--dmx", dmx is not None),
        ("--velocity", velocity is not None),
    ):
        if given and move is None:
            raise typer.BadParameter(f"{option} needs --move")
    if every and pause:
        raise typer.BadParameter("--every is from shot to shot, --pause between them: give one")
    wanted = frames_of(frames)
    known = load_axes(axes)
    content, lights = read_files(move, dmx, known) if move else (None, None)
    set_speeds = speeds(known, content, velocity, acceleration)
    blurred: list[int] = []
    if content:
        section(content, min(wanted), max(wanted), False)
        blurred = _motors(content, motors, known)
    shots = Shots(round(exposure * 1000), shutter_angle, content, blurred, settle, pause, every)
    done: list[int] = []
    try:
        with moving(device, known) as client:
            if not _has_camera(client):
                note("the device does not say that it has camera outputs: it may expose nothing")
            if content:
                for each in set_speeds:
                    set_speed(client, each)
                send(client, content, lights)
            late = _shoot(client, wanted, shots, done)
    except BaseException:
        if done:
            left = spans(wanted[len(done) :])
            print(f"{spans(done)} shot, {left} not", file=sys.stderr, flush=True)
        raise
    print(f"{len(done)} frame{'s' * (len(done) > 1)} shot: {spans(done)}")
    if late:
        print(f"{late} of them later than --every says: the rig and the exposure take longer")


def _motors(content: "Move", text: str | None, axes: "Axes") -> list[int]:
    """Parse --motors. Raises BadParameter for motors that the move does not have."""
    if text is None:
        return list(content.positions)
    if text == "none":
        return []
    found = []
    for word in text.split(","):
        found.append(axes.motor(word.strip()))
        if found[-1] not in content.positions:
            raise typer.BadParameter(
                f"--motors: expected motors of the move, {_listed(content.positions)}, "
                f"such as 1,3, or none, found {text[:40]!r}"
            )
    return found


def _listed(motors: "Iterable[int]") -> str:
    return ", ".join(map(str, motors))


def _shoot(client: "Client", wanted: list[int], shots: "Shots", done: list[int]) -> int:
    from rich.console import Console

    from ..move.move_display import ShotDisplay
    from ..move.shoot import shoot

    info = client.info or client.greet()
    names = shots.move.names if shots.move else {i: "" for i in range(1, info.motors + 1)}
    display = ShotDisplay(names, len(wanted), Console(highlight=False), client.axes)
    with display.running():
        return shoot(client, wanted, shots, display, done.append)


def add(app: typer.Typer) -> None:
    """Put these commands into the command line."""
    put(app, upload, play, shoot)
