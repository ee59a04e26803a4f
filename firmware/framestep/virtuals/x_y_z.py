"""Type 4, X-Y-Z: three straight axes at right angles that carry pan, tilt and roll.

Axes: X, Y, Z, PAN, TILT, ROLL. vEW = X, vNS = Y, vTrack = Z; angles are themselves; the nodal offset is added.
The layout of the message and this reading are inferred from type 1 (field note 9.3). Every pose can be reached.
"""

from framestep.virtuals import geometry as g
from framestep.virtuals.formulas import COPY, END


class Geometry(g.Rig):
    least = 85
    straight = 7
    main = b"\x00\x03\x01\x02\x04\x05\x06"
    _inverse = g.FROM_POSE + bytes(
        (COPY, g.JOINT, g.PLACE, 0)
        + (COPY, g.JOINT + 2, g.PLACE + 2, 0)
        + (COPY, g.JOINT + 4, g.PLACE + 4, 0)
        + (END, 0, 0, 0)
    )
    _forward = g.ANGLES + bytes(
        (COPY, g.PLACE, g.JOINT, 0)
        + (COPY, g.PLACE + 2, g.JOINT + 2, 0)
        + (COPY, g.PLACE + 4, g.JOINT + 4, 0)
        + (END, 0, 0, 0)
    )
