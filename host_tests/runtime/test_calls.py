"""Functions of numbers and memory as machine code on 32 bits, with the heap locked: results and
memory are as on CPython. Those with a form of their own for a board (`if CPYTHON: ... else:`) get
memory at any place in a word."""

import itertools
import random
from array import array
from pathlib import Path

from framestep.motion.reals import put
from framestep.moves.path import path
from host_tests.runtime.calls_replay import answer

REPLAY = Path(__file__).with_name("calls_replay.py")
LOWEST, HIGHEST = -(2**31), 2**31 - 1
LENGTHS = [*range(70), 255, 256, 257, 271, 272, 511, 512, 513, 1030, 1045, 1046]
CASES = 600


def memory(rng, kind, size):
    """Return bytes in hex: any, or with many at the end of their range."""
    if rng.random() < 0.5:
        return kind + rng.randbytes(size).hex()
    return kind + bytes(rng.choice((0, 255)) for _ in range(size)).hex()


def words(values):
    """Return memory of these words."""
    return "w" + bytes(array("i", values)).hex()


def copied(rng):
    to = memory(rng, "b", 64)
    return to, rng.randrange(8), memory(rng, "b", 64), rng.randrange(8), rng.randrange(48)


def copied_to_the_front(rng):
    """Within one buffer."""
    to = rng.randrange(8)
    return memory(rng, "b", 64), to, "=0", to + rng.randrange(8), rng.randrange(48)


def dwords(rng):
    to, source = memory(rng, "w", 80), memory(rng, "b", 96)
    return to, source, rng.randrange(4), rng.randrange(8), rng.randrange(16)


def summed(rng):
    return memory(rng, "b", 1100), rng.randrange(9), rng.choice(LENGTHS)


def sums(rng):
    return (rng.randrange(255) << 8 | rng.randrange(255),)


def changes(rng):
    """Positions whose changes change little, but for one in some: then they need more bits."""
    bends = [rng.randint(-64, 63) for _ in range(40)]
    if rng.random() < 0.7:
        bends[rng.randrange(40)] = rng.choice((-65, 64, 150, -(2**20)))
    positions, velocity = [0], 0
    for bend in bends:
        velocity += bend
        positions.append(positions[-1] + velocity)
    count = rng.randrange(30)
    return (
        words(positions), rng.randint(2, 40 - count), memory(rng, "b", 64), rng.randrange(8), count,
    )  # fmt: skip


def window(rng):
    """A frame of a smoothed run: positions, the limits, whether there is play, and how many frames
    of the upload come before and after."""
    frames = 2 * path.BESIDE + 1
    if rng.random() < 0.8:
        size = rng.choice([1, 2, 40, 6000, 2**20])
        positions = [rng.randint(-size, size) for _ in range(frames)]
        for _ in range(rng.randrange(3)):
            positions = list(itertools.accumulate(positions))
        positions = positions[: rng.randint(1, frames)]
        positions += [positions[-1]] * (frames - len(positions))
        at = rng.choice([0, 2**30, -(2**30), LOWEST + 2**29, HIGHEST - 2**29])
        positions = [at + step for step in positions]
    else:
        positions = [rng.randint(LOWEST + 1, HIGHEST) for _ in range(frames)]
    limits = [(LOWEST, HIGHEST), (min(positions), max(positions)), (-(2**30), 2**30)]
    bounds = words([*rng.choice(limits), rng.randrange(2)])
    positions += [0] * (path.SMOOTH_WORDS - frames)
    numbers = array("i", [0] * 8)
    put(numbers, 0, 715827883, -33)  # a twelfth
    put(numbers, 2, 0x10000000, 0)
    scale, top, to = 0, 2, 4
    beside = rng.randint(0, 9), rng.randint(0, 9)
    return words(numbers), to, words(positions), bounds, *beside, scale, top


FORMS = {
    "copy_bytes": ("framestep.base.copying copy_bytes", copied),
    "copy_bytes, to the front": ("framestep.base.copying copy_bytes", copied_to_the_front),
    "copy_dwords": ("framestep.base.copying copy_dwords", dwords),
    "fletcher16": ("framestep.protocol.checksum fletcher16", summed),
    "check_bytes": ("framestep.protocol.checksum check_bytes", sums),
    "_changes": ("framestep.moves.upload.codec _changes", changes),
    "velocity": ("framestep.moves.path.smoothing velocity", window),
}


def test_results_and_memory_are_as_on_cpython(runtime):
    rng = random.Random(1)
    lines = [
        " ".join([function, *map(str, arguments(rng))])
        for function, arguments in FORMS.values()
        for _ in range(CASES)
    ]
    lines = runtime.share(lines)
    printed = runtime.run(REPLAY, heap="8m", stdin="".join(f"{line}\n" for line in lines).encode())
    for line, there in zip(lines, printed.split("\n")[:-1], strict=True):
        assert there == answer(line), line
