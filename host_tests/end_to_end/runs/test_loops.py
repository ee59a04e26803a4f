"""Loops and ping-pong on the host simulation: laps, STOP_LOOP, rolls of no time."""

import itertools

import numpy as np
import pytest

from framestep_tools import payloads as p
from host_tests.end_to_end import realtime as rt
from host_tests.end_to_end.session import assert_within, run_request


@pytest.mark.parametrize("flags", [rt.LOOP, rt.PING_PONG, rt.LOOP | rt.PING_PONG])
@pytest.mark.parametrize(("first", "last"), [(1, rt.FRAMES), (rt.FRAMES, 1), (4, 20)])
def test_laps(flags, first, last):
    """Every lap keeps to its frames like a single one, with ramps within the limits between
    laps; RT_END comes once."""
    session = rt.loaded()
    before = rt.go(session, run_request(24, first, last, 500, 300, flags=flags))
    session.run(4.8)
    assert not session.events(p.RtEnd)
    session.accept(p.RtStopLoop())
    rt.to_the_end(session)
    verdicts = rt.judged(session, before, first=first, last=last, roll=0.3)
    assert len(verdicts) >= 3
    for motor in rt.MOVE:
        assert_within(*session.steps(motor), rt.VELOCITY, rt.ACCELERATION)
        assert session.position(motor) == before[motor] + session.made(motor)
    reported = rt.laps_seen(session)
    turns = [at[-1][1] > at[0][1] for at in reported]
    if flags & rt.PING_PONG:
        assert all(a != b for a, b in itertools.pairwise(turns))
    else:
        assert len(set(turns)) == 1


# seconds after GO; the laps then played to their ends
@pytest.mark.needs("prompt", only=("1-2.01-2-1",))
@pytest.mark.parametrize(
    ("after", "ping_pong", "loop"),
    [
        *((0.2, 1, 1), (1.0, 1, 1), (1.52, 1, 1), (1.8, 1, 1), (1.99, 1, 1)),
        *((2.01, 2, 1), (2.3, 2, 1), (3.0, 2, 2)),
    ],
)
@pytest.mark.parametrize("flags", [rt.PING_PONG, rt.LOOP])
def test_stop_loop(after, ping_pong, loop, flags):
    """Field note 6.6: the present lap reaches its end, then comes RT_END: in the pre-roll, the
    lap, the ramp after its end frame until rest at 2 s, the next roll or the way back."""
    session = rt.loaded()
    before = rt.go(session, run_request(24, 1, rt.FRAMES, 500, 500, flags=flags))
    session.run(after).accept(p.RtStopLoop())
    session.accept(p.RtStopLoop())
    rt.to_the_end(session)
    assert len(rt.judged(session, before)) == (ping_pong if flags == rt.PING_PONG else loop)
    assert rt.laps_seen(session)[-1][-1][1] in (1, rt.FRAMES)
    session.accept(p.RtStopLoop())
    session.refuse(p.Ack.ERR_GENERAL, p.RtGo()).wait_idle()
    # STOP_LOOP counts once: the next loop loops again
    rt.go(session, run_request(24, 1, rt.FRAMES, 500, 500, flags=flags))
    session.run(3.5)
    assert not session.events(p.RtEnd)
    assert len(rt.laps_seen(session)) >= 2
    session.accept(p.MotorStopAll())
    rt.to_the_end(session)


@pytest.mark.needs("prompt")
@pytest.mark.parametrize("after", [1.2, 1.3, 1.45, 1.499, 1.51])
@pytest.mark.parametrize("flags", [rt.PING_PONG, rt.LOOP])
def test_stop_loop_late_in_a_lap(after, flags):
    """Field note 6.11: if the ramp after the end frame is already queued, it becomes the post-roll,
    within the limits."""
    session = rt.loaded()
    rt.go(session, run_request(24, 1, rt.FRAMES, 500, 500, flags=flags))
    begun = session.now
    session.run(after).accept(p.RtStopLoop())
    ended = rt.to_the_end(session)
    assert 1.99 < ended - begun < 2.06
    session.wait_idle()
    assert session.position(1) == rt.MOVE[1][-1]
    assert session.position(2) == rt.MOVE[2][-1]
    assert rt.laps_seen(session)[-1][-1][1] == rt.FRAMES
    assert len(rt.laps_seen(session)) == 1
    for motor in rt.MOVE:
        assert_within(*session.steps(motor), rt.VELOCITY, rt.ACCELERATION)


@pytest.mark.each_processor
def test_stop_loop_on_the_way_back():
    """Between two laps of a loop: the rig ends at the start, an end point, and plays no further
    lap."""
    session = rt.rig()
    far = {1: 4000 * np.arange(rt.FRAMES) // 24, 2: np.zeros(rt.FRAMES, int)}
    rt.upload(session, far)
    session.speed(1, 6000, 20_000)
    rt.go(session, run_request(24, 1, rt.FRAMES, 500, 500, flags=rt.LOOP))
    session.run(2.4).accept(p.RtStopLoop())
    assert not session.events(p.RtEnd)
    rt.to_the_end(session)
    assert len(rt.laps_seen(session)) == 1
    assert min(session.steps(1)[1].cumsum()[1000:]) <= 1, "it has gone back to where the lap began"
    session.wait_idle()
    assert session.position(1) == far[1][-1]


@pytest.mark.parametrize("flags", [rt.LOOP, rt.PING_PONG])
@pytest.mark.parametrize("wait", [0.0, 0.02, 2.0])
def test_stop_loop_before_go(flags, wait):
    """Field note 6.12: it cancels the loop, both on the way to the pre-roll position and in the
    wait for GO."""
    session = rt.loaded()
    session.accept(run_request(24, 1, rt.FRAMES, 500, 500, flags=flags)).run(wait)
    session.accept(p.RtStopLoop()).wait_idle()
    before = session.positions
    session.forget().accept(p.RtGo())
    rt.to_the_end(session)
    assert len(rt.judged(session, before)) == 1
    session.wait_idle()
    assert session.position(1) == rt.MOVE[1][-1]


def test_stop_loop_without_a_loop():
    """Field note 6.12: always OK, and it changes nothing."""
    session = rt.loaded()
    session.accept(p.RtStopLoop())
    session.ready(p.RtShootFrame(10, 1, 300, 500))
    session.accept(p.RtStopLoop(), p.RtGo(), p.RtStopLoop())
    rt.to_the_end(session)
    before = rt.go(session, run_request(24, 1, rt.FRAMES, 500, 500))
    session.run(0.7).accept(p.RtStopLoop())
    rt.to_the_end(session)
    assert len(rt.judged(session, before)) == 1
    session.accept(p.RtJogAll(24000, 3), p.RtStopLoop()).wait_idle()
    assert session.position(1) == rt.MOVE[1][2]


@pytest.mark.with_reports
@pytest.mark.parametrize("flags", [rt.LOOP, rt.PING_PONG])
def test_rolls_of_no_time(flags):
    """Pre-roll 0 and post-roll 0: in each lap the shortest ramps that the motors can follow."""
    session = rt.loaded()
    before = rt.go(session, run_request(24, 1, rt.FRAMES, 0, 0, flags=flags))
    session.run(3.5).accept(p.RtStopLoop())
    rt.to_the_end(session)
    assert len(rt.judged(session, before, roll=0.03)) >= 3
    for motor in rt.MOVE:
        assert_within(*session.steps(motor), rt.VELOCITY, rt.ACCELERATION)


def test_loop_of_a_single_frame():
    session = rt.loaded()
    for flags in (rt.LOOP, rt.PING_PONG):
        rt.go(session, run_request(24, 7, 7, 200, 200, flags=flags))
        session.run(2)
        assert not session.events(p.RtEnd)
        session.accept(p.RtStopLoop())
        rt.to_the_end(session)
        assert session.position(1) == rt.MOVE[1][6]


@pytest.mark.needs("prompt")
def test_lights_alone():
    """An upload without positions plays as well: lights and triggers in time, then RT_END."""
    session = rt.rig()
    rt.upload(session, {}, rt.LEVELS, rt.TRIGGERS)
    session.accept(run_request(24, 1, rt.FRAMES, 300, 0, sync_dmx=1)).wait_idle().forget()
    session.accept(p.RtGo())
    asked = session.now
    ended = rt.to_the_end(session)
    # the last frame has a trigger on
    assert ended - asked == pytest.approx(0.3 + rt.FRAMES / 24, abs=0.01)
    first = rt.edges(session, "gio1")[0][0]
    assert first - asked == pytest.approx(0.3, abs=0.005)
    rt.assert_triggers(session, first + np.arange(rt.FRAMES) / 24, range(rt.FRAMES))
    rt.assert_levels(session, first + np.arange(rt.FRAMES) / 24, range(rt.FRAMES))
