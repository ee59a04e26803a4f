"""Virtual moves keep the limits of each motor: soft limits, switches, velocity with backlash."""

import numpy as np
import pytest

from framestep.protocol import messages as m
from framestep_tools import payloads as p
from host_tests.end_to_end.session import assert_within, simulated
from host_tests.end_to_end.virtual_axes.judging import BOOM, NODAL, XYZ, Track, configured, pose


def limits(low=None, high=None, motor=1):
    return p.MotorSetLimits(motor, low is not None, low or 0, high is not None, high or 0, 0)


def test_soft_limits_on_the_way():
    """For any motor anywhere on the path the request is refused before anything moves. A motor past
    its limit may return."""
    session = configured(NODAL)
    session.accept(limits(-500, 500))
    session.refuse(p.Ack.ERR_SOFT_UP, p.VirtMove(2, round((pose(session)[1] + 1) * 100000)))
    session.refuse(p.Ack.ERR_SOFT_LOW, p.VirtMove(2, round((pose(session)[1] - 1) * 100000)))
    # a turn of the camera about its nodal point moves the carriage to one side and back
    session.refuse(p.Ack.ERR_SOFT_UP, p.VirtMove(4, round((pose(session)[3] + 180) * 100000)))
    session.run(0.5)
    assert session.made(1) == 0
    assert session.moving == []
    session.accept(limits(-500, -200))
    session.refuse(p.Ack.ERR_SOFT_UP, p.VirtMove(2, round((pose(session)[1] + 0.01) * 100000)))
    session.accept(p.VirtMove(2, round((pose(session)[1] - 0.1) * 100000))).wait_idle()
    assert session.position(1) == -100


def test_a_motor_in_a_limit_switch():
    session = simulated({"limits": [{"high": 22, "low": 26, "contact": "no"}]})
    session.accept(p.VirtConfig.unpack(XYZ.payload()), p.MotorSetLimits(2, 0, 0, 0, 0, 1))
    session.input(22, 0).run(0.05).refuse(p.Ack.ERR_HARD_UP, p.VirtMove(3, -19 * 100000))
    session.accept(p.VirtMove(3, -21 * 100000)).wait_idle()
    assert session.position(2) == -1000


def test_backlash_is_taken_up_before_the_line_begins():
    """The load is at rest until all motors are ready; no motor exceeds its acceleration, or turns
    on the way."""
    session = configured(BOOM, settings={"motors": [{"backlash": 300}] * 6})
    for target in (250, 150, 180):
        before = session.positions
        session.forget().accept(p.VirtMove(m.VIRT_MOTOR_EW, target * 100000))
        if target == 180:
            session.run(0.6).accept(p.VirtStop(m.VIRT_MOTOR_EW))
        session.wait_idle()
        after = session.positions
        track = Track(session, before)
        track.limits(20_000, 50_000)
        for motor, (_, signs) in track.steps.items():
            moved = after[motor] - before[motor]
            assert len(signs) in (abs(moved), abs(moved) + 300), (
                f"motor {motor} has turned on the way"
            )


LOOSE = {"motors": [{"backlash": 200}] * 6}


@pytest.mark.parametrize("stop_s", [0.02, 0.15, 0.6, None])
@pytest.mark.parametrize(
    "request_",
    [
        p.VirtMove(m.VIRT_MOTOR_EW, 60 * 100000),
        p.VirtMove(m.VIRT_MOTOR_NS, -40 * 100000),
        p.VirtJog(m.VIRT_MOTOR_EW, 10_000, 3000),
        p.VirtJog(m.VIRT_MOTOR_PAN, 5000, -3000),
        p.VirtJogOnLine(m.LINE_Y, 10_000),
        p.VirtJogOnLine(m.LINE_X, -10_000),
    ],
    ids=str,
)
@pytest.mark.parametrize(
    # An x-y-z rig needs a thousand steps for a unit, and none of its motors turns on a straight
    # line: a fifth of the distance has the same start, seconds of cruise, and the same end.
    ("rig", "share"),
    [(BOOM, 1.0), (NODAL, 0.2)],
    ids=["boom", "x-y-z"],
)
def test_play_costs_no_motor_its_limits(rig, share, request_, stop_s):
    """Neither at the start, nor at a motor's turn, nor at the end; at rest everything is as
    requested."""
    session = configured(rig, 2000, 20_000, settings={**LOOSE, "jog_timeout_ms": 0})
    if isinstance(request_, p.VirtMove):
        request_ = p.VirtMove(request_.motor, round(share * request_.position))
    back = p.VirtMove(m.VIRT_MOTOR_EW, 100000 * round(pose(session)[1] - 20 * share))
    for k, request in enumerate((request_, back)):
        before = session.positions
        session.forget().accept(request)
        if k == 0 and (stop_s or isinstance(request, p.VirtJogOnLine)):
            session.run(stop_s or 2).accept(p.MotorStopAll())
        session.wait_idle()
        assert not session.events(p.HardStop)
        for motor in range(1, 7):
            times, signs = session.steps(motor)
            if len(times) > 2:
                assert_within(times, signs, 2000, 20_000)
            moved = session.position(motor) - before[motor]
            assert abs(moved - signs.sum()) <= 200, "the load is at most the play from the motor"
        if stop_s is None or k == 1:
            now = pose(session)
            if isinstance(request, p.VirtMove):
                assert now[request.motor - 1] == pytest.approx(request.position / 100000, abs=0.03)


def test_a_motor_that_turns_on_the_way_takes_up_its_play_in_the_end():
    """The track of a boom moves forth and back while the camera passes the column's side; it ends
    at its target."""
    session = configured(BOOM, 4000, 20_000, settings=LOOSE)
    session.accept(p.VirtMove(m.VIRT_MOTOR_EW, -190 * 100000)).wait_idle()
    before = session.positions
    session.forget().accept(p.VirtMove(m.VIRT_MOTOR_EW, 210 * 100000)).wait_idle()
    track = Track(session, before)
    track.limits(4000, 20_000)
    turned = np.flatnonzero(np.diff(session.steps(3)[1]))
    assert len(turned) >= 1
    rest = BOOM.steps(BOOM.inverse(BOOM.from_host([3100, 210, 3, -10, -3, 0]), np.zeros(6)))
    assert [session.position(motor) for motor in range(1, 7)] == np.round(rest).tolist()


@pytest.mark.parametrize("stop_s", [1.5, 2.45], ids=["on-the-line", "at-its-end"])
def test_no_motor_takes_up_its_play_after_stop_all(stop_s):
    """The track turns on the line, and takes up its play at the end, here for ten seconds; but
    nothing moves on after a STOP_ALL."""
    session = configured(BOOM, 4000, 20_000, settings=LOOSE)
    session.accept(p.VirtMove(m.VIRT_MOTOR_EW, -190 * 100000)).wait_idle().forget()
    session.accept(p.VirtMove(m.VIRT_MOTOR_EW, 210 * 100000)).run(stop_s)
    assert np.diff(session.steps(3)[1]).any()
    session.speed(3, 20, 20_000).accept(p.MotorStopAll()).run(1)
    assert session.moving == []
    assert not session.events(p.HardStop)


@pytest.mark.needs("ramped E-stop", only=("E-stop",))
@pytest.mark.parametrize(
    ("pin", "low", "high"),
    [pytest.param(22, 1, 0, id="switch"), pytest.param("estop", 0, 1, id="E-stop")],
)
def test_a_limit_switch_or_the_e_stop_in_a_move(pin, low, high):
    """All motors of the rig come to rest, each by its own ramp, and the one at the switch by a hard
    stop."""
    session = simulated({"limits": [{"high": 22, "low": 26, "contact": "no"}], "estop": "nc"})
    session.input("estop", 0).run(0.1)
    for motor in range(1, 7):
        session.speed(motor, 20_000, 50_000)
    session.accept(p.VirtConfig.unpack(XYZ.payload()), p.MotorSetLimits(3, 0, 0, 0, 0, 1)).forget()
    session.accept(p.VirtMove(m.VIRT_MOTOR_TRACK, 400 * 100000)).run(0.8)
    struck = session.now
    session.input(pin, high).run(1.0)
    assert session.moving == []
    assert len(session.events(p.HardStop)) == 1
    assert session.steps(3)[0][-1] - struck < 20_000 / 50_000 / 4 + 0.02
    session.refuse(
        p.Ack.ERR_GENERAL if pin == "estop" else p.Ack.ERR_HARD_UP, p.VirtMove(1, 500 * 100000)
    )
    session.input(pin, low)
    session.run(0.1).accept(p.VirtMove(m.VIRT_MOTOR_TRACK, 300 * 100000)).wait_idle()
    assert session.position(3) == 0
