"""Moves into the formats of other programs and back, and what their files mean in steps."""

import time
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from framestep_tools import cli
from framestep_tools.axes.axes_file import Axis, read_axes
from framestep_tools.axes.units import UNITS, factor
from framestep_tools.errors import ToolError
from framestep_tools.move.move_conversion import to_move, to_table
from framestep_tools.move.move_file import Move, read_move
from framestep_tools.move.move_formats import FORMATS, of_content
from framestep_tools.move.move_formats.curves import Samples, Segment, within
from host_tests.tools.conftest import ARC, LINEAR, MAYA, imported, named_in_file, run

NAMED = {"arc", "anim", "csv", "chan", "flair", "ae", "aejson"}  # formats that number their frames
RATED = {"anim", "ae", "aejson", "bvh"}  # formats that have a rate in any case
# Names of axes that a format prescribes: those of angles, and others
NAMES = {
    "anim": (
        ["c1.rotateX", "c2.rotateX", "c3.rotateX", "c4.rotateX"],
        ["a.x", "b.x", "c.x", "d.x"],
    ),
    "chan": (["rx", "ry", "rz", "vfov"], ["tx", "ty", "tz"]),
    "ae": (
        ["X Rotation", "Orientation Z", "Rotation", "Y Rotation"],
        ["Position Z", "Zoom", "Point of Interest X", "Position X"],
    ),
    "bvh": (
        ["c.Xrotation", "c.Zrotation", "c.Yrotation"],
        ["c.Yposition", "c.Zposition", "c.Xposition"],
    ),
}
# Scenes hold a camera's pose, not axes: test_scenes.py, test_camera_rig.py
OF_AXES = sorted(FORMATS.keys() - {"gltf", "usd"})
NAMES["aejson"] = NAMES["ae"]
ANY = (["a1", "a2", "a3", "a4"], ["b1", "b2", "b3", "b4"])


def named(name: str, axes: list[Axis], move: Move) -> tuple[list[Axis], Move]:
    """Return axes with names that the format has, and their positions; without the axes for which
    it has none."""
    angles, others = map(list, NAMES.get(name, ANY))
    found, positions = [], {}
    for axis in axes:
        left = angles if factor(axis.unit, "deg") else others
        if left:
            found.append(replace(axis, motor=len(found) + 1, in_file=left.pop(0)))
            positions[len(found)] = move.positions[axis.motor]
    names = {axis.motor: axis.name for axis in found}
    return found, Move(move.start_frame, names, positions)


# Round trips


@st.composite
def axes_and_moves(draw) -> tuple[list[Axis], Move]:
    axes = []
    for motor in range(1, draw(st.integers(1, 4)) + 1):
        unit = draw(st.sampled_from(sorted(UNITS)))
        same_kind = [other for other in UNITS if factor(unit, other) is not None]
        axes.append(
            Axis(
                name=f"axis {motor}", motor=motor, steps_per_unit=draw(st.floats(0.01, 1e5)),
                unit=unit, in_file=f"camera{motor}.rotateX", zero=draw(st.floats(-1e4, 1e4)),
                invert=draw(st.booleans()), file_unit=draw(st.sampled_from(same_kind)),
            )
        )  # fmt: skip
    frames = draw(st.integers(1, 6))
    steps = st.lists(st.integers(-(2**31), 2**31 - 1), min_size=frames, max_size=frames)
    positions = {axis.motor: draw(steps) for axis in axes}
    start = draw(st.integers(-1000, 10**6))
    return axes, Move(start, {axis.motor: axis.name for axis in axes}, positions)


EXTREMES = (
    [
        Axis("a", 1, 0.01, "mm", "a.translateX", 1e4, None, True, "m"),
        Axis("b", 2, 1e5, "rad", "b.focus", file_unit="deg"),
    ],
    Move(-7, {1: "a", 2: "b"}, {1: [-(2**31), 2**31 - 1, 0], 2: [2**31 - 1, -(2**31), 1]}),
)


@pytest.mark.parametrize("name", OF_AXES)
@settings(max_examples=60, deadline=None)
@example(EXTREMES)
@given(axes_and_moves())
def test_what_is_exported_gives_the_same_steps(name, case):
    axes, move = named(name, *case)
    text = FORMATS[name].write(to_table(move, axes), None)
    assert name == of_content(text, f"f{FORMATS[name].ENDINGS[0]}").NAME
    found, left = to_move(
        FORMATS[name].read(text, "f"),
        axes,
        "f",
        start=None if name in NAMED else move.start_frame,
        unwrap=False,
    )
    assert found == replace(move, fps=24 if name in RATED else None)
    assert not left or name in ("chan", "ae", "aejson"), "those have a fixed set of columns"


@pytest.mark.parametrize("name", OF_AXES)
def test_ten_thousand_frames_take_no_time(name):
    """A second of the processor is asked for; work that grows with the square takes seven."""
    axes = [
        Axis("a", 1, 100.0, "mm", "a", file_unit="mm"),
        Axis("b", 2, 100.0, "deg", "b", file_unit="deg"),
    ]
    steps = {1: [i * i % 977 for i in range(10_000)], 2: [i % 50 for i in range(10_000)]}
    axes, move = named(name, axes, Move(1, {1: "a", 2: "b"}, steps))
    text = FORMATS[name].write(to_table(move, axes), None)
    begin = time.process_time()
    found, _ = to_move(FORMATS[name].read(text, "f"), axes, "f", start=1)
    assert time.process_time() - begin < 3
    assert found.positions == move.positions


# What a file means

MAYA_AXES = """
[[axis]]
name = "focus"
motor = 3
steps_per_unit = 1
in_file = "camera1.fStop"
"""


@pytest.mark.parametrize(
    "text",
    [
        "frame,track,pan\n1,0,2\n2,1.25,2.01\n3,-5,2\n",
        "\ufeffFRAME;pan;track\r\n1;2;0\r\n2;2,01;1,25\r\n3;2;-5\r\n\r\n",
        "frame,track,pan,focus\n1,0,2,7\n2,1.25,2.01,7\n3,-5,2,7\n",
        "Axes = Track, Pan\r\n0 2\r\n1.25 2.01\r\n-5 2\r\n",
        "0\t2\n\n1.25  2.01   \n-5 2e0\n",
        "frame   track pan\n1  0   2 \n2  1.25  2.01\n 3 -5 2\n",
    ],
    ids=["csv", "csv of a spreadsheet", "an axis more", "kuper", "raw", "csv of blanks"],
)
def test_units_become_steps(text, shot):
    move = imported(shot, text)
    # 1.25 mm are 12.5 steps: to the nearest even; pan is inverted, and 2 deg its zero
    assert move == Move(1, {1: "track", 2: "pan"}, {1: [0, 12, -50], 2: [0, -1, 0]})


def test_units_named_in_the_file_are_converted_and_curves_sampled(shot):
    move = imported(shot, ARC)
    assert (move.start_frame, move.end_frame) == (1, 9)
    assert (move.positions[1][0], move.positions[1][8]) == (0, 800)
    # Both handles at half of the distance: the curve is the same from either end
    assert move.positions[1][4] == 400
    assert [800 - steps for steps in reversed(move.positions[1])] == move.positions[1]
    # At an eighth of the segment 1.5 t - 1.5 t^2 + t^3 = 1/8, so t = 0.0911, 3 t^2 - 2 t^3 = 0.0234
    assert move.positions[1][1] == 19
    # A straight line between its keyframes; constant before and after
    assert move.positions[2] == [0, 0, 0, -50, -100, -100, -100, -100, -100]


def test_a_handle_that_reaches_past_its_neighbour_ends_there(shot):
    assert within((17.0, 8.0), (1.0, 0.0), 9.0) == (9.0, 4.0)
    assert within((-3.0, 8.0), (9.0, 2.0), 1.0) == (1.0, 6.0)
    assert within((5.0, 8.0), (1.0, 0.0), 9.0) == (5.0, 8.0)
    shortened = imported(shot, ARC.replace('y="0" x="5"', 'y="0" x="9"'))
    assert imported(shot, ARC.replace('y="0" x="5"', 'y="0" x="90"')) == shortened


def test_curves_of_maya(shot):
    axes = named_in_file("track.translateX", "camera1.rotateY")
    (shot / "axes.toml").write_text(axes + MAYA_AXES)
    move = imported(shot, MAYA)
    assert (move.start_frame, move.end_frame) == (1, 7)
    # Linear, in cm; then flat to flat: 3 t^2 - 2 t^3 at its thirds; then constant
    assert move.positions[1] == [0, 50, 100, 100 + 207, 100 + 593, 900, 900]
    # A step at frame 3; pan is inverted, and 2 deg its zero
    assert move.positions[2] == [0, 0, -100, -100, -100, -100, -100]
    # No frame lies between its keys, so the unknown tangents do not matter
    assert move.positions[3] == [0, 0, 0, 0, 0, 0, 5]
    text = MAYA.replace("timeUnit pal", "timeUnit sec")
    with pytest.raises(ToolError, match="between the keys at 6 and 7 are tangents"):
        to_move(of_content(text, "f").read(text, "f"), read_axes(shot / "axes.toml"), "f", 2)


def test_the_rate_of_an_exported_curve(shot, refusal):
    (shot / "axes.toml").write_text(LINEAR.replace('"track"', '"a.x"').replace('"pan"', '"a.y"'))
    imported(shot, "0 2\n1. 2\n")
    command = ["export", str(shot / "move.csv"), "-o", str(shot / "out.anim")]
    for options, rate in (([], "film"), (["--fps", "25"], "pal"), (["--fps", "60"], "ntscf")):
        assert run(shot, *command, *options) == 0
        assert f"timeUnit {rate};\n" in (shot / "out.anim").read_text()
    said = refusal(*command, "--fps", "23")
    assert "expected 15, 24, 25, 30, 48, 50, 60 frames per second" in said
    (shot / "axes.toml").write_text(LINEAR)
    imported(shot, "0 2\n1. 2\n")
    assert "attributes of nodes, like camera1.rotateY; found 'track'" in refusal(*command)


@pytest.mark.parametrize("x", [0.001, 0.25, 0.5, 0.9, 0.999])
def test_a_bezier_curve_is_solved_for_its_place(x):
    # Handles of full length: as uneven as possible
    segment = Segment((0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0))
    t = np.linspace(0, 1, 20001)
    places, values = 3 * t * (1 - t) ** 2 + t**3, 3 * t * t * (1 - t) + t**3
    assert segment.at(x) == pytest.approx(np.interp(x, places, values), abs=2e-3)


def test_samples_in_seconds_are_resampled(shot):
    header = "seconds,track,pan\n"
    # A parabola sampled at uneven times comes out exactly, since the slopes are a parabola's
    rows = "".join(f"{t},{40 * t * t},2\n" for t in (0, 0.1, 0.25, 0.4, 0.5, 0.7, 0.8, 1))
    move = imported(shot, header + rows, "--fps", "10")
    assert move.start_frame == 1
    assert move.positions[1][2:-2] == [round(400 * (i / 10) ** 2) for i in range(2, 9)]
    assert len(move.positions[1]) == 11
    millis = imported(shot, "ms,track,pan\n0,0,2\n100,1,2\n200,4,2\n", "--fps", "10")
    assert millis.positions[1] == [0, 10, 40]
    late = "seconds,track,pan\n1000000000000000,1,2\n"  # where a thousandth more is no other number
    assert imported(shot, late, "--fps", "1000").positions[1] == [10]


def test_slopes_at_the_ends():
    curve = Samples([1.0, 2.0, 4.0], [0.0, 1.0, 7.0])
    assert [curve.slope(i) for i in range(3)] == [1.0, pytest.approx(5 / 3), 3.0]
    assert (curve.at(0), curve.at(9)) == (0.0, 7.0)
    assert Samples([1.0], [5.0]).slope(0) == 0


def test_start_names_the_first_frame(shot):
    assert imported(shot, "0 2\n0 2\n", "--start", "1001").end_frame == 1002
    assert imported(shot, "frame,track,pan\n5,0,2\n", "--start", "-3").start_frame == -3


def test_an_axis_that_the_file_has_not_holds(shot):
    (shot / "axes.toml").write_text(LINEAR + "hold = 3\n")
    for text in ("0\n1\n", "frame,track\n1,0\n2,1\n"):
        assert imported(shot, text).positions == {1: [0, 10], 2: [-100, -100]}
    out = shot / "out.csv"
    assert run(shot, "export", str(shot / "move.csv"), "-o", str(out)) == 0
    assert out.read_text() == "frame,track (mm)\n1,0.0000\n2,1.0000\n"


@pytest.mark.parametrize("in_file", ["Camera Pan", "pan (rad)"])
def test_an_exported_csv_is_not_taken_for_steps(in_file, shot, refusal):
    """Its units are in its headings; a heading's own unit is kept."""
    (shot / "axes.toml").write_text(LINEAR + f'in_file = "{in_file}"\n')
    move, out, back = shot / "move.csv", shot / "out.csv", shot / "back.csv"
    move.write_text("frame,track,pan\n1,0,200\n2,10,0\n3,50,-700\n")
    assert run(shot, "export", str(move), "-o", str(out)) == 0
    heading = "pan (rad)" if in_file == "pan (rad)" else "Camera Pan (deg)"
    assert out.read_text().splitlines()[0] == f"frame,track (mm),{heading}"
    said = refusal("check", str(out))
    if in_file == "Camera Pan":  # all numbers are whole
        assert "a move has steps, this is in mm: framestep import converts it" in said
    assert run(shot, "import", str(out), "-o", str(back)) == 0
    assert read_move(back).positions == read_move(move).positions


def test_an_axis_that_moves_is_not_left_out_silently(shot, refusal):
    """The file would lead to other steps."""
    (shot / "axes.toml").write_text(LINEAR + "hold = 3\n")
    move, out = shot / "move.csv", shot / "out.csv"
    for pan, said in (("-100,-150", "2, axis pan: it is at 3.5 deg"), ("0,0", "1, axis pan: it")):
        first, second = pan.split(",")
        move.write_text(f"frame,track,pan\n1,0,{first}\n2,10,{second}\n")
        error = refusal("export", str(move), "-o", str(out))
        assert f"frame {said}" in error
        assert error.endswith('to stay at 3 deg: take "hold" out of axes.toml')
        assert not out.exists()


def test_seconds_from_zero_on_are_exported(shot):
    imported(shot, "0 2\n1. 2\n")
    out = shot / "out.csv"
    assert run(shot, "export", str(shot / "move.csv"), "-o", str(out), "--fps", "25") == 0
    assert [line.split(",")[0] for line in out.read_text().splitlines()] == [
        "seconds", "0.000000000", "0.040000000",
    ]  # fmt: skip


def test_axes_that_nobody_has_are_named(shot, capsys):
    imported(shot, "frame,track,focus,pan,iris\n1,0,5,2,4\n")
    assert "left out, no axis names them: focus, iris" in capsys.readouterr().err


def test_help_names_the_formats(capsys):
    assert cli.app.status(["import", "--help"]) == 0
    assert ", ".join(FORMATS) in " ".join(capsys.readouterr().out.split())
