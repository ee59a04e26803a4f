"""MicroPython on each processor is what the other tests of this folder assume."""

import numpy as np

CODE = """
import sys, gc, asyncio, micropython, framestep.base.native
@micropython.viper
def shift(x: int) -> int:
    return x << 31
print(sys.maxsize, shift(1), 1 / 3, framestep.base.native.__file__.endswith(".mpy"), sys.argv[1:])
gc.collect()
print(gc.mem_free() + gc.mem_alloc())
x = 0x3fffffff
micropython.heap_lock()
try:
    x += 1  # one more than a small int holds
    print("not allocated")
except MemoryError:
    print("allocated")
micropython.heap_unlock()
"""


def test_words_floats_and_heap(runtime):
    words, heap, big = runtime.run(CODE, 7).splitlines()
    assert words == "2147483647 -2147483648 0.33333334 True ['7']"
    assert 230_000 < int(heap) < 242 * 1024
    assert big == "allocated"


# For each pair: sum, difference, product, quotient, comparisons, the first as an integer and back
FLOATS = """
import struct, sys
for line in sys.stdin:
    a, b = struct.unpack("<2f", bytes.fromhex(line.strip()))
    values = [a + b, a - b, a * b]
    values.append(a / b if b else 0.0)
    whole = int(a) if -1e9 < a < 1e9 else 0
    back = struct.pack("<f", float(whole)).hex()
    print(struct.pack("<4f", *values).hex(), a < b, a == b, a >= b, whole, back)
"""


def ieee(a, b):
    """Return the line that FLOATS prints for a pair, by numpy."""
    with np.errstate(all="ignore"):
        values = np.array([a + b, a - b, a * b, a / b if b else 0.0], "<f4")
    whole = int(a) if -1e9 < a < 1e9 else 0
    return (
        f"{values.tobytes().hex()} {a < b} {a == b} {a >= b} {whole} "
        f"{np.float32(whole).tobytes().hex()}"
    )


def test_floats_are_ieee_754(runtime):
    """Rounded to nearest, even; subnormal and infinite numbers, too. On Xtensa these functions are
    this project's own."""
    dice = np.random.default_rng(7)
    near = dice.normal(size=(300, 1)) * 10.0 ** dice.integers(-20, 20, (300, 1))
    pairs = np.concatenate(
        [
            near * (1 + dice.integers(-3, 4, (300, 2)) * 2.0**-23),
            dice.normal(size=(300, 2)) * 10.0 ** dice.integers(-44, 38, (300, 2)),
            dice.integers(-(2**30), 2**30, (100, 2)),
            [(0, 1), (1, 0), (-0.0, 0), (np.inf, 1), (1, -np.inf), (2.0**-149, 2.0**-126)],
        ]
    ).astype("<f4")
    said = runtime.run(FLOATS, stdin="".join(p.tobytes().hex() + "\n" for p in pairs).encode())
    for (a, b), answer in zip(pairs, said.splitlines(), strict=True):
        assert answer == ieee(a, b), (a, b)
