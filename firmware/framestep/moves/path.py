"""The smooth path through uploaded frames: velocity at each frame, and what a motor needs for it.

Between two frames a motor follows the cubic with the frames' positions and these velocities at its
ends (motion/phases.py, AIM), so it passes each frame exactly and its velocity never jumps.
Velocities are those of the fourth-order central difference, (8·(p₊₁ - p₋₁) - (p₊₂ - p₋₂))/12, which
follows sampled motion more closely than a parabola, held within the range that keeps the cubic
monotonic between monotonic frames (Fritsch and Carlson 1980: three times the lesser slope) and away
from a halt in passing (half the lesser slope). They are held within the motor's velocity, too:
velocity(). Where a motor holds still on either side the velocity is 0, so it never leaves a hold
(field note 5.6).
"""

from framestep.motion.reals import multiply, put
from framestep.motors.bounds import EXACT, LOWER, UPPER
from framestep.native import const, micropython, ptr32

# Words of a window: five positions, frame -2 to frame 2, and twelfths of the lesser slope that are
# the most
FRAMES = const(0)
MOST = const(5)
WINDOW_WORDS = const(6)
MONOTONE = const(36)  # at a constant rate
# also where the motion starts or stops within a frame, which takes twice as long
FROM_REST = const(18)

TWELFTHS = const(12)  # slopes are counted in twelfths of a step per frame

# Steps from one frame to the next: a greater difference counts as this in a slope, so that slopes
# are small integers
_FAR = const(0x1000000)


@micropython.viper
def slope(window: ptr32, bounds: ptr32, before: int, after: int) -> int:
    """Velocity at the middle frame of the window, in 1/12 step per frame.

    before, after: how many frames of the move there are on either side; 2 are as good as more.
    The positions may be any. bounds are the soft limits, or the ends of the range; a turning point
    so close to one that the curve would pass it gets the velocity 0.
    """
    here = window[2]
    # Halves tell how far, since the difference of two words may need 33 bits.
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
    least = 6  # twelfths of the lesser slope: it never halts on its way through a frame
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
    # A turning point: the curve passes it by at most 4/27 of the slope.
    s = 6 * (back + ahead)
    past = s
    if past < 0:
        past = 0 - past
    past = (past * 4 + 323) // 324
    # halves first: from one end of the range to the other is more than a word holds
    if back > 0:
        room = (bounds[UPPER] >> 1) - (here >> 1)
        if room < 0x20000000 and room > -0x20000000:
            room = bounds[UPPER] - here
    else:
        room = (here >> 1) - (bounds[LOWER] >> 1)
        if room < 0x20000000 and room > -0x20000000:
            room = here - bounds[LOWER]
    if room < past or bounds[EXACT]:
        return 0
    return s


@micropython.viper
def velocity(r, to: int, window, bounds, before: int, after: int, scale: int, top: int):
    """r[to] = slope() times the real number r[scale], but no more than r[top] either way.

    A slope may be steeper than both of its chords. At an end of a play the motor keeps it for a
    whole frame, and ramps to it and from it.
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


# Words of a check: the two frames before, how many of them there are, and what the motor allows
BEFORE = const(0)
SEEN = const(2)
FASTEST = const(3)  # steps from frame to frame
STEEPEST = const(4)  # change of that
LOWEST = const(5)  # how far the load may go
HIGHEST = const(6)
BACKLASH = const(7)  # steps of backlash
LAST = const(8)  # the last frame's position, the motor's step for it less that
OFFSET = const(9)
RAMP = const(10)  # see bends()
# 1: from the frame before the last one to the last one the motor has taken up its play
TAKEN = const(11)
# a change that the kernel's numbers still hold; STEEPEST where more than that is refused
HARDEST = const(12)
PULSED = const(13)  # steps from frame to frame that the board can pulse
# the greatest change above STEEPEST so far, and at which frame, counted from 0
SHARPEST = const(14)
SHARPEST_AT = const(15)
FOUND = const(16)  # what has not been let pass, in steps or as a change of them
BENT = const(17)  # of what bends() has found, steps per frame and frame: the path's own bend,
GATHERED = const(18)  # and what comes on top while the rate itself changes
FINE = const(19)
CHECK_WORDS = const(20)

FITS = const(0)
TOO_FAST = const(1)
TOO_HIGH = const(2)
TOO_LOW = const(3)
TOO_STEEP = const(4)
TOO_HARD = const(5)  # for the board


@micropython.viper
def check(words: ptr32, values: ptr32, count: int, order: int) -> int:
    """Check `count` more frames: FITS, TOO_FAST, TOO_HIGH, TOO_LOW, TOO_STEEP or TOO_HARD.

    For all but FITS, SEEN is the frame and FOUND what was too much there.

    order: 1 where they are played from the first to the last, -1 the other way round. OFFSET is 0
    at the first one, or -BACKLASH if the play has been taken up for a motion down. Where its motion
    turns, the motor takes it up.

    The frame in which it does so begins or ends with next to no velocity. So its cubic is faster
    than its mean: by up to half of that, and an eighth of a neighbour's mean where that goes the
    other way. That has to be within FASTEST.
    """
    a = words[BEFORE]
    b = words[BEFORE + 1]
    seen = words[SEEN]
    fastest = words[FASTEST]
    steepest = words[STEEPEST]
    play = words[BACKLASH]
    taken = words[TAKEN]
    i = 0
    if order < 0:
        i = count - 1
    while count > 0:
        count -= 1
        p = values[i + 0]
        i += 1
        if order < 0:
            i -= 2
        words[SEEN] = seen
        if p > words[HIGHEST]:
            return TOO_HIGH
        if p < words[LOWEST]:
            return TOO_LOW
        before = taken
        if play:
            # the motor's own steps
            taken = 0
            if seen:
                if p > words[LAST]:
                    if words[OFFSET]:
                        taken = 1
                    words[OFFSET] = 0
                elif p < words[LAST]:
                    if words[OFFSET] == 0:
                        taken = 1
                    words[OFFSET] = 0 - play
            words[LAST] = p
            p = p + words[OFFSET]
        if seen:
            # halves first, since the difference of two words may need 33 bits
            step = (p >> 1) - (b >> 1)
            if step > fastest or step < 0 - fastest:
                words[FOUND] = 0x1FFFFFFF
                return TOO_FAST
            step = p - b
            words[FOUND] = step
            if step < 0:
                words[FOUND] = 0 - step
            if step > fastest or step < 0 - fastest:
                return TOO_FAST
            if taken | before:
                last = 0
                if seen > 1:
                    last = b - a
                    if last < 0:
                        last = 0 - last
                most = step
                if most < 0:
                    most = 0 - most
                if taken:
                    if most + (most >> 1) + (last >> 3) > fastest:
                        return TOO_FAST
                if before:
                    if last + (last >> 1) + (most >> 3) > fastest:
                        return TOO_FAST
            if seen > 1:
                change = step - (b - a)
                if change < 0:
                    change = 0 - change
                most = words[FOUND]
                if change > steepest:
                    words[SEEN] = seen - 1
                    if change > words[HARDEST]:
                        words[FOUND] = change
                        return TOO_STEEP if words[HARDEST] == steepest else TOO_HARD
                    if change > words[SHARPEST]:
                        words[SHARPEST] = change
                        words[SHARPEST_AT] = seen - 1
                    # How fast the cubics on either side may be: their mean, and no more than that
                    # or the change on top.
                    last = b - a
                    if last < 0:
                        last = 0 - last
                    if last > most:
                        most = last
                    if change > most:
                        change = most
                    if most + change > words[PULSED]:
                        words[FOUND] = most + change
                        return TOO_HARD
        a = b
        b = p
        seen += 1
    words[BEFORE] = a
    words[BEFORE + 1] = b
    words[SEEN] = seen
    words[TAKEN] = taken
    return FITS


@micropython.viper
def bends(
    words,
    values,
    bounds,
    window,
    begin: int,
    count: int,
    index: int,
    last: int,
    order: int,
    rests: int,
) -> int:
    """How fast and how steep the cubics between frames are: 0 where the motor can follow all, or
    the number of those looked at, the last of which is too fast or too steep: FOUND, BENT,
    GATHERED. Call it again with that as `begin`.

    values: `count` frames, in the upload's order, and two more on either side. index: of the first
    one played, in an upload that ends with `last`. order, OFFSET: as for check(), which has let
    them pass, with 2^23 as FASTEST. rests: 1 if it is at rest at the first frame of these, 2 if at
    the last one, 3 for both. RAMP: change of the rate in a frame's time, as a part of it, Q15: at
    most half. FINE, for three frames per second and more: that is Q18, and STEEPEST is in 256ths of
    a step.
    """
    own = ptr32(words)
    v = ptr32(values)
    w = ptr32(window)
    play = own[BACKLASH]
    if begin == 0:
        begin = 1
    while begin < count:
        k = begin + 2
        if order < 0:
            k = count + 1 - begin
        begin += 1
        step = v[k + 0] - v[k - order]
        if play:
            # the motor's own steps
            if step > 0:
                step -= own[OFFSET]
                own[OFFSET] = 0
            elif step < 0:
                step -= play + own[OFFSET]
                own[OFFSET] = 0 - play
        # A slope is no farther from a step beside it than one and a half times the most that steps
        # change around it.
        low = k
        if order > 0:
            low = k - 1
        most = 0
        i = low - 1
        while i < low + 3:
            change = v[i - 1] + v[i + 1] - v[i + 0] - v[i + 0]
            if change < 0:
                change = 0 - change
            if change > most:
                most = change
            i += 1
        gathered = step
        if step < 0:
            gathered = 0 - step
        bend = 9 * most - 6
        if bend < 0:
            bend = 0
        most = gathered + 3 * most
        gathered += 5 * (most - gathered) // 3
        worked = 0
        if play or rests & 1 and begin == 2 or rests & 2 and begin == count or gathered > 0x100000:
            worked = 1
        while True:
            if worked:
                i = 0
                before = here = 0
                while i < 2:
                    n = k - order + order * i - 2
                    w[0] = v[n + 0]
                    w[1] = v[n + 1]
                    w[2] = v[n + 2]
                    w[3] = v[n + 3]
                    w[4] = v[n + 4]
                    n = index + order * (begin - 2 + i)
                    before = here
                    here = order * int(slope(window, bounds, n, last - n))
                    i += 1
                # At rest the slope does not matter: the one that makes least of it is that at the
                # other end.
                if rests & 2 and begin == count:
                    here = before
                    if rests & 1 and begin == 2:
                        here = 0
                if rests & 1 and begin == 2:
                    before = here
                # Its velocity is a parabola with these control points: before, middle, here. Beyond
                # both ends it turns before the middle one.
                middle = 36 * step - before - here
                if middle < before:
                    step = 0 - step
                    before = 0 - before
                    middle = 0 - middle
                    here = 0 - here
                most = before
                if most < 0:
                    most = 0 - most
                if here > most:
                    most = here
                if 0 - here > most:
                    most = 0 - here
                if middle > here:
                    rise = middle - before
                    if middle - here < rise:
                        rise = middle - here
                    if middle - (rise >> 1) > most:
                        most = middle - (rise >> 1)
                bend = 72 * step - 4 * before - 2 * here
                if bend < 0:
                    bend = 0 - bend
                other = 72 * step - 2 * before - 4 * here
                if other < 0:
                    other = 0 - other
                if other > bend:
                    bend = other
                gathered = 2 * before - here
                if gathered < 0:
                    gathered = 0 - gathered
                other = 2 * here - before
                if other < 0:
                    other = 0 - other
                if other > gathered:
                    gathered = other
                most = most // 12
                bend = bend // 12 - 6  # so much comes of positions rounded to steps
                if bend < 0:
                    bend = 0
                gathered = gathered // 12
            own[FOUND] = most
            own[BENT] = bend
            own[GATHERED] = gathered
            if own[FINE] == 0:
                if gathered < 0x10000:
                    bend += (gathered * own[RAMP]) >> 15
                else:
                    bend += ((gathered >> 14) * own[RAMP]) >> 1
            elif bend > 0x100000 or gathered > 0x100000:
                bend = 0x3FFFFFFF  # no motor can
            elif gathered < 0x2000:
                bend = (bend << 8) + ((gathered * own[RAMP]) >> 10)
            else:
                bend = (bend << 8) + (((gathered >> 7) * own[RAMP]) >> 3)
            if most <= own[FASTEST] and bend <= own[STEEPEST]:
                break
            if worked:
                return begin
            worked = 1
    return 0


@micropython.viper
def first_direction(values: ptr32, count: int, order: int) -> int:
    """The direction of the first change in `count` positions: 1 up, -1 down, 0 for no change.

    order: as for check().
    """
    i = 1
    if order < 0:
        i = count - 2
    while count > 1:
        count -= 1
        last = values[i - order]
        if values[i + 0] > last:
            return 1
        if values[i + 0] < last:
            return -1
        i += order
    return 0


@micropython.viper
def turn(window: ptr32):
    """Look at the five frames of a window from the other side, for playing backward."""
    t = window[0]
    window[0] = window[4]
    window[4] = t
    t = window[1]
    window[1] = window[3]
    window[3] = t


@micropython.viper
def near(window: ptr32, there: int) -> int:
    """Whether the middle frame and another one are near enough for midway()."""
    half = (window[there + 0] >> 1) - (window[2] >> 1)
    if half > _FAR // 2 - 2 or half < 2 - _FAR // 2:
        return 0
    return 1


@micropython.viper
def midway(window: ptr32, there: int, slope_there: int, slope_here: int) -> int:
    """Where the path is half-way between the middle frame and a neighbour: steps from the former.

    there: 1 for the frame before, 3 for the one after; slopes in twelfths. A cubic with slopes a
    and b at its ends passes (a - b)/8 beside the middle of its chord.
    """
    chord = window[there + 0] - window[2]
    bow = slope_there - slope_here
    if there == 3:
        bow = 0 - bow
    return (48 * chord + bow + 48) // 96
