"""Backlash: the load lags behind the motor by the play of its gears, and the motor makes up for it.

Hosts ask for positions of the load; limits and reports count them, too. The motor's own position
is that of the load plus an offset: 0 if the load was moved up last, minus the play if it was moved
down. `planned` of an axis has the position of the load to which its phases lead, the offset there,
and the play.

Positions are words, int32, handed over as (array, index). Nothing allocates.
"""

from framestep.motion import stepper
from framestep.native import const, micropython, ptr32

# Words of `planned`
PLACE = const(0)
OFFSET = const(1)
PLAY = const(2)

PHYSICAL = const(3)  # word of an axis' `limits`: the motor's own position for a target


@micropython.viper
def motor_step(planned: ptr32, limits: ptr32, targets, i: int, part: int):
    """limits[PHYSICAL] = the motor's position for targets[i], coming from where it is planned to
    be.

    part: Q16 of a step beyond targets[i]. The nearest step decides in which direction it lies.
    """
    step = ptr32(targets)[i + 0]
    place = step + (part >> 15)
    if place > planned[PLACE]:
        planned[OFFSET] = 0
    elif place < planned[PLACE]:
        planned[OFFSET] = 0 - planned[PLAY]
    planned[PLACE] = place
    limits[PHYSICAL] = step + planned[OFFSET]


@micropython.viper
def same_side(planned: ptr32, limits: ptr32, places, i: int, part: int):
    """limits[PHYSICAL] = the motor's position for places[i] with the play as it is.

    part: Q16 of a step beyond places[i].
    """
    step = ptr32(places)[i + 0]
    planned[PLACE] = step + (part >> 15)
    limits[PHYSICAL] = step + planned[OFFSET]


@micropython.viper
def take_up(planned: ptr32, limits: ptr32, way: int):
    """limits[PHYSICAL] = the motor's position where it is planned to be, its play taken up for
    `way`."""
    if way > 0:
        planned[OFFSET] = 0
    elif way < 0:
        planned[OFFSET] = 0 - planned[PLAY]
    limits[PHYSICAL] = planned[PLACE] + planned[OFFSET]


@micropython.viper
def replan_from(planned: ptr32, cut: ptr32, places, i: int) -> int:
    """Plan on from where the motor is at cut[0] steps and cut[1] (Q16) of one.

    places[i] = the load's whole steps there, with the play as it is. Returns cut[1].
    """
    step = cut[0] - planned[OFFSET]
    part = cut[1]
    place = ptr32(places)
    place[i] = step
    planned[PLACE] = step + (part >> 15)
    return part


@micropython.viper
def drag(place: ptr32, block: ptr32, backlash: int):
    """Move the load with the motor: it lags by the play, in whichever direction it goes."""
    p = block[stepper.POSITION]
    if place[0] < p:
        place[0] = p
    elif place[0] - p > backlash:
        place[0] = p + backlash


@micropython.viper
def offset(place: ptr32, block: ptr32) -> int:
    """Steps from the load's position to the motor's."""
    return block[stepper.POSITION] - place[0]


@micropython.viper
def taken_up(place: ptr32, block: ptr32, backlash: int, way: int) -> int:
    """Whether the play is taken up for a motion in direction `way`; 0: always."""
    gap = block[stepper.POSITION] - place[0]
    if way > 0:
        return 1 if gap == 0 else 0
    if way < 0:
        return 1 if gap + backlash == 0 else 0
    return 1
