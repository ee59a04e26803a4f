"""Backlash: the load lags behind the motor by the play of its gears, and the motor makes up for it.

Hosts ask for positions of the load; limits and reports count them, too. The motor's own position
is that of the load plus an offset: 0 if the load was moved up last, minus the play if it was moved
down. `planned` of an axis has the position of the load to which its phases lead, the offset there,
and the play.

Positions are words, int32, handed over as (array, index). Nothing allocates.
"""

from framestep.base.native import const, micropython, ptr32
from framestep.pulse import stepper

# Words of `planned`
LOAD_POSITION = const(0)
OFFSET = const(1)
BACKLASH = const(2)

PHYSICAL = const(3)  # word of an axis' `limits`: the motor's own position for a target


@micropython.viper
def motor_step(planned: ptr32, limits: ptr32, targets, i: int, part: int):
    """limits[PHYSICAL] = the motor's position for targets[i], coming from where it is planned to
    be.

    part: Q16 of a step beyond targets[i]. The nearest step decides in which direction it lies.
    """
    step = ptr32(targets)[i + 0]
    load_position = step + (part >> 15)
    if load_position > planned[LOAD_POSITION]:
        planned[OFFSET] = 0
    elif load_position < planned[LOAD_POSITION]:
        planned[OFFSET] = 0 - planned[BACKLASH]
    planned[LOAD_POSITION] = load_position
    limits[PHYSICAL] = step + planned[OFFSET]


@micropython.viper
def same_side(planned: ptr32, limits: ptr32, positions, i: int, part: int):
    """limits[PHYSICAL] = the motor's position for positions[i] with the play as it is.

    part: Q16 of a step beyond positions[i].
    """
    step = ptr32(positions)[i + 0]
    planned[LOAD_POSITION] = step + (part >> 15)
    limits[PHYSICAL] = step + planned[OFFSET]


@micropython.viper
def take_up(planned: ptr32, limits: ptr32, direction: int):
    """limits[PHYSICAL] = the motor's position where it is planned to be, its play taken up for
    that direction."""
    if direction > 0:
        planned[OFFSET] = 0
    elif direction < 0:
        planned[OFFSET] = 0 - planned[BACKLASH]
    limits[PHYSICAL] = planned[LOAD_POSITION] + planned[OFFSET]


@micropython.viper
def replan_from(planned: ptr32, cut: ptr32, positions, i: int) -> int:
    """Plan on from where the motor is at `cut` (stepper.AT_STEP, AT_PART).

    positions[i] = the load's whole steps there, with the play as it is. Returns its part.
    """
    step = cut[stepper.AT_STEP] - planned[OFFSET]
    part = cut[stepper.AT_PART]
    load_position = ptr32(positions)
    load_position[i] = step
    planned[LOAD_POSITION] = step + (part >> 15)
    return part


@micropython.viper
def drag(load_position: ptr32, block: ptr32, backlash: int):
    """Move the load with the motor: it lags by the play, in whichever direction it goes."""
    p = block[stepper.POSITION]
    if load_position[0] < p:
        load_position[0] = p
    elif load_position[0] - p > backlash:
        load_position[0] = p + backlash


@micropython.viper
def offset(load_position: ptr32, block: ptr32) -> int:
    """Steps from the load's position to the motor's."""
    return block[stepper.POSITION] - load_position[0]


@micropython.viper
def taken_up(load_position: ptr32, block: ptr32, backlash: int, direction: int) -> int:
    """Whether the play is taken up for a motion in that direction; 0: always."""
    gap = block[stepper.POSITION] - load_position[0]
    if direction > 0:
        return 1 if gap == 0 else 0
    if direction < 0:
        return 1 if gap + backlash == 0 else 0
    return 1
