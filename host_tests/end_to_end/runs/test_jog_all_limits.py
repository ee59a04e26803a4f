"""JOG_ALL keeps the limits of the motors: it slows down, or stops on a frame."""

import numpy as np
import pytest

from framestep.protocol.messages import (
    EXCEEDED_BOARD,
    EXCEEDED_SLOWED,
    MOTOR_ENABLED,
    MOTOR_LIVE,
)
from framestep_tools import payloads as p
from host_tests.end_to_end.realtime import rig, upload
from host_tests.end_to_end.runs.moves import (
    ACCELERATION,
    PATH,
    PATH_FRAMES,
    PER_FRAME,
    K,
    assert_followed,
    assert_on_frame,
)
from host_tests.end_to_end.session import assert_within, velocities
from host_tests.selection import sweep


def test_limits(standing):
    """Nothing moves if a limit is in the way."""
    standing.speed(1, 1000, 100_000).accept(p.MotorSetLimits(1, 0, 0, 1, 15_000))
    standing.refuse(p.Ack.ERR_SOFT_UP, p.RtJogAll(9000, 200))
    standing.accept(p.MotorSetLimits(1, 1, 11_000, 0, 0))
    standing.refuse(p.Ack.ERR_SOFT_LOW, p.RtJogAll(9000, 20)).run(0.2)
    assert not standing.trace().motors
    standing.accept(p.RtJogAll(9000, 131))
    # and in motion it continues to its destination
    standing.run(0.3).refuse(p.Ack.ERR_SOFT_LOW, p.RtJogAll(9000, 20)).wait_idle()
    assert_on_frame(standing, 130)


SLOWED = {  # motor, velocity, acceleration: the rate at which the motors can follow
    "velocity": (1, 1000, 100_000, 10),
    "where the path is steepest": (2, 900, 100_000, 6),
    "the ramp": (1, 20_000, 390, 7.8**0.5),
    "a gentle ramp": (1, 20_000, 50, 1),
    "the bend of the path": (2, 20_000, 1100, 8),
    "next to nothing": (1, 10, 100_000, 0.1),
}


@pytest.mark.parametrize("case", SLOWED)
@pytest.mark.parametrize("to", [200, 20])
def test_slows_down_to_what_the_motors_can_follow(standing, case, to):
    """Field note 5.5: no refusal, but as slow as the most limited motor requires."""
    motor, velocity, acceleration, rate = SLOWED[case]
    if rate < 1:
        to = 121 + (to > 121) - (to < 121)
    standing.speed(motor, velocity, acceleration).accept(p.RtJogAll(12000, to))
    begun = standing.now
    standing.client.wait_idle(200, 0.05)
    assert_on_frame(standing, to - 1)
    assert_followed(standing, 120, 12)
    assert_within(*standing.steps(motor), velocity * 1.01, acceleration * 1.02, window=0.2)
    # but not slower than that
    way = abs(to - 121)
    top = min(rate, (ACCELERATION * way) ** 0.5)
    ideal = way / top + top / ACCELERATION
    assert standing.steps(1)[0][-1] - begun <= ideal * 1.08 + max(2 / top, 0.2)


@pytest.mark.with_reports
@pytest.mark.parametrize("to", [200, 20])
def test_only_the_frames_between_count(standing, to):
    """Motor 3 is steep, but on other frames."""
    upload(
        standing,
        {**PATH, 3: np.where(K < 15, K * 3000 - 42_000, np.clip(K - 205, 0, None) * 3000)},
        frames=PATH_FRAMES,
    )
    standing.speed(3, 1000, 100_000).accept(p.RtPositionFrame(121)).wait_idle()
    standing.forget().accept(p.RtJogAll(12000, to)).run(4)
    rate = np.count_nonzero(standing.steps(1)[0] > standing.now - 0.5) / 0.5 / PER_FRAME
    assert rate == pytest.approx(12, rel=0.02)


@pytest.mark.long
@pytest.mark.parametrize("grain", sweep(range(10), 0, 9))
def test_slows_down_under_way(grain):
    """It continues into frames that it can follow only at less than its speed: it has slowed down
    before them."""
    session = rig()
    gathering = np.cumsum(100 + 10 * np.clip(K - 150, 0, 50)) - 100
    upload(session, {1: gathering}, frames=PATH_FRAMES)
    session.speed(1, 400, 3000).accept(p.RtPositionFrame(131)).wait_idle()
    session.forget().accept(p.RtJogAll(12000, 151)).run(2 + 0.42 * grain)
    assert session.moving
    session.accept(p.RtJogAll(12000, 221)).run(15)
    # there and back, at the speed of the present frames
    session.accept(p.RtJogAll(12000, 140), p.RtJogAll(12000, 201))
    session.client.wait_idle(300, 0.05)
    assert session.position(1) == gathering[200]
    assert_within(*session.steps(1), 400 * 1.01, 3000 * 1.02, window=0.2)


def test_slows_down_for_what_is_set_before_it_begins(standing):
    """A lower velocity, set while the motors take up their play (field note 6.12)."""
    standing.speed(1, 1000, 100_000).accept(p.RtJogAll(12000, 141))
    standing.client.wait_idle(60, 0.05)
    standing.speed(1, 200, 100_000).forget().accept(p.RtJogAll(12000, 121))
    standing.client.wait_idle(60, 0.05)
    assert_within(*standing.steps(1), 200 * 1.002, 400, window=0.2)


def test_what_no_rate_can_make(standing):
    """A frame takes 1000 s at most: nothing moves if a motor needs longer."""
    upload(standing, {1: K * 10_010, 2: 0 * K}, frames=PATH_FRAMES)
    standing.accept(p.RtPositionFrame(121)).wait_idle().speed(1, 10, 100_000).forget()
    standing.refuse(p.Ack.ERR_RANGE, p.RtJogAll(12000, 200), p.RtJogAll(1, 122)).run(0.2)
    assert not standing.trace().motors
    assert standing.client.request(p.GetExceeded()).what == EXCEEDED_BOARD


CORNERS = {
    "one frame": 200 * np.clip(K - 3, 0, 1),
    "into motion": 200 * np.clip(K - 3, 0, 20),
    "to and fro": 100 * (K % 2),
    "a fast swing": np.round(1000 * np.sin(K * 0.9)).astype(int),
    "anywhere": np.random.default_rng(3).integers(-300, 300, PATH_FRAMES),
    "jumps among small steps": np.cumsum(np.where(K % 7 == 3, 900, 5)),
}


@pytest.mark.parametrize("corners", CORNERS)
@pytest.mark.parametrize(("velocity", "acceleration"), [(1000, 100_000), (20_000, 2000)])
@pytest.mark.parametrize("play", [0, 40])
def test_keeps_the_limits_at_corners(corners, velocity, acceleration, play):
    """Also on the curve between frames, where the cubic is faster than its mean and steeper than
    its corner: in acceleration, turns, stops anywhere and continuations."""
    session = rig(motors=[{"backlash": play}, {}]) if play else rig()
    upload(session, {1: CORNERS[corners][:61]}, frames=61)
    session.speed(1, velocity, acceleration).accept(p.RtPositionFrame(1)).wait_idle().forget()
    for to, after in ((61, 7.3), (1, 3.1), (40, 2.77)):
        session.accept(p.RtJogAll(24000, to)).run(after)
        session.accept(p.MotorStopAll())
        session.client.wait_idle(30, 0.05)
        session.run(1.1)
    session.accept(p.RtJogAll(24000, 61)).run(3)
    session.accept(p.RtJogAll(24000, 3))
    session.client.wait_idle(300, 0.05)
    assert session.position(1) == CORNERS[corners][2]
    times, signs = session.steps(1)
    assert np.diff(times).min() >= 1 / (1.01 * velocity + 24)
    # the second difference of places, each exact to a step
    window = 0.1 if acceleration < 10_000 else 0.02
    rates, _ = velocities(times, signs, window)
    assert np.abs(np.diff(rates)).max() / window <= acceleration * 1.02 + 2 / window**2


@pytest.mark.parametrize("grain", sweep(range(8), 0, 5))
def test_stopped_just_before_a_turn(grain):
    """The backlash is taken up for the motion after the turn, even if the last part before the turn
    coincides with it."""
    session = rig(motors=[{"backlash": 40}, {}])
    positions = CORNERS["anywhere"][:61]
    upload(session, {1: positions}, frames=61)
    session.speed(1, 20_000, 2000).accept(p.RtPositionFrame(3)).wait_idle()
    session.accept(p.RtJogAll(24000, 40))
    while session.ask_positions().move_time < 3930 + 8 * grain:
        session.run(0.004)
    session.accept(p.MotorStopAll())
    session.client.wait_idle(30, 0.05)
    reported = session.ask_positions()
    assert reported.steps[0] == positions[reported.move_time // 1000 - 1]
    session.accept(p.RtJogAll(24000, 1))


def test_what_slows_it_down_is_reported(standing):
    standing.speed(2, 900, 100_000).accept(p.RtJogAll(5000, 200))
    reported = standing.client.request(p.GetExceeded())
    assert reported.what == 0
    standing.accept(p.RtJogAll(12000, 200)).run(2)
    reported = standing.client.request(p.GetExceeded())
    assert (reported.what, reported.motor) == (EXCEEDED_SLOWED, 2)
    assert reported.by == pytest.approx(6000, rel=0.02)
    assert abs(PATH[2][reported.frame - 1] - PATH[2][reported.frame - 2]) == pytest.approx(
        150, abs=2
    )


def test_motors_without_a_part(standing):
    standing.accept(p.MotorConfigure(2, 0), p.RtJogAll(12000, 130)).wait_idle()
    assert standing.trace().motors == [1]
    standing.accept(p.MotorConfigure(1, 0))
    standing.refuse(p.Ack.ERR_NOT_IN_POSITION, p.RtJogAll(12000, 121))


def test_limit_switches():
    """Refused if it would begin by moving further into a limit, however long the motor rests
    before that."""
    session = rig(limits=[{"high": 22, "contact": "no"}], outputs=[], inputs=[])
    held = np.clip(20 * (K - 150), 0, None)  # holds until frame 151
    upload(session, {**PATH, 3: held}, frames=PATH_FRAMES)
    session.accept(p.MotorSetLimits(3, 0, 0, 0, 0, 1), p.RtPositionFrame(121)).wait_idle()
    session.input(22, 0).run(0.05).forget()
    session.refuse(p.Ack.ERR_HARD_UP, p.RtJogAll(9000, 200), p.RtJogAll(9000, 152))
    session.accept(p.RtJogAll(9000, 121), p.RtJogAll(9000, 151))  # not that far
    session.wait_idle().accept(p.RtJogAll(9000, 20)).wait_idle()
    assert session.position(1) == 1900
    assert session.made(3) == 0
    session.accept(p.MotorSetLimits(3, 0, 0, 0, 0, 0x81), p.RtJogAll(9000, 155)).wait_idle()
    session.refuse(p.Ack.ERR_HARD_LOW, p.RtJogAll(9000, 20))
    session.accept(p.RtJogAll(9000, 160)).wait_idle()
    assert session.position(3) == held[159]


def test_a_limit_switch_of_a_motor_that_is_left_out():
    """A motor under live control does not move, so its switch refuses nothing."""
    session = rig(limits=[{"high": 22, "contact": "no"}], outputs=[], inputs=[])
    upload(session, {**PATH, 3: 20 * K}, frames=PATH_FRAMES)
    session.accept(p.MotorSetLimits(3, 0, 0, 0, 0, 1), p.RtPositionFrame(121)).wait_idle()
    session.input(22, 0).run(0.05).forget().refuse(p.Ack.ERR_HARD_UP, p.RtJogAll(9000, 200))
    session.accept(p.MotorConfigure(3, MOTOR_ENABLED | MOTOR_LIVE))
    here = session.position(3)
    session.accept(p.RtJogAll(9000, 140)).wait_idle()
    assert session.position(1) == PATH[1][139]
    assert session.position(3) == here
