"""Each type against the double-precision reference."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from framestep.protocol import messages
from framestep_tools import virtual_reference as reference
from framestep_tools.virtual_reference import Axis, Rig
from host_tests.virtuals.boards import Board, Refused

ANGLE = st.floats(-400, 400)
NODAL = st.tuples(*[st.integers(-300_000, 300_000).map(lambda n: n / 1000)] * 3)


def near(got, wanted, atol):
    np.testing.assert_allclose(got[: len(wanted)], wanted, rtol=0, atol=atol)


@given(
    nodal=NODAL,
    place=st.tuples(*[st.floats(-20000, 20000)] * 3),
    angles=st.tuples(ANGLE, ANGLE, ANGLE),
    home=st.integers(-2_000_000_000, 2_000_000_000),
)
def test_x_y_z(nodal, place, angles, home):
    linear = Axis(1, 1000, home / 100000, 77)
    axes = (linear, Axis(2), Axis(3), Axis(4, 2000, 12.5, -900), Axis(5, 2000), Axis(6, 500))
    rig = Rig(reference.X_Y_Z, axes, nodal=nodal)
    board = Board.of(rig)
    near(board.pose(), rig.forward(rig.joints([77, 0, 0, -900, 0, 0])), 1e-4)
    joints = (*place, *angles)
    pose = board.forward(joints)
    near(pose, rig.forward(joints), 1e-4)
    near(board.inverse(pose), joints, 1e-4)


@given(st.integers(-(10**6), 10**6), st.integers(-(10**6), 10**6), ANGLE)
def test_swing_pan(swing, pan, wanted):
    rig = Rig(reference.SWING_PAN, (Axis(4, 1000), Axis(2, 500.5)))
    board = Board.of(rig)
    pose = board.locate({4: swing, 2: pan})
    joints = rig.joints([swing, pan])
    near(pose, rig.forward(joints), 1e-5)
    near(board.inverse([0, 0, 0, wanted, 0, 0]), rig.inverse([0, 0, 0, wanted, 0, 0], joints), 1e-5)
    near(board.steps(), rig.steps(rig.inverse([0, 0, 0, wanted, 0, 0], joints)), 0.01)


def test_refused_configurations_change_nothing():
    good = Rig(reference.X_Y_Z, tuple(Axis(i + 1, 1000 + i, 3.5) for i in range(6)), nodal=(1, 2, 3), safe=100)
    board = Board.of(good)
    before = board.r.tolist(), bytes(board.geometry.motor), board.geometry.start.tolist()
    payload = bytearray(good.payload())
    for at, byte, code in (
        (1, 9, messages.ERR_RANGE),  # no such motor
        (4, 0x80, messages.ERR_RANGE),
        (13, 1, messages.ERR_RANGE),  # the first motor again
        (5, 0, messages.ERR_RANGE),  # no steps per unit
    ):
        bad = bytearray(payload)
        if byte == 0:
            bad[at : at + 4] = bytes(4)
        else:
            bad[at] = byte
        with pytest.raises(Refused, match=str(code)):
            board.configure(bytes(bad))
        assert before == (board.r.tolist(), bytes(board.geometry.motor), board.geometry.start.tolist())
    for length in (1, 84, 86, 88, 90, 93):
        with pytest.raises(Refused, match=str(messages.ERR_UNSUPPORTED)):
            board.configure(bytes(payload + payload)[:length])
    assert before == (board.r.tolist(), bytes(board.geometry.motor), board.geometry.start.tolist())
