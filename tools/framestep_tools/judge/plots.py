"""Pictures of a played move."""

import os
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from .judge import Verdict, frame_times_ns
from .trace import Trace

_VELOCITY_BINS = 1000
_HIGH = 0.8  # height of a drawn level; its neighbour's low is at 1


def plot_move(
    verdict: Verdict,
    uploaded: Mapping[int, Sequence[int]],
    names: Mapping[int, str],
    path: str | os.PathLike[str],
):
    """Draw position, velocity and step-timing error of each motor over the run, as a PNG."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    motors = verdict.motors
    frame_s = frame_times_ns(verdict.frames, verdict.fps_milli) * 1e-9
    figure, axes = plt.subplots(
        3, len(motors), figsize=(4.2 * len(motors), 8.5), sharex=True, squeeze=False
    )
    for column, motor in enumerate(motors):
        position, velocity, error = axes[:, column]
        position.set_title(f"motor {motor.motor}: {names.get(motor.motor, '')}")
        position.plot(motor.edge_times_s, motor.edge_positions, linewidth=1.2, label="steps made")
        position.plot(
            frame_s,
            uploaded[motor.motor],
            ".",
            markersize=2.5,
            color="black",
            label="uploaded frames",
        )
        velocity.plot(
            *_velocity(motor.edge_times_s, motor.edge_positions, frame_s[-1]), linewidth=0.9
        )
        if len(motor.edge_error_us):
            error.plot(
                motor.edge_times_s, motor.edge_error_us, ",", color="tab:gray", label="each step"
            )
        error.plot(
            frame_s, motor.time_error_us, ".", markersize=3, color="tab:red", label="at the frames"
        )
        error.set_xlabel("seconds after the first frame")
    for row, label in zip(
        axes[:, 0], ("position, steps", "velocity, steps/s", "timing error, µs"), strict=True
    ):
        row.set_ylabel(label)
    axes[0, 0].legend(loc="best", fontsize="small")
    axes[2, 0].legend(loc="best", fontsize="small")
    for axis in axes.flat:
        axis.grid(alpha=0.3)
    figure.suptitle(f"{verdict.summary()}, {verdict.fps_milli / 1000:g} fps")
    figure.tight_layout()
    Path(path).parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=110)
    plt.close(figure)


def plot_trace(trace: Trace, path: str | os.PathLike[str]) -> None:
    """Draw each motor's position and velocity and the levels of all other pins, over the whole
    trace.

    Positions count from the trace's start. The file's ending decides the format: png, svg, pdf.
    """
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    levels = sorted(name for name in trace.signals if not name.removeprefix("m").isdecimal())
    times = np.concatenate([np.zeros(1), *(times for times, _ in trace.signals.values())]) * 1e-9
    begin, end = times[1:].min(initial=times.max()), times.max()
    figure, (position, velocity, level) = plt.subplots(
        3,
        figsize=(12, 7 + 0.2 * len(levels)),
        sharex=True,
        height_ratios=(3, 3, 0.4 + 0.25 * len(levels)),
    )
    for motor in trace.motors:
        stepped, reached = trace.positions(motor)
        stepped = stepped * 1e-9
        position.step(
            np.concatenate(([begin], stepped, [end])),
            np.concatenate(([0], reached, reached[-1:])),
            where="post",
            linewidth=1.2,
            label=f"motor {motor}",
        )
        # starts at the first edge, where the position is 0
        at, rate = _velocity(stepped - begin, reached, end - begin)
        velocity.plot(at + begin, rate, linewidth=0.9)
    for row, name in enumerate(reversed(levels)):
        changed, values = trace.signals[name]
        level.step(
            np.append(changed * 1e-9, end),
            row + _HIGH * np.append(values, values[-1:]),
            where="post",
            linewidth=1,
            color="black",
        )
    position.set_ylabel("position, steps")
    velocity.set_ylabel("velocity, steps/s")
    level.set_yticks(np.arange(len(levels)) + _HIGH / 2, list(reversed(levels)))
    level.set_xlabel("time of the board's clock, s")
    if trace.motors:
        position.legend(loc="best", fontsize="small")
    for axis in (position, velocity, level):
        axis.grid(alpha=0.3)
    figure.tight_layout()
    Path(path).parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=110)
    plt.close(figure)


def _velocity(
    times_s: np.ndarray, positions: np.ndarray, end_s: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return steps per second from the intervals between the edges, averaged over a thousandth of
    the run."""
    grid = np.linspace(0, end_s, _VELOCITY_BINS + 1)
    if len(times_s) < 2:
        return grid, np.zeros(len(grid))
    return (grid[1:] + grid[:-1]) / 2, np.diff(np.interp(grid, times_s, positions)) / np.diff(grid)
