"""Functions with a form of their own for a board (`if CPYTHON: ... else:`), and check_bytes: the
same results on random memory, at any place in a word."""

import random

from host_tests.runtime.both import HERE
from host_tests.runtime.own_forms import answer

REPLAY = HERE / "own_forms.py"
LENGTHS = [*range(70), 255, 256, 257, 271, 272, 511, 512, 513, 1030, 1045, 1046]
CASES = 600


def memory(rng, kind, size):
    """Return bytes in hex: any, or with many at the end of their range."""
    if rng.random() < 0.5:
        return kind + rng.randbytes(size).hex()
    return kind + bytes(rng.choice((0, 255)) for _ in range(size)).hex()


def copied(rng):
    to = memory(rng, "b", 64)
    return to, rng.randrange(8), memory(rng, "b", 64), rng.randrange(8), rng.randrange(48)


def copied_to_the_front(rng):
    """Within one buffer."""
    to = rng.randrange(8)
    return memory(rng, "b", 64), to, "=0", to + rng.randrange(8), rng.randrange(48)


def dwords(rng):
    words, source = memory(rng, "w", 80), memory(rng, "b", 96)
    return words, source, rng.randrange(4), rng.randrange(8), rng.randrange(16)


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
    words = "w" + b"".join(each.to_bytes(4, "little", signed=True) for each in positions).hex()
    count = rng.randrange(30)
    return words, rng.randint(2, 40 - count), memory(rng, "b", 64), rng.randrange(8), count


FORMS = {
    "copy_bytes": ("framestep.base.copying copy_bytes", copied),
    "copy_bytes, to the front": ("framestep.base.copying copy_bytes", copied_to_the_front),
    "copy_dwords": ("framestep.base.copying copy_dwords", dwords),
    "fletcher16": ("framestep.protocol.checksum fletcher16", summed),
    "check_bytes": ("framestep.protocol.checksum check_bytes", sums),
    "_changes": ("framestep.moves.upload.codec _changes", changes),
}


def test_the_same_on_a_board(runtime):
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
