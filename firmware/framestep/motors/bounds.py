"""Bounds of a motor: its soft limits, the range of positions, and the coupled motor's bounds.

Positions are words, int32. Nothing allocates.
"""

from array import array

from framestep.base.native import const, micropython, ptr32
from framestep.motion import reals
from framestep.motion.reals import add_words, order_words
from framestep.motors.backlash import BACKLASH, LOAD
from framestep.pulse import stepper as sw

# Words of a motor's `bounds`, in steps of the load
LOWER = const(0)
UPPER = const(1)
# not 0: the path must not overshoot its frames, since turning back would take up backlash
NO_OVERSHOOT = const(2)
SOFT_LOWER = const(3)  # soft limits, as set
SOFT_UPPER = const(4)
IN_MOTION = const(5)  # not 0: set while the motor moved, so its path may be on the way beyond them
BOUNDS_WORDS = const(6)

ENDS = array("i", [-(1 << 31), (1 << 31) - 1])  # the range of positions

_SLOW = const(sw.ONE // 10)  # Q22 steps per tick, 100 steps/s


@micropython.viper
def stop_rate(m: ptr32, bounds: ptr32, rate: int, on_path: int) -> int:
    """Return the deceleration at which a motor stops within its bounds: `rate`, or more. Q22 steps
    per tick². m: the motor's block.

    `rate` is rounded down, so on its own it may take a motor that slows down to a soft limit beyond
    it. `rate` + 1 cannot, and more is never needed away from a path.

    on_path: the motor follows an uploaded path, which may end on a soft limit. Its frames are
    rounded to whole steps, so between them it may be faster than the original move by about a step
    per frame, and a stop at `rate` would overrun the limit. The path itself turns back before a
    limit, at least as steeply as needed here. If the limit was set in motion, the result is at most
    four times `rate`. Below 100 steps/s, where each step starts and stops the motor, a stop ends
    within the step; else it could go far past a path that makes a step now and then.
    """
    v = m[sw.VELOCITY] - ((m[sw.ACCEL] - m[sw.JERK]) >> 5)  # see stepper.halt()
    part = m[sw.FRACTION]
    if v < 0:
        v = 0 - v
        part = 0 - part
        room = m[sw.POSITION] - bounds[LOWER] + ptr32(m[sw.BACKLASH])[BACKLASH]  # wraps
    else:
        room = bounds[UPPER] - m[sw.POSITION]  # wraps
    if v <= _SLOW and on_path:
        room = 0
    if room < 0 or room >= 1 << 24:
        return rate
    # A stop takes v² / 2d - v / 2 steps and may end within the step behind the bound. So
    # d = v / n with n = (2 room + v) / v ticks, and a little more for rounding.
    shift = 0
    while room >= 1 << 12:
        room = room >> 2
        shift += 1
    room = room << 9  # Q8 of twice the room
    if shift == 0:
        room += 64 - (part >> 13)
    speed = v >> shift
    room += (speed >> shift) >> 14
    if room < 1:
        room = 1
    while room < 1 << 20 and speed < 1 << 28:
        room = room << 2
        speed = speed << 1
    part = speed >> 8
    if part < 1:
        return rate
    n = (room << 8) // part
    if n < 1 << 16:
        n = (n << 6) + (((room << 8) % part) << 6) // part  # Q8
        if n < 1 << 8:
            n = 1 << 8  # a stop in one tick
        elif n < 1 << 12:
            n = n & ~0xFF  # a stop in a few ticks and a part of one goes farther than that formula
    else:
        speed = speed >> 6
    while n >= 1 << 22:
        n = n >> 1
        speed = speed >> 1
    d = ((speed // n) << 8) + ((speed % n) << 8) // n
    d += (d >> 10) + 1
    most = v
    if on_path == 0:
        most = rate + 1
    elif v > _SLOW and bounds[IN_MOTION]:
        most = rate << 2
    if d > most:
        d = most
    return d if d > rate else rate


def update(axis):
    """Set an axis' `bounds`: the load's lowest and highest position, and whether it has backlash.

    They come from the enabled soft limits and the range of positions, which is narrower for a
    servo. At the lower end there must be room for the motor's backlash. Coupled motors also keep to
    the partner's bounds.
    """
    bounds = axis.bounds
    _own(axis)
    bounds[IN_MOTION] = axis.moving
    partner = axis.partner
    bounds[NO_OVERSHOOT] = axis.backlash[BACKLASH]
    if not partner:
        return
    bounds[NO_OVERSHOOT] |= partner.backlash[BACKLASH]
    # The partner's motor can go from its lower bound less its backlash to its upper bound.
    word = axis.word
    _own(partner, 1)  # its backlash is rounded, so it may end a step farther
    word[2] = partner.backlash[BACKLASH]
    add_words(word, 0, partner.bounds, LOWER, word, 2, 1)
    reals.copy_word(word, 1, partner.bounds, UPPER)
    low = 0
    if axis.reversed:
        add_words(word, 0, axis.base, 0, word, 0, 1)
        add_words(word, 1, axis.base, 0, word, 1, 1)
        low = 1
    else:
        add_words(word, 0, word, 0, axis.base, 0, 1)
        add_words(word, 1, word, 1, axis.base, 0, 1)
    word[2] = axis.backlash[BACKLASH]
    add_words(word, low, word, low, word, 2, 0)
    if order_words(word, low, bounds, LOWER) > 0:
        reals.copy_word(bounds, LOWER, word, low)
    if order_words(word, 1 - low, bounds, UPPER) < 0:
        reals.copy_word(bounds, UPPER, word, 1 - low)


def _own(axis, margin=0):
    """Set LOWER and UPPER of `bounds` to what the axis alone allows."""
    bounds = axis.bounds
    word = axis.word
    word[2] = axis.backlash[BACKLASH] + margin
    add_words(bounds, LOWER, axis.ends, 0, word, 2, 0)
    reals.copy_word(bounds, UPPER, axis.ends, 1)
    if axis.lower_enabled and order_words(bounds, SOFT_LOWER, bounds, LOWER) > 0:
        reals.copy_word(bounds, LOWER, bounds, SOFT_LOWER)
    if axis.upper_enabled and order_words(bounds, SOFT_UPPER, bounds, UPPER) < 0:
        reals.copy_word(bounds, UPPER, bounds, SOFT_UPPER)


def clamp(axis, target, i):
    """Bring target[i] within `bounds`. If the motor itself is outside, or there is no room,
    make it where the load is, and return True."""
    side = outside(axis, target, i)
    if not side:
        return False
    end = 1 if side > 0 else 0
    reals.copy_word(target, i, axis.bounds, end)
    if not outside(axis, target, i):
        _find_place(axis, side)
        if order_words(axis.word, 0, axis.bounds, end) != side and not (
            axis.at_rest and order_words(axis.backlash, LOAD, axis.bounds, end) == side
        ):
            return False
    reals.copy_word(target, i, axis.backlash, LOAD)
    return True


def outside(axis, target, i):
    """Return whether target[i] is out of bounds: 1 above, -1 below, 0 not.

    A motor that is outside already may move toward the allowed range (field note 4.3).
    """
    # Check both ends, since there may be no room between them.
    side = 1
    while side >= -1:
        end = 1 if side > 0 else 0
        if order_words(target, i, axis.bounds, end) == side:
            _find_place(axis, side)
            if (
                order_words(axis.word, 0, axis.bounds, end) != side
                or order_words(target, i, axis.word, 0) == side
            ):
                return side
        side -= 2
    return 0


def _find_place(axis, side):
    """Set word[0] to where the load is; of coupled motors to where it would be if it moved
    outward, to `side`.

    A motor that stops on its way back from outside may turn, and take up its backlash outward.
    That moves a coupled motor at once, perhaps past its own limits.
    """
    axis.backlash.refresh()
    reals.copy_word(axis.word, 0, axis.backlash, LOAD)
    if axis.partner:
        if side > 0:
            reals.copy_word(axis.word, 0, axis.block, sw.POSITION)
        else:
            add_words(axis.word, 0, axis.block, sw.POSITION, axis.backlash, BACKLASH, 0)


def beyond(axis, target, i):
    """Return the same as outside(), but regardless of where the motor is now."""
    if order_words(target, i, axis.bounds, 1) > 0:
        return 1
    if order_words(target, i, axis.bounds, 0) < 0:
        return -1
    return 0
