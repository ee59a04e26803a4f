"""Each type against the double-precision reference, over the whole reach of a rig."""

import math

import numpy as np
import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st

from framestep.protocol import messages
from framestep_tools.bench.virtual_precision import RIGS, errors
from framestep_tools.judge import virtual_reference as reference
from framestep_tools.judge.virtual_reference import Axis, Rig, Unreachable
from framestep_tools.move.kinematics import Firmware, Refused

HEAD = (Axis(4, 2000, 12.5, -900), Axis(5, 2000), Axis(6, 500))
ANGLE = st.floats(-400, 400)
MILLI = st.integers(-300_000, 300_000).map(lambda n: n / 1000)
NODAL = st.tuples(MILLI, MILLI, MILLI)


def near(got, wanted, atol):
    np.testing.assert_allclose(got[: len(wanted)], wanted, rtol=0, atol=atol)


# ---------------------------------------------------------------- X-Y-Z, swing-pan


@given(
    nodal=NODAL,
    place=st.tuples(*[st.floats(-20000, 20000)] * 3),
    angles=st.tuples(ANGLE, ANGLE, ANGLE),
    home=st.integers(-2_000_000_000, 2_000_000_000),
)
def test_x_y_z(nodal, place, angles, home):
    rig = Rig(
        reference.X_Y_Z, (Axis(1, 1000, home / 100000, 77), Axis(2), Axis(3), *HEAD), nodal=nodal
    )
    firmware = Firmware.of(rig)
    near(firmware.pose(), rig.forward(rig.joints([77, 0, 0, -900, 0, 0])), 1e-4)
    assert firmware.host_pose() == [0, home / 100000, 0, 12.5, 0, 0]
    joints = (*place, *angles)
    pose = firmware.forward(joints)
    near(pose, rig.forward(joints), 1e-4)
    near(firmware.inverse(pose), joints, 1e-4)


@given(st.integers(-(10**6), 10**6), st.integers(-(10**6), 10**6), ANGLE)
def test_swing_pan(swing, pan, wanted):
    rig = Rig(reference.SWING_PAN, (Axis(4, 1000), Axis(2, 500.5)))
    firmware = Firmware.of(rig)
    pose = firmware.locate({4: swing, 2: pan})
    joints = rig.joints([swing, pan])
    near(pose, rig.forward(joints), 1e-5)
    near(firmware.host_pose(), [0, 0, 0, swing / 1000 + pan / 500.5, 0, 0], 1e-5)
    near(
        firmware.inverse([0, 0, 0, wanted, 0, 0]),
        rig.inverse([0, 0, 0, wanted, 0, 0], joints),
        1e-5,
    )
    near(firmware.steps(), rig.steps(rig.inverse([0, 0, 0, wanted, 0, 0], joints)), 0.01)


# ---------------------------------------------------------------- arms


@st.composite
def arms(draw):
    """Draw an arm, with a table or without, and joints within its reach: up to ±88 degrees, several
    turns of the swing."""
    kind = draw(st.sampled_from([reference.BOOM_SWING_TRACK, reference.Y_SWING_TRACK]))
    length = draw(st.integers(200_000, 5_000_000)) / 1000
    extension = draw(st.integers(-100_000, 1_000_000)) / 1000
    table = None
    first = Axis(1, 1234.567, 3.25, 1000)
    if kind == reference.Y_SWING_TRACK:
        up = draw(st.floats(-2000, 2000))
    elif draw(st.booleans()):
        up = draw(st.floats(-60, 60))
        steps = draw(st.lists(st.integers(500, 3000), min_size=120, max_size=120))
        table = np.cumsum([draw(st.integers(-200_000, 0)), *steps])
        table = tuple(int(n) for n in table * draw(st.sampled_from([1, -1])))
        first = Axis(1, 1, 0.0, table[60])
    else:
        up = draw(st.floats(-88, 88))
    assume(kind == reference.Y_SWING_TRACK or length * math.cos(math.radians(up)) + extension > 1)
    axes = (first, Axis(2, 2000, round(draw(ANGLE), 5), 5), Axis(3, 1000, -55.5, 10**6), *HEAD)
    rig = Rig(kind, axes, length, extension, draw(NODAL), table)
    swing = draw(st.floats(-88, 88)) + 180 * draw(st.integers(-3, 3))
    joints = np.array(
        [up, swing, draw(st.floats(-20000, 20000)), draw(ANGLE), draw(ANGLE), draw(ANGLE)]
    )
    return rig, joints


_ROUNDING = 2.0**-29  # of a number's size: the error of a result of `reals` (motion/reals.py)
# degrees: the arc tangent (motion/compute.py), and what the steps of an angle round to
_ANGLE = 1e-6


def conditioning(rig, joints):
    """Return how far inverse() may be from the joints if each of its intermediate results has a
    rounding error, to first order.

    Near ±90 degrees of boom and swing a place says little about an angle: an error of the place
    is 1 / cos(boom) times as large in the reach, and a further 1 / cos(swing) times as large in
    swing and track.
    """
    boom, swing, track = joints[0], joints[1], abs(joints[2])
    reach, _ = rig._arm(boom)
    size = rig.length + abs(rig.extension) + sum(map(abs, rig.nodal))
    place = 3 * _ROUNDING * size  # the pose, the nodal offset (sines, products), their difference
    lift = 1 / math.cos(math.radians(boom)) if rig.kind == reference.BOOM_SWING_TRACK else 1
    first = math.degrees(place * lift / rig.length) + _ANGLE
    if rig.kind == reference.Y_SWING_TRACK:
        first = place + _ROUNDING * (abs(boom) + size)
    aside = (place + place * lift) / abs(math.cos(math.radians(swing)))
    turned = math.degrees(aside / reach) + _ANGLE + _ROUNDING * abs(swing)
    return np.array(
        [
            first,
            turned,
            aside + 3 * _ROUNDING * (track + size),
            turned + 3 * _ROUNDING * (abs(swing) + abs(joints[3])),
            _ROUNDING * 400,
            _ROUNDING * 400,
        ]
    )


def spread(rig, joints):
    """Return the same for forward(): the angles' rounding on the arm that they turn, and the
    rounding of sines and sums."""
    angles = np.radians(3 * _ROUNDING * np.abs(joints) + _ANGLE / 2)
    size = rig.length + abs(rig.extension)
    nodal = sum(map(abs, rig.nodal))
    place = (
        4 * _ROUNDING * (size + nodal + abs(joints[2]))
        + size * angles[1]
        + nodal * angles[[1, 3, 4, 5]].sum()
    )
    if rig.kind == reference.BOOM_SWING_TRACK:
        place += size * angles[0]
    else:
        place += 4 * _ROUNDING * abs(joints[0])
    return np.array(
        [place, place, place, *np.degrees([angles[1] + angles[3], angles[4], angles[5]])]
    )


@given(arms())
@example(
    # so near to 90 degrees the last bit of the place, 7.6e-6, is 2.2e-4 of the track
    (
        Rig(
            3,
            (Axis(1), Axis(2, 2000), Axis(3, 1000, -55.5, 10**6), *HEAD),
            4901.188,
            0,
            (0, 0, -0.001),
        ),
        np.array([0.0, 88.0, 0.0, 0.0, 0.0, 0.0]),
    )
)
def test_forward_and_back(case):
    """inverse() of forward() gives the joints back, and each agrees with double precision."""
    rig, joints = case
    firmware = Firmware.of(rig)
    steps = np.round(rig.steps(joints))
    joints = rig.joints(steps)
    pose = firmware.locate(
        {axis.motor: int(step) for axis, step in zip(rig.axes, steps, strict=True)}
    )
    assert (np.abs(pose - rig.forward(joints)) <= spread(rig, joints)).all(), pose - rig.forward(
        joints
    )
    back = firmware.inverse(rig.forward(joints))
    assert (np.abs(back - joints) <= conditioning(rig, joints)).all(), back - joints


@given(arms(), st.tuples(*[st.floats(-2, 2)] * 3))
@example((Rig(1, (Axis(1), Axis(2), Axis(3), *HEAD), 857.7, 78), np.zeros(6)), (0, 0, 1.1))
def test_what_is_out_of_reach(case, way):
    """The firmware finds no joints where the reference finds none, and finds them a degree away
    from that."""
    rig, joints = case
    firmware = Firmware.of(rig)
    firmware.locate(
        {axis.motor: int(step) for axis, step in zip(rig.axes, rig.steps(joints), strict=True)}
    )
    pose = rig.forward(joints)
    pose[:3] += np.array(way) * rig.length
    try:
        wanted = rig.inverse(pose, joints)
        rig.steps(wanted)
    except Unreachable:
        with pytest.raises(Refused, match=str(messages.ERR_RANGE)):
            firmware.inverse(pose)
            firmware.steps()
        return
    side = abs(math.cos(math.radians(wanted[1])))
    up = abs(math.cos(math.radians(wanted[0]))) if rig.kind == reference.BOOM_SWING_TRACK else 1
    if min(side, up) < 1 / 32.05:
        with pytest.raises(Refused, match=str(messages.ERR_RANGE)):
            firmware.inverse(pose)
    elif min(side, up) > 1 / 31.95:
        firmware.inverse(pose)


def test_along_a_path_no_joint_jumps():
    """Swing and pan of an arm behind its column, beyond a turn, follow a line from one side to the
    other."""
    rig = Rig(1, (Axis(1), Axis(2), Axis(3), *HEAD), 800, 200, (10, 20, 30))
    firmware = Firmware.of(rig)
    start = np.array([20.0, 545.0, 3000.0, -600.0, 10.0, 5.0])
    first = rig.steps(start).round()
    firmware.locate({axis.motor: int(step) for axis, step in zip(rig.axes, first, strict=True)})
    pose = rig.forward(rig.joints(first))
    last = rig.joints(first)
    for x in np.linspace(pose[1], -900, 300):
        pose[1] = x
        joints = np.array(firmware.inverse(pose))
        assert np.abs(joints - last).max() < 20
        near(joints, rig.inverse(pose, start), 1e-4)
        last = joints
    assert last[1] > 580


# ---------------------------------------------------------------- worked values


def test_worked_values():
    """Field note 9.9: length 857.7, extension 78, vNS +100 moves the track by -5.8494
    (-5.84949)."""
    rig = Rig(1, (Axis(1), Axis(2), Axis(3), *HEAD), 857.7, 78)
    firmware = Firmware.of(rig)
    pose = firmware.forward([0, 0, 0, 0, 0, 0])
    assert pose[0] == pytest.approx(-935.7, abs=1e-5)
    pose[2] += 100
    assert firmware.inverse(pose)[2] == pytest.approx(-5.84949, abs=1e-5)


def test_a_camera_over_the_column_is_of_no_use():
    """An extension that points back: raised to 80 degrees the camera is behind the arm's column."""
    rig = Rig(1, (Axis(1), Axis(2), Axis(3), *HEAD), 500, -100)
    firmware = Firmware.of(rig)
    firmware.forward([70, 10, 0, 0, 0, 0])
    with pytest.raises(Refused):
        firmware.forward([80, 10, 0, 0, 0, 0])
    with pytest.raises(Refused):
        firmware.forward([90, 10, 0, 0, 0, 0])
    with pytest.raises(Refused):
        firmware.inverse([0, 0, 499, 0, 0, 0])


# ---------------------------------------------------------------- boom table, axes without a motor


@pytest.mark.parametrize("sign", [1, -1])
def test_boom_table(sign):
    table = tuple(sign * (1000 * k + 3 * k * k) for k in range(-60, 61))
    rig = Rig(1, (Axis(1), Axis(2), Axis(3), *HEAD), 857.7, 78, table=table)
    firmware = Firmware.of(rig)
    for angle in (-60, -59.75, -0.5, 0, 30.25, 59.999, 60):
        firmware.inverse(rig.forward([angle, 0, 0, 0, 0, 0]))
        near(firmware.steps(), rig.steps([angle, 0, 0, 0, 0, 0]), 0.05)
    for step in (
        table[0], table[0] + 1, table[0] - 1, 0, 1, -1, 12345, table[1], table[119], table[120],
    ):  # fmt: skip
        if min(table) <= step <= max(table):
            firmware.locate({1: step})
            assert firmware.inverse(firmware.pose())[0] == pytest.approx(
                rig.joints([step, 0, 0, 0, 0, 0])[0], abs=1e-6
            )
        else:
            with pytest.raises(Refused):
                firmware.locate({1: step})
    firmware.locate({1: 0})
    firmware.inverse(rig.forward([60.01, 0, 0, 0, 0, 0]))
    with pytest.raises(Refused, match=str(messages.ERR_RANGE)):
        firmware.steps()


def test_with_a_table_the_boom_s_own_numbers_do_not_matter():
    table = tuple(range(-6000, 6100, 100))
    rig = Rig(1, (Axis(1, 2_000_000, -20_000), Axis(2), Axis(3), *HEAD), 857.7, 78, table=table)
    firmware = Firmware.of(rig)
    firmware.inverse(rig.forward([60, 0, 0, 0, 0, 0]))
    near(firmware.steps(), [6000], 0.01)


def test_an_axis_without_a_motor_stays():
    axes = (Axis(1), Axis(2), Axis(0, 0, 250.0), Axis(3), Axis(0, 0, -7.5), Axis(0, 0, 0.0))
    rig = Rig(1, axes, 500, 100)
    firmware = Firmware.of(rig)
    near(firmware.pose(), [-600, 0, 0, 0, 0, 0], 1e-4)
    near(firmware.host_pose(), [250, 0, 0, 0, -7.5, 0], 1e-6)
    firmware.inverse(rig.forward([10, 20, 0, 30, 0, 0]))
    near(firmware.steps(), [10000, 20000, 0, 30000, 0, 0], 0.01)
    for other in ([10, 20, 0.01, 30, 0, 0], [10, 20, 0, 30, 0.5, 0], [10, 20, 0, 30, 0, 1]):
        with pytest.raises(Refused, match=str(messages.ERR_RANGE)):
            firmware.inverse(rig.forward(other))


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize(
    "start, far",
    [
        (2**31 - 2**23 - 1000, 997), (2**30, 2**26 - 64), (0, 2**26 - 64), (-(2**30), 2**26 - 64),
    ],
)  # fmt: skip
def test_a_place_too_far_to_be_exact(sign, start, far):
    """Motors' steps are 32 bits, and their distance from their steps at VIRT_CONFIG is exact to a
    part of a step up to 2^26; a pose that needs a motor beyond it is out of reach.
    """
    rig = Rig(4, (Axis(1, 1, 0.0, sign * start), Axis(2), Axis(3), *HEAD))
    firmware = Firmware.of(rig)
    firmware.inverse([0, sign * far, 0, 0, 0, 0])
    near(firmware.steps(), [sign * (start + far)], 0.1)
    for beyond in (min(2**31 - start + 128, 2**26), 2**30, 2**32, 2.0**40, 2.0**70):
        firmware.inverse([0, sign * beyond, 0, 0, 0, 0])
        with pytest.raises(Refused, match=str(messages.ERR_RANGE)):
            firmware.steps()


def test_an_axis_that_counts_backward():
    rig = Rig(4, (Axis(1, -1000, 5.0, 77), Axis(2), Axis(3), *HEAD))
    firmware = Firmware.of(rig)
    near(firmware.locate({1: 1077}), [0, -1, 0, -0.45, 0, 0], 1e-5)
    near(firmware.host_pose(), [0, 4, 0, 12.5, 0, 0], 1e-5)
    firmware.inverse([0, -25, 0, 0, 0, 0])
    near(firmware.steps(), [77 + 25000], 0.01)


@pytest.mark.parametrize("name", RIGS)
@pytest.mark.parametrize("limit, most", [(80, 0.1), (88, 0.5)])
def test_near_double_precision(name, limit, most):
    """With a track of 20 m and 1000 steps per millimetre: a tenth of a step, and half a step at the
    end of an arm's reach."""
    worst = errors(RIGS[name], 300, limit, seed=5).max(axis=0)
    assert (worst < most).all(), worst
