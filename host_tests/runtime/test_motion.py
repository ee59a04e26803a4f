"""The motion core as machine code on 32 bits, with the heap locked: every word of its state is as
on CPython, tick by tick."""

import random
from pathlib import Path

import numpy as np
import pytest

from framestep.motion import segments
from framestep.motors import backlash
from framestep.pulse import stepper
from host_tests.runtime import motion_replay

REPLAY = Path(__file__).parent / "motion_replay.py"

# Words that hold addresses
HEADER_ADDRESSES = [stepper.CLOCK, stepper.FIRST, stepper.CUES, stepper.OUT_SET, stepper.OUT_CLEAR]
BLOCK_ADDRESSES = [
    stepper.NEXT,
    stepper.FIFO,
    stepper.QUEUE,
    stepper.WORK,
    stepper.PHASES,
    stepper.BACKLASH,
    stepper.BLOCK_WORDS + segments.CUBIC_WORDS + backlash.BLOCK,
]
MOTOR_WORDS = stepper.BLOCK_WORDS + segments.CUBIC_WORDS + backlash.WORDS + 1
LOWEST, HIGHEST = -(2**31), 2**31 - 1


@pytest.fixture
def words(runtime, tmp_path):
    """Return words(*arguments, stdin=...): the words that the replay gives on MicroPython."""

    def run(*arguments, stdin=None):
        runtime.run(REPLAY, tmp_path / "words", *arguments, stdin=stdin)
        return np.fromfile(tmp_path / "words", "<i4")

    return run


def compare(words, lines, motors):
    """Play a script on both runtimes; return the common state, a row of words for each tick."""
    script = "".join(line + "\n" for line in lines)
    there = words(stdin=script.encode())
    here = bytearray()
    motion_replay.play(lines, here.extend)
    width = stepper.HEADER_WORDS + motors * MOTOR_WORDS
    there = there.reshape(-1, width)
    here = np.frombuffer(bytes(here), "<i4").reshape(-1, width).copy()
    hidden = HEADER_ADDRESSES + [
        stepper.HEADER_WORDS + i * MOTOR_WORDS + word
        for i in range(motors)
        for word in BLOCK_ADDRESSES
    ]
    here[:, hidden] = there[:, hidden] = 0
    assert len(here) == len(there)
    if not np.array_equal(here, there):
        row, word = np.argwhere(here != there)[0]
        motor, place = divmod(word - stepper.HEADER_WORDS, MOTOR_WORDS)
        where = f"word {place} of motor {motor}" if motor >= 0 else f"word {word} of the header"
        pytest.fail(
            f"tick {row}, {where}: {here[row, word]} on CPython, "
            f"{there[row, word]} on MicroPython\n{script}"
        )
    return here


def of_motor(state, motor, word):
    return state[:, stepper.HEADER_WORDS + motor * MOTOR_WORDS + word]


def requests(rng, motors, count):
    """Return a script of any requests at any moment."""
    yield f"new {motors}"
    yield "tick 20"
    spans = []
    for motor in range(motors):
        velocity = round(10 ** rng.uniform(1, 5.69))
        acceleration = max(round(10 ** rng.uniform(2, 6.6)), velocity)
        spans.append(velocity * velocity // acceleration + velocity // 10 + 5)
        yield f"speed {motor} {velocity} {acceleration}"
        yield f"jerk {motor} {rng.choice([0, 0, 1, 100, 10**4, 10**6])}"
        yield f"place {motor} {rng.choice([0, 5, -1000, 2**29, -(2**30), 2**30 + 7])}"
    for _ in range(count):
        motor = rng.randrange(motors)
        what = rng.random()
        if what < 0.55:
            base = rng.choice([0, 0, 0, 2**29, -(2**30)])
            target = base + rng.randint(-spans[motor], spans[motor])
            if rng.random() < 0.1:
                target = rng.choice([LOWEST, HIGHEST, LOWEST + 1, 2**30, -(2**30) - 1])
            yield f"travel {motor} {target} {rng.choice([10000, 10000, 3333, 100, 1])}"
        elif what < 0.65:
            yield f"stop {motor} {rng.choice([1, 4, 16])}"
        elif what < 0.7:
            yield f"smooth {motor}"
        elif what < 0.72:
            yield f"halt {rng.choice([1, 4])}"
        elif what < 0.77:
            yield f"late {rng.choice([30, 600, 1500, 1750, 1900, 2000, 3456, 50_000])}"
        elif what < 0.8:
            yield f"starve {rng.choice([3, 50, 400])}"
        yield f"tick {rng.choice([1, 1, 2, 5, 11, 12, 13, 30, 100, 300])}"
    yield "halt 4"
    yield "tick 100"


@pytest.mark.parametrize("seed", range(4))
def test_any_requests(words, runtime, seed):
    rng = random.Random(seed)
    lines = [line for _ in runtime.share(range(3)) for line in requests(rng, 3, 12)]
    compare(words, lines, 3)


@pytest.mark.parametrize("seed", range(2))
def test_any_requests_of_coupled_motors(words, seed):
    """With play, limits and jerk; the two motors stay together in every tick."""
    rng = random.Random(seed)
    for turned in 0, 1:
        lines = list(requests(rng, 2, 20))
        lines[2:2] = [
            "backlash 0 7", "backlash 1 9", f"couple 0 {turned}", f"limits 1 -{2**31} {2**31 - 1}",
        ]  # fmt: skip
        lines = [line for line in lines if line[-2:] != " 1" or "tick" in line or "couple" in line]
        lines = [
            line
            for line in lines
            if not line.startswith(("travel 1", "stop 1", "smooth 1", "place"))
        ]
        state = compare(words, lines, 2)
        one, two = (of_motor(state, motor, stepper.POSITION).astype(np.int64) for motor in (0, 1))
        assert (one == (-two if turned else two)).all()
        assert (
            not of_motor(state, 1, stepper.FAULT).any() or of_motor(state, 0, stepper.FAULT).any()
        )


@pytest.mark.parametrize("seed", range(2))
def test_numbers(words, runtime, seed):
    """The planner's arithmetic and the kernels of segments, word by word."""
    count = len(runtime.share(range(800)))
    there = words(seed, count)
    here = bytearray()
    motion_replay.numbers(seed, count, here.extend)
    assert np.array_equal(there, np.frombuffer(bytes(here), "<i4"))


# How much memory some moves of eight motors leave allocated
LEFT = """
import gc

from motion_replay import Rig

rig = Rig(8)
for i in range(8):
    rig.axes[i].set_speed(20000, 100000)
    rig.axes[i].set_jerk(5000)


def run(turns):
    for i in range(turns):
        for k in range(8):
            rig.words[1] = (i * 7919 + k * 104729) % 5000
            rig.axes[k].move_to(rig, rig.words, 1, 10000)
        for _ in range(25):
            rig.clock[0] += 1000
            rig.feed()
            rig.tick(None)
        rig.axes.stop(1)


run(2)
gc.collect()
gc.disable()
before = gc.mem_alloc()
run(20)
print(gc.mem_alloc() - before)
"""


def test_nothing_left_allocated(runtime):
    """Nothing may stay, not even memory freed at once, such as large call frames."""
    left = int(runtime.run(LEFT, path=[REPLAY.parent]))
    assert left <= 64  # the loop's own variables
