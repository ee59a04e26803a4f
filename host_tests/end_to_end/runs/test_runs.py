"""Uploaded moves on the host simulation: upload, positioning, runs forward and backward, whole and
in part."""

import numpy as np
import pytest

from framestep.pulse import stepper
from framestep_tools import payloads as p
from framestep_tools.judge.judge import frame_times_ns, judge
from framestep_tools.simulator.boards import SimulatedBoard
from host_tests.end_to_end.runs.moves import FRAMES, MOVE, assert_played, section
from host_tests.end_to_end.session import Session, assert_within, deceleration, run_request

# ---- RUN_MOVE, GO, RT_END ------------------------------------------------------------------------


@pytest.mark.parametrize(
    "more", [{}, {"flags": 0}, {"flags": 0, "open_angle": 0, "close_angle": 180}]
)
def test_run_in_all_three_lengths(both, more):
    for motor in MOVE:
        both.speed(motor, 20000, 100_000)
    both.upload(MOVE)
    request = run_request(24, 1, FRAMES, **more)
    assert len(request.pack()) in (29, 31, 35)
    before = both.play(request)
    assert_played(both, before, MOVE, 24)


@pytest.fixture
def reported(loaded):
    """A run of MOVE from beginning to end, and when each frame was on its motors' pins."""
    loaded.ready(run_request(24, 1, FRAMES, 700, 300))
    before = loaded.positions
    loaded.forget().accept(p.RtGo()).run(0.7 + FRAMES / 24 + 1)
    verdict = assert_played(loaded, before, MOVE, 24)
    loaded.frames_s = (verdict.origin_ns + frame_times_ns(FRAMES, 24000)) * 1e-9
    return loaded


@pytest.mark.needs("prompt")
def test_a_report_at_each_frames_time_has_its_move_time_and_positions(reported):
    """Field note 4.6; within 4 ms, by when a motor may have gone on for 5 ms."""
    first_of = {}
    for time, message in reported.events(p.Positions):
        if time > reported.frames_s[0] - 0.05:
            first_of.setdefault(message.move_time, (time, message))
    for i in range(1, FRAMES):
        time, message = first_of[1000 * (i + 1)]
        assert 0 <= time - reported.frames_s[i] <= 0.004, f"frame {i + 1}"
        for motor, steps in MOVE.items():
            rate = abs(int(steps[i]) - int(steps[i - 1])) * 24
            assert abs(message.steps[motor - 1] - steps[i]) <= rate * 0.005 + 2, f"frame {i + 1}"


@pytest.mark.needs("prompt")
def test_the_end_of_a_run_is_reported_once_when_all_motors_are_at_rest(reported):
    """Field note 6.4: after a frame and the post-roll."""
    ((end, _),) = reported.events(p.RtEnd)
    assert end - reported.frames_s[-1] == pytest.approx(1 / 24 + 0.3, abs=0.01)
    before_end = [steps[steps < end][-1] for steps in (reported.steps(m)[0] for m in MOVE)]
    assert 0 <= end - max(before_end) <= 0.01
    assert reported.moving == []


# With smoothing a roll is half a step longer or shorter, and its acceleration is not constant.
unsmoothed = pytest.mark.parametrize("fast", [{"smoothing": False}], indirect=True, ids=["exact"])


@unsmoothed
@pytest.mark.parametrize(("first", "last"), [(1, 25), (25, 1), (4, 20), (20, 4), (7, 8)])
@pytest.mark.parametrize("roll", [(1000, 400), (400, 1000)])
def test_roll_positions(loaded, first, last, roll):
    """Field notes 6.2 and 6.11: p − ½·v·T before the first frame, by constant acceleration; after
    the last one a frame at the same velocity and then ½·v·T."""
    pre, post = (ms / 1000 for ms in roll)
    fps = 24
    loaded.ready(run_request(fps, first, last, *roll))
    velocity = 60 * fps * (1 if last > first else -1)
    assert loaded.position(1) == round(MOVE[1][first - 1] - velocity * pre / 2)
    before = loaded.positions
    loaded.forget().accept(p.RtGo()).until(p.RtEnd, 10)
    end = loaded.now
    loaded.run(0.5)
    times, signs = loaded.steps(1)
    assert before[1] + signs[times < end].sum() == round(
        MOVE[1][last - 1] + velocity * (1 / fps + post / 2)
    )
    assert loaded.position(1) == MOVE[1][last - 1]
    times, signs = times[times < end], signs[times < end]
    rate = abs(velocity)
    assert_within(times, signs, rate * 1.001, rate / min(pre, post), window=0.1)
    # the roll lasts T: its edges show a constant acceleration
    n = int(rate * pre / 2)
    begun = times[n - 1] - pre
    ideal = begun + (2 * np.arange(1, n + 1) * pre / rate) ** 0.5
    assert np.abs(times[:n] - ideal).max() < 1e-4
    if abs(last - first) > 1:
        assert_played(loaded, before, section(first, last), fps, smooth=False)


def test_single_frame(loaded):
    """Field note 6.5: START = END moves there, then RT_END."""
    for frame in (12, 1, 25):
        loaded.ready(run_request(24, frame, frame, 500, 500)).forget()
        loaded.accept(p.RtGo()).until(p.RtEnd, 3).run(0.3)
        assert not loaded.events(p.RtEnd)
        for motor, steps in MOVE.items():
            assert loaded.position(motor) == steps[frame - 1]
        assert loaded.ask_positions().move_time == frame * 1000


@unsmoothed
@pytest.mark.parametrize("post", [0, 500])
@pytest.mark.parametrize(("first", "last"), [(1, 25), (25, 1)])
def test_pre_roll_of_no_time(loaded, first, last, post):
    """Field note 6.2: as short as the motor's own acceleration allows, if it moves at the first
    frame."""
    loaded.speed(1, 20000, 20_000)
    before = loaded.play(run_request(24, first, last, 0, post))
    assert_played(loaded, before, section(first, last), 24, smooth=False)
    velocity = 60 * 24 * (1 if last > first else -1)
    way = velocity * abs(velocity) / (2 * 20_000)
    assert before[1] == pytest.approx(MOVE[1][first - 1] - way, abs=1)
    if not post:
        _, signs = loaded.steps(1)
        farthest = before[1] + (np.cumsum(signs).max() if velocity > 0 else np.cumsum(signs).min())
        assert farthest == pytest.approx(MOVE[1][last - 1] + velocity / 24 + way, abs=1)
    # motor 2 has five times the acceleration and twice the velocity: it starts later, and keeps to
    # its own acceleration
    for motor, acceleration in ((1, 20_000), (2, 100_000)):
        times, signs = loaded.steps(motor)
        assert_within(times, signs, 20000, acceleration)
        n = int(abs(before[motor] - MOVE[motor][first - 1]))
        assert n > 8
        ramp = times[:n] - times[0]
        assert ramp == pytest.approx(
            ((2 * np.arange(1, n + 1)) ** 0.5 - 2**0.5) / acceleration**0.5, abs=3e-4
        )


def test_no_roll_at_rest(fast):
    """A move that begins and ends at rest starts at its first frame."""
    steps = np.round(500 * (1 - np.cos(np.linspace(0, 2 * np.pi, 30)))).astype(int)
    steps[:3], steps[-3:] = 0, 0
    positions = {1: steps, 2: steps + 3}
    fast.upload(positions)
    before = fast.play(run_request(24, 1, 30, 0, 0))
    assert before[1] == 0
    assert before[2] == 3
    assert_played(fast, before, positions, 24)
    assert fast.position(1) == 0


def test_a_second_run_and_after(loaded):
    """The same upload as often as wanted, with other moves between; each run has its own
    reports."""
    for _ in range(2):
        before = loaded.play(run_request(24, 1, FRAMES))
        assert_played(loaded, before, MOVE, 24)
        loaded.accept(p.MotorMove(1, -300)).wait_idle()
        assert loaded.position(1) == -300
    loaded.refuse(p.Ack.ERR_GENERAL, p.RtGo())


def test_motors_without_a_part_hold_still(loaded):
    """Field notes 5.4 and 3.1: no data, not enabled, under live control."""
    loaded.accept(p.MotorConfigure(2, 0), p.MotorConfigure(4, 0x01 | 0x08))
    loaded.accept(p.MotorResetPosition(2, 77), p.MotorResetPosition(4, -3))
    loaded.ready(run_request(24, 1, FRAMES))
    before = loaded.positions
    assert before[2] == 77
    assert before[4] == -3
    loaded.forget().accept(p.RtGo()).run(0.2)
    assert loaded.code(p.MotorMove(4, 300)) == p.Ack.OK, (
        "a motor under live control moves during a run"
    )
    loaded.run(0.3).accept(p.MotorJog(4, 5000, 500), p.MotorStop(4)).until(p.RtEnd, 10).run(0.5)
    trace = loaded.trace()
    assert 2 not in trace.motors
    assert 4 in trace.motors
    del trace.signals["m4"]
    assert judge(trace, {1: MOVE[1]}, 24000, before).good


def test_moving_bits_from_the_acknowledgement_on(loaded):
    loaded.accept(p.RtPositionFrame(9))
    assert loaded.moving == [1, 2]  # motor 4 is there already
    loaded.wait_idle().accept(run_request(24, 1, FRAMES))
    assert set(loaded.moving) >= {1, 2}
    loaded.wait_idle().accept(p.RtGo())
    assert loaded.ask(p.MotorStatus()).motor_bits == 0b1011
    loaded.until(p.RtEnd, 10)


# ---- stopping a run ------------------------------------------------------------------------------


@pytest.mark.parametrize("after", [0.2, 0.5, 0.9, 1.6])
@pytest.mark.parametrize("hard", [False, True])
def test_stop_all_in_a_run(loaded, after, hard):
    """Field note 6.6: the motors ramp down, RT_END comes once; in the pre-roll, at its end, between
    frames, in the post-roll."""
    loaded.speed(1, 20000, 20_000).ready(run_request(24, 1, FRAMES, 500, 500))
    before = loaded.positions
    loaded.forget().accept(p.RtGo()).run(after)
    loaded.accept(*[p.MotorStopAll()] * (2 if hard else 1))
    asked = loaded.now
    loaded.run(1.0)
    assert len(loaded.events(p.RtEnd)) == 1
    assert loaded.moving == []
    times, signs = loaded.steps(1)
    if after in (0.5, 0.9):
        expected = 80_000 if hard else 20_000
        assert deceleration(times, signs, asked) == pytest.approx(expected, rel=0.05)
    for motor in MOVE:
        assert loaded.position(motor) == before[motor] + loaded.made(motor)
    loaded.refuse(p.Ack.ERR_GENERAL, p.RtGo())
    before = loaded.play(run_request(24, 1, FRAMES))
    assert_played(loaded, before, MOVE, 24)


@pytest.mark.needs("inside")
@pytest.mark.parametrize("smoothing", [True, False])
@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize(
    "velocity, acceleration, each",
    [(26, 183, 15), (15, 183, 15), (15, 183, 14), (15, 100, 15), (100, 400, 95), (60, 1500, 60)],
)
def test_the_shortest_ramps_of_slow_motors(velocity, acceleration, each, sign, smoothing):
    """The kernel keeps to the motor's velocity and acceleration, though the motor waits on a whole
    step and the smoothed path begins beside one."""
    board = SimulatedBoard({"smoothing": smoothing})
    session = Session(board)
    session.speed(1, velocity, acceleration).accept(p.MotorResetPosition(1, sign))
    session.upload({1: [0, sign * each, 2 * sign * each]})
    session.ready(run_request(1, 1, 3, 0, 0))
    session.accept(p.RtGo())
    block = board._board.controller.axes.axes[0].block
    times, found = [], []
    while session.moving or len(found) < 100:
        session.run(0.001)
        times.append(session.now)
        found.append(block[stepper.VELOCITY] / stepper.ONE * 1000)
    # from its first frame to the second a smoothed path may have a step more; the kernel's word
    # holds the velocity of the next tick, with its acceleration
    assert max(map(abs, found)) <= max(velocity, each + smoothing) * 1.01 + acceleration * 0.001
    times, found = np.array(times), np.array(found)
    rates = np.abs(found[10:] - found[:-10]) / (times[10:] - times[:-10])
    assert 0.4 * acceleration < rates.max() <= 1.03 * acceleration
    assert np.abs(found).max() > 0.9 * each
