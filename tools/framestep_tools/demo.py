"""`make demo`: play a camera move on a board and check every edge on its pins.

The move is uploaded, played with pre-roll and post-roll, and judged from the pins.
`build/demo/trace.csv` gets the edges, `build/demo/move.png` the picture. The last line has the
number of frames, the worst position error at a frame in steps, and the worst frame time error in
µs. The exit status is 1 if the move was not played as uploaded.
"""

import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

from .axes import rig_axes
from .building.board_files import ROOT, board_data, emulated_boards
from .client.client import Client
from .errors import Command, ToolError
from .judge.judge import Verdict, judge
from .judge.plots import plot_move
from .judge.reference import Reference
from .judge.trace import Trace, TraceWriter
from .move.move_display import MoveDisplay
from .move.move_file import CAMERA_MOVE, Move, read_move
from .payloads import (
    Hi,
    MotorGetPosition,
    MotorSetSpeed,
    MotorStatus,
    RtEnd,
    RtGo,
    RtRunMove,
)
from .simulator.boards import Board, EmulatedBoard, LockstepPort, SimulatedBoard

VELOCITY = 20_000  # steps/s
ACCELERATION = 100_000  # steps/s²
ROLL_MS = 1000
UPLOAD_WINDOW = 4
SETTLE_S = 0.2  # board time after the run, so the trace contains its last edges
_RESULT_FOLDER = ROOT / "build" / "demo"


class Recorder:
    """Collects a board's edges, and writes them to a file as they come."""

    def __init__(self, board: Board, path: Path):
        self.board = board
        self.writer = TraceWriter(path)
        self.edges: list = []

    def collect(self) -> None:
        """Collect the edges so far."""
        edges = self.board.edges()
        self.edges += edges
        self.writer.add(edges)
        self.writer.release(self.board.now_ns)
        self.writer.flush()

    def trace(self) -> Trace:
        """Close the file. Return all collected edges."""
        self.collect()
        self.writer.close()
        return Trace.from_edges(self.edges)


def fitting(move: Move, motors: int) -> Move:
    """Return the example move for a board with this many motors: without the others."""
    return replace(
        move,
        names={motor: name for motor, name in move.names.items() if motor <= motors},
        positions={motor: steps for motor, steps in move.positions.items() if motor <= motors},
    )


Standing = dict[int, int]  # motor -> position in steps


def play(
    client: Client, move: Move, fps_milli: int, recorder: Recorder, display: MoveDisplay
) -> tuple[Standing, Standing]:
    """Upload a move and play it once. Return the reported positions before and after."""
    info = client.request(Hi())
    display.phase(f"{info.name}: {info.motors} motors, holds {info.upload_frames} frames")
    if info.motors < len(move.positions):
        raise ToolError(f"the move needs {len(move.positions)} motors, the board has {info.motors}")
    start = standing(client)
    for motor in move.positions:
        client.request(MotorSetSpeed(motor, VELOCITY, ACCELERATION))
    display.phase("upload")
    client.upload_move(move.start_frame, move.end_frame, move.positions, UPLOAD_WINDOW)
    display.phase("pre-roll")
    client.request(RtRunMove(fps_milli, move.start_frame, move.end_frame, ROLL_MS, ROLL_MS))
    while not client.request(MotorStatus()).idle:
        client.pump(0.1)
        recorder.collect()
    display.phase("running")
    client.events.clear()
    client.request(RtGo())
    limit = client.clock() + 2 * ROLL_MS / 1000 + move.frames * 1000 / fps_milli + 10
    while not client.take_event(RtEnd):
        if client.clock() > limit:
            raise ToolError("the run did not end: no RT_END came from the board")
        client.pump(0.1)
        recorder.collect()
    display.phase("at rest")
    client.wait_idle()
    client.pump(SETTLE_S)
    return start, standing(client)


def standing(client: Client) -> Standing:
    """Return the reported positions."""
    return dict(enumerate(client.request(MotorGetPosition()).steps, 1))


def show_verdict(verdict: Verdict, move: Move, console: Console) -> None:
    """Print a table with a line per motor, then the complaints."""
    table = Table(
        box=None,
        title="steps on the pins against the upload and its ideal path",
        title_justify="left",
    )
    for name in (
        "motor",
        "axis",
        "steps in the run",
        "worst position error",
        "worst time error, µs",
        "worst step, µs",
    ):
        table.add_column(name, justify="right")
    for motor in verdict.motors:
        table.add_row(
            str(motor.motor),
            move.names[motor.motor],
            str(len(motor.edge_times_s)),
            str(motor.worst_position),
            f"{motor.worst_time_us:.1f}",
            f"{motor.worst_edge_us:.1f}",
        )
    console.print(table)
    for complaint in verdict.complaints:
        console.print(complaint, style="red")


app = Command("demo")


@app.command()
def main(
    board: Annotated[
        str, typer.Option(help="a folder in boards/, or all that are emulated")
    ] = "pico",
    host: Annotated[
        bool, typer.Option("--host", help="simulated on this computer instead of emulated")
    ] = False,
    fps: Annotated[float, typer.Option(help="frames per second", min=0.1, max=120)] = 24,
    move_file: Annotated[
        Path, typer.Option("--move", help="the move as CSV", metavar="FILE")
    ] = CAMERA_MOVE,
    out: Annotated[
        Path, typer.Option(help="folder for the trace and the picture", metavar="DIR")
    ] = _RESULT_FOLDER,
) -> int:
    """Play a camera move and check every edge."""
    if board != "all":
        return play_on(board, host, fps, move_file, out)
    return max(play_on(each, host, fps, move_file, out / each) for each in emulated_boards())


def play_on(board: str, host: bool, fps: float, move_file: Path, out: Path) -> int:
    """Play the move on one board, check it, plot it, and return the exit status."""
    console = Console(highlight=False)
    data = board_data(board)
    if not host and board not in emulated_boards():
        raise ToolError(
            f"{data['name']} is not emulated, as its chip is {data['chip']}: add --host"
        )
    move = read_move(move_file, None if move_file == CAMERA_MOVE else rig_axes.load())
    if move_file == CAMERA_MOVE:
        move = fitting(move, len(data["step"]))
    fps_milli = round(fps * 1000)
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ToolError(f"cannot write {out}: {error.strerror}") from None
    console.print(f"bringing up {'a simulated' if host else 'an emulated'} {data['name']}")
    device: Board = SimulatedBoard(board=board) if host else EmulatedBoard(board=board)
    began, begun_ns = time.monotonic(), device.now_ns
    began_ms = device.emulator.cmd("time")["cpu_ms"] if isinstance(device, EmulatedBoard) else 0
    try:
        recorder = Recorder(device, out / "trace.csv")
        display = MoveDisplay(move.names, move.start_frame, move.end_frame, console)
        with Client(LockstepPort(device)) as client, display.running():
            client.on_event = display.show
            start, end = play(client, move, fps_milli, recorder, display)
        trace = recorder.trace()
        times = f"{(device.now_ns - begun_ns) * 1e-9:.1f} s of the board's time in "
        times += f"{time.monotonic() - began:.1f} s"
        if isinstance(device, EmulatedBoard):
            used_ms = device.emulator.cmd("time")["cpu_ms"] - began_ms
            times += f", of which its emulator has used {used_ms / 1000:.1f} s of a processor"
    finally:
        device.close()
    path = Reference(move.positions, fps_milli, ROLL_MS, ROLL_MS)
    verdict = judge(trace, move.positions, fps_milli, start, end, path)
    show_verdict(verdict, move, console)
    plot_move(verdict, move.positions, move.names, out / "move.png")
    console.print(times)
    console.print(f"edges in {_shown(out / 'trace.csv')}, picture in {_shown(out / 'move.png')}")
    sys.stdout.flush()
    print(verdict.summary())
    return 0 if verdict.good else 1


def _shown(path: Path) -> Path:
    path = path.absolute()
    return path.relative_to(Path.cwd()) if path.is_relative_to(Path.cwd()) else path


if __name__ == "__main__":
    app()
