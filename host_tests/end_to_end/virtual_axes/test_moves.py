"""VIRT_CONFIG, VIRT_MOVE, VIRT_STOP and VIRT_GET_POSITION end to end on the host simulation."""

import struct

import numpy as np
import pytest

from framestep.protocol import messages as m
from framestep_tools import cli
from framestep_tools.client.client import Client
from framestep_tools.judge.virtual_reference import Axis, Rig
from framestep_tools.payloads import (
    Ack,
    Hi,
    MotorConfigure,
    MotorJog,
    MotorMove,
    MotorResetPosition,
    MotorStop,
    MotorStopAll,
    Positions,
    RtPositionFrame,
    VirtConfig,
    VirtGetPosition,
    VirtMove,
    VirtPositions,
    VirtStop,
)
from framestep_tools.simulator.boards import LockstepPort
from host_tests.end_to_end.session import simulated
from host_tests.end_to_end.virtual_axes.judging import (
    BOOM,
    BOOM_NODAL,
    COLUMN,
    NODAL,
    SWING_PAN,
    SWUNG,
    UNIT,
    XYZ,
    assert_straight,
    configured,
    joints,
    pose,
    pose_of,
)

RIGS = {
    "x-y-z": XYZ,
    "x-y-z with a nodal offset": NODAL,
    "boom": BOOM,
    "boom swung out": SWUNG,
    "boom with a nodal offset": BOOM_NODAL,
    "column": COLUMN,
    "swing-pan": SWING_PAN,
}
MOVES = [
    ("boom", m.VIRT_MOTOR_EW, 500.0),
    ("boom", m.VIRT_MOTOR_NS, -700.0),
    ("boom swung out", m.VIRT_MOTOR_EW, -500.0),
    ("boom", m.VIRT_MOTOR_TRACK, 30.0),
    ("boom with a nodal offset", m.VIRT_MOTOR_EW, -110.0),
    ("boom with a nodal offset", m.VIRT_MOTOR_PAN, 30.0),
    ("column", m.VIRT_MOTOR_EW, 400.0),
    ("swing-pan", m.VIRT_MOTOR_PAN, -90.0),
    ("x-y-z", m.VIRT_MOTOR_EW, 22.5),
    ("x-y-z", m.VIRT_MOTOR_TRACK, -14.0),
    ("x-y-z", m.VIRT_MOTOR_ROLL, 0.5),
    ("x-y-z with a nodal offset", m.VIRT_MOTOR_PAN, 70.0),
    ("x-y-z with a nodal offset", m.VIRT_MOTOR_TILT, -25.0),
]


@pytest.mark.parametrize(("name", "number", "length"), MOVES)
def test_a_move_is_straight(name, number, length):
    rig = RIGS[name]
    session = configured(rig)
    before = session.positions
    start = rig.forward(joints(rig, np.array([before[n] for n in sorted(before)])))
    np.testing.assert_allclose(pose(session), rig.host_pose(start), atol=1e-9)
    target = rig.host_pose(start)[number - 1] + length
    session.forget()
    session.accept(VirtMove(number, round(target * 100000)))
    assert session.moving == sorted(a.motor for a in rig.axes), (
        "the moving bits are set by the acknowledgement"
    )
    session.wait_idle()
    way = UNIT[number] * np.sign(length)
    track, s = assert_straight(rig, session, before, way, abs(length))
    track.limits(20_000, 50_000)
    # one ramp up, one ramp down
    assert (np.diff(s) >= -0.03).all()
    expected = rig.steps(rig.inverse(start + length * UNIT[number], joints(rig, track.places[0])))
    after = session.positions
    assert [after[a.motor] for a in rig.axes] == np.round(expected).tolist()
    np.testing.assert_allclose(
        pose(session), rig.host_pose(start) + length * UNIT[number], atol=0.03
    )


def test_a_stop_stays_on_the_line():
    """VIRT_STOP of that axis, STOP of one of its motors, STOP_ALL, a lost host. VIRT_STOP of
    another axis has no effect."""
    session = configured(NODAL)
    for stop in (VirtStop(m.VIRT_MOTOR_PAN), MotorStop(1), MotorStopAll(), None):
        session.run(1.1)  # no second STOP_ALL
        before = session.positions
        session.forget()
        session.accept(VirtMove(m.VIRT_MOTOR_PAN, 60 * 100000 if before[4] < 30_000 else 0))
        session.run(0.7)
        session.accept(VirtStop(m.VIRT_MOTOR_EW))
        asked = session.now
        if stop:
            session.accept(stop)
        else:
            session.leave()
        session.run(1.5)
        if not stop:
            session.come_back()
        assert session.moving == []
        track, s = assert_straight(
            NODAL, session, before, UNIT[4] * (1 if before[4] < 30_000 else -1), 65.0
        )
        assert 5 < s[-1] < 50
        # some hundredths of a second until it slows down, then as steeply as the motors can
        peak = np.diff(s).max() * 1000
        assert track.end - asked < 0.15 + peak / 30


def test_a_second_stop_all_lets_each_motor_ramp_down_by_itself():
    session = configured(XYZ)
    session.accept(VirtMove(m.VIRT_MOTOR_EW, 100 * 100000))
    session.run(0.8)
    session.accept(MotorStopAll(), MotorStopAll())
    asked = session.now
    session.run(0.5)
    assert session.moving == []
    assert session.steps(1)[0][-1] - asked < 0.05 + 20_000 / 50_000 / 4
    # and it continues from there
    session.accept(VirtMove(m.VIRT_MOTOR_EW, 0))
    session.wait_idle()
    assert session.position(1) == -10_000


def test_capabilities_and_their_mask():
    assert simulated().ask(Hi()).capabilities & 0x7C == 0x7C
    session = simulated({"virtuals": m.CAP_X_Y_Z})
    assert session.ask(Hi()).capabilities & 0x7C == m.CAP_X_Y_Z
    session.refuse(Ack.ERR_UNSUPPORTED, VirtConfig.unpack(Rig(2, (Axis(1), Axis(2))).payload()))
    session.accept(VirtConfig.unpack(XYZ.payload()))
    session = simulated({"virtuals": 0})
    assert session.ask(Hi()).capabilities & 0x7C == 0
    session.refuse(
        Ack.ERR_UNSUPPORTED, VirtConfig(0), VirtGetPosition(), VirtMove(1, 0), VirtStop(1)
    )


def test_without_a_configuration():
    session = simulated()
    requests = VirtGetPosition(), VirtMove(1, 0), VirtStop(1)
    session.refuse(Ack.ERR_GENERAL, *requests)
    session.accept(VirtConfig.unpack(XYZ.payload()))
    session.accept(VirtGetPosition(), VirtStop(1))
    session.accept(VirtConfig(0))
    session.refuse(Ack.ERR_GENERAL, *requests)


def test_positions_are_reported_beside_those_of_the_motors():
    """Field note 9.8; they follow the motors, whatever has moved these."""
    session = configured(XYZ)
    session.ask(MotorMove(2, 3000))
    session.wait_idle()
    motors, virtuals = session.events(Positions), session.events(VirtPositions)
    assert len(motors) == len(virtuals) >= 3
    for (_, place), (_, stands) in zip(motors, virtuals, strict=True):
        assert stands.north_south == pytest.approx(-2_000_000 + place.steps[1] * 100, abs=150 * 100)
    assert virtuals[-1][1].north_south == -1_700_000
    assert session.code(MotorResetPosition(2, 0)) == Ack.OK
    session.run(0.1)
    assert pose_of(session.events(VirtPositions)[-1][1])[2] == pytest.approx(-20)
    session.accept(VirtConfig(0))
    session.forget()
    session.ask(MotorMove(2, 0))
    session.wait_idle()
    assert not session.events(VirtPositions)


@pytest.mark.parametrize("rig", [BOOM_NODAL, SWUNG, COLUMN, XYZ, SWING_PAN])
def test_the_pose_is_that_of_the_configuration_and_what_has_changed_since(rig):
    """Field note 9.2, as a host sees it: also if motors move by themselves, or the rig is
    configured again."""
    session = configured(rig)
    begun = {a.motor: a.step for a in rig.axes}
    wanted = (
        [
            rig.axes[i].position
            for i in ((2, 1, 0, 3, 4, 5) if rig.kind != 4 else (2, 0, 1, 3, 4, 5))
        ]
        if rig.kind != 2
        else [0] * 6
    )
    assert pose(session).tolist() == wanted
    for axis in rig.axes:
        session.ask(MotorMove(axis.motor, axis.step + 1000 * axis.motor))
    session.wait_idle()
    stands = session.positions
    now = rig.host_pose(rig.forward(joints(rig, np.array([stands[n] for n in sorted(stands)]))))
    np.testing.assert_allclose(pose(session), now, atol=1e-4)
    assert np.abs(now - wanted).max() > 0.5
    assert begun != stands
    # all positions 0: its positions read 0 at once
    if rig.kind != 2:
        zero = Rig(
            rig.kind,
            tuple(Axis(a.motor, a.steps_per_unit) for a in rig.axes),
            rig.length,
            rig.extension,
            rig.nodal,
        )
        session.accept(VirtConfig.unpack(zero.payload()))
        assert pose(session).tolist() == [0] * 6


def test_worked_value():
    """Field note 9.9: length 857.7, extension 78, vNS +100 moves the raw track by -5.8494."""
    rig = Rig(1, tuple(Axis(i + 1, 1000.0) for i in range(6)), 857.7, 78.0)
    session = configured(rig)
    session.accept(VirtMove(m.VIRT_MOTOR_NS, 100 * 100000))
    session.wait_idle()
    assert session.position(3) == -5849
    np.testing.assert_allclose(pose(session), [0, 0, 100, 0, 0, 0], atol=0.02)


def test_a_refused_configuration_leaves_the_old_one():
    session = configured(XYZ)
    old = session.ask(VirtGetPosition())
    good = bytearray(XYZ.payload())

    def changed(at, value):
        data = bytearray(good)
        struct.pack_into("<i", data, at, value)
        return bytes(data)

    for code, payload in [
        (Ack.ERR_RANGE, b"\5"),
        (Ack.ERR_RANGE, bytes(good[:-1])),
        (Ack.ERR_RANGE, changed(1, 9)),
        (Ack.ERR_RANGE, changed(1, -1)),
        (Ack.ERR_RANGE, changed(1, 2)),
        (Ack.ERR_RANGE, changed(5, 0)),
    ]:
        answer = session.answer_to(m.MSG_VIRT_CONFIG, payload)
        assert answer.is_ack, payload.hex()
        assert Ack.unpack(answer.payload) == code, payload.hex()
        assert session.ask(VirtGetPosition()) == old
    session.accept(MotorConfigure(7, 0))
    answer = session.answer_to(m.MSG_VIRT_CONFIG, changed(1, 7))
    assert Ack.unpack(answer.payload) == Ack.ERR_RANGE, "disabled"
    session.accept(VirtMove(1, 302 * 100000))
    session.wait_idle()
    assert session.position(3) == 2000


def test_what_is_refused_while_something_moves():
    session = configured(XYZ)
    session.ask(MotorMove(8, 100_000))  # not of the rig
    session.accept(VirtMove(1, 305 * 100000))
    config = VirtConfig.unpack(XYZ.payload())
    refused = (
        config,
        VirtConfig(0),
        VirtMove(2, 0),
        MotorMove(3, 0),
        MotorJog(1, 100, 0),
        MotorResetPosition(6, 0),
        MotorConfigure(2, 0),
    )
    session.refuse(Ack.ERR_MOVING, *refused)
    session.run(0.2)
    session.refuse(Ack.ERR_MOVING, *refused)
    session.upload({1: [0, 0, 0]})
    session.refuse(Ack.ERR_MOVING, RtPositionFrame(1))
    session.run(2)
    assert session.moving == [8]
    assert session.position(3) == 5000
    session.accept(config)
    session.ask(MotorMove(1, 5000))
    session.refuse(Ack.ERR_MOVING, config, VirtConfig(0), VirtMove(1, 0))
    session.wait_idle()
    session.accept(VirtMove(1, 0), VirtStop(1))


@pytest.mark.parametrize("number", [0, 7, 255])
def test_virtual_axes_that_there_are_not(number):
    session = configured(XYZ)
    session.refuse(Ack.ERR_RANGE, VirtMove(number, 0), VirtStop(number))


def test_an_axis_without_a_motor():
    """It stays where it is: a pose that needs it is out of reach."""
    rig = Rig(4, (*XYZ.axes[:4], Axis(0, 1000.0, -3.0), Axis(0)))
    session = configured(rig)
    session.refuse(Ack.ERR_RANGE, VirtMove(5, 0), VirtMove(6, 100000))
    session.accept(VirtMove(4, 6 * 100000))
    session.wait_idle()
    assert session.position(4) == 1000


def test_a_long_track_with_fine_steps():
    """A track of 20 m at 1000 steps per millimetre: the precision is the same at its end."""
    axes = (Axis(1, 250.0, 20.0), Axis(2, 1000.0, 35.0), Axis(3, 1000.0, 20_000.0), *BOOM.axes[3:])
    rig = Rig(1, axes, 857.7, 78.0, nodal=(20.0, 35.5, -12.0))
    session = configured(rig, 60_000, 300_000)
    before = session.positions
    start = rig.host_pose(rig.forward(joints(rig, np.zeros(6))))
    session.forget()
    session.accept(VirtMove(m.VIRT_MOTOR_EW, round((start[1] - 60) * 100000)))
    session.wait_idle()
    track, _ = assert_straight(rig, session, before, -UNIT[m.VIRT_MOTOR_EW], 60)
    track.limits(60_000, 300_000)


TABLE = tuple(round(250 * a + 40 * np.sin(np.radians(2 * a))) for a in range(-60, 61))


@pytest.mark.parametrize(
    ("rig", "number", "target"),
    [
        (BOOM, m.VIRT_MOTOR_EW, 946),  # farther than the arm is long
        (BOOM, m.VIRT_MOTOR_EW, -935.6),  # the swing at 90 degrees
        (BOOM, m.VIRT_MOTOR_NS, 860.7),  # the boom upright
        (BOOM, m.VIRT_MOTOR_NS, -900),
        (COLUMN, m.VIRT_MOTOR_EW, 640),
        (
            Rig(1, (Axis(1, 250.0, 0.0), *BOOM.axes[1:]), 857.7, 78.0, table=TABLE),
            m.VIRT_MOTOR_NS,
            745,  # 60.3 degrees
        ),
        # a number of steps that is too large is refused as well
        (XYZ, m.VIRT_MOTOR_TRACK, 21_474),
    ],
)
def test_what_cannot_be_reached_is_refused_before_anything_moves(rig, number, target):
    if rig is XYZ:
        rig = Rig(4, (*XYZ.axes[:2], Axis(3, 200_000.0, 300.0), *XYZ.axes[3:]))
    session = configured(rig)
    session.refuse(Ack.ERR_RANGE, VirtMove(number, round(target * 100000)))
    session.run(0.3)
    assert session.moving == []
    assert all(session.made(motor) == 0 for motor in range(1, 7))


def test_the_command_line_reports_and_moves(monkeypatch, capsys):
    session = configured(XYZ)
    monkeypatch.setattr(Client, "open", lambda device: Client(LockstepPort(session.board)))
    assert cli.app.status(["virtual", "socket://x", "pan", "6.5"]) == 0
    assert capsys.readouterr().out.split() == (
        [
            "track:",
            "300.000",
            "ew:",
            "10.000",
            "ns:",
            "-20.000",
            "pan:",
            "6.500",
            "tilt:",
            "-3.000",
            "roll:",
            "0.000",
        ]
    )
    assert cli.app.status(["virtual", "socket://x", "roll", "-1e9"]) != 0


def test_rounding_to_steps_does_not_add_up():
    """Coordinates that stay the same do so however often another one moves."""
    session = configured(BOOM)
    start = pose(session)
    for k in range(12):
        session.accept(VirtMove(m.VIRT_MOTOR_NS, round((start[2] + 0.337 * (k % 3)) * 100000)))
        session.wait_idle()
        session.accept(VirtMove(m.VIRT_MOTOR_EW, round((start[1] + 0.771 * (k % 5)) * 100000)))
        session.wait_idle()
    session.accept(VirtMove(m.VIRT_MOTOR_NS, round(start[2] * 100000)))
    session.wait_idle()
    session.accept(VirtMove(m.VIRT_MOTOR_EW, round(start[1] * 100000)))
    session.wait_idle()
    assert [session.position(motor) for motor in range(1, 7)] == [0] * 6
