"""Drivers of motors at rest are switched off (setting `off_after_s`).

Loaded only if the rig file has it for a motor. Nothing allocates after construction.
"""

from array import array

from framestep.base.clock import elapsed
from framestep.pulse.stepper import TICKS


class Resting:
    """Since when motors rest, and which of them have done so for long enough.

    seconds: for each motor; 0: never. alone: each driver has an enable pin of its own; otherwise
    all go off together.
    """

    def __init__(self, axes, seconds, alone):
        self.axes = axes
        self.alone = alone
        self.after = array("i", [1000 * each for each in seconds])  # ticks
        self.since = array("i", [0] * len(seconds))  # ticks

    def begin(self, bits):
        """Count the rest of these motors from now on."""
        ticks = self.axes.kernel.state[TICKS]
        for motor in range(len(self.since)):
            if (bits >> motor) & 1:
                self.since[motor] = ticks

    def due(self, powered, used, virtuals):
        """Return the motors whose drivers are due to be switched off, one bit each.

        powered: those whose drivers are on. used: those that move or are about to. A coupled motor
        and one of the rig of `virtuals` stay on as well.
        """
        axes = self.axes
        ticks = axes.kernel.state[TICKS]
        bits = 0
        for motor in range(len(self.since)):
            axis = axes[motor]
            bit = 1 << motor
            if used & bit or axis.partner or axis.leader or virtuals.holds(motor):
                self.since[motor] = ticks
            elif self.after[motor] and powered & bit:
                if elapsed(ticks, self.since[motor]) >= self.after[motor]:
                    bits |= bit
        return bits if self.alone or bits == powered else 0
