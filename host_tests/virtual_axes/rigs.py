"""What the tests of kinematics share."""

import numpy as np

from framestep_tools.judge.virtual_reference import Axis

HEAD = (Axis(4, 2000, 12.5, -900), Axis(5, 2000), Axis(6, 500))


def near(got, wanted, atol):
    np.testing.assert_allclose(got[: len(wanted)], wanted, rtol=0, atol=atol)
