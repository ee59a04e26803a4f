"""JOG_ALL on the host simulation: along the path as one axis, with the frame as its unit (field
note 6.10)."""

import numpy as np
import pytest

from framestep_tools import payloads as p
from host_tests.end_to_end.realtime import rig, upload
from host_tests.end_to_end.runs.moves import (
    ACCELERATION,
    PATH,
    PATH_FRAMES,
    PER_FRAME,
    assert_followed,
    assert_on_frame,
    indices,
)
from host_tests.end_to_end.session import assert_within, run_request, velocities
from host_tests.selection import sweep


def test_frame_by_frame(standing):
    """To the next frame: from rest to rest in a second, half of it up and half of it down."""
    at = 120
    for step in (1, 1, -1, -1, -1):
        standing.accept(p.RtJogAll(24000, at + step + 1))
        assert standing.moving == [1, 2]
        begun = standing.now
        standing.wait_idle()
        at += step
        assert_on_frame(standing, at)
        times, _ = standing.steps(1)
        assert times[-1] - begun == pytest.approx(1.0, abs=0.03)
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
    # as fast as the axis allows, except that the first and the last frame are ramps: they take
    # twice as long as the others
    top = min(fps, (ACCELERATION * abs(way)) ** 0.5)
    ideal = abs(way) / top + top / ACCELERATION
    times, _ = standing.steps(1)
    assert times[-1] - begun <= ideal * 1.05 + max(2 / top, 0.2)


@pytest.mark.parametrize("after", [0.3, 0.9, 2.0, 4.1])
def test_reversed_on_the_way(standing, after):
    """To a frame behind: on to the first frame where it can end, then back."""
    standing.accept(p.RtJogAll(12000, 200)).run(after)
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
    """Farther, nearer, beyond the turn and back, and at any time of a turn."""
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


@pytest.mark.parametrize("grain", sweep(range(8), 0, 3, 7))
def test_a_request_in_each_millisecond_of_a_turn(standing, grain):
    """The time at rest before it goes back is not special."""
    standing.accept(p.RtJogAll(12000, 130)).run(0.3)
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


@pytest.mark.with_reports
def test_lower_and_higher_speed_under_way(standing):
    """It reaches a new FPS by the axis' acceleration, up or down."""
    standing.accept(p.RtJogAll(10000, 200)).run(3.5)
    standing.accept(p.RtJogAll(2000, 200)).run(3)
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
    """Field note 6.10: on the next frame that it can reach at 4 frames/s², or at a frame per second
    if that takes more than 2 s. A STOP of one motor stops the axis."""
    standing.accept(p.RtJogAll(round(fps * 1000), 220)).run(after)
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
    # it acts after 0.05 s and some passes; a queued ramp up adds little more
    rate += 0.05 * ACCELERATION
    assert at - before <= 1 + rate * 0.066 + rate**2 / (2 * ACCELERATION) + 0.05
    assert times[-1] - begun <= max(
        2.1, 0.1 + 2 * (at - before) / max(rate - 0.2, 0.1) if rate > 1.2 else 2.1
    )
    # it rests on a frame, so it can continue from there
    standing.accept(p.RtJogAll(12000, 121))
    standing.client.wait_idle(60, 0.05)
    assert_on_frame(standing, 120)


def test_a_stop_keeps_the_limits_of_the_motors(standing):
    """The motors can follow a slow axis, but not one at a frame per second."""
    standing.speed(1, 40, 60).accept(p.RtJogAll(300, 140)).run(5.1)
    standing.accept(p.MotorStopAll())
    standing.client.wait_idle(30, 0.02)
    assert_on_frame(standing, round(indices(standing)))
    assert_within(*standing.steps(1), 40 * 1.01, 60 * 1.02, window=0.3)


@pytest.mark.parametrize("fps", [0.3, 12])
@pytest.mark.parametrize("later", [0, 0.4, 1.05])
def test_second_stop_all_while_it_lands(standing, fps, later):
    """Field note 6.10: it is a hard stop, whenever it comes."""
    standing.accept(p.RtJogAll(round(fps * 1000), 220)).run(3.3)
    standing.accept(p.MotorStop(1)).run(0.05)
    standing.accept(p.MotorStopAll()).run(later)
    assert standing.moving
    standing.accept(p.MotorStopAll()).run(0.1)
    assert not standing.moving
    assert indices(standing) != round(indices(standing))


def test_second_stop_all_is_hard(standing):
    standing.accept(p.RtJogAll(20000, 220)).run(4)
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
    for rate, frame in (
        (24000, 0), (24000, PATH_FRAMES + 1), (24000, -(2**31)),
        (0, 5), (200001, 5), (2**32 - 1, 5),
    ):  # fmt: skip
        standing.refuse(p.Ack.ERR_RANGE, p.RtJogAll(rate, frame))
    assert standing.ask(p.MotorMove(2, standing.position(2) + 1))
    standing.wait_idle().forget().refuse(p.Ack.ERR_NOT_IN_POSITION, p.RtJogAll(24000, 121)).run(0.2)
    assert not standing.trace().motors
    standing.accept(p.MotorMove(5, 2000))
    standing.refuse(p.Ack.ERR_MOVING, p.RtJogAll(24000, 121)).wait_idle()
    standing.accept(p.RtPositionFrame(9))
    standing.refuse(p.Ack.ERR_MOVING, p.RtJogAll(24000, 121)).wait_idle()
    standing.accept(p.RtJogAll(24000, 12)).wait_idle()
    standing.speed(2, 20000, 1_000_000).ready(run_request(24, 100, 110))
    standing.refuse(p.Ack.ERR_NOT_IN_POSITION, p.RtJogAll(24000, 12))
    standing.accept(p.RtGo())
    standing.refuse(p.Ack.ERR_MOVING, p.RtJogAll(24000, 121))


def test_too_far_to_be_checked_under_way():
    """ERR_MOVING, and the jog continues to its destination; from rest there is time for the
    check."""
    frames = 3600
    session = rig()
    upload(session, {1: 10 * np.arange(frames), 2: -7 * np.arange(frames)}, frames=frames)
    session.accept(p.RtPositionFrame(1)).wait_idle()
    session.accept(p.RtJogAll(24000, 60)).run(0.5)
    session.refuse(p.Ack.ERR_MOVING, p.RtJogAll(24000, 3500))
    session.accept(p.RtJogAll(24000, 70)).wait_idle()
    assert [session.position(1), session.position(2)] == [690, -483]
    session.accept(p.RtJogAll(24000, 3500)).run(1)
    session.accept(p.MotorStopAll()).wait_idle()
    frame = session.position(1) / 10
    assert frame == round(frame) > 72
    assert session.position(2) == -7 * frame


def test_where_it_stands_is_found_by_positions(standing):
    """On any frame, however it got there."""
    standing.accept(p.MotorMove(1, int(PATH[1][77])), p.MotorMove(2, int(PATH[2][77])))
    standing.wait_idle().forget().accept(p.RtJogAll(12000, 80)).wait_idle()
    assert_on_frame(standing, 79)
    assert_followed(standing, 77, 12)
    standing.accept(
        p.MotorResetPosition(1, int(PATH[1][3])), p.MotorResetPosition(2, int(PATH[2][3]))
    )
    standing.accept(p.RtJogAll(12000, 1)).wait_idle()
    assert_on_frame(standing, 0)


def test_there_already(standing):
    standing.accept(p.RtJogAll(24000, 121))
    assert not standing.moving
    standing.run(0.2)
    assert not standing.trace().motors
    assert not standing.events(p.RtEnd)
