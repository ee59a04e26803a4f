"""Jumps by full turns in a rotation."""

import math

import pytest

from framestep_tools.axes.axes_file import Axis
from framestep_tools.move.turns import said_of, turns_in
from host_tests.tools.conftest import imported, run


@pytest.mark.parametrize(
    ("degrees", "found"),
    [
        ([170, 178, -174, -166], [(1, -1, -352)]),
        ([-170, 170], [(0, 1, 340)]),
        ([0, 720, 725], [(0, 2, 720)]),
        ([0, 10, 200, 190, 0], []),
        ([0, 269], []),
        ([0, 1080], []),
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


PAN = '[[axis]]\nname = "pan"\nmotor = 1\nsteps_per_unit = 100\nunit = "deg"\n'
WRAPPED = [170, 175, 179, -176, -170, -179, 179, 170]
GOES_ON = [170, 175, 179, 184, 190, 181, 179, 170]


@pytest.mark.parametrize(
    ("header", "place", "value", "options"),
    [
        ("frame,pan (deg)", lambda i: i + 1, lambda y: f"{y}", []),
        ("frame,pan (rad)", lambda i: i + 1, lambda y: f"{y * math.pi / 180:.12f}", []),
        ("seconds,pan", lambda i: f"{i / 24:.6f}", lambda y: f"{y}", ["--fps", "24"]),
        ("seconds,pan", lambda i: f"{i / 12:.6f}", lambda y: f"{y}", ["--fps", "24"]),
    ],
)
def test_rotations_go_on_beyond_a_turn(header, place, value, options, shot, capsys):
    (shot / "axes.toml").write_text(PAN)
    text = "".join(f"{place(i)},{value(y)}\n" for i, y in enumerate(WRAPPED))
    move = imported(shot, f"{header}\n{text}", *options)
    every, first = (2, 7) if move.frames > 8 else (1, 4)
    assert move.positions[1][::every] == [100 * y for y in GOES_ON]
    assert (
        f"pan jumps by full turns and goes on instead, from frames {first}, {first + 3 * every} "
        in capsys.readouterr().err
    )
    steps = imported(shot, f"{header}\n{text}", *options, "--no-unwrap").positions[1]
    assert steps[::every] == [100 * y for y in WRAPPED]
    assert "full turns" not in capsys.readouterr().err


def test_a_turn_between_distant_keyframes_is_meant(shot):
    arc = (
        '<scene><axis name="pan" units="deg"><points x="1" y="0"/><points x="{}" y="350"/>'
        '<controlPoints x="1" y="0"/><controlPoints x="{}" y="350"/></axis></scene>'
    )
    (shot / "axes.toml").write_text(PAN)
    assert imported(shot, arc.format(49, 49)).positions[1][-1] == 35000
    assert imported(shot, arc.format(2, 2)).positions[1] == [0, -1000]


@pytest.mark.parametrize(
    ("steps", "said"),
    [
        ([0, 10, 20, 9000, 9010], "  it jumps by 898 mm (8980 steps) from frame 3 to 4, and moves"),
        ([0, 10, 20, 30, 40], ""),
        ([0, 9000, 18000, 28000, 37000], "  it needs 48 times its velocity: is the unit of the"),
    ],
)
def test_check_says_what_cannot_be_followed(steps, said, shot, capsys):
    rows = "".join(f"{i},{step}\n" for i, step in enumerate(steps, 1))
    (shot / "move.csv").write_text("frame,track\n" + rows)
    assert run(shot, "check", str(shot / "move.csv")) == (7 if said else 0)
    second = capsys.readouterr().out.splitlines()[1]
    assert second.startswith(said or "  velocity")


def test_check_says_it_before_any_number(shot, capsys):
    (shot / "move.csv").write_text("frame,pan\n1,-17000\n2,-17900\n3,17800\n4,17000\n")
    assert run(shot, "check", str(shot / "move.csv")) == 7
    first, second, *_ = capsys.readouterr().out.splitlines()
    assert first.startswith("motor 2, pan: refused: at frame 3 it would need")
    assert second.startswith("  pan jumps by -357° from frame 2 to 3, a full turn: its rotation")
