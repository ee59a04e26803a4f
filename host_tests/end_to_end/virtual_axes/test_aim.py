"""VIRT_AIM_POINT end to end on the host simulation."""

import numpy as np
import pytest

from framestep.protocol import messages as m
from framestep_tools import payloads as p
from framestep_tools.judge.virtual_reference import Axis, Rig, aim, world
from host_tests.end_to_end.session import simulated
from host_tests.end_to_end.virtual_axes.judging import (
    BOOM,
    BOOM_NODAL,
    SWING_PAN,
    XYZ,
    Track,
    configured,
    joints,
    pose,
)

FINE = (250.0, 300.0, 80.0, 1000.0, 1000.0, 250.0)
AXES = tuple(Axis(a.motor, n, a.position) for n, a in zip(FINE, BOOM.axes, strict=True))
BOOM_FINE = Rig(1, AXES, 857.7, 78.0)
NODAL_FINE = Rig(1, AXES, 857.7, 78.0, nodal=(20.0, 35.5, -12.0), safe=150.0)
POINT = (400.0, 120.0, 1900.0)


def enabled(rig, point=POINT, **more):
    """Return a session whose rig looks at the point, and follows it."""
    session = configured(rig, **more)
    pan, tilt = aim(world(pose(session)), point)
    session.accept(p.VirtMove(m.VIRT_MOTOR_PAN, round(pan * 100000))).wait_idle()
    session.accept(p.VirtMove(m.VIRT_MOTOR_TILT, round(tilt * 100000))).wait_idle()
    asked = p.SetVirtAimPoint(1, *(round(1000 * x) for x in point))
    assert session.ask(asked) == p.VirtAimPoint(1, *(round(1000 * x) for x in point))
    session.forget()
    return session


def beside(rig, track, point, offset=(0.0, 0.0)):
    """Return by how much the camera misses the point, at every millisecond, degrees of pan,
    tilt."""
    angles = []
    for row in track.places:
        pose = rig.host_pose(rig.forward(joints(rig, row)))
        pan, tilt = aim(world(pose), point)
        angles.append(((pose[3] - pan - offset[0] + 180) % 360 - 180, pose[4] - tilt - offset[1]))
    return np.array(angles)


@pytest.mark.parametrize("rig", [BOOM_FINE, NODAL_FINE], ids=["plain", "with a nodal offset"])
def test_the_camera_stays_on_the_point(rig):
    """In moves of virtual axes, of track, swing and boom alone, and in jogs of either kind."""
    session = enabled(rig)

    def follows(*requests, key=None, stop=None):
        before = session.positions
        session.forget().accept(*requests)
        for _ in range(5):
            if key:
                session.accept(key)
            session.run(0.2)
        if stop:
            session.accept(stop)
        session.wait_idle()
        assert not session.events(p.HardStop)
        track = Track(session, before)
        assert np.ptp(track.places, axis=0).max() > 500
        track.limits(20_000, 50_000)
        assert np.abs(beside(rig, track, POINT)).max() < 0.01
        assert np.ptp(track.places[:, 3]) > 100, "it had to be turned for that"

    follows(p.VirtMove(m.VIRT_MOTOR_TRACK, 3120 * 100000))
    follows(p.VirtMove(m.VIRT_MOTOR_EW, -100 * 100000))
    follows(p.VirtJogOnLine(m.LINE_X, 5000), stop=p.VirtStop(m.VIRT_MOTOR_EW))
    follows(p.MotorMove(3, 4000))
    follows(p.MotorMove(2, -9000))
    follows(p.MotorMove(1, 3000))
    follows(key=p.MotorJog(3, 10_000, -90_000), stop=p.MotorStop(3))


@pytest.mark.parametrize("back", [False, True], ids=["the same way", "back"])
def test_a_jog_that_is_asked_for_while_one_stops(back):
    """Field note 4.2: one request is enough; the jog starts after the one before has come to rest,
    with the camera on its point."""
    session = enabled(NODAL_FINE)
    before = session.positions
    session.forget()
    for _ in range(4):
        session.accept(p.MotorJog(3, 10_000, 90_000)).run(0.2)
    session.accept(p.MotorStop(3)).run(0.06)
    session.accept(p.MotorJog(3, 10_000, -90_000 if back else 90_000)).run(0.3)
    assert session.moving
    session.wait_idle()
    track = Track(session, before)
    track.limits(20_000, 50_000)
    assert np.abs(beside(NODAL_FINE, track, POINT)).max() < 0.01
    times, signs = session.steps(3)
    rests = np.flatnonzero(np.diff(times) > 0.02)
    assert len(rests) == 1
    assert len(times) - rests[0] > 100
    assert np.all(signs[: rests[0]] == signs[0])
    assert np.all(signs[rests[0] + 1 :] == (-1 if back else 1) * signs[0])


def test_enabling_does_not_jump_and_keeps_the_offset():
    session = configured(BOOM_FINE)
    start = pose(session)
    pan, tilt = aim(world(start), POINT)
    session.forget()
    assert session.ask(p.SetVirtAimPoint(1, *(round(1000 * x) for x in POINT)))
    session.run(0.5)
    assert all(session.made(motor) == 0 for motor in range(1, 7))
    before = session.positions
    for target in (3110, 3050, 3100):
        session.accept(p.VirtMove(m.VIRT_MOTOR_TRACK, target * 100000)).wait_idle()
    offset = start[3] - pan, start[4] - tilt
    assert np.abs(beside(BOOM_FINE, Track(session, before), POINT, offset)).max() < 0.01
    # the operator's own pan is added
    here = pose(session)
    session.accept(p.VirtMove(m.VIRT_MOTOR_PAN, round((here[3] + 7) * 100000))).wait_idle()
    session.accept(p.MotorMove(5, session.position(5) + 2000)).wait_idle()
    before = session.positions
    session.forget().accept(p.VirtMove(m.VIRT_MOTOR_EW, 220 * 100000)).wait_idle()
    offset = offset[0] + 7, offset[1] + 2
    assert np.abs(beside(BOOM_FINE, Track(session, before), POINT, offset)).max() < 0.01


@pytest.mark.each_processor
def test_the_safe_distance():
    """Field notes 3.2 and 9.7: a vertical cylinder, when aiming is enabled and on a path."""
    rig = NODAL_FINE
    session = configured(rig)
    x, y, z = world(pose(session))

    def asked(*point):
        return p.SetVirtAimPoint(1, *(round(1000 * c) for c in point))

    session.refuse(p.Ack.ERR_AIM_COD, asked(x, y + 500, z - 149), asked(x + 100, y, z + 100))
    assert session.ask(p.VirtGetPosition()).aim_enabled == 0
    session.accept(asked(x, y + 500, z - 200))
    session.refuse(p.Ack.ERR_AIM_COD, p.VirtMove(m.VIRT_MOTOR_TRACK, round((z - 100) * 100000)))
    session.refuse(p.Ack.ERR_AIM_COD, p.MotorMove(3, -400 * 80)).run(0.3)
    assert session.made(3) == 0
    session.accept(p.VirtMove(m.VIRT_MOTOR_TRACK, round((z - 40) * 100000))).wait_idle()
    # a jog ends there
    session.accept(p.VirtJogOnLine(m.LINE_TILT, 100)).run(0.1)
    session.accept(p.VirtStop(m.VIRT_MOTOR_TILT)).wait_idle()
    for _ in range(20):
        session.accept(p.MotorJog(3, 10_000, -90_000)).run(0.2)
        if not session.moving:
            break
    end = world(pose(session))
    assert np.hypot(end[0] - x, end[2] - (z - 200)) == pytest.approx(150, abs=0.2)


@pytest.mark.parametrize(
    ("point", "pan", "tilt"), [((10, 0, 0), -90, 0), ((0, 10, -1), 0, 84.2894)]
)
def test_worked_values(point, pan, tilt):
    """Field note 9.9, in the coordinates of VIRT_CONFIG: the camera looks at the point, and
    continues to."""
    axes = tuple(
        Axis(i + 1, 1000.0, place) for i, place in enumerate((0.0, 0.0, 0.0, pan, tilt, 0.0))
    )
    rig = Rig(4, axes)
    session = configured(rig)
    session.accept(p.SetVirtAimPoint(1, *(1000 * x for x in point)))
    session.accept(p.VirtMove(m.VIRT_MOTOR_NS, 5 * 100000)).wait_idle()
    wanted = aim((0, 5, 0), point)
    assert (session.position(4), session.position(5)) == (
        pytest.approx(1000 * (wanted[0] - pan), abs=1),
        pytest.approx(1000 * (wanted[1] - tilt), abs=1),
    )


def test_answers():
    session = simulated()
    session.refuse(p.Ack.ERR_GENERAL, p.SetVirtAimPoint(1, 1, 2, 3))
    session = configured(XYZ)
    answer = session.answer_to(
        m.MSG_VIRT_AIM_POINT, p.SetVirtAimPoint(1, 5, -(2**31), 2**31 - 1).pack()
    )
    assert not answer.is_ack
    assert answer.payload == p.SetVirtAimPoint(1, 5, -(2**31), 2**31 - 1).pack()
    said = session.ask(p.VirtGetPosition())
    assert (said.aim_enabled, said.aim_x, said.aim_y, said.aim_z) == (1, 5, -(2**31), 2**31 - 1)
    session.refuse(p.Ack.ERR_RANGE, p.SetVirtAimPoint(2, 0, 0, 0))
    session.ask(p.SetVirtAimPoint(0, 1, 2, 3))
    said = session.ask(p.VirtGetPosition())
    assert (said.aim_enabled, said.aim_x, said.aim_y, said.aim_z) == (0, 1, 2, 3)
    session.ask(p.SetVirtAimPoint(1, 1, 2, 3000))
    session.accept(p.VirtMove(1, 302 * 100000))
    session.refuse(
        p.Ack.ERR_MOVING, p.SetVirtAimPoint(0, 0, 0, 0), p.MotorMove(1, 0), p.MotorMove(4, 0),
        p.MotorJog(1, 100, 0),
    )  # fmt: skip
    session.wait_idle().accept(p.MotorMove(2, 1000))
    session.refuse(p.Ack.ERR_MOVING, p.MotorMove(2, 0), p.MotorMove(3, 0), p.VirtMove(1, 0))
    session.wait_idle().accept(p.VirtConfig.unpack(XYZ.payload()))
    assert session.ask(p.VirtGetPosition()).aim_enabled == 0, "a new configuration"
    session = configured(SWING_PAN)
    session.refuse(p.Ack.ERR_RANGE, p.SetVirtAimPoint(1, 0, 0, 0))
    session = configured(BOOM_NODAL, settings={"virtuals": m.CAP_VIRTUALS})
    session.refuse(p.Ack.ERR_UNSUPPORTED, p.SetVirtAimPoint(1, 0, 0, 0))
    assert session.ask(p.VirtGetPosition()).aim_enabled is None
    session.accept(p.MotorConfigure(4, 0))
    session.refuse(p.Ack.ERR_GENERAL, p.VirtMove(1, 0))
