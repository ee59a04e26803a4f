"""Conversion of moves: from other programs' formats to steps, and back."""

from pathlib import Path
from typing import Annotated, Any

import typer

from ..errors import extra
from .common import AxesFile, SpokenCommand, fps_of, note, put_once

# spelled out, so that --help loads none of them
_FORMATS = "gltf, usd, arc, anim, ae, aejson, bvh, flair, kuper, csv, raw, chan"


def _format(name: str | None) -> str | None:
    from ..move.move_formats import FORMATS

    if name is not None and name not in FORMATS:
        raise typer.BadParameter(f"{name!r} is not one of {', '.join(FORMATS)}")
    return name


def _decimal(word: str | None) -> str | None:
    from ..text.numerals import WORDS

    if word is None:
        return None
    if word not in WORDS:
        raise typer.BadParameter(f"{word!r} is not one of {', '.join(WORDS)}")
    return WORDS[word]


def _speed(text: str) -> float:
    """Return a share such as 50%. Raises BadParameter."""
    number, sign, rest = text.strip().partition("%")
    try:
        share = float(number) / 100 if sign and not rest else 0.0
    except ValueError:
        share = 0.0
    if not 0.001 <= share <= 10:
        raise typer.BadParameter(
            f"expected a share from 0.1% to 1000%, such as 50%, found {text[:40]!r}"
        )
    return share


def _smooth(text: str) -> int:
    """Return an odd number of frames. Raises BadParameter."""
    from ..move.smoothing import FEWEST, MOST

    frames = int(text) if text.isascii() and text.isdecimal() and len(text) < 9 else 0
    if not FEWEST <= frames <= MOST or frames % 2 == 0:
        raise typer.BadParameter(
            f"expected an odd number of frames from {FEWEST} to {MOST}, found {text[:40]!r}"
        )
    return frames


def _columns(given: list[str] | None) -> dict[str, str]:
    """Return column by axis."""
    found = {}
    for text in given or []:
        axis, sign, column = text.partition("=")
        if not (axis and sign and column):
            raise typer.BadParameter(
                f"--column: expected AXIS=COLUMN such as pan=ry or pan=5, found {text[:80]!r}"
            )
        put_once(found, axis.strip(), column.strip(), "--column")
    return found


def _camera(given: list[str] | None) -> dict[str, Any]:
    """Return values of keys of [camera] as TOML has them, or as text."""
    from ..axes.axes_file import toml_value
    from ..move.camera_rig import KEYS

    found: dict[str, Any] = {}
    for text in given or []:
        key, sign, value = (part.strip() for part in text.partition("="))
        if not (key and sign and value) or key not in KEYS:
            raise typer.BadParameter(
                f"--camera: expected KEY=VALUE with one of {', '.join(KEYS)}, found {text[:80]!r}"
            )
        for written in (value, f"[{value}]", f'"{value}"'):
            try:
                taken = toml_value(written)
                break
            except ValueError:
                continue
        else:
            continue
        if key == "ignore" and isinstance(taken, str):
            taken = [each.strip() for each in value.split(",")]
        put_once(found, key, taken, "--camera")
    return found


CameraKeys = Annotated[
    list[str] | None,
    typer.Option(
        "--camera",
        metavar="KEY=VALUE",
        help="another value of a key of [camera] in axes.toml: origin=first, up=z; may be repeated",
    ),
]
Format = Annotated[
    str | None,
    typer.Option("--format", "-f", help=_FORMATS, metavar="FORMAT", callback=_format),
]


def import_move(
    file: Annotated[Path, typer.Argument(help="the move of another program", show_default=False)],
    output: Annotated[
        Path, typer.Option("--output", "-o", help="CSV in steps, for upload", show_default=False)
    ],
    axes: AxesFile = None,
    file_format: Format = None,
    fps: Annotated[
        float | None,
        typer.Option(
            help="frames per second, for a file that does not name them; needed if it is in "
            "seconds",
            parser=fps_of,
            metavar="N",
        ),
    ] = None,
    column: Annotated[
        list[str] | None,
        typer.Option(
            metavar="AXIS=COLUMN",
            help="the column of an axis by its heading or its number from 1: pan=ry, pan=5; may "
            "be repeated",
        ),
    ] = None,
    decimal: Annotated[
        str | None,
        typer.Option(
            help="point or comma: the decimal sign of a file that leaves it open",
            metavar="SIGN",
            callback=_decimal,
        ),
    ] = None,
    to_fps: Annotated[
        float | None,
        typer.Option(
            help="other frames per second for the move, which takes as long as before",
            parser=fps_of,
            metavar="N",
        ),
    ] = None,
    speed: Annotated[
        float | None,
        typer.Option(
            help="another speed of the move, such as 50%: twice as many frames",
            parser=_speed,
            metavar="PERCENT",
        ),
    ] = None,
    smooth: Annotated[
        int | None,
        typer.Option(
            help="smooth noisy positions over this odd number of frames, such as 5",
            parser=_smooth,
            metavar="FRAMES",
        ),
    ] = None,
    unwrap: Annotated[
        bool,
        typer.Option(
            "--unwrap/--no-unwrap",
            help="rotations that jump by a full turn go on instead, or jump",
        ),
    ] = True,
    start: Annotated[
        int | None, typer.Option(help="number of the first frame", min=-(10**9), max=10**9)
    ] = None,
    camera: CameraKeys = None,
) -> None:
    """Convert another program's file to a move in steps.

    An Arc scene (.arcx) with -o axes.toml gives the names and units of its motors.
    """
    from ..axes import rig_axes
    from ..errors import ToolError
    from ..move.camera_rig import rig_of
    from ..move.move_conversion import to_move
    from ..move.move_file import or_example, write_move
    from ..move.move_formats import FORMATS, of_content
    from ..text.text_file import listed, read_text

    if smooth:
        with extra("--smooth"):
            import scipy  # noqa: F401
    _not_itself(file, output)
    source = or_example(file)
    text, said = read_text(source)
    chosen = FORMATS[file_format] if file_format else of_content(text, str(source))
    if output.suffix.lower() == ".toml":
        if chosen.NAME != "arc":
            raise ToolError(f"{output}: only an Arc scene (.arcx) gives an axes.toml")
        print(f"{output}: {_write_axes(text, source, output)}")
        return
    recording = chosen.read(text, str(source), decimal)
    found = rig_axes.find(axes)
    if not found or not rig_axes.exists(found):
        raise ToolError(
            f"there is no {found or rig_axes.FILE}, which assigns the axes of {file} "
            f"({listed(recording.names)}) to motors; docs/use/axes.md shows one"
        )
    rig = rig_axes.load(found, every_motor=True)
    known = rig.list
    move, left = to_move(
        recording,
        known,
        str(source),
        fps,
        start,
        _columns(column),
        unwrap,
        smooth,
        rig_of(rig, _camera(camera)),
        posed=bool(camera),
    )
    if to_fps or speed:
        from ..move.resample import resampled

        if to_fps and not move.fps:
            raise ToolError(f"{source} does not name its frames per second: name them by --fps")
        ratio = (move.fps or 1.0) / to_fps if to_fps else 1.0
        move = resampled(move, known, ratio * (speed or 1.0), to_fps or move.fps)
    write_move(output, move)
    note(*said, *move.said)
    if left:
        note(f"left out, no axis names them: {listed(left)}")
    print(
        f"{output}: frames {move.start_frame} to {move.end_frame}"
        + (f" at {move.fps:.10g} frames/s" if move.fps else "")
        + f" for {len(known)} motor{'s' * (len(known) > 1)}, from {chosen.NAME}"
    )


def _write_axes(text: str, source: Path, output: Path) -> str:
    """Write the axes.toml of an Arc scene, and return the names of its axes."""
    from ..axes.axes_file import axes_of
    from ..move.move_formats.arc import axes_toml
    from ..text.text_file import write_text

    written = axes_toml(text, str(source))
    axes = axes_of(written, output)
    write_text(output, written)
    return ", ".join(f"{axis.name} (motor {axis.motor})" for axis in axes)


def export_move(
    move: Annotated[
        Path, typer.Argument(help="CSV in steps, as for upload", metavar="CSV", show_default=False)
    ],
    output: Annotated[
        Path, typer.Option("--output", "-o", help="the file to write", show_default=False)
    ],
    axes: AxesFile = None,
    file_format: Format = None,
    fps: Annotated[
        float | None,
        typer.Option(
            help="csv: write seconds, at this many frames per second; anim, ae, aejson, bvh, "
            "flair, gltf, usd: the file's rate, else the move's own",
            parser=fps_of,
            metavar="N",
        ),
    ] = None,
    pose: Annotated[
        bool,
        typer.Option("--pose", help="the camera's pose, by [camera] in axes.toml, not the axes"),
    ] = False,
    camera: CameraKeys = None,
) -> None:
    """Write a move in steps as another program's file."""
    from ..axes import rig_axes
    from ..errors import ToolError
    from ..move.any_file import read_any
    from ..move.camera_rig import rig_of
    from ..move.move_conversion import left_by_pose, to_pose_table, to_table
    from ..move.move_file import or_example
    from ..move.move_formats import FORMATS, WITH_RATE, of_name
    from ..text.text_file import listed, write_text

    _not_itself(move, output)
    chosen = FORMATS[file_format] if file_format else of_name(output)
    if fps is not None and chosen.NAME not in WITH_RATE:
        raise typer.BadParameter(f"--fps is for {', '.join(WITH_RATE)}; {chosen.NAME} has no rate")
    found = rig_axes.find(axes) or rig_axes.FILE
    axes_of_rig = rig_axes.load(found, every_motor=True)
    content = read_any(or_example(move), axes_of_rig, fps)
    left: list[str] = []
    if pose or camera:
        rig = rig_of(axes_of_rig, _camera(camera))
        if rig is None:
            raise ToolError(f"--pose needs [camera] in {found}, see docs/use/virtual-axes.md")
        table = to_pose_table(content, axes_of_rig.list, rig, chosen.CAMERA)
        left = left_by_pose(content, axes_of_rig.list, rig)
    else:
        table = to_table(content, axes_of_rig.list)
    write_text(output, chosen.write(table, fps))
    note(*content.said)
    if left:
        note(f"left out, no part of the camera's pose: {listed(left)}")
    count = len(table.columns)
    print(
        f"{output}: frames {table.frames[0]} to {table.frames[-1]} of {count} "
        f"ax{'e' if count > 1 else 'i'}s, as {chosen.NAME}"
    )


def _not_itself(source: Path, output: Path) -> None:
    if output.exists() and source.exists() and output.samefile(source):
        raise typer.BadParameter(f"{output} is the file to read; name another one with -o")


def add(app: typer.Typer) -> None:
    """Put these commands into the command line."""
    app.command("import", cls=SpokenCommand)(import_move)
    app.command("export", cls=SpokenCommand)(export_move)
