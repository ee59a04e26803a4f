"""Backlash: the load lags behind the motor by the play of its gears, and the motor makes up for it.

What is asked for, limited and reported is where the load is. The motor's own steps are ahead of it by an offset:
0 where the load was moved up last, minus the play where it was moved down. `planned` of an axis has the place of the
load that its phases lead to, the offset there, and the play.

Positions are words, int32, handed over as (array, index). Nothing allocates.
"""

from framestep.motion import stepper
from framestep.native import const, micropython, ptr32

# Words of `planned`
PLACE = const(0)
OFFSET = const(1)
PLAY = const(2)

PHYSICAL = const(3)  # word of an axis' `limits`: the motor's own step for a target, with the play


@micropython.viper
def motor_step(planned: ptr32, limits: ptr32, targets, i: int, part: int):
    """limits[PHYSICAL] = the motor's step for the place targets[i], coming from where it is planned to be.

    part: Q16 of a step that the place is beyond; whether it lies ahead or behind is decided by the nearest step.
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
    """limits[PHYSICAL] = the motor's step for the place places[i] with the play as it is, whichever way that is.

    part: Q16 of a step that the place is beyond.
    """
    step = ptr32(places)[i + 0]
    planned[PLACE] = step + (part >> 15)
    limits[PHYSICAL] = step + planned[OFFSET]


@micropython.viper
def take_up(planned: ptr32, limits: ptr32, way: int):
    if way > 0:
        planned[OFFSET] = 0
    elif way < 0:
        planned[OFFSET] = 0 - planned[PLAY]
    limits[PHYSICAL] = planned[PLACE] + planned[OFFSET]


@micropython.viper
def replan_from(planned: ptr32, cut: ptr32, places, i: int) -> int:
    """Plan from where the motor is on the step cut[0] and cut[1] (Q16) of one more: places[i] is that step of the load,
    with the play as it is. cut[1] again."""
    step = cut[0] - planned[OFFSET]
    part = cut[1]
    place = ptr32(places)
    place[i] = step
    planned[PLACE] = step + (part >> 15)
    return part


@micropython.viper
def drag(place: ptr32, block: ptr32, backlash: int):
    """Where the load is: it lags behind the motor by the play of the gears, whichever way it goes."""
    p = block[stepper.POSITION]
    if place[0] < p:
        place[0] = p
    elif place[0] - p > backlash:
        place[0] = p + backlash


@micropython.viper
def offset(place: ptr32, block: ptr32) -> int:
    """Steps from the load's place to the motor's."""
    return block[stepper.POSITION] - place[0]


@micropython.viper
def taken_up(place: ptr32, block: ptr32, backlash: int, way: int) -> int:
    """Whether the play is taken up for a motion up (way > 0) or down (< 0); 0: whatever it is."""
    gap = block[stepper.POSITION] - place[0]
    if way > 0:
        return 1 if gap == 0 else 0
    if way < 0:
        return 1 if gap + backlash == 0 else 0
    return 1
