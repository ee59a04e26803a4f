"""An arm that swings about an upright column on a track: the common part of types 1 and 3.

Axes 1 SWING, 2 TRACK, 3 PAN. With the arm's horizontal reach (field note 9.4):
vEW = reach·sin(swing), along the track = track - reach·cos(swing), vPan = pan + swing.

Two swings bring the camera to the same position: in front of the column and behind it. inverse()
keeps to the side on which locate() has found the arm, as the number of half turns nearest to its
swing. So swing and pan go on without a jump beyond ±180 degrees as well. A path cannot change
sides: it would pass a swing of ±90 degrees, where the track no longer moves the camera sideways.
Within 2 degrees of that (from 88.2 on, where the cosine is a 32nd) the rig counts as out of reach,
because the last bit of a position would be whole steps of the track.
"""

from framestep.base.native import const
from framestep.motion import reals
from framestep.motion.compute import compute
from framestep.motion.formula import formula
from framestep.virtual_axes import registers
from framestep.virtual_axes.kinematics.kinematics import Kinematics
from framestep.virtual_axes.registers import NARROW, SIDE, SPARE, TURNS

TRACK_AXIS = const(2)

# From REACH, WRIST and vPan to SWING, TRACK and the pan.
SWING_IN = formula(
    registers,
    """
    cosine = sqrt((REACH - WRIST_EW) * (REACH + WRIST_EW))  # times the reach
    assert cosine > REACH * NARROW  # else out of reach
    SWING = angle(WRIST_EW, cosine) * SIDE + TURNS
    TRACK = WRIST_TRACK + cosine * SIDE
    JOINT_PAN = V_PAN - SWING
    """,
)

# From REACH, SWING, TRACK and the pan to WRIST and vPan.
SWING_OUT = formula(
    registers,
    """
    sine, cosine = sincos(SWING)
    WRIST_EW = REACH * sine
    WRIST_TRACK = TRACK - REACH * cosine
    V_PAN = JOINT_PAN + SWING
    ...
    """,
)

# The half turns nearest to the swing.
_HALF_TURNS = formula(registers, "-> turns", "turns = floor((SWING + 90) / 180)")


class Arm(Kinematics):
    main = b"\x00\x03\x02\x01\x04\x05\x06"

    def _choose_side(self):
        r = self.r
        reals.put(r, NARROW, 1, -5)
        compute(r, _HALF_TURNS)
        half_turns = reals.floor(r, _HALF_TURNS.turns, 0x7FFFFF)
        reals.put(r, SIDE, -1 if half_turns & 1 else 1, 0)
        reals.put(r, SPARE, 180, 0)
        reals.put(r, TURNS, half_turns, 0)
        reals.multiply(r, TURNS, TURNS, SPARE)
