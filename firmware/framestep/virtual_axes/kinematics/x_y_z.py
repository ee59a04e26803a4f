"""Type 4, X-Y-Z: three linear axes at right angles that carry pan, tilt and roll.

Axes: X, Y, Z, PAN, TILT, ROLL. vEW = X, vNS = Y, vTrack = Z, plus the nodal offset; angles are
themselves. The layout of the message and this reading are inferred from type 1 (field note 9.3).
Every pose can be reached.
"""

from framestep.motion.formula import formula
from framestep.virtual_axes import registers
from framestep.virtual_axes.kinematics.kinematics import ANGLES, FROM_POSE, Kinematics


class Geometry(Kinematics):
    straight = 7
    main = b"\x00\x03\x01\x02\x04\x05\x06"
    _inverse = FROM_POSE + formula(
        registers,
        """
        JOINT[0] = WRIST_EW
        JOINT[1] = WRIST_NS
        JOINT[2] = WRIST_TRACK
        """,
    )
    _forward = ANGLES + formula(
        registers,
        """
        WRIST_EW = JOINT[0]
        WRIST_NS = JOINT[1]
        WRIST_TRACK = JOINT[2]
        """,
    )
