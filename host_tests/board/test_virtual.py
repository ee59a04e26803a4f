"""A virtual move on the emulated board: the camera's path from the pins' edges."""

import numpy as np
import pytest

from framestep.protocol import messages as m
from framestep_tools.judge.virtual_reference import aim, world
from framestep_tools.payloads import (
    HardStop,
    MotorMove,
    SetVirtAimPoint,
    VirtConfig,
    VirtJog,
    VirtMove,
    VirtStop,
)
from framestep_tools.simulator.boards import EmulatedBoard
from host_tests.end_to_end.session import Session
from host_tests.end_to_end.virtual_axes.judging import (
    BOOM_NODAL,
    UNIT,
    Track,
    assert_straight,
    joints,
    pose,
)

pytestmark = pytest.mark.repeats  # end_to_end/virtual_axes

VELOCITY, ACCELERATION = 20_000, 50_000


@pytest.fixture(scope="module")
def session():
    with EmulatedBoard() as board:
        session = Session(board, reply_s=0.2)
        for axis in BOOM_NODAL.axes:
            session.speed(axis.motor, VELOCITY, ACCELERATION)
        session.accept(VirtConfig.unpack(BOOM_NODAL.payload()))
        session.run(0.3)
        session.forget()
        yield session


def test_a_boom_swing_track_move(session):
    """Straight within a step at every millisecond, within the motors' limits, and no queue runs
    dry."""
    before = session.positions
    session.forget()
    asked = session.now
    session.accept(VirtMove(m.VIRT_MOTOR_EW, 250 * 100000))
    answered = session.now
    assert len(session.moving) == 6
    session.wait_idle()
    length = 250 - BOOM_NODAL.axes[1].position
    track, _ = assert_straight(BOOM_NODAL, session, before, UNIT[m.VIRT_MOTOR_EW], length)
    track.limits(VELOCITY, ACCELERATION)
    print(
        f"answered after {(answered - asked) * 1000:.0f} ms, "
        f"began {(track.begin - asked) * 1000:.0f} ms after that"
    )
    # half a step of SWING is 0.027 at this reach
    assert pose(session)[1] == pytest.approx(250, abs=0.03)


def test_a_jog_is_stopped_on_its_line(session):
    before = session.positions
    session.forget()
    start = pose(session)
    session.accept(VirtJog(m.VIRT_MOTOR_TRACK, 10_000, 2**31 - 1))
    session.run(0.45)
    session.accept(VirtStop(m.VIRT_MOTOR_TRACK))
    session.wait_idle()
    assert_straight(BOOM_NODAL, session, before, UNIT[m.VIRT_MOTOR_TRACK], 300)
    assert [n for n in before if len(session.steps(n)[0])] == [3], "the others stand"
    assert pose(session)[0] > start[0] + 10


def test_the_camera_stays_on_an_aim_point(session):
    place = world(pose(session))
    x, y, z = place + np.array([150.0, 30.0, -900.0])
    session.ask(SetVirtAimPoint(1, round(x * 1000), round(y * 1000), round(z * 1000)))
    before = session.positions
    session.forget()
    session.ask(MotorMove(3, before[3] - 6000))
    session.wait_idle()
    assert not session.events(HardStop)
    track = Track(session, before)
    angles = []
    for row in track.places:
        p = BOOM_NODAL.host_pose(BOOM_NODAL.forward(joints(BOOM_NODAL, row)))
        pan, tilt = aim(world(p), (x, y, z))
        angles.append((p[3] - pan, p[4] - tilt))
    assert np.ptp(np.array(angles), axis=0).max() < 0.02
