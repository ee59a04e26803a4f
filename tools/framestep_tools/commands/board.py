"""framestep onto a board: install, flash, uf2."""

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
            help="folder of the board's drive, where it is not found by itself", metavar="DIR"
        ),
    ] = None,
    image: Annotated[
        Path | None, typer.Option(help="another UF2 file than framestep's own", metavar="FILE")
    ] = None,
) -> None:
    """Put framestep on a board that is plugged in with BOOTSEL held.

    Then ask it who it is.
    """
    from .. import drives, install
    from ..drives import DriveError
    from ..files import board_data

    if board:
        board_data(board)  # there is one of this name
    if drive is None:
        found = drives.wait(_say, install.DRIVE_S)
    else:
        known = drives.look(drive)
        if known is None:
            raise DriveError(f"{drive} is no board's drive: {drives.PRESS}")
        found = known
    wanted = install.board_on(found, board)
    content = install.read(image) if image else install.image_of(wanted)
    install.onto_drive(wanted, content, found, device, _say)


def flash(
    board: Annotated[
        str, typer.Option(help="pico, pico2, skr_pico or fysetc_erb", metavar="BOARD")
    ] = "pico",
    port: Annotated[
        str | None,
        typer.Option(help="port of the REPL; without it the only board on USB", metavar="PORT"),
    ] = None,
    protocol: Annotated[
        str | None,
        typer.Option(
            help="port that Dragonframe will use, where it cannot be told", metavar="PORT"
        ),
    ] = None,
    clean: Annotated[
        bool, typer.Option("--clean", help="back to the modules of the board's image")
    ] = False,
) -> None:
    """Copy edited modules onto a board with framestep's image.

    On a board without one, copy framestep beside its MicroPython.

    rig.json and other files of yours stay.
    """
    from ..flash import flash_board
    from ..overlay import flash_overlay

    if not flash_overlay(port, protocol, clean, _say):
        flash_board(board, port, protocol, _say)


def uf2(
    micropython: Annotated[
        Path,
        typer.Option("--micropython", help="MicroPython's UF2 file, 1.26 or newer", metavar="FILE"),
    ],
    out: Annotated[Path, typer.Option("--out", "-o", help="the UF2 file to make", metavar="FILE")],
    board: Board = None,
    rig: Annotated[Path | None, typer.Option(help="a rig file to put in", metavar="FILE")] = None,
) -> None:
    """Join MicroPython's UF2 file with framestep: one file to drop.

    It writes the board's file system as a whole: files that are on the board go, rig.json too.
    """
    from .. import rig_file
    from ..errors import ToolError
    from ..files import board_data
    from ..install import joined, read

    content = rig_file.for_board(read(rig)) if rig else None
    name, made = joined(read(micropython), str(micropython), board, content)
    if content is not None:
        rig_file.check(rig_file.parse(content, str(rig)), board_data(name), str(rig))
    try:
        out.write_bytes(made)
    except OSError as error:
        raise ToolError(f"cannot write {out}: {error.strerror}") from None
    print(
        f"{out}, {len(made) // 1024} kB: "
        f"plug the {board_data(name)['name']} in with BOOTSEL held, drop it there"
    )


def add(app: typer.Typer) -> None:
    """Put these commands into the command line."""
    put(app, install, flash, uf2)
