"""The direction to an aim point, and the camera's own axes, against the double-precision
reference."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from framestep.motion import reals
from framestep.protocol import messages
from framestep.virtual_axes.kinematics import aim
from framestep.virtual_axes.kinematics.kinematics import camera_axis
from framestep.virtual_axes.registers import (
    AIM_X,
    DIRECTION_PAN,
    DIRECTION_TILT,
    NEAR_PAN,
    SAFE,
    SCRATCH,
    V_EW,
    V_NS,
    V_PAN,
    V_TRACK,
)
from framestep_tools.judge import virtual_reference as reference
from framestep_tools.move.kinematics import Firmware, put

ANGLE = st.floats(-1000, 1000)
PLACE = st.tuples(*[st.floats(-20000, 20000)] * 3)


def aimed(place, point, pan=0.0, safe=0.0):
    """Return the code, pan and tilt from a place to a point, both X, Y, Z."""
    r = Firmware(4).r
    for at, value in (
        (V_EW, place[0]), (V_NS, place[1]), (V_TRACK, place[2]), (NEAR_PAN, pan), (SAFE, safe),
    ):  # fmt: skip
        put(r, at, value)
    for i in range(3):
        put(r, AIM_X + 2 * i, point[i])
    code = aim.direction(r)
    return code, reals.value(r, DIRECTION_PAN), reals.value(r, DIRECTION_TILT)


@pytest.mark.parametrize(
    "point, pan, tilt",
    [
        ((10, 0, 0), -90, 0),  # field note 9.9
        ((0, 10, -1), 0, 84.2894),
        ((0, 0, -5), 0, 0),
        ((-1, 0, -1), 45, 0),
        ((0, -1, -1), 0, -45),
        ((1e-6, 0, 1), -180, 0),
        ((-1e-6, 0, 1), 180, 0),
    ],
)
def test_worked_values(point, pan, tilt):
    code, got_pan, got_tilt = aimed((0, 0, 0), point, pan)
    assert code == 0
    assert (got_pan, got_tilt) == (pytest.approx(pan, abs=6e-5), pytest.approx(tilt, abs=5e-5))


@given(PLACE, PLACE, ANGLE)
def test_the_camera_looks_at_the_point(place, point, before):
    way = np.array(point) - place
    assume(np.hypot(way[0], way[2]) > 1)
    code, pan, tilt = aimed(place, point, before)
    assert code == 0
    assert abs(pan - before) <= 180.001
    off = np.cross(reference.looks(pan, tilt), way / np.linalg.norm(way))
    # 20 m and 30 bits: 4e-5 units; else 1e-6 degrees
    assert np.degrees(np.linalg.norm(off)) < 1e-6 + np.degrees(1e-4 / np.hypot(way[0], way[2]))
    wanted = reference.aim(place, point)
    assert abs((pan - wanted[0] + 180) % 360 - 180) < 0.01
    assert abs(tilt - wanted[1]) < 0.01


@pytest.mark.parametrize(
    "point, inside",
    [((60, 999, 79), True), ((60, 0, 80), False), ((-61, 5, -80), False), ((0, 5, 0), True)],
)
def test_safe_distance_is_a_cylinder(point, inside):
    code, _, _ = aimed((0, 0, 0), point, safe=100)
    assert code == (messages.ERR_AIM_COD if inside else 0)
    assert aimed((0, 0, 0), point)[0] == (messages.ERR_AIM_COD if point[::2] == (0, 0) else 0)


@given(st.tuples(ANGLE, ANGLE, ANGLE), st.sampled_from([0, 1, 2]))
def test_camera_axes(angles, axis):
    r = Firmware(4).r
    for i, angle in enumerate(angles):
        put(r, V_PAN + 2 * i, angle)
    camera_axis(r, axis, SCRATCH)
    got = [reals.value(r, SCRATCH + i) for i in (0, 2, 4)]
    x, y, z = reference.line_direction(axis, *angles)
    np.testing.assert_allclose(got, [z, x, y], rtol=0, atol=3e-8)


def test_the_camera_line_is_where_the_camera_looks():
    np.testing.assert_allclose(
        -reference.line_direction(2, 30, 20, 70), reference.looks(30, 20), atol=1e-12
    )
    np.testing.assert_allclose(reference.line_direction(2, 0, 0, 0), [0, 0, 1], atol=1e-12)
    # left: X looks forward
    np.testing.assert_allclose(reference.line_direction(0, 90, 0, 0), [0, 0, -1], atol=1e-12)
