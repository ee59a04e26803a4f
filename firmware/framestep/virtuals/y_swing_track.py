"""Type 3, Y-Swing-Track: a level arm on a column that goes up and down, on a track; pan, tilt and roll at its end.

Axes: Y, SWING, TRACK, PAN, TILT, ROLL. reach = length + extension, vNS = Y, the rest as arm.py says.
The layout of the message and this reading are inferred from type 1 (field note 9.3).
"""

from framestep import results
from framestep.motion import reals
from framestep.virtuals import arm
from framestep.virtuals import geometry as g
from framestep.virtuals.formulas import ADD, COPY, END


class Geometry(arm.Arm):
    straight = 1 | 1 << arm.TRACK_AXIS
    _inverse = (
        g.FROM_POSE
        + bytes(
            (COPY, g.JOINT, g.PLACE + 2, 0)  #
            + (ADD, arm.REACH, g.LENGTH, g.EXTENSION)
        )
        + arm.SWUNG
    )
    _forward = (
        g.ANGLES
        + bytes(
            (COPY, g.PLACE + 2, g.JOINT, 0)  #
            + (ADD, arm.REACH, g.LENGTH, g.EXTENSION)
        )
        + arm.SWING_OUT
        + bytes((END, 0, 0, 0))
    )

    def _check(self, reader, present):
        r = self.r
        self.number(reader, 73, g.T, 1000)
        self.number(reader, 77, g.T + 2, 1000)
        reals.add(r, g.T, g.T, g.T + 2)
        if reals.sign(r, g.T) <= 0:
            return results.ERR_RANGE
        return super()._check(reader, present)
