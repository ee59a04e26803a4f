"""A mistake in a move file gives one sentence, and nothing is written."""

import json
import os
from contextlib import suppress
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from framestep_tools.axes.axes_file import Axis
from framestep_tools.errors import ToolError
from framestep_tools.move.move_conversion import to_move
from framestep_tools.move.move_formats import FORMATS, of_content
from framestep_tools.move.move_formats.arc import axes_toml
from host_tests.tools.conftest import ARC, MAYA, run
from host_tests.tools.move.test_ae_json import BAKED, KEYED, KEYS
from host_tests.tools.move.test_camera_formats import AE, BVH, CHAN, FLAIR, SCENE

VALID = [
    ARC, MAYA, "frame,track,pan\n1,0,2\n2,1.25,2.01\n", "seconds;track;pan\n0;0;2\n0,5;1,25;2,01\n",
    "Axes = Track, Pan\r\n0 2\r\n1.25 2.01\r\n", "0 2\n1.25 2.01\n", CHAN, FLAIR, AE, BVH, SCENE,
    json.dumps(KEYED), json.dumps(BAKED), json.dumps(KEYS),
]  # fmt: skip


@settings(max_examples=500, deadline=None)
@given(
    st.sampled_from(VALID),
    st.integers(0, 1500),
    st.integers(0, 30),
    st.text("0123456789.,;-+eE \n\t\"'<>/={}axn\0\x85", max_size=6) | st.text(max_size=3),
)
def test_a_spoilt_file_is_read_or_refused(text, at, length, put):
    """Nothing comes out but the error that a command prints as a sentence."""
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
    with suppress(ToolError):
        axes_toml(spoilt, "f")


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
        ("frame,track,pan\n1,0,2\n2,100.1,2\n", [],
         "frame 2, axis track: 100.1 mm is beyond its limits of -5 to 100 mm"),
        ("frame,track,pan\n7,0,1e9\n", [],
         "frame 7, axis pan: 1000000000 deg is step -99999999800"),
        ("frame,track,pan\n2147483647,0,2\n2147483648,0,2\n", [], "frame numbers have to fit"),
        ("seconds,track,pan\n0,0,2\n", [], "is in seconds: name the frames per second by --fps"),
        ("seconds,track,pan\n0,0,2\n0,0,2\n", ["--fps", "24"],
         "column seconds: expected a time after 0"),
        ("seconds,track,pan\n0,0,2\n1e9,0,2\n", ["--fps", "24"], "expected at most 1000000 frames"),
        ("# 25 fps\nframe,track,pan\n1,0,2\n", ["--fps", "24"],
         "is at 25 frames/s, --fps says 24: leave --fps out"),
        *(
            (
                f"# {comment}\nframe,track,pan\n1,0,2\n",
                [],
                ", line 1: expected frames per second from 0.001 to 1000, such as 25 or "
                f"24000/1001, found {found!r}",
            )
            for comment, found in {
                "fps: 0": "0", "fps = -25": "-25", "-25 fps": "-25", "fps: 1e9": "1e9",
                "25.5.1 fps": "25.5.1", "frame rate: 24/0": "24/0", "fps: 25p": "25p",
                "FPS = abc": "abc", "fps:": "", "frame rate: film": "film",
            }.items()
        ),
        ("# 24 fps\n# fps: 25\nframe,track,pan\n1,0,2\n", [],
         ", line 2: comments say 24 and 25 frames per second: leave one"),
        ("# 25 fps\nseconds,track,pan\n0,0,2\n2,1,2\n", ["--fps", "24"],
         "is at 25 frames/s, --fps says 24: leave --fps out"),
        ('frame,track,pan\n1,0,2\n2,"0,2\n3,0,2\n', [], "line 3: a quote is not closed"),
        ('frame,track,pan\n1,"0"5,2\n', [], "line 2: ',' expected after '\"'"),
        ("0 2\n0 2 3\n", [], "line 2: expected 2 columns, found 3"),
        ("0 2 3\n", [], "has 3 columns without names, there are 2 axes"),
        ("0 2\n\n0 two\n", [], "line 3, column 2: expected a number, found 'two'"),
        ("Axes = Track, Pan\r\n0 2\r\n0\r\n", [], "line 3: expected 2 columns, found 1"),
        ("Axes = Track,\n0\n", [], "expected a first line like Axes = Pan, Tilt"),
        ("Axes = Track, Pan\n", [], "expected a line for each frame, found none"),
        ("0 2\n", ["--format", "kuper"],
         "expected a first line like Axes = Pan, Tilt, found '0 2'"),
        ("0 2\n", ["--format", "csv"],
         "line 1: expected a header that begins with frame or seconds"),
        ("bones\n", [],
         "not recognised as any of gltf, usd, arc, anim, ae, aejson, bvh, flair, kuper, csv"),
        ("", [], "the file is empty"),
        ("animVersion 1.1;\n", [], "expected a curve with keys over time, found none"),
        (MAYA.replace("pal", "vhs"), [], "timeUnit: expected one of game, film, pal"),
        (MAYA.replace("    3 1 lin", "    1 1 lin"), [],
         "line 6, track.translateX: expected a key after 1"),
        (MAYA.replace("3 1 linear flat 1 1 0", "3 1"), [], "line 14: not understood: '3,1'"),
        (MAYA[: MAYA.index("    6 9 flat")], [], "line 14: expected } at the end: a part of the"),
        (MAYA.rstrip().removesuffix("}"), [], "expected } at the end: a part of the file"),
        (MAYA.replace("3 1 linear", "3 one linear"), [],
         "line 14, track.translateX: expected a number"),
        (MAYA.replace("outputUnit cm", "outputUnit mi"), [], "its linear unit: expected mm, cm, m"),
        (MAYA.replace("outputUnit cm", "inputUnit sec"), [],
         "expected the file's timeUnit pal, found sec"),
        ("<scene>", [], "not valid XML: no element found: line 1"),
        ("<svg/>", [], "expected <scene> as the outermost element, found svg"),
        ("<scene/>", [], "expected an axis with keyframes, found none"),
        (ARC.replace('units="cm"', 'units="deg"'), [],
         "axis track: its unit deg cannot be converted to mm"),
        (ARC.replace('units="cm"', 'units="parsec"'), [], "axis track: expected units of mm, cm"),
        (ARC.replace('x="9"', 'x="1"'), [],
         "axis track, keyframe 2: expected a frame after 1, found 1"),
        (ARC.replace('y="8" x="9"', 'x="9"'), [], "axis track, keyframe 2, y: expected a number"),
        (ARC.replace('<scen:controlPoints y="0" x="5"/>', ""), [],
         "axis track: expected 2 control points for 2 keyframes, found 1"),
        (ARC.replace('y="0" x="5"', 'y="0" x="0.5"'), [],
         "between the keyframes at 1 and 9 points away from the other keyframe"),
        (ARC.replace('x="9"', 'x="1e9"'), [], "expected at most 1000000 frames, found 1 to 1e+09"),
    ],
)  # fmt: skip
def test_one_sentence_says_what_is_wrong_and_nothing_is_written(text, options, said, not_imported):
    assert said in not_imported(text, *options)


@pytest.mark.parametrize(
    ("args", "status", "said"),
    [
        (["import", "SOURCE", "-o", "SOURCE"], 2, "is the file to read"),
        (["import", "SOURCE", "-o", "OUT", "--format", "flare"], 2,
         "'flare' is not one of gltf, usd, "),
        (["import", "nothing", "-o", "OUT"], 1, "cannot read the move nothing: No such file"),
        (["import", "SOURCE", "-o", "no/where.csv"], 1, "cannot write no/where.csv: No such file"),
        (["export", "SOURCE", "-o", "OUT"], 1, "no format has the ending (none); name one by"),
        (["export", "SOURCE", "-o", "x.arcm", "--fps", "9"], 2,
         "--fps is for csv, anim, ae, aejson, bvh, flair, gltf, usd; arc has no rate"),
        (["export", "MOVE", "-o", "x.csv", "--fps", "inf"], 2,
         "--fps: expected frames per second from 0.001 to 1000"),
        (["import", "SOURCE", "-o", "OUT", "--column", "pan=1", "--column", "pan=2"], 2,
         "--column: pan has two values: give one"),
        (["import", "SOURCE", "-o", "OUT", "--camera", "up=y", "--camera", "up=z"], 2,
         "--camera: up has two values: give one"),
        (["import", "SOURCE", "-o", "OUT", "--fps", "nan"], 2,
         "--fps: expected frames per second from 0.001 to 1000"),
        (["export", "camera_move.csv", "-o", "x.csv"], 1, "there are axes for 1, 2"),
        (["export", "MOVE", "-o", "x.csv"], 1, "axis track: 100.1 mm is beyond its limits"),
        (["export", "ONE", "-o", "x.csv"], 1, "positions for motor 1, and there are axes for 1, 2"),
    ],
)  # fmt: skip
def test_one_sentence_says_what_is_wrong_with_a_command(args, status, said, shot, refusal):
    files = {name: str(shot / name) for name in ("SOURCE", "OUT", "MOVE", "ONE")}
    Path(files["SOURCE"]).write_text("0 2\n")
    Path(files["MOVE"]).write_text("frame,track,pan\n1,1001,0\n")
    Path(files["ONE"]).write_text("frame,track\n1,0\n")
    assert said in refusal(*(files.get(word, word) for word in args), status=status)
    assert not Path(files["OUT"]).exists()


def test_what_cannot_be_written_leaves_nothing_behind(shot, not_imported):
    (shot / "out").mkdir()
    assert "out: Is a directory" in not_imported("0 2\n")


def test_a_link_stays_one_and_a_device_is_written_to(shot):
    (shot / "link").symlink_to(shot / "move.csv")
    (shot / "source").write_text("0 2\n")
    near, far = os.openpty()
    try:
        for output in (str(shot / "link"), os.ttyname(far)):
            assert run(shot, "import", str(shot / "source"), "-o", output) == 0
        whole = (shot / "move.csv").read_bytes().split()
        received = b""
        while len(received.split()) < len(whole):  # the kernel hands it over in parts
            received += os.read(near, 99)
        assert received.split() == whole
    finally:
        os.close(near)
        os.close(far)
    assert (shot / "link").is_symlink()
