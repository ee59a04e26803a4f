"""The smoothed path of a run: at a frame's time a motor has made the uploaded steps."""

import itertools
from array import array

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from framestep.moves.path import path, smoothing

LOWEST, HIGHEST = -(2**31), 2**31 - 1
FREE = (LOWEST, HIGHEST)
SAMPLES = 48  # within a frame


def passed(frames, index, bounds=FREE, exact=0):
    """Return the path's offset from a frame's position, steps, and its slope there."""
    last = len(frames) - 1
    around = (frames[min(max(index + i, 0), last)] for i in range(-path.BESIDE, path.BESIDE + 1))
    window = array("i", [*map(int, around)])
    window.extend([0] * (path.SMOOTH_WORDS - len(window)))
    slope = smoothing.slope(window, array("i", (*bounds, exact)), index, last - index)
    return window[path.PART] / 65536, slope / 12 / 2 ** window[smoothing.BITS]


def curve(frames, bounds=FREE, exact=0):
    """Return (places, slopes) at all frames."""
    found = [passed(frames, index, bounds, exact) for index in range(len(frames))]
    return np.array(frames) + [beyond for beyond, _ in found], np.array([s for _, s in found])


def cubics(places, slopes):
    """Return samples of the path, a row for each frame, which contains both ends."""
    x = np.linspace(0, 1, SAMPLES + 1)
    rise = np.diff(places)[:, None]
    a, b = slopes[:-1, None], slopes[1:, None]
    return places[:-1, None] + x * (a + x * (3 * rise - 2 * a - b + x * (a + b - 2 * rise)))


def motor_at_frames(frames, rows):
    """Follow the path as a motor does, which steps when the path is a whole step away; return its
    positions at the frames, and the lowest and highest between each two."""
    stands, found, reached = frames[0], [frames[0]], []
    for row in rows:
        ends = [stands]
        for place in row:
            if place >= stands + 1 - 1e-9:
                stands = int(np.floor(place + 1e-9))
            elif place <= stands - 1 + 1e-9:
                stands = int(np.ceil(place - 1e-9))
            ends.append(stands)
        found.append(stands)
        reached.append((min(ends), max(ends)))
    return found, reached


few = st.integers(-3, 3)
some = st.integers(-40, 40)
many = st.integers(-5000, 5000)
moves = st.one_of(
    *(st.lists(size, min_size=2, max_size=24) for size in (few, some, many)),
    *(
        st.lists(size, min_size=2, max_size=24).map(lambda d: list(itertools.accumulate(d)))
        for size in (few, some, many)
    ),
    st.lists(some, min_size=2, max_size=24).map(
        lambda d: list(itertools.accumulate(itertools.accumulate(d)))
    ),
    st.lists(st.tuples(some, st.integers(1, 9)), min_size=2, max_size=8).map(
        lambda runs: [step for step, count in runs for _ in range(count)]
    ),
)


@given(moves)
@example([0, 0, 0, 62, 62, 62, 62, 62, 62, 40])
@example([0, 130, 131, 131, 130, 131, 131, 0])
def test_at_each_frame_the_motor_stands_on_its_position(frames):
    assert motor_at_frames(frames, cubics(*curve(frames)))[0] == frames


@given(moves, st.integers(0, 1))
def test_between_frames_on_its_way_it_does_not_turn(frames, exact):
    """Nor in a hold. It may pass the position of a turn, as without smoothing."""
    _, reached = motor_at_frames(frames, cubics(*curve(frames, exact=exact)))
    for k, (low, high) in enumerate(reached):
        a, b = frames[k : k + 2]
        turns = k > 0 and (frames[k] - frames[k - 1]) * (b - a) < 0
        turns |= k + 2 < len(frames) and (frames[k + 2] - frames[k + 1]) * (b - a) < 0
        if not turns or exact:
            assert (low, high) == (min(a, b), max(a, b))


@given(moves)
def test_it_does_not_pass_a_limit(frames):
    bounds = min(frames), max(frames)
    found, reached = motor_at_frames(frames, cubics(*curve(frames, bounds)))
    assert found == frames
    assert min(low for low, _ in reached) >= bounds[0]
    assert max(high for _, high in reached) <= bounds[1]


@given(moves)
def test_no_frame_is_passed_a_step_beside_its_position(frames):
    places, _ = curve(frames)
    assert np.abs(places - frames).max() < 1


@given(moves)
def test_backward_is_the_mirror_image(frames):
    """The slopes are the same; backward the path passes the smoothed position on the other side."""
    places, slopes = curve(frames)
    back, falls = curve(frames[::-1])
    assert np.array_equal(slopes, -falls[::-1])
    assert np.abs(places - back[::-1]).max() <= 1
    assert np.abs((places + back[::-1]) / 2 - frames).max() <= 122 / 256


@given(moves, st.sampled_from([2**30, LOWEST + 100_000, HIGHEST - 100_000]))
def test_it_does_not_matter_where(frames, shift):
    places, slopes = curve(frames)
    others, same = curve([step + shift for step in frames])
    if max(map(abs, frames)) < 100_000:
        assert np.array_equal(others - shift, places)
        assert np.array_equal(same, slopes)


@given(st.lists(st.integers(LOWEST + 1, HIGHEST), min_size=2, max_size=12))
def test_positions_as_far_apart_as_can_be(frames):
    """No number overflows: between turns the slope follows the positions around it."""
    for index in range(1, len(frames) - 1):
        back = frames[index] - frames[index - 1]
        ahead = frames[index + 1] - frames[index]
        beyond, slope = passed(frames, index)
        assert abs(beyond) < 1
        if back > 0 and ahead > 0:
            assert 0 <= slope <= 3 * (min(back, ahead) + 1)
        elif back < 0 and ahead < 0:
            assert 0 >= slope >= -3 * (min(-back, -ahead) + 1)


@pytest.mark.parametrize("rate", [0.4, 1.618, 7.3, 61.7])
def test_a_line_is_nearly_a_line(rate):
    """Rounding moves positions by up to half a step and leaves slopes wrong by up to a step."""
    frames = [round(rate * index + 0.3) for index in range(120)]
    places, slopes = curve(frames)
    assert np.abs(slopes[10:-10] - rate).max() < 0.1
    assert np.abs(np.diff(places)[10:-10] - rate).max() < 0.12


def test_a_parabola_of_whole_steps_is_left_alone():
    frames = [index * index for index in range(1, 40)]
    places, slopes = curve(frames)
    assert np.array_equal(places[8:-8], np.array(frames[8:-8]) + 0.5)
    assert slopes[8:-8] == pytest.approx(2 * np.arange(1, 40)[8:-8])


def test_a_hold_is_a_hold():
    frames = [0] * 20 + [10 * index for index in range(1, 12)] + [110] * 20
    places, slopes = curve(frames)
    assert not slopes[1:20].any()
    assert not slopes[30:-1].any()
    assert not (places - frames)[4:16].any()
    assert not (places - frames)[36:-4].any()
    assert list((places - frames)[16:20]) == [0.125, 0.25, 0.375, 0.5]
    assert list((places - frames)[30:34]) == [0.5, 0.375, 0.25, 0.125]
