"""Files of cameras: Nuke, Flair, After Effects, BVH. Each with a small file of its own."""

import re

import pytest

from framestep_tools.axes.axes_file import Axis, read_axes
from framestep_tools.errors import ToolError
from framestep_tools.move.move_conversion import to_table
from framestep_tools.move.move_file import Move
from framestep_tools.move.move_formats import FORMATS, of_content
from host_tests.tools.conftest import imported, named_in_file, run

CHAN = """1001\t0.5\t1.5\t-3.2\t-12.5\t2\t0\t37.8
1002\t0.6\t1.5\t-3.2\t-12.5\t2.5\t0\t37.8
1003\t0.7\t1.5\t-3.2\t-12.5\t3\t0\t37.8
"""
FLAIR = """# CGI Export
DATA_TYPE  CARTS_RAW  MRMC_COORDS  IN_CENTIMETRES
POINTS 3  SPEED 25
FRAME     XV         YV         ZV         XT         YT         ZT         ROLL
   1,    0.50000   -1.98000   60.55700  322.00600    0.25000   80.86100    2.00000
   2,    0.60000   -1.98000   60.55700  322.00600    0.25000   80.86100    2.50000
   3,    0.70000   -1.98000   60.55700  322.00600    0.25000   80.86100    3.00000
~~ anything that follows ~~
"""
FLAIR_AXES = """DATA_TYPE AXES_RAW
POINTS 2 SPEED 23.976
FRAME TRACK PAN
10 0.5 2
11 0.6 2.5
"""
AE = """Adobe After Effects 8.0 Keyframe Data

\tUnits Per Second\t29.97
\tSource Width\t1920
\tSource Height\t1080
\tSource Pixel Aspect Ratio\t1
\tComp Pixel Aspect Ratio\t1

Transform\tPosition
\tFrame\tX pixels\tY pixels\tZ pixels\t
\t0\t0.5\t540\t-1866.7\t
\t1\t0.6\t540\t-1866.7\t
\t2\t0.7\t540\t-1866.7\t

Transform\tY Rotation
\tFrame\tdegrees\t
\t0\t2\t
\t2\t2\t

Transform\tZoom
\tFrame\tpixels\t
\t\t1866.7\t

Effects\tSlider Control #1\tSlider #2
\tFrame\t\t
\t0\t7\t
\t1\t7\t

End of Keyframe Data
"""
BVH = """HIERARCHY
ROOT Camera
{
  OFFSET 0.0 0.0 0.0
  CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
  JOINT Head
  {
    OFFSET 0 1 0
    CHANNELS 1 Yrotation
    End Site
    {
      OFFSET 0 0 0
    }
  }
}
MOTION
Frames: 3
Frame Time: 0.041667
0.5 1 2 0 0 2 9
0.6 1 2 0 0 2.5 9
0.7 1 2 0 0 3 9
"""


@pytest.mark.parametrize(
    ("text", "ending", "axes", "frames", "track", "fps"),
    [
        (CHAN, ".chan", ("tx", "ry"), (1001, 1003), [5, 6, 7], None),
        (CHAN.replace("\t37.8", ""), ".chan", ("TX", "ry"), (1001, 1003), [5, 6, 7], None),
        ("# 25 fps\n" + CHAN, ".chan", ("tx", "ry"), (1001, 1003), [5, 6, 7], 25),
        (FLAIR, ".txt", ("XV", "ROLL"), (1, 3), [50, 60, 70], 25),
        (FLAIR_AXES, ".txt", ("TRACK", "PAN"), (10, 11), [5, 6], 23.976),
        (AE, ".txt", ("Position X", "Y Rotation"), (0, 2), [5, 6, 7], 29.97),
        (AE.replace("\n", "\r\n"), ".txt", ("Position X", "Y Rotation"), (0, 2), [5, 6, 7], 29.97),
        (BVH, ".bvh", ("Camera.Xposition", "Camera.Yrotation"), (1, 3), [5, 6, 7], 24),
    ],
)
def test_the_small_file_of_each_format(text, ending, axes, frames, track, fps, shot):
    (shot / "axes.toml").write_text(named_in_file(*axes))
    move = imported(shot, text, name=f"source{ending}")
    assert (move.start_frame, move.end_frame) == frames
    assert move.positions[1] == track
    pan = [0, -50, -100] if ending != ".txt" or "FRAME" in text else [0, 0, 0]
    assert move.positions[2] == pan[: len(track)]
    assert move.fps == (None if fps is None else pytest.approx(fps))


def test_lengths_of_flair_have_their_unit(shot, not_imported):
    (shot / "axes.toml").write_text(named_in_file("XV", "ROLL"))
    said = not_imported(FLAIR.replace("IN_CENTIMETRES", "IN_METRES"))
    assert "frame 1, axis track: 500 mm is beyond its limits" in said


def test_a_property_that_is_twice_has_its_group(shot):
    text = AE.replace("Slider #2", "Zoom")
    names = FORMATS["ae"].read(text, "f").names
    assert "Transform Zoom" in names
    assert "Effects Slider Control #1 Zoom" in names
    assert FORMATS["ae"].read(AE, "f").names == [
        "Position X", "Position Y", "Position Z", "Y Rotation in deg", "Slider #2", "Zoom",
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("period", "fps"),
    [
        ("0.041667", 24), ("0.0416667", 24), ("0.04170833", 24000 / 1001), ("0.0417", 24),
        ("0.0333333", 30), ("0.0333667", 30000 / 1001), ("0.04", 25), ("0.008333", 120),
        ("0.0166833", 60000 / 1001), ("0.02083", 48), ("0.5", 2), ("0.001", 1000),
    ],
)  # fmt: skip
def test_the_rate_of_a_rounded_frame_time(period, fps):
    assert FORMATS["bvh"].read(BVH.replace("0.041667", period), "f").fps == pytest.approx(fps)


@pytest.mark.parametrize(
    ("text", "ending", "said"),
    [
        (CHAN.replace("\t0.5\t1.5", "\t0.5"), ".chan", "line 2: expected 7 columns, found 8"),
        (CHAN.replace("1002", "1004"), ".chan", "line 2, column frame: expected frame 1002, found"),
        ("1 2 3\n", ".chan", "line 1: expected 7 or 8 columns, the frame and tx ty tz"),
        (FLAIR.replace("FRAME ", "FRAMES "), ".t", "line 4: expected headings that begin with"),
        (FLAIR.replace("POINTS 3", "POINTS 9"), ".t", "expected 9 lines with positions, as POINTS"),
        (FLAIR.replace("POINTS 3", "POINTS x"), ".t", "line 3: POINTS: expected a whole number"),
        (FLAIR.replace("SPEED 25", "SPEED fast"), ".t", "line 3: SPEED: expected frames per"),
        (FLAIR.replace("0.60000", "0.6x"), ".t", "line 6, column XV: expected a number, found"),
        (FLAIR.replace("   2,", "   4,"), ".t", "line 6, column FRAME: expected frame 2, found 4"),
        (AE.replace("29.97", "fast"), ".t", "line 3: expected frames per second, found 'fast'"),
        (AE.replace("\t1\t0.6", "\t0\t0.6"), ".t", "line 12, Frame: expected a frame after 0"),
        (AE.replace("\tFrame\tdeg", "\tTime\tdeg"), ".t", "line 16: expected Frame, found 'Time'"),
        (AE.replace("\t1\t0.6\t540", "\t1\t0.6"), ".t", "line 12: expected 4 columns, found 3"),
        (AE.replace("\t2\t2\t", "\t2\t9\t"), ".t", "between the keyframes at 0 and 2: set one at"),
        (AE[: AE.index("Transform")], ".t", "line 7: expected End of Keyframe Data at the end"),
        (AE[: AE.index("\t2\t0.7")], ".t", "line 12: expected End of Keyframe Data at the end"),
        (AE[: AE.index("Transform")] + "End of Keyframe Data", ".t", "expected a property with"),
        (BVH.replace("Frames: 3", "Frames: 4"), ".t", "expected 4 lines with positions, as Frames"),
        (BVH.replace("CHANNELS 6", "CHANNELS 5"), ".t", "line 19: expected 6 columns, found 7"),
        (BVH.replace("CHANNELS 6", "CHANNELS x"), ".t", "joint Camera: expected CHANNELS, their"),
        (BVH.replace("Frame Time", "Time"), ".t", "expected Frames: and Frame Time:"),
        (BVH.replace("0.041667", "0"), ".t", "line 18: Frame Time: expected seconds, found '0'"),
        (BVH.replace("MOTION", ""), ".t", "expected HIERARCHY, and MOTION below it"),
    ],
)  # fmt: skip
def test_a_mistake_is_a_sentence(text, ending, said, shot, not_imported):
    axes = ("Position X", "Y Rotation") if "Adobe" in text else ("tx", "ry")
    (shot / "axes.toml").write_text(named_in_file(*axes))
    assert said in not_imported(text, name=f"source{ending}")


@pytest.mark.parametrize(
    ("name", "axis", "said"),
    [
        ("chan", "track", "chan has only tx, ty, tz, rx, ry, rz, vfov; found 'track'"),
        ("chan", "rx", "chan has rx in deg, not in mm"),
        ("flair", "my track", "Flair's headings have no blanks and commas; found 'my track'"),
        ("flair", "ROLL", "flair has ROLL in deg, not in mm"),
        ("ae", "track", "After Effects' properties are Position X"),
        ("ae", "X Rotation", "After Effects has X Rotation in deg, not in mm"),
        ("bvh", "track", "BVH's axes are channels of one joint, like camera1.Xrotation; found"),
        ("bvh", "a.Xrotation", "BVH has a.Xrotation in deg, not in mm"),
    ],
)
def test_what_a_format_cannot_hold(name, axis, said):
    table = to_table(
        Move(1, {1: axis}, {1: [0, 1]}), [Axis(axis, 1, 10, "mm", axis, file_unit="mm")]
    )
    with pytest.raises(ToolError, match=re.escape(said)):
        FORMATS[name].write(table, None)


SCENE = """<?xml version="1.0" encoding="UTF-8"?>
<scen:scene xmlns:scen="http://caliri.com/motion/scene">
  <scen:axis name="Pan" stepsPerUnit="-225.5" connectionChannel="2" units="deg"
    runMaxVelocity="20" runMaxAcceleration="40"/>
  <scen:axis name="Track &quot;A&quot;" stepsPerUnit="80" connectionChannel="1" units="mm"/>
  <scen:axis name="free" stepsPerUnit="1" connectionChannel="-1"/>
  <scen:axis name="Lens" stepsPerUnit="1" connectionChannel="3"/>
</scen:scene>
"""


def test_a_scene_of_arc_makes_an_axes_toml(shot, capsys):
    (shot / "rig.arcx").write_text(SCENE)
    out = shot / "rig.toml"
    assert run(shot, "import", str(shot / "rig.arcx"), "-o", str(out)) == 0
    assert 'Track "A" (motor 1), Pan (motor 2), Lens (motor 3)' in capsys.readouterr().out
    assert [
        (axis.name, axis.motor, axis.steps_per_unit, axis.unit, axis.invert)
        for axis in read_axes(out, every_motor=True)
    ] == [
        ('Track "A"', 1, 80.0, "mm", False), ("Pan", 2, 225.5, "deg", True),
        ("Lens", 3, 1.0, "units", False),
    ]  # fmt: skip
    assert "# runMaxVelocity in Arc: 20 units/s\n" in out.read_text()


@pytest.mark.parametrize(
    ("text", "output", "said"),
    [
        (SCENE, "x.csv", "it is an Arc scene, the set-up of a rig, and not a move: export"),
        (SCENE.replace("stepsPerUnit", "spu"), "x.toml", "expected an axis with stepsPerUnit"),
        (SCENE.replace('"-225.5"', '"x"'), "x.toml", "axis Pan, stepsPerUnit: expected a number"),
        (SCENE.replace('="2"', '="two"'), "x.toml", "connectionChannel: expected a motor's number"),
        (SCENE.replace('="2"', '="1"'), "x.toml", '"motor": 1 occurs twice'),
        (SCENE.replace('"80"', '"0"'), "x.toml", '"steps_per_unit": expected a number from 1e-06'),
        (CHAN, "x.toml", "x.toml: only an Arc scene (.arcx) gives an axes.toml"),
    ],
)  # fmt: skip
def test_a_scene_that_gives_no_axes(text, output, said, not_imported):
    assert said in not_imported(text, out=output)


def test_only_its_ending_tells_a_chan():
    assert of_content(CHAN, "a/b.chan").NAME == "chan"
    assert of_content(CHAN, "a/b.txt").NAME == "raw"
    assert of_content("frame,a\n1,2\n", "a/b.chan").NAME == "csv"
