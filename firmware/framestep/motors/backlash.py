"""Backlash: steps that a motor makes after a change of direction before its load moves.

Hosts ask for positions of the load; limits and reports refer to them, too. The motor's position is
the load's plus an offset: 0 if the motor has last moved the load up, minus the backlash if down,
and anything between while it turns.

Positions are words, int32, passed as (array, index). Nothing allocates.
"""

from array import array

from framestep.base.native import addressof, as_word, const, micropython, ptr32
from framestep.motors.backlash_rules import dragged, turned
from framestep.pulse import stepper

# Words of a Backlash
BACKLASH = const(0)  # in steps
LOAD = const(1)  # position of the load, as far as refresh() has followed the motor
PLANNED_LOAD = const(2)  # position of the load at the end of the phases
OFFSET = const(3)  # offset at the end of the phases
MOTOR = const(4)  # position of the motor at the end of the phases
TARGET = const(5)  # position to which move_to() brings the load
BLOCK = const(6)  # address of the motor's words in the StepKernel
WORDS = const(7)


def make_backlash(block):
    """Make a Backlash of 0 steps. block: the motor's words in the StepKernel."""
    backlash = Backlash("i", [0] * WORDS)
    backlash[BLOCK] = as_word(addressof(block))
    block[stepper.BACKLASH] = as_word(addressof(backlash))
    return backlash


class Backlash(array):
    """A motor's backlash, with the positions of load and motor, now and at the end of the plan."""

    # ---------------------------------------------------------------- now

    @micropython.viper
    def refresh(w: ptr32):
        """Update LOAD. Call it before LOAD is read, and often enough to see each turn."""
        load = w[LOAD]
        backlash = w[BACKLASH]
        motor = ptr32(w[BLOCK])[stepper.POSITION]
        w[LOAD] = dragged(load, backlash, motor)

    @micropython.viper
    def offset(w: ptr32) -> int:
        """Return the steps from the load to the motor."""
        return ptr32(w[BLOCK])[stepper.POSITION] - w[LOAD]

    @micropython.viper
    def taken_up(w: ptr32, direction: int) -> int:
        """Return whether it is taken up for a motion in that direction; for direction 0 it is."""
        offset = ptr32(w[BLOCK])[stepper.POSITION] - w[LOAD]
        return 1 if offset == turned(offset, w[BACKLASH], 0, direction) else 0

    # ---------------------------------------------------------------- at the end of the plan

    @micropython.viper
    def offset_for(w: ptr32, direction: int) -> int:
        """Return the offset at the beginning of a motion in that direction; 0 for no motion."""
        return turned(0, w[BACKLASH], 0, direction)

    @micropython.viper
    def plan_from(w: ptr32, positions, i: int):
        """Continue the plan from the load position positions[i], with the present offset."""
        w[OFFSET] = ptr32(w[BLOCK])[stepper.POSITION] - w[LOAD]
        w[PLANNED_LOAD] = ptr32(positions)[i]

    @micropython.viper
    def plan_from_cut(w: ptr32, cut: ptr32, positions, i: int) -> int:
        """Continue the plan from where the motor's queue has been cut. cut: AT_STEP, AT_PART.

        Set positions[i] to the whole steps of the load there, with the planned offset. Return the
        fraction.
        """
        step = cut[stepper.AT_STEP] - w[OFFSET]
        part = cut[stepper.AT_PART]
        load = ptr32(positions)
        load[i] = step
        w[PLANNED_LOAD] = step + (part >> 15)
        return part

    @micropython.viper
    def turn_to(w: ptr32, targets, i: int, part: int):
        """Plan MOTOR for the load at targets[i]. If the load turns, take up the backlash as well.

        part: Q16 of a step beyond targets[i]. The nearest step decides whether the load turns.
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
        """Like turn_to(), but keep the offset: if the motion turns, the motor does not take up the
        backlash, so the load is not moved as far as planned."""
        step = ptr32(positions)[i + 0]
        w[PLANNED_LOAD] = step + (part >> 15)
        w[MOTOR] = step + w[OFFSET]

    @micropython.viper
    def take_up(w: ptr32, direction: int):
        """Plan MOTOR for a motion in that direction from where the load is. Direction 0 keeps the
        offset."""
        offset = turned(w[OFFSET], w[BACKLASH], 0, direction)
        w[OFFSET] = offset
        w[MOTOR] = w[PLANNED_LOAD] + offset
