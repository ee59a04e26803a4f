"""Sine, cosine and arc tangent of `reals`; angles in degrees.

Fixed point inside: sine and cosine are right to 2^-28, angles to 4e-7 degrees. Each is one viper kernel of some
10 microseconds on an RP2040. Nothing allocates.
"""

from array import array

from framestep.native import micropython, ptr32

# Taylor coefficients of sin(x) / x and of cos(x) in powers of x², Q30, last first. Six do for 45 degrees.
_SERIES = array(
    "i",
    [-27, 2959, -213044, 8947849, -178956971, 1073741824] + [-296, 26631, -1491308, 44739243, -536870912, 1073741824],
)

# The arc tangents of k / 16 in degrees, Q24
_ARCS = array(
    "i",
    [0, 60000934, 119537938, 178168250, 235489088, 291152220, 344873211, 396435174, 445687602, 492541372, 536961227]
    + [578956944, 618574237, 655886115, 690985163, 723976963, 754974720],
)


@micropython.viper
def _sines(r: ptr32, sine: int, cosine: int, a: int, series: ptr32):
    right = 0x2D000000  # 45 degrees in Q24; more than 2^30 would be an object
    right = right + right
    x = r[a + 0]
    s = 0 - r[a + 1]
    sign = x >> 31
    x = (x ^ sign) - sign
    quarters = 0
    if s > 24:
        n = s - 24
        if n > 30:
            n = 30
        x = (x + (1 << (n - 1))) >> n
    else:
        if s < 2:  # 2^27 degrees: nothing that a rig can turn
            x = 0
            s = 2
        d = right
        n = 25 - s
        while n:
            quarters = quarters + quarters
            if x >= d:
                x = x - d
                quarters += 1
            d = d >> 1
            n -= 1
        x = x << (24 - s)
    if x > 0x2D000000:
        x = x - right
        quarters += 1
    # radians Q30: 64 π / 180 is 1.117
    mirror = x >> 31
    x = (x ^ mirror) - mirror
    x = x + (x >> 15) * 3834 + (((x >> 15) * 6793 + (x & 0x7FFF) * 3834 + 0x4000) >> 15)
    high = x >> 15
    low = x & 0x7FFF
    square = high * high + ((high * low + 0x2000) >> 14)
    top = square >> 15
    rest = square & 0x7FFF
    i = 0
    value = 0
    first = 0
    while i < 12:
        if i == 6:
            first = value
            value = 0
        m = value >> 15
        value = series[i + 0] + m * top + ((m * rest + (value & 0x7FFF) * top + 0x4000) >> 15)
        i += 1
    m = first >> 15
    x = m * high + ((m * low + (first & 0x7FFF) * high + 0x4000) >> 15)
    # the sine of the whole angle: x, value, -x, -value by quarter; and of the angle's other sign
    x = (x ^ mirror) - mirror
    if quarters & 1:
        m = x
        x = value
        value = 0 - m
    if quarters & 2:
        x = 0 - x
        value = 0 - value
    x = (x ^ sign) - sign
    to = sine
    while True:
        e = -30
        if x:
            if x > 0x3FFFFFFF or x < -0x3FFFFFFF:
                x = x >> 1
                e = -29
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
        if to == cosine:
            break
        to = cosine
        x = value


def sines(r, sine, cosine, a):
    """r[sine], r[cosine] = those of r[a] degrees, |r[a]| < 2^27. The three differ."""
    _sines(r, sine, cosine, a, _SERIES)


@micropython.viper
def _angle(r: ptr32, to: int, y: int, x: int, arcs: ptr32):
    n = r[y + 0]
    d = r[x + 0]
    shift = r[x + 1] - r[y + 1]
    below = n >> 31
    behind = d >> 31
    n = (n ^ below) - below
    d = (d ^ behind) - behind
    steep = 0
    if n and (d == 0 or shift < 0 or (shift == 0 and n > d)):
        steep = 1
        n = n ^ d
        d = n ^ d
        n = n ^ d
        shift = 0 - shift
    if n == 0 or d == 0 or shift > 30:
        n = 0
        d = 1
        shift = 30
    # q = n / d, Q30
    q = 0
    shift = 30 - shift
    if n >= d:
        n = n - d
        q = 1
    while shift:
        q = q + q
        n = n + n
        if n >= d:
            n = n - d
            q += 1
        shift -= 1
    # the nearest sixteenth k, and u = (q - k) / (1 + q k), whose arc tangent is the rest
    k = (q + 0x2000000) >> 26
    n = q - (k << 26)
    less = n >> 31
    n = (n ^ less) - less
    if k:
        d = 0x20000000 + (q >> 5) * k
        q = 0
        shift = 29
        while shift:
            q = q + q
            n = n + n
            if n >= d:
                n = n - d
                q += 1
            shift -= 1
        n = q
    # u - u³/3 + u⁵/5, Q30; u is at most 1/32
    v = (n >> 15) * (n >> 15) + (((n >> 15) * (n & 0x7FFF)) >> 14)
    v = (v >> 5) * (10923 - (v * 3 >> 19)) >> 10
    n = n - ((v >> 4) * (n >> 10) + 0x8000 >> 16)
    # degrees Q24: 180 / π / 64 is 0.895
    n = (n >> 15) * 29335 + (((n >> 15) * 14389 + (n & 0x7FFF) * 29335 + 0x4000) >> 15)
    n = arcs[k + 0] + ((n ^ less) - less)
    e = -24
    if steep:
        n = 0x2D000000 - n + 0x2D000000
    if behind:
        n = 0x2D000000 - (n >> 1) + 0x2D000000
        e = -23
    if n > 0x3FFFFFFF:
        n = (n + 1) >> 1
        e += 1
    if n:
        while n < 0x200000:
            n = n << 8
            e -= 8
        while n < 0x20000000:
            n = n << 1
            e -= 1
    else:
        e = 0
    r[to] = (n ^ below) - below
    r[to + 1] = e


def angle(r, to, y, x):
    """r[to] = the angle of the point (r[x], r[y]) in degrees, -180 to 180; 0 if both are 0."""
    _angle(r, to, y, x, _ARCS)
