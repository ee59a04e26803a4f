"""Bounds of a motor: its soft limits, the range of positions, and the coupled motor's bounds.

Positions are words, int32. Nothing allocates.
"""

from array import array

from framestep.base.native import const
from framestep.motion import reals
from framestep.motion.reals import add_words, order_words
from framestep.motors.backlash import BACKLASH

# Words of a motor's `bounds`, in steps of the load
LOWER = const(0)
UPPER = const(1)
# not 0: the path must not overshoot its frames, since turning back would take up backlash
NO_OVERSHOOT = const(2)
SOFT_LOWER = const(3)  # soft limits, as set
SOFT_UPPER = const(4)
BOUNDS_WORDS = const(5)

ENDS = array("i", [-(1 << 31), (1 << 31) - 1])  # the range of positions


def update(axis):
    """Set an axis' `bounds`: the load's lowest and highest position, and whether it has backlash.

    They come from the enabled soft limits and the range of positions, which is narrower for a
    servo. At the lower end there must be room for the motor's backlash. Coupled motors also keep to
    the partner's bounds.
    """
    bounds = axis.bounds
    _own(axis)
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
