"""`make plots`: draw the smoothness of motion between frames, docs/internals/interpolation.svg.

It compares velocity and acceleration of framestep's cubics with the straight lines of dmc-lite, the
device that Dragonframe ships, for each motor of the demo's move. The cubics are reference.py's,
with the firmware's velocities at frames. dmc-lite calculates a position every 20 ms on the straight
line from frame to frame, and holds one velocity until the next. A jump of velocity has no
acceleration, so it is drawn spread over the whole 20 ms, the smallest acceleration that a motor
could use.

The same source makes the same file, byte for byte.
"""

import io
import os
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from ..building.board_files import ROOT
from ..errors import Command
from ..judge.judge import frame_times_ns
from ..judge.reference import Reference
from ..move.move_file import CAMERA_MOVE, Move, read_move

PICTURE = ROOT / "docs/internals/interpolation.svg"
FPS_MILLI = 24_000
LINEAR_GRID_S = 0.02
CLOSE_UP_S = 0.4
# points from frame to frame in the close-up, so a parabola looks smooth
_PER_FRAME = 4


def linear_velocity(positions: Sequence[int], fps_milli: int) -> tuple[np.ndarray, np.ndarray]:
    """Return (times in s, steps/s from each time on) of straight lines on a grid of 20 ms."""
    frames = frame_times_ns(len(positions), fps_milli) * 1e-9
    grid = np.arange(0, frames[-1], LINEAR_GRID_S)
    return grid[:-1], np.diff(np.interp(grid, frames, positions)) / LINEAR_GRID_S


def _close_up(reference: Reference, motor: int, frames: np.ndarray) -> float:
    """Return the start of the close-up around the highest acceleration, in whole 20 ms."""
    peak = frames[np.argmax(np.abs(reference.acceleration(motor, frames)))]
    begin = np.clip(peak - CLOSE_UP_S / 2, 0, frames[-1] - CLOSE_UP_S)
    return float(np.round(begin / LINEAR_GRID_S) * LINEAR_GRID_S)


def draw(move: Move, out: str | os.PathLike[str], fps_milli: int = FPS_MILLI) -> None:
    """Draw the picture of a move as SVG."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    reference = Reference(move.positions, fps_milli, 1000, 1000)
    frames = frame_times_ns(move.frames, fps_milli) * 1e-9
    fine = np.interp(
        np.arange((move.frames - 1) * _PER_FRAME + 1) / _PER_FRAME, np.arange(move.frames), frames
    )
    with plt.rc_context(
        {
            "svg.hashsalt": "framestep",  # else names in the file are random
            "svg.fonttype": "none",
            "font.size": 9,
            "axes.grid": True,
            "grid.alpha": 0.3,
        }
    ):
        figure, axes = plt.subplots(
            3, len(move.names), figsize=(3.3 * len(move.names), 7.2), squeeze=False
        )
        for column, (motor, name) in enumerate(move.names.items()):
            velocity, close, acceleration = axes[:, column]
            grid, linear = linear_velocity(move.positions[motor], fps_milli)
            smooth = reference.velocity(motor, fine)
            lines = {"color": "tab:orange", "linewidth": 0.7, "label": "linear at 50 Hz"}
            ours = {"color": "tab:blue", "linewidth": 1.1, "label": "framestep"}
            velocity.set_title(f"motor {motor}: {name}")
            velocity.step(grid, linear / 1000, where="post", **lines)
            velocity.plot(frames, smooth[::_PER_FRAME] / 1000, **ours)
            begin = _close_up(reference, motor, frames)
            near = (grid >= begin - LINEAR_GRID_S) & (grid <= begin + CLOSE_UP_S)
            inside = (fine >= begin - 0.05) & (fine <= begin + CLOSE_UP_S + 0.05)
            close.step(grid[near], linear[near] / 1000, where="post", **lines | {"linewidth": 1.0})
            close.plot(fine[inside], smooth[inside] / 1000, **ours | {"linewidth": 1.4})
            close.set_xlim(begin, begin + CLOSE_UP_S)
            velocity.axvspan(begin, begin + CLOSE_UP_S, color="0.9", zorder=0)
            acceleration.plot(grid[1:], np.diff(linear) / LINEAR_GRID_S / 1000, **lines)
            # acceleration is linear between frames and may jump at them
            ends = np.ravel(np.column_stack((frames[:-1], np.nextafter(frames[1:], 0))))
            acceleration.plot(ends, reference.acceleration(motor, ends) / 1000, **ours)
            acceleration.set_xlabel("seconds after the first frame")
        for row, label in zip(
            axes[:, 0],
            ("velocity, 1000 steps/s", "velocity, close-up", "acceleration, 1000 steps/s²"),
            strict=True,
        ):
            row.set_ylabel(label)
        axes[0, 0].legend(loc="upper right", fontsize="small")
        figure.tight_layout()
        drawn = io.StringIO()
        figure.savefig(drawn, format="svg", metadata={"Date": None})
        plt.close(figure)
    Path(out).parent.mkdir(parents=True, exist_ok=True)
    Path(out).write_text(_short(drawn.getvalue()))


def _short(svg: str) -> str:
    """Round the picture to a hundredth of a point, with a path on each line: half the size."""
    svg = re.sub(r"-?\d+\.\d{3,}", lambda number: f"{float(number[0]):.2f}", svg)
    return re.sub(r' d="[^"]*"', lambda path: re.sub(r" ?\n", "", path[0]), svg)


app = Command("plot_interpolation")


@app.command()
def main(
    move_file: Annotated[
        Path, typer.Option("--move", help="the move as CSV", metavar="FILE")
    ] = CAMERA_MOVE,
    out: Annotated[Path, typer.Option(help="the picture", metavar="FILE")] = PICTURE,
) -> int:
    """Draw velocity and acceleration between frames against linear interpolation."""
    draw(read_move(move_file), out)
    print(f"{out}: {out.stat().st_size // 1000} kB")
    return 0


if __name__ == "__main__":
    app()
