"""Conversion of moves: from other programs' formats to steps, and back."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from .common import AxesFile, SpokenCommand

_FORMATS = "arc, anim, kuper, csv, raw"  # spelled out, so that --help loads none of them


def _format(name: str | None) -> str | None:
    from ..move.move_formats import FORMATS

    if name is not None and name not in FORMATS:
        raise typer.BadParameter(f"{name!r} is not one of {', '.join(FORMATS)}")
    return name


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
        typer.Option(help="frames per second, for a file in seconds", min=0.001, max=1000),
    ] = None,
    start: Annotated[
        int | None, typer.Option(help="number of the first frame", min=-(10**9), max=10**9)
    ] = None,
) -> None:
    """Convert another program's file to a move in steps."""
    from ..errors import ToolError
    from ..move import rig_axes
    from ..move.axes_file import read_axes
    from ..move.move_conversion import to_move
    from ..move.move_file import text_of, write_move
    from ..move.move_formats import FORMATS, of_content

    _not_itself(file, output)
    text = text_of(file)
    chosen = FORMATS[file_format] if file_format else of_content(text, str(file))
    recording = chosen.read(text, str(file))
    found = rig_axes.find(axes)
    if not found or not found.exists():
        raise ToolError(
            f"there is no {found or rig_axes.FILE}, which assigns the axes of {file} "
            f"({', '.join(recording.names)}) to motors; docs/use/axes.md shows one"
        )
    known = read_axes(found, every_motor=True)
    move, left = to_move(recording, known, str(file), fps, start)
    write_move(output, move)
    if left:
        print(f"left out, no axis names them: {', '.join(left)}", file=sys.stderr)
    print(
        f"{output}: frames {move.start_frame} to {move.end_frame} for {len(known)} motors, "
        f"from {chosen.NAME}"
    )


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
            help="csv: write seconds, at this many frames per second; anim: Maya's rate",
            min=0.001,
            max=1000,
        ),
    ] = None,
) -> None:
    """Write a move in steps as another program's file."""
    from ..move import rig_axes
    from ..move.axes_file import read_axes
    from ..move.move_conversion import to_table
    from ..move.move_file import or_example, read_move, write_text
    from ..move.move_formats import FORMATS, of_name

    _not_itself(move, output)
    chosen = FORMATS[file_format] if file_format else of_name(output)
    if fps is not None and chosen.NAME not in ("csv", "anim"):
        raise typer.BadParameter(f"--fps is for csv and anim; {chosen.NAME} has frames")
    found = rig_axes.find(axes) or rig_axes.FILE
    table = to_table(read_move(or_example(move)), read_axes(found, every_motor=True))
    write_text(output, chosen.write(table, fps))
    print(
        f"{output}: frames {table.frames[0]} to {table.frames[-1]} of {len(table.columns)} axes, "
        f"as {chosen.NAME}"
    )


def _not_itself(source: Path, output: Path) -> None:
    if output.exists() and source.exists() and output.samefile(source):
        raise typer.BadParameter(f"{output} is the file to read; name another one with -o")


def add(app: typer.Typer) -> None:
    """Put these commands into the command line."""
    app.command("import", cls=SpokenCommand)(import_move)
    app.command("export", cls=SpokenCommand)(export_move)
