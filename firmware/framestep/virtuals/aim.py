"""Where the camera has to look for an aim point to be in the middle of its picture."""

from framestep.motion import reals
from framestep.native import const
from framestep.protocol import messages as m
from framestep.virtuals import geometry as g
from framestep.virtuals import trig

_X = const(g.T)
_Y = const(g.T + 2)
_Z = const(g.T + 4)
_LEVEL = const(g.T + 6)


def direction(r, pan, tilt):
    """r[pan], r[tilt] = degrees from the place of POSE to the point AIM; pan on the turn that is nearest to POSE's.

    0, or ERR_AIM_COD where the point is nearer than SAFE, measured level (a vertical cylinder, field note 9.7), or
    straight above or below.
    """
    reals.subtract(r, _X, g.POSE + 2, g.AIM)
    reals.subtract(r, _Y, g.AIM + 2, g.POSE + 4)
    reals.subtract(r, _Z, g.POSE, g.AIM + 4)
    reals.multiply(r, _LEVEL, _X, _X)
    reals.multiply(r, tilt, _Z, _Z)
    reals.add(r, _LEVEL, _LEVEL, tilt)
    reals.root(r, _LEVEL, _LEVEL)
    if reals.sign(r, _LEVEL) == 0 or reals.compare(r, _LEVEL, g.SAFE) < 0:
        return m.ERR_AIM_COD
    trig.angle(r, tilt, _Y, _LEVEL)
    trig.angle(r, _LEVEL, _X, _Z)
    # turns between it and the pan there is
    reals.put(r, _X, 360, 0)
    reals.subtract(r, _Y, g.POSE + 6, _LEVEL)
    reals.divide(r, _Y, _Y, _X)
    reals.put(r, _Z, 1, -1)
    reals.add(r, _Y, _Y, _Z)
    turns = reals.floor(r, _Y, 0xFFFF)
    reals.put(r, _X, 360 * turns, 0)
    reals.add(r, pan, _LEVEL, _X)
    return 0
