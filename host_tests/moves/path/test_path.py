"""The smooth path through uploaded frames (field note 5.6), against Hermite cubics in numpy and
exact fractions."""

import itertools
from array import array
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.polynomial import Polynomial

from framestep.moves.path import path, path_check

LOWEST, HIGHEST = -(2**31), 2**31 - 1
FREE = (LOWEST, HIGHEST)
FAR = 2**24  # steps per frame; in a slope, more counts as this


def slope(frames, index, bounds=FREE, most=path.MONOTONE, exact=0):
    """Return the path's slope at a frame of these positions, steps per frame."""
    last = len(frames) - 1
    window = array("i", [int(frames[min(max(index + i, 0), last)]) for i in range(-2, 3)] + [most])
    return Fraction(
        path.slope(window, array("i", (*bounds, exact)), index, last - index), path.TWELFTHS
    )


def slopes(frames, bounds=FREE):
    return [slope(frames, index, bounds) for index in range(len(frames))]


def hermite(p, q, m, n):
    """Return the cubic from p to q within [0, 1] with slopes m and n at its ends."""
    p, q, m, n = map(float, (p, q, m, n))
    return Polynomial([p, m, 3 * (q - p) - 2 * m - n, 2 * (p - q) + m + n])


def curve(frames, bounds=FREE):
    """Return the cubics between the frames, one after the other."""
    made = slopes(frames, bounds)
    return [
        hermite(*pair, *ends)
        for pair, ends in zip(itertools.pairwise(frames), itertools.pairwise(made), strict=True)
    ]


small = st.integers(-10_000, 10_000)
moves = st.lists(small, min_size=2, max_size=12)


# ---------------------------------------------------------------- slopes


@pytest.mark.parametrize(
    "coefficients", [(5, 700), (0, 900, 12), (0, 2000, -24, 1), (9, 9000, 30, -4, 1)]
)
def test_inside_a_move_the_slope_of_sampled_motion_up_to_the_fourth_power_is_exact(coefficients):
    motion = Polynomial(coefficients)
    frames = [round(motion(k)) for k in range(9)]
    for k in range(2, 7):
        assert float(slope(frames, k)) == pytest.approx(motion.deriv()(k), abs=1e-6)


@pytest.mark.parametrize("coefficients", [(5, 700), (0, 900, 12)])
def test_at_either_end_the_slope_is_that_of_the_parabola_through_three_frames(coefficients):
    motion = Polynomial(coefficients)
    frames = [round(motion(k)) for k in range(9)]
    for k in (0, 1, 7, 8):
        assert float(slope(frames, k)) == pytest.approx(motion.deriv()(k), abs=1e-6)


def test_a_move_of_a_single_frame_stands_still():
    assert slopes([1234]) == [0]


def test_two_frames_are_joined_by_a_straight_line():
    assert slopes([100, 350]) == [250, 250]


@given(moves)
def test_played_backward_the_path_is_the_same(frames):
    assert slopes(frames[::-1]) == [-s for s in reversed(slopes(frames))]


def test_where_the_rate_changes_within_a_frame_the_lesser_slope_counts_half_as_much():
    """The curve takes twice as long to come to rest: with more it would pass the frame and come
    back."""
    assert slope([0, 900, 905, 910], 1) == 15
    assert slope([0, 900, 905, 910], 1, most=path.FROM_REST) == Fraction(15, 2)


def test_a_motor_with_play_turns_exactly_at_the_frame():
    assert slope([0, 100, 200, 180, 160], 2) == 40
    assert slope([0, 100, 200, 180, 160], 2, exact=40) == 0
    assert slope([0, 100, 200, 250, 260], 2, exact=40) > 0


@given(moves)
def test_turning_a_window_round_gives_the_slope_of_the_move_backward(frames):
    last = len(frames) - 1
    for index in range(len(frames)):
        window = array(
            "i", [frames[min(max(index + i, 0), last)] for i in range(-2, 3)] + [path.MONOTONE]
        )
        path.reverse(window, 2)
        bounds = array("i", (*FREE, 0))
        assert path.slope(window, bounds, last - index, index) == -12 * slope(frames, index)


@given(moves, st.integers(-(2**30), 2**30))
def test_where_in_the_range_of_positions_a_move_lies_does_not_matter(frames, place):
    assert slopes([place + f for f in frames]) == slopes(frames)


# ---------------------------------------------------------------- the curve


@given(st.lists(st.integers(0, 5000), min_size=1, max_size=11), st.sampled_from((1, -1)))
def test_between_frames_that_go_one_way_the_curve_never_turns(steps, way):
    frames = [way * place for place in itertools.accumulate(steps, initial=0)]
    x = np.linspace(0, 1, 101)
    for cubic in curve(frames):
        assert (way * cubic.deriv()(x)).min() >= -1e-6


@given(moves)
def test_the_path_does_not_leave_a_hold(frames):
    """field note 5.6: between two equal neighbours the motor rests."""
    made = slopes(frames)
    for k, (before, after) in enumerate(itertools.pairwise(frames)):
        if before == after:
            assert (made[k], made[k + 1]) == (0, 0)


def test_a_single_frame_held_twice_in_a_move_stops_there():
    assert slopes([0, 100, 200, 200, 300, 400])[2:4] == [0, 0]


@given(st.lists(st.integers(1, 5000), min_size=3, max_size=11))
def test_in_passing_through_a_frame_it_keeps_half_the_lesser_slope_or_more(steps):
    frames = list(itertools.accumulate(steps, initial=0))
    for k in range(1, len(frames) - 1):
        lesser = min(frames[k] - frames[k - 1], frames[k + 1] - frames[k])
        assert Fraction(lesser, 2) <= slope(frames, k) <= 3 * lesser


@given(st.lists(small, min_size=3, max_size=9), st.integers(0, 20))
def test_no_soft_limit_that_holds_all_frames_is_passed_between_them(frames, room):
    bounds = (min(frames) - room, max(frames) + room)
    x = np.linspace(0, 1, 201)
    for cubic in curve(frames, bounds):
        places = cubic(x)
        assert places.min() >= bounds[0] - 1e-6
        assert places.max() <= bounds[1] + 1e-6


def test_a_turning_point_far_from_any_limit_is_passed_in_motion():
    assert slope([0, 100, 160, 140, 0], 2) == Fraction(60 - 20, 2)


def test_a_turning_point_on_a_limit_is_a_halt():
    assert slope([0, 100, 160, 140, 0], 2, (0, 160)) == 0


def test_a_motion_from_rest_needs_twice_the_room_at_a_turning_point():
    """Its first frame takes twice as long, so the slope counts twice."""
    frames = [0, 100, 160, 140, 0]  # with the slope 20
    for room, made in ((3, 20), (2, 0)):
        assert slope(frames, 2, (0, 160 + room)) == made
    for room, made in ((6, 20), (5, 0)):
        assert slope(frames, 2, (0, 160 + room), path.FROM_REST) == made


@pytest.mark.parametrize(
    "frames", [(LOWEST, 0, HIGHEST), (HIGHEST, LOWEST, HIGHEST), (0, LOWEST, 0)]
)
def test_steps_beyond_any_motor_leave_no_word(frames):
    for k, s in enumerate(slopes(frames)):
        assert abs(s) <= 3 * FAR, k


# --------------------------------------------------------- half-way between frames (field note 7.2)


@given(st.lists(small, min_size=3, max_size=9), st.data())
def test_midway_is_where_the_curve_is_half_way_to_the_neighbour(frames, data):
    index = data.draw(st.integers(1, len(frames) - 2))
    window = array("i", [frames[min(max(index + i, 0), len(frames) - 1)] for i in range(-2, 3)])
    made = slopes(frames)
    for there, neighbour, cubic in ((1, index - 1, index - 1), (3, index + 1, index)):
        found = path.midway(window, there, int(12 * made[neighbour]), int(12 * made[index]))
        assert frames[index] + found == pytest.approx(curve(frames)[cubic](0.5), abs=0.5 + 1e-6)


def test_frames_are_near_enough_for_midway_up_to_the_steepest_slope_counted():
    window = array("i", [0, FAR, 0, -FAR, 0])
    assert not path.near(window, 1)
    assert not path.near(window, 3)
    window = array("i", [0, FAR - 8, 0, 8 - FAR, 0])
    assert path.near(window, 1)
    assert path.near(window, 3)


# ---------------------------------------------------------------- the direction


@given(st.lists(st.integers(-1, 1), min_size=1, max_size=8), st.sampled_from((1, -1)))
def test_the_way_is_that_of_the_first_change_in_the_order_played(frames, order):
    played = frames[::order]
    changes = [b - a for a, b in itertools.pairwise(played) if b != a]
    wanted = 0 if not changes else 1 if changes[0] > 0 else -1
    assert path_check.first_direction(array("i", frames), len(frames), order) == wanted


# --------------------------------------------------------- what a motor can follow (field note 5.5)

RANGE = {
    "fastest": 2**29, "steepest": 2**29, "hardest": 2**29, "pulsed": 2**29, "play": 0, "way": 1,
    "bounds": FREE,
}  # fmt: skip


def checked(frames, order=1, batch=None, **motor):
    """Return a check's words and its result, with `batch` frames handed over at a time."""
    motor = RANGE | motor
    words = array("i", [0] * path_check.CHECK_WORDS)
    words[path_check.FASTEST], words[path_check.STEEPEST] = motor["fastest"], motor["steepest"]
    words[path_check.HARDEST], words[path_check.PULSED] = motor["hardest"], motor["pulsed"]
    words[path_check.LOWEST], words[path_check.HIGHEST] = motor["bounds"]
    words[path_check.BACKLASH] = motor["play"]
    words[path_check.OFFSET] = -motor["play"] if motor["way"] < 0 else 0
    played = list(frames)[::order]
    size = batch or len(played)
    for at in range(0, len(played), size):
        part = played[at : at + size]
        found = path_check.check(words, array("i", part[::order]), len(part), order)
        if found != path_check.FITS:
            return words, found
    return words, path_check.TOO_FAST if words[path_check.FASTEST_AT] else path_check.FITS


@pytest.mark.parametrize("order", [1, -1])
@pytest.mark.parametrize("way", [1, -1])
def test_a_step_of_the_velocity_allowed_fits_and_one_more_does_not(way, order):
    assert checked([0, way * 100], order, fastest=100)[1] == path_check.FITS
    words, found = checked([0, 0, way * 101], order, fastest=100)
    assert found == path_check.TOO_FAST
    assert words[path_check.FASTEST] == 101
    assert words[path_check.FASTEST_AT] == (2 if order > 0 else 1)


def test_a_step_from_end_to_end_of_the_range_is_too_fast():
    words, found = checked([0, 2**28 + 1, LOWEST, HIGHEST, LOWEST], fastest=2**28)
    assert found == path_check.TOO_FAST
    assert words[path_check.FASTEST_AT] == 2, "nothing is faster"


@given(moves, st.integers(1, 5), st.sampled_from((1, -1)))
def test_the_fastest_of_the_frames_that_are_too_fast_is_found(frames, batch, order):
    words, found = checked(frames, order, batch, fastest=3000)
    steps = np.abs(np.diff(frames[::order]))
    fastest = int(steps.max()) if len(steps) else 0
    if fastest > 3000:
        assert found == path_check.TOO_FAST
        assert words[path_check.FASTEST] == fastest
        assert words[path_check.FASTEST_AT] == int(steps.argmax()) + 1
    else:
        assert found == path_check.FITS


def test_what_is_wrong_after_a_frame_that_is_too_fast_does_not_hide_a_faster_one():
    words, found = checked([0, 11, 21, 20, 80], fastest=10, bounds=(0, 20), hardest=11, steepest=11)
    assert (found, words[path_check.FASTEST], words[path_check.FASTEST_AT]) == (
        path_check.TOO_FAST,
        60,
        4,
    )


@pytest.mark.parametrize(
    "frames, found",
    [([5, 10], path_check.FITS), ([5, 11], path_check.TOO_HIGH), ([-5, -6], path_check.TOO_LOW)],
)
def test_a_frame_on_a_soft_limit_fits_and_one_step_past_it_does_not(frames, found):
    assert checked(frames, bounds=(-5, 10))[1] == found


def test_a_single_frame_needs_nothing_of_a_motor_but_its_range():
    assert checked([7], fastest=0, steepest=0, bounds=(7, 7))[1] == path_check.FITS


@given(moves, st.integers(1, 5), st.sampled_from((1, -1)), st.integers(1, 20_000))
def test_it_is_the_same_check_in_pieces(frames, batch, order, steepest):
    limits = {"fastest": 12_000, "steepest": steepest, "hardest": steepest}
    whole, in_pieces = checked(frames, order, **limits), checked(frames, order, batch, **limits)
    assert whole[1] == in_pieces[1]
    if whole[1] == path_check.TOO_FAST:
        reported = path_check.FASTEST, path_check.FASTEST_AT
    else:
        reported = path_check.FOUND, path_check.SEEN
    if whole[1] != path_check.FITS:
        assert [whole[0][word] for word in reported] == [in_pieces[0][word] for word in reported]


@given(moves, st.integers(1, 20_000))
def test_a_change_of_step_above_the_acceleration_is_too_steep_where_that_is_refused(
    frames, steepest
):
    sharpest = max((abs(x) for x in np.diff(frames, 2)), default=0)
    _, found = checked(frames, steepest=steepest, hardest=steepest)
    assert found == (path_check.TOO_STEEP if sharpest > steepest else path_check.FITS)


@given(moves, st.integers(1, 20_000))
def test_otherwise_the_sharpest_corner_is_only_noted(frames, steepest):
    words, found = checked(frames, steepest=steepest)
    corners = np.abs(np.diff(frames, 2))
    sharpest = int(corners.max()) if len(corners) else 0
    assert found == path_check.FITS
    if sharpest > steepest:
        assert words[path_check.SHARPEST] == sharpest
        assert words[path_check.SHARPEST_AT] == int(corners.argmax()) + 1
    else:
        assert words[path_check.SHARPEST] == 0


def test_what_the_kernel_or_the_pulse_engine_cannot_do_is_too_hard():
    assert checked([0, 0, 300], steepest=10, hardest=299)[1] == path_check.TOO_HARD
    assert checked([0, 0, 300], steepest=10, pulsed=599)[1] == path_check.TOO_HARD
    assert checked([0, 0, 300], steepest=10, hardest=300, pulsed=600)[1] == path_check.FITS


@pytest.mark.parametrize(
    "frames, way, order", [([0, 60, 20], 1, 1), ([0, -60, -20], -1, 1), ([20, 60, 0], 1, -1)]
)
def test_where_the_path_turns_the_motor_makes_up_for_its_play_as_well(frames, way, order):
    """40 steps of path and 30 of play: the cubic for both is half as fast again, plus an eighth of
    the next frame's."""
    most = 70 + 70 // 2 + 60 // 8
    assert checked(frames, order, play=30, way=way, fastest=most)[1] == path_check.FITS
    words, found = checked(frames, order, play=30, way=way, fastest=most - 1)
    assert found == path_check.TOO_FAST
    assert words[path_check.FASTEST] == most, "what it needs, not the mean of the frame"


def test_play_taken_up_beforehand_costs_nothing_in_a_path_that_goes_one_way():
    assert checked([0, -60, -120], play=30, way=-1, fastest=60)[1] == path_check.FITS
    assert checked([0, -60, -120], play=30, way=1, fastest=60)[1] == path_check.TOO_FAST
