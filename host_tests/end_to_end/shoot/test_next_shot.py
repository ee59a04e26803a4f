"""A button that shoots the next frame, and the delays of a camera, on the host simulation."""

import itertools

import numpy as np
import pytest

from framestep_tools import payloads as p
from framestep_tools.move.half_frame import ends
from host_tests.end_to_end.realtime import (
    ACCELERATION,
    FRAMES,
    MOVE,
    STILLS,
    camera,
    edges,
    go,
    to_the_end,
    upload,
)
from host_tests.end_to_end.realtime import rig as realtime_rig
from host_tests.end_to_end.session import run_request

BUTTON = 28


def rig(**settings):
    session = realtime_rig(
        outputs=[{"pin": 22}], inputs=[{"pin": 27}, {"pin": BUTTON}], shoot_input=2, **settings
    )
    upload(session)
    return session


def press(session, seconds=0.1):
    session.input(BUTTON, 0).run(seconds).input(BUTTON, 1).run(0.1)


def first(session, request):
    """Let the host shoot a frame."""
    session.ready(request)
    session.accept(p.RtGo()).until(p.RtEnd, 20).wait_idle().forget()


def shot(session):
    """Press the button and wait until the frame is shot. Return when the shutter was open, and the
    edges of motors 1 and 2."""
    session.forget()
    press(session)
    session.until(p.RtEnd, 20).run(0.2).wait_idle()
    (opened, _), (closed, _) = edges(session, "shutter")
    return opened, closed


def test_each_press_shoots_the_next_frame():
    """Like the host's frame: exposure, angles, motors; those that do not blur rest on the frame."""
    session = rig()
    session.accept(p.MotorConfigure(2, 1))
    a, b = ends(list(MOVE[1]), 6)
    first(session, p.RtShootFrame2(7, 500, 90, 270, [p.BlurMotor(1, a, b)]))
    press(session, 0.01)  # too short to count
    session.run(1)
    assert edges(session, "shutter") == []
    for index in (7, 8, 9):
        opened, closed = shot(session)
        assert closed - opened == pytest.approx(0.5, abs=1e-3)
        assert session.position(1) == ends(list(MOVE[1]), index)[1]
        assert session.position(2) == MOVE[2][index]
        assert not np.any((session.steps(2)[0] > opened) & (session.steps(2)[0] < closed))
        assert np.any((session.steps(1)[0] > opened) & (session.steps(1)[0] < closed))


def test_without_a_host():
    """The computer has gone since the first frame."""
    session = rig()
    first(session, p.RtShootFrame2(1, 200, 0, 180))
    session.leave().run(0.3)
    session.board.edges()
    press(session)
    session.run(5)
    shutter = [edge for edge in session.board.edges() if edge[1] == "shutter"]
    assert [value for _, _, value in shutter] == [1, 0]


def test_a_shot_that_waits_for_go():
    """The button gives GO, and the host is told so; while it runs, nothing more."""
    session = rig()
    session.ready(p.RtShootFrame2(5, 500, 0, 360)).forget()
    press(session)
    assert len(session.events(p.RtGo)) == 1
    press(session)
    session.until(p.RtEnd, 20).run(3).wait_idle()
    assert len(edges(session, "shutter")) == 2
    assert session.position(1) == ends(list(MOVE[1]), 4)[1]


def test_backward():
    session = rig()
    first(session, p.RtShootFrame(5, 0, 500, 1000, []))
    shot(session)
    steps = session.steps(1)[1]
    assert steps.sum() < 0
    session.accept(p.RtPositionFrame(4)).wait_idle().forget()


def nothing_shot(session):
    press(session)
    session.run(3)
    assert edges(session, "shutter") == []
    assert not session.events(p.RtEnd)


def test_nothing_to_shoot():
    """No frame of the upload has been shot; the last frame has; another operation waits."""
    session = rig()
    session.forget()
    nothing_shot(session)
    first(session, p.RtShootFrame2(FRAMES, 200, 0, 180))
    nothing_shot(session)
    first(session, p.RtShootFrame2(1, 200, 0, 180))
    upload(session)  # another sequence
    nothing_shot(session)
    first(session, p.RtShootFrame2(1, 200, 0, 180))
    session.ready(run_request(24, 1, 5)).forget()
    nothing_shot(session)


def stop_by(session, stop):
    """Stop what moves."""
    if stop == "all":
        session.accept(p.MotorStopAll())
    elif stop == "one":
        session.accept(p.MotorStop(1))
    elif stop == "leave":
        session.leave()
    else:
        session.input("estop", 1).run(0.1).input("estop", 0)


@pytest.mark.parametrize("stop", ["all", "one", "estop"])
def test_a_stop_on_the_way_ends_it(stop):
    """Nothing goes on by itself."""
    session = rig(estop="nc")
    session.input("estop", 0).run(0.1)
    first(session, p.RtShootFrame2(1, 200, 0, 180))
    session.accept(p.MotorMove(1, 9000)).wait_idle()
    press(session, 0.05)
    assert 1 in session.moving
    stop_by(session, stop)
    session.wait_idle().forget().run(3)
    assert edges(session, "shutter") == []
    assert len(session.steps(1)[0]) == len(session.steps(2)[0]) == 0


@pytest.mark.parametrize("stop", ["all", "one", "estop", "leave"])
def test_a_stop_while_drivers_wake_up_ends_it(stop):
    """The motors are on the frame already, so nothing but their drivers is waited for."""
    session = rig(estop="nc", motors=[{"enable_ms": 500, "off_after_s": 3}] * 2)
    session.input("estop", 0).run(0.1)
    first(session, p.RtShootFrame2(1, 200, 0, 180))
    session.accept(p.RtPositionFrame(2)).wait_idle().run(4)
    session.board.edges()
    press(session)
    stop_by(session, stop)
    session.run(4)
    assert not [edge for edge in session.board.edges() if edge[1] == "shutter"]


def test_a_frame_that_a_motor_cannot_do():
    """It is refused like a request."""
    session = rig()
    first(session, p.RtShootFrame2(3, 500, 0, 180))
    session.speed(1, 10, ACCELERATION).forget()
    press(session)
    session.run(8).wait_idle()
    assert edges(session, "shutter") == []
    found = session.ask(p.GetExceeded())
    assert (found.what, found.motor) == (1, 1)


# ---- delays of a camera


@pytest.mark.parametrize(("delay", "hold"), [(120, 0), (0, 300), (250, 80), (1500, 700)])
@pytest.mark.parametrize("angles", [(0, 360), (-90, 90), (90, 270)])
def test_shutter_delay_and_hold(delay, hold, angles):
    """The motion during the exposure is the same; the output goes on earlier and off later."""
    seen = []
    for more in ({}, {"shutter_delay_ms": delay, "shutter_hold_ms": hold}):
        session = rig(**more)
        session.ready(p.RtShootFrame2(7, 800, *angles, [])).forget()
        session.accept(p.RtGo()).until(p.RtEnd, 20)
        ended = session.now
        session.run(0.3)
        (opened, _), (closed, _) = edges(session, "shutter")
        (metered, _), (unmetered, _) = edges(session, "meter")
        assert metered < opened
        assert ended >= closed == unmetered
        if more:
            opened, closed = opened + delay / 1000, closed - hold / 1000
        assert closed - opened == pytest.approx(0.8, abs=1e-3)
        seen.append(session.steps(1)[0] - opened)
    assert np.abs(seen[0] - seen[1]).max() < 1e-4


def test_shutter_delay_and_hold_of_stills():
    """In a run the exposure of each frame is where it was."""
    seen = []
    for delay, hold in ((0, 0), (60, 40)):
        session = rig(shutter_delay_ms=delay, shutter_hold_ms=hold)
        go(session, run_request(4, 1, 6, 500, 500, flags=STILLS, open_angle=90, close_angle=180))
        to_the_end(session)
        first_step = session.steps(1)[0][0]
        seen.append(np.array(camera(session)) - first_step + [delay / 1000, -hold / 1000])
    assert len(seen[1]) == 6
    assert np.abs(seen[0] - seen[1]).max() < 1.1e-3


def test_delay_of_stills_that_do_not_fit():
    """The pulse of a frame ends before the next one's begins."""
    session = rig(shutter_delay_ms=200, shutter_hold_ms=400)
    go(session, run_request(4, 1, 6, 500, 500, flags=STILLS, open_angle=0, close_angle=180))
    to_the_end(session)
    pulses = camera(session)
    assert len(pulses) == 6
    assert all(b[0] - a[1] >= 0.0095 for a, b in itertools.pairwise(pulses))
