"""Decimal points and commas, thousands, encodings and line ends of other programs' files."""

import re

import pytest

from framestep_tools.errors import ToolError
from framestep_tools.move.move_file import read_move
from framestep_tools.move.move_formats import FORMATS, of_content
from framestep_tools.text.text_file import decoded, read_text
from host_tests.tools.conftest import ARC, LINEAR, MAYA, imported, named_in_file, run
from host_tests.tools.move.test_move_formats import OF_AXES

TABLE = [[0.0, 2.0], [1.25, 2.01], [-5.5, 2.0]]


def values(text, decimal=None):
    """Return the rows of a file's axes."""
    text = decoded(text.encode(), "f").text
    recording = of_content(text, "f").read(text, "f", decimal)
    curves = [channel.curve.values for channel in recording.axes]
    return [list(row) for row in zip(*curves, strict=True)]


@pytest.mark.parametrize(
    "text",
    [
        "0,0 2,0\n1,25 2,01\n-5,5 2\n",
        "0,0\t2,0\n1,25\t2,01\n-5,5\t2\n",
        "0,0; 2,0\n1,25; 2,01\n-5,5; 2\n",
        "0,0, 2,0\n1,25, 2,01\n-5,5, 2\n",
        "0.0, 2.0\n1.25, 2.01\n-5.5, 2\n",
        "0.0,2.0\n1.25,2.01\n-5.5,2\n",
        "0.0 2.0\r1.25 2.01\r-5.5 2\r",
        "0 , 2.0\n1.25 , 2.01\n-5.5 , 2\n",
        "Axes = Track, Pan\n0,0 2,0\n1,25 2,01\n-5,5 2\n",
        "Axes = Track, Pan\n0.0,2\n1.25,2.01\n-5.5,2\n",
        "// a comment\nAxes = Track\tPan\n\n0,0 2,0\n# more\n1,25 2,01\n-5,5 2\n\x1a",
        "frame;a;b\n1;0,0;2\n2;1,25;2,01\n3;-5,5;2\n",
        'frame,a,b\n1,"0,0",2\n2,"1,25","2,01"\n3,"-5,5",2\n',
        "sep=;\nframe;a;b\n1;0,0;2\n2;1,25;2,01\n3;-5,5;2\n",
        "frame\ta\tb\n1\t0.0\t2\n2\t1.25\t2.01\n3\t-5.5\t2\n\x1a\x1a\x1a",
        "frame,a,b\n# a comment\n1,0,2\n// another\n2,1.25,2.01\n3,-5.5,2\n",
    ],
)
def test_points_and_commas(text):
    assert values(text) == TABLE


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("frame;a;b\n1;1.234;1,25\n", [[1234, 1.25]]),
        ("frame;a;b\n1;1.234,5;1\n", [[1234.5, 1]]),
        ("frame;a;b\n1;-1.234.567;1,5\n", [[-1234567, 1.5]]),
        ('frame,a,b\n1,"1,234.5",2\n2,"1,234","5"\n', [[1234.5, 2], [1234, 5]]),
        ("frame;a;b\n1;1 234,5;2\n", [[1234.5, 2]]),
        ("frame;a;b\n1;1\u202f234,5;2\u00a0345\n", [[1234.5, 2345]]),
        ("frame;a;b\n1;1'234.5;2’345\n", [[1234.5, 2345]]),
        ("frame;a;b\n1;0,125;2,125\n", [[0.125, 2.125]]),
        ("frame;a;b\n1;1e-3;2E+1\n", [[0.001, 20]]),
        ("frame;a;b\n1;1,5e-3;2\n", [[0.0015, 2]]),
        ("frame,a,b\n1,1.234,2.345\n", [[1.234, 2.345]]),
        ("1,2,3\n4,5,6\n", [[1, 2, 3], [4, 5, 6]]),
        ("Axes = A, B\n1,2\n3,4\n", [[1, 2], [3, 4]]),
        ("Axes = A\n1,2\n3,4\n", [[1.2], [3.4]]),
        ("12,5\n13\n", [[12.5], [13]]),
    ],
)
def test_what_numbers_mean(text, found):
    assert values(text) == found


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("12,5\n12,6\n", "f, line 1: '12,5' may be 12.5 or the numbers 12 and 5: say which by"),
        ("frame;a\n1;1,234\n", "f, line 2, column a: '1,234' may be 1.234 or 1234: say which by"),
        ("1,234 2,345\n", "f, line 1, column 1: '1,234' may be 1.234 or 1234"),
        ("1,234.5 2,345.5\n", "'1,234.5' may be 1234.5 or the numbers 1 and 234.5"),
        (
            "frame;a;b\n1;0;1,25\n2;12.5;1\n",
            "line 3, column a: '12.5' has a decimal point, but '1,25' a decimal comma (line 2, "
            "column b)",
        ),
        ("frame;a;b\n1;12,5;1.234.5\n", "expected a number with a decimal comma, found '1.234.5'"),
        ("frame,a\n1,1.23e-\n", "column a: expected a number, found '1.23e-'; its exponent is cut"),
        ("frame;a\n1;1,25x\n", "column a: expected a number, found '1,25x'"),
    ],
)
def test_what_can_be_read_in_two_ways_is_refused(text, said):
    with pytest.raises(ToolError, match=re.escape(said)):
        values(text)


def test_an_option_decides(shot):
    assert values("12,5\n12,6\n", ",") == [[12.5], [12.6]]
    assert values("12,5\n12,6\n", ".") == [[12, 5], [12, 6]]
    assert values("frame;a\n1;1,234\n", ",") == [[1.234]]
    assert values("frame;a\n1;1,234\n", ".") == [[1234]]
    move = imported(shot, "12,5\n12,6\n", "--decimal", "point")
    assert move.positions[1] == [120, 120]


# Steps are whole


def steps(tmp_path, text):
    (tmp_path / "steps.csv").write_text(text)
    return read_move(tmp_path / "steps.csv").positions


@pytest.mark.parametrize(
    "text",
    [
        "frame;a;b\n1;1234;12\n2;-5;0\n",
        "frame;a;b\n1;1234,0;12\n2;-5,00;0\n",
        "frame,a,b\n1,1234.000,12.000\n2,-5.000,0.000\n",
        "frame;a;b\n1;1.234;12,0\n2;-5;0\n",
        'frame,a,b\n1,"1,234.0",12\n2,-5,0\n',
        "frame;a;b\n1;1 234;12\n2;-5;0\n",
        "Frame;a;b\n1;1234;12\n2;-5;0\n\n;;\n",
        "FRAME\ta\tb\n1.0\t1234.0\t12.00\n2\t-5.\t0\n\n",
        "frame, a, b,\n1, 1234, 12,\n2, -5, 0,\n,,,\n",
    ],
)
def test_steps_as_spreadsheets_write_them(tmp_path, text):
    assert steps(tmp_path, text) == {1: [1234, -5], 2: [12, 0]}


@pytest.mark.parametrize(
    ("cell", "said"),
    [
        ("1.000", "'1.000' may be 1 with decimals or 1000: write whole steps, without fractions"),
        ("1.234", "'1.234' may be 1 with decimals or 1234: write whole steps"),
        ("1,000", "'1,000' may be 1.000 or 1000: write whole steps"),
        ("12.5", "expected a whole number for a, found '12.5'"),
        ("12,5", "expected a whole number for a, found '12,5'"),
        ("1e3", "expected a whole number for a, found '1e3'"),
        ("1_0", "expected a whole number for a, found '1_0'"),
    ],
)
def test_steps_that_are_not_whole_or_not_clear(tmp_path, cell, said):
    with pytest.raises(ToolError, match=f"line 3.*{re.escape(said)}"):
        steps(tmp_path, f"frame;a\n0;0\n1;{cell}\n")


# Encodings

ENCODINGS = ["utf-8", "utf-8-sig", "utf-16", "utf-16-be", "utf-32"]


@pytest.mark.parametrize("encoding", ENCODINGS)
@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
@pytest.mark.parametrize("last", ["", "\x1a", "\n\n\x1a\x1a"])
def test_encodings_line_ends_and_the_end_of_a_dos_file(encoding, end, last, shot, tmp_path):
    files = [
        ARC.replace(' encoding="utf-8"', ""), MAYA, "frame,track,pan\n1,0,2\n2,1.25,2.01\n",
        "Axes = Track, Pan\n0 2\n1.25 2.01\n", "0 2\n1.25 2.01\n",
    ]  # fmt: skip
    for text in files:
        path = tmp_path / "source"
        content = (text + last).replace("\n", end).encode(encoding)
        path.write_bytes(b"\xfe\xff" + content if encoding == "utf-16-be" else content)
        read, said = read_text(path)
        assert not said
        found = of_content(read, "f").read(read, "f")
        assert found.names == of_content(text, "f").read(text, "f").names
    (tmp_path / "axes.toml").write_bytes(LINEAR.encode("utf-8-sig"))
    path = tmp_path / "steps.csv"
    content = ("frame,track\n1,5\n2,6\n" + last).replace("\n", end).encode(encoding)
    path.write_bytes(b"\xfe\xff" + content if encoding == "utf-16-be" else content)
    assert read_move(path).positions == {1: [5, 6]}


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"PK\x03\x04anything", "it is a ZIP archive: save an Excel sheet as CSV, unpack a .usdz"),
        (b"Kaydara FBX Binary  \0\x1a\0", "it is a binary FBX file: export the camera to another"),
        ("frame,a\n1,2\n".encode("utf-16-le"), "it is not text, see character 2 (if it is UTF-16"),
        (b"frame,a\n1,2\x01\n", "it is not text, see character 12"),
        (b"frame,a\x1a\n1,2" + b"\n" * 2000 + b"3", "it is not text, see character 8"),
        (b"\xff\xfe\x00\xd8f", "its mark says UTF-16, which it is not, see byte 2"),
        (b"", "the file is empty"),
        (b"\n \n", "the file is empty"),
        (b"<scene><axis name='pan' stepsPerUnit='9'/></scene>", "it is an Arc scene, the set-up"),
    ],
)
def test_what_is_no_text(content, said, not_imported):
    assert said in not_imported(content)


def test_latin_1_is_the_last_resort_and_is_said(shot, capsys):
    (shot / "axes.toml").write_text(LINEAR.replace('"pan"', '"schräg"'), encoding="utf-8")
    (shot / "source").write_bytes("frame,track,schräg\n1,0,2\n".encode("latin-1"))
    assert run(shot, "import", str(shot / "source"), "-o", str(shot / "out")) == 0
    assert "byte 16 is not UTF-8, so the text is read as Latin-1" in capsys.readouterr().err
    assert read_move(shot / "out").names == {1: "track", 2: "schräg"}


def test_a_blank_line_before_the_xml_declaration(shot):
    assert imported(shot, "\n  " + ARC) == imported(shot, ARC)
    declared = ARC.replace("?>", ' encoding="ISO-8859-1"?>', 1)
    assert imported(shot, declared) == imported(shot, ARC)


@pytest.mark.parametrize("name", OF_AXES)
def test_the_rate_travels_with_the_move(name, shot, capsys):
    """From an .anim at 25 frames/s into the move, from there into each file that can name it."""
    names = {
        "chan": ("tx", "rx"),
        "ae": ("Zoom", "Rotation"),
        "aejson": ("Zoom", "Rotation"),
        "bvh": ("a.Xposition", "a.Xrotation"),
    }
    (shot / "axes.toml").write_text(named_in_file("a.x", "a.y"))
    curves = "".join(
        f"anim {axis} {axis} a 0 0 0; animData {{ input time; output unitless; "
        f"keys {{ 1 {value} linear linear; 3 {value} linear linear; }} }}\n"
        for axis, value in (("x", 0), ("y", 2))
    )
    move = imported(shot, "animVersion 1.1; timeUnit pal;\n" + curves)
    assert move.fps == 25
    (shot / "axes.toml").write_text(named_in_file(*names.get(name, ("a.x", "a.y"))))
    out, back = shot / f"out{FORMATS[name].ENDINGS[0]}", shot / "back.csv"
    assert run(shot, "export", str(shot / "move.csv"), "-o", str(out), "--format", name) == 0
    assert f"frames 1 to 3 of 2 axes, as {name}" in capsys.readouterr().out
    assert run(shot, "import", str(out), "-o", str(back)) == 0
    assert f"for 2 motors, from {name}" in capsys.readouterr().out
    carries = name in ("anim", "csv", "ae", "aejson", "bvh", "flair")
    assert read_move(back).fps == (25 if carries else None)
    given = ["import", str(out), "-o", str(back), "--fps", "24"]
    assert run(shot, *given) == (1 if carries else 0)
    if carries:
        assert "is at 25 frames/s, --fps says 24: leave --fps out" in capsys.readouterr().err
    else:
        assert read_move(back).fps == 24
        assert run(shot, "import", str(out), "-o", str(back), "--fps", "24000/1001") == 0
        assert read_move(back).fps == pytest.approx(24000 / 1001)


@pytest.mark.parametrize(
    ("comment", "fps"),
    [
        ("fps: 23,976", 23.976),
        ("23,976 fps", 23.976),
        ("frame rate = 24000/1001 (NTSC)", 24000 / 1001),
        ("shot at 25fps, 1001 frames", 25),
        ("fps: 25, frames: 8", 25),
        ("exported at 25 fps. 25 frames per second", 25),
        ("frame rate 25p, H264", None),
        ("frames 1 to 240", None),
    ],
)
def test_the_rate_in_a_comment(comment, fps):
    for text in (f"# {comment}\nframe,a\n1,2\n", f"# {comment}\nAxes = a\n1\n"):
        assert of_content(text, "f").read(text, "f").fps == fps
