"""Pan and tilt that put an aim point in the middle of the camera's picture."""

from framestep.base.results import ERR_AIM_COD
from framestep.motion.compute import compute
from framestep.motion.formula import formula
from framestep.virtual_axes import registers

_DIRECTION = formula(
    registers,
    """
    left = V_EW - AIM_X
    up = AIM_Y - V_NS
    ahead = V_TRACK - AIM_Z
    level = sqrt(left * left + ahead * ahead)
    assert level > ZERO  # straight above or below
    assert level >= SAFE  # a vertical cylinder (field note 9.7)
    DIRECTION_TILT = angle(up, level)
    DIRECTION_PAN = angle(left, ahead)
    turns = floor((NEAR_PAN - DIRECTION_PAN) / 360 + 0.5)
    DIRECTION_PAN = DIRECTION_PAN + turns * 360
    """,
)


def direction(r):
    """Set DIRECTION_PAN and DIRECTION_TILT: degrees from the position in POSE to the aim point.

    The pan is on the turn nearest to NEAR_PAN. Return 0, or ERR_AIM_COD if the point is nearer than
    the safe distance, or straight above or below.
    """
    return 0 if compute(r, _DIRECTION) else ERR_AIM_COD
