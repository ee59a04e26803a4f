"""Backlash, coupled motors, live control and the jerk limit, over the protocol on the host
simulation."""

import random

import numpy as np
import pytest

from framestep_tools import payloads as p
from framestep_tools.client.client import Client
from framestep_tools.judge.judge import frame_times_ns
from framestep_tools.judge.ripple import origins_ns
from framestep_tools.simulator.boards import LockstepPort, SimulatedBoard
from host_tests.end_to_end.session import simulated

COUPLE, REVERSED, LIVE = 0x10, 0x20, 0x08
INT32_MAX = 2**31 - 1


def connect(rig=None):
    board = SimulatedBoard(rig)
    return board, Client(LockstepPort(board))


def steps(edges, motor):
    """Return [(ns, ±1)] of a motor."""
    return [(t, value) for t, signal, value in edges if signal == f"m{motor}"]


def position(client, motor):
    return client.request(p.MotorGetPosition()).steps[motor - 1]


# ---------------------------------------------------------------- coupled motors


@pytest.mark.parametrize("flag, sense", [(COUPLE, 1), (REVERSED, -1)])
def test_partner_makes_the_same_steps_at_the_same_time(flag, sense):
    board, client = connect()
    client.request(p.MotorMove(2, 500))
    client.wait_idle()
    client.request(p.MotorSetSpeed(1, 9000, 30000))
    assert client.code(p.MotorConfigure(1, 1 | flag)) == p.Ack.OK
    board.edges()
    rng = random.Random(3)
    for k in range(12):
        client.request(p.MotorMove(1, rng.randint(-4000, 4000)))
        client.pump(rng.random())
        if k % 3 == 2:
            client.code(p.MotorStopAll())
            client.wait_idle()
    client.request(p.MotorMove(1, 333))
    client.wait_idle()
    edges = board.edges()
    one, two = steps(edges, 1), steps(edges, 2)
    assert len(one) == len(two) > 5000
    assert all(a[1] == sense * b[1] for a, b in zip(one, two, strict=True))
    # with the opposite sign, rounding goes the other way
    assert max(abs(a[0] - b[0]) for a, b in zip(one, two, strict=True)) < 1000
    assert position(client, 1) == 333
    assert position(client, 2) == 500 + sense * 333


def test_partner_cannot_be_asked_and_the_last_motor_has_none():
    _board, client = connect()
    assert client.code(p.MotorConfigure(8, 1 | COUPLE)) == p.Ack.ERR_RANGE
    assert client.code(p.MotorConfigure(3, 1 | COUPLE)) == p.Ack.OK
    assert client.code(p.MotorMove(4, 10)) == p.Ack.ERR_GENERAL
    assert client.code(p.MotorJog(4, 100, 10)) == p.Ack.ERR_GENERAL
    assert client.code(p.MotorConfigure(4, 1 | COUPLE)) == p.Ack.ERR_RANGE
    client.request(p.MotorMove(3, 1000))
    assert client.code(p.MotorConfigure(3, 1)) == p.Ack.ERR_MOVING
    client.pump(0.1)
    client.code(p.MotorStop(4))  # stops both
    client.wait_idle()
    assert 0 < position(client, 3) < 1000
    assert position(client, 3) == position(client, 4)
    assert client.code(p.MotorConfigure(3, 1)) == p.Ack.OK
    client.request(p.MotorMove(4, 10))
    client.wait_idle()
    assert position(client, 4) == 10


def test_coupled_motors_run_an_uploaded_move_together():
    board, client = connect()
    client.request(p.MotorConfigure(1, 1 | REVERSED))
    client.upload_move(1, 25, {1: [40 * k for k in range(25)], 2: [7 * k for k in range(25)]})
    client.request(p.RtRunMove(24000, 1, 25, 300, 300))
    client.wait_idle()
    board.edges()
    client.request(p.RtGo())
    client.wait_event(p.RtEnd, 10)
    edges = board.edges()
    one, two = steps(edges, 1), steps(edges, 2)
    assert len(one) == len(two) > 960
    assert all(a[1] == -b[1] and abs(a[0] - b[0]) < 1000 for a, b in zip(one, two, strict=True))


# ---------------------------------------------------------------- backlash


class Load:
    """The load of a motor with play in its gears."""

    def __init__(self, backlash):
        self.backlash = backlash
        self.motor = self.place = 0
        self.history = []

    def follow(self, edges):
        for t, step in steps(edges, 1):
            self.motor += step
            self.place = min(max(self.place, self.motor), self.motor + self.backlash)
            self.history.append((t, self.place))


@pytest.mark.parametrize("backlash", [1, 25, 300])
def test_the_load_goes_where_it_was_sent(backlash):
    board, client = connect({"motors": [{"backlash": backlash}]})
    client.request(p.MotorSetSpeed(1, 20000, 100000))
    load = Load(backlash)
    rng = random.Random(backlash)
    for k in range(40):
        target = rng.randint(-500, 500)
        client.request(p.MotorMove(1, target))
        client.pump(rng.choice([0.01, 0.05, 0.3]))
        if k % 7 == 3:
            client.code(p.MotorStopAll())
            client.wait_idle()
            load.follow(board.edges())
            assert load.place == position(client, 1)
        elif k % 4 == 0:
            client.wait_idle()
            load.follow(board.edges())
            assert load.place == position(client, 1) == target


def test_the_load_is_on_every_frame_of_a_run():
    board, client = connect({"motors": [{"backlash": 25}]})
    client.request(p.MotorSetSpeed(1, 20000, 100000))
    frames = [round(1000 * np.sin(2 * np.pi * k / 48) + 6 * k) for k in range(49)]
    client.upload_move(1, 49, {1: frames})
    load = Load(25)
    client.request(p.RtRunMove(24000, 1, 49, 500, 500))
    client.wait_idle()
    load.follow(board.edges())
    load.history.clear()
    client.request(p.RtGo())
    client.wait_event(p.RtEnd, 10)
    load.follow(board.edges())
    times, places = np.array(load.history).T
    # the origin of the run is not reported; with one of them all frames are right
    assert origins_ns(
        times[1:], np.diff(places), places[0], frames, frame_times_ns(49, 24_000), 30_000
    )


def test_a_take_up_that_is_too_fast_is_refused():
    _board, client = connect({"motors": [{"backlash": 5000}]})
    client.upload_move(1, 9, {1: [0, 50, 100, 150, 200, 150, 100, 50, 0]})
    assert client.code(p.RtRunMove(24000, 1, 9, 500, 500)) == p.Ack.ERR_RANGE
    assert client.code(p.RtRunMove(24000, 1, 5, 500, 500)) == p.Ack.OK


# ---------------------------------------------------------------- live control


def test_a_live_motor_stays_free_during_a_run():
    _board, client = connect()
    client.request(p.MotorConfigure(2, 1 | LIVE))
    client.upload_move(1, 49, {1: [20 * k for k in range(49)], 2: [20 * k for k in range(49)]})
    client.request(p.RtRunMove(24000, 1, 49, 200, 200))
    client.wait_idle()
    client.request(p.RtGo())
    client.pump(0.5)
    assert client.code(p.MotorMove(1, 0)) == p.Ack.ERR_MOVING
    assert client.code(p.MotorMove(2, -123)) == p.Ack.OK
    client.pump(0.3)
    assert position(client, 2) == -123
    assert client.code(p.MotorJog(2, 10000, INT32_MAX)) == p.Ack.OK
    client.pump(0.1)
    assert client.code(p.MotorStop(2)) == p.Ack.OK
    client.wait_event(p.RtEnd, 10)
    assert position(client, 1) >= 960


# ---------------------------------------------------------------- jerk limit


@pytest.mark.needs("fine edges")
@pytest.mark.parametrize("jerk", [0, 200])
def test_ramps_keep_the_jerk(jerk):
    """jerk: 1000 steps/s³. Measures the steepest change of acceleration from the edges of a
    4000-step move."""
    board, client = connect({"motors": [{"jerk": jerk}]})
    client.request(p.MotorSetSpeed(1, 10000, 40000))
    board.edges()
    client.request(p.MotorMove(1, 4000))
    client.wait_idle()
    edges = board.edges()
    assert len(steps(edges, 1)) == 4000
    steepest, acceleration = steepest_change(edges)
    if jerk:
        assert steepest < jerk * 1000 * 1.3
    else:
        assert steepest > 1_000_000  # a corner
    assert acceleration < 40000 * 1.1


def steepest_change(edges, window=0.01):
    """Return the greatest jerk (steps/s³) and acceleration of motor 1, from differences over
    windows of time."""
    t = np.array([t for t, _ in steps(edges, 1)]) * 1e-9
    made = np.cumsum([value for _, value in steps(edges, 1)])
    grid = np.arange(t[0] + 2 * window, t[-1] - 2 * window, window)
    acceleration = np.diff(np.interp(grid, t, made), 2) / window**2
    return np.abs(np.diff(acceleration)).max() / window, np.abs(acceleration).max()


def moved_and_stopped(jerk, after_s, request, target=4000, stops=1):
    """Return the edges of a move that is stopped after a time, how long the stop took, and the
    position reported at the end."""
    board, client = connect({"motors": [{"jerk": jerk}]})
    client.request(p.MotorSetSpeed(1, 10000, 40000))
    board.edges()
    client.request(p.MotorMove(1, target))
    client.pump(after_s)
    asked = board.now_ns
    for _ in range(stops):
        assert client.code(request) == p.Ack.OK
        client.pump(0.02)
    client.wait_idle()
    edges = board.edges()
    return edges, (steps(edges, 1)[-1][0] - asked) * 1e-9, position(client, 1)


@pytest.mark.needs("fine edges")
@pytest.mark.parametrize("request_", [p.MotorStop(1), p.MotorStopAll()], ids=["STOP", "STOP_ALL"])
@pytest.mark.parametrize("target", [4000, -4000])
@pytest.mark.parametrize("after_s", [0.06, 0.12, 0.2, 0.3, 0.45, 0.6, 0.7])
def test_a_stop_keeps_the_jerk(after_s, target, request_):
    """In acceleration, cruising or deceleration, the motor comes to rest at once, and never past
    its target."""
    edges, took, at = moved_and_stopped(200, after_s, request_, target)
    jerk, acceleration = steepest_change(edges)
    assert jerk < 200_000 * 1.3
    assert acceleration < 40_000 * 1.05
    signs = {value for _, value in steps(edges, 1)}
    assert signs == {1 if target > 0 else -1}
    assert len(steps(edges, 1)) == abs(at) <= 4000
    # at most: lose the acceleration, then a ramp of A/j + v/A, after the twelve ticks that a plan
    # waits
    assert took < 0.2 + 0.2 + 0.25 + 0.02


def test_stops_without_a_jerk_limit_and_hard_ones_are_immediate():
    edges, took, _ = moved_and_stopped(0, 0.35, p.MotorStop(1))
    assert took < 0.26  # v/A
    assert steepest_change(edges)[0] > 1_000_000
    edges, took, _ = moved_and_stopped(200, 0.35, p.MotorStopAll(), stops=2)
    assert took < 0.02 + 0.07  # the second one is four times as steep
    assert steepest_change(edges)[0] > 1_000_000


def test_a_stop_asked_for_again_takes_no_longer():
    _, once, at = moved_and_stopped(200, 0.5, p.MotorStop(1), 20000)
    _, thrice, then = moved_and_stopped(200, 0.5, p.MotorStop(1), 20000, stops=3)
    assert (once, at) == (thrice, then)
    assert 0.44 < once < 0.48  # A/j + v/A, and the time until the plan begins


@pytest.mark.needs("fine edges")
def test_a_jog_let_go_keeps_the_jerk():
    board, client = connect({"motors": [{"jerk": 200}], "jog_timeout_ms": 300})
    client.request(p.MotorSetSpeed(1, 10000, 40000))
    board.edges()
    client.request(p.MotorJog(1, 10000, INT32_MAX))
    client.wait_idle()
    edges = board.edges()
    assert 1000 < len(steps(edges, 1)) == position(client, 1)
    assert steepest_change(edges)[0] < 200_000 * 1.3


def test_a_move_may_follow_a_stop_under_way():
    board, client = connect({"motors": [{"jerk": 200}]})
    client.request(p.MotorConfigure(1, 1 | COUPLE))
    client.request(p.MotorSetSpeed(1, 10000, 40000))
    rng = random.Random(5)
    for _ in range(30):
        target = rng.randint(-5000, 5000)
        client.request(p.MotorMove(1, target))
        client.pump(rng.random() * 0.5)
        client.code(p.MotorStop(1))
        client.pump(rng.random() * 0.3)
    client.request(p.MotorMove(1, 77))
    client.wait_idle()
    edges = board.edges()
    assert (
        position(client, 1)
        == position(client, 2)
        == 77
        == sum(value for _, value in steps(edges, 1))
    )
    assert [value for _, value in steps(edges, 1)] == [value for _, value in steps(edges, 2)]


@pytest.mark.parametrize("jerk", [200, 2000])
def test_retarget_near_a_soft_limit(jerk):
    """A motor that slows down to its limit and gets a target behind it comes to rest before the
    limit, then turns."""
    session = simulated({"motors": [{"jerk": jerk}]})
    session.speed(1, 10_000, 40_000).accept(p.MotorSetLimits(1, 0, 0, 1, 6000))
    for wait in (0.4, 0.5, 0.6, 0.7, 0.8):
        session.accept(p.MotorMove(1, 6000)).run(wait)
        session.accept(p.MotorMove(1, 1000)).wait_idle()
        assert session.position(1) == session.made(1) == 1000
        _, signs = session.steps(1)
        assert np.cumsum(signs).max() <= 6000


# --------------------------------------------------------------- the ends of the range of positions

LOWEST, HIGHEST = -(2**31), 2**31 - 1


@pytest.mark.each_processor
@pytest.mark.parametrize("flags", [1, 1 | COUPLE, 1 | REVERSED])
@pytest.mark.parametrize("backlash", [0, 24])
def test_a_jog_to_the_last_step_there_is(backlash, flags):
    """Hosts send this for "jog down" and "jog up": the direction is right with any backlash."""
    for target, way in ((LOWEST, -1), (HIGHEST, 1)):
        session = simulated({"motors": [{"backlash": backlash}]})
        session.accept(p.MotorConfigure(1, flags), p.MotorJog(1, 10_000, target)).run(0.3)
        session.accept(p.MotorJog(1, 10_000, target)).run(0.3).wait_idle()
        assert session.position(1) * way > 1000
        assert set(session.steps(1)[1]) == {way}


@pytest.mark.parametrize("jerk", [0, 300])
@pytest.mark.parametrize("backlash", [0, 24])
@pytest.mark.parametrize("way", [1, -1])
def test_up_to_the_end_of_the_range(way, backlash, jerk):
    """The motor's own steps must fit as well: with play the load's range is that much shorter."""
    session = simulated({"motors": [{"backlash": backlash, "jerk": jerk}]})
    end = HIGHEST if way > 0 else LOWEST + backlash
    session.accept(p.MotorResetPosition(1, end - way * 1500))
    for _ in range(12):
        session.accept(p.MotorJog(1, 10_000, HIGHEST if way > 0 else LOWEST)).run(0.1)
    session.wait_idle()
    assert session.position(1) == end
    if backlash and way < 0:
        session.refuse(p.Ack.ERR_SOFT_LOW, p.MotorMove(1, end - 1), p.MotorMove(1, LOWEST))
        session.refuse(
            p.Ack.ERR_RANGE, p.MotorResetPosition(1, end - 1), p.MotorResetPosition(1, LOWEST)
        )
        assert session.position(1) == end
    session.accept(p.MotorMove(1, end - way * 700))
    session.run(0.2).accept(p.MotorStop(1)).wait_idle()
    session.accept(p.MotorMove(1, end)).run(0.3)
    session.accept(p.MotorMove(1, end - way * 900))  # while it slows down to the end
    session.wait_idle().accept(p.MotorMove(1, end))
    for wait in (0.3, 0.1, 0.05, 0.05):
        session.run(wait).accept(p.MotorStop(1))
    session.wait_idle()
    assert (end - session.position(1)) * way >= 0


def test_uploads_keep_to_the_range_the_play_leaves():
    session = simulated({"motors": [{"backlash": 24}]})
    session.accept(p.MotorResetPosition(1, LOWEST + 30))
    session.upload({1: [LOWEST + 30, LOWEST + 23, LOWEST + 23, LOWEST + 23]})
    session.refuse(p.Ack.ERR_RANGE, p.RtRunMove(24000, 1, 4, 500, 500))
