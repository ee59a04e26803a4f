"""Backlash is taken up before an operation begins, by a motion within the motor's limits.

Judged from the edges: no motor is ever faster or steeper than its settings, and the load is where
it should be.
"""

import random

import numpy as np
import pytest

from framestep_tools import payloads as p
from framestep_tools.judge.judge import frame_times_ns
from framestep_tools.judge.ripple import origins_ns
from host_tests.end_to_end.realtime import upload
from host_tests.end_to_end.session import assert_no_faster, assert_within, run_request, simulated

PLAY = 200
VELOCITY, ACCELERATION = 2000, 20_000
FRAMES = 25
UP = 1000 + 40 * np.arange(FRAMES)  # 960 steps/s at 24 frames/s
SWING = np.rint(900 * np.sin(np.arange(121) * 2 * np.pi / 120)).astype(int)
LOOP, PING_PONG = 2, 1


def rig(**settings):
    session = simulated({"motors": [{"backlash": PLAY}, {"backlash": PLAY}], **settings})
    for motor in (1, 2):
        session.speed(motor, VELOCITY, ACCELERATION).accept(p.MotorConfigure(motor, 0x03))
    return session


def load(signs, play=PLAY):
    """Return where the load is after each step of the motor, whose gears have play; both begin at
    0, with the play taken up for a motion up."""
    motor, place, places = 0, 0, []
    for step in signs:
        motor += step
        place = min(max(place, motor), motor + play)
        places.append(place)
    return places


def assert_kept(session, motors=(1, 2)):
    """Assert that all edges so far are within the limits, and the load is where the report says."""
    for motor in motors:
        times, signs = session.steps(motor)
        assert_within(times, signs, VELOCITY * 1.002, ACCELERATION * 1.01, window=0.02)
        assert load(signs)[-1] == session.position(motor)


@pytest.mark.parametrize("play", [1, 25, 300])
def test_the_load_goes_where_it_was_sent(play):
    session = simulated({"motors": [{"backlash": play}]}).speed(1, 20000, 100_000)
    rng = random.Random(play)
    for k in range(40):
        target = rng.randint(-500, 500)
        session.accept(p.MotorMove(1, target)).run(rng.choice([0.01, 0.05, 0.3]))
        stopped = k % 7 == 3
        if stopped:
            session.accept(p.MotorStopAll())
        if stopped or k % 4 == 0:
            place = session.wait_idle().position(1)
            assert load(session.steps(1)[1], play)[-1] == place
            assert stopped or place == target


def test_the_load_is_on_every_frame_of_a_run():
    session = simulated({"motors": [{"backlash": 25}]}).speed(1, 20000, 100_000)
    k = np.arange(49)
    frames = np.rint(1000 * np.sin(2 * np.pi * k / 48) + 6 * k).astype(int)
    session.upload({1: frames}).ready(run_request(24, 1, 49))
    waited = len(session.steps(1)[0])
    session.accept(p.RtGo()).until(p.RtEnd, 10)
    times, signs = session.steps(1)
    places = load(signs, 25)[waited:]
    # the origin of the run is not reported; with one of them all frames are right
    assert origins_ns(
        times[waited + 1 :] * 1e9, np.diff(places), places[0], frames, frame_times_ns(49, 24_000),
        30_000,
    )  # fmt: skip


def test_a_take_up_that_is_too_fast_is_refused():
    session = simulated({"motors": [{"backlash": 5000}]})
    session.upload({1: [0, 50, 100, 150, 200, 150, 100, 50, 0]})
    session.refuse(p.Ack.ERR_RANGE, run_request(24, 1, 9)).accept(run_request(24, 1, 5))


@pytest.mark.parametrize("side", [-300, 300], ids=["from below", "from above"])
@pytest.mark.parametrize(("first", "last"), [(1, FRAMES), (FRAMES, 1)], ids=["forward", "backward"])
@pytest.mark.parametrize("roll", [0, 60])
def test_a_run(side, first, last, roll):
    session = rig()
    upload(session, {1: UP, 2: UP[::-1]})
    for motor in (1, 2):
        session.accept(p.MotorMove(motor, int(UP[first - 1]) + side))
    session.wait_idle().ready(run_request(24, first, last, roll, roll))
    places = session.positions
    session.accept(p.RtGo()).until(p.RtEnd, 20)
    ended = session.now
    session.wait_idle()  # on the end frame again (field note 6.11)
    assert_kept(session)
    # while it waits for GO no motor goes the other way until RT_END
    for motor, way in ((1, last - first), (2, first - last)):
        times, signs = session.steps(motor)
        signs = signs[times < ended]
        at = np.array(load(signs))
        begun = np.flatnonzero(at == places[motor])[-1]
        assert np.all(signs[begun + 1 :] == np.sign(way))


@pytest.mark.parametrize("flags", [LOOP, PING_PONG])
def test_every_pass(flags):
    session = rig()
    upload(session, {1: UP, 2: UP[::-1]})
    session.ready(run_request(24, 1, FRAMES, 0, 0, flags=flags))
    session.accept(p.RtGo()).run(12)
    session.accept(p.RtStopLoop()).until(p.RtEnd, 20).wait_idle()
    assert_kept(session)
    frames = [
        message for _, message in session.events(p.Positions) if message.move_time == 1000 * FRAMES
    ]
    assert len(frames) >= 3


def test_a_turn_at_the_first_and_the_last_frame():
    """The ramp before a peak goes up, the frame after it down; likewise at the other end, and in a
    ping-pong."""
    session = rig()
    peak = np.concatenate((400 - 4 * np.abs(np.arange(-8, 9)) ** 2, [148, 150, 152, 154, 156, 158]))
    upload(session, {1: peak, 2: -peak}, frames=len(peak))
    for first, last in ((8, 22), (9, 22), (10, 22), (22, 9), (18, 9), (17, 18)):
        for flags in (0, PING_PONG):
            request = run_request(12, first, last, 100, 100, flags=flags)
            if session.code(request) != p.Ack.OK:
                continue
            session.wait_idle().accept(p.RtGo()).run(8)
            if flags:
                session.accept(p.RtStopLoop()).until(p.RtEnd, 20)
            session.wait_idle()
            assert_kept(session)


@pytest.mark.parametrize("fps", [0.5, 6, 24])
def test_jog_all(fps):
    session = rig()
    path = np.arange(121) * 30
    upload(session, {1: path, 2: SWING}, frames=121)
    session.accept(p.RtPositionFrame(60)).wait_idle()
    for frame in (62, 61, 58, 60, 57, 57, 59):
        session.accept(p.RtJogAll(round(fps * 1000), frame))
        session.client.wait_idle(60, 0.05)
        session.run(0.05)
        assert session.position(1) == path[frame - 1]
        assert session.position(2) == SWING[frame - 1]
    assert_kept(session)


def test_jog_all_called_elsewhere_while_it_takes_up_the_play():
    """At any time during it; the last destination counts."""
    session = rig()
    path = np.arange(121) * 30
    upload(session, {1: path, 2: -path}, frames=121)
    session.accept(p.RtPositionFrame(60)).wait_idle()
    at = 60
    for wait in np.arange(0, 0.6, 0.03):
        session.accept(p.RtJogAll(6000, at + 2)).run(wait)
        session.accept(p.RtJogAll(6000, at - 1))
        session.client.wait_idle(60, 0.05)
        session.run(0.05)
        at -= 1
        assert session.position(1) == path[at - 1]
    session.accept(p.RtJogAll(6000, at - 1)).run(0.05)
    session.accept(p.RtJogAll(6000, at), p.MotorStop(1)).wait_idle()
    assert session.position(1) in (path[at - 2], path[at - 1])
    assert_kept(session)


def assert_no_play_made(session, request):
    """Assert that from GO to the end each motor makes the steps of its load, and none for play."""
    before = session.play(request)
    for motor in (1, 2):
        _, signs = session.steps(motor)
        assert 0 < len(signs) == abs(session.position(motor) - before[motor])


@pytest.mark.parametrize("way", [1, -1])
@pytest.mark.parametrize("second", [False, True])
def test_shoot_frame(way, second):
    session = rig()
    upload(session, {1: UP, 2: UP[::-1]})
    session.accept(p.RtPositionFrame(12)).wait_idle()
    for at in (0, 300, -300):
        motors = tuple(p.BlurMotor(motor, at + 50 * way, at - 50 * way) for motor in (1, 2))
        request = (
            p.RtShootFrame2(12, 1000, 0, 360, motors)
            if second
            else p.RtShootFrame(12, 0, 1000, 1000, motors)
        )
        assert_no_play_made(session, request)
    assert_no_play_made(
        session,
        p.RtShootFrame2(12, 1000, 0, 360) if second else p.RtShootFrame(12, way > 0, 1000, 500),
    )


@pytest.mark.long
@pytest.mark.parametrize("start", [1, 17])
@pytest.mark.parametrize("fps", [6, 24])
def test_a_turn_within_the_path(fps, start):
    """Between two frames the motor makes up for all of the play: the request is refused if that is
    too fast for the motor; otherwise no edge comes too soon."""
    taken = refused = 0
    for play in (20, 60, 100, 150, 240):
        session = rig(motors=[{"backlash": play}, {}])
        session.speed(1, VELOCITY, 4_000_000)
        for rate in (0.1, 0.3, 0.5, 0.7, 0.9):
            step = rate * VELOCITY / fps
            path = np.rint(step * np.abs(np.arange(FRAMES) - 12)).astype(int)
            upload(session, {1: path})
            for first, last in ((start, FRAMES), (FRAMES, start)):
                if session.code(run_request(fps, first, last, 1000, 1000)) != p.Ack.OK:
                    refused += 1
                    assert start == 1
                    assert 1.5 * (step + play) + step / 8 > VELOCITY / fps - 3
                    continue
                taken += 1
                session.wait_idle().forget().accept(p.RtGo()).until(p.RtEnd, 60)
                times, _ = session.steps(1)
                times = times[times < session.now]
                session.wait_idle()
                assert_no_faster(times, VELOCITY * 1.002)
    assert taken
    assert refused or start == 17


@pytest.mark.parametrize("jog", [False, True])
def test_the_load_turns_where_the_path_does(jog):
    """At an uneven peak the curve alone might pass the frame: the load would stay there while the
    motor takes up the play."""
    session = rig()
    peak = np.array(
        [
            0, 5, 10, 20, 40, 70, 60, 55, 50, 45, 40, 35, 30, 25, 20, 18, 16, 18, 48, 98, 140, 160,
            170, 175,
        ]
    )  # fmt: skip
    upload(session, {1: peak, 2: -peak}, frames=len(peak))
    session.accept(p.RtPositionFrame(1)).wait_idle()
    if jog:
        session.accept(p.RtJogAll(6000, len(peak))).wait_idle()
        session.client.wait_idle(60, 0.05)
    else:
        session.ready(run_request(6, 1, len(peak), 500, 500))
        session.accept(p.RtGo()).until(p.RtEnd, 20)
    session.wait_idle()
    for motor, sign in ((1, 1), (2, -1)):
        places = sign * np.array(load(session.steps(motor)[1]))
        places = places[np.insert(np.diff(places) != 0, 0, True)]
        turns = places[1:-1][np.diff(np.sign(np.diff(places))) != 0].tolist()
        assert [place for place in turns if 0 < place < 175] == [70, 16]
