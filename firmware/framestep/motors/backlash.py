"""Backlash: steps that a motor makes after a change of direction before its load moves.

Hosts ask for positions of the load; limits and reports count those, too. The motor's position is
the load's plus an offset: 0 if the motor has moved the load up last, minus the backlash if down.

Positions are words, int32, handed over as (array, index). Nothing allocates.
"""

from array import array

from framestep.base.native import addressof, as_word, const, micropython, ptr32
from framestep.motors.backlash_rules import dragged, turned
from framestep.pulse import stepper

# Words of a Backlash
BACKLASH = const(0)  # in steps
LOAD = const(1)  # where the load is, counting all that has been queued to the engine
PLANNED_LOAD = const(2)  # where the load is at the end of the phases,
OFFSET = const(3)  # the offset there,
MOTOR = const(4)  # and the motor
TARGET = const(5)  # where move_to() is to bring the load
BLOCK = const(6)  # address of the motor's words in the StepKernel
WORDS = const(7)


def make_backlash(block):
    """A Backlash of no steps. block: the motor's words in the StepKernel."""
    backlash = Backlash("i", [0] * WORDS)
    backlash[BLOCK] = as_word(addressof(block))
    block[stepper.BACKLASH] = as_word(addressof(backlash))
    return backlash


class Backlash(array):
    """A motor's backlash: where it is between motor and load now, and at the end of the plan."""

    # ---------------------------------------------------------------- now

    @micropython.viper
    def refresh(w: ptr32):
        """Bring LOAD up to date: before it is read, and often enough to see each turn."""
        load = w[LOAD]
        backlash = w[BACKLASH]
        motor = ptr32(w[BLOCK])[stepper.POSITION]
        w[LOAD] = dragged(load, backlash, motor)

    @micropython.viper
    def offset(w: ptr32) -> int:
        """Steps from the load to the motor."""
        return ptr32(w[BLOCK])[stepper.POSITION] - w[LOAD]

    @micropython.viper
    def taken_up(w: ptr32, direction: int) -> int:
        """Whether it is taken up for a motion in that direction; 0: always."""
        offset = ptr32(w[BLOCK])[stepper.POSITION] - w[LOAD]
        return 1 if offset == turned(offset, w[BACKLASH], 0, direction) else 0

    # ---------------------------------------------------------------- at the end of the plan

    @micropython.viper
    def offset_for(w: ptr32, direction: int) -> int:
        """The offset with which a motion in that direction begins; 0: any, as it does not move."""
        return turned(0, w[BACKLASH], 0, direction)

    @micropython.viper
    def heading(w: ptr32) -> int:
        """The direction for which it is taken up there; 0 without backlash."""
        if w[BACKLASH] == 0:
            return 0
        return -1 if w[OFFSET] else 1

    @micropython.viper
    def plan_from(w: ptr32, positions, i: int):
        """Plan on from the load's position positions[i], with the present offset."""
        w[OFFSET] = ptr32(w[BLOCK])[stepper.POSITION] - w[LOAD]
        w[PLANNED_LOAD] = ptr32(positions)[i]

    @micropython.viper
    def plan_from_cut(w: ptr32, cut: ptr32, positions, i: int) -> int:
        """Plan on from where the motor is at `cut` (stepper.AT_STEP, AT_PART).

        positions[i] = the load's whole steps there, with the planned offset. Returns its part.
        """
        step = cut[stepper.AT_STEP] - w[OFFSET]
        part = cut[stepper.AT_PART]
        load = ptr32(positions)
        load[i] = step
        w[PLANNED_LOAD] = step + (part >> 15)
        return part

    @micropython.viper
    def turn_to(w: ptr32, targets, i: int, part: int):
        """Plan MOTOR for the load at targets[i], and take it up on the way if the load turns.

        part: Q16 of a step beyond targets[i]. The nearest step decides in which direction it lies.
        """
        step = ptr32(targets)[i + 0]
        load = step + (part >> 15)
        before = w[PLANNED_LOAD]
        offset = turned(w[OFFSET], w[BACKLASH], before, load)
        w[PLANNED_LOAD] = load
        w[OFFSET] = offset
        w[MOTOR] = step + offset

    @micropython.viper
    def coast_to(w: ptr32, positions, i: int, part: int):
        """As turn_to(), but leave it as it is: if the motion turns, the load stays behind."""
        step = ptr32(positions)[i + 0]
        w[PLANNED_LOAD] = step + (part >> 15)
        w[MOTOR] = step + w[OFFSET]

    @micropython.viper
    def take_up(w: ptr32, direction: int):
        """Plan MOTOR for a motion in that direction from where the load is; 0: any."""
        offset = turned(w[OFFSET], w[BACKLASH], 0, direction)
        w[OFFSET] = offset
        w[MOTOR] = w[PLANNED_LOAD] + offset
