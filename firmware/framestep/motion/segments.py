"""Exact motion of one motor as a cubic in time, cut into segments for the tick kernel.

    position(x) = P + G1·x + G2·x² + G3·x³        x in ticks

Each coefficient is a fixed-point number with 46 fraction bits in two words, `high` (Q16, signed)
and `low` (the 30 bits below). G3 has 58 fraction bits. The position has a word of whole steps in
front. So a cubic can be moved along for half a minute, a few ticks at a time, with an error below a
hundredth of a step. A longer one is computed again on the way (phases.py).

The kernel adds up displacements, so a segment gets the differences of the cubic at its start:
first G1 + G2 + G3, second 2·G2 + 6·G3, third 6·G3.
"""

from framestep.base.native import const, micropython, ptr32
from framestep.pulse import stepper as sw

# Words of a cubic
WHOLE = const(0)  # whole steps
P = const(1)  # the fraction of a step, 0 <= P < 1
G1 = const(3)
G2 = const(5)
G3 = const(7)
CUBIC_WORDS = const(9)

LONGEST = const(32)  # ticks in a segment: limits rounding errors, and the time to a new plan
# With so few ticks the kernel's sums are off by 24 units (Q22) at most: one of the velocity for
# each tick, half of one of the acceleration 8·7/2 times, and some of the jerk. See meet().
EXACT = const(8)

_SLOW = const(0x2000000)  # Q22: eight steps per tick
_STEEP = const(0x40000)  # Q16: four steps per tick²
# Q22: less than _STEP_TOLERANCE of pulse/tick.py by more than the units that EXACT and meet() leave
_NEAR = const(64)
_SLOTS = const(sw.SEGMENTS - 1)
_MASK = const(0x3FFFFFFF)


@micropython.viper
def shift(cubic: ptr32, fraction: int, powers: int, back: int):
    """Move the origin of a cubic by x = fraction·2^(powers-30) ticks; into the past if back is 1.

    0 <= fraction < 2^30, 0 <= powers <= 6. The shifted values must stay below 2^14 (steps).
    """
    m1 = fraction >> 15
    m0 = fraction & 0x7FFF
    turn = 0
    while turn < 6:
        # Horner: add x times coefficient k + 1 to coefficient k, for k = 2, 1, 0, 2, 1, 2.
        k = 2 - turn
        if turn > 2:
            k = 5 - turn
        if turn == 5:
            k = 2
        turn += 1
        k = k + k + 1
        high = cubic[k + 2]
        low = cubic[k + 3]
        h1 = high >> 15
        h0 = high & 0x7FFF
        l1 = low >> 15
        l0 = low & 0x7FFF
        middle = h1 * m0 + h0 * m1
        high = h1 * m1 + (middle >> 15)
        low = ((middle & 0x7FFF) << 15) + h0 * m0
        high = high + (low >> 30 & 1)
        low = (low & _MASK) + l1 * m1 + ((l1 * m0 + l0 * m1) >> 15)
        high = high + (low >> 30 & 1)
        low = low & _MASK
        if powers:
            high = (high << powers) + (low >> (30 - powers))
            low = (low << powers) & _MASK
        if k == G2:
            low = ((high & 0xFFF) << 18) + (low >> 12)
            high = high >> 12
        if back:
            low = cubic[k + 1] - low
            high = cubic[k + 0] - high + (low >> 31)
        else:
            low = cubic[k + 1] + low
            high = cubic[k + 0] + high + (low >> 30 & 1)
        cubic[k + 1] = low & _MASK
        cubic[k] = high
    steps = cubic[P] >> 16
    low = -0x40000000
    # Only going down: going up the sum would wrap.
    if cubic[WHOLE] < 0 and steps < 0 and cubic[WHOLE] - (low + low) + steps < 0:
        cubic[WHOLE] = low + low  # rounding took it just past the end of the range
        cubic[P] = 0
        cubic[P + 1] = 0
    else:
        cubic[WHOLE] = cubic[WHOLE] + steps
        cubic[P] = cubic[P] & 0xFFFF


@micropython.viper
def cut(cubic: ptr32, block: ptr32, ticks: int):
    """Queue the next `ticks` (1 to 32) of a cubic as a segment. The queue must have room."""
    q = ptr32(block[sw.QUEUE])
    k = (block[sw.WRITE_INDEX] & _SLOTS) << 3
    # G1 + G2 + G3 in Q22: the high words, and the carry from the low words
    low = (cubic[G1 + 1] >> 3) + (cubic[G2 + 1] >> 3) + (cubic[G3] << 15 & 0x7FFFFFF)
    high = cubic[G1] + cubic[G2] + (cubic[G3] >> 12)
    q[k + sw.SEG_TICKS] = ticks
    q[k + sw.SEG_WHOLE] = cubic[WHOLE]
    q[k + sw.SEG_FRACTION] = (cubic[P] << 6) + (cubic[P + 1] >> 24)
    q[k + sw.SEG_VELOCITY] = (high << 6) + (low >> 21)
    jerk = (cubic[G3] << 1) + (cubic[G3 + 1] >> 29)
    jerk += jerk >> 1  # three halves: a product would not fit if the phase has a single tick
    # The kernel rounds the acceleration down from Q27 to Q22: add half a unit.
    q[k + sw.SEG_ACCEL] = (cubic[G2] << 12) + (cubic[G2 + 1] >> 18) + jerk + 16
    # After its last tick the kernel adds the jerk once more. From a single tick of a short phase
    # that sum would not fit.
    q[k + sw.SEG_JERK] = 0 if ticks == 1 else jerk
    q[k + sw.SEG_BRIDGE] = 0
    q[k + sw.SEG_SPAN] = block[sw.WHOLE_SPAN]
    block[sw.WRITE_INDEX] = (block[sw.WRITE_INDEX] + 1) & _MASK


@micropython.viper
def meet(cubic: ptr32, block: ptr32, ticks: int):
    """Make the segment that cut() has queued end where the cubic now is, to half a unit for each of
    its ticks.

    The kernel's sums round: by up to 300 units (Q22) in 32 ticks, more than _STEP_TOLERANCE of
    pulse/tick.py. Then a motor that turns on the step at the segment's end would not make it, and
    one that passes it slowly would be microseconds late. So the sums are made here, and the
    segment's velocity changes by what is left over. Where a motor is fast it makes no difference.
    """
    if (cubic[G1] + 0x80000) >> 20:
        return
    q = ptr32(block[sw.QUEUE])
    k = ((block[sw.WRITE_INDEX] - 1) & _SLOTS) << 3
    whole = q[k + sw.SEG_WHOLE] - cubic[WHOLE]  # at the end of the range rounding may pass it
    rem = q[k + sw.SEG_FRACTION]
    v = q[k + sw.SEG_VELOCITY]
    a = q[k + sw.SEG_ACCEL]
    jerk = q[k + sw.SEG_JERK]
    n = ticks
    while n:
        n -= 1
        rem = rem + v
        v = v + (a >> 5)
        a = a + jerk
        whole = whole + (rem >> 22)
        rem = rem & 0x3FFFFF
    rem = rem + (whole << 22) - (cubic[P] << 6) - (cubic[P + 1] >> 24)
    q[k + sw.SEG_VELOCITY] = q[k + sw.SEG_VELOCITY] - (rem + (ticks >> 1)) // ticks


# What mark() and knot() keep about a tick that two phases share
OPEN_WHOLE = const(0)  # position at its start, whole steps
OPEN_FRACTION = const(1)  # position at its start, Q22 of one more step
OPEN_ACCEL = const(2)  # half the acceleration at its start, Q27
OPEN_SHARE = const(3)  # share of the tick (Q30) after which the place is known, or 0
OPEN_STEP = const(4)  # that place, whole steps
OPEN_PART = const(5)  # that place, Q16 of one more step
OPEN_WORDS = const(6)


@micropython.viper
def mark(state: ptr32, cubic: ptr32):
    """Keep the position and acceleration of a cubic, for bridge()."""
    state[OPEN_WHOLE] = cubic[WHOLE]
    state[OPEN_FRACTION] = (cubic[P] << 6) + (cubic[P + 1] >> 24)
    state[OPEN_ACCEL] = (cubic[G2] << 11) + (cubic[G2 + 1] >> 19)
    state[OPEN_SHARE] = 0


@micropython.viper
def knot(state: ptr32, at: ptr32, part: int):
    """Keep that within the tick of mark(), after its share `part` (Q30), the cubic is exactly at
    the place `at` (AT_ words)."""
    state[OPEN_SHARE] = part
    state[OPEN_STEP] = at[sw.AT_STEP]
    state[OPEN_PART] = at[sw.AT_PART]


@micropython.viper
def bridge(state: ptr32, cubic: ptr32, block: ptr32, part: int):
    """Queue one tick from the place of mark() to where the cubic is now.

    part: the share of the tick (Q30) after which the cubic is at rest, if it comes to rest.

    The kernel makes one parabola of the two phases. At low velocity this goes through the place of
    knot(), which is a frame's, so that the steps there are in time.

    If the motion turns within the tick, at or next to the step of knot(), that step lies outside of
    the range between the tick's ends, and the kernel would not make it. Then the segment leads to
    that step in that share of the tick, and the next segment begins a little behind. No step is
    lost, since the kernel tolerates a difference of two steps, and this one is smaller.
    """
    q = ptr32(block[sw.QUEUE])
    k = (block[sw.WRITE_INDEX] & _SLOTS) << 3
    q[k + sw.SEG_TICKS] = 1
    q[k + sw.SEG_WHOLE] = state[OPEN_WHOLE]
    q[k + sw.SEG_FRACTION] = state[OPEN_FRACTION]
    q[k + sw.SEG_VELOCITY] = (
        ((cubic[WHOLE] - state[OPEN_WHOLE]) << 22)
        + (cubic[P] << 6)
        + (cubic[P + 1] >> 24)
        - state[OPEN_FRACTION]
    )
    # the mean of the accelerations before and after
    q[k + sw.SEG_ACCEL] = state[OPEN_ACCEL] + (cubic[G2] << 11) + (cubic[G2 + 1] >> 19)
    q[k + sw.SEG_JERK] = 0
    q[k + sw.SEG_BRIDGE] = 1
    q[k + sw.SEG_SPAN] = block[sw.WHOLE_SPAN]
    turns = 0
    share = state[OPEN_SHARE]
    step = state[OPEN_STEP]
    if share and state[OPEN_PART] == 0:
        back = step - cubic[WHOLE]  # from the step back to the end of the tick, rounded up
        if back > 0:
            if back < 3 and state[OPEN_WHOLE] < step:
                # a place this close to the step counts as on it, and the step as made
                if step - state[OPEN_WHOLE] - 1 or state[OPEN_FRACTION] < sw.ONE - _NEAR:
                    turns = share
        elif back > -2:
            # below both ends
            if cubic[P] or cubic[P + 1] or back:
                if state[OPEN_WHOLE] > step or (
                    state[OPEN_WHOLE] == step and state[OPEN_FRACTION] > _NEAR
                ):
                    turns = share
    if turns == 0 and share >> 19 and (_MASK - share) >> 19:
        d = q[k + sw.SEG_VELOCITY]
        if (d + _SLOW) >> 26 == 0 and (step - state[OPEN_WHOLE] + 16) >> 5 == 0:
            # p(x) = d·x - a·x·(1 - x)/2: find the a with which p(share) is the place
            x = share >> 17
            e = ((d >> 11) * x >> 2) + ((d & 0x7FF) * x >> 13)
            e = e - ((step - state[OPEN_WHOLE]) << 22)
            e = e + state[OPEN_FRACTION] - (state[OPEN_PART] << 6)
            if (e + sw.ONE // 2) >> 22 == 0:
                x = x * (8192 - x) >> 11
                d = d >> 6
                e = e << 9
                half = e // x  # of a, Q16
                if d < 0:
                    d = 0 - d
                if state[OPEN_PART] == 0 and (half > d + d or half + d + d < 0):
                    turns = share  # the peak lies far beyond both ends
                elif (half + _STEEP) >> 19 == 0 and share >> 23 and (_MASK - share) >> 23:
                    q[k + sw.SEG_ACCEL] = (half << 12) + ((e - half * x) << 12) // x
    if turns:
        q[k + sw.SEG_VELOCITY] = ((step - state[OPEN_WHOLE]) << 22) - state[OPEN_FRACTION]
        part = turns
    if turns or (cubic[G1] == 0 and cubic[G1 + 1] == 0):
        q[k + sw.SEG_SPAN] = (
            (part >> 16) * block[sw.WHOLE_SPAN] >> 14
        ) + 1  # the kernel divides by it
    block[sw.WRITE_INDEX] = (block[sw.WRITE_INDEX] + 1) & _MASK


@micropython.viper
def mirror(block: ptr32, other: ptr32, base: ptr32, opposite: int):
    """Copy the segment queued last into the queue of a coupled motor.

    base: that motor's step minus this one's; opposite: 1 if it turns in the opposite sense, then
    base is the sum of both. The kernel computes both motors' ticks alike to the bit, so they are
    never a step apart, whatever stops them.
    """
    q = ptr32(block[sw.QUEUE])
    k = ((block[sw.WRITE_INDEX] - 1) & _SLOTS) << 3
    p = ptr32(other[sw.QUEUE])
    j = (other[sw.WRITE_INDEX] & _SLOTS) << 3
    whole = q[k + sw.SEG_WHOLE]
    part = q[k + sw.SEG_FRACTION]
    v = q[k + sw.SEG_VELOCITY]
    a = q[k + sw.SEG_ACCEL]
    jerk = q[k + sw.SEG_JERK]
    if opposite:
        whole = base[0] - whole
        if part:
            whole -= 1
            part = 0x400000 - part
        v = 0 - v
        jerk = 0 - jerk
        # so that the kernel rounds it down to the negative of the other motor's
        a = 31 - a
    else:
        whole = base[0] + whole
    p[j + sw.SEG_TICKS] = q[k + sw.SEG_TICKS]
    p[j + sw.SEG_WHOLE] = whole
    p[j + sw.SEG_FRACTION] = part
    p[j + sw.SEG_VELOCITY] = v
    p[j + sw.SEG_ACCEL] = a
    p[j + sw.SEG_JERK] = jerk
    p[j + sw.SEG_BRIDGE] = q[k + sw.SEG_BRIDGE]
    p[j + sw.SEG_SPAN] = q[k + sw.SEG_SPAN]
    other[sw.WRITE_INDEX] = (other[sw.WRITE_INDEX] + 1) & _MASK


@micropython.viper
def snap(cubic: ptr32, at: ptr32):
    """Put a cubic exactly on the step at[0] plus at[1] (Q16), which it has reached except for
    rounding."""
    cubic[WHOLE] = at[0]
    cubic[P] = at[1]
    cubic[P + 1] = 0


@micropython.viper
def settle(cubic: ptr32):
    """Bring a cubic to rest where it is. If that is within a sixteenth of a whole step, then on
    this step."""
    if (cubic[P] + 0x1000) & 0xE000 == 0:
        cubic[WHOLE] = cubic[WHOLE] + ((cubic[P] + 0x8000) >> 16)
        cubic[P] = 0
    cubic[P + 1] = 0
    i = G1
    while i < CUBIC_WORDS:
        cubic[i + 0] = 0
        i += 1


@micropython.viper
def coefficient(cubic: ptr32, k: int, r: ptr32, a: int):
    """Set coefficient k (G1, G2 or G3) to the real number r[a], below 2^14 (G3: below 2^2)."""
    m = r[a + 0]
    e = r[a + 1] + 46
    if k == G3:
        e += 12
    if e >= 30:
        high = m << (e - 30)
        low = 0
    elif e > 0:
        high = m >> (30 - e)
        low = (m << e) & _MASK
    else:
        if e < -31:
            e = -31
        m = m >> (0 - e)
        high = m >> 30
        low = m & _MASK
    cubic[k] = high
    cubic[k + 1] = low


@micropython.viper
def velocity(r: ptr32, to: int, cubic: ptr32, k: int):
    """r[to] = coefficient k of a cubic, as a real number"""
    m = cubic[k + 0]
    low = cubic[k + 1]
    e = -16
    if m == 0 or m == -1:
        m = (m << 30) + low
        e = -46
        low = 0
    if m:
        while m > 0x3FFFFFFF or m < -0x3FFFFFFF:
            m = m >> 1
            e += 1
        while m < 0x20000000 and m > -0x20000000:
            m = m + m + (low >> 29)
            low = (low << 1) & _MASK
            e -= 1
    else:
        e = 0
    r[to] = m
    r[to + 1] = e


@micropython.viper
def distance(r: ptr32, to: int, target, i: int, cubic: ptr32):
    """r[to] = target[i] - position of the cubic. Exact to 2^-16 of a step below 2^14 steps, to 2^-9
    below 2^21, to a step beyond."""
    t = ptr32(target)
    x = t[i + 0]
    y = cubic[WHOLE]
    # Halve both first, since a distance between two words may need 33 bits.
    m = (x >> 1) - (y >> 1)
    e = 1
    if m < 0x20000000 and m > -0x20000000:
        m = m + m + (x & 1) - (y & 1)
        e = 0
        if m < 0x4000 and m > -0x4000:
            m = (m << 16) - cubic[P]
            e = -16
        elif m < 0x200000 and m > -0x200000:
            m = (m << 9) - (cubic[P] >> 7)
            e = -9
    if m:
        while m > 0x3FFFFFFF or m < -0x3FFFFFFF:
            m = m >> 1
            e += 1
        while m < 0x20000000 and m > -0x20000000:
            m = m + m
            e -= 1
    else:
        e = 0
    r[to] = m
    r[to + 1] = e
