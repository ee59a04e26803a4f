"""The 32-bit MicroPython is what the other tests of this layer take it for."""

CODE = """
import sys, gc, asyncio, micropython, framestep.native
@micropython.viper
def shift(x: int) -> int:
    return x << 31
print(sys.maxsize, shift(1), 1 / 3, framestep.native.__file__.endswith(".mpy"), sys.argv[1:])
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


def test_words_floats_and_heap(unix32f):
    words, heap, big = unix32f.run(CODE, 7).splitlines()
    assert words == "2147483647 -2147483648 0.33333334 True ['7']"
    assert 230_000 < int(heap) < 242 * 1024
    assert big == "allocated"
