"""The controller in the foreground, on this computer: `make sim`."""

import os
import sys
from typing import Annotated

import typer

from framestep.rig import RigError

from .boards import SimulatedBoard, read_rig
from .errors import Command
from .serve import Server, parse_speed

app = Command("sim", expected=(RigError,))

Tcp = Annotated[
    str | None, typer.Option(help="offer the protocol port as raw TCP too", metavar="HOST:PORT")
]
TraceFile = Annotated[
    str | None, typer.Option("--trace", help="write every edge as CSV as it comes", metavar="FILE")
]
Speed = Annotated[
    str, typer.Option(help="times real time, or max: as fast as it can while a client waits")
]
Rig = Annotated[str | None, typer.Option(help="the rig file", metavar="FILE")]
Board = Annotated[
    str, typer.Option(help="the board whose pins it has: a folder in boards/", metavar="NAME")
]


def _takes_a_view() -> bool:
    """Whether standard input and output are a terminal that takes keys and a picture."""
    if os.environ.get("TERM", "dumb") in ("", "dumb"):
        return False
    try:
        import termios  # noqa: F401 - not on Windows
    except ImportError:
        return False
    return sys.stdin.isatty() and sys.stdout.isatty()


@app.command()
def main(
    tcp: Tcp = None,
    trace: TraceFile = None,
    speed: Speed = "1",
    rig: Rig = None,
    board: Board = "pico",
    motors: Annotated[
        int | None,
        typer.Option(
            help="how many motors, whatever the board has; without it as many", min=1, max=12
        ),
    ] = None,
    plain: Annotated[
        bool, typer.Option("--plain", help="no live view, even in a terminal")
    ] = False,
) -> None:
    """Run the controller on the host HAL. In a terminal it shows what the board does, and keys
    press switches; elsewhere it prints the path of its pseudo-terminal, then `ready`."""
    pace = parse_speed(speed)
    simulated = SimulatedBoard(read_rig(rig), motors, board)
    simulated.wire_switches()
    if not plain and _takes_a_view():
        from .live import LiveServer

        server: Server = LiveServer(simulated, pace, tcp, trace)
    else:
        server = Server(simulated, pace, tcp, trace)
    server.run()
    server.tell_lost_time()


if __name__ == "__main__":
    app()
