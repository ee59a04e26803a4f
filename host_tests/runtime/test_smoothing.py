"""The smoothed path as machine code on 32 bits, with the heap locked, is the same as on CPython."""

import itertools
import random

from host_tests.runtime import smoothing_replay
from host_tests.runtime.both import HERE, assert_answers

LOWEST, HIGHEST = -(2**31), 2**31 - 1
FRAMES = 17


def window(dice):
    """Return a line for smoothing_replay.py."""
    if dice.random() < 0.8:
        size = dice.choice([1, 2, 40, 6000, 2**20])
        positions = [dice.randint(-size, size) for _ in range(FRAMES)]
        for _ in range(dice.randrange(3)):
            positions = list(itertools.accumulate(positions))
        positions = positions[: dice.randint(1, FRAMES)]
        positions += [positions[-1]] * (FRAMES - len(positions))
        at = dice.choice([0, 2**30, -(2**30), LOWEST + 2**29, HIGHEST - 2**29])
        positions = [at + step for step in positions]
    else:
        positions = [dice.randint(LOWEST + 1, HIGHEST) for _ in range(FRAMES)]
    limits = [(LOWEST, HIGHEST), (min(positions), max(positions)), (-(2**30), 2**30)]
    beside = dice.randint(0, 9), dice.randint(0, 9)
    return " ".join(map(str, (*dice.choice(limits), dice.randrange(2), *beside, *positions)))


def test_any_window(runtime):
    dice = random.Random(5)
    scripts = [[(line, line) for _ in range(100) for line in [window(dice)]] for _ in range(30)]

    def expected(script):
        return smoothing_replay.replay([line for line, _ in script])

    assert_answers(runtime, HERE / "smoothing_replay.py", scripts, expected)
