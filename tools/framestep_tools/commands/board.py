"""Commands that put framestep on a board: install, flash."""

from pathlib import Path
from typing import Annotated

import typer

from ..errors import ToolError
from .common import Url, put

Board = Annotated[
    str | None,
    typer.Option(
        help="a name of boards/, such as pico or esp32_s3_595; without it the Pico of the chip",
        metavar="BOARD",
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
    port: Annotated[
        str | None,
        typer.Option(help="an ESP32's serial port, if it is not the only one", metavar="PORT"),
    ] = None,
    micropython: Annotated[
        Path | None,
        typer.Option(
            help="MicroPython for an ESP32, to be written first; erases the board", metavar="FILE"
        ),
    ] = None,
) -> None:
    """Put framestep on a board with BOOTSEL held, or an ESP32.

    Then ask it for its name and version.
    """
    from ..building.board_files import board_chip

    if board and board_chip(board).uf2_family is None:
        _refuse(board, {"--drive": drive, "--image": image, "--device": device})
        _onto_esp32(board, port, micropython)
    else:
        _refuse(board or "a board with BOOTSEL", {"--port": port, "--micropython": micropython})
        _onto_drive(board, drive, image, device)


def _refuse(board: str, options: dict[str, object]) -> None:
    """Raise ToolError for an option that means nothing for this board."""
    for name, value in options.items():
        if value is not None:
            raise ToolError(f"{name} is not for {board}")


def _onto_drive(
    board: str | None, drive: Path | None, image: Path | None, device: str | None
) -> None:
    from ..board import bootsel_drive, install
    from ..board.bootsel_drive import DriveError

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


def _onto_esp32(board: str, port: str | None, micropython: Path | None) -> None:
    from ..board import esp32_flash, file_install
    from ..client import port_finder

    wanted = file_install.package(board)
    path = port or port_finder.esp32_port()
    if micropython:
        esp32_flash.write(board, path, micropython, _say)
    file_install.install(wanted, path, _say)


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
    """Copy edited modules onto a board with framestep.

    rig.json and your other files stay.
    """
    from ..board import overlay

    overlay.flash(port, protocol, clean, _say)


def add(app: typer.Typer) -> None:
    """Put these commands into the command line."""
    put(app, install, flash)
