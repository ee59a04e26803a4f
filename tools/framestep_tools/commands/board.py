"""Commands that put framestep on a board: install, flash."""

from pathlib import Path
from typing import Annotated

import typer

from .common import Url, put

Board = Annotated[
    str | None,
    typer.Option(
        help="pico, pico2, skr_pico or fysetc_erb; without it the Pico of the chip", metavar="BOARD"
    ),
]


def _say(line: str) -> None:
    print(line, flush=True)


def install(
    device: Url = None,
    board: Board = None,
    drive: Annotated[
        Path | None,
        typer.Option(
            help="folder of the board's drive, if it is not found by itself", metavar="DIR"
        ),
    ] = None,
    image: Annotated[
        Path | None, typer.Option(help="a UF2 file other than framestep's own", metavar="FILE")
    ] = None,
) -> None:
    """Put framestep on a board that is plugged in with BOOTSEL held.

    Then ask it for its name and version.
    """
    from ..board import bootsel_drive, install
    from ..board.bootsel_drive import DriveError
    from ..building.board_files import board_data

    if board:
        board_data(board)  # raises ToolError for an unknown name
    if drive is None:
        found = bootsel_drive.wait(_say, install.DRIVE_S)
    else:
        known = bootsel_drive.look(drive)
        if known is None:
            raise DriveError(f"{drive} is not a board's drive: {bootsel_drive.PRESS}")
        found = known
    wanted = install.board_on(found, board)
    content = install.read(image) if image else install.image_of(wanted)
    install.onto_drive(wanted, content, found, device, _say)


def flash(
    port: Annotated[
        str | None,
        typer.Option(help="port of the REPL; without it the only board on USB", metavar="PORT"),
    ] = None,
    protocol: Annotated[
        str | None,
        typer.Option(
            help="port that Dragonframe will use, if it is not found by itself", metavar="PORT"
        ),
    ] = None,
    clean: Annotated[
        bool, typer.Option("--clean", help="remove the overlay and use the image's own modules")
    ] = False,
) -> None:
    """Copy edited modules onto a board with framestep's image.

    rig.json and your other files stay.
    """
    from ..board.overlay import flash_overlay

    flash_overlay(port, protocol, clean, _say)


def add(app: typer.Typer) -> None:
    """Put these commands into the command line."""
    put(app, install, flash)
