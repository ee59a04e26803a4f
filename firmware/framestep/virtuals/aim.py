"""Where the camera has to look for an aim point to be in the middle of its picture."""

from framestep import results
from framestep.motion import reals
from framestep.native import const
from framestep.virtuals import geometry as g
from framestep.virtuals.formulas import ABOVE, ADD, ANGLE, END, MULTIPLY, ROOT, SUBTRACT, compute

_X = const(g.T)
_Y = const(g.T + 2)
_Z = const(g.T + 4)
_LEVEL = const(g.T + 6)
_PAN = const(g.T + 8)
_TILT = const(g.T + 10)
_TURN = const(g.T + 12)

_DISTANCE = bytes(
    (SUBTRACT, _X, g.POSE + 2, g.AIM)  # to the left
    + (SUBTRACT, _Y, g.AIM + 2, g.POSE + 4)  # up
    + (SUBTRACT, _Z, g.POSE, g.AIM + 4)  # forward
    + (MULTIPLY, _LEVEL, _X, _X)
    + (MULTIPLY, _TILT, _Z, _Z)
    + (ADD, _LEVEL, _LEVEL, _TILT)
    + (ROOT, _LEVEL, _LEVEL, 0)
    + (ABOVE, 0, _LEVEL, g.ZERO)
    + (END, 0, 0, 0)
)

# and how far the pan of POSE is away
_DIRECTION = bytes(
    (ANGLE, _TILT, _Y, _LEVEL)  #
    + (ANGLE, _PAN, _X, _Z)
    + (SUBTRACT, _X, g.POSE + g.PAN, _PAN)
    + (END, 0, 0, 0)
)


def direction(r, pan, tilt):
    """r[pan], r[tilt] = degrees from the place of POSE to the point AIM; pan on the turn that is nearest to POSE's.

    0, or ERR_AIM_COD where the point is nearer than SAFE, measured level (a vertical cylinder, field note 9.7), or
    straight above or below.
    """
    if not compute(0, 0, r, _DISTANCE) or reals.compare(r, _LEVEL, g.SAFE) < 0:
        return results.ERR_AIM_COD
    compute(0, 0, r, _DIRECTION)
    reals.copy(r, tilt, _TILT)
    reals.put(r, _TURN, 360, 0)
    reals.divide(r, _X, _X, _TURN)
    reals.put(r, _Y, 1, -1)
    reals.add(r, _X, _X, _Y)
    reals.put(r, _X, reals.floor(r, _X, 0x7FFFFF), 0)
    reals.multiply(r, _X, _X, _TURN)
    reals.add(r, pan, _PAN, _X)
    return 0
