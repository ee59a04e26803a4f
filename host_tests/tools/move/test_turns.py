"""Jumps by full turns in a rotation."""

import pytest

from framestep_tools.move.axes_file import Axis
from framestep_tools.move.turns import said_of, turns_in
from host_tests.tools.move.move_samples import run


@pytest.mark.parametrize(
    ("degrees", "found"),
    [
        ([170, 178, -174, -166], [(1, -1, -352)]),
        ([-170, 170], [(0, 1, 340)]),
        ([0, 720, 725], [(0, 2, 720)]),
        ([0, 10, 200, 190, 0], []),
        ([0, 269], []),
        ([5], []),
    ],
)
def test_jumps_by_full_turns(degrees, found):
    assert turns_in(degrees) == found


def test_only_an_axis_that_turns_makes_turns():
    steps = [0, 3590]
    assert said_of(steps, Axis("pan", 1, 10, "deg"), 7) == [
        "pan jumps by 359° from frame 7 to 8, a full turn: its rotation has to go on beyond 180°, "
        "not to begin again"
    ]
    assert said_of(steps, Axis("pan", 1, 3590 / 6.28, "rad"), 7)
    assert not said_of(steps, Axis("track", 1, 10, "mm"), 7)
    assert not said_of(steps, None, 7)


def test_check_says_it_before_any_number(shot, capsys):
    (shot / "move.csv").write_text("frame,pan\n1,-17000\n2,-17900\n3,17800\n4,17000\n")
    assert run(shot, "check", str(shot / "move.csv")) == 7
    first, second, *_ = capsys.readouterr().out.splitlines()
    assert first.startswith("motor 2, pan: refused: at frame 3 it would need")
    assert second.startswith("  pan jumps by -357° from frame 2 to 3, a full turn: its rotation")
