"""`framestep check --plot`: a picture of a move's path before anything moves."""

import os
from pathlib import Path

import numpy as np

from .move_check import MoveVerdict

_SAMPLES = 4000
_MEAN_OF_FRAMES = 3  # the acceleration of a path through whole steps looks like noise


def plot(found: MoveVerdict, path: str | os.PathLike[str]) -> None:
    """Draw position, velocity and acceleration of each motor over the run, with its limits.

    The file's ending decides the format: png, svg, pdf.
    """
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    run = found.run
    frames = abs(run.end_frame - run.start_frame) + 1
    span = _MEAN_OF_FRAMES * 1000 / run.fps_milli
    figure, axes = plt.subplots(
        3, len(found.motors), figsize=(4.2 * len(found.motors), 8.5), sharex=True, squeeze=False
    )
    for column, each in enumerate(found.motors):
        knots, _ = each.path.pieces(each.motor)
        t = np.linspace(knots[0], knots[-1], _SAMPLES)
        top = each.setting
        velocity, acceleration = each.path.velocity, each.path.acceleration(each.motor, t)
        mean = velocity(each.motor, t + span / 2) - velocity(each.motor, t - span / 2)
        axes[2, column].plot(t, mean / span, linewidth=1.3)
        for axis, value, limits, alpha in (
            (axes[0, column], each.path(each.motor, t), (top.lower, top.upper), 1),
            (axes[1, column], velocity(each.motor, t), (-top.velocity, top.velocity), 1),
            (axes[2, column], acceleration, (-top.acceleration, top.acceleration), 0.25),
        ):
            axis.plot(t, value, linewidth=1, alpha=alpha, color="tab:blue")
            low, high = min(value), max(value)
            for limit in limits:
                # a distant limit would flatten the curve
                if limit is not None and abs(limit) <= 2 * max(abs(low), abs(high), 1):
                    axis.axhline(limit, color="tab:red", linewidth=0.8, linestyle="--")
            for edge in (0, frames * 1000 / run.fps_milli):
                axis.axvline(edge, color="gray", linewidth=0.6)
            axis.grid(alpha=0.3)
        axes[0, column].set_title(f"motor {each.motor}, {each.name}: {each.verdict}")
        axes[2, column].set_xlabel("seconds after the first frame")
    for axis, label in zip(
        axes[:, 0],
        ("position, steps", "velocity, steps/s", "acceleration, steps/s²"),
        strict=True,
    ):
        axis.set_ylabel(label)
    figure.suptitle(
        f"frames {run.start_frame} to {run.end_frame} at {run.fps_milli / 1000:g} frames/s; "
        "dashed: what is set; between the lines: the frames; "
        f"acceleration: mean of {_MEAN_OF_FRAMES} frames, and faint as it is through whole steps"
    )
    figure.tight_layout()
    Path(path).parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=110)
    plt.close(figure)
