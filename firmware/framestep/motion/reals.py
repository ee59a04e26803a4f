"""Real numbers in array('i') elements, for planning a motion without allocating.

In MicroPython a float is a heap object, and so is an int of 2^30 and more. Here a number is two
words of an array, mantissa and exponent: `value = mantissa * 2**exponent`, with
2^29 <= |mantissa| < 2^30 or a mantissa of 0. Results are rounded. They are exact to 2^-29 of their
size, and the same bits on every runtime. A register is named by the index of its first word.

compute.py has the same arithmetic for whole formulas, because calling a function of this module
takes longer than the operation itself. Tests compare the two bit by bit.

All functions are viper kernels, take 5 to 15 microseconds on an RP2040 and allocate nothing.
"""

from framestep.base.native import micropython, ptr32


@micropython.viper
def put(r: ptr32, to: int, value: int, exponent: int):
    """r[to] = value * 2**exponent, for any 32-bit value."""
    m = value
    e = exponent
    if m:
        while m >= 0x20000000 or m < -0x20000000:
            if m < 0x3FFFFFFF and m > -0x3FFFFFFF:
                break
            m = (m >> 1) + (m & 1)
            e += 1
        while m < 0x200000 and m > -0x200000:
            m = m << 8
            e -= 8
        while m < 0x20000000 and m > -0x20000000:
            m = m << 1
            e -= 1
    else:
        e = 0
    r[to] = m
    r[to + 1] = e


@micropython.viper
def put_difference(r: ptr32, to: int, left, i: int, right, j: int):
    """r[to] = left[i] - right[j], of two array('i') elements of any size."""
    a = ptr32(left)
    b = ptr32(right)
    x = a[i + 0]
    y = b[j + 0]
    # Halve both first, since the difference of two words may need 33 bits.
    m = (x >> 1) - (y >> 1)
    e = 1
    if m < 0x1FFFFFFF and m > -0x1FFFFFFF:
        m = m + m + (x & 1) - (y & 1)
        e = 0
    if m:
        while m >= 0x3FFFFFFF or m <= -0x3FFFFFFF:
            m = m >> 1
            e += 1
        while m < 0x200000 and m > -0x200000:
            m = m << 8
            e -= 8
        while m < 0x20000000 and m > -0x20000000:
            m = m << 1
            e -= 1
    else:
        e = 0
    r[to] = m
    r[to + 1] = e


@micropython.viper
def copy(r: ptr32, to: int, a: int):
    """r[to] = r[a]"""
    r[to] = r[a + 0]
    r[to + 1] = r[a + 1]


@micropython.viper
def negate(r: ptr32, to: int, a: int):
    """r[to] = -r[a]"""
    r[to] = 0 - r[a + 0]
    r[to + 1] = r[a + 1]


@micropython.viper
def double(r: ptr32, to: int, a: int, powers: int):
    """r[to] = r[a] * 2**powers"""
    r[to] = r[a + 0]
    if r[a + 0]:
        r[to + 1] = r[a + 1] + powers
    else:
        r[to + 1] = 0


@micropython.viper
def combine(r: ptr32, to: int, a: int, b: int, minus: int):
    """r[to] = r[a] + r[b], or r[a] - r[b] if minus is 1."""
    x = r[a + 0]
    e = r[a + 1]
    y = r[b + 0]
    f = r[b + 1]
    if minus:
        y = 0 - y
    if x == 0:
        x = y
        e = f
        y = 0
    if y:
        shift = e - f
        if shift < -31:
            shift = -31
        if shift > 31:
            shift = 31
        if shift < 0:
            shift = 0 - shift
            x = ((x + (1 << (shift - 1))) >> shift) + y  # below 2^31
            e = f
        elif shift:
            x = x + ((y + (1 << (shift - 1))) >> shift)
        else:
            x = x + y
        if x > 0x3FFFFFFF or x < -0x3FFFFFFF:
            x = (x + 1) >> 1
            e += 1
        if x:
            while x < 0x200000 and x > -0x200000:
                x = x << 8
                e -= 8
            while x < 0x20000000 and x > -0x20000000:
                x = x << 1
                e -= 1
        else:
            e = 0
    r[to] = x
    r[to + 1] = e


@micropython.viper
def add(r, to: int, a: int, b: int):
    """r[to] = r[a] + r[b]"""
    combine(r, to, a, b, 0)


@micropython.viper
def subtract(r, to: int, a: int, b: int):
    """r[to] = r[a] - r[b]"""
    combine(r, to, a, b, 1)


@micropython.viper
def multiply(r: ptr32, to: int, a: int, b: int):
    """r[to] = r[a] * r[b]"""
    x = r[a + 0]
    y = r[b + 0]
    e = r[a + 1] + r[b + 1] + 29
    high = x >> 15
    low = x & 0x7FFF
    top = y >> 15
    y = y & 0x7FFF
    # 2^29 to 2^31
    m = ((high * top) << 1) + ((high * y + low * top + (low * y >> 15) + 0x2000) >> 14)
    if m:
        if m > 0x3FFFFFFF or m < -0x3FFFFFFF:
            m = (m + 1) >> 1
            e += 1
    else:
        e = 0
    r[to] = m
    r[to + 1] = e


@micropython.viper
def divide(r: ptr32, to: int, a: int, b: int):
    """r[to] = r[a] / r[b]; r[b] must not be 0."""
    x = r[a + 0]
    y = r[b + 0]
    s = (x ^ y) >> 31
    if x < 0:
        x = 0 - x
    if y < 0:
        y = 0 - y
    e = r[a + 1] - r[b + 1] - 29
    if x < y:
        x = x + x
        e -= 1
    # 1 <= x / y < 2: find 30 binary digits
    q = 0
    n = 30
    while n:
        q = q + q
        if x >= y:
            x = x - y
            q += 1
        x = x + x
        n -= 1
    if x >= y:
        q += 1
        if q > 0x3FFFFFFF:
            q = q >> 1
            e += 1
    if q:
        r[to] = (q ^ s) - s
        r[to + 1] = e
    else:
        r[to] = 0
        r[to + 1] = 0


@micropython.viper
def sign(r: ptr32, a: int) -> int:
    """Return -1, 0 or 1."""
    m = r[a + 0]
    if m:
        return (m >> 31) | 1
    return 0


@micropython.viper
def compare(r: ptr32, a: int, b: int) -> int:
    """Return the sign of r[a] - r[b]."""
    x = r[a + 0]
    y = r[b + 0]
    if x == y and r[a + 1] == r[b + 1]:
        return 0
    s = x >> 31
    if s != y >> 31 or y == 0:
        return s | 1
    if x == 0:
        return -1
    if r[a + 1] != r[b + 1]:
        if r[a + 1] > r[b + 1]:
            return s | 1
        return 0 - (s | 1)
    if x > y:
        return 1
    return -1


@micropython.viper
def floor(r: ptr32, a: int, limit: int) -> int:
    """Return the greatest integer not above r[a], clamped to -limit … limit (limit < 2^30)."""
    m = r[a + 0]
    e = r[a + 1]
    if e > 0:
        if m < 0:
            return 0 - limit
        return limit
    if e < -31:
        e = -31
    m = m >> (0 - e)
    if m > limit:
        return limit
    if m < 0 - limit:
        return 0 - limit
    return m


def value(r, a):
    """Return r[a] as a Python float. For tests and displays; allocates."""
    return r[a] * 2.0 ** r[a + 1]


@micropython.viper
def fetch(r: ptr32, to: int, source, i: int):
    """r[to] = source[i], a number in another array"""
    s = ptr32(source)
    r[to] = s[i + 0]
    r[to + 1] = s[i + 1]


@micropython.viper
def split(r: ptr32, a: int, out: ptr32):
    """out[0] = whole part (0 … 2^30 - 1), out[1] = fraction (Q30) of r[a] >= 0"""
    m = r[a + 0]
    e = r[a + 1]
    if m <= 0 or e < -59:
        out[0] = 0
        out[1] = 0
    elif e > 0:
        out[0] = 0x3FFFFFFF
        out[1] = 0
    elif e < -29:
        out[0] = 0
        out[1] = m >> (0 - e - 30)
    else:
        whole = m >> (0 - e)
        out[0] = whole
        out[1] = (m - (whole << (0 - e))) << (30 + e)


@micropython.viper
def copy_word(to, i: int, source, j: int):
    """to[i] = source[j], array('i') elements of any size"""
    t = ptr32(to)
    s = ptr32(source)
    t[i] = s[j + 0]


@micropython.viper
def add_word(to, i: int, source, j: int, small: int):
    """to[i] = source[j] + small, array('i') elements of any size"""
    t = ptr32(to)
    s = ptr32(source)
    t[i] = s[j + 0] + small


@micropython.viper
def add_within(to, i: int, source, j: int, small: int) -> int:
    """to[i] = source[j] + small. Returns 0 if the sum does not fit a word; nothing changes then.

    small: |small| < 2^30.
    """
    s = ptr32(source)
    top = 0x3FFFFFFF
    top = top + top + 1
    if small > 0:
        if s[j + 0] > top - small:
            return 0
    elif s[j + 0] < 0 - top - 1 - small:
        return 0
    t = ptr32(to)
    t[i] = s[j + 0] + small
    return 1


@micropython.viper
def add_words(to, i: int, a, j: int, b, k: int, minus: int) -> int:
    """to[i] = a[j] + b[k], or a[j] - b[k] if minus is 1. Returns 0 if that is outside int32; to[i]
    is then the nearest int32."""
    t = ptr32(to)
    m = ptr32(a)
    n = ptr32(b)
    x = m[j + 0]
    y = n[k + 0]
    if minus:
        half = (x >> 1) - (y >> 1) + (((x & 1) - (y & 1)) >> 1)
    else:
        half = (x >> 1) + (y >> 1) + (x & y & 1)
    end = 0x3FFFFFFF
    if half > end:
        t[i] = end + end + 1
        return 0
    end = -0x40000000
    if half < end:
        t[i] = end + end
        return 0
    if minus:
        t[i] = x - y
    else:
        t[i] = x + y
    return 1


@micropython.viper
def equal_words(a, i: int, b, j: int) -> int:
    """Return whether a[i] == b[j], array('i') elements of any size."""
    x = ptr32(a)
    y = ptr32(b)
    if x[i + 0] == y[j + 0]:
        return 1
    return 0


@micropython.viper
def order_words(a, i: int, b, j: int) -> int:
    """Return the sign of a[i] - b[j], array('i') elements of any size."""
    x = ptr32(a)
    y = ptr32(b)
    if x[i + 0] > y[j + 0]:
        return 1
    if x[i + 0] < y[j + 0]:
        return -1
    return 0
