"""JOG_ALL on the host simulation: along the path as one axis, frames as its unit (field note
6.10)."""

import numpy as np
import pytest

from framestep.protocol.messages import EXCEEDED_BOARD, EXCEEDED_SLOWED
from framestep_tools import payloads as p
from host_tests.end_to_end.realtime import rig, upload
from host_tests.end_to_end.session import assert_within, run_request, velocities

FRAMES = 241
K = np.arange(FRAMES)
PATH = {1: 100 * K, 2: np.round(3000 * np.sin(K * 0.05)).astype(int)}
PER_FRAME = 100
ACCELERATION = 4.0  # frames/s²


@pytest.fixture
def standing():
    """On frame 121 of 1 … 241, index 120."""
    session = rig()
    upload(session, PATH, frames=FRAMES)
    session.accept(p.RtPositionFrame(121))
    session.wait_idle()
    session.forget()
    return session


def indices(session):
    """The frame, as a fraction, that motor 1 stands on: it makes PER_FRAME steps from one to the
    next."""
    return session.position(1) / PER_FRAME


def assert_followed(session, start, fps):
    """All edges since then lie on the path, one axis within its velocity and acceleration."""
    times, signs = session.steps(1)
    assert_within(times, signs, fps * PER_FRAME * 1.002, ACCELERATION * PER_FRAME, window=0.2)
    frames = start + np.cumsum(signs) / PER_FRAME
    at, turned = session.steps(2)
    places = int(PATH[2][start]) + np.concatenate(([0], np.cumsum(turned)))
    for time, frame in zip(
        times[frames == np.round(frames)], frames[frames == np.round(frames)], strict=True
    ):
        # the moment at which motor 1 makes the frame's step
        near = places[np.searchsorted(at, time - 2e-5) : np.searchsorted(at, time + 2e-5) + 1]
        assert np.abs(near - PATH[2][round(frame)]).min() <= 1, frame
    assert not session.events(p.RtEnd), "JOG_ALL has no RT_END"


def assert_on_frame(session, index):
    assert indices(session) == index
    assert session.position(2) == PATH[2][index]
    assert session.ask_positions().move_time == (index + 1) * 1000


def test_frame_by_frame(standing):
    """To a neighbour: from rest to rest in a second, half of it up and half of it down."""
    at = 120
    for step in (1, 1, -1, -1, -1):
        standing.accept(p.RtJogAll(24000, at + step + 1))
        assert standing.moving == [1, 2]
        begun = standing.now
        standing.wait_idle()
        at += step
        assert_on_frame(standing, at)
        times, _ = standing.steps(1)
        assert times[-1] - begun == pytest.approx(1.0, abs=0.02)
    assert_followed(standing, 120, 24)


@pytest.mark.parametrize("fps", [0.2, 1, 6, 24])
@pytest.mark.parametrize("way", [5, -60, 110])
def test_at_speed(standing, fps, way):
    if fps < 1 and abs(way) > 5:
        way = 3 if way > 0 else -3
    standing.accept(p.RtJogAll(round(fps * 1000), 121 + way))
    begun = standing.now
    standing.client.wait_idle(200, 0.05)
    assert_on_frame(standing, 120 + way)
    assert_followed(standing, 120, fps)
    # as fast as the axis allows, but that the first and the last frame are a ramp each: twice as
    # long as the others
    top = min(fps, (ACCELERATION * abs(way)) ** 0.5)
    ideal = abs(way) / top + top / ACCELERATION
    times, _ = standing.steps(1)
    assert times[-1] - begun <= ideal * 1.05 + max(2 / top, 0.2)


@pytest.mark.parametrize("after", [0.3, 0.9, 2.0, 4.1])
def test_reversed_on_the_way(standing, after):
    """To somewhere behind: on to the first frame where it can end, then back."""
    standing.accept(p.RtJogAll(12000, 200))
    standing.run(after)
    standing.accept(p.RtJogAll(12000, 60))
    while standing.moving:
        standing.run(0.05)
    assert_on_frame(standing, 59)
    assert_followed(standing, 120, 12)
    _, signs = standing.steps(1)
    assert np.count_nonzero(np.diff(signs)) == 1, "it turned once"
    turn = 120 + signs[: np.flatnonzero(np.diff(signs))[0] + 1].sum() / PER_FRAME
    assert turn == round(turn), "on a whole frame"


def test_new_destinations_under_way(standing):
    """Farther, nearer, beyond the turn and there again, and in every moment of a turn."""
    rng = np.random.default_rng(7)
    standing.accept(p.RtJogAll(12000, 160))
    last = 160
    for _ in range(12):
        standing.run(rng.random() * 1.5)
        last = int(rng.integers(20, 220))
        standing.accept(p.RtJogAll(int(rng.integers(1, 13)) * 1000, last))
    standing.client.wait_idle(200, 0.05)
    standing.run(0.1)
    assert_on_frame(standing, last - 1)
    assert_followed(standing, 120, 12)


@pytest.mark.parametrize("grain", range(8))
def test_a_request_in_each_millisecond_of_a_turn(standing, grain):
    """The moment in which it stands and is about to go back is no other than the rest."""
    standing.accept(p.RtJogAll(12000, 130))
    standing.run(0.3)
    standing.accept(p.RtJogAll(12000, 115))
    while standing.steps(1)[1][-1:].tolist() != [-1]:
        before = standing.now
        standing.run(0.001)
        if (
            standing.steps(1)[1].sum() in (PER_FRAME, 2 * PER_FRAME)
            and before - standing.steps(1)[0][-1] > 0.0005 * grain
        ):
            standing.accept(p.RtJogAll(12000, (121, 122, 123, 118, 140, 119, 120, 124)[grain]))
            break
    standing.wait_idle()
    assert indices(standing) == round(indices(standing))
    assert indices(standing) + 1 in (121, 122, 123, 118, 140, 119, 120, 124, 115)
    assert_followed(standing, 120, 12)


def test_lower_and_higher_speed_under_way(standing):
    """A new FPS is come to by the axis' acceleration, up or down."""
    standing.accept(p.RtJogAll(10000, 200))
    standing.run(3.5)
    standing.accept(p.RtJogAll(2000, 200))
    standing.run(3)
    rate = np.count_nonzero(standing.steps(1)[0] > standing.now - 0.5) / 0.5 / PER_FRAME
    assert rate == pytest.approx(2, rel=0.02)
    standing.accept(p.RtJogAll(5000, 200))
    standing.client.wait_idle(60, 0.05)
    assert_on_frame(standing, 199)
    assert_followed(standing, 120, 10)


@pytest.mark.parametrize("fps", [0.1, 0.2, 0.6, 1.1, 2, 3, 12, 60])
@pytest.mark.parametrize("after", [0.02, 0.5, 1.1, 1.75, 3.3])
@pytest.mark.parametrize("request_", [p.MotorStopAll(), p.MotorStop(2)])
def test_stop_lands_on_a_frame(standing, fps, after, request_):
    """Field note 6.10: on the next one that can be reached at 4 frames/s², or at a frame per second
    where that takes more than 2 s. A STOP of one motor stops the axis."""
    standing.accept(p.RtJogAll(round(fps * 1000), 220))
    standing.run(after)
    times, signs = standing.steps(1)
    rate = velocities(times, signs, 0.1)[0][-1] / PER_FRAME if len(times) > 30 else 0
    before = 120 + signs.sum() / PER_FRAME
    standing.accept(request_)
    begun = standing.now
    standing.client.wait_idle(30, 0.02)
    times, signs = standing.steps(1)
    at = indices(standing)
    assert at == round(at)
    assert at >= 121
    assert_on_frame(standing, round(at))
    assert_followed(standing, 120, max(fps, 1))
    # 0.05 s pass until it acts; what a queued ramp up still adds is little
    rate += 0.05 * ACCELERATION
    assert at - before <= 1 + rate * 0.06 + rate**2 / (2 * ACCELERATION) + 0.05
    assert times[-1] - begun <= max(
        2.1, 0.1 + 2 * (at - before) / max(rate - 0.2, 0.1) if rate > 1.2 else 2.1
    )
    # it stands on a frame: it may go on from there, on its own
    standing.accept(p.RtJogAll(12000, 121))
    standing.client.wait_idle(60, 0.05)
    assert_on_frame(standing, 120)


def test_a_stop_keeps_the_limits_of_the_motors(standing):
    """Of motors that can follow a slow axis, but not one at a frame per second."""
    standing.speed(1, 40, 60)
    standing.accept(p.RtJogAll(300, 140))
    standing.run(5.1)
    standing.accept(p.MotorStopAll())
    standing.client.wait_idle(30, 0.02)
    assert_on_frame(standing, round(indices(standing)))
    assert_within(*standing.steps(1), 40 * 1.01, 60 * 1.02, window=0.3)


@pytest.mark.parametrize("fps", [0.3, 12])
@pytest.mark.parametrize("later", [0, 0.4, 1.05])
def test_second_stop_all_while_it_lands(standing, fps, later):
    """Field note 6.10: it is the hard stop, whenever it comes."""
    standing.accept(p.RtJogAll(round(fps * 1000), 220))
    standing.run(3.3)
    standing.accept(p.MotorStop(1))
    standing.run(0.05)
    standing.accept(p.MotorStopAll())
    standing.run(later)
    assert standing.moving
    standing.accept(p.MotorStopAll())
    standing.run(0.1)
    assert not standing.moving
    assert indices(standing) != round(indices(standing))


def test_second_stop_all_is_hard(standing):
    standing.accept(p.RtJogAll(20000, 220))
    standing.run(4)
    standing.accept(p.MotorStopAll(), p.MotorStopAll())
    asked = standing.now
    standing.run(0.3)
    assert not standing.moving
    times, _ = standing.steps(1)
    assert times[-1] - asked < 0.02
    standing.refuse(p.Ack.ERR_NOT_IN_POSITION, p.RtJogAll(24000, 1))
    assert not standing.events(p.RtEnd)


def test_refused(standing):
    """Numbers out of range, not on a frame, in a run; nothing moves."""
    standing.refuse(
        p.Ack.ERR_RANGE, p.RtJogAll(24000, 0), p.RtJogAll(24000, FRAMES + 1), p.RtJogAll(0, 5)
    )
    standing.refuse(
        p.Ack.ERR_RANGE,
        p.RtJogAll(200001, 5),
        p.RtJogAll(2**32 - 1, 5),
        p.RtJogAll(24000, -(2**31)),
    )
    assert standing.ask(p.MotorMove(2, standing.position(2) + 1))
    assert standing.wait_idle() is None
    standing.forget()
    standing.refuse(p.Ack.ERR_NOT_IN_POSITION, p.RtJogAll(24000, 121))
    standing.run(0.2)
    assert not standing.trace().motors
    standing.ask(p.MotorMove(5, 2000))
    standing.refuse(p.Ack.ERR_MOVING, p.RtJogAll(24000, 121))
    standing.wait_idle()
    standing.accept(p.RtPositionFrame(9))
    standing.refuse(p.Ack.ERR_MOVING, p.RtJogAll(24000, 121))
    standing.wait_idle()
    standing.accept(p.RtJogAll(24000, 12))
    standing.wait_idle()
    standing.speed(2, 20000, 1_000_000)
    standing.ready(run_request(24, 100, 110))
    standing.refuse(p.Ack.ERR_NOT_IN_POSITION, p.RtJogAll(24000, 12))
    standing.accept(p.RtGo())
    standing.refuse(p.Ack.ERR_MOVING, p.RtJogAll(24000, 121))


def test_too_far_to_be_checked_under_way():
    """ERR_MOVING, and the jog goes on to where it was going; from rest there is time to check the
    way."""
    frames = 3600
    session = rig()
    upload(session, {1: 10 * np.arange(frames), 2: -7 * np.arange(frames)}, frames=frames)
    session.accept(p.RtPositionFrame(1))
    session.wait_idle()
    session.accept(p.RtJogAll(24000, 60))
    session.run(0.5)
    session.refuse(p.Ack.ERR_MOVING, p.RtJogAll(24000, 3500))
    session.accept(p.RtJogAll(24000, 70))
    session.wait_idle()
    assert [session.position(1), session.position(2)] == [690, -483]
    session.accept(p.RtJogAll(24000, 3500))
    session.run(1)
    session.accept(p.MotorStopAll())
    session.wait_idle()
    frame = session.position(1) / 10
    assert frame == round(frame) > 72
    assert session.position(2) == -7 * frame


def test_where_it_stands_is_found_by_positions(standing):
    """On whatever frame, however it came there."""
    standing.ask(p.MotorMove(1, int(PATH[1][77])))
    standing.ask(p.MotorMove(2, int(PATH[2][77])))
    standing.wait_idle()
    standing.forget()
    standing.accept(p.RtJogAll(12000, 80))
    standing.wait_idle()
    assert_on_frame(standing, 79)
    assert_followed(standing, 77, 12)
    standing.accept(
        p.MotorResetPosition(1, int(PATH[1][3])), p.MotorResetPosition(2, int(PATH[2][3]))
    )
    standing.accept(p.RtJogAll(12000, 1))
    standing.wait_idle()
    assert_on_frame(standing, 0)


def test_there_already(standing):
    standing.accept(p.RtJogAll(24000, 121))
    assert not standing.moving
    standing.run(0.2)
    assert not standing.trace().motors
    assert not standing.events(p.RtEnd)


def test_limits(standing):
    """Nothing moves where a limit lies on the way."""
    standing.speed(1, 1000, 100_000)
    standing.accept(p.MotorSetLimits(1, 0, 0, 1, 15_000))
    standing.refuse(p.Ack.ERR_SOFT_UP, p.RtJogAll(9000, 200))
    standing.accept(p.MotorSetLimits(1, 1, 11_000, 0, 0))
    standing.refuse(p.Ack.ERR_SOFT_LOW, p.RtJogAll(9000, 20))
    standing.run(0.2)
    assert not standing.trace().motors
    standing.accept(p.RtJogAll(9000, 131))
    # and under way it goes on to where it was sent
    standing.run(0.3)
    standing.refuse(p.Ack.ERR_SOFT_LOW, p.RtJogAll(9000, 20))
    standing.wait_idle()
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
    """Field note 5.5: no refusal, but as slow as the motor with the least to spare needs it."""
    motor, velocity, acceleration, rate = SLOWED[case]
    if rate < 1:
        to = 121 + (to > 121) - (to < 121)
    standing.speed(motor, velocity, acceleration)
    standing.accept(p.RtJogAll(12000, to))
    begun = standing.now
    standing.client.wait_idle(200, 0.05)
    assert_on_frame(standing, to - 1)
    assert_followed(standing, 120, 12)
    assert_within(*standing.steps(motor), velocity * 1.01, acceleration * 1.02, window=0.2)
    # and no slower than that
    way = abs(to - 121)
    top = min(rate, (ACCELERATION * way) ** 0.5)
    ideal = way / top + top / ACCELERATION
    assert standing.steps(1)[0][-1] - begun <= ideal * 1.08 + max(2 / top, 0.2)


@pytest.mark.parametrize("to", [200, 20])
def test_only_the_frames_between_count(standing, to):
    """Motor 3 is steep, but elsewhere."""
    upload(
        standing,
        {**PATH, 3: np.where(K < 15, K * 3000 - 42_000, np.clip(K - 205, 0, None) * 3000)},
        frames=FRAMES,
    )
    standing.speed(3, 1000, 100_000)
    standing.accept(p.RtPositionFrame(121))
    standing.wait_idle()
    standing.forget()
    standing.accept(p.RtJogAll(12000, to))
    standing.run(4)
    rate = np.count_nonzero(standing.steps(1)[0] > standing.now - 0.5) / 0.5 / PER_FRAME
    assert rate == pytest.approx(12, rel=0.02)


@pytest.mark.parametrize("grain", range(10))
def test_slows_down_under_way(grain):
    """Sent on into frames that it can follow at less than its speed only: it has come down to that
    before them."""
    session = rig()
    gathering = np.cumsum(100 + 10 * np.clip(K - 150, 0, 50)) - 100
    upload(session, {1: gathering}, frames=FRAMES)
    session.speed(1, 400, 3000)
    session.accept(p.RtPositionFrame(131))
    session.wait_idle()
    session.forget()
    session.accept(p.RtJogAll(12000, 151))
    session.run(2 + 0.42 * grain)
    assert session.moving
    session.accept(p.RtJogAll(12000, 221))
    session.run(15)
    # there and back, at the speed of the frames it is in
    session.accept(p.RtJogAll(12000, 140), p.RtJogAll(12000, 201))
    session.client.wait_idle(300, 0.05)
    assert session.position(1) == gathering[200]
    assert_within(*session.steps(1), 400 * 1.01, 3000 * 1.02, window=0.2)


def test_slows_down_for_what_is_set_before_it_begins(standing):
    """A lower velocity, set while the motors take up their play (field note 6.12)."""
    standing.speed(1, 1000, 100_000)
    standing.accept(p.RtJogAll(12000, 141))
    standing.client.wait_idle(60, 0.05)
    standing.speed(1, 200, 100_000)
    standing.forget()
    standing.accept(p.RtJogAll(12000, 121))
    standing.client.wait_idle(60, 0.05)
    assert_within(*standing.steps(1), 200 * 1.002, 400, window=0.2)


def test_what_no_rate_can_make(standing):
    """A frame takes 1000 s at most: nothing moves where a motor needs longer."""
    upload(standing, {1: K * 10_010, 2: 0 * K}, frames=FRAMES)
    standing.accept(p.RtPositionFrame(121))
    standing.wait_idle()
    standing.speed(1, 10, 100_000)
    standing.forget()
    standing.refuse(p.Ack.ERR_RANGE, p.RtJogAll(12000, 200), p.RtJogAll(1, 122))
    standing.run(0.2)
    assert not standing.trace().motors
    assert standing.client.request(p.GetExceeded()).what == EXCEEDED_BOARD


CORNERS = {
    "one frame": 200 * np.clip(K - 3, 0, 1),
    "into motion": 200 * np.clip(K - 3, 0, 20),
    "to and fro": 100 * (K % 2),
    "a fast swing": np.round(1000 * np.sin(K * 0.9)).astype(int),
    "anywhere": np.random.default_rng(3).integers(-300, 300, FRAMES),
    "jumps among small steps": np.cumsum(np.where(K % 7 == 3, 900, 5)),
}


@pytest.mark.parametrize("corners", CORNERS)
@pytest.mark.parametrize(("velocity", "acceleration"), [(1000, 100_000), (20_000, 2000)])
@pytest.mark.parametrize("play", [0, 40])
def test_keeps_the_limits_at_corners(corners, velocity, acceleration, play):
    """On the curve between frames as well, where the cubic is faster than its mean and steeper than
    its corner: gathering speed, turning, stopping anywhere and going on."""
    session = rig(motors=[{"backlash": play}, {}]) if play else rig()
    upload(session, {1: CORNERS[corners][:61]}, frames=61)
    session.speed(1, velocity, acceleration)
    session.accept(p.RtPositionFrame(1))
    session.wait_idle()
    session.forget()
    for to, after in ((61, 7.3), (1, 3.1), (40, 2.77)):
        session.accept(p.RtJogAll(24000, to))
        session.run(after)
        session.accept(p.MotorStopAll())
        session.client.wait_idle(30, 0.05)
        session.run(1.1)
    session.accept(p.RtJogAll(24000, 61))
    session.run(3)
    session.accept(p.RtJogAll(24000, 3))
    session.client.wait_idle(300, 0.05)
    assert session.position(1) == CORNERS[corners][2]
    times, signs = session.steps(1)
    assert np.diff(times).min() >= 1 / (1.01 * velocity + 24)
    # what a second difference of places shows, to a step each
    window = 0.1 if acceleration < 10_000 else 0.02
    rates, _ = velocities(times, signs, window)
    assert np.abs(np.diff(rates)).max() / window <= acceleration * 1.02 + 2 / window**2


@pytest.mark.parametrize("grain", range(8))
def test_stopped_just_before_a_turn(grain):
    """The play is taken up for the way behind the turn, also where the last bit before it is one
    with that."""
    session = rig(motors=[{"backlash": 40}, {}])
    positions = CORNERS["anywhere"][:61]
    upload(session, {1: positions}, frames=61)
    session.speed(1, 20_000, 2000)
    session.accept(p.RtPositionFrame(3))
    session.wait_idle()
    session.accept(p.RtJogAll(24000, 40))
    while session.ask_positions().move_time < 3930 + 8 * grain:
        session.run(0.004)
    session.accept(p.MotorStopAll())
    session.client.wait_idle(30, 0.05)
    told = session.ask_positions()
    assert told.steps[0] == positions[told.move_time // 1000 - 1]
    session.accept(p.RtJogAll(24000, 1))


def test_what_slows_it_down_is_told(standing):
    standing.speed(2, 900, 100_000)
    standing.accept(p.RtJogAll(5000, 200))
    told = standing.client.request(p.GetExceeded())
    assert told.what == 0
    standing.accept(p.RtJogAll(12000, 200))
    standing.run(2)
    told = standing.client.request(p.GetExceeded())
    assert (told.what, told.motor) == (EXCEEDED_SLOWED, 2)
    assert told.by == pytest.approx(6000, rel=0.02)
    assert abs(PATH[2][told.frame - 1] - PATH[2][told.frame - 2]) == pytest.approx(150, abs=2)


def test_motors_without_a_part(standing):
    standing.accept(p.MotorConfigure(2, 0))
    standing.accept(p.RtJogAll(12000, 130))
    standing.wait_idle()
    assert standing.trace().motors == [1]
    standing.accept(p.MotorConfigure(1, 0))
    standing.refuse(p.Ack.ERR_NOT_IN_POSITION, p.RtJogAll(12000, 121))


def test_limit_switches():
    """Refused where it would begin by going on into a limit, however long the motor stands still
    before that."""
    session = rig(limits=[{"high": 22, "contact": "no"}], outputs=[], inputs=[])
    held = np.clip(20 * (K - 150), 0, None)  # holds until frame 151
    upload(session, {**PATH, 3: held}, frames=FRAMES)
    session.accept(p.MotorSetLimits(3, 0, 0, 0, 0, 1), p.RtPositionFrame(121))
    session.wait_idle()
    session.board._board.set_input(22, 0)
    session.run(0.05)
    session.forget()
    session.refuse(p.Ack.ERR_HARD_UP, p.RtJogAll(9000, 200), p.RtJogAll(9000, 152))
    session.accept(p.RtJogAll(9000, 121), p.RtJogAll(9000, 151))  # not that far
    session.wait_idle()
    session.accept(p.RtJogAll(9000, 20))
    session.wait_idle()
    assert session.position(1) == 1900
    assert session.made(3) == 0
    session.accept(p.MotorSetLimits(3, 0, 0, 0, 0, 0x81))
    session.accept(p.RtJogAll(9000, 155))
    session.wait_idle()
    session.refuse(p.Ack.ERR_HARD_LOW, p.RtJogAll(9000, 20))
    session.accept(p.RtJogAll(9000, 160))
    session.wait_idle()
    assert session.position(3) == held[159]
