"""Interpreter of formulas: lists of operations on registers of `reals`, in one call of a kernel.

A call from Python costs some 18 microseconds on an RP2040, the operation itself one or two. So a
formula is compiled from its text (formula.py, on the computer that builds the firmware) to bytes,
four for each operation: operation, register of the result, registers of two operands. SCALE and
NUMBER have four bytes more. Angles are degrees. Sine and cosine are exact to 2^-28, angles to 4e-7
degrees. Nothing allocates.

Results equal those of the functions in `reals` bit by bit. The arithmetic is here a second time
because a call of those functions would take longer than the operation itself. `reals` still has to
provide single operations for kernels that run from RAM.
"""

from array import array

from framestep.base.native import CPYTHON, const, micropython, ptr8, ptr32

END = const(0)
ADD = const(1)  # to = a + b
SUBTRACT = const(2)  # to = a - b
ABOVE = const(3)  # if not a > b, the formula ends and compute() returns 0
NOT_ABOVE = const(4)  # if a > b, the formula ends and compute() returns 0
LESSER = const(5)  # to = the lesser of a and b
GREATER = const(6)  # to = the greater of a and b
MULTIPLY = const(7)  # to = a · b
DIVIDE = const(8)  # to = a / b, b not 0
ROOT = const(9)  # to = √a, 0 for a negative number
NEGATE = const(10)  # to = -a
SCALE = const(11)  # to = a · 2^(c - 128), c in the next byte; three bytes are unused
# to = c · 2^(d - 128), c in the next two bytes, d in the third; one is unused
NUMBER = const(12)
FLOOR = const(13)  # to = the greatest integer not above a
COPY = const(14)  # to = a
ANGLE = const(15)  # to = the angle of the point (x b, y a), -180 to 180; 0 if both are 0
SINES = const(16)  # to, b = sine and cosine of a, |a| < 2^27

_BIAS = const(128)  # of exponents in a formula

# Taylor coefficients of sin(x) / x and of cos(x) in powers of x², Q30, last first (six suffice for
# 45 degrees); from _ARCS on the arc tangents of k / 16 in degrees, Q24
_ARCS = const(12)
_TABLES = array(
    "i",
    [-27, 2959, -213044, 8947849, -178956971, 1073741824]
    + [-296, 26631, -1491308, 44739243, -536870912, 1073741824]
    + [
        0,
        60000934,
        119537938,
        178168250,
        235489088,
        291152220,
        344873211,
        396435174,
        445687602,
        492541372,
        536961227,
    ]
    + [578956944, 618574237, 655886115, 690985163, 723976963, 754974720],
)


@micropython.viper
def _angle(m: int, n: int, r: ptr32, to: int, a: int, b: int):
    """r[to] = the angle of the point (x r[b], y r[a]), whose mantissas are n and m.

    A function of its own, since a function in flash has to fit a page.
    """
    shift = r[b + 1] - r[a + 1]
    s = m >> 31
    behind = n >> 31
    m = (m ^ s) - s
    n = (n ^ behind) - behind
    steep = 0
    if m and (n == 0 or shift < 0 or (shift == 0 and m > n)):
        steep = 1
        m = m ^ n
        n = m ^ n
        m = m ^ n
        shift = 0 - shift
    if m == 0 or n == 0 or shift > 30:
        m = 0
        n = 1
        shift = 30
    # low = m / n, Q30
    low = 0
    shift = 30 - shift
    while True:
        if m >= n:
            m = m - n
            low += 1
        if shift == 0:
            break
        low = low + low
        m = m + m
        shift -= 1
    # arctan(low) = arctan(k) + arctan(u): k the nearest sixteenth, u = (low - k) / (1 + low · k)
    k = (low + 0x2000000) >> 26
    m = low - (k << 26)
    f = m >> 31
    m = (m ^ f) - f
    if k:
        n = 0x20000000 + (low >> 5) * k
        low = 0
        shift = 29
        while shift:
            low = low + low
            m = m + m
            if m >= n:
                m = m - n
                low += 1
            shift -= 1
        m = low
    # u - u³/3 + u⁵/5, Q30; u is at most 1/32
    n = (m >> 15) * (m >> 15) + (((m >> 15) * (m & 0x7FFF)) >> 14)
    n = (n >> 5) * (10923 - (n * 3 >> 19)) >> 10
    m = m - ((n >> 4) * (m >> 10) + 0x8000 >> 16)
    # degrees Q24: 180 / π / 64 is 0.895
    m = (m >> 15) * 29335 + (((m >> 15) * 14389 + (m & 0x7FFF) * 29335 + 0x4000) >> 15)
    m = ptr32(_TABLES)[k + _ARCS] + ((m ^ f) - f)
    e = -24
    n = 0x2D000000  # 45 degrees
    if steep:
        m = n - m + n
    if behind:
        m = n - (m >> 1) + n
        e = -23
    m = (m ^ s) - s
    while m > 0x3FFFFFFF or m < -0x3FFFFFFF:
        m = (m + 1) >> 1
        e += 1
    if m:
        while m < 0x20000000 and m > -0x20000000:
            m = m << 1
            e -= 1
    else:
        e = 0
    r[to] = m
    r[to + 1] = e


@micropython.viper
def execute(m: int, n: int, registers, formula: ptr8) -> int:
    """Compute a formula. Returns 1, or 0 if an ABOVE or NOT_ABOVE does not hold: the rest is then
    not computed.

    m: index in `formula` at which to begin, 0. m and n are parameters because viper keeps the first
    two in registers on ARM; n may be anything.
    """
    r = ptr32(registers)
    at = m
    while True:
        what = formula[at + 0]
        to = formula[at + 1]
        a = formula[at + 2]
        b = formula[at + 3]
        at += 4
        m = r[a + 0]
        e = r[a + 1]
        n = r[b + 0]
        f = r[b + 1]
        if what <= GREATER:
            if what == END:
                return 1
            if what > ADD:
                n = 0 - n
            if m == 0:
                m = n
                e = f
                n = 0
            if n:
                shift = e - f
                if shift < 0:
                    shift = 0 - shift
                    if shift > 31:
                        shift = 31
                    m = ((m + (1 << (shift - 1))) >> shift) + n  # below 2^31
                    e = f
                elif shift:
                    if shift > 31:
                        shift = 31
                    m = m + ((n + (1 << (shift - 1))) >> shift)
                else:
                    m = m + n
            if what > SUBTRACT:
                if what == ABOVE:
                    if m <= 0:
                        return 0
                    continue
                if what == NOT_ABOVE:
                    if m > 0:
                        return 0
                    continue
                # rounding can turn a difference below 0 into 0, but not one above 0
                if what == GREATER:
                    m = 1 - m
                if m > 0:
                    a = b
                m = r[a + 0]
                e = r[a + 1]
        elif what == MULTIPLY:
            e = e + f + 29
            high = m >> 15
            low = m & 0x7FFF
            top = n >> 15
            n = n & 0x7FFF
            m = ((high * top) << 1) + ((high * n + low * top + (low * n >> 15) + 0x2000) >> 14)
        elif what == DIVIDE:
            s = (m ^ n) >> 31
            if m < 0:
                m = 0 - m
            if n < 0:
                n = 0 - n
            e = e - f - 29
            if m < n:
                m = m + m
                e -= 1
            # 1 <= m / n < 2: find 30 binary digits, and one more to round
            low = 0
            k = 30
            while k:
                low = low + low
                if m >= n:
                    m = m - n
                    low += 1
                m = m + m
                k -= 1
            if m >= n:
                low += 1
            m = (low ^ s) - s
        elif what == ROOT:
            if m < 0:
                m = 0
            if m:
                if e & 1:
                    m = m >> 1
                    e += 1
                e = (e >> 1) - 15
                # upper half, digit by digit: 2^14 <= n < 2^15; m becomes the remainder
                n = 0
                bit = 0x10000000
                while bit:
                    if m >= n + bit:
                        m = m - n - bit
                        n = (n >> 1) + bit
                    else:
                        n = n >> 1
                    bit = bit >> 2
                # lower half: the remainder divided by twice the upper half
                m = m << 14
                low = 0
                f = n << 15
                bit = 0x8000
                while bit:
                    if m >= f:
                        m = m - f
                        low = low + bit
                    f = f >> 1
                    bit = bit >> 1
                if m + m >= n:
                    low += 1
                m = (n << 15) + low
                # the square of the lower half, which the division left out
                if low * low >> 15 >= n:
                    m -= 1
        elif what == NEGATE:
            m = 0 - m
        elif what == SCALE:
            e = e + formula[at + 0] - _BIAS
            at += 4
        elif what == NUMBER:
            m = formula[at + 0] + (formula[at + 1] << 8)
            e = formula[at + 2] - _BIAS
            at += 4
        elif what == FLOOR:
            if e < 0:
                if e < -31:
                    e = -31
                m = m >> (0 - e)
                e = 0
        elif what == ANGLE:
            _angle(m, n, registers, to, a, b)
            continue
        elif what == SINES:
            s = m >> 31
            m = (m ^ s) - s
            quarters = 0
            shift = 0 - e
            n = 0x2D000000  # 45 degrees in Q24
            f = n + n
            if shift > 24:
                shift -= 24
                if shift > 31:
                    shift = 31
                m = (m + (1 << (shift - 1))) >> shift
            else:
                if shift < 2:
                    m = 0
                    shift = 2
                k = 25 - shift
                top = f
                while k:
                    quarters = quarters + quarters
                    if m >= top:
                        m = m - top
                        quarters += 1
                    top = top >> 1
                    k -= 1
                m = m << (24 - shift)
            if m > n:
                m = m - f
                quarters += 1
            # radians Q30: 64 π / 180 is 1.117
            f = m >> 31
            m = (m ^ f) - f
            m = m + (m >> 15) * 3834 + (((m >> 15) * 6793 + (m & 0x7FFF) * 3834 + 0x4000) >> 15)
            high = m >> 15
            low = m & 0x7FFF
            n = high * high + ((high * low + 0x2000) >> 14)
            top = n >> 15
            n = n & 0x7FFF
            tables = ptr32(_TABLES)
            k = 0
            e = 0
            shift = 0
            while k < 12:
                if k == 6:
                    shift = e
                    e = 0
                m = e >> 15
                e = tables[k + 0] + m * top + ((m * n + (e & 0x7FFF) * top + 0x4000) >> 15)
                k += 1
            m = shift >> 15
            m = m * high + ((m * low + (shift & 0x7FFF) * high + 0x4000) >> 15)
            # sine and cosine of the whole angle, by quarter: (m, e), (e, -m), (-m, -e), (-e, m)
            m = (m ^ f) - f
            if quarters & 1:
                f = m
                m = e
                e = 0 - f
            if quarters & 2:
                m = 0 - m
                e = 0 - e
            m = (m ^ s) - s
            n = e
            e = -30
        while True:
            if m > 0x3FFFFFFF or m < -0x3FFFFFFF:
                m = (m + 1) >> 1
                e += 1
            if m:
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
            if what < SINES or to == b:
                break
            m = n
            e = -30
            to = b


if CPYTHON:  # for a board the build replaces each call by one of execute()

    def compute(registers, formula):
        """Compute a formula with these registers; see execute()."""
        return execute(0, 0, registers, formula)
