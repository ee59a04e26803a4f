"""Fletcher-16 with K=8 and modulus 255 (spec: Computing and Validating the Checksum).

`fletcher16(buffer, start, count)` returns the specification's `(sum2 << 8) | sum1`, each sum 0 to
254; over a whole undamaged message that is 0. `check_bytes(sums)` returns the two bytes to append,
the first in the low byte. Neither allocates on the board.

The kernel reads half words. As 256 leaves a remainder of 1, a half word counts like the sum of its
two bytes modulo 255, so the first sum takes it as a whole. With A the running first sum after each
half word, the second sum grows by 2·ΣA minus the bytes at odd offsets, which come after their
neighbour and would be counted once too often. These are summed two at a time, in the two halves of
a word. 256 bytes keep every sum below 2^31. Then the sums are folded: 256·q + r counts like q + r.
"""

from framestep.base.native import CPYTHON, const, micropython, ptr8, ptr16, ptr32

if CPYTHON:
    from itertools import accumulate

    def fletcher16(buffer, start, count):
        """Return both sums over `count` bytes from `start` on, as (sum2 << 8) | sum1."""
        part = memoryview(buffer)[start : start + count]
        return ((sum(accumulate(part)) % 255) << 8) | (sum(part) % 255)

else:
    _BLOCK = const(256)

    @micropython.viper
    def fletcher16(buffer: ptr16, start: int, count: int) -> int:
        # On ARM, viper keeps the first two locals in registers. So from here on `buffer` is the
        # address and `start` the first sum.
        buffer = ptr16(int(buffer) + start)
        start = 0
        second = 0
        while count > 0 and int(buffer) & 3:
            start += ptr8(buffer)[0]
            second += start
            buffer = ptr16(int(buffer) + 1)
            count -= 1
        places = 0x00FF00FF
        while count >= 16:
            rest = count - _BLOCK
            if rest < 0:
                rest = 0
            sums = 0
            odd = 0
            while count >= rest + 16:
                start += buffer[0]
                sums += start
                start += buffer[1]
                sums += start
                odd = ((ptr32(buffer)[0] >> 8) & places) + odd
                start += buffer[2]
                sums += start
                start += buffer[3]
                sums += start
                odd = ((ptr32(buffer)[1] >> 8) & places) + odd
                start += buffer[4]
                sums += start
                start += buffer[5]
                sums += start
                odd = ((ptr32(buffer)[2] >> 8) & places) + odd
                start += buffer[6]
                sums += start
                start += buffer[7]
                sums += start
                odd = ((ptr32(buffer)[3] >> 8) & places) + odd
                buffer = ptr16(int(buffer) + 16)
                count -= 16
            sums = (sums << 1) - (odd & 0xFFFF) - (odd >> 16)
            second += (sums & 0xFFFF) + (sums >> 16)
            second = (second & 0xFF) + (second >> 8)
            start = (start & 0xFFFF) + (start >> 16)
            start = (start & 0xFF) + (start >> 8)
        while count > 0:
            start += ptr8(buffer)[0]
            second += start
            buffer = ptr16(int(buffer) + 1)
            count -= 1
        while start > 255:
            start = (start & 0xFF) + (start >> 8)
        while second > 255:
            second = (second & 0xFF) + (second >> 8)
        return ((second if second < 255 else 0) << 8) | (start if start < 255 else 0)


@micropython.viper
def check_bytes(sums: int) -> int:
    """Return the bytes that bring these sums to 0: first | second << 8, each 1 to 255."""
    low = sums & 0xFF
    first = low + (sums >> 8)
    while first >= 255:
        first -= 255
    first = 255 - first
    second = low + first
    while second >= 255:
        second -= 255
    return first | ((255 - second) << 8)
