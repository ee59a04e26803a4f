"""Refused runs on the host simulation: too fast, too steep, limits in the way, during motion."""

import numpy as np
import pytest

from framestep import texts
from framestep.protocol import messages as m
from framestep_tools import payloads as p
from framestep_tools.client.client import RequestRefused
from framestep_tools.client.refusals import explain
from framestep_tools.judge.judge import judge
from host_tests.end_to_end.runs.moves import FRAMES, MOVE, assert_played
from host_tests.end_to_end.session import run_request, simulated


def test_run_refused_for_its_numbers(loaded):
    loaded.refuse(
        p.Ack.ERR_RANGE,
        p.RtRunMove(0, 1, 5, 500, 500),
        p.RtRunMove(2**32 - 1, 1, 5, 500, 500),
        p.RtRunMove(2**30, 1, 5, 500, 500),
        p.RtRunMove(24000, 1, 26, 500, 500),
        p.RtRunMove(24000, 0, 5, 500, 500),
        p.RtRunMove(24000, 26, 1, 500, 500),
        p.RtRunMove(24000, 1, 5, 2**32 - 1, 500),
        p.RtRunMove(24000, 1, 5, 500, 2**31),
    )
    assert loaded.moving == []


@pytest.mark.parametrize(
    "request_", [run_request(200.001, 1, 5), run_request(1000, 1, 5), p.RtJogAll(200_001, 3)]
)
def test_a_rate_above_the_board_s_is_refused_with_the_reason(loaded, request_):
    with pytest.raises(RequestRefused) as caught:
        loaded.ask(request_)
    rate = request_.fps_milli / 1000
    said = f"{rate:g} frames/s: expected more than 0, at most 200"
    assert said in str(explain(loaded.client, caught.value))
    found = loaded.ask(p.GetExceeded())
    assert (found.what, found.by, found.room) == (m.EXCEEDED_RATE, request_.fps_milli, 200_000)
    assert str(request_.fps_milli) in texts.exceeded(found.what, 0, 0, found.by, found.room)[0]
    loaded.accept(p.RtPositionFrame(1))  # nothing else has changed
    loaded.wait_idle().accept(run_request(20, 1, 2))


def test_too_fast_is_refused_at_its_rate(loaded):
    """Field note 5.5: refused if the rate exceeds the motor's limits, accepted otherwise."""
    loaded.speed(1, 1500, 100_000)  # 60 steps a frame: 25 fps
    loaded.refuse(
        p.Ack.ERR_RANGE,
        run_request(30, 1, FRAMES),
        run_request(26, 1, FRAMES),
        run_request(30, FRAMES, 1),
    )
    before = loaded.play(run_request(24, 1, FRAMES, 200, 200))
    assert_played(loaded, before, MOVE, 24)


# At 4 frames/s this is 1280 steps/s from frame to frame, but at either end 2560 by the parabola
# that leads there; and 1920 and 2440 at the third frame
STEEP_ENDS = [0, 320, 0, 320]
STEEP_FRAME = [300, 0, 480, 960, 660]


def gap(times, signs):
    """Return the least time between two steps in the same direction."""
    return np.diff(times)[signs[1:] == signs[:-1]].min()


@pytest.mark.parametrize(("first", "last"), [(1, 4), (4, 1)])
@pytest.mark.parametrize(
    ("flags", "rolls"), [(0, (300, 300)), (0, (0, 0)), (1, (300, 200)), (2, (0, 300))]
)
def test_no_end_of_a_run_is_faster_than_its_motor(fast, first, last, flags, rolls):
    """Neither the last frame's period, the rolls, the turns of a loop nor the frames are."""
    fast.upload({1: STEEP_ENDS})
    fast.speed(1, 2000, 100_000).ready(run_request(4, first, last, *rolls, flags=flags)).forget()
    fast.accept(p.RtGo()).run(4)
    fast.accept(p.RtStopLoop())
    if flags:
        fast.until(p.RtEnd, 10)
    fast.wait_idle()
    assert gap(*fast.steps(1)) >= 1 / 2000 - 2e-6
    assert fast.position(1) in STEEP_ENDS


@pytest.mark.parametrize(("first", "last"), [(2, 3), (3, 2)])
def test_no_end_of_a_part_is_faster_than_its_motor(fast, first, last):
    fast.upload({1: STEEP_FRAME})
    fast.speed(1, 2000, 100_000).ready(run_request(4, first, last, 300, 300)).forget()
    go = fast.now
    fast.accept(p.RtGo()).until(p.RtEnd, 10)
    times, signs = fast.steps(1)
    for part in (times < go + 0.3, times > go + 0.56):
        assert gap(times[part], signs[part]) >= 1 / 2000 - 2e-6


CORNERS = np.array([0, 0, 0, 50, 100, 150, 150, 150])  # 50 steps/frame² at 24 fps: 28 800 steps/s²


@pytest.mark.parametrize("acceleration", [500, 20_000, 100_000])
def test_corners_are_played_as_uploaded(fast, acceleration):
    """Field note 5.5: acceleration is no reason to refuse; each frame is met, and the excess is
    reported."""
    positions = {1: CORNERS, 2: 10 * np.arange(8)}
    fast.upload(positions, start_frame=11).speed(1, 20000, acceleration)
    before = fast.play(run_request(24, 11, 18))
    assert_played(fast, before, positions, 24)
    reported = fast.ask(p.GetExceeded())
    if acceleration < 28_800:
        assert (reported.what, reported.motor) == (2, 1)
        assert reported.frame in (13, 16)
        assert reported.by == 28_800 - acceleration
    else:
        assert reported.what == 0
    assert bool(fast.ask(p.GetCondition()).bits & 0x80) == (acceleration < 28_800)
    fast.ready(run_request(1, 11, 18))
    assert fast.ask(p.GetExceeded()).what == 0, "at this rate nothing is too steep"


def test_strict_moves():
    """The setting refuses them, with the same report."""
    fast = simulated({"strict_moves": True})
    fast.upload({1: CORNERS, 2: 10 * np.arange(8)})
    fast.speed(1, 20000, 20_000).refuse(p.Ack.ERR_RANGE, run_request(24, 1, 8))
    reported = fast.ask(p.GetExceeded())
    assert (reported.what, reported.motor, reported.frame, reported.by) == (2, 1, 3, 8_800)
    fast.accept(run_request(12, 1, 8)).wait_idle()
    assert fast.ask(p.GetExceeded()).what == 0
    fast.speed(1, 20000, 100_000)
    before = fast.play(run_request(24, 1, 8))
    assert_played(fast, before, {1: CORNERS, 2: 10 * np.arange(8)}, 24)


def test_what_is_exceeded_is_reported(fast):
    """Velocity: the first frame that is too far, and by how much."""
    fast.upload(
        {1: np.zeros(30, int), 3: np.concatenate((np.zeros(20, int), 1000 + np.zeros(10, int)))}
    )
    fast.speed(3, 20_000, 100_000).refuse(p.Ack.ERR_RANGE, run_request(24, 1, 30))
    reported = fast.ask(p.GetExceeded())
    assert (reported.what, reported.motor, reported.frame, reported.by) == (1, 3, 21, 4_000)


@pytest.mark.needs("short pulses")
@pytest.mark.parametrize("fps", [24, 60, 200])
@pytest.mark.parametrize("shape", ["jump", "stop", "zigzag"])
def test_the_sharpest_corners_that_the_board_can_make(fast, fps, shape):
    """Each frame is met as long as the board's numbers suffice; beyond that the run is refused,
    never played wrongly."""
    unit = {
        "jump": np.array([0, 0, 0, 0, 1, 1, 1, 1, 1]),
        "stop": np.array([0, 1, 2, 3, 4, 4, 4, 4, 4]),
        "zigzag": np.array([0, 0, 1, 0, 1, 0, 1, 1, 1]),
    }[shape]
    fast.speed(1, 200_000, 4_000_000)
    taken = refused = 0
    for size in (5, 20, 60, 150, 400, 1000, 3000, 7000):
        fast.upload({1: size * unit, 2: 20 * np.arange(9)})
        code = fast.code(run_request(fps, 1, 9, 500, 500))
        if code != p.Ack.OK:
            assert code == p.Ack.ERR_RANGE
            refused += 1
            continue
        assert not refused
        taken += 1
        fast.wait_idle()
        before = fast.positions
        fast.forget().accept(p.RtGo()).until(p.RtEnd, 10).wait_idle()
        assert not fast.events(p.HardStop)
        trace = fast.trace()
        verdict = judge(trace, {1: size * unit, 2: 20 * np.arange(9)}, fps * 1000, before)
        # at a turning point the last step may be missing
        assert verdict.motors[0].worst_position <= (shape == "zigzag"), (size, verdict.complaints)
        assert fast.position(1) == size * unit[-1]
    assert taken
    assert refused


@pytest.mark.parametrize("flags", [0, m.RUN_LOOP, 0x01 | 0x20], ids=["run", "loop", "ping-pong"])
def test_limits_in_the_way(loaded, flags):
    """Field note 6.2: pre-roll 0x17, post-roll 0x18; and a frame past a limit. Backward it is the
    other way round."""
    velocity = 60 * 24
    begin, end = 100 - velocity // 4, 1540 + 60 + velocity // 4
    forward = run_request(24, 1, FRAMES, 500, 500, flags=flags)
    backward = run_request(24, FRAMES, 1, 500, 500, flags=flags)
    loaded.accept(p.RtPositionFrame(1)).wait_idle().forget()
    for lower, upper, code, other in (
        (begin + 5, 5000, p.Ack.ERR_PREROLL, p.Ack.ERR_POSTROLL),
        (-5000, end - 65, p.Ack.ERR_POSTROLL, p.Ack.ERR_PREROLL),
        (-5000, 1500, p.Ack.ERR_SOFT_UP, p.Ack.ERR_SOFT_UP),
        (150, 5000, p.Ack.ERR_SOFT_LOW, p.Ack.ERR_SOFT_LOW),
    ):
        loaded.accept(p.MotorSetLimits(1, 1, lower, 1, upper))
        loaded.refuse(code, forward)
        loaded.refuse(other, backward)
    if flags & 1:  # the way back has a post-roll there
        loaded.accept(p.MotorSetLimits(1, 1, begin, 1, end))
        loaded.refuse(p.Ack.ERR_POSTROLL, forward)
        begin -= 60
    loaded.accept(p.MotorSetLimits(1, 1, begin, 1, end), p.MotorSetLimits(2, 0, 0, 1, 190))
    loaded.refuse(p.Ack.ERR_SOFT_UP, forward)
    loaded.refuse(p.Ack.ERR_GENERAL, p.RtGo()).run(0.3)
    assert not loaded.trace().motors
    assert not loaded.moving
    loaded.accept(p.MotorSetLimits(2, 0, 0, 0, 0))
    # slower or shorter fits
    loaded.accept(forward).wait_idle()
    loaded.accept(p.MotorSetLimits(1, 1, begin + 5, 1, 5000))
    loaded.accept(run_request(24, 1, FRAMES, 450, 450, flags=flags))


@pytest.mark.parametrize("flags", [0, m.RUN_LOOP, 0x01 | 0x20], ids=["run", "loop", "ping-pong"])
def test_roll_too_steep(loaded, flags):
    """A pre-roll too short for the motor's acceleration."""
    loaded.speed(1, 20000, 20_000)
    loaded.refuse(p.Ack.ERR_PREROLL, run_request(24, 1, FRAMES, 50, 500, flags=flags))
    loaded.refuse(p.Ack.ERR_POSTROLL, run_request(24, 1, FRAMES, 500, 50, flags=flags))
    loaded.accept(run_request(24, 1, FRAMES, 100, 100, flags=flags))


def test_position_frame_past_a_limit(loaded):
    loaded.accept(p.MotorSetLimits(1, 1, 200, 1, 1000), p.MotorResetPosition(1, 500))
    loaded.refuse(p.Ack.ERR_SOFT_UP, p.RtPositionFrame(25))
    loaded.refuse(p.Ack.ERR_SOFT_LOW, p.RtPositionFrame(1)).run(0.1)
    assert loaded.moving == []
    assert not loaded.trace().motors
    loaded.accept(p.RtPositionFrame(10)).wait_idle()
    assert loaded.position(1) == 640


def test_refused_while_moving(loaded):
    """0x12 to RUN_MOVE while anything moves, and during a run to everything that would disturb
    it."""
    loaded.accept(p.MotorMove(7, 2000))
    loaded.refuse(p.Ack.ERR_MOVING, run_request(24, 1, FRAMES)).wait_idle()
    loaded.ready(run_request(24, 1, FRAMES))
    before = loaded.positions
    loaded.forget().accept(p.RtGo()).run(0.6)
    loaded.refuse(
        p.Ack.ERR_MOVING, run_request(24, 1, FRAMES), p.RtGo(), p.RtPositionFrame(1),
        p.RtUploadMoveBegin(1, 3), p.RtUploadMoveAxis(1, 0, (1, 2)), p.RtUploadMoveEnd(),
        p.MotorMove(1, 0), p.MotorJog(2, 100, 0), p.MotorResetPosition(4, 0),
        p.MotorConfigure(1, 0),
    )  # fmt: skip
    loaded.until(p.RtEnd, 10).wait_idle()
    assert_played(loaded, before, MOVE, 24)
