"""The path of a run with `smoothing`: without the ripple that comes from rounding to whole steps.

An upload has whole steps, so the velocity through them varies by up to a step per frame. But the
kernel makes a step once the path has gone a whole step from the motor's position. Going up, a motor
stays on a position from where the path passes it until just before the next one. So at a frame the
path may be anywhere within that step, and the motor still makes the uploaded steps.

Here the path is in the middle of the step, plus what smoothing adds, at most _CLOSEST. Positions
are smoothed by the middle row of penalized least squares over thirteen of them, with third
differences weighted by 10 (Whittaker 1923; Eilers 2003), which leaves parabolas and cubics
unchanged. Where that changes a position by more than two steps, the upload has a corner, and the
path stays in the middle: after a corner it may be so fast that there has to be room before the next
step. The velocities are computed as in path.py, from smoothed positions. They are limited so that
between two frames the path keeps going in one direction: it makes no step that was not uploaded.

In a hold, where a motor keeps its position for more than _HOLD frames, the path is on the position,
except in the first and last frames of the hold. Where the motor turns, the path goes from one side
of the step to the other, since the motor needs a whole step to come back. A single frame at the
turn is on the side of that neighbour frame next to which the path does not turn.

Played backward the path is the mirror image: the same steps at the same times, except next to a
turn or a hold. Only positions up to eight frames away count, so each frame is passed in the same
way wherever a run begins.
"""

from framestep.base.native import const, micropython, ptr32
from framestep.motion.reals import multiply, put
from framestep.motors.bounds import LOWER, NO_OVERSHOOT, UPPER
from framestep.moves.path.path import BESIDE, PART

# Words of a window
_SPAN = const(17)  # positions from frame -8 to frame 8; slope() counts them from the middle one
_SMOOTHED = const(17)  # frame -2 to frame 2, in parts of a step: see BITS
_HERE = const(22)  # position of the middle frame
BITS = const(23)  # _Q; 0 if positions are so far apart that smoothing makes no difference
# Of the last frame of place():
_KIND = const(24)
_SIGN = const(25)  # direction in which it is passed: 1 up, -1 down
_ADDED = const(26)  # what smoothing adds to its position
# PART, behind these: how far beyond its position the middle frame is passed, Q16 of a step

_Q = const(8)
_HALF = const(128)  # half a step
_CLOSEST = const(122)  # limit of what smoothing adds; a fortieth of a step remains on either side
_CORNER_FROM = const(512)  # two steps; rounding makes less of a difference
_FAR = const(0x20000)  # a position farther from the middle one counts as this far
_FARTHEST = const(0x1000000)  # _FAR if BITS is 0
_HOLD = const(6)
_FADE = const(4)  # frames in which the path approaches the position of a hold, or leaves it
_WORKABLE = const(0x8000)  # steps around a turn within a frame; with more it is left as it is

_STILL = const(0)
_ONWARD = const(1)
_BEYOND = const(2)  # the first or the last frame of several at a turn
_TURNS = const(3)  # a single frame at a turn
_CORNER = const(4)  # a single frame at a turn, passed on its position, as in path.py


@micropython.viper
def smooth(w: ptr32, before: int, after: int):
    """Make the positions relative to the middle one, and set _SMOOTHED and BITS. before, after: as
    for slope()."""
    # Halve both first, since the difference of two words may need 33 bits.
    here = w[BESIDE]
    w[_HERE] = here
    bits = _Q
    far = _FAR
    k = BESIDE - 2
    while k < BESIDE + 3:
        d = (w[k + 0] >> 1) - (here >> 1)
        if d > _FAR // 2 - 2 or d < 2 - _FAR // 2:
            bits = 0
            far = _FARTHEST
        k += 1
    w[BITS] = bits
    k = 0
    while k < _SPAN:
        d = (w[k + 0] >> 1) - (here >> 1)
        if d > (far >> 1) - 2:
            d = far
        elif d < 2 - (far >> 1):
            d = 0 - far
        else:
            d = w[k + 0] - here
        w[k + 0] = d
        k += 1
    # Beyond an end of the upload the motion continues point-symmetrically.
    first = 0
    if before < BESIDE:
        first = BESIDE - before
    last = _SPAN - 1
    if after < BESIDE:
        last = BESIDE + after
    k = last
    while k < _SPAN - 1:
        k += 1
        d = last + last - k
        if d < first:
            d = first
        w[k + 0] = w[last + 0] + w[last + 0] - w[d + 0]
    k = first
    while k:
        k -= 1
        d = first + first - k
        if d > last:
            d = last
        w[k + 0] = w[first + 0] + w[first + 0] - w[d + 0]
    k = BESIDE - 2
    while k < BESIDE + 3:
        here = w[k + 0]
        d = 0
        if bits:
            far = here + here
            d = 859 * (w[k + 1] + w[k - 1] - far) + 583 * (w[k + 2] + w[k - 2] - far)
            d += 279 * (w[k + 3] + w[k - 3] - far) + 38 * (w[k + 4] + w[k - 4] - far)
            d -= 94 * (w[k + 5] + w[k - 5] - far) + 110 * (w[k + 6] + w[k - 6] - far)
            d = (d + 8) >> 4  # from Q12
            if (d + _CORNER_FROM) >> 10:
                d = 0
            elif d > _CLOSEST:
                d = _CLOSEST
            elif d < 0 - _CLOSEST:
                d = 0 - _CLOSEST
        w[k + _SMOOTHED - BESIDE + 2] = (here << bits) + d
        k += 1


@micropython.viper
def room(w: ptr32, bounds: ptr32, k: int, sign: int) -> int:
    """Return the steps from frame k's position to the bound in that direction, at most 2^28."""
    end = bounds[UPPER] if sign > 0 else bounds[LOWER]
    # Halve all first, since a distance between two words may need 33 bits.
    d = (end >> 1) - (w[_HERE] >> 1) - (w[k + 0] >> 1)
    if d > 0x8000000 or d < -0x8000000:  # beyond a small integer it would be allocated
        return 0x10000000
    d = end - w[_HERE] - w[k + 0]
    return d if sign > 0 else 0 - d


@micropython.viper
def place(w, bounds, k: int) -> int:
    """Return how far beyond frame k of the window, smoothed, the path passes it: up to half a step.

    Backward the path passes it as far on the other side. Sets _KIND, _SIGN and _ADDED.
    """
    f = ptr32(w)
    p = f[k + 0]
    i = 0
    while i < _HOLD and f[k - i - 1] == p:
        i += 1
    arrival = 0
    if i < _HOLD:
        arrival = 1 if f[k - i - 1] < p else -1
    j = 0
    while j < _HOLD and f[k + j + 1] == p:
        j += 1
    departure = 0
    if j < _HOLD:
        departure = 1 if f[k + j + 1] > p else -1
    f[_SIGN] = arrival
    f[_ADDED] = 0
    bits = f[BITS]
    at = k + _SMOOTHED - BESIDE + 2
    smoothed = f[at + 0] - (p << bits)
    if i + j >= _HOLD:
        f[_KIND] = _STILL
        if bits == 0:
            return 0
        here = 0
        if i < _FADE:
            here = arrival * (_FADE - i)
        if j < _FADE:
            here += departure * (_FADE - j)
        return here * (_HALF // _FADE)
    if arrival == departure:
        f[_KIND] = _ONWARD
        f[_ADDED] = smoothed
        return arrival * _HALF if bits else 0
    if i + j:
        f[_KIND] = _STILL
        if bits == 0:
            return 0
        d = j - i
        if d < 0:
            d = i - j
            arrival = departure
        here = _HALF * d // (i + j) * arrival
        if ptr32(bounds)[NO_OVERSHOOT]:
            return here
        if i == 0:
            f[_KIND] = _BEYOND
        elif j == 0:
            f[_KIND] = _BEYOND
            f[_SIGN] = departure
        f[_ADDED] = smoothed
        return here
    f[_KIND] = _CORNER
    if bits == 0 or ptr32(bounds)[NO_OVERSHOOT]:
        return 0
    # Distance on the way to the turn, and back. Do the frames next to this one move on as well?
    d = (p - f[k - 1]) * arrival
    rise = (p - f[k + 1]) * arrival
    if d > _WORKABLE or rise > _WORKABLE:
        return 0
    if (f[k - 1] - f[k - 2]) * arrival <= 0 or (f[k + 2] - f[k + 1]) * departure <= 0:
        return 0
    rise = (f[at + 1] - f[at - 1]) * arrival  # half of its slope
    # The path overshoots the frame by 4/27 of the slope.
    past = rise
    if rise < 0:
        past = 0 - rise
    past = (past * 2 // 27 + _HALF + smoothed * arrival) >> bits
    if int(room(w, bounds, k, arrival)) < past:
        return 0
    # If the path turns in the frame before, it comes back to half a step below the position. That
    # is enough only if it has reached the position before. The cubic from half a step above the
    # frame before shows that at an eighth, a fourth or half of the way back, whatever its velocity
    # there. If it turns in the frame after, the same holds backward.
    beside = k - 1
    if rise >= 0:
        beside = k + 1
        at += 1
    else:
        at -= 1
        rise = 0 - rise
    fall = rise >> 1
    short = _HALF - smoothed * arrival
    d = (p - f[beside]) * arrival
    back = short + _HALF + (f[at + 0] - (f[beside] << bits)) * arrival - (d << bits)
    if d < 2 or (
        49 * fall + 22 * back < short << 9
        and 9 * fall + 10 * back < short << 6
        and fall + 4 * back < short << 3
    ):
        return 0
    f[_KIND] = _TURNS
    if beside < k:
        arrival = 0 - arrival
        f[_SIGN] = arrival
    f[_ADDED] = smoothed
    return arrival * _HALF


@micropython.viper
def slope(window, bounds, before: int, after: int) -> int:
    """Return the velocity at the middle frame, in 1/12 step per frame, with BITS binary digits.
    Sets PART.

    before, after: how many frames of the upload there are on either side, at most 8 matter.
    bounds: as for path.slope(). Changes the positions in the window.
    """
    w = ptr32(window)
    smooth(window, before, after)
    bits = w[BITS]
    past = int(place(window, bounds, BESIDE - 1))
    back = (w[BESIDE - 1] << bits) + w[_ADDED]
    onward = int(place(window, bounds, BESIDE + 1))
    ahead = (w[BESIDE + 1] << bits) + w[_ADDED]
    here = int(place(window, bounds, BESIDE))
    kind = w[_KIND]
    sign = w[_SIGN]
    # How far the path goes on either side, forward or backward, whichever is less
    past -= here
    if past > 0:
        past = 0 - past
    past += (w[_ADDED] - back) * sign
    onward -= here
    if onward > 0:
        onward = 0 - onward
    onward += (ahead - w[_ADDED]) * sign
    here += w[_ADDED]
    w[PART] = here << 8
    if before == 0:
        past = onward
        if w[BESIDE + 1] == 0:
            return 0
    if after == 0:
        onward = past
        if w[BESIDE - 1] == 0:
            return 0
    if kind == _STILL:
        return 0
    # The same of smoothed positions
    first = w[_SMOOTHED + 2] - w[_SMOOTHED + 1]
    last = w[_SMOOTHED + 3] - w[_SMOOTHED + 2]
    s = 6 * (first + last)
    least = 0
    if kind == _ONWARD:
        if before == 0:
            s = 12 * last
            if after > 1:
                s = 18 * last - 6 * (w[_SMOOTHED + 4] - w[_SMOOTHED + 3])
        elif after == 0:
            s = 12 * first
            if before > 1:
                s = 18 * first - 6 * (w[_SMOOTHED + 1] - w[_SMOOTHED])
        else:
            least = 6 * (last if (last - first) * sign < 0 else first) * sign
            if least < 0:
                least = 0
            if before > 1 and after > 1:
                s += first + last
                s += w[_SMOOTHED] - w[_SMOOTHED + 1] + w[_SMOOTHED + 3] - w[_SMOOTHED + 4]
        if onward < past:
            past = onward
    elif kind == _BEYOND:
        back = here if here > 0 else 0 - here
        if w[BESIDE + 1]:  # it is the last of them
            past = onward
        else:
            back = 256 - back
        # so that between these frames the path stays within a step of their position
        if past > back:
            past = back
    elif kind == _TURNS:
        if w[BESIDE - 1] * sign > 0:  # it has turned in the frame before
            past = onward
    else:
        s = 6 * (w[BESIDE + 1] - w[BESIDE - 1]) << bits
        ahead = s if s > 0 else 0 - s
        ahead = ((ahead >> bits) * 4 + 323) // 324
        if ptr32(bounds)[NO_OVERSHOOT] or int(room(window, bounds, BESIDE, sign)) < ahead:
            return 0
        if s * sign < 0:
            sign = 0 - sign
            past = 0 - onward
    s = s * sign
    if bits == 0:
        past -= 1  # the frames next to it may be a step farther
    if past < 0:
        past = 0
    if s < least:
        s = least
    if s > 36 * past:
        s = 36 * past
    return s * sign


@micropython.viper
def velocity(r, to: int, window, bounds, before: int, after: int, scale: int, top: int):
    """Set r[to] like path.velocity(), but from this module's slope()."""
    put(r, to, int(slope(window, bounds, before, after)), 0 - ptr32(window)[BITS])
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
