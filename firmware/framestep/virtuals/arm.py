"""An arm that swings about an upright column on a track: what types 1 and 3 share.

Axes 1 SWING, 2 TRACK, 3 PAN. With the arm's level reach (field note 9.4): vEW = reach·sin(swing), along the track
= track − reach·cos(swing), vPan = pan + swing.

Two swings bring the camera to the same place: in front of the column and behind it. inverse() keeps to the side on
which locate() has found the arm, as the number of half turns nearest to its swing, so that swing and pan go on without
a jump beyond ±180 degrees as well. A path cannot change sides: that would be at a swing of ±90 degrees, where the track
no longer moves the camera to the side. What is nearer than 2 degrees (88.2, where the cosine is a 32nd) is out of
reach: there the last bit of a place would be whole steps of the track.
"""

from framestep.motion import reals
from framestep.native import const
from framestep.virtuals import geometry as g
from framestep.virtuals.formulas import ABOVE, ADD, ANGLE, END, MULTIPLY, ROOT, SINES, SUBTRACT

TRACK_AXIS = const(2)
SWING = const(g.JOINT + 2)
TRACK = const(g.JOINT + 4)
HEAD = const(g.JOINT + g.PAN)
REACH = const(g.T)
_SINE = const(g.T + 2)
_COSINE = const(g.T + 4)

NARROW = const(g.OWN)  # 2^-5, the least cosine of an angle that counts as within reach
_SIDE = const(g.OWN + 2)  # 1, or -1 behind the column
_TURNS = const(g.OWN + 4)  # degrees: 180 times the half turns of the swing

# From REACH, PLACE and vPan to SWING, TRACK and PAN
SWUNG = bytes(
    # what is left of the reach along the track: √(reach² − EW²)
    (SUBTRACT, _COSINE, REACH, g.PLACE)
    + (ADD, _SINE, REACH, g.PLACE)
    + (MULTIPLY, _COSINE, _COSINE, _SINE)
    + (ROOT, _COSINE, _COSINE, 0)
    + (MULTIPLY, _SINE, REACH, NARROW)
    + (ABOVE, 0, _COSINE, _SINE)
    + (ANGLE, SWING, g.PLACE, _COSINE)
    + (MULTIPLY, SWING, SWING, _SIDE)
    + (ADD, SWING, SWING, _TURNS)
    + (MULTIPLY, _COSINE, _COSINE, _SIDE)
    + (ADD, TRACK, g.PLACE + 4, _COSINE)
    + (SUBTRACT, HEAD, g.POSE + g.PAN, SWING)
    + (END, 0, 0, 0)
)

# From REACH, SWING, TRACK and PAN to PLACE and vPan
SWING_OUT = bytes(
    (SINES, _SINE, SWING, _COSINE)
    + (MULTIPLY, g.PLACE, REACH, _SINE)
    + (MULTIPLY, _COSINE, REACH, _COSINE)
    + (SUBTRACT, g.PLACE + 4, TRACK, _COSINE)
    + (ADD, g.POSE + g.PAN, HEAD, SWING)
)


class Arm(g.Rig):
    least = 93
    main = b"\x00\x03\x02\x01\x04\x05\x06"

    def _choose(self):
        r = self.r
        reals.put(r, NARROW, 1, -5)
        reals.put(r, g.X, 90, 0)
        reals.add(r, g.Y, SWING, g.X)
        reals.put(r, g.X, 180, 0)
        reals.divide(r, g.Y, g.Y, g.X)
        half_turns = reals.floor(r, g.Y, 0x7FFFFF)
        reals.put(r, _SIDE, -1 if half_turns & 1 else 1, 0)
        reals.put(r, _TURNS, half_turns, 0)
        reals.multiply(r, _TURNS, _TURNS, g.X)
