"""Makes camera_move.csv: a crane shot of 240 frames, ten seconds at 24 fps. `python generate.py`
writes it again.

Each axis runs through knots of (frame, steps, steps per frame), joined by quintics with zero
acceleration at the knots. As in real moves, the track is already rolling at the first frame and the
pan is still turning at the last one, so there is a pre-roll and a post-roll. The track holds in the
middle, and the swing turns back.
"""

import csv
from itertools import pairwise
from pathlib import Path

import numpy as np

FRAMES = 240
AXES = {
    "track": [(1, 0, 180), (105, 31000, 0), (135, 31000, 0), (215, 47500, 0), (240, 47500, 0)],
    "boom": [(1, 2000, 0), (18, 2000, 0), (125, 24000, 0), (190, 24000, 0), (240, 19500, 0)],
    "swing": [(1, 0, 0), (10, 0, 0), (110, 9000, 0), (228, -5200, 0), (240, -5200, 0)],
    "pan": [(1, -1500, 0), (30, -1500, 0), (160, 14000, 95), (240, 22500, 130)],
}


def quintic(frames: np.ndarray, knots: list[tuple[int, int, int]]) -> np.ndarray:
    """Return the position at each frame in whole steps."""
    steps = np.zeros(len(frames))
    for (start, p, v), (end, q, w) in pairwise(knots):
        span = end - start
        here = (frames >= start) & (frames <= end)
        u = (frames[here] - start) / span
        travel, v, w = q - p, v * span, w * span
        steps[here] = (
            p + v * u + (10 * travel - 6 * v - 4 * w) * u**3 + (-15 * travel + 8 * v + 7 * w) * u**4
            + (6 * travel - 3 * v - 3 * w) * u**5
        )  # fmt: skip
    return np.rint(steps).astype(int)


def main() -> None:
    """Write the CSV next to this file."""
    frames = np.arange(1, FRAMES + 1)
    columns = [frames, *(quintic(frames, knots) for knots in AXES.values())]
    with open(Path(__file__).with_name("camera_move.csv"), "w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["frame", *AXES])
        writer.writerows(np.column_stack(columns).tolist())


if __name__ == "__main__":
    main()
