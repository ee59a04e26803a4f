"""The controller in the foreground, on this computer: `make sim`."""

from typing import Annotated

import typer

from .boards import SimulatedBoard, read_rig
from .errors import Command
from .serve import Server, parse_speed

app = Command("sim")

Tcp = Annotated[str | None, typer.Option(help="offer the protocol port as raw TCP too", metavar="HOST:PORT")]
TraceFile = Annotated[str | None, typer.Option("--trace", help="write every edge as CSV as it comes", metavar="FILE")]
Speed = Annotated[str, typer.Option(help="times real time, or max: as fast as it can while a client waits")]
Rig = Annotated[str | None, typer.Option(help="the rig file", metavar="FILE")]


@app.command()
def main(
    tcp: Tcp = None,
    trace: TraceFile = None,
    speed: Speed = "1",
    rig: Rig = None,
    motors: Annotated[int, typer.Option(help="how many motors the board has", min=1, max=32)] = 8,
) -> None:
    """Run the controller on the host HAL; prints the path of its pseudo-terminal, then `ready`."""
    pace = parse_speed(speed)
    Server(SimulatedBoard(read_rig(rig), motors), pace, tcp, trace).run()


if __name__ == "__main__":
    app()
