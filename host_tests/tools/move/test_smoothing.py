"""Smoothing of noisy input: what it changes, what it leaves alone, and what it says."""

import math
import random

import pytest

from framestep_tools.move.smoothing import smoothed
from host_tests.tools.conftest import imported


def text(track, pan=None):
    """Return a file of positions, track in mm and pan in degrees."""
    pan = pan or [2] * len(track)
    rows = (f"{i},{a!r},{b!r}\n" for i, (a, b) in enumerate(zip(track, pan, strict=True), 11))
    return "# fps: 25\nframe,track,pan\n" + "".join(rows)


def test_by_hand():
    """The weights of a cubic over five: -3, 12, 17, 12, -3 of 35. Near the ends the first and the
    last cubic go on: -1 of 70 for the first, 2 of 35 for the second."""
    values = [0.0, 0, 0, 0, 35, 0, 0, 0, 0]
    assert smoothed(values, 5) == pytest.approx([-0.5, 2, -3, 12, 17, 12, -3, 2, -0.5])
    assert smoothed([0.0, 0, 35, 0, 0], 5) == pytest.approx([-3, 12, 17, 12, -3])


@pytest.mark.parametrize("frames", [5, 7, 31])
def test_a_cubic_stays_as_it_is(frames):
    values = [0.002 * i**3 - 0.1 * i * i + i - 7 for i in range(40)]
    assert smoothed(values, frames) == pytest.approx(values, abs=1e-9)


def test_noise_gets_less_and_the_path_stays(shot):
    rng = random.Random(1)
    path = [40 - 40 * math.cos(math.pi * i / 100) for i in range(101)]
    noisy = [at + rng.gauss(0, 0.5) for at in path]

    def far(move):
        return math.sqrt(
            sum((a / 10 - b) ** 2 for a, b in zip(move.positions[1], path, strict=True)) / 101
        )

    rough, smooth = imported(shot, text(noisy)), imported(shot, text(noisy), "--smooth", "15")
    assert far(smooth) < 0.6 * far(rough)
    assert (smooth.start_frame, smooth.frames, smooth.fps) == (11, 101, 25)
    assert smooth.positions[2] == rough.positions[2] == [0] * 101


def test_the_largest_change_is_told_in_each_axis_unit(shot, capsys):
    track, pan = [0.0] * 13, [2.0] * 13
    track[6], pan[5] = 3.5, 9.0
    move = imported(shot, text(track, pan), "--smooth", "5")
    assert move.positions[1] == [0, 0, 0, 0, -3, 12, 17, 12, -3, 0, 0, 0, 0]
    assert capsys.readouterr().err.splitlines() == [
        "track: smoothed over 5 frames, by at most 1.8 mm, at frame 17",
        "pan: smoothed over 5 frames, by at most 3.6 deg, at frame 16",
    ]


def test_full_turns_are_unwrapped_before(shot):
    pan = [(170 + 4 * i + 180) % 360 - 180 for i in range(12)]
    move = imported(shot, text([0] * 12, pan), "--smooth", "5")
    assert move.positions[2] == [-100 * (170 + 4 * i - 2) for i in range(12)]


def test_it_comes_before_another_rate(shot):
    track = [3.0 * (i % 2) for i in range(21)]
    fast = imported(shot, text(track), "--smooth", "5", "--to-fps", "50")
    assert fast.positions[1][::2] == imported(shot, text(track), "--smooth", "5").positions[1]


def test_an_axis_that_holds_says_nothing(shot, capsys):
    axes = shot / "axes.toml"
    axes.write_text(axes.read_text() + "hold = 5\n")
    imported(shot, text([1.0] * 9), "--smooth", "5")
    said = capsys.readouterr().err
    assert "track: smoothed over 5 frames, by at most 0 mm" in said
    assert "pan: smoothed" not in said


def test_limits_hold_for_what_comes_out(shot, not_imported):
    """A peak of 105 mm is beyond them, what comes out of it is not; a corner is the other way
    round."""
    flat = [50.0] * 13
    flat[6] = 105
    assert "frame 17, axis track: 105 mm" in not_imported(text(flat))
    assert max(imported(shot, text(flat), "--smooth", "5").positions[1]) == 767
    corner = [100.0] * 5 + [0.0] * 5
    assert "frame 14, axis track: 108.6 mm" in not_imported(text(corner), "--smooth=5")


@pytest.mark.parametrize(
    ("frames", "status", "said"),
    [
        *(
            (found, 2, f"--smooth: expected an odd number of frames from 5 to 999, found '{found}'")
            for found in ("4", "3", "x", "1001")
        ),
        ("11", 1, "--smooth 11 needs at least as many frames, "),
    ],
)
def test_a_mistake_is_a_sentence(frames, status, said, not_imported):
    assert said in not_imported(text([0.0] * 9), "--smooth", frames, status=status)
