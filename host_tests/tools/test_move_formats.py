"""Moves into the formats of other programs and back, and what is wrong with a file in a
sentence."""

from contextlib import suppress
from pathlib import Path

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from framestep_tools import cli
from framestep_tools.axes_file import KEYS, Axis, read_axes
from framestep_tools.errors import ToolError
from framestep_tools.files import ROOT
from framestep_tools.move_conversion import to_move, to_table
from framestep_tools.move_file import CAMERA_MOVE, Move, read_move
from framestep_tools.move_formats import FORMATS, of_content
from framestep_tools.move_formats.curves import Samples, Segment, within
from framestep_tools.move_formats.units import UNITS, factor

NAMED = {"arc", "anim", "csv"}  # formats that number their frames

LINEAR = """
[[axis]]
name = "track"
motor = 1
steps_per_unit = 10
unit = "mm"
limits = [-5, 100]

[[axis]]
name = "pan"
motor = 2
steps_per_unit = 100
unit = "deg"
zero = 2
invert = true
"""

ARC = """<?xml version="1.0"?>
<scen:scene xmlns:scen="http://caliri.com/motion/scene" endframe="9">
  <scen:axis name="track" units="cm">
    <scen:points y="0" x="1"/>
    <scen:points y="8" x="9"/>
    <scen:controlPoints y="0" x="5"/>
    <scen:controlPoints y="8" x="5"/>
  </scen:axis>
  <scen:axis name="unused"/>
  <scen:axis name="pan" units="deg">
    <scen:points y="2" x="3"/>
    <scen:points y="3" x="5"/>
    <scen:controlPoints y="2.3333333333" x="3.6666666667"/>
    <scen:controlPoints y="2.6666666667" x="4.3333333333"/>
  </scen:axis>
</scen:scene>
"""

# Comments, a node without curves, what later versions write, and units that differ from the axes'
MAYA = """animVersion 1.1;
mayaVersion 2013 x64; // anything
timeUnit pal; linearUnit m; angularUnit deg; startTime 1; endTime 7;
anim camera1 0 2 0;
anim translate.translateX translateX track 0 1 0; # a comment
animData {
  input time;
  output linear;
  outputUnit cm;
  weighted 0;
  preInfinity constant;
  keys {
    1 0 auto linear 1 1 0;
    3 1 linear flat 1 1 0;
    6 9 flat clamped 1 1 0;
  }
}
anim rotate.rotateY rotateY camera1 0 1 0;
animData { input time; output angular; weighted 1; tangentAngleUnit deg;
  keys {
    1 2 step step 1 1 0;
    3 3 step linear 1 1 0;
    4 3 linear fixed 1 1 0 45 1;
  }
}
anim fStop fStop camera1 1 0 0;
animData {
  input time; output unitless; weighted 1;
  keys { 6 0 auto auto 1 1 0; 7 5 spline spline 1 1 0; }
}
"""
MAYA_AXES = """
[[axis]]
name = "focus"
motor = 3
steps_per_unit = 1
in_file = {}
"""


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "axes.toml").write_text(LINEAR)
    return tmp_path


def run(folder: Path, *args: str) -> int:
    return cli.app.status([*args, "--axes", str(folder / "axes.toml")])


def imported(folder: Path, text: str, *options: str) -> Move:
    source, out = folder / "source", folder / "move.csv"
    source.write_bytes(text.encode())
    assert run(folder, "import", str(source), "-o", str(out), *options) == 0
    return read_move(out)


# Round trips


@st.composite
def axes_and_moves(draw) -> tuple[list[Axis], Move]:
    axes = []
    for motor in range(1, draw(st.integers(1, 4)) + 1):
        unit = draw(st.sampled_from(sorted(UNITS)))
        same_kind = [other for other in UNITS if factor(unit, other) is not None]
        axes.append(
            Axis(
                name=f"axis {motor}",
                motor=motor,
                steps_per_unit=draw(st.floats(0.01, 1e5)),
                unit=unit,
                in_file=f"camera{motor}.rotateX",
                zero=draw(st.floats(-1e4, 1e4)),
                invert=draw(st.booleans()),
                file_unit=draw(st.sampled_from(same_kind)),
            )
        )
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


@pytest.mark.parametrize("name", sorted(FORMATS))
@settings(max_examples=60, deadline=None)
@example(EXTREMES)
@given(axes_and_moves())
def test_what_is_exported_gives_the_same_steps(name, case):
    axes, move = case
    text = FORMATS[name].write(to_table(move, axes), None)
    assert name == of_content(text, "f").NAME
    found, left = to_move(
        FORMATS[name].read(text, "f"), axes, "f", start=None if name in NAMED else move.start_frame
    )
    assert (found, left) == (move, [])


@settings(max_examples=60, deadline=None)
@example(EXTREMES, 240.0)
@given(axes_and_moves(), st.floats(1, 240))
def test_seconds_give_the_same_steps(case, fps):
    axes, move = case
    text = FORMATS["csv"].write(to_table(move, axes), fps)
    found, _ = to_move(FORMATS["csv"].read(text, "f"), axes, "f", fps, move.start_frame)
    assert found.positions == move.positions


@pytest.mark.parametrize("name", sorted(FORMATS))
def test_the_example_through_the_commands(name, folder, capsys):
    motors = read_move(CAMERA_MOVE).names
    (folder / "axes.toml").write_text(
        "".join(
            f'[[axis]]\nname = "{axis}"\nmotor = {motor}\nin_file = "rig.{axis}"\n'
            'steps_per_unit = 222.2222\nunit = "deg"\n'
            for motor, axis in motors.items()
        )
    )
    out, back = folder / "out", folder / "back.csv"
    assert run(folder, "export", CAMERA_MOVE.name, "-o", str(out), "--format", name) == 0
    assert f"frames 1 to 240 of 4 axes, as {name}" in capsys.readouterr().out
    assert run(folder, "import", str(out), "-o", str(back)) == 0
    assert f"frames 1 to 240 for 4 motors, from {name}" in capsys.readouterr().out
    assert back.read_bytes() == CAMERA_MOVE.read_bytes()


# What a file means


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
def test_units_become_steps(text, folder):
    move = imported(folder, text)
    # 1.25 mm are 12.5 steps: to the nearest even; pan is inverted, and 2 deg its zero
    assert move == Move(1, {1: "track", 2: "pan"}, {1: [0, 12, -50], 2: [0, -1, 0]})


def test_units_named_in_the_file_are_converted_and_curves_sampled(folder):
    move = imported(folder, ARC)
    assert (move.start_frame, move.end_frame) == (1, 9)
    assert (move.positions[1][0], move.positions[1][8]) == (0, 800)
    # Both handles at half of the way: the curve is the same from either end
    assert move.positions[1][4] == 400
    assert [800 - steps for steps in reversed(move.positions[1])] == move.positions[1]
    # At an eighth of the way 1.5 t - 1.5 t^2 + t^3 = 1/8, so t = 0.0911 and 3 t^2 - 2 t^3 = 0.0234
    assert move.positions[1][1] == 19
    # A straight line between its keyframes; it stands before and after
    assert move.positions[2] == [0, 0, 0, -50, -100, -100, -100, -100, -100]


def test_a_handle_that_reaches_past_its_neighbour_ends_there(folder):
    assert within((17.0, 8.0), (1.0, 0.0), 9.0) == (9.0, 4.0)
    assert within((-3.0, 8.0), (9.0, 2.0), 1.0) == (1.0, 6.0)
    assert within((5.0, 8.0), (1.0, 0.0), 9.0) == (5.0, 8.0)
    shortened = imported(folder, ARC.replace('y="0" x="5"', 'y="0" x="9"'))
    assert imported(folder, ARC.replace('y="0" x="5"', 'y="0" x="90"')) == shortened


def test_curves_of_maya(folder):
    (folder / "axes.toml").write_text(
        LINEAR.replace('"track"\n', '"track"\nin_file = "track.translateX"\n')
        + 'in_file = "camera1.rotateY"\n'
        + MAYA_AXES.format('"camera1.fStop"')
    )
    move = imported(folder, MAYA)
    assert (move.start_frame, move.end_frame) == (1, 7)
    # Linear, in cm; then flat to flat: 3 t^2 - 2 t^3 at thirds of the way; then it stands
    assert move.positions[1] == [0, 50, 100, 100 + 207, 100 + 593, 900, 900]
    # A step at frame 3; pan is inverted, and 2 deg its zero
    assert move.positions[2] == [0, 0, -100, -100, -100, -100, -100]
    # No frame between its keys, so it does not matter that nobody knows the tangents
    assert move.positions[3] == [0, 0, 0, 0, 0, 0, 5]
    text = MAYA.replace("timeUnit pal", "timeUnit sec")
    with pytest.raises(ToolError, match="between the keys at 6 and 7 are tangents"):
        to_move(of_content(text, "f").read(text, "f"), read_axes(folder / "axes.toml"), "f", 2)


def test_the_rate_of_an_exported_curve(folder, capsys):
    (folder / "axes.toml").write_text(LINEAR.replace('"track"', '"a.x"').replace('"pan"', '"a.y"'))
    imported(folder, "0 2\n1 2\n")
    command = ["export", str(folder / "move.csv"), "-o", str(folder / "out.anim")]
    for options, rate in (([], "film"), (["--fps", "25"], "pal"), (["--fps", "60"], "ntscf")):
        assert run(folder, *command, *options) == 0
        assert f"timeUnit {rate};\n" in (folder / "out.anim").read_text()
    assert run(folder, *command, "--fps", "23") == 1
    assert "expected 15, 24, 25, 30, 48, 50, 60 frames per second" in capsys.readouterr().err
    (folder / "axes.toml").write_text(LINEAR)
    assert run(folder, *command) == 1
    assert "attributes of nodes, like camera1.rotateY; found 'track'" in capsys.readouterr().err


@pytest.mark.parametrize("x", [0.001, 0.25, 0.5, 0.9, 0.999])
def test_a_bezier_curve_is_solved_for_its_place(x):
    # Handles that reach all the way: as far from even as can be
    segment = Segment((0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0))
    y = segment.at(x)
    t = next(t for t in _parameters() if _place(t) >= x)
    assert y == pytest.approx(3 * t * t * (1 - t) + t**3, abs=2e-3)


def _place(t: float) -> float:
    return 3 * t * (1 - t) ** 2 + t**3


def _parameters():
    return (i / 20000 for i in range(20001))


def test_samples_in_seconds_are_resampled(folder):
    header = "seconds,track,pan\n"
    # A parabola sampled at uneven times comes out exactly, as the slopes are those of parabolas
    rows = "".join(f"{t},{40 * t * t},2\n" for t in (0, 0.1, 0.25, 0.4, 0.5, 0.7, 0.8, 1))
    move = imported(folder, header + rows, "--fps", "10")
    assert move.start_frame == 1
    assert move.positions[1][2:-2] == [round(400 * (i / 10) ** 2) for i in range(2, 9)]
    assert len(move.positions[1]) == 11
    millis = imported(folder, "ms,track,pan\n0,0,2\n100,1,2\n200,4,2\n", "--fps", "10")
    assert millis.positions[1] == [0, 10, 40]


def test_slopes_at_the_ends():
    curve = Samples([1.0, 2.0, 4.0], [0.0, 1.0, 7.0])
    assert [curve.slope(i) for i in range(3)] == [1.0, pytest.approx(5 / 3), 3.0]
    assert (curve.at(0), curve.at(9)) == (0.0, 7.0)
    assert Samples([1.0], [5.0]).slope(0) == 0


def test_start_names_the_first_frame(folder):
    assert imported(folder, "0 2\n0 2\n", "--start", "1001").end_frame == 1002
    assert imported(folder, "frame,track,pan\n5,0,2\n", "--start", "-3").start_frame == -3


def test_an_axis_that_the_file_has_not_holds(folder):
    (folder / "axes.toml").write_text(LINEAR + "hold = 3\n")
    for text in ("0\n1\n", "frame,track\n1,0\n2,1\n"):
        assert imported(folder, text).positions == {1: [0, 10], 2: [-100, -100]}
    out = folder / "out.csv"
    assert run(folder, "export", str(folder / "move.csv"), "-o", str(out)) == 0
    assert out.read_text() == "frame,track\n1,0.0000\n2,1.0000\n"


def test_seconds_from_zero_on_are_exported(folder):
    imported(folder, "0 2\n1 2\n")
    out = folder / "out.csv"
    assert run(folder, "export", str(folder / "move.csv"), "-o", str(out), "--fps", "25") == 0
    assert [line.split(",")[0] for line in out.read_text().splitlines()] == [
        "seconds", "0.000000000", "0.040000000",
    ]  # fmt: skip


def test_axes_that_nobody_has_are_named(folder, capsys):
    imported(folder, "frame,track,focus,pan,iris\n1,0,5,2,4\n")
    assert "left out, as no axis has them: focus, iris" in capsys.readouterr().err


# What is wrong


VALID = [
    ARC,
    MAYA,
    "frame,track,pan\n1,0,2\n2,1.25,2.01\n",
    "seconds;track;pan\n0;0;2\n0,5;1,25;2,01\n",
    "Axes = Track, Pan\r\n0 2\r\n1.25 2.01\r\n",
    "0 2\n1.25 2.01\n",
]


@settings(max_examples=400, deadline=None)
@given(
    st.sampled_from(VALID),
    st.integers(0, 1500),
    st.integers(0, 30),
    st.text("0123456789.,;-+eE \n\t\"'<>/={}axn\0\x85", max_size=6) | st.text(max_size=3),
)
def test_a_spoilt_file_is_read_or_refused(text, at, length, put):
    """Nothing but the error that a command tells in a sentence comes out."""
    at %= len(text)
    spoilt = text[:at] + put + text[at + length :]
    axes = [
        Axis("a", 1, 10.0, in_file="track", file_unit="units"),
        Axis("b", 2, 10.0, "deg", "pan", file_unit="deg"),
    ]
    for module in FORMATS.values():
        with suppress(ToolError):
            recording = module.read(spoilt, "f")
            to_move(recording, axes, "f", 24.0 if recording.seconds else None)
    with suppress(ToolError):
        of_content(spoilt, "f")


@pytest.mark.parametrize(
    ("text", "options", "said"),
    [
        ("frame,track,pan\n1,0,2\n3,0,2\n", [], "line 3, column frame: expected frame 2, found 3"),
        ("frame,track,pan\n1,0,2\n1,0,2\n", [], "line 3, column frame: expected frame 2, found 1"),
        ("frame,track,pan\n1.5,0,2\n", [], "line 2, column frame: expected a whole number"),
        ("frame,track,pan\n1,0,x\n", [], "line 2, column pan: expected a number, found 'x'"),
        ("frame,track,pan\n1,0,nan\n", [], "line 2, column pan: expected a number, found 'nan'"),
        ("frame,track,pan\n1,1e300,2\n", [], "line 2, column track: expected a number"),
        ("frame,track,pan\n1,0\n", [], "line 2: expected 3 columns, found 2"),
        ("frame,track,pan\n", [], "expected a line for each frame, found none"),
        ("frame,track\n1,0\n", [], "has no axis 'pan' for motor 2; it has track"),
        ("frame,pan,pan,track\n1,0,1,0\n", [], "has more than one axis 'pan'"),
        (
            "frame,track,pan\n1,0,2\n2,100.1,2\n",
            [],
            "frame 2, axis track: 100.1 mm is beyond its limits of -5 to 100 mm",
        ),
        (
            "frame,track,pan\n7,0,1e9\n",
            [],
            "frame 7, axis pan: 1000000000 deg is step -99999999800",
        ),
        ("frame,track,pan\n2147483647,0,2\n2147483648,0,2\n", [], "frame numbers have to fit"),
        ("seconds,track,pan\n0,0,2\n", [], "is in seconds: name the frames per second by --fps"),
        (
            "seconds,track,pan\n0,0,2\n0,0,2\n",
            ["--fps", "24"],
            "column seconds: expected a time after 0",
        ),
        ("seconds,track,pan\n0,0,2\n1e9,0,2\n", ["--fps", "24"], "expected at most 1000000 frames"),
        (
            "frame,track,pan\n1,0,2\n",
            ["--fps", "24"],
            "is in frames: --fps is for files in seconds",
        ),
        ("0 2\n0 2 3\n", [], "line 2: expected 2 columns, found 3"),
        ("0 2 3\n", [], "has 3 columns without names, there are 2 axes"),
        ("0 2\n\n0 two\n", [], "line 3, column 2: expected a number, found 'two'"),
        ("Axes = Track, Pan\r\n0 2\r\n0\r\n", [], "line 3: expected 2 columns, found 1"),
        ("Axes = Track,\n0\n", [], "expected a first line like Axes = Pan, Tilt"),
        ("Axes = Track, Pan\n", [], "expected a line for each frame, found none"),
        (
            "0 2\n",
            ["--format", "kuper"],
            "expected a first line like Axes = Pan, Tilt, found '0 2'",
        ),
        (
            "0 2\n",
            ["--format", "csv"],
            "line 1: expected a header that begins with frame or seconds",
        ),
        ("bones\n", [], "not recognised as any of arc, anim, kuper, csv, raw"),
        ("", [], "not recognised as any of"),
        ("animVersion 1.1;\n", [], "expected a curve with keys over time, found none"),
        (MAYA.replace("pal", "vhs"), [], "timeUnit: expected one of game, film, pal"),
        (
            MAYA.replace("    3 1 lin", "    1 1 lin"),
            [],
            "line 6, track.translateX: expected a key after 1",
        ),
        (MAYA.replace("3 1 linear flat 1 1 0", "3 1"), [], "line 14: not understood: '3,1'"),
        (
            MAYA.replace("3 1 linear", "3 one linear"),
            [],
            "line 14, track.translateX: expected a number",
        ),
        (MAYA.replace("outputUnit cm", "outputUnit mi"), [], "its linear unit: expected mm, cm, m"),
        (
            MAYA.replace("outputUnit cm", "inputUnit sec"),
            [],
            "expected the file's timeUnit pal, found sec",
        ),
        ("<scene>", [], "not XML as it should be: no element found: line 1"),
        ("<svg/>", [], "expected <scene> as the outermost element, found svg"),
        ("<scene/>", [], "expected an axis with keyframes, found none"),
        (
            ARC.replace('units="cm"', 'units="deg"'),
            [],
            "axis track: its unit deg cannot be converted to mm",
        ),
        (ARC.replace('units="cm"', 'units="parsec"'), [], "axis track: expected units of mm, cm"),
        (
            ARC.replace('x="9"', 'x="1"'),
            [],
            "axis track, keyframe 2: expected a frame after 1, found 1",
        ),
        (ARC.replace('y="8" x="9"', 'x="9"'), [], "axis track, keyframe 2, y: expected a number"),
        (
            ARC.replace('<scen:controlPoints y="0" x="5"/>', ""),
            [],
            "axis track: expected 2 control points for 2 keyframes, found 1",
        ),
        (
            ARC.replace('y="0" x="5"', 'y="0" x="0.5"'),
            [],
            "between the keyframes at 1 and 9 points away from the other keyframe",
        ),
        (ARC.replace('x="9"', 'x="1e9"'), [], "expected at most 1000000 frames, found 1 to 1e+09"),
    ],
)
def test_one_sentence_says_what_is_wrong_and_nothing_is_written(
    text, options, said, folder, capsys
):
    source, out = folder / "source", folder / "move.csv"
    source.write_text(text)
    assert run(folder, "import", str(source), "-o", str(out), *options) == 1
    error = capsys.readouterr().err
    assert said in error
    assert len(error.splitlines()) == 1
    assert sorted(path.name for path in folder.iterdir()) == ["axes.toml", "source"]


@pytest.mark.parametrize(
    ("args", "status", "said"),
    [
        (["import", "SOURCE", "-o", "SOURCE"], 2, "is the file that is read"),
        (["import", "SOURCE", "-o", "OUT", "--format", "flair"], 2, "'flair' is not one of arc, "),
        (["import", "nothing", "-o", "OUT"], 1, "cannot read the move nothing: No such file"),
        (["import", "SOURCE", "-o", "no/where.csv"], 1, "cannot write no/where.csv: No such file"),
        (["export", "SOURCE", "-o", "OUT"], 1, "no format has the ending (none); name one by"),
        (
            ["export", "SOURCE", "-o", "x.arcm", "--fps", "9"],
            2,
            "--fps is for csv and anim; arc has",
        ),
        (
            ["export", "MOVE", "-o", "x.csv", "--fps", "inf"],
            2,
            "Input should be less than or equal to 1000",
        ),
        (
            ["import", "SOURCE", "-o", "OUT", "--fps", "nan"],
            2,
            "Input should be less than or equal to 1000",
        ),
        (["export", "MOVE", "-o", "x.csv"], 1, "axis track: 100.1 mm is beyond its limits"),
        (["export", "ONE", "-o", "x.csv"], 1, "the move has 1 motors, and there are 2 axes"),
    ],
)
def test_one_sentence_says_what_is_wrong_with_a_command(args, status, said, folder, capsys):
    files = {name: str(folder / name) for name in ("SOURCE", "OUT", "MOVE", "ONE")}
    Path(files["SOURCE"]).write_text("0 2\n")
    Path(files["MOVE"]).write_text("frame,track,pan\n1,1001,0\n")
    Path(files["ONE"]).write_text("frame,track\n1,0\n")
    assert run(folder, *(files.get(word, word) for word in args)) == status
    error = capsys.readouterr().err
    assert said in error
    assert len(error.splitlines()) == 1
    assert not Path(files["OUT"]).exists()


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[[axis]\n", "not TOML as it should be: "),
        ("", "expected an [[axis]] for each motor, found none"),
        ("axis = 3\n", "expected an [[axis]] for each motor, found none"),
        ("fps = 24\n", 'expected only [[axis]] at the top, found "fps"'),
        (LINEAR + "step = 1\n", 'axis 2 (pan): no key "step"; there are name, motor'),
        (LINEAR + 'hold = "x"\n', "axis 2 (pan): \"hold\": expected a number, found 'x'"),
        (LINEAR.replace("motor = 1", "motor = 0"), '"motor": expected a whole number from 1 to 32'),
        (LINEAR.replace("motor = 1", "motor = true"), '"motor": expected a whole number'),
        (LINEAR.replace("motor = 1", "motor = 2"), '"motor": 2 is there twice'),
        (
            LINEAR.replace("motor = 1", "motor = 3"),
            "there is no axis for motor 1, but one for motor 2",
        ),
        (LINEAR.replace('"pan"', '"track"'), "\"name\": 'track' is there twice"),
        (LINEAR + 'in_file = "track"\n', "\"in_file\": 'track' is there twice"),
        (
            LINEAR.replace("= 10\n", "= 0\n"),
            'unit": expected a number from 1e-06 to 1e+09, found 0',
        ),
        (LINEAR.replace("= 10\n", "= nan\n"), '"steps_per_unit": expected a number'),
        (
            LINEAR.replace("steps_per_unit = 10\n", ""),
            '(track): "steps_per_unit" is missing: a number',
        ),
        (LINEAR.replace('"mm"', '"yard"'), '"unit": expected one of "mm", "cm"'),
        (LINEAR + 'file_unit = "mm"\n', '"file_unit": mm cannot be converted to deg'),
        (
            LINEAR.replace("[-5, 100]", "[100, -5]"),
            '"limits": expected two numbers [lowest, highest]',
        ),
        (LINEAR.replace("true", "1"), '"invert": expected true or false, found 1'),
        (
            LINEAR.replace('name = "pan"', 'name = " "'),
            "axis 2: \"name\": expected a text, found ' '",
        ),
    ],
)
def test_one_sentence_says_what_is_wrong_with_axes_toml(text, said, folder, capsys):
    (folder / "axes.toml").write_text(text)
    (folder / "source").write_text("0 2\n")
    assert run(folder, "import", str(folder / "source"), "-o", str(folder / "out")) == 1
    error = capsys.readouterr().err
    assert said in error
    assert len(error.splitlines()) == 1


def test_what_cannot_be_written_leaves_nothing_behind(folder, capsys):
    (folder / "source").write_text("0 2\n")
    (folder / "out").mkdir()
    assert run(folder, "import", str(folder / "source"), "-o", str(folder / "out")) == 1
    assert "cannot write" in capsys.readouterr().err
    assert sorted(path.name for path in folder.iterdir()) == ["axes.toml", "out", "source"]


def test_there_is_no_axes_toml(tmp_path, capsys):
    (tmp_path / "shot.arcm").write_text(ARC)
    (tmp_path / "raw").write_text("1 2\n")
    for name, axes in (("shot.arcm", "track in cm, pan in deg"), ("raw", "column 1, column 2")):
        assert run(tmp_path, "import", str(tmp_path / name), "-o", str(tmp_path / "out")) == 1
        error = capsys.readouterr().err
        assert f"are to the motors ({axes}); docs/moves.md shows one" in error
        assert len(error.splitlines()) == 1
    with pytest.raises(ToolError, match=r"cannot read the axes .*axes.toml: No such file"):
        read_axes(tmp_path / "axes.toml")


# The page


def test_the_page_has_every_key_unit_and_format(tmp_path):
    page = (ROOT / "docs" / "moves.md").read_text(encoding="utf-8")
    for key in KEYS:
        assert f"\n| `{key}` |" in page
    for unit in UNITS:
        assert f"`{unit}`" in page
    for name, module in FORMATS.items():
        assert f"\n| `{name}` |" in page
        assert " ".join(module.ENDINGS) in page
    example_file = page.split("## axes.toml")[1].split("| key |")[0]
    (tmp_path / "axes.toml").write_text(
        "\n".join(line.strip() for line in example_file.splitlines() if line.startswith("    "))
    )
    assert [axis.name for axis in read_axes(tmp_path / "axes.toml")] == ["track", "pan"]


def test_help_names_the_formats(capsys):
    assert cli.app.status(["import", "--help"]) == 0
    assert ", ".join(FORMATS) in capsys.readouterr().out
