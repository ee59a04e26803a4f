"""Hours of a host's work in emulated time, held to what may never happen.

    python -m host_tests.soak.soak [--hours 2] [--minutes 15] [--seed 1] [--board-rounds 3]
                                                                                  (make soak)

A few rounds (rounds.py) are played on the emulated board, where ticks may come late (on_board.py).
Then stretches of rounds are played with the host simulation and again on 32-bit MicroPython
(stretch.py). It prints a line for each of them, and ends with 1 where anything was wrong.
"""

import argparse
import sys
import tempfile
from pathlib import Path

from framestep.base import native_cpython
from host_tests.runtimes import Runtime
from host_tests.soak import on_board
from host_tests.soak.stretch import play


def main() -> int:
    parser = argparse.ArgumentParser(description="a soak of the controller in emulated time")
    parser.add_argument("--hours", type=float, default=2, help="emulated hours in all")
    parser.add_argument("--minutes", type=float, default=15, help="of a stretch on one heap")
    parser.add_argument("--seed", type=int, default=1, help="of the first stretch")
    parser.add_argument("--board-rounds", type=int, default=3, help="on the emulated board")
    options = parser.parse_args()
    try:
        return _on_board(options.board_rounds, options.seed) or _stretches(options)
    except AssertionError as error:
        print(f"{error}", flush=True)
        return 1


def _on_board(rounds: int, seed: int) -> int:
    """0 where nothing was wrong."""
    if not rounds:
        return 0
    found = on_board.play(rounds, seed)
    print(
        f"emulated board: {found.seconds:.0f} s, {found.rounds} rounds, {found.motions} positions "
        f"of all motors exact, worst tick {found.late_us} µs late (from {found.limit_us} µs on "
        f"pulses would break off): {found.wrong or 'nothing wrong'}",
        flush=True,
    )
    return int(bool(found.wrong))


def _stretches(options: argparse.Namespace) -> int:
    """0 where nothing was wrong."""
    left, seed = options.hours * 3600, options.seed
    rounds = motions = 0
    seconds = 0.0
    with tempfile.TemporaryDirectory() as folder:
        runtime = Runtime("x86", Path(folder))
        while left > 0:
            path = Path(folder) / "soak.recording"
            try:
                found = play(runtime, min(left, options.minutes * 60), seed, path)
            except AssertionError as error:
                raise AssertionError(f"seed {seed}: {error}") from error
            print(
                f"seed {seed}: {found.seconds:.0f} s, {found.rounds} rounds, {found.motions} "
                f"positions of all motors exact, heap {found.heap[-1]} bytes: "
                f"{found.wrong or 'nothing wrong'}",
                flush=True,
            )
            if found.wrong:
                return 1
            left -= found.seconds
            seconds += found.seconds
            rounds += found.rounds
            motions += found.motions
            seed += 1
            native_cpython.forget()
    print(f"{seconds / 3600:.2f} emulated hours, {rounds} rounds, {motions} checks: nothing wrong")
    return 0


if __name__ == "__main__":
    sys.exit(main())
