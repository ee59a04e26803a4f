"""`framestep sim`: the controller on this computer, without a board."""

import os
import sys
from typing import Annotated

import typer

from .common import put

_ADDRESS = "127.0.0.1:7000"  # on systems without pseudo-terminals

Tcp = Annotated[
    str | None, typer.Option(help="also offer the protocol port as raw TCP", metavar="HOST:PORT")
]
TraceFile = Annotated[
    str | None,
    typer.Option("--trace", help="write every edge as CSV, as it happens", metavar="FILE"),
]
Speed = Annotated[
    str, typer.Option(help="times real time, or max: as fast as it can while a client waits")
]
Rig = Annotated[str | None, typer.Option(help="the rig file", metavar="FILE")]
Board = Annotated[
    str, typer.Option(help="the board whose pins it has: a folder in boards/", metavar="NAME")
]


def _takes_a_view() -> bool:
    """Return whether standard input and output are a terminal for keys and a picture."""
    if os.environ.get("TERM", "dumb") in ("", "dumb"):
        return False
    try:
        import termios  # noqa: F401 - not on Windows
    except ImportError:
        return False
    return sys.stdin.isatty() and sys.stdout.isatty()


def sim(
    tcp: Tcp = None,
    trace: TraceFile = None,
    speed: Speed = "1",
    rig: Rig = None,
    board: Board = "pico",
    motors: Annotated[
        int | None,
        typer.Option(help="number of motors, if it is not the board's", min=1, max=24),
    ] = None,
    plain: Annotated[
        bool, typer.Option("--plain", help="no live view, even in a terminal")
    ] = False,
) -> None:
    """Simulate a board on this computer, to try framestep without one.

    In a terminal it shows what the board does, and keys press switches. Elsewhere it prints the
    path of its pseudo-terminal or its TCP address, then `ready`.
    """
    from framestep.rig import RigError

    from ..board.rig_file import with_suggestion
    from ..client.pty_port import can_make_one
    from ..errors import ToolError
    from ..simulator.boards import SimulatedBoard, read_rig
    from ..simulator.serve import Server, parse_speed

    pace = parse_speed(speed)
    if tcp is None and not can_make_one():
        tcp = _ADDRESS
    try:
        simulated = SimulatedBoard(read_rig(rig), motors, board)
    except RigError as error:
        raise ToolError(f"{rig}: {with_suggestion(str(error))}") from None
    simulated.wire_switches()
    if not plain and _takes_a_view():
        from ..simulator.live import LiveServer

        server: Server = LiveServer(simulated, pace, tcp, trace)
    else:
        server = Server(simulated, pace, tcp, trace)
    server.run()
    server.report_lost_time()


def add(app: typer.Typer) -> None:
    """Put this command into the command line."""
    put(app, sim)
