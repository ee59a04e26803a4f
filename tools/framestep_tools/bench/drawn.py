"""`make drawn`: an emulated board plays moves drawn at random with all its motors, one after the
other, and every edge is judged."""

import time
from typing import Annotated

import numpy as np
import typer

from ..errors import Command, ToolError
from ..simulator.boards import EmulatedBoard
from .session import Session

app = Command("drawn")

_RATES = (24, 25, 30, 48, 60)  # frames per second
_FASTEST = 20_000  # steps/s
_LONGEST_S = 30
_PART_S = 2.5  # on average, of a move that is made of parts
_ERROR_US = 200  # of a frame's time


def _eased(t: np.ndarray) -> np.ndarray:
    return np.polyval((6, -15, 10, 0, 0, 0), t)


def _path(dice: np.random.Generator, t: np.ndarray) -> np.ndarray:
    """Return one motor's path, steps at times t (s), at _FASTEST at most."""
    seconds = t[-1]
    kind = dice.choice(("eases", "sines", "line", "creeps", "rests"), p=(0.45, 0.3, 0.1, 0.1, 0.05))
    if kind == "eases":  # between keyframes, some of them a rest
        at = np.sort(dice.uniform(0, seconds, max(2, round(seconds / _PART_S))))
        # the shorter a part, the steeper
        apart = (np.diff(at, prepend=0) > 0.4) & (at < seconds - 0.4)
        at = np.concatenate(([0], at[apart], [seconds]))
        # an ease's highest velocity is 15/8 of its mean
        ways = dice.uniform(-1, 1, len(at) - 1) * np.diff(at) * _FASTEST * 8 / 15
        ways[dice.random(len(ways)) < 0.2] = 0
        part = np.clip(np.searchsorted(at, t, side="right") - 1, 0, len(ways) - 1)
        begun = np.concatenate(([0], np.cumsum(ways)))
        return begun[part] + ways[part] * _eased((t - at[part]) / np.diff(at)[part])
    if kind == "sines":
        shares = dice.dirichlet((1, 1, 1)) * _FASTEST * dice.uniform(0.1, 1)
        return sum(
            share / speed * np.sin(speed * t + phase)
            for share, speed, phase in zip(
                shares, 2 * np.pi / dice.uniform(0.8, 12, 3), dice.uniform(0, 7, 3), strict=True
            )
        )
    if kind == "line":
        return dice.uniform(-1, 1) * _FASTEST * t
    if kind == "creeps":
        return dice.uniform(-30, 30) * t + 3 * np.sin(t * dice.uniform(0.2, 5))
    return np.zeros_like(t)


def drawn_move(dice: np.random.Generator, motors: int) -> tuple[int, dict[int, np.ndarray]]:
    """Return the frames per second and the steps of each motor at each frame, from 0 on."""
    fps = int(dice.choice(_RATES))
    t = np.arange(round(dice.uniform(4, _LONGEST_S) * fps) + 1) / fps
    paths = {motor: np.rint(_path(dice, t)).astype(np.int64) for motor in range(1, motors + 1)}
    return fps, {motor: path - path[0] for motor, path in paths.items()}


@app.command()
def main(
    board: Annotated[str, typer.Option(help="folder in boards/ of an emulated board")] = "pico2",
    minutes: Annotated[float, typer.Option(help="of the moves, by the board's clock")] = 10,
    seed: Annotated[int, typer.Option(help="draws other moves")] = 1,
    first: Annotated[int, typer.Option(help="number of the first move")] = 1,
) -> None:
    """Play drawn moves, and stop at the first that is not played as uploaded."""
    begun = time.process_time(), time.monotonic()
    seconds = worst_us = 0.0
    edges = frames = number = off = 0
    with EmulatedBoard({}, board=board) as emulated:
        session = Session(emulated)
        motors = session.info.motors
        number = first - 1
        while seconds < 60 * minutes:
            number += 1
            fps, move = drawn_move(np.random.default_rng((seed, number)), motors)
            played = session.play(session.prepare(move, 2 * _FASTEST, fps))
            verdict = played.verdict
            off = max(off, verdict.worst_position)
            worst_us = max(worst_us, verdict.worst_time_us)
            count = len(move[1])
            seconds += (count - 1) / fps
            frames += count
            edges += sum(len(motor.edge_times_s) for motor in verdict.motors)
            print(
                f"move {number}: {count} frames at {fps}/s; in all {seconds / 60:.1f} min, "
                f"{frames} frames of {motors} motors, {edges} steps, {off} steps off, "
                f"worst step {worst_us:.1f} µs",
                flush=True,
            )
            if played.complaints or off or verdict.worst_time_us > _ERROR_US:
                raise ToolError(
                    f"move {number} of seed {seed} was not played as uploaded: "
                    + ("; ".join(played.complaints) or verdict.summary())
                )
    print(f"{time.monotonic() - begun[1]:.0f} s")


if __name__ == "__main__":
    app()
