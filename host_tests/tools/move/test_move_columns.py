"""Which column of a file moves which motor."""

import re

import pytest

from framestep_tools.axes.axes_file import axes_of
from framestep_tools.axes.rig_axes import Axes
from framestep_tools.errors import ToolError
from framestep_tools.move.move_file import Move, read_move, write_move
from host_tests.tools.conftest import LINEAR, imported, named_in_file

AXES = Axes(axes_of(LINEAR, "axes.toml"), "axes.toml")  # track is motor 1, pan motor 2


def moved(tmp_path, header, rows=((1, 5, 6), (2, 7, 8)), axes=AXES):
    path = tmp_path / "move.csv"
    width = header.count(",") + 1
    lines = [header, *(",".join(map(str, row[:width])) for row in rows)]
    path.write_text("\n".join(lines) + "\n")
    return read_move(path, axes)


@pytest.mark.parametrize(
    ("header", "positions", "names"),
    [
        ("frame,pan", {2: [5, 7]}, {2: "pan"}),
        ("frame,pan,track", {1: [6, 8], 2: [5, 7]}, {1: "track", 2: "pan"}),
        ("frame,PAN", {2: [5, 7]}, {2: "pan"}),
        ("frame,pan (steps)", {2: [5, 7]}, {2: "pan"}),
        ("frame,2", {2: [5, 7]}, {2: "pan"}),
        ("frame,motor 3,motor 1", {1: [6, 8], 3: [5, 7]}, {1: "track", 3: "motor 3"}),
        ("frame,Motor 2,track", {1: [6, 8], 2: [5, 7]}, {1: "track", 2: "pan"}),
    ],
)
def test_a_heading_decides(tmp_path, header, positions, names):
    move = moved(tmp_path, header)
    assert (move.positions, move.names, move.counted) == (positions, names, "")
    assert list(move.positions) == sorted(positions)
    write_move(tmp_path / "again.csv", move)
    assert read_move(tmp_path / "again.csv", AXES) == move


def test_other_headings_count_in_order_and_that_is_said(tmp_path):
    move = moved(tmp_path, "frame,boom,swing", axes=Axes())
    assert (move.positions, move.names) == ({1: [5, 7], 2: [6, 8]}, {1: "boom", 2: "swing"})
    assert move.counted == "boom is motor 1, swing is motor 2"
    mixed = moved(tmp_path, "frame,boom,pan", axes=Axes(axes_of(LINEAR, "axes.toml")[1:]))
    assert (mixed.positions, mixed.counted) == ({1: [5, 7], 2: [6, 8]}, "boom is motor 1")


@pytest.mark.parametrize(
    ("header", "said"),
    [
        ("frame,1,1", "column '1': it is for motor 1, as is column '1'"),
        ("frame,pan,2", "column '2': it is for motor 2, as is column 'pan'"),
        ("frame,track,Motor 1", "column 'Motor 1': it is for motor 1, as is column 'track'"),
        ("frame,boom", "column 'boom': no axis has this name, and axes.toml calls motor 1 'track'"),
        ("frame,pan,boom", "column 'boom': no axis has this name, and axes.toml calls motor 2"),
        ("frame,0", "column '0': expected a motor from 1 to 32"),
        ("frame,motor 33", "column 'motor 33': expected a motor from 1 to 32"),
        ("frame,pan (deg)", "this is in deg: framestep import converts it"),
        ("frame,pan [mm]", "this is in mm: framestep import converts it"),
        ("frame,m2", "column 'm2': by its place it is motor 1: write motor 1, or motor 2"),
        ("frame,track,Axis 3:", "column 'Axis 3:': by its place it is motor 2"),
    ],
)
def test_a_heading_that_contradicts_is_refused(tmp_path, header, said):
    with pytest.raises(ToolError, match=re.escape(said)):
        moved(tmp_path, header)


def test_an_axis_with_another_motors_number_is_refused(tmp_path):
    axes = Axes(axes_of(LINEAR.replace('"pan"', '"1"'), "axes.toml"), "axes.toml")
    with pytest.raises(ToolError, match="has an axis of this name for motor 2: write motor 1 or"):
        moved(tmp_path, "frame,1", axes=axes)
    assert moved(tmp_path, "frame,motor 1", axes=axes).positions == {1: [5, 7]}


def test_a_number_as_spreadsheets_write_it(tmp_path):
    assert moved(tmp_path, "frame,3.0,2.").positions == {3: [5, 7], 2: [6, 8]}


def test_what_is_written_is_read_without_axes(tmp_path):
    names = {1: "m2", 2: "pan (deg)", 3: "boom", 5: "tilt"}
    move = Move(1, names, {motor: [motor, motor] for motor in names})
    write_move(tmp_path / "move.csv", move)
    again = read_move(tmp_path / "move.csv", Axes())
    assert again.positions == move.positions
    assert again.names == {1: "motor 1", 2: "motor 2", 3: "boom", 5: "motor 5"}


@pytest.mark.parametrize("command", ["check", "upload", "play", "shoot", "export"])
def test_every_command_goes_by_the_headings(command, shot, refusal):
    """Each refuses a move whose headings contradict axes.toml, so each reads them."""
    path = shot / "named.csv"
    path.write_text("frame,tilt\n1,0\n2,1\n")
    options = {"export": ["-o", str(shot / "out.csv")], "check": []}
    options = options.get(command, ["--device", "socket://127.0.0.1:9"])
    given = ["1", "--move", str(path)] if command == "shoot" else [str(path)]
    assert "column 'tilt': no axis has this name, and" in refusal(command, *given, *options)


# Columns of other programs' files

CAMERA = "".join(f"{i} {0.1 * i:g} 1.5 -3.2 -12.5 {0.5 * i:g} 0 37.8\n" for i in range(1, 6))


def test_a_first_column_that_counts_is_the_frame(shot, capsys):
    move = imported(shot, "7 0 2\n8 1.25 2.01\n9 -5 2\n")
    assert (move.start_frame, move.positions) == (7, {1: [0, 12, -50], 2: [0, -1, 0]})
    error = capsys.readouterr().err
    assert "its first column counts 7, 8 … 9, so it is the frame" in error
    assert imported(shot, "-1,0,2\n0,1,2\n").start_frame == -1


@pytest.mark.parametrize("text", ["1.0 2\n2.0 2\n", "1 2\n3 2\n", "2 2\n1 2\n", "1 2\n"])
def test_other_first_columns_are_positions(text, shot, capsys):
    move = imported(shot, text)
    assert len(move.positions) == 2
    assert "the frame" not in capsys.readouterr().err


def test_columns_are_chosen_by_number(shot, not_imported, capsys):
    error = not_imported(CAMERA)
    assert "has 7 columns without names from column 2 on, there are 2 axes" in error
    assert "choose by --column track=2 and so on" in error
    move = imported(shot, CAMERA, "--column", "track=2", "--column", "pan=column 6")
    assert move.positions == {1: [1, 2, 3, 4, 5], 2: [150, 100, 50, 0, -50]}
    assert "left out, no axis names them: column 3, column 4, column 5, column 7, column 8" in (
        capsys.readouterr().err
    )
    assert imported(shot, CAMERA, "--column", "track=1", "--column", "pan=3").positions == {
        1: [10, 20, 30, 40, 50],
        2: [50] * 5,
    }
    (shot / "axes.toml").write_text(named_in_file("2", "column 6").replace('"2"', "2"))
    assert imported(shot, CAMERA) == move


def test_columns_are_chosen_by_heading_and_number_in_any_file(shot):
    csv = "frame,x,pan (deg),y\n1,0,2,3\n2,1,2,3\n"
    assert imported(shot, csv, "--column", "track=x").positions == {1: [0, 10], 2: [0, 0]}
    assert imported(shot, csv, "--column", "track=4").positions[1] == [30, 30]
    kuper = "Axes = A, B, C\r\n9 0 2\r\n9 1. 2\r\n"
    chosen = ["--column", "track=B", "--column", "pan=3"]
    assert imported(shot, kuper, *chosen).positions == {1: [0, 10], 2: [0, 0]}


@pytest.mark.parametrize(
    ("options", "status", "said"),
    [
        (["--column", "track"], 2, "--column: expected AXIS=COLUMN such as pan=ry or pan=5"),
        (["--column", "boom=2"], 1, "--column: there is no axis 'boom', there are track, pan"),
        (["--column", "track=9", "--column", "pan=2"], 1, "has no column 9 for axis track; its l"),
        (["--column", "track=x", "--column", "pan=2"], 1, "has no axis 'x' for motor 1; it has"),
    ],
)
def test_a_column_that_is_not_there(options, status, said, not_imported):
    assert said in not_imported(CAMERA, *options, status=status)


def test_units_in_headings_and_in_a_row_below_them(shot):
    for text in (
        "frame,track (cm),pan [deg]\n1,0,2\n2,1,2.01\n",
        "frame,track,pan\n,cm,deg\n1,0,2\n2,1,2.01\n",
        "# made by hand\n# frame;track;pan\n-;(cm);(°)\n1;0;2\n2;1;2,01\n",
    ):
        assert imported(shot, text).positions == {1: [0, 100], 2: [0, -1]}


def test_a_long_list_of_columns_is_cut(shot, not_imported, capsys):
    """Of those that are left out, and of those that there are."""
    wide = f"frame,track,pan{',other' * 2000}\n1,0,2{',1' * 2000}\n"
    imported(shot, wide)
    error = capsys.readouterr().err
    assert error.endswith("other, other and 1950 more\n")
    assert len(error) < 1000
    assert len(not_imported(wide, "--column", "pan=none")) < 1000
