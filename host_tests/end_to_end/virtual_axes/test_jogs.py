"""VIRT_JOG and VIRT_JOG_ON_LINE end to end on the host simulation."""

import numpy as np
import pytest

from framestep.protocol import messages as m
from framestep_tools import payloads as p
from framestep_tools.judge.virtual_reference import Axis, Rig, line_direction
from host_tests.end_to_end.session import assert_within
from host_tests.end_to_end.virtual_axes.judging import (
    BOOM,
    BOOM_NODAL,
    COLUMN,
    NODAL,
    SWUNG,
    UNIT,
    XYZ,
    Track,
    assert_straight,
    configured,
    joints,
    pose,
)

FAR = 2**31 - 1
STOP_OF_LINE = [
    m.VIRT_MOTOR_EW, m.VIRT_MOTOR_NS, m.VIRT_MOTOR_TRACK, m.VIRT_MOTOR_PAN, m.VIRT_MOTOR_TILT,
]  # fmt: skip


def hold(session, jog, seconds):
    """Hold a jog key for that long, or until nothing moves."""
    end = session.now + seconds
    while session.now < end:
        session.accept(jog).run(0.2)
        if not session.moving:
            return


@pytest.mark.parametrize(
    ("rig", "number", "sign"),
    [(SWUNG, m.VIRT_MOTOR_EW, 1), (BOOM_NODAL, m.VIRT_MOTOR_NS, -1), (COLUMN, m.VIRT_MOTOR_EW, -1)],
)
def test_a_jog_ends_where_the_rig_cannot_reach(rig, number, sign):
    """It slows down before, on the line, with each motor always within its limits."""
    session = configured(rig, 20_000, 100_000)
    before = session.positions
    start = pose(session)
    session.forget()
    hold(session, p.VirtJog(number, 10_000, FAR if sign > 0 else -FAR - 1), 30)
    assert session.moving == [], "it has come to rest by itself"
    track, _ = assert_straight(rig, session, before, UNIT[number] * sign, 2000)
    track.limits(20_000, 100_000)
    end = pose(session)
    assert sign * (end - start)[number - 1] > 200
    near = joints(rig, track.places[-1])
    swing, boom = abs(near[1]), abs(near[0]) if rig.kind == 1 else 0
    assert 80 < max(swing, boom) <= 88.22
    hold(
        session, p.VirtJog(number, 10_000, rig.axes[0 if number == m.VIRT_MOTOR_NS else 1].step), 30
    )
    np.testing.assert_allclose(pose(session), start, atol=0.1)


def test_a_jog_ends_at_a_soft_limit():
    session = configured(BOOM, 10_000, 50_000)
    session.accept(p.MotorSetLimits(3, 1, -9000, 1, 400, 0))
    before = session.positions
    session.forget()
    hold(session, p.VirtJog(m.VIRT_MOTOR_EW, 10_000, FAR), 30)
    track, _ = assert_straight(BOOM, session, before, UNIT[2], 700)
    assert session.position(3) == pytest.approx(-9000, abs=2)
    assert track.places[:, 2].min() >= -9000
    # there it stays, without an error, like a motor's jog; the other way it moves
    session.accept(p.VirtJog(m.VIRT_MOTOR_EW, 10_000, FAR)).run(0.3)
    assert session.moving == []
    assert session.position(3) == pytest.approx(-9000, abs=1)
    session.accept(p.VirtJog(m.VIRT_MOTOR_EW, 10_000, -FAR)).run(0.2)
    assert session.moving
    session.wait_idle()
    assert session.position(3) > -9000


def test_a_destination_is_a_step_of_the_main_motor():
    """The last jog ends in cells that allow steeper ramps than those before them."""
    session = configured(BOOM)
    for destination in (3000, 2000, 2000, -10_000):
        session.accept(p.VirtJog(m.VIRT_MOTOR_EW, 10_000, destination))
        hold(session, p.VirtJog(m.VIRT_MOTOR_EW, 10_000, destination), 20)
        assert session.position(2) == pytest.approx(destination, abs=1)
    for motor in (2, 3, 4):
        assert_within(*session.steps(motor), 20_000, 50_000, window=0.016)
    assert not session.events(p.HardStop)


def test_a_falling_boom_table_turns_the_sense():
    """The main motor's steps may fall as the virtual axis rises."""
    table = tuple(round(-250 * a + 3 * np.sin(a)) for a in range(-60, 61))
    rig = Rig(
        1, (Axis(1, 1000.0, 0.0, 0), *BOOM.axes[1:]), BOOM.length, BOOM.extension, table=table
    )
    session = configured(rig)
    start = pose(session)
    hold(session, p.VirtJog(m.VIRT_MOTOR_NS, 10_000, 5000), 20)
    assert session.position(1) == pytest.approx(5000, abs=1)
    assert pose(session)[2] < start[2] - 100


def test_a_jog_that_is_not_repeated_ends():
    session = configured(XYZ)
    session.forget().accept(p.VirtJog(m.VIRT_MOTOR_EW, 10_000, FAR))
    begun = session.now
    session.wait_idle()
    assert 0.5 < session.steps(1)[0][-1] - begun < 1.1
    assert session.events(p.VirtPositions)
    session = configured(XYZ, settings={"jog_timeout_ms": 0})
    session.accept(p.VirtJog(m.VIRT_MOTOR_EW, 10_000, FAR)).run(3)
    assert session.moving
    session.accept(p.VirtStop(m.VIRT_MOTOR_EW)).wait_idle()


def test_the_speed_is_a_share():
    """A share of velocity and acceleration; 1 is for fine moves."""
    top = {}
    for speed in (1, 1000, 5000):
        session = configured(XYZ, 20_000, 50_000)
        session.forget()
        hold(session, p.VirtJog(m.VIRT_MOTOR_NS, speed, FAR), 3 if speed > 1 else 1)
        times, _ = session.steps(2)
        top[speed] = 1 / np.diff(times).min()
        Track(session, session.positions).limits(20_000 * max(speed, 100) / 10_000 + 1, 50_000)
    assert top[5000] == pytest.approx(9700, rel=0.05)
    assert top[1000] == pytest.approx(1940, rel=0.05)
    assert top[1] == pytest.approx(194, rel=0.1)


@pytest.mark.long
@pytest.mark.parametrize(
    ("line", "speed"), [(0, 10_000), (1, -4000), (2, -10_000), (3, 6000), (4, -10_000)]
)
def test_a_line_jog_goes_where_the_camera_points(line, speed):
    rig = BOOM_NODAL
    session = configured(rig)
    before = session.positions
    # field note 9.6: the camera's, as reported
    angles = rig.host_pose(rig.forward(joints(rig, np.zeros(6))))[3:]
    session.forget().accept(p.VirtJogOnLine(line, speed))
    session.accept(p.VirtJogOnLine(line, speed)).run(0.8)
    number = STOP_OF_LINE[line]
    for other in {*range(1, 7)} - {number}:
        session.accept(p.VirtStop(other))
    session.run(0.3)
    assert session.moving, "no time-out"
    session.accept(p.VirtStop(number)).wait_idle()
    way = UNIT[number]
    if line <= m.LINE_Z:
        x, y, z = line_direction(line, *angles)
        way = np.array([z, x, y, 0, 0, 0])
    track, s = assert_straight(rig, session, before, way * np.sign(speed), 600)
    track.limits(20_000, 50_000)
    assert s[-1] > 2


def test_a_line_jog_ends_at_a_limit():
    session = configured(NODAL)
    session.accept(p.MotorSetLimits(1, 0, 0, 1, 3000, 0))
    before = session.positions
    session.forget().accept(p.VirtJogOnLine(m.LINE_X, 10_000)).wait_idle()
    x, y, z = line_direction(0, 5.0, -3.0, 0.0)
    track, _ = assert_straight(NODAL, session, before, np.array([z, x, y, 0, 0, 0]), 10)
    assert session.position(1) == 3000
    track.limits(20_000, 50_000)


def test_what_is_refused():
    session = configured(XYZ)
    session.refuse(
        p.Ack.ERR_RANGE, p.VirtJog(0, 100, 0), p.VirtJog(7, 100, 0), p.VirtJog(1, 0, 0),
        p.VirtJog(1, 10_001, 0), p.VirtJogOnLine(5, 100), p.VirtJogOnLine(0, 0),
        p.VirtJogOnLine(0, 10_001), p.VirtJogOnLine(0, -10_001),
    )  # fmt: skip
    session.accept(p.VirtJog(1, 5000, FAR))
    session.refuse(p.Ack.ERR_MOVING, p.VirtMove(1, 0))
    session.accept(p.VirtJog(1, 5000, FAR), p.MotorStop(3)).wait_idle()
    session.accept(p.VirtMove(m.VIRT_MOTOR_EW, 0))
    session.refuse(p.Ack.ERR_MOVING, p.VirtJogOnLine(0, -100), p.VirtJog(1, 5000, FAR)).wait_idle()


def test_another_jog_begins_when_the_one_under_way_has_come_to_rest():
    """Field note 4.2: also against the direction."""
    session = configured(XYZ)
    session.forget()
    hold(session, p.VirtJog(m.VIRT_MOTOR_EW, 10_000, FAR), 0.8)
    hold(session, p.VirtJog(m.VIRT_MOTOR_EW, 10_000, -FAR), 1.4)
    hold(session, p.VirtJog(m.VIRT_MOTOR_NS, 10_000, FAR), 1.2)
    session.accept(p.VirtStop(m.VIRT_MOTOR_NS)).wait_idle()
    assert not session.events(p.HardStop)
    track = Track(session, session.positions)
    track.limits(20_000, 50_000)
    times, signs = session.steps(1)
    assert (np.diff(signs) != 0).sum() == 1
    assert signs[0] > 0 > signs[-1]
    assert session.steps(2)[0][0] > times[-1], "never both"
    assert session.made(2) > 5000
    # line jogs need no repetition; a stop drops the next one
    session.accept(p.VirtJogOnLine(m.LINE_X, 5000), p.VirtJogOnLine(m.LINE_X, -5000)).run(2)
    assert session.moving
    session.accept(p.VirtJogOnLine(m.LINE_Y, 5000), p.VirtStop(m.VIRT_MOTOR_NS)).run(2)
    assert session.moving == []


ENDS = {
    "VIRT_STOP": [p.VirtStop(m.VIRT_MOTOR_EW)],
    "STOP": [p.MotorStop(2)],
    "STOP_ALL": [p.MotorStopAll()],
    "two STOP_ALL": [p.MotorStopAll(), p.MotorStopAll()],
    "another jog": [p.VirtJog(m.VIRT_MOTOR_NS, 10_000, FAR), p.VirtStop(m.VIRT_MOTOR_NS)],
}


def end_of_a_jog(kind, begun, seconds):
    """Release a jog after `seconds`, in one of the ways in which it ends."""
    end = begun.now + seconds
    while begun.now < end - 1e-6:
        begun.run(min(0.2, end - begun.now))
        begun.code(p.VirtJog(m.VIRT_MOTOR_EW, 10_000, FAR))
    if kind == "host lost":
        begun.leave()
    begun.accept(*ENDS.get(kind, ())).run(3)


@pytest.mark.parametrize("kind", [*ENDS, "host lost"])
@pytest.mark.parametrize(
    ("rig", "motor", "limits"), [(BOOM, 3, (-9000, 400)), (NODAL, 1, (0, 7000))]
)
def test_a_stop_keeps_the_limit_that_a_jog_brakes_for(rig, motor, limits, kind):
    """At any time of the stop, no motor goes further than it would have gone."""
    for k in range(5):
        session = configured(rig, 10_000, 20_000)
        session.accept(p.MotorSetLimits(motor, 1, limits[0], 1, limits[1], 0))
        before = session.positions
        session.forget()
        end_of_a_jog(kind, session, 0.7 + 0.14 * k)
        track = Track(session, before)
        assert limits[0] <= track.places[:, motor - 1].min()
        assert track.places[:, motor - 1].max() <= limits[1]
        track.limits(10_000, 20_000 * (4 if kind == "two STOP_ALL" else 1))
        if kind == "host lost":
            session.come_back()
        assert not session.events(p.HardStop)
        assert session.moving == []


@pytest.mark.parametrize("timeout_ms", range(300, 900, 75))
def test_a_time_out_keeps_the_limit_that_a_jog_brakes_for(timeout_ms):
    session = configured(BOOM, 10_000, 20_000, settings={"jog_timeout_ms": timeout_ms})
    session.accept(p.MotorSetLimits(3, 1, -3000, 1, 400, 0))
    before = session.positions
    session.forget().accept(p.VirtJog(m.VIRT_MOTOR_EW, 10_000, FAR)).wait_idle()
    track = Track(session, before)
    assert track.places[:, 2].min() >= -3000
    track.limits(10_000, 20_000)


@pytest.mark.parametrize(
    "jog", [p.VirtJog(m.VIRT_MOTOR_EW, 10_000, FAR), p.VirtJogOnLine(m.LINE_X, 10_000)]
)
def test_limits_set_under_way_are_kept(jog):
    """The jog ends on its line, and begins again at its next request; wider limits do not end
    it."""
    session = configured(XYZ, 10_000, 50_000)
    session.accept(jog).run(0.4)
    session.accept(p.MotorSetLimits(1, 1, -(10**6), 1, 10**6, 0)).run(0.05)
    limit = session.position(1) + 4000
    session.accept(p.MotorSetLimits(1, 1, -100, 1, limit, 0)).wait_idle()
    assert limit - 4000 < session.position(1) < limit
    assert max(np.cumsum(session.steps(1)[1])) < limit
    hold(session, jog, 5)
    assert session.position(1) == pytest.approx(limit, abs=1)
    assert max(np.cumsum(session.steps(1)[1])) <= limit
    assert not session.events(p.HardStop)


COARSE = Rig(
    4,
    tuple(Axis(i + 1, n, 0.0) for i, n in enumerate((10.0,) * 3 + (100.0,) * 3)),
    nodal=(20.0, -35.5, 20.0),
)


@pytest.mark.parametrize("speed", [10_000, 1000])
def test_a_motor_without_a_part_makes_no_step(speed):
    """Even if the line before has left it between two steps, and its soft limits are at its
    position."""
    session = configured(COARSE, 20_000, 50_000)
    for k in range(6):
        # the nodal offset turns with the camera, so X and Z move along an arc
        session.accept(p.VirtJogOnLine(m.LINE_PAN, 10_000 if k < 3 else -10_000))
        session.run(0.23 + 0.061 * k).accept(p.VirtStop(m.VIRT_MOTOR_PAN)).wait_idle()
        for number, motor in ((m.VIRT_MOTOR_EW, 1), (m.VIRT_MOTOR_NS, 2), (m.VIRT_MOTOR_TRACK, 3)):
            for other, step in session.positions.items():
                session.accept(
                    p.MotorSetLimits(other, int(other != motor), step, int(other != motor), step, 0)
                )
            session.forget()
            for way in (1, -1):
                hold(session, p.VirtJog(number, speed, FAR * way), 0.2)
                session.accept(p.VirtStop(number)).wait_idle()
            assert len(session.steps(motor)[0]) > 5
            assert [n for n in session.positions if len(session.steps(n)[0])] == [motor]
        for motor in session.positions:
            session.accept(p.MotorSetLimits(motor, 0, 0, 0, 0, 0))
    assert not session.events(p.HardStop)


@pytest.mark.parametrize(
    "request_",
    [p.VirtMove(2, 60 * 100000), p.VirtJog(2, 10_000, FAR), p.VirtJogOnLine(m.LINE_X, 10_000)],
    ids=str,
)
def test_a_lower_velocity_set_under_way_is_soon_kept(request_):
    """The rig reaches it by a ramp within the acceleration, and the requested motion continues."""
    session = configured(NODAL, 20_000, 40_000)
    session.accept(request_)
    for _ in range(8):
        session.run(0.1)
        if isinstance(request_, p.VirtJog):
            session.accept(request_)
    assert len(session.steps(1)[0]) > 5000
    session.forget().speed(1, 2000, 40_000)
    since = session.now
    if isinstance(request_, p.VirtJog):
        hold(session, request_, 3)
    else:
        session.run(3)
    assert session.moving
    times, signs = session.steps(1)
    assert_within(times, signs, 20_000, 40_000)
    late = times[times > since + 1.2]
    assert 3000 < len(late) <= 3700
    assert np.diff(late).min() > 1 / 2000
    # the former velocity does not return by itself, but a request brings it back
    session.speed(1, 20_000, 40_000).accept(p.VirtStop(m.VIRT_MOTOR_EW)).wait_idle()
    assert not session.events(p.HardStop)
    session.forget().accept(p.VirtMove(m.VIRT_MOTOR_EW, 0)).wait_idle()
    assert 1 / np.diff(session.steps(1)[0]).min() > 19_000


@pytest.mark.parametrize(
    "jog", [p.VirtJog(2, 10_000, FAR), p.VirtJogOnLine(m.LINE_X, 10_000)], ids=str
)
def test_a_lower_acceleration_set_under_way_counts_for_the_next_motion(jog):
    """Like a motor's own moves: the stop was planned with the earlier acceleration."""
    session = configured(NODAL, 20_000, 40_000)
    session.accept(p.MotorSetLimits(1, 1, -100, 1, 15_000, 0), jog).run(0.4)
    session.speed(1, 20_000, 10_000)
    hold(session, jog, 3)
    assert session.moving == []
    times, signs = session.steps(1)
    assert_within(times, signs, 20_000, 40_000)
    assert max(np.cumsum(signs)) == pytest.approx(15_000, abs=1)
    assert max(np.cumsum(signs)) <= 15_000
    session.forget().accept(p.VirtMove(m.VIRT_MOTOR_EW, 10 * 100000)).wait_idle()
    assert_within(*session.steps(1), 20_000, 10_000)


@pytest.mark.parametrize(
    "stop", [p.VirtStop(m.VIRT_MOTOR_EW), p.MotorStop(1), p.MotorStopAll()], ids=str
)
@pytest.mark.parametrize("delay_s", [0.0, 0.05, 0.3])
def test_a_jog_asked_for_again_while_it_stops_begins_anew(stop, delay_s):
    """A key is released and pressed again: an acknowledged request moves the rig."""
    session = configured(XYZ, 10_000, 10_000)
    for jog in (p.VirtJogOnLine(m.LINE_X, 10_000), p.VirtJog(m.VIRT_MOTOR_EW, 10_000, FAR)):
        session.accept(jog).run(0.45)
        session.accept(stop).run(delay_s)
        session.accept(jog)
        for _ in range(3):
            session.run(0.25).forget()
            if isinstance(jog, p.VirtJog):
                session.accept(jog)
        session.run(0.25)
        assert len(session.steps(1)[0]) > 100
        assert min(session.steps(1)[1]) == 1
        session.accept(p.VirtStop(m.VIRT_MOTOR_EW)).wait_idle().run(1)  # no second STOP_ALL


def test_the_end_of_one_jog_is_not_that_of_the_next():
    """A second key is pressed, then the first released."""
    session = configured(XYZ, 10_000, 10_000)
    session.accept(p.VirtJogOnLine(m.LINE_X, 10_000)).run(0.45)
    session.accept(p.VirtJogOnLine(m.LINE_Y, 10_000)).run(0.05)
    session.accept(p.VirtStop(m.VIRT_MOTOR_EW)).run(1)
    assert session.made(2) > 900
    session.accept(p.VirtStop(m.VIRT_MOTOR_NS)).wait_idle()
