"""Type 3, Y-Swing-Track: a level arm on a column that goes up and down, on a track; pan, tilt,
roll.

Axes: Y, SWING, TRACK, PAN, TILT, ROLL. reach = length + extension, vNS = Y, the rest as in arm.py.
The layout of the message and this reading are inferred from type 1 (field note 9.3).
"""

from framestep.motion import reals
from framestep.motion.formula import formula
from framestep.virtual_axes import registers
from framestep.virtual_axes.kinematics.arm import SWING_IN, SWING_OUT, TRACK_AXIS, Arm
from framestep.virtual_axes.kinematics.kinematics import ANGLES, FROM_POSE
from framestep.virtual_axes.registers import REACH, SPARE


class Geometry(Arm):
    straight = 1 | 1 << TRACK_AXIS
    _inverse = (
        FROM_POSE
        + formula(
            registers,
            """
            JOINT[0] = WRIST_NS
            REACH = LENGTH + EXTENSION
            ...
            """,
        )
        + SWING_IN
    )
    _forward = (
        ANGLES
        + formula(
            registers,
            """
            REACH = LENGTH + EXTENSION
            ...
            """,
        )
        + SWING_OUT
        + formula(registers, "WRIST_NS = JOINT[0]")
    )

    def _possible(self, configuration):
        r = self.r
        self.load(REACH, configuration.lengths, 0)
        self.load(SPARE, configuration.lengths, 1)
        reals.add(r, REACH, REACH, SPARE)
        return reals.sign(r, REACH) > 0
