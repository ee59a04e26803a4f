"""Type 2, Swing-Pan: the pan head on an arm that swings keeps its heading.

Axes: SWING, PAN; the other four have no motor. vPan = pan + swing (field note 9.4); no lengths are known, so the five
other virtual numbers are 0 and ignored. inverse() leaves the swing where JOINT says it is and turns the pan.
The message tells no pose: step 0 of either motor counts as 0 degrees. Every vPan can be reached.
"""

from framestep import results
from framestep.motion import reals
from framestep.native import const
from framestep.virtuals import geometry as g

_VPAN = const(g.POSE + 6)
_SWING = const(g.JOINT)
_PAN = const(g.JOINT + 2)


class Geometry(g.Rig):
    joints = 2
    main = b"\x00\x00\x00\x00\x02\x00\x00"

    def configure(self, reader, present):
        if reader.length < 17:
            return results.ERR_RANGE
        motors = len(present)
        swing = reader.i32(1)
        pan = reader.i32(9)
        if swing < 1 or swing > motors or pan < 1 or pan > motors or swing == pan:
            return results.ERR_RANGE
        if reader.i32(5) == 0 or reader.i32(13) == 0:
            return results.ERR_RANGE
        r = self.r
        for i in range(g.AIM):
            r[i] = 0
        for i in range(g.AXES):
            self.motor[i] = 0
            self.told[i] = 0
        self.motor[0] = swing
        self.motor[1] = pan
        self.number(reader, 5, g.PER_UNIT, 1000)
        self.number(reader, 13, g.PER_UNIT + 2, 1000)
        # the host counts from both at 0
        self.start[0] = self.start[1] = 0
        self.locate(present)
        reals.copy(r, g.OWN, _VPAN)
        self._begin(present)
        reals.subtract(r, g.BEGUN + g.PAN, _VPAN, g.OWN)
        return 0

    def inverse(self):
        reals.subtract(self.r, _PAN, _VPAN, _SWING)
        return 0

    def forward(self):
        reals.add(self.r, _VPAN, _PAN, _SWING)
        return 0
