"""How far a motor may go: its soft limits, the range of positions, and the coupled motor's bounds.

Positions are words, int32. Nothing allocates.
"""

from array import array

from framestep.base.native import const
from framestep.motion import reals
from framestep.motion.reals import add_words, order_words

# Words of an axis' `limits` and `bounds`, in steps of the load
LOWER = const(0)
UPPER = const(1)
# of `bounds` alone; not 0: the path may not turn beyond its frames, as where taking up the backlash
# would move the load
EXACT = const(2)
BOUNDS_WORDS = const(3)

ENDS = array("i", [-(1 << 31), (1 << 31) - 1])  # of the range of positions


def update(axis):
    """Set an axis' `bounds`: the lowest and the highest position of the load, and if there is play.

    They are the enabled soft limits and the ends of the range of positions, of a servo its own; at
    the lower end there must be room for the motor's play. For coupled motors the partner's bounds
    count as well.
    """
    bounds = axis.bounds
    _own(axis, bounds)
    partner = axis.partner
    bounds[EXACT] = axis.backlash
    if not partner:
        return
    bounds[EXACT] |= partner.backlash
    # The partner's motor goes from its lower bound less its play up to its upper bound.
    word = axis.word
    _own(partner, partner.bounds, 1)  # as its play is rounded, it may end a step farther
    word[2] = partner.backlash
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
    word[2] = axis.backlash
    add_words(word, low, word, low, word, 2, 0)
    if order_words(word, low, bounds, LOWER) > 0:
        reals.copy_word(bounds, LOWER, word, low)
    if order_words(word, 1 - low, bounds, UPPER) < 0:
        reals.copy_word(bounds, UPPER, word, 1 - low)


def _own(axis, bounds, margin=0):
    """Set LOWER and UPPER of `bounds` to what the axis on its own allows."""
    word = axis.word
    word[2] = axis.backlash + margin
    add_words(bounds, LOWER, axis.ends, 0, word, 2, 0)
    reals.copy_word(bounds, UPPER, axis.ends, 1)
    if axis.lower_enabled and order_words(axis.limits, LOWER, bounds, LOWER) > 0:
        reals.copy_word(bounds, LOWER, axis.limits, LOWER)
    if axis.upper_enabled and order_words(axis.limits, UPPER, bounds, UPPER) < 0:
        reals.copy_word(bounds, UPPER, axis.limits, UPPER)
