"""`framestep lab prove`: a board that measures itself."""

from pathlib import Path
from typing import Annotated

import typer

from ..errors import extra
from .common import Json, Url, put, say_json

_ASK = (
    "The step and direction pins of all motors will move, with up to 500 000 steps/s, and "
    "velocities will change. {drivers} Unplug anything else that is wired to these pins. Go on?"
)
_OFF = (
    "Drivers are held off by their enable pins: unplug those whose enable pin is not wired to the "
    "board, or their motors."
)
_ON = "Drivers are switched on and the motors turn, far and fast: take them off their loads."


def prove(
    device: Url = None,
    port: Annotated[
        str | None,
        typer.Option(help="port of the REPL, if it is not found by itself", metavar="PORT"),
    ] = None,
    board: Annotated[
        str | None,
        typer.Option(
            help="the board that it should be, a folder in boards/ such as pico; without it, any",
            metavar="NAME",
        ),
    ] = None,
    with_drivers: Annotated[
        bool, typer.Option("--with-drivers", help="let the drivers be switched on: motors turn")
    ] = False,
    short: Annotated[
        bool, typer.Option("--short", help="the first four motors, one frame rate")
    ] = False,
    yes: Annotated[bool, typer.Option("--yes", help="do not ask before pins move")] = False,
    out: Annotated[Path, typer.Option(help="folder for the report", metavar="DIR")] = Path(),
    json: Json = False,
) -> None:
    """Let a board measure itself, without wires.

    Then compare it with the emulated one.
    """
    with extra("prove"):
        from ..prove import report
        from ..prove.board import real
        from ..prove.measurement import Options
        from ..prove.measurement import prove as measure
    from ..building.board_files import board_data
    from ..client import port_finder
    from ..errors import ToolError

    if board:
        board_data(board)  # raises ToolError for an unknown name
    emulated = report.emulated_boards()
    device = device or port_finder.protocol_port()  # report a missing board first
    if not yes:
        text = _ASK.format(drivers=_ON if with_drivers else _OFF)
        if not typer.confirm(text, err=True):
            raise typer.Abort

    def say(line: str) -> None:
        typer.echo(line, err=True)

    with real(device, port, board, say) as connected:
        found = measure(connected, Options(with_drivers, short), emulated, say)
    paths = found.write(out)
    if json:
        say_json(found.as_json())
    else:
        report.show(found)
    found.raise_broken_off(paths[1])
    if not json:
        print(f"{paths[1]} is a report to attach to an issue: docs/use/hardware-reports.md")
    if found.complaints:
        raise ToolError(f"{len(found.complaints)} things are not as they should be")


def add_lab(app: typer.Typer) -> None:
    """Put this command into the laboratory."""
    put(app, prove)
