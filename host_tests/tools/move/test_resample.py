"""Moves at other frames per second and speeds."""

import pytest

from framestep_tools.axes.axes_file import Axis
from framestep_tools.move.move_file import Move
from framestep_tools.move.resample import resampled
from host_tests.tools.conftest import imported

LINE = "# fps: 25\nframe,track,pan\n" + "".join(f"{i + 1},{i / 10},2\n" for i in range(51))


def test_another_rate_keeps_the_time(shot):
    move = imported(shot, LINE, "--to-fps", "24")
    assert (move.start_frame, move.frames, move.fps) == (1, 49, 24)
    assert move.positions[1] == [round(i * 25 / 24) for i in range(49)]
    assert imported(shot, LINE, "--to-fps", "25") == imported(shot, LINE)
    back = imported(shot, LINE, "--to-fps", "50")
    assert back.positions[1][::2] == imported(shot, LINE).positions[1]


@pytest.mark.parametrize(
    ("speed", "count"), [("50%", 101), ("200%", 26), ("100%", 51), ("40%", 126)]
)
def test_another_speed_keeps_the_path_and_ends_on_its_end(speed, count, shot):
    move = imported(shot, LINE, "--speed", speed)
    assert (move.frames, move.fps) == (count, 25)
    assert (move.positions[1][0], move.positions[1][-1]) == (0, 50)
    share = float(speed[:-1]) / 100
    assert move.positions[1] == pytest.approx([i * share for i in range(count)], abs=0.51)


def test_a_curve_is_the_boards_between_frames():
    """A parabola: fourth-order differences are exact on it, away from the ends."""
    steps = [40 * i * i for i in range(20)]
    axes = [Axis("a", 1, 1.0)]
    move = resampled(Move(7, {1: "a"}, {1: steps}), axes, 0.25, None)
    assert move.start_frame == 7
    assert move.positions[1][::4] == steps
    for i in range(3 * 4, 16 * 4):
        assert move.positions[1][i] == pytest.approx(40 * (i / 4) ** 2, abs=0.51)


def test_the_end_between_two_frames_is_reached():
    move = resampled(Move(1, {1: "a"}, {1: [0, 10, 20, 30]}), [Axis("a", 1, 1.0)], 2, 12)
    assert move.positions[1] == [0, 20, 30]
    still = resampled(Move(1, {1: "a"}, {1: [7]}), [Axis("a", 1, 1.0)], 2, 12)
    assert still.positions[1] == [7]


@pytest.mark.parametrize(
    ("text", "options", "status", "said"),
    [
        ("0.5 2\n", ["--to-fps", "24"], 1, "does not name its frames per second: name them by"),
        (LINE, ["--to-fps", "0"], 2, "--to-fps: expected frames per second from 0.001 to 1000"),
        (LINE, ["--speed", "50"], 2, "--speed: expected a share from 0.1% to 1000%, such as 50%"),
        (LINE, ["--speed", "0%"], 2, "--speed: expected a share from 0.1% to 1000%, such as 50%"),
    ],
)
def test_a_mistake_is_a_sentence(text, options, status, said, not_imported):
    assert said in not_imported(text, *options, status=status)
