"""The reference interpolant, and the picture of it."""

import numpy as np
import pytest

from framestep_tools.documents.plot_interpolation import PICTURE, draw, linear_velocity
from framestep_tools.judge.judge import frame_times_ns
from framestep_tools.judge.reference import Reference, slopes
from framestep_tools.move.move_file import read_move

MOVE = read_move()
FPS = [1000, 23_976, 24_000, 60_000]
TINY_S = 1e-9


def both(fps_milli, smooth=True):
    return Reference(MOVE.positions, fps_milli, 1000, 700, smooth=smooth), frame_times_ns(
        MOVE.frames, fps_milli
    ) * 1e-9


@pytest.mark.parametrize("smooth", [False, True])
@pytest.mark.parametrize("fps_milli", FPS)
def test_the_path_meets_every_frame_with_one_velocity(fps_milli, smooth):
    path, frames = both(fps_milli, smooth)
    for motor, steps in MOVE.positions.items():
        for side in (-TINY_S, 0, TINY_S):
            beyond = np.abs(path(motor, frames + side) - steps)
            assert beyond.max() < (1 if smooth else 1e-3)
        jumps = path.velocity(motor, frames + TINY_S) - path.velocity(motor, frames - TINY_S)
        assert np.abs(jumps).max() < 1e-3


def test_derivatives_are_those_of_the_position():
    path, frames = both(24_000)
    times = np.concatenate(
        (np.linspace(-0.9, -0.1, 20), frames[:-1] + 0.02, frames[-1] + np.linspace(0.1, 0.6, 20))
    )
    h = 1e-4
    for motor in MOVE.positions:
        before, here, behind = (path(motor, times + side) for side in (-h, 0, h))
        assert path.velocity(motor, times) == pytest.approx((behind - before) / (2 * h), abs=0.01)
        assert path.acceleration(motor, times) == pytest.approx(
            (behind - 2 * here + before) / h**2, abs=0.1
        )


def test_holds_are_still():
    path, frames = both(24_000, smooth=False)
    for motor, steps in MOVE.positions.items():
        for frame in np.flatnonzero(np.diff(steps) == 0):
            inside = np.linspace(frames[frame], frames[frame + 1], 5)
            assert np.all(path(motor, inside) == steps[frame])


def test_rolls_have_constant_acceleration_and_rest_on_steps():
    path, frames = both(24_000)
    seen = []
    for motor, steps in MOVE.positions.items():
        v, w = path.velocity(motor, np.array([0.0, frames[-1]]))
        begins, ends = path(motor, np.array([-5.0, frames[-1] + 5]))
        assert begins == round(begins)
        assert ends == round(ends)
        assert abs(begins - (steps[0] - v * 1.0 / 2)) <= 0.5
        assert abs(ends - (steps[-1] + w * (1 / 24 + 0.7 / 2))) <= 1
        assert path.acceleration(motor, np.array([-0.999, -0.001])) == pytest.approx(
            [v, v], abs=6.1
        )
        assert not path.velocity(motor, np.array([-1.001, frames[-1] + 1 / 24 + 0.701])).any()
        seen.append((bool(v), bool(w)))
    assert (True, False) in seen
    assert (False, True) in seen


def test_sections_and_backward_play_see_the_frames_outside():
    steps = MOVE.positions[1]
    for smooth in (False, True):
        whole, beyond = slopes(steps, 0, len(steps) - 1, smooth=smooth)
        velocity, same = slopes(steps, 100, 150, smooth=smooth)
        assert velocity == pytest.approx(whole[100:151], abs=0)
        assert same == pytest.approx(beyond[100:151], abs=0)
        assert slopes(steps, 150, 100, smooth=smooth)[0] == pytest.approx(-whole[150:99:-1], abs=0)
        forward = Reference({1: steps}, 24_000, 500, 500, 20, 60, smooth=smooth)
        backward = Reference({1: steps}, 24_000, 500, 500, 60, 20, smooth=smooth)
        times = np.linspace(0, 40 / 24, 200)
        # frame times are whole µs; a smooth path is half a step beyond, whichever way it goes
        assert backward(1, times) == pytest.approx(
            forward(1, 40 / 24 - times), abs=1.02 if smooth else 0.02
        )


def test_a_soft_limit_takes_the_velocity_of_a_turn():
    steps = [0, 300, 600, 540, 200, -100]
    for limits, velocity in (((None, None), 120), ((None, 617), 0), ((-100, 618), 120)):
        assert slopes(steps, 0, 5, limits, smooth=False)[0][2] == velocity


def test_a_roll_of_no_time_is_only_for_motors_at_rest():
    with pytest.raises(ValueError, match="pre-roll above 0"):
        Reference(MOVE.positions, 24_000, 0, 500)
    still = Reference({1: [0, 0, 10, 20, 20, 20]}, 24_000, 0, 0)
    assert still(1, [-1.0, 1.0]).tolist() == [0, 20]


def test_linear_is_held_for_20_ms_and_adds_up():
    for steps in MOVE.positions.values():
        times, velocity = linear_velocity(steps, 25_000)  # a frame is two of its ticks
        assert np.diff(times) == pytest.approx(0.02)
        assert steps[0] + velocity.sum() * 0.02 == pytest.approx(steps[-1], abs=200)
        assert velocity[10] == velocity[11] == pytest.approx((steps[6] - steps[5]) * 25)


def test_the_picture_is_up_to_date(tmp_path):
    """`make plots` makes it."""
    draw(MOVE, tmp_path / "again.svg")
    drawn = (tmp_path / "again.svg").read_text()
    assert drawn == PICTURE.read_text(), (
        "docs/internals/interpolation.svg is not what the source makes: run `make plots`"
    )
    assert len(drawn) < 250_000
