"""An arm that swings about an upright column on a track: what types 1 and 3 share.

Axes 1 SWING, 2 TRACK, 3 PAN. With the arm's level reach (field note 9.4): vEW = reach·sin(swing), along the track
= track − reach·cos(swing), vPan = pan + swing.

Two swings bring the camera to the same place: in front of the column and behind it. inverse() keeps to the side on
which locate() has found the arm, as the number of half turns nearest to its swing, so that swing and pan go on without
a jump beyond ±180 degrees as well. A path cannot change sides: that would be at a swing of ±90 degrees, where the track
no longer moves the camera to the side. The last degree before (89.1, where the cosine is a 64th) is out of reach.
"""

from framestep.motion import reals
from framestep.native import const
from framestep.virtuals import geometry as g
from framestep.virtuals import trig

SWING = const(g.JOINT + 2)
TRACK = const(g.JOINT + 4)
PAN = const(g.JOINT + 6)
REACH = const(g.T)
_S = const(g.T + 2)
_C = const(g.T + 4)

NARROW = const(-6)  # 2^-6: the least cosine of an angle that counts as within reach, 89.1 degrees


def leg(r, to, long, short):
    """r[to] = √(long² − short²); False where that is less than a 64th of `long`."""
    reals.subtract(r, to, long, short)
    reals.add(r, _S, long, short)
    if reals.sign(r, to) <= 0 or reals.sign(r, _S) <= 0:
        return False
    reals.multiply(r, to, to, _S)
    reals.root(r, to, to)
    reals.double(r, _S, long, NARROW)
    return reals.compare(r, to, _S) > 0


class Arm(g.Rig):
    main = b"\x00\x03\x02\x01\x04\x05\x06"

    def __init__(self, r):
        super().__init__(r)
        self.half_turns = 0

    def _choose(self):
        r = self.r
        reals.put(r, _S, 90, 0)
        reals.add(r, _C, SWING, _S)
        reals.put(r, _S, 180, 0)
        reals.divide(r, _C, _C, _S)
        self.half_turns = reals.floor(r, _C, 0x7FFF)

    def _swing(self):
        """SWING, TRACK and PAN for REACH and PLACE."""
        r = self.r
        if not leg(r, _C, REACH, g.PLACE):
            return False
        trig.angle(r, SWING, g.PLACE, _C)
        if self.half_turns:
            if self.half_turns & 1:
                reals.negate(r, SWING, SWING)
                reals.negate(r, _C, _C)
            reals.put(r, _S, 180 * self.half_turns, 0)
            reals.add(r, SWING, SWING, _S)
        reals.add(r, TRACK, g.PLACE + 4, _C)
        reals.subtract(r, PAN, g.POSE + 6, SWING)
        return True

    def _swung(self):
        """PLACE and vPan for REACH, SWING, TRACK and PAN."""
        r = self.r
        trig.sines(r, _S, _C, SWING)
        reals.multiply(r, g.PLACE, REACH, _S)
        reals.multiply(r, _C, REACH, _C)
        reals.subtract(r, g.PLACE + 4, TRACK, _C)
        reals.add(r, g.POSE + 6, PAN, SWING)
