"""What all plays of an uploaded move share: which motors move, whether they can follow (field note
5.5), how fast."""

from array import array

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from framestep.base import results
from framestep.motion import reals
from framestep.moves.path import move_check as module
from framestep.moves.path.path import FROM_REST, MOST
from framestep.moves.path.registers import TOP
from framestep.protocol import messages as m
from host_tests.fakes import OperationBench

LOWEST, HIGHEST = -(2**31), 2**31 - 1
WAY_UP = [1] * 8


def player_of(*paths, start=1, **settings):
    return OperationBench(*paths, start=start, **settings).player


def check_of(*paths, start=1, **settings):
    return OperationBench(*paths, start=start, **settings).move_check


def check(move_check, fps, frames=None, begin=0, step=1, ways=WAY_UP, **more):
    """Return the code for `frames` frames from the index `begin` on, of motor 1 alone."""
    count = len(move_check.store.paths[0]) if frames is None else frames
    return move_check.check(1, begin, count, round(fps * 1000), step, ways, **more)


def exceeded(move_check):
    reported = move_check.exceeded
    return {word: reported[getattr(results, word)] for word in ("WHAT", "MOTOR", "FRAME", "BY")}


def place(value):
    return array("i", [value])


# ---------------------------------------------------------------- who takes part


def test_a_motor_without_uploaded_data_has_no_part():
    """field note 5.4"""
    assert player_of([0, 1], None, [0, 1]).motors() == 0b101


def test_an_excluded_motor_has_no_part():
    """field note 3.1: disabled, or under live control."""
    player = player_of([0, 1], [0, 1], [0, 1])
    player.excluded = 0b010
    assert player.motors() == 0b101


# ---------------------------------------------------------------- how fast at a frame


@given(
    st.integers(1, module.FASTEST_FPS),
    st.lists(st.integers(-5000, 5000), min_size=3, max_size=6),
    st.data(),
)
def test_the_velocity_at_a_frame_is_the_slope_at_that_rate(fps_milli, frames, data):
    index = data.draw(st.integers(0, len(frames) - 1))
    player = SHARED
    player.store.paths = (frames,)
    player.store.end = len(frames)
    player.set_frame_rate(fps_milli)
    player.velocity(TOP, 0, index, 1)
    per_tick = player.slope(0, index, 1) / 12 * fps_milli / 1e6
    assert reals.value(player.numbers, TOP) == pytest.approx(per_tick, rel=1e-8)


SHARED = player_of([0, 0])


@pytest.mark.parametrize("way", [1, -1])
def test_no_frame_is_passed_faster_than_the_motor(way):
    """field note 5.6: at this end the slope is 150 steps per frame, 3600 steps/s."""
    bench = OperationBench([0, 0, way * 100], velocity=2400)
    player = bench.player
    assert check(bench.move_check, 24) == m.OK
    player.set_frame_rate(24_000)
    player.velocity(TOP, 0, 2, 1)
    assert reals.value(player.numbers, TOP) == pytest.approx(way * 2.4, rel=1e-8)


@pytest.mark.parametrize("index", [0, 1, 2, 4, 5])
def test_backward_it_is_the_same_velocity_the_other_way(index):
    player = player_of([0, 40, 100, 90, 90, 300])
    assert player.slope(0, index, -1) == -player.slope(0, index, 1)


def test_the_window_of_a_slope_has_the_frame_in_its_middle():
    player = player_of([7, 40, 100])
    player.slope(0, 2, -1)
    assert player.window[2] == 100


# ---------------------------------------------------------------- the direction


@pytest.mark.parametrize(
    "step, begin, frames, way", [(1, 0, 80, 1), (-1, 79, 80, -1), (1, 0, 40, 0), (-1, 79, 20, 0)]
)
def test_the_way_a_load_goes_first_is_found_behind_any_number_of_equal_frames(
    step, begin, frames, way
):
    player = player_of([5] * 45 + [6] * 35)
    assert player.first_direction(0, begin, step, frames, always=True) == way


def test_the_way_matters_to_a_motor_with_play_only():
    player = player_of([0, 9])
    assert player.first_direction(0, 0, 1, 2) == 0
    player.axes.set_backlash(0, 20)
    assert player.first_direction(0, 0, 1, 2) == 1


# ---------------------------------------------------------------- whether the motors can follow


@pytest.mark.parametrize("fps", [0.001, 0.5, 1, 23.976, 24, 60, 120])
@pytest.mark.parametrize("way", [1, -1])
@pytest.mark.parametrize("step", [1, -1])
def test_neighbouring_frames_may_lie_as_far_apart_as_the_velocity_allows_and_one_step(
    fps, way, step
):
    """field note 5.5"""
    velocity = 2400
    most = int(velocity / fps) + 1
    begin = 0 if step > 0 else 1
    # one frame more, so that the two ends are not a single step from rest
    move_check = check_of([0, way * most], velocity=velocity)
    assert check(move_check, fps, begin=begin, step=step) == m.OK
    move_check.store.paths = ([0, way * (most + 1)],)
    assert check(move_check, fps, begin=begin, step=step) == m.ERR_RANGE


def test_what_was_too_fast_is_reported_with_its_motor_its_frame_and_by_how_much():
    move_check = check_of([0, 100, 200, 350, 450], start=101, velocity=2400)
    assert check(move_check, 24) == m.ERR_RANGE
    assert exceeded(move_check) == {
        "WHAT": m.EXCEEDED_VELOCITY,
        "MOTOR": 0,
        "FRAME": 104,
        "BY": 150 * 24 - 2400,
    }


@pytest.mark.parametrize("step", [1, -1])
def test_of_all_frames_that_are_too_fast_the_fastest_is_reported(step):
    """A user who gives the motor that velocity is not refused again."""
    path = [0, 150, 250, 650, 800, 600, 500] + [500] * 40 + [250]
    move_check = check_of(path, start=101, velocity=2400)
    begin = 0 if step > 0 else len(path) - 1
    assert check(move_check, 24, frames=len(path), begin=begin, step=step) == m.ERR_RANGE
    assert exceeded(move_check) == {
        "WHAT": m.EXCEEDED_VELOCITY,
        "MOTOR": 0,
        "FRAME": 104,
        "BY": 400 * 24 - 2400,
    }
    needed = check_of(path, start=101, velocity=400 * 24)
    assert check(needed, 24, frames=len(path), begin=begin, step=step) == m.OK


def test_a_motor_that_takes_up_its_play_is_reported_what_that_needs():
    move_check = check_of([0, 100, 0], velocity=2400)
    move_check.axes.set_backlash(0, 40)
    assert check(move_check, 24) == m.ERR_RANGE
    reported = exceeded(move_check)
    assert reported["WHAT"] == m.EXCEEDED_VELOCITY
    assert reported["BY"] == (140 + 70 + 100 // 8) * 24 - 2400


def test_only_the_frames_played_count():
    move_check = check_of([0, 100, 200, 350, 450], velocity=2400)
    assert check(move_check, 24, frames=3) == m.OK
    assert check(move_check, 24, frames=4) == m.ERR_RANGE
    assert check(move_check, 24, frames=2, begin=4, step=-1) == m.OK
    assert check(move_check, 24, frames=3, begin=4, step=-1) == m.ERR_RANGE


def test_a_single_frame_is_never_too_fast():
    assert check(check_of([12_345], velocity=10), 120) == m.OK


@pytest.mark.parametrize("frame", [1, 65_534])
def test_of_65535_frames_each_is_checked(frame):
    path = np.zeros(65_535, int)
    move_check = check_of(path, velocity=2400)
    assert check(move_check, 24) == m.OK
    path[frame] = 102
    assert check(move_check, 24) == m.ERR_RANGE


def test_a_sharp_corner_is_no_reason_to_refuse_but_is_reported():
    """field note 5.5: the corners of an uploaded path are what the animator drew."""
    move_check = check_of([0, 0, 100, 200], acceleration=10_000)
    assert check(move_check, 24) == m.OK
    reported = exceeded(move_check)
    assert (reported["WHAT"], reported["FRAME"]) == (m.EXCEEDED_ACCELERATION, 2)
    assert reported["BY"] == pytest.approx(100 * 24 * 24 - 10_000, abs=1)


def test_the_sharper_corner_of_two_motors_is_reported():
    move_check = check_of([0, 0, 100, 200], [0, 0, 0, 200], acceleration=10_000)
    assert move_check.check(3, 0, 4, 24_000, 1, WAY_UP) == m.OK
    assert (exceeded(move_check)["MOTOR"], exceeded(move_check)["FRAME"]) == (1, 3)


def test_strict_moves_refuse_it():
    move_check = check_of([0, 0, 100, 200], acceleration=10_000)
    move_check.strict = True
    assert check(move_check, 24) == m.ERR_RANGE
    assert exceeded(move_check)["WHAT"] == m.EXCEEDED_ACCELERATION


def test_a_move_that_fits_reports_nothing():
    move_check = check_of([0, 0, 100, 200], acceleration=10_000)
    check(move_check, 24)
    assert check(move_check, 1) == m.OK
    assert exceeded(move_check)["WHAT"] == m.EXCEEDED_NOTHING


def test_a_corner_that_the_board_cannot_make_is_refused():
    corner = int(module.HARDEST / 120 / 120)
    move_check = check_of([0, 0, 2 * corner], velocity=500_000)
    assert check(move_check, 120) == m.ERR_RANGE
    assert exceeded(move_check)["WHAT"] == m.EXCEEDED_BOARD


@pytest.mark.parametrize(
    "path, code", [([0, 51], m.ERR_SOFT_UP), ([0, -51], m.ERR_SOFT_LOW), ([50, -50], m.OK)]
)
def test_a_frame_past_a_soft_limit_is_refused(path, code):
    bench = OperationBench(path)
    bench.limit(-50, 50)
    assert check(bench.move_check, 24) == code


@pytest.mark.parametrize(
    "acceleration, rate", [(410, 24_000), (400, 24_000), (390, 2792), (50, 1000), (1, 141)]
)
def test_with_a_ramp_the_rate_is_come_to_within_the_acceleration(acceleration, rate):
    """JOG_ALL: 100 steps per frame at 4 frames/s² are 400 steps/s²; within a frame a rate grows by
    half its square."""
    move_check = check_of(range(0, 100 * 60, 100), acceleration=acceleration)
    assert check(move_check, 24, ramp=4) == m.OK
    assert move_check.rate == pytest.approx(rate, abs=2)


@pytest.mark.parametrize("step", [1, -1])
@pytest.mark.parametrize("velocity", [10, 999, 1001, 20_000])
def test_with_a_ramp_the_rate_is_what_the_steepest_frame_allows(velocity, step):
    """field note 5.5: JOG_ALL slows down instead of refusing."""
    path = np.cumsum([0] + [60] * 30 + [70, 80, 90, 100, 100, 100, 100, 90, 80, 70] + [60] * 30)
    move_check = check_of(path, velocity=velocity, acceleration=1_000_000)
    begin = 0 if step > 0 else len(path) - 1
    assert check(move_check, 24, begin=begin, step=step, ramp=4) == m.OK
    assert move_check.rate == pytest.approx(min(24_000, velocity * 10), rel=0.03)
    if move_check.rate < 24_000:
        assert move_check.exceeded[results.WHAT] == m.EXCEEDED_SLOWED
        assert move_check.exceeded[results.BY] == move_check.rate
        assert abs(move_check.exceeded[results.FRAME] - 35) <= 4


@given(
    st.lists(st.integers(-3000, 3000), min_size=3, max_size=80),
    st.integers(10, 20_000),
    st.integers(1, 400_000),
)
def test_with_a_ramp_the_curve_is_within_velocity_and_acceleration(path, velocity, acceleration):
    bench = OperationBench(path, velocity=velocity, acceleration=acceleration)
    assume(check(bench.move_check, 24, ramp=4) == m.OK)
    rate = bench.move_check.rate / 1000
    bench.player.window[MOST] = FROM_REST
    slopes = np.array([bench.player.slope(0, k, 1) for k in range(len(path))]) / 12
    steps = np.diff(path)
    inner = slice(1, -1)
    bend = np.maximum(
        np.abs(6 * steps - 4 * slopes[:-1] - 2 * slopes[1:]),
        np.abs(6 * steps - 2 * slopes[:-1] - 4 * slopes[1:]),
    )[inner]
    gathered = np.maximum(
        np.abs(2 * slopes[:-1] - slopes[1:]), np.abs(2 * slopes[1:] - slopes[:-1])
    )[inner]
    needed = np.maximum(bend - 7, 0) * rate**2 + np.maximum(gathered - 1, 0) * min(4, rate**2 / 2)
    assert np.all(needed <= acceleration * 1.01 + rate**2)
    x = np.linspace(0, 1, 21)[:, None]
    a, b, s = slopes[:-1], slopes[1:], steps
    speeds = np.abs(a * (1 - x) ** 2 + (3 * s - a - b) * 2 * x * (1 - x) + b * x**2)[:, inner]
    assert np.all(speeds * rate <= velocity + 1.1 * rate)


def test_no_rate_is_less_than_a_frame_in_a_thousand_seconds():
    assert check(check_of([0, 6_000], velocity=10), 24, ramp=4) == m.OK
    move_check = check_of([0, 10_010], velocity=10)
    assert check(move_check, 24, ramp=4) == m.ERR_RANGE
    assert move_check.exceeded[results.WHAT] == m.EXCEEDED_BOARD


# ------------------------------------------------------- ramps to and from a frame (field note 6.2)


def register(move_check, index, value):
    """Write a number into a register; denominators of 2^20 are exact."""
    reals.put(move_check.numbers, index, round(value * 2**20), -20)
    return index


@pytest.mark.parametrize("backward, wanted", [(True, 1000 - 75), (False, 1000 + 75)])
def test_a_roll_makes_half_the_way_of_its_velocity(backward, wanted):
    """p - v·T/2: 0.5 steps a tick, reached within 300 ticks."""
    move_check = check_of([0, 0])
    places = place(1000)
    velocity, ticks = register(move_check, TOP, 0.5), register(move_check, TOP + 2, 300)
    assert move_check.apply_roll(0, velocity, ticks, backward, places)
    assert places[0] == wanted


@pytest.mark.parametrize("acceleration, fits", [(1667, True), (1666, False)])
def test_a_roll_steeper_than_the_motor_can_is_refused(acceleration, fits):
    """0.5 steps a tick within 300 ticks are 1666.7 steps/s²."""
    move_check = check_of([0, 0], acceleration=acceleration)
    velocity, ticks = register(move_check, TOP, 0.5), register(move_check, TOP + 2, 300)
    assert move_check.apply_roll(0, velocity, ticks, True, place(0)) is fits
    assert move_check.too_steep(0, velocity, ticks) is not fits


def test_a_roll_past_a_soft_limit_is_refused():
    bench = OperationBench([0, 0])
    bench.limit(-75, None)
    move_check = bench.move_check
    velocity, ticks = register(move_check, TOP, 0.5), register(move_check, TOP + 2, 300)
    assert move_check.apply_roll(0, velocity, ticks, True, place(0))
    assert not move_check.apply_roll(0, velocity, ticks, True, place(-1))


def test_without_velocity_a_roll_goes_nowhere():
    move_check = check_of([0, 0])
    places = place(9)
    assert move_check.apply_roll(
        0, register(move_check, TOP, 0), register(move_check, TOP + 2, 0), True, places
    )
    assert places[0] == 9


@pytest.mark.parametrize(
    "by, backward, moved", [(2.25, False, 2), (2.5, False, 3), (2.25, True, -2), (2.75, True, -3)]
)
def test_a_shift_is_rounded_to_the_nearest_step(by, backward, moved):
    move_check = check_of([0, 0])
    places = place(10)
    assert move_check.shift(places, 0, register(move_check, TOP, by), backward)
    assert places[0] == 10 + moved


@pytest.mark.parametrize("begin, by", [(HIGHEST, 1), (LOWEST, -1), (HIGHEST - 99, 100)])
def test_a_shift_past_the_range_of_positions_changes_nothing(begin, by):
    move_check = check_of([0, 0])
    places = place(begin)
    assert not move_check.shift(places, 0, register(move_check, TOP, by), False)
    assert places[0] == begin
