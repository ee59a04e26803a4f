"""check, play, upload, export and the console read what import reads."""

import json

import pytest

from framestep_tools.axes import rig_axes
from framestep_tools.console.axes_text import AxesText
from framestep_tools.console.move_requests import MoveWork
from framestep_tools.errors import ToolError
from framestep_tools.move.any_file import read_any
from framestep_tools.move.move_file import read_move
from host_tests.tools.conftest import ARC, LINEAR, named_in_file, run
from host_tests.tools.move.test_ae_json import KEYED
from host_tests.tools.move.test_camera_formats import AE, BVH, CHAN, FLAIR

FILES = {
    "a.arcm": (ARC, "track", "pan", []),
    "a.chan": (CHAN, "tx", "ry", []),
    "a.txt": (FLAIR, "XV", "ROLL", []),
    "ae.txt": (AE, "Position X", "Y Rotation", []),
    "ae.json": (json.dumps(KEYED), "Position X", "Y Rotation", []),
    "a.bvh": (BVH, "Camera.Xposition", "Camera.Yrotation", []),
    "raw.txt": ("0.5 2\n0.6 2.5\n", "track", "pan", []),
    "s.csv": ("seconds;track;pan\n0;0,5;2\n0,04;0,6;2,5\n", "track", "pan", ["--fps", "25"]),
    "t.csv": ("# 25 fps\nseconds;track;pan\n0;0,5;2\n2;0,6;2,5\n", "track", "pan", []),
    "k.kup": ("# 24 fps\nAxes = Track, Pan\n0,5 2\n0,6 2,5\n", "track", "pan", []),
}


@pytest.fixture(params=sorted(FILES))
def file(request, shot):
    text, track, pan, options = FILES[request.param]
    (shot / "axes.toml").write_text(named_in_file(track, pan))
    path = shot / request.param
    path.write_text(text)
    return path, options


def test_each_file_is_the_move_that_import_makes_of_it(file, shot, capsys):
    path, options = file
    out = shot / "move.csv"
    assert run(shot, "import", str(path), "-o", str(out), *options) == 0
    axes = rig_axes.load(shot / "axes.toml")
    fps = float(options[1]) if options else None
    assert read_any(path, axes, fps) == read_move(out, axes)
    capsys.readouterr()
    speeds = ["--velocity", "20000", "--acceleration", "200000"]
    assert run(shot, "check", str(path), "--json", *speeds, *options) in (0, 1)
    found = json.loads(capsys.readouterr().out)
    assert [motor["name"] for motor in found["motors"]] == ["track", "pan"]
    assert found["fps"] == round(read_move(out, axes).fps or 24, 3)
    assert run(shot, "export", str(path), "-o", str(shot / "x.csv"), *options) == 0


def test_the_page_reads_it_as_well(file, shot):
    path, options = file
    asked = {"name": path.name, "text": path.read_text(), "fps": float((options or [0, 24])[1])}
    found = MoveWork(AxesText(shot / "axes.toml")).read_move(json.dumps(asked))
    move = read_any(path, rig_axes.load(shot / "axes.toml"), asked["fps"])
    expected = {
        "start": move.start_frame, "motors": [1, 2], "positions": [*move.positions.values()],
        "names": ["track", "pan"], "fps": move.fps, "said": [*move.said],
    }  # fmt: skip
    assert {key: found[key] for key in expected} == expected


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        ("{}", "the page has sent no file"),
        ('{"name": "f", "data": "A"}', "the page has sent no file"),
        ('{"name": "f", "data": "ü"}', "the page has sent no file"),
        ('{"name": "f", "text": "\\u0000"}', "cannot read f: it is not text"),
        ('{"name": "f", "text": "0 1\\n"}', "f is in units, and there is no axes.toml, which"),
    ],
)
def test_what_the_page_cannot_have_read(asked, said):
    with pytest.raises(ToolError, match=said):
        MoveWork(None).read_move(asked)


def test_a_file_in_units_needs_axes_and_one_in_steps_does_not(shot, refusal, capsys):
    (shot / "steps.csv").write_text("frame,a\n1,5\n2,6\n")
    (shot / "units.txt").write_text("0.5 2\n0.6 2\n")
    (shot / "seconds.csv").write_text("seconds,track,pan\n0,0.5,2\n")
    nothing = rig_axes.Axes()
    assert read_any(shot / "steps.csv", nothing).positions == {1: [5, 6]}
    with pytest.raises(ToolError, match=r"is in units, and there is no axes.toml.*column 1, col"):
        read_any(shot / "units.txt", nothing)
    said = refusal("check", str(shot / "seconds.csv"))
    assert "is in seconds: name the frames per second by --fps" in said
    assert run(shot, "check", str(shot / "units.txt")) == 0
    assert "column 1 is track, column 2 is pan" in capsys.readouterr().err


def test_the_example_plays_whatever_the_motors_are_called(shot, capsys):
    (shot / "axes.toml").write_text(LINEAR.replace('"track"', '"swing"'))
    assert run(shot, "check", "camera_move.csv", "--json", "--velocity", "20000") in (0, 1)
    motors = json.loads(capsys.readouterr().out)["motors"]
    named = {each["motor"]: each["name"] for each in motors}
    assert named == {1: "swing", 2: "pan", 3: "swing", 4: "pan"}


def test_another_rate_than_the_files_is_said(shot, capsys):
    (shot / "m.csv").write_text("# fps: 25\nframe,track\n1,5\n2,6\n")
    assert run(shot, "check", str(shot / "m.csv"), "--json") == 0
    assert json.loads(capsys.readouterr().out)["fps"] == 25
    assert run(shot, "check", str(shot / "m.csv"), "--json", "--fps", "24") == 0
    out, error = capsys.readouterr()
    assert json.loads(out)["fps"] == 24
    assert error == ("the move is at 25 frames/s, --fps says 24: it takes 1.04 times as long\n")
    assert run(shot, "check", str(shot / "m.csv"), "--json", "--fps", "25.0") == 0
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize("command", ["check", "play", "import", "export"])
def test_a_scene_that_is_not_read_is_named(command, shot, refusal):
    (shot / "a.fbx").write_text("; FBX 7.3.0 project file\nFBXHeaderExtension:  {\n}\n")
    output = ["-o", str(shot / "x.csv")] if command in ("import", "export") else []
    said = refusal(command, str(shot / "a.fbx"), *output)
    assert "it is an FBX scene, which framestep does not read: export" in said


WHOLE = {
    "start": 1,
    "positions": [[1, 2, 3], [4, 5, 6]],
    "fps": 24,
    "motors": 8,
    "frames": 1000,
    "set": [{"velocity": 5000, "acceleration": 20000, "lower": None, "upper": None}] * 2,
    "format": "csv",
    "name": "f.csv",
    "text": "frame,pan\n1,2\n",
}
ODD = ["null", "0", "-1", "1e300", "1e-300", "NaN", "Infinity", '"x"', "[]", "{}", "99999999999"]


@pytest.mark.parametrize("task", ["check_move", "export_move", "read_move"])
def test_a_request_of_the_page_is_done_or_refused(task, shot):
    """Whatever it has in place of a value: the page gets an answer."""
    work = MoveWork(AxesText(shot / "axes.toml"))
    getattr(work, task)(json.dumps(WHOLE))
    changed = [{**WHOLE, key: "ODD"} for key in WHOLE]
    changed += [{**WHOLE, "set": [{**WHOLE["set"][0], key: "ODD"}] * 2} for key in WHOLE["set"][0]]
    texts = [json.dumps(each).replace('"ODD"', odd) for each in changed for odd in ODD]
    for text in [*texts, "[" * 100_000]:
        try:
            found = getattr(work, task)(text)
        except ToolError:
            continue
        assert "nan" not in str(found)


@pytest.mark.parametrize("fps", [0, -25, 1e9, float("nan"), "25"])
def test_the_rate_of_an_export_of_the_page(fps, shot):
    work = MoveWork(AxesText(shot / "axes.toml"))
    with pytest.raises(ToolError, match=r"expected frames per second from 0\.001 to 1000, found"):
        work.export_move(json.dumps({**WHOLE, "fps": fps}))
