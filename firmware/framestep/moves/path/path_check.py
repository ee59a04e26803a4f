"""What the path through uploaded frames (path.py) needs of a motor: velocity and acceleration.

check() judges frames one by one, from position to position. bends() judges the cubics between them,
for a motion that may be slowed down. A first frame, an index, `order` and backlash are as in
move_check.py, which calls both with the motor's limits.
"""

from framestep.base.native import const, micropython, ptr32
from framestep.motors.backlash_rules import turned
from framestep.moves.path.path import slope

# Words of a check: the frame before, the number of frames so far, and the motor's limits
BEFORE = const(0)  # the load's position there, and the motor's steps to it
SEEN = const(2)
FASTEST = const(3)  # steps from frame to frame; once a frame is too fast, the most so far
STEEPEST = const(4)  # change of these steps
LOWEST = const(5)  # lowest position of the load
HIGHEST = const(6)
BACKLASH = const(7)  # steps of backlash
# index of the fastest frame so far that is too fast, counted from 0; 0: none
FASTEST_AT = const(8)
OFFSET = const(9)  # from the load's position to the motor's
RAMP = const(10)  # see bends()
# not 0: in the step to the last frame the motor has taken up its backlash
TAKEN = const(11)
# greatest change that the kernel's numbers can hold; STEEPEST if more than that is refused
HARDEST = const(12)
PULSED = const(13)  # steps from frame to frame that the board can pulse
# the greatest change above STEEPEST so far, and its frame, counted from 0
SHARPEST = const(14)
SHARPEST_AT = const(15)
FOUND = const(16)  # what was refused: steps, or a change of steps
# found by bends(), steps per frame and frame
BENT = const(17)  # the bend of the path
GATHERED = const(18)  # the additional change while the rate changes
FINE = const(19)
CHECK_WORDS = const(20)
_SHARP = const(0x2000000)  # any change of steps beyond this counts as this: no motor can follow it

FITS = const(0)
TOO_FAST = const(1)
TOO_HIGH = const(2)
TOO_LOW = const(3)
TOO_STEEP = const(4)
TOO_HARD = const(5)  # for the board


@micropython.viper
def check(words: ptr32, values: ptr32, count: int, order: int) -> int:
    """Check `count` more frames: FITS, TOO_FAST, TOO_HIGH, TOO_LOW, TOO_STEEP or TOO_HARD.

    A frame that is too fast is noted in FASTEST_AT, with its need in FASTEST. From then on only a
    faster one matters, and the check goes on to find it. TOO_FAST: nothing can be faster. For
    TOO_HIGH and the following results, SEEN is the frame and FOUND what was too much there.

    order: 1 if they are played from the first to the last, -1 the other way round. At the first
    frame OFFSET is 0, or -BACKLASH if the backlash has been taken up for a motion down. Where the
    motion turns, the motor takes it up.

    The frame in which it does so begins or ends with next to no velocity. So its cubic is faster
    than its mean: by up to half of the mean, and by an eighth of a neighbour's mean if that goes
    the other way. The sum has to be within FASTEST.
    """
    seen = words[SEEN]
    last = words[BEFORE]
    step = 0
    if seen:
        step = words[BEFORE + 1]
    fastest = words[FASTEST]
    steepest = words[STEEPEST]
    backlash = words[BACKLASH]
    offset = words[OFFSET]
    taken = words[TAKEN]
    too_fast = words[FASTEST_AT]
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
        if too_fast == 0:
            if p > words[HIGHEST]:
                return TOO_HIGH
            if p < words[LOWEST]:
                return TOO_LOW
        if seen:
            earlier = step
            # Halve both first, since the difference of two words may need 33 bits.
            step = (p >> 1) - (last >> 1)
            if step > 0xFFFFFFF or step < -0xFFFFFFF:
                words[FASTEST] = 0x1FFFFFFF
                words[FASTEST_AT] = seen
                return TOO_FAST
            step = p - last
            before = taken
            if backlash:
                # the motor's own steps
                taken = 0 - offset
                offset = turned(offset, backlash, last, p)
                taken += offset
                step += taken
            most = step
            if most < 0:
                most = 0 - most
            beside = earlier
            if beside < 0:
                beside = 0 - beside
            needed = most
            if taken:
                needed = most + (most >> 1) + (beside >> 3)
            if before:
                other = beside + (beside >> 1) + (most >> 3)
                if other > needed:
                    needed = other
            if needed > fastest:
                fastest = needed
                too_fast = seen
            if seen > 1 and too_fast == 0:
                change = step - earlier
                if change < 0:
                    change = 0 - change
                if change > steepest:
                    words[SEEN] = seen - 1
                    if change > words[HARDEST]:
                        words[FOUND] = change
                        return TOO_STEEP if words[HARDEST] == steepest else TOO_HARD
                    if change > words[SHARPEST]:
                        words[SHARPEST] = change
                        words[SHARPEST_AT] = seen - 1
                    # Peak velocity of the cubics on either side: their mean, plus at most as much
                    # again or the change.
                    if beside > most:
                        most = beside
                    if change > most:
                        change = most
                    if most + change > words[PULSED]:
                        words[FOUND] = most + change
                        return TOO_HARD
        last = p
        seen += 1
    words[BEFORE] = last
    words[BEFORE + 1] = step
    words[SEEN] = seen
    words[OFFSET] = offset
    words[TAKEN] = taken
    words[FASTEST] = fastest
    words[FASTEST_AT] = too_fast
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
    """Judge how fast and how steep the cubics between frames are. Return 0 if the motor can follow
    all of them, else the number of those judged: the last is too fast or too steep, see FOUND,
    BENT, GATHERED. Call it again with that number as `begin`.

    values: `count` frames, in the upload's order, and two more on either side. index: of the first
    one played, in an upload that ends with `last`. order, OFFSET: as for check(), which must have
    accepted the frames, with 2^23 as FASTEST. rests: 1 if the motor is at rest at the first of
    these frames, 2 if at the last, 3 for both. RAMP: relative change of the rate in a frame's time,
    Q15, at most a half. FINE, from three frames per second on: RAMP is Q18, and STEEPEST is in
    256ths of a step.
    """
    own = ptr32(words)
    v = ptr32(values)
    w = ptr32(window)
    backlash = own[BACKLASH]
    if begin == 0:
        begin = 1
    while begin < count:
        k = begin + 2
        if order < 0:
            k = count + 1 - begin
        begin += 1
        p = v[k + 0]
        earlier = v[k - order]
        step = p - earlier
        if backlash:
            # the motor's own steps
            step -= own[OFFSET]
            own[OFFSET] = turned(own[OFFSET], backlash, earlier, p)
            step += own[OFFSET]
        # A slope differs from the steps next to it by at most one and a half times the greatest
        # change of steps around it.
        low = k
        if order > 0:
            low = k - 1
        most = 0
        i = low - 1
        while i < low + 3:
            # a quarter of it, which fits a word: frames beyond those played may lie anywhere
            change = (v[i - 1] >> 2) + (v[i + 1] >> 2) - (v[i + 0] >> 1)
            if ((change >> 23) + 1) >> 1:
                change = _SHARP
            else:
                change = v[i - 1] + v[i + 1] - v[i + 0] - v[i + 0]  # wraps
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
        if (
            backlash
            or rests & 1
            and begin == 2
            or rests & 2
            and begin == count
            or gathered > 0x100000
        ):
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
                # At rest the slope has no effect. The slope of the other end needs least.
                if rests & 2 and begin == count:
                    here = before
                    if rests & 1 and begin == 2:
                        here = 0
                if rests & 1 and begin == 2:
                    before = here
                # Its velocity is a parabola with these control points: before, middle, here. If
                # the middle one lies beyond both ends, the parabola does not quite reach it.
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
                bend = bend // 12 - 6  # the rounding of positions to steps causes up to 6
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
                bend = 0x3FFFFFFF  # more than any motor can do
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
def bend(values: ptr32, inner: int) -> int:
    """Return by how many steps the change from frame to frame changes at the second of three
    frames, or the steps between it and frame `inner` (0 or 2) if they are fewer."""
    change = (values[0] >> 2) + (values[2] >> 2) - (values[1] >> 1)
    if ((change >> 23) + 1) >> 1:
        change = _SHARP
    else:
        change = values[0] + values[2] - values[1] - values[1]  # wraps
        if change < 0:
            change = 0 - change
    steps = values[inner] - values[1]
    if steps < 0:
        steps = 0 - steps
    return steps if steps < change else change


@micropython.viper
def first_direction(values: ptr32, count: int, order: int) -> int:
    """Return the direction of the first change in `count` positions: 1 up, -1 down, 0 for none.

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
