"""VIRT_CONFIG, VIRT_MOVE, VIRT_STOP and VIRT_GET_POSITION end to end on the host simulation."""

import struct
from dataclasses import replace

import numpy as np
import pytest

from framestep.protocol import messages as m
from framestep_tools import payloads as p
from framestep_tools.judge.virtual_reference import Axis, Rig
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
    Track,
    assert_straight,
    configured,
    joints,
    pose,
    pose_of,
)

RIGS = {
    "x-y-z": XYZ, "x-y-z with a nodal offset": NODAL, "boom": BOOM, "boom swung out": SWUNG,
    "boom with a nodal offset": BOOM_NODAL, "column": COLUMN, "swing-pan": SWING_PAN,
}  # fmt: skip
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
    session.forget().accept(p.VirtMove(number, round(target * 100000)))
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


STOPS = {
    "VIRT_STOP": p.VirtStop(m.VIRT_MOTOR_PAN),
    "STOP": p.MotorStop(1),
    "STOP_ALL": p.MotorStopAll(),
    "lost host": None,
}


@pytest.fixture(scope="module")
def unstopped():
    session = configured(NODAL)
    before = session.positions
    session.accept(p.VirtMove(m.VIRT_MOTOR_PAN, 60 * 100000)).wait_idle()
    return Track(session, before)


@pytest.mark.parametrize("stop", STOPS.values(), ids=STOPS)
@pytest.mark.parametrize("after_s", [0.15, *np.arange(0.3, 1.3, 0.0831), 3.2])
def test_a_stop_begins_at_once_and_stays_on_the_line(unstopped, stop, after_s):
    """While it starts, at full speed and where it slows down, wherever between two knots.
    VIRT_STOP of another axis has no effect."""
    session = configured(NODAL)
    before = session.positions
    session.accept(p.VirtMove(m.VIRT_MOTOR_PAN, 60 * 100000)).run(after_s)
    session.accept(p.VirtStop(m.VIRT_MOTOR_EW))
    asked = session.now
    if stop:
        session.accept(stop).run(1.5)
    else:
        session.leave().run(1.5).come_back()
    assert session.moving == []
    track, s = assert_straight(NODAL, session, before, UNIT[4], 65.0)
    track.limits(20_000, 50_000)
    peak = np.diff(s).max() * 1000
    assert track.end - asked < 0.07 + peak / 50  # as steeply as the motors can
    if after_s < 3:  # later it slows down anyway
        soon = round((asked - track.begin) * 1000) + 30
        assert np.abs(track.places[soon] - unstopped.places[soon]).max() > 5


@pytest.mark.parametrize(("flag", "sense"), [(m.MOTOR_COUPLE, 1), (m.MOTOR_COUPLE_REVERSED, -1)])
def test_a_stop_on_the_line_keeps_coupled_motors_together(flag, sense):
    session = configured(XYZ)
    session.accept(p.MotorConfigure(6, m.MOTOR_ENABLED | flag))
    for _ in range(3):
        session.accept(p.VirtMove(m.VIRT_MOTOR_ROLL, 9_000_000)).run(0.437)
        session.accept(p.MotorStop(7)).wait_idle()
        session.accept(p.VirtMove(m.VIRT_MOTOR_ROLL, 0)).wait_idle()
    assert not session.events(p.HardStop)
    times, signs = session.steps(6)
    others, their_signs = session.steps(7)
    assert len(times) > 1000
    assert np.array_equal(signs, sense * their_signs)
    assert np.abs(times - others).max() < 1e-5


def test_a_second_stop_all_lets_each_motor_ramp_down_by_itself():
    session = configured(XYZ)
    session.accept(p.VirtMove(m.VIRT_MOTOR_EW, 100 * 100000)).run(0.8)
    session.accept(p.MotorStopAll(), p.MotorStopAll())
    asked = session.now
    session.run(0.5)
    assert session.moving == []
    assert session.steps(1)[0][-1] - asked < 0.05 + 20_000 / 50_000 / 4
    # and it continues from there
    session.accept(p.VirtMove(m.VIRT_MOTOR_EW, 0)).wait_idle()
    assert session.position(1) == -10_000


def test_capabilities_and_their_mask():
    assert simulated().ask(p.Hi()).capabilities & 0x7C == 0x7C
    session = simulated({"virtuals": m.CAP_X_Y_Z})
    assert session.ask(p.Hi()).capabilities & 0x7C == m.CAP_X_Y_Z
    session.refuse(p.Ack.ERR_UNSUPPORTED, p.VirtConfig.unpack(Rig(2, (Axis(1), Axis(2))).payload()))
    session.accept(p.VirtConfig.unpack(XYZ.payload()))
    session = simulated({"virtuals": 0})
    assert session.ask(p.Hi()).capabilities & 0x7C == 0
    session.refuse(
        p.Ack.ERR_UNSUPPORTED, p.VirtConfig(0), p.VirtGetPosition(), p.VirtMove(1, 0), p.VirtStop(1)
    )


def test_without_a_configuration():
    session = simulated()
    requests = p.VirtGetPosition(), p.VirtMove(1, 0), p.VirtStop(1)
    session.refuse(p.Ack.ERR_GENERAL, *requests)
    session.accept(p.VirtConfig.unpack(XYZ.payload()), p.VirtGetPosition(), p.VirtStop(1))
    session.accept(p.VirtConfig(0))
    session.refuse(p.Ack.ERR_GENERAL, *requests)


def test_positions_are_reported_beside_those_of_the_motors():
    """Field note 9.8; they follow the motors, whatever has moved these."""
    session = configured(XYZ)
    session.accept(p.MotorMove(2, 3000)).wait_idle()
    motors, virtuals = session.events(p.Positions), session.events(p.VirtPositions)
    assert len(motors) == len(virtuals) >= 3
    for (_, place), (_, stands) in zip(motors, virtuals, strict=True):
        assert stands.north_south == pytest.approx(-2_000_000 + place.steps[1] * 100, abs=150 * 100)
    assert virtuals[-1][1].north_south == -1_700_000
    assert session.code(p.MotorResetPosition(2, 0)) == p.Ack.OK
    session.run(0.1)
    assert pose_of(session.events(p.VirtPositions)[-1][1])[2] == pytest.approx(-20)
    session.accept(p.VirtConfig(0)).forget()
    session.accept(p.MotorMove(2, 0)).wait_idle()
    assert not session.events(p.VirtPositions)


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
        session.accept(p.MotorMove(axis.motor, axis.step + 1000 * axis.motor))
    session.wait_idle()
    stands = session.positions
    now = rig.host_pose(rig.forward(joints(rig, np.array([stands[n] for n in sorted(stands)]))))
    np.testing.assert_allclose(pose(session), now, atol=1e-4)
    assert np.abs(now - wanted).max() > 0.5
    assert begun != stands
    # all positions 0: its positions read 0 at once
    if rig.kind != 2:
        zero = replace(rig, axes=tuple(Axis(a.motor, a.steps_per_unit) for a in rig.axes))
        session.accept(p.VirtConfig.unpack(zero.payload()))
        assert pose(session).tolist() == [0] * 6


def test_worked_value():
    """Field note 9.9: length 857.7, extension 78, vNS +100 moves the raw track by -5.8494."""
    rig = Rig(1, tuple(Axis(i + 1, 1000.0) for i in range(6)), 857.7, 78.0)
    session = configured(rig)
    session.accept(p.VirtMove(m.VIRT_MOTOR_NS, 100 * 100000)).wait_idle()
    assert session.position(3) == -5849
    np.testing.assert_allclose(pose(session), [0, 0, 100, 0, 0, 0], atol=0.02)


def test_a_refused_configuration_leaves_the_old_one():
    session = configured(XYZ)
    old = session.ask(p.VirtGetPosition())
    good = bytearray(XYZ.payload())

    def changed(at, value):
        data = bytearray(good)
        struct.pack_into("<i", data, at, value)
        return bytes(data)

    for code, payload in [
        (p.Ack.ERR_RANGE, b"\5"),
        (p.Ack.ERR_RANGE, bytes(good[:-1])),
        (p.Ack.ERR_RANGE, changed(1, 9)),
        (p.Ack.ERR_RANGE, changed(1, -1)),
        (p.Ack.ERR_RANGE, changed(1, 2)),
        (p.Ack.ERR_RANGE, changed(5, 0)),
    ]:
        answer = session.answer_to(m.MSG_VIRT_CONFIG, payload)
        assert answer.is_ack, payload.hex()
        assert p.Ack.unpack(answer.payload) == code, payload.hex()
        assert session.ask(p.VirtGetPosition()) == old
    session.accept(p.MotorConfigure(7, 0))
    answer = session.answer_to(m.MSG_VIRT_CONFIG, changed(1, 7))
    assert p.Ack.unpack(answer.payload) == p.Ack.ERR_RANGE, "disabled"
    session.accept(p.VirtMove(1, 302 * 100000)).wait_idle()
    assert session.position(3) == 2000


def test_what_is_refused_while_something_moves():
    session = configured(XYZ)
    session.accept(p.MotorMove(8, 100_000))  # not of the rig
    session.accept(p.VirtMove(1, 305 * 100000))
    config = p.VirtConfig.unpack(XYZ.payload())
    refused = (
        config, p.VirtConfig(0), p.VirtMove(2, 0), p.MotorMove(3, 0), p.MotorJog(1, 100, 0),
        p.MotorResetPosition(6, 0), p.MotorConfigure(2, 0),
    )  # fmt: skip
    session.refuse(p.Ack.ERR_MOVING, *refused).run(0.2)
    session.refuse(p.Ack.ERR_MOVING, *refused)
    session.upload({1: [0, 0, 0]})
    session.refuse(p.Ack.ERR_MOVING, p.RtPositionFrame(1)).run(2)
    assert session.moving == [8]
    assert session.position(3) == 5000
    session.accept(config, p.MotorMove(1, 5000))
    session.refuse(p.Ack.ERR_MOVING, config, p.VirtConfig(0), p.VirtMove(1, 0)).wait_idle()
    session.accept(p.VirtMove(1, 0), p.VirtStop(1))


@pytest.mark.parametrize("number", [0, 7, 255])
def test_virtual_axes_that_there_are_not(number):
    session = configured(XYZ)
    session.refuse(p.Ack.ERR_RANGE, p.VirtMove(number, 0), p.VirtStop(number))


def test_an_axis_without_a_motor():
    """It stays where it is: a pose that needs it is out of reach."""
    rig = Rig(4, (*XYZ.axes[:4], Axis(0, 1000.0, -3.0), Axis(0)))
    session = configured(rig)
    session.refuse(p.Ack.ERR_RANGE, p.VirtMove(5, 0), p.VirtMove(6, 100000))
    session.accept(p.VirtMove(4, 6 * 100000)).wait_idle()
    assert session.position(4) == 1000


def test_a_long_track_with_fine_steps():
    """A track of 20 m at 1000 steps per millimetre: the precision is the same at its end."""
    axes = (Axis(1, 250.0, 20.0), Axis(2, 1000.0, 35.0), Axis(3, 1000.0, 20_000.0), *BOOM.axes[3:])
    rig = Rig(1, axes, 857.7, 78.0, nodal=(20.0, 35.5, -12.0))
    session = configured(rig, 60_000, 300_000)
    before = session.positions
    start = rig.host_pose(rig.forward(joints(rig, np.zeros(6))))
    session.forget().accept(p.VirtMove(m.VIRT_MOTOR_EW, round((start[1] - 60) * 100000)))
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
    session.refuse(p.Ack.ERR_RANGE, p.VirtMove(number, round(target * 100000))).run(0.3)
    assert session.moving == []
    assert all(session.made(motor) == 0 for motor in range(1, 7))


def test_the_command_line_reports_and_moves(command):
    board = configured(XYZ).board
    status, out, _ = command(board, "virtual pan 6.5")
    shown = "track: 300.000 ew: 10.000 ns: -20.000 pan: 6.500 tilt: -3.000 roll: 0.000"
    assert (status, out.split()) == (0, shown.split())
    assert command(board, "virtual roll -1e9")[0] != 0


def test_rounding_to_steps_does_not_add_up():
    """Coordinates that stay the same do so however often another one moves."""
    session = configured(BOOM)
    start = pose(session)
    for k in range(12):
        session.accept(p.VirtMove(m.VIRT_MOTOR_NS, round((start[2] + 0.337 * (k % 3)) * 100000)))
        session.wait_idle()
        session.accept(p.VirtMove(m.VIRT_MOTOR_EW, round((start[1] + 0.771 * (k % 5)) * 100000)))
        session.wait_idle()
    session.accept(p.VirtMove(m.VIRT_MOTOR_NS, round(start[2] * 100000))).wait_idle()
    session.accept(p.VirtMove(m.VIRT_MOTOR_EW, round(start[1] * 100000))).wait_idle()
    assert [session.position(motor) for motor in range(1, 7)] == [0] * 6
