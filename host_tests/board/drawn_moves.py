"""Drawn moves of all motors of an emulated board at once, for as long of its time as is asked.

    python -m host_tests.board.drawn_moves --board pico2 --minutes 120

Half of them are moves to drawn targets, some turned round or stopped on the way, the others are
uploaded moves that are played. After each one every motor has to be where its edges and its target
say, and in a played move on its uploaded step at each frame. Nothing may stop the motors unasked.
"""

import argparse
import functools
import math
import random
import time
from collections import Counter

from framestep_tools import demo
from framestep_tools import payloads as p
from framestep_tools.building.board_files import board_data, emulated_boards
from framestep_tools.judge.judge import judge
from framestep_tools.judge.reference import Reference
from framestep_tools.simulator.boards import EmulatedBoard
from host_tests.end_to_end.session import Session, run_request

FPS = 24
ROLL_MS = 500
_SAY_S = 60  # of this computer's time, from one line to the next


class Off(AssertionError):
    """A motor is not where it has to be."""


class Drawn:
    """A board and what has been drawn for it."""

    def __init__(self, board, motors, seed):
        self.session = Session(board, motors)
        self.motors = range(1, motors + 1)
        self.dice = random.Random(seed)
        self.counts = Counter()

    def one(self):
        """Draw a move, play it, and judge it. Raises Off."""
        self.session.forget()
        before = self.session.positions
        if self.dice.random() < 0.5:
            targets = self._targets(before)
        else:
            targets = self._played(before)
        after = self.session.positions
        for motor in self.motors:
            made = self.session.made(motor)
            self.counts["steps"] += len(self.session.steps(motor)[0])
            if before[motor] + made != after[motor] or after[motor] != targets.get(
                motor, after[motor]
            ):
                raise Off(
                    f"motor {motor} is at {after[motor]} by its report, at {before[motor] + made} "
                    f"by its edges, its target is {targets.get(motor, 'none')}"
                )
        if stops := self.session.events(p.HardStop):
            raise Off(f"the motors were stopped: {stops}")
        self.counts["moves"] += 1

    def _speeds(self, fastest=60_000):
        speeds = {}
        for motor in self.motors:
            speeds[motor] = round(10 ** self.dice.uniform(2.5, math.log10(fastest)))
            self.session.speed(motor, speeds[motor], round(10 ** self.dice.uniform(4, 5.6)))
        return speeds

    def _targets(self, at):
        """Move all motors; return {motor: target} of those that nothing stops."""
        dice, speeds = self.dice, self._speeds()
        targets = {}

        def go(motor):
            reach = speeds[motor] * dice.uniform(-1, 1)
            targets[motor] = at[motor] + round(reach)
            self.session.accept(p.MotorMove(motor, targets[motor]))

        for motor in self.motors:
            go(motor)
        self.session.run(dice.uniform(0, 0.6))
        if dice.random() < 0.4:
            self.counts["turned"] += 1
            for motor in self.motors:
                if dice.random() < 0.5:
                    go(motor)
            self.session.run(dice.uniform(0, 0.3))
        if dice.random() < 0.15:
            self.counts["stopped"] += 1
            self.session.accept(p.MotorStopAll())
            targets.clear()
        self.session.wait_idle()
        return targets

    def _played(self, at):
        """Upload a move and play it; return {motor: its last position}."""
        dice = self.dice
        frames = dice.randint(12, 72)
        positions = {}
        for motor in self.motors:
            self.session.speed(motor, demo.VELOCITY, demo.ACCELERATION)
            far = dice.uniform(-2500, 2500) * frames / FPS
            wave, turns = dice.uniform(0, 300), dice.choice((1, 2))
            positions[motor] = [
                at[motor]
                + round(
                    far * (1 - math.cos(math.pi * k / (frames - 1))) / 2
                    + wave * math.sin(math.pi * turns * k / (frames - 1)) ** 2
                )
                for k in range(frames)
            ]
        self.session.upload(positions)
        self.session.ready(run_request(FPS, 1, frames, ROLL_MS, ROLL_MS))
        self.session.accept(p.RtGo())
        self.session.client.wait_event(p.RtEnd, 60)
        self.session.run(0.3)
        self.session.wait_idle()
        self.counts["played"] += 1
        self.counts["frames"] += frames
        path = Reference(positions, FPS * 1000, ROLL_MS, ROLL_MS)
        after = self.session.positions
        found = judge(self.session.trace(), positions, FPS * 1000, at, after, path)
        if not found.good:
            raise Off("; ".join(found.complaints))
        return {motor: steps[-1] for motor, steps in positions.items()}


def play(board, motors, seconds, seed=1, say=print):
    """Play drawn moves for this long of the board's time; return the counts."""
    drawn = Drawn(board, motors, seed)
    begun = said = time.monotonic()

    def line():
        parts = ", ".join(f"{number} {what}" for what, number in sorted(drawn.counts.items()))
        took = time.monotonic() - begun
        played = f"{drawn.session.now:.0f} s of the board's time in {took:.0f} s"
        say(f"{motors} motors, {played}: {parts}")

    while drawn.session.now < seconds:
        drawn.one()
        if time.monotonic() - said > _SAY_S:
            said = time.monotonic()
            line()
    line()
    return drawn.counts


def main():
    parser = argparse.ArgumentParser(description="drawn moves of all motors of an emulated board")
    parser.add_argument("--board", default="pico2", choices=emulated_boards())
    parser.add_argument("--minutes", type=float, default=10, help="of the board's time")
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    if options.minutes <= 0:
        parser.error("--minutes has to be more than 0")
    motors = len(board_data(options.board)["step"])
    with EmulatedBoard({"motor_count": motors}, board=options.board) as board:
        play(
            board, motors, 60 * options.minutes, options.seed, functools.partial(print, flush=True)
        )
    print("0 steps off")


if __name__ == "__main__":
    main()
