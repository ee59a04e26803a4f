"""The last frame of a run and the way back to it, on the host simulation (field note 6.11)."""

import numpy as np
import pytest

from framestep_tools import payloads as p
from framestep_tools.judge.judge import frame_times_ns
from host_tests.end_to_end.runs.moves import FRAMES, MOVE, assert_played, section
from host_tests.end_to_end.session import assert_within, run_request


def played_to(loaded, run):
    """Play a run up to its RT_END and no further. Return where the motors waited, and when RT_END
    came."""
    loaded.ready(run)
    before = loaded.positions
    loaded.forget().accept(p.RtGo()).until(p.RtEnd, 20)
    return before, loaded.now


@pytest.mark.needs("fine edges")
@pytest.mark.parametrize(("first", "last"), [(1, 25), (25, 1), (20, 4)])
@pytest.mark.parametrize("fps", [12, 24, 29.97])
@pytest.mark.parametrize("post", [0, 300])
def test_the_last_frame_lasts_its_period(loaded, first, last, fps, post):
    """The motors keep the end frame's velocity until END + 1 frame, then ramp; RT_END comes at the
    end of the ramp, then they return to the end frame."""
    before, end = played_to(loaded, run_request(fps, first, last, 300, post))
    loaded.wait_idle()
    assert not loaded.events(p.RtEnd), "RT_END came twice"
    verdict = assert_played(loaded, before, section(first, last), fps)
    period = 1 / fps
    reached = (
        verdict.origin_ns + frame_times_ns(abs(last - first) + 1, round(fps * 1000))[-1]
    ) * 1e-9
    times, signs = loaded.steps(1)
    inside = (times > reached + 1e-5) & (times < reached + period)
    assert abs(inside.sum() - 60) <= 1
    assert len(set(signs[inside])) == 1
    # with a short post-roll the last of its 60 steps is half a step nearer
    assert np.abs(np.diff(times[inside]) * 60 * fps - 1).max() < 0.013, "constant velocity"
    behind = (times > reached + period) & (times < end)
    assert len(set(signs[behind])) == 1
    assert np.diff(times[behind])[-1] > 2 * np.diff(times[inside])[-1]
    rest = max(t[t < end][-1] for t in (loaded.steps(motor)[0] for motor in MOVE))
    assert 0 <= end - rest < 0.02
    if post:
        assert end - reached == pytest.approx(period + post / 1000, abs=0.01)
    for motor, steps in MOVE.items():
        assert loaded.position(motor) == steps[last - 1]
    assert loaded.ask_positions().move_time == last * 1000
    # it rests on a frame, so a JOG_ALL can start from here
    loaded.accept(p.RtJogAll(12_000, 12)).wait_idle()
    assert loaded.position(1) == MOVE[1][11]


def test_the_way_back_is_a_position_frame(loaded):
    """MOTOR_STATUS reports it, it keeps to limits, POSITION_FRAME retargets it, STOP stops it,
    RUN_MOVE waits."""
    loaded.speed(1, 800, 1500)
    run = run_request(10, 1, FRAMES, 700, 700)
    _, end = played_to(loaded, run)
    assert 1 in loaded.moving
    loaded.run(0.1).refuse(p.Ack.ERR_MOVING, run)
    loaded.refuse(p.Ack.ERR_GENERAL, p.RtGo()).wait_idle()
    times, signs = loaded.steps(1)
    back = times > end
    assert set(signs[back]) == {-1}
    assert_within(times[back], signs[back], 800, 1500, window=0.1)
    assert loaded.position(1) == 1540
    # another frame in motion
    played_to(loaded, run)
    loaded.run(0.1).accept(p.RtPositionFrame(20)).wait_idle()
    assert loaded.position(1) == MOVE[1][19]
    assert loaded.ask_positions().move_time == 20_000
    # stopped
    played_to(loaded, run)
    loaded.run(0.15).accept(p.MotorStop(1)).wait_idle()
    assert MOVE[1][24] < loaded.position(1) < MOVE[1][24] + 60 + 210
    assert not loaded.events(p.RtEnd)
    loaded.play(run)


@pytest.mark.parametrize(
    "request_",
    [p.MotorMove(4, 4321), p.RtPositionFrame(20), p.MotorStop(1), p.MotorStopAll(), None],
)
def test_asked_as_motors_set_out_for_the_way_back(loaded, request_):
    """Motors start one after the other; a request in between finds all of them moving, and none
    starts later."""
    run = run_request(10, 1, FRAMES, 700, 700)
    played_to(loaded, run)
    assert loaded.moving == sorted(MOVE)
    if request_:
        loaded.client.request(request_)
    loaded.run(2)
    assert not loaded.moving
    assert not loaded.events(p.RtEnd)
    found = {motor: loaded.position(motor) for motor in MOVE}
    expected = {
        motor: steps[19 if request_ == p.RtPositionFrame(20) else 24]
        for motor, steps in MOVE.items()
    }
    if request_ == p.MotorMove(4, 4321):
        expected[4] = 4321
    elif request_ == p.MotorStop(1):
        assert found.pop(1) > expected.pop(1) + 100
    if request_ == p.MotorStopAll():
        assert found[1] > expected[1] + 100
    else:
        assert found == expected
    loaded.play(run)


def test_no_way_back_after_a_stop(loaded):
    """A run that is stopped stays where it rests."""
    for after in (0.2, 0.8, 1.62):
        loaded.ready(run_request(24, 1, FRAMES, 500, 500))
        loaded.accept(p.RtGo()).run(after).forget()
        loaded.accept(p.MotorStopAll()).until(p.RtEnd, 5)
        end = loaded.now
        loaded.run(0.5)
        assert not loaded.moving
        assert not [t for m in MOVE for t in loaded.steps(m)[0] if t > end]


def test_only_motors_of_the_run_go_back(loaded):
    """A motor that was disabled stays, even if it is enabled by then; a motor under live control
    goes to its own target."""
    loaded.accept(
        p.MotorConfigure(2, 0), p.MotorConfigure(4, 0x01 | 0x08), p.MotorResetPosition(2, 70)
    )
    loaded.ready(run_request(24, 1, FRAMES, 500, 500))
    loaded.accept(p.RtGo()).run(0.5)
    loaded.accept(p.MotorConfigure(2, 1), p.MotorMove(4, 4321)).until(p.RtEnd, 5).wait_idle()
    assert (loaded.position(1), loaded.position(2), loaded.position(4)) == (MOVE[1][24], 70, 4321)


def test_the_way_back_keeps_to_limits(loaded):
    """A way back that POSITION_FRAME would then refuse does not happen: the rig stays at the end of
    the post-roll."""
    loaded.ready(run_request(24, 1, FRAMES, 500, 500))
    loaded.accept(p.RtGo()).run(1.0)
    loaded.accept(
        p.MotorSetLimits(1, 1, 1800, 0, 0)
    )  # accepted at any time; the end frame is below
    loaded.until(p.RtEnd, 5).run(0.5)
    assert loaded.position(1) == 1540 + 60 + 360
