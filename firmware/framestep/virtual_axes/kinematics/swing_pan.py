"""Type 2, Swing-Pan: the pan head on an arm that swings keeps its heading.

Axes: SWING, PAN; the other four have no motor. vPan = pan + swing (field note 9.4). No lengths are
known, so the other five virtual numbers are 0 and ignored. inverse() leaves the swing as it is in
JOINT, and turns the pan. The message has no pose: the host counts from both at 0. Every vPan can be
reached.
"""

from framestep.motion import reals
from framestep.virtual_axes.kinematics.kinematics import Kinematics
from framestep.virtual_axes.registers import BEFORE, FIRST_POSE, JOINT, PER_UNIT, V_PAN


class Geometry(Kinematics):
    main = b"\x00\x00\x00\x00\x02\x00\x00"

    def _begin(self, present):
        r = self.r
        for i in range(PER_UNIT):
            r[i] = 0
        self.start[0] = self.start[1] = 0
        self.locate(present)
        reals.copy(r, BEFORE, V_PAN)
        super()._begin(present)
        reals.subtract(r, FIRST_POSE + 6, V_PAN, BEFORE)

    def inverse(self):
        reals.subtract(self.r, JOINT + 2, V_PAN, JOINT)
        return 0

    def forward(self):
        reals.add(self.r, V_PAN, JOINT + 2, JOINT)
        return 0
