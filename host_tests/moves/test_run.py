"""RUN_MOVE (field notes 5.2, 6.1 to 6.11): refusals, where the motors wait, and where they are at
each frame."""

import math
from fractions import Fraction

import numpy as np
import pytest

from framestep.motion import reals
from framestep.moves.operation_runner import IDLE, POSITIONING, READY, RUNNING
from framestep.moves.run import RunMove
from framestep.moves.run_plan import LONGEST_ROLL
from framestep.protocol import messages as m
from host_tests.fakes import OperationBench
from host_tests.pulse.engine import PER_TICK

WAVE = [round(60 * k + 300 * np.sin(k / 2)) for k in range(16)]


class Run:
    """A run of an upload; the times of edges count from the tick in which it starts."""

    def __init__(self, *paths, **settings):
        self.bench = OperationBench(*paths, **settings)
        self.run = RunMove(self.bench.operations, self.bench.run_outputs)
        self.store = self.bench.store

    def prepare(self, fps=25, start=None, end=None, pre=200, post=200, angles=(0, 0), **draft):
        start = self.store.start if start is None else start
        end = self.store.end if end is None else end
        for field in ("loops", "turns", "video", "stills"):
            setattr(self.run.draft, field, draft.pop(field, False))
        assert not draft
        return self.run.prepare(round(fps * 1000), start, end, pre, post, *angles)

    def play(self, fps=25, **request):
        """Prepare it, GO, wait until it rests; places come from the edges after GO."""
        assert self.prepare(fps, **request) == m.OK
        self.bench.until(READY).run(5)
        self.waits = self.places
        self.bench.operations.start()
        self.bench.until(RUNNING)
        self.began = self.bench.now()
        self.starts = self.run.begin_ms
        return self

    def rest(self):
        self.bench.rest()
        return self

    @property
    def places(self):
        return [self.bench.place(motor) for motor in range(self.bench.axes.count)]

    def at(self, ms, motor=0):
        """Return where a motor is, `ms` milliseconds after the first frame."""
        return self.bench.place_at(self.began + (self.starts + ms) * PER_TICK, motor)


def due(number, fps):
    """Return the milliseconds from the first frame played to another."""
    return round(Fraction(number * 10**9) / round(fps * 1000)) / 1000


# ---------------------------------------------------------------- refusals


@pytest.mark.parametrize(
    "request_, code",
    [
        ({}, m.OK),
        ({"start": 0}, m.ERR_RANGE),  # field note 5.2
        ({"end": 17}, m.ERR_RANGE),
        ({"start": 16, "end": 1}, m.OK),  # field note 6.5
        ({"start": 16, "end": 0}, m.ERR_RANGE),
        ({"fps": 0}, m.ERR_RANGE),
        ({"fps": 0.001}, m.OK),
        ({"fps": 120}, m.OK),
        ({"fps": 200.001}, m.ERR_RANGE),
        ({"pre": LONGEST_ROLL, "fps": 0.01}, m.OK),
        ({"pre": LONGEST_ROLL + 1, "fps": 0.01}, m.ERR_RANGE),
        ({"pre": -1}, m.ERR_RANGE),
        ({"post": LONGEST_ROLL + 1}, m.ERR_RANGE),
        ({"angles": (361, 0)}, m.ERR_RANGE),
        ({"angles": (0, 361)}, m.ERR_RANGE),
        ({"angles": (0, 360)}, m.OK),
    ],
)
def test_what_lies_outside_its_range_is_refused(request_, code):
    run = Run(WAVE)
    assert run.prepare(**request_) == code
    assert run.bench.operations.state == (POSITIONING if code == m.OK else IDLE)


def test_a_run_without_a_finished_upload_is_refused():
    """field note 5.2"""
    assert Run(None).prepare(start=1, end=1) == m.ERR_GENERAL


def test_frames_too_far_apart_for_that_rate_are_refused():
    """field note 5.5"""
    run = Run([0, 100, 200], velocity=2400)
    assert run.prepare(fps=24) == m.OK
    assert run.prepare(fps=24.5) == m.ERR_RANGE


def test_a_refused_run_leaves_the_one_that_waits():
    run = Run([0, 100, 200], velocity=2400)
    run.prepare(fps=24)
    run.bench.until(READY)
    plan = run.run.plan
    assert run.prepare(fps=100) == m.ERR_RANGE
    assert run.run.plan is plan
    assert run.bench.operations.may_go() == m.OK
    run.bench.operations.start()
    assert run.bench.rest().place() == 200


@pytest.mark.parametrize("lower, code", [(-250, m.OK), (-249, m.ERR_PREROLL)])
def test_a_limit_in_the_way_of_the_pre_roll_is_refused(lower, code):
    """field note 6.2: 100 steps per frame at 25 frames/s for 200 ms make 250 steps."""
    run = Run(range(0, 1000, 100))
    run.bench.limit(lower)
    assert run.prepare() == code


@pytest.mark.parametrize(
    "upper, code", [(900 + 100 + 250, m.OK), (900 + 100 + 249, m.ERR_POSTROLL)]
)
def test_a_limit_in_the_way_of_the_post_roll_is_refused(upper, code):
    """field notes 6.2 and 6.11: after the last frame, which lasts its period."""
    run = Run(range(0, 1000, 100))
    run.bench.limit(None, upper)
    assert run.prepare() == code


def test_a_limit_switch_in_the_way_is_refused():
    run = Run(WAVE)
    run.bench.safety.code = m.ERR_HARD_LOW
    assert run.prepare() == m.ERR_HARD_LOW
    assert run.bench.operations.state == IDLE


# ---------------------------------------------------------------- where the motors wait


@pytest.mark.parametrize("fps", [1, 23.976, 120])
@pytest.mark.parametrize("way", [1, -1])
def test_the_motors_wait_half_the_pre_rolls_way_before_the_first_frame(fps, way):
    """field note 6.2: p(start) - ½·v·T"""
    run = Run([way * 40 * k for k in range(5)])
    run.prepare(fps, pre=300)
    run.bench.until(READY)
    assert run.bench.place() == pytest.approx(-way * 0.5 * 40 * fps * 0.3, abs=0.5)


def test_a_pre_roll_of_no_time_takes_the_motors_own_acceleration():
    """field note 6.2: v²/2a, rounded up to a step, at constant acceleration."""
    run = Run(range(0, 1000, 100), acceleration=50_000)
    run.prepare(pre=0, post=0)
    run.bench.until(READY)
    way = math.ceil(2500**2 / 2 / 50_000)
    assert run.bench.place() == -way
    assert run.run.plan.pre_ms == 2 * way * 1000 // 2500 + 1


def test_motors_that_need_less_time_for_it_wait_for_the_slowest():
    """All reach the first frame at the same time."""
    run = Run(range(0, 1000, 100), range(0, 100, 10), acceleration=50_000)
    run.play(pre=0).rest()
    assert run.waits == [-63, -1]
    assert [run.at(0.1, motor) for motor in (0, 1)] == [0, 0]


def test_a_single_frame_has_no_pre_roll():
    """field note 6.5"""
    run = Run([70])
    run.play().rest()
    assert run.waits == [70]
    assert run.places == [70]
    assert run.bench.reported == [1000]
    assert run.bench.ends == 1


# ---------------------------------------------------------------- where they are


@pytest.mark.parametrize("fps", [10, 23.976, 25, 120])
@pytest.mark.parametrize("start, end", [(1, 16), (16, 1), (5, 11), (11, 5), (7, 8)])
def test_at_each_frames_time_a_motor_has_made_the_uploaded_steps(fps, start, end):
    """field notes 5.6 and 6.5: exactly, except for the time the engine takes to make a step."""
    path = [p // 4 for p in WAVE]
    run = Run(path)
    run.play(fps, start=start, end=end).rest()
    step = 1 if end > start else -1
    for n, number in enumerate(range(start, end + step, step)):
        around = sorted(run.at(due(n, fps) + late) for late in (-0.05, 0.25))
        assert around[0] <= path[number - 1] <= around[1], number


@pytest.mark.parametrize("fps", [23.976, 29.97, 120])
def test_the_durations_of_a_thousand_frames_add_up_to_the_time_of_the_last(fps):
    """Each is a difference of rounded times in whole microseconds, so no rounding adds up."""
    run = Run([0] * 1001)
    run.prepare(fps)
    run.run.begin_lap()
    player, durations = run.bench.player, []
    player.append_frame = lambda bits, index, step, duration, *more: durations.append(
        reals.value(player.numbers, duration)
    )
    for _ in range(1000):
        run.run._queue()
    assert sum(round(1000 * ms) for ms in durations) == round(1000 * due(1000, fps))


def test_frames_of_five_seconds_are_in_time():
    run = Run([0, 40, 20], velocity=500)
    run.play(0.2, end=2).rest()
    assert run.at(due(1, 0.2) + 0.25) == 40
    assert run.bench.reported == [1000, 2000]


@pytest.mark.parametrize("start, end", [(101, 116), (116, 101), (104, 104)])
def test_each_frame_is_reported_once_by_its_scene_number(start, end):
    """field notes 4.6, 5.1 and 6.4"""
    run = Run(WAVE, start=101)
    run.play(start=start, end=end).rest()
    step = 1 if end >= start else -1
    assert run.bench.reported == [1000 * number for number in range(start, end + step, step)]
    assert run.bench.ends == 1


@pytest.mark.parametrize("ticks", [2**29 - 100, 2**29 - 500, 2**29 - 1000])
def test_the_counter_of_ticks_may_wrap_in_the_middle_of_a_run(ticks):
    run = Run(WAVE, ticks=ticks)
    run.play().rest()
    assert run.bench.reported == [1000 * number for number in range(1, 17)]
    assert run.at(due(15, 25) + 0.1) == WAVE[15]


def test_after_the_post_roll_it_goes_back_to_the_end_frame():
    """field note 6.11: 100 steps of the last frame and 250 of the ramp after it, then back
    again."""
    run = Run(range(0, 1000, 100))
    run.play()
    while not run.bench.ends:
        run.bench.run()
    assert run.bench.place() == 900 + 100 + 250
    run.rest()
    assert run.bench.place() == 900
    assert run.bench.ends == 1


def test_a_motor_without_data_stands_still():
    """field note 5.4"""
    run = Run(WAVE, None)
    run.play().rest()
    assert run.bench.bench.engines[1].rises == []


# ---------------------------------------------------------------- the play head (field note 4.6)


def test_move_time_is_the_start_frame_in_the_pre_roll_then_runs_on_to_the_end_frame():
    run = Run(WAVE, start=101)
    run.play(10)
    heads = []
    while not run.bench.ends:
        run.bench.run()
        if run.bench.operations.state == RUNNING:
            heads.append(run.bench.operations.sample_move_time(False))
    assert heads[0] == 101_000
    assert heads[-1] == 116_000
    assert np.diff(heads).min() >= 0
    middle = heads[run.starts + 50 : run.starts + 1400]
    assert set(np.diff(middle)) <= {9, 10, 11}, "a hundred ticks to the frame"


# ---------------------------------------------------------------- loops (field note 6.6)


@pytest.mark.parametrize("kind, turned", [("loops", False), ("turns", True)])
def test_a_loop_runs_until_stop_loop_and_a_ping_pong_turns(kind, turned):
    path = [0, 30, 50, 60, 90]
    run = Run(path)
    run.play(**{kind: True})
    while len(run.bench.reported) < 7:
        run.bench.run()
    run.run.stop_loop()
    run.rest()
    once = [1000, 2000, 3000, 4000, 5000]
    assert run.bench.reported == once + (once[::-1] if turned else once)
    assert run.places == [path[0] if turned else path[-1]]
    assert run.bench.ends == 1


def test_stop_loop_before_go_makes_it_a_single_pass():
    """field note 6.12"""
    run = Run([0, 30, 50])
    run.prepare(loops=True)
    run.bench.until(READY)
    run.run.stop_loop()
    run.bench.operations.start()
    run.bench.rest()
    assert run.bench.reported == [1000, 2000, 3000]


def test_a_ping_pong_turns_with_a_ramp():
    """No step from one velocity to its opposite: the motor rests between the ramps."""
    run = Run([100 * k for k in range(6)])
    run.play(turns=True, pre=100, post=100)
    while len(run.bench.reported) < 7:
        run.bench.run()
    assert run.run.plan.ends[0] == 500 + 125
    _, ways = run.bench.bench.times()
    assert np.cumsum(ways).max() == 625
    run.run.stop_loop()
    run.rest()


# -------------------------------------------------------------- long moves, and their cues


def test_65535_frames_are_checked_and_prepared():
    path = np.arange(65_535) * 3
    run = Run(path)
    assert run.prepare(120) == m.OK
    assert run.run.plan.frames == 65_534
    assert run.run.plan.ends[0] == path[-1]


@pytest.mark.parametrize(
    "angles, kept", [((0, 0), (90, 180)), ((180, 90), (90, 180)), ((10, 350), (10, 350))]
)
def test_stills_without_angles_are_open_from_90_to_180_degrees(angles, kept):
    """field note 6.9"""
    run = Run(WAVE)
    run.prepare(stills=True, angles=angles)
    assert (run.run.plan.open_angle, run.run.plan.close_angle) == kept


def test_the_show_begins_with_the_pass_and_ends_with_it():
    run = Run(WAVE)
    run.play().rest()
    (begin,) = [call for call in run.bench.run_outputs.calls if call[0] == "begin"]
    _, plan, first, step, starts, tick, closing = begin
    assert plan is run.run.plan
    assert (first, step, closing) == (0, 1, True)
    assert tick - starts == 200
    assert run.bench.run_outputs.calls[-1] == ("end",)
