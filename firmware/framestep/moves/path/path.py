"""The smooth path through uploaded frames: the velocity at each frame.

Between two frames a motor follows the cubic with the frames' positions and these velocities at its
ends (motion/phases.py, AIM). So it passes each frame exactly, and its velocity never jumps.
Velocities come from the fourth-order central difference, (8·(p₊₁ - p₋₁) - (p₊₂ - p₋₂))/12, which
follows sampled motion more closely than a parabola. They are limited to the range that keeps the
cubic monotonic between monotonic frames (Fritsch and Carlson 1980: three times the lesser slope),
that avoids a halt on the way through a frame (half the lesser slope), and to the motor's velocity:
velocity(). If a motor holds still on either side, the velocity is 0, so it never leaves a hold
(field note 5.6).
"""

from framestep.base.native import const, micropython, ptr32
from framestep.motion.reals import multiply, put
from framestep.motors.bounds import LOWER, NO_OVERSHOOT, UPPER

# Words of a window: five positions, from frame -2 to frame 2, and the limit of a slope in twelfths
# of the lesser one
FRAMES = const(0)
MOST = const(5)
WINDOW_WORDS = const(6)
# Words of the window of a run with smoothing (smoothing.py): positions from frame -8 to frame 8 and
# what is computed from them; how far beyond its position the middle frame is passed, Q16 of a step
BESIDE = const(8)
PART = const(27)
SMOOTH_WORDS = const(28)
MONOTONE = const(36)  # at a constant rate
# valid also where the motion starts or stops within a frame, which takes twice as long
FROM_REST = const(18)

TWELFTHS = const(12)  # slopes are counted in twelfths of a step per frame

# Steps from one frame to the next: in a slope a greater difference counts as this, so that slopes
# are small integers
_FAR = const(0x1000000)


@micropython.viper
def slope(window: ptr32, bounds: ptr32, before: int, after: int) -> int:
    """Return the velocity at the middle frame of the window, in 1/12 step per frame.

    before, after: how many frames of the move there are on either side, at most 2 matter.
    Positions may have any value. bounds: the soft limits, or the ends of the range. A turning point
    gets the velocity 0 if the curve would pass a bound there.
    """
    here = window[2]
    # Halve both first, since the difference of two words may need 33 bits.
    back = (here >> 1) - (window[1] >> 1)
    if back > _FAR // 2 - 2:
        back = _FAR
    elif back < 2 - _FAR // 2:
        back = 0 - _FAR
    else:
        back = here - window[1]
    ahead = (window[3] >> 1) - (here >> 1)
    if ahead > _FAR // 2 - 2:
        ahead = _FAR
    elif ahead < 2 - _FAR // 2:
        ahead = 0 - _FAR
    else:
        ahead = window[3] - here
    first = back  # the outer differences
    last = ahead
    if before > 1:
        first = (window[1] >> 1) - (window[0] >> 1)
        if first > _FAR // 2 - 2:
            first = _FAR
        elif first < 2 - _FAR // 2:
            first = 0 - _FAR
        else:
            first = window[1] - window[0]
    if after > 1:
        last = (window[4] >> 1) - (window[3] >> 1)
        if last > _FAR // 2 - 2:
            last = _FAR
        elif last < 2 - _FAR // 2:
            last = 0 - _FAR
        else:
            last = window[4] - window[3]
    most = window[MOST]
    least = 6  # twelfths of the lesser slope, so that it never halts on its way through a frame
    if before == 0:
        least = 0
        if after == 0:
            return 0
        # The parabola through the first three frames
        s = 12 * ahead
        if after > 1:
            s = 18 * ahead - 6 * last
        back = ahead
    elif after == 0:
        least = 0
        s = 12 * back
        if before > 1:
            s = 18 * back - 6 * first
        ahead = back
    elif before > 1 and after > 1:
        s = 7 * (back + ahead) - first - last
    else:
        s = 6 * (back + ahead)
    if back == 0 or ahead == 0:
        return 0
    if back > 0 and ahead > 0:
        if ahead < back:
            back = ahead
        if s < least * back:
            return least * back
        if s > most * back:
            return most * back
        return s
    if back < 0 and ahead < 0:
        if ahead > back:
            back = ahead
        if s > least * back:
            return least * back
        if s < most * back:
            return most * back
        return s
    # A turning point: the curve overshoots it by at most 4/27 of the slope, or of twice the slope
    # if a frame may take twice as long.
    s = 6 * (back + ahead)
    past = s
    if past < 0:
        past = 0 - past
    past = (past * 4 + 323) // 324
    if most < MONOTONE:
        past += past
    # Halve both first, since a distance between two words may need 33 bits.
    if back > 0:
        room = (bounds[UPPER] >> 1) - (here >> 1)
        if room < 0x20000000 and room > -0x20000000:
            room = bounds[UPPER] - here
    else:
        room = (here >> 1) - (bounds[LOWER] >> 1)
        if room < 0x20000000 and room > -0x20000000:
            room = here - bounds[LOWER]
    if room < past or bounds[NO_OVERSHOOT]:
        return 0
    return s


@micropython.viper
def velocity(r, to: int, window, bounds, before: int, after: int, scale: int, top: int):
    """r[to] = slope() times the real number r[scale], limited to r[top] in either direction.

    The limit is needed because a slope may be steeper than both of its chords, and a run goes on
    with the slope of its first and its last frame: for a whole frame, and in the ramps.
    """
    put(r, to, int(slope(window, bounds, before, after)), 0)
    multiply(r, to, to, scale)
    w = ptr32(r)
    m = w[to + 0]
    if m < 0:
        m = 0 - m
    e = w[to + 1] - w[top + 1]
    if m and (e > 0 or (e == 0 and m > w[top + 0])):
        m = w[top + 0]
        if w[to + 0] < 0:
            m = 0 - m
        w[to + 0] = m
        w[to + 1] = w[top + 1]


@micropython.viper
def reverse(window: ptr32, beside: int):
    """Mirror the frames of a window, for playing backward.

    beside: frames on either side of the middle one.
    """
    i = 0
    k = beside + beside
    while i < k:
        t = window[i + 0]
        window[i + 0] = window[k + 0]
        window[k + 0] = t
        i += 1
        k -= 1


@micropython.viper
def near(window: ptr32, there: int) -> int:
    """Return whether another frame is near enough to the middle one for midway()."""
    half = (window[there + 0] >> 1) - (window[2] >> 1)
    if half > _FAR // 2 - 2 or half < 2 - _FAR // 2:
        return 0
    return 1


@micropython.viper
def midway(window: ptr32, there: int, slope_there: int, slope_here: int) -> int:
    """Return where the path is half-way to a neighbour frame, in steps from the middle frame.

    there: 1 for the frame before, 3 for the frame after; slopes in twelfths. A cubic with slopes a
    and b at its ends is (a - b)/8 away from the middle of its chord.
    """
    chord = window[there + 0] - window[2]
    bow = slope_there - slope_here
    if there == 3:
        bow = 0 - bow
    return (48 * chord + bow + 48) // 96
