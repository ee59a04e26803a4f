"""`make emu`: run the unpatched firmware on the emulated board, in the foreground."""

import sys
from typing import Annotated

import typer

from framestep_emulator import EmulatorError

from ..building.board_files import CompileError
from ..building.images import BuildError
from ..errors import Command
from ..simulator.boards import EmulatedBoard, read_rig
from ..simulator.serve import Server, parse_speed
from .sim import Board, Rig, Speed, Tcp, TraceFile

app = Command("emu", expected=(EmulatorError, BuildError, CompileError))


@app.command()
def main(
    tcp: Tcp = None,
    trace: TraceFile = None,
    speed: Speed = "1",
    rig: Rig = None,
    board: Board = "pico",
    repl: Annotated[
        bool, typer.Option("--repl", help="offer the REPL on a pseudo-terminal")
    ] = False,
    repl_tcp: Annotated[
        str | None, typer.Option(help="offer the REPL as raw TCP", metavar="HOST:PORT")
    ] = None,
    single_port: Annotated[
        bool,
        typer.Option(
            "--single-port", help="one USB serial port for protocol and REPL (rig file: ports 1)"
        ),
    ] = False,
    flash: Annotated[
        str | None, typer.Option(help="keep the board's flash in this file", metavar="FILE")
    ] = None,
) -> None:
    """Run the firmware on the emulated board. Print the path of its pseudo-terminal, then
    `ready`."""
    pace = parse_speed(speed)
    settings = read_rig(rig)
    if single_port:
        settings["ports"] = 1
    if (repl or repl_tcp) and settings.get("ports") == 1:
        raise typer.BadParameter(
            "with a single port the REPL is on the protocol port: send it Ctrl-C there"
        )
    print("starting the emulated board", file=sys.stderr)
    emulated = EmulatedBoard(settings, trace is not None, flash, board)
    emulated.wire_switches()
    server = Server(emulated, pace, tcp, trace, repl, repl_tcp)
    server.run()
    server.report_lost_time()


if __name__ == "__main__":
    app()
