"""Type 4, X-Y-Z: three straight axes at right angles that carry pan, tilt and roll.

Axes: X, Y, Z, PAN, TILT, ROLL. vEW = X, vNS = Y, vTrack = Z; angles are themselves; the nodal offset is added.
The layout of the message and this reading are inferred from type 1 (field note 9.3). Every pose can be reached.
"""

from framestep.motion import reals
from framestep.virtuals import geometry as g


class Geometry(g.Rig):
    main = b"\x00\x03\x01\x02\x04\x05\x06"

    def _numbers(self, length):
        return 3 if length == 85 or length == 89 else -1

    def _reach(self):
        for i in range(0, 6, 2):
            reals.copy(self.r, g.JOINT + i, g.PLACE + i)
        return True

    def _stand(self):
        for i in range(0, 6, 2):
            reals.copy(self.r, g.PLACE + i, g.JOINT + i)
        return True
