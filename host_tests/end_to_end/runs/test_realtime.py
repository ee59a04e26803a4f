"""Real-time runs on the host simulation: planning before GO, refusals, stops."""

import random

import numpy as np
import pytest

from framestep_tools import payloads as p
from host_tests.end_to_end import realtime as rt
from host_tests.end_to_end.session import assert_within, run_request

# ---- planning before GO -------------------------------------------------------------------


@pytest.mark.parametrize("ms", [0, 1, 2, 3, 5, 8, 12, 20, 50])
def test_go_at_any_moment_of_planning(ms):
    """The run is the same, whether its beginning is planned, is being planned, or was dropped."""
    session = rt.loaded()
    session.ready(run_request(24, 1, rt.FRAMES, 300, 300))
    session.speed(1, rt.VELOCITY, rt.ACCELERATION)  # planning begins again
    session.run(ms / 1000)
    assert not session.moving
    before = session.positions
    session.forget().accept(p.RtGo())
    rt.to_the_end(session)
    assert len(rt.judged(session, before, roll=0.3)) == 1


@pytest.mark.parametrize("ms", [1, 4, 9, 20, 60])
@pytest.mark.parametrize("cause", ["E-stop", "lost host"])
def test_a_stop_while_the_beginning_is_planned(cause, ms):
    """Nothing moves, GO is refused, and afterwards the same run plays as if nothing had
    happened."""
    session = rt.loaded(estop="nc")
    session.input("estop", 0).run(0.05).ready(run_request(24, 1, rt.FRAMES, 300, 300))
    session.speed(1, rt.VELOCITY, rt.ACCELERATION)  # planning begins again
    session.run(ms / 1000)
    before = session.positions
    session.forget()
    if cause == "E-stop":
        session.input("estop", 1).run(0.1).refuse(p.Ack.ERR_GENERAL, p.RtGo())
        session.input("estop", 0).run(0.1)
    else:
        session.leave()
        session.board.run_until(session.board.now_ns + 10**8)
        session.come_back().run(0.1)
    session.refuse(p.Ack.ERR_GENERAL, p.RtGo()).run(0.5)
    assert session.positions == before
    assert not session.moving
    assert not session.trace().motors
    session.ready(run_request(24, 1, rt.FRAMES, 300, 300)).forget()
    session.accept(p.RtGo())
    rt.to_the_end(session)
    assert len(rt.judged(session, before, roll=0.3)) == 1


def test_what_is_planned_before_go_makes_no_edge():
    session = rt.loaded()
    session.ready(run_request(24, 1, rt.FRAMES, 300, 300)).run(0.3)
    before = session.positions
    session.forget().accept(p.MotorStopAll())
    rt.to_the_end(session, 1)
    assert session.positions == before
    assert not session.trace().motors
    session.refuse(p.Ack.ERR_GENERAL, p.RtGo())
    # away and back: MOVE starts from the motor's position
    session.ready(run_request(24, 1, rt.FRAMES, 300, 300)).run(0.3)
    for place in (before[1] + 700, before[1]):
        session.accept(p.MotorMove(1, place))
        session.refuse(p.Ack.ERR_NOT_IN_POSITION, p.RtGo()).wait_idle().run(0.1)
    session.forget().accept(p.RtGo())
    rt.to_the_end(session)
    assert len(rt.judged(session, before, roll=0.3)) == 1


# ---- refusals, without motion ---------------------------------------------------------


def test_refused_keeps_what_waits():
    """A refused run does not affect a waiting one."""
    session = rt.loaded()
    session.ready(
        run_request(24, 1, rt.FRAMES, 500, 500, flags=rt.STILLS, open_angle=90, close_angle=180)
    )
    session.refuse(
        p.Ack.ERR_RANGE,
        run_request(24, 1, 99),
        run_request(12, 0, 5),
        p.RtShootFrame(99, 1, 100, 500),
    )
    session.refuse(p.Ack.ERR_PREROLL, run_request(12, 20, 3, 1, 500, flags=rt.VIDEO))
    session.refuse(p.Ack.ERR_RANGE, p.RtShootFrame2(3, 100, 50, 20), p.RtJogAll(24000, 99))
    before = session.positions
    session.forget().accept(p.RtGo())
    rt.to_the_end(session)
    rt.judged(session, before)
    assert len(rt.camera(session)) == rt.FRAMES


@pytest.mark.parametrize(
    "request_",
    [run_request(24, 25, 1), p.RtShootFrame(20, 1, 100, 500), p.RtShootFrame2(20, 300, 0, 180)],
)
def test_go_too_early(request_):
    """Field note 6.1: 0x16 until all are in position; a client that waits for zero before its GO is
    accepted."""
    session = rt.loaded()
    for motor in rt.MOVE:
        session.speed(motor, 4000, 20_000)
    session.accept(request_)
    early = 0
    while session.moving:
        begun = session.now
        code = session.code(p.RtGo())
        if code == p.Ack.OK:
            break
        assert code == p.Ack.ERR_NOT_IN_POSITION
        early += 1
    else:
        begun = session.now
        session.accept(p.RtGo())
    assert early > 10
    session.run(0.5)
    for motor in rt.MOVE:
        times, _ = session.steps(motor)
        assert not np.any(np.abs(times - begun) < 0.001), "it had not arrived"
    rt.to_the_end(session)


def test_go_with_a_motor_disabled_meanwhile():
    session = rt.loaded()
    for request in (run_request(24, 1, rt.FRAMES), p.RtShootFrame(5, 1, 100, 500)):
        session.ready(request)
        session.accept(p.MotorConfigure(2, 0)).forget()
        session.refuse(p.Ack.ERR_GENERAL, p.RtGo()).run(0.2)
        assert not session.trace().motors
        session.accept(p.MotorConfigure(2, 3), p.RtGo())
        rt.to_the_end(session)


# ---- stops at any time -----------------------------------------------------------------------


OPERATIONS = {
    "run": run_request(
        24, 1, rt.FRAMES, 400, 400, sync_dmx=1, bloop_outputs=8, bloop_channel=40, bloop_ms=300
    ),
    "stills": run_request(
        24, rt.FRAMES, 1, 400, 400, flags=rt.STILLS, sync_dmx=1, open_angle=0, close_angle=300
    ),
    "loop": run_request(24, 1, rt.FRAMES, 300, 0, flags=rt.LOOP, sync_dmx=1),
    "ping-pong": run_request(24, 1, 9, 0, 200, flags=rt.PING_PONG | rt.STILLS),
    "shoot": p.RtShootFrame(12, 1, 400, 700),
    "shoot 2": p.RtShootFrame2(12, 400, -60, 400),
    "jog": p.RtJogAll(24000, rt.FRAMES),
    "position": p.RtPositionFrame(rt.FRAMES),
}
STOPS = ("stop all", "twice", "stop one", "stop and all", "lost host")


def stop(session, how, rng):
    if how == "stop one":
        session.accept(p.MotorStop(rng.choice((1, 2))))
    elif how == "stop and all":
        session.accept(p.MotorStop(1)).run(rng.random() * 0.05)
        session.accept(p.MotorStopAll())
    elif how == "lost host":
        session.leave()
    else:
        session.accept(p.MotorStopAll())
        if how == "twice":
            session.run(rng.choice((0, rng.random() * 0.3))).accept(p.MotorStopAll())


@pytest.mark.parametrize("how", STOPS)
@pytest.mark.parametrize("name", OPERATIONS)
def test_stopped_at_any_moment(name, how):
    """In the end all rest after ramps within the limits, RT_END comes once for runs and exposures,
    and nothing is left on."""
    rng = random.Random(f"{name} {how}")
    session = rt.loaded()
    for _ in range(3):
        if name == "jog":
            session.accept(p.RtPositionFrame(rng.choice((1, 10)))).wait_idle()
        before = session.positions
        session.forget().accept(OPERATIONS[name])
        reports = name not in ("jog", "position")
        begun = 0
        if reports and rng.random() < 0.8:
            session.wait_idle().accept(p.RtGo())
            begun = session.now
            session.run(rng.random() * (2.5 if name in ("loop", "ping-pong") else 1.7))
        else:
            session.run(rng.random() * 0.4)
        over = bool(session.events(p.RtEnd))
        stop(session, how, rng)
        session.run(7 if name == "jog" and how in ("stop all", "stop one", "stop and all") else 1.3)
        if how == "lost host":
            session.come_back().run(0.1)
            assert not [e for e in session.events(p.RtEnd) if not over]
        elif reports:
            assert len(session.events(p.RtEnd)) == 1, (begun, how)
        else:
            assert not session.events(p.RtEnd)
        assert not session.moving
        factor = 4 if how == "twice" else 1
        for motor in rt.MOVE:
            times, signs = session.steps(motor)
            if len(times) > 2:
                assert_within(times, signs, rt.VELOCITY, factor * rt.ACCELERATION)
            assert session.position(motor) == before[motor] + signs.sum()
        for signal in rt.ALL_OFF:
            if name != "position" or not signal.startswith("gio"):  # those have its frame's levels
                assert rt.level_now(session, signal) == 0, signal
        assert rt.level_now(session, "dmx40") == 0
        if reports:
            session.refuse(p.Ack.ERR_GENERAL, p.RtGo())
        # after any of these the rig works
        session.accept(p.RtPositionFrame(3)).wait_idle()
        assert session.positions[1] == rt.MOVE[1][2]
        assert session.positions[2] == rt.MOVE[2][2]


def test_lost_host_while_it_waits():
    """In each state before GO; nothing is prepared for the next host."""
    for request in (OPERATIONS["stills"], OPERATIONS["shoot"], OPERATIONS["shoot 2"]):
        for wait in (0.05, 3):
            session = rt.loaded()
            session.accept(request).run(wait).leave().run(0.6)
            session.come_back().run(0.1)
            assert not session.moving
            assert not session.events(p.RtEnd)
            session.refuse(p.Ack.ERR_GENERAL, p.RtGo())
            assert session.ask(p.MotorGetPosition())


def test_lost_host_that_comes_back_at_once():
    """While the motors still ramp down: the next host gets no RT_END of an operation that it does
    not know."""
    session = rt.loaded()
    for motor in rt.MOVE:
        session.speed(motor, rt.VELOCITY, 20_000)
    session.ready(run_request(12, 1, rt.FRAMES))
    session.accept(p.RtGo()).run(1).leave().run(0.005)
    session.come_back()
    assert session.moving
    session.run(1)
    assert not session.events(p.RtEnd)
    assert not session.moving
    # the next run has its reports
    rt.go(session, run_request(12, 1, rt.FRAMES))
    rt.to_the_end(session)
