"""`framestep rig`: check and edit the rig file."""

import codecs
from pathlib import Path
from typing import Annotated

import typer

from .common import Json, say_json

rig = typer.Typer(help="Check and edit the rig file, the settings on a board.")


@rig.command("check")
def rig_check(
    file: Annotated[Path, typer.Argument(help="a rig file", metavar="FILE", show_default=False)],
    board: Annotated[
        str, typer.Option(help="the board that the file is for, a folder of boards/")
    ] = "pico",
    json: Json = False,
) -> None:
    """Read a rig file as a board does; say what is wrong with it."""
    from ..board import rig_file
    from ..building.board_files import board_data

    content = rig_file.content_of(file)
    mark = content.startswith(codecs.BOM_UTF8)
    bare = content.removeprefix(codecs.BOM_UTF8)
    comments = rig_file.for_board(bare) != bare
    given = rig_file.read(file)
    found = rig_file.check(given, board_data(board), str(file))
    warnings = rig_file.warnings(given, board_data(board))
    if json:
        say_json(
            {
                "file": str(file),
                "board": board,
                "name": found.name.decode(),
                "settings": found.settings,
                "comments": comments,
                "byte_order_mark": mark,
                "warnings": warnings,
            }
        )
        return
    unread = ["begins with a byte order mark"] * mark + ["has // comments"] * comments
    print(
        f"{file} is valid for {board_data(board)['name']}: "
        f"{found.name.decode()!r}, {len(found.motors)} motor{'s' * (len(found.motors) != 1)} set"
        + (
            f"; it {' and '.join(unread)}, which a board does not read: "
            f"framestep rig edit {file} sends it without"
            if unread
            else ""
        )
    )
    for warning in warnings:
        print(f"warning: {warning}")


@rig.command("edit")
def rig_edit(
    file: Annotated[
        Path | None,
        typer.Argument(
            help="file to begin with instead of the board's, such as an earlier draft; "
            "it is not changed",
            metavar="FILE",
            show_default=False,
        ),
    ] = None,
    port: Annotated[
        str | None, typer.Option(help="port of the REPL; without it the only board on USB")
    ] = None,
    protocol: Annotated[
        str | None, typer.Option(help="port that Dragonframe uses, if it is not found by itself")
    ] = None,
    everything: Annotated[
        bool, typer.Option("--all", help="show every setting, not only those to begin with")
    ] = False,
) -> None:
    """Edit a board's rig file with $EDITOR, check it and put it back.

    Then the board restarts.
    """
    from ..board import rig_file
    from ..board.repl_device import Device

    rig_file.edit(Device(port), protocol, file, everything)


@rig.command("example")
def rig_example(
    board: Annotated[str, typer.Option(help="the board that the file is for")] = "pico",
) -> None:
    """Print a board's example rig file to begin with."""
    from .. import paths
    from ..building.board_files import board_data

    board_data(board)  # raises ToolError for an unknown name
    print((paths.BOARDS / board / "rig.json").read_text(encoding="utf-8"), end="")


@rig.command("schema")
def rig_schema() -> None:
    """Print the rig file's JSON Schema, for an editor that checks it."""
    from ..documents import rig_schema

    print(rig_schema.text(), end="")


def add(app: typer.Typer) -> None:
    """Put these commands into the command line."""
    app.add_typer(rig, name="rig")
