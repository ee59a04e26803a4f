"""`framestep rig`: what a user changes on a board."""

from pathlib import Path
from typing import Annotated

import typer

from .common import Json, say_json

rig = typer.Typer(help="The rig file: what a user changes on a board.")


@rig.command("check")
def rig_check(
    file: Annotated[Path, typer.Argument(help="a rig file", metavar="FILE", show_default=False)],
    board: Annotated[
        str, typer.Option(help="the board that it is for, a folder of boards/")
    ] = "pico",
    json: Json = False,
) -> None:
    """Read a rig file as a board does; say what is wrong with it."""
    from .. import rig_file
    from ..files import board_data

    found = rig_file.check(rig_file.read(file), board_data(board), str(file))
    if json:
        say_json(
            {
                "file": str(file),
                "board": board,
                "name": found.name.decode(),
                "settings": found.settings,
            }
        )
        return
    print(
        f"{file} is right for {board_data(board)['name']}: "
        f"{found.name.decode()!r}, {len(found.motors)} motors set"
    )


@rig.command("edit")
def rig_edit(
    port: Annotated[
        str | None, typer.Option(help="port of the REPL; without it the only board on USB")
    ] = None,
    protocol: Annotated[
        str | None, typer.Option(help="port that Dragonframe uses, where it cannot be told")
    ] = None,
) -> None:
    """Fetch a board's rig file, edit it with $EDITOR, check it, put it back and restart."""
    from .. import rig_file
    from ..device import Device

    rig_file.edit(Device(port), protocol)


@rig.command("example")
def rig_example(
    board: Annotated[str, typer.Option(help="the board that it is for")] = "pico",
) -> None:
    """Print a board's example rig file, to begin with."""
    from .. import home
    from ..files import board_data

    board_data(board)  # is there such a board?
    print((home.BOARDS / board / "rig.json").read_text(encoding="utf-8"), end="")


@rig.command("schema")
def rig_schema() -> None:
    """Print the rig file's JSON Schema, with which an editor completes and checks a file."""
    from .. import rig_schema

    print(rig_schema.text(), end="")


def add(app: typer.Typer) -> None:
    """Put these commands into the command line."""
    app.add_typer(rig, name="rig")
