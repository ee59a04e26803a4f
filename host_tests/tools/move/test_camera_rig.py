"""From a camera's pose in a file to the motors of its rig, and back."""

import json
import re
from contextlib import suppress

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from framestep_tools.axes import rig_axes
from framestep_tools.console.axes_text import AxesText
from framestep_tools.console.move_requests import MoveWork
from framestep_tools.errors import ToolError
from framestep_tools.judge import virtual_reference as reference
from framestep_tools.move.any_file import any_of
from framestep_tools.move.camera_rig import rig_of
from framestep_tools.move.move_conversion import to_move, to_pose_table
from framestep_tools.move.move_file import Move
from framestep_tools.move.move_formats import FORMATS, of_content
from framestep_tools.text.text_file import Text
from host_tests.tools.conftest import imported, run

MM, DEG = 1000, 2000  # steps per unit
NODAL = (120, -80, 60)
SPANS = {"boom": 80, "swing": 80, "pan": 170, "tilt": 85, "roll": 170}  # degrees


def rig_with(kind, joints, **arm):
    """Return the names of a rig's joints, its lines in axes.toml, and the rig."""
    names = (*joints, "pan", "tilt", "roll")
    axes = tuple(reference.Axis(i, DEG if n in SPANS else MM) for i, n in enumerate(names, 1))
    lengths = "".join(f"{key} = {value}\n" for key, value in arm.items())
    return names, f"{lengths}nodal = {[*NODAL]}\n", reference.Rig(kind, axes, nodal=NODAL, **arm)


RIGS = {
    "boom-swing-track": rig_with(1, ("boom", "swing", "track"), length=1200, extension=300),
    "Y-swing-track": rig_with(3, ("y", "swing", "track"), length=1200, extension=300),
    "X-Y-Z": rig_with(4, ("x", "y", "z")),
}


def axes_toml(kind, more=""):
    joints, lengths, _ = RIGS[kind]
    axes = "".join(
        f'[[axis]]\nname = "{name}"\nmotor = {i}\nsteps_per_unit = {DEG if name in SPANS else MM}\n'
        f'unit = "{"deg" if name in SPANS else "mm"}"\n'
        for i, name in enumerate(joints, 1)
    )
    return f'{axes}[camera]\ntype = "{kind}"\n{lengths}{more}'


def drawn(kind, frames=12, seed=1):
    """Return steps of each motor at each frame, over the rig's whole reach."""
    random = np.random.default_rng(seed)
    spans = [SPANS.get(name, 1500) for name in RIGS[kind][0]]
    joints = random.uniform(-1, 1, (frames, len(spans))) * spans
    return RIGS[kind][2], np.array([RIGS[kind][2].steps(row).round() for row in joints], int)


def chan(poses, first=1):
    """Write poses of the reference as Nuke does: z back, rz to the other side than roll."""
    return "".join(
        f"{i} {x:.9f} {y:.9f} {z:.9f} {tilt:.9f} {pan:.9f} {-roll:.9f} 30\n"
        for i, (z, x, y, pan, tilt, roll) in enumerate(poses, first)
    )


def moved(text, name, toml):
    return any_of(Text(text), name, rig_axes.of_text(toml, "axes.toml"))


def steps_of(text, toml):
    """Return the steps of a .chan, a row per frame; drawn angles jump, and are not unwrapped."""
    axes = rig_axes.of_text(toml, "axes.toml")
    recording = FORMATS["chan"].read(text, "a.chan")
    move, _ = to_move(recording, axes.list, "a.chan", camera=rig_of(axes), unwrap=False)
    return np.array(list(move.positions.values())).T


@pytest.mark.parametrize("kind", RIGS)
def test_poses_lead_to_the_motors_of_the_double_precision_rig(kind):
    """Also if the rig has a place and a heading in the scene."""
    rig, steps = drawn(kind)
    home = rig.forward(rig.home) * (1, 1, 1, 0, 0, 0)
    poses = [rig.forward(rig.joints(row)) - home for row in steps]
    assert np.abs(steps_of(chan(poses), axes_toml(kind)) - steps).max() <= 1
    turned = [  # by 90 degrees to the left: what was to the right is ahead, at -z
        (-x + 30, z + 10, y + 20, pan + 90, tilt, roll) for z, x, y, pan, tilt, roll in poses
    ]
    toml = axes_toml(kind, "origin = [10, 20, 30]\nheading = 90\n")
    assert np.abs(steps_of(chan(turned), toml) - steps).max() <= 1


ORDERS = ["XYZ", "XZY", "YXZ", "YZX", "ZXY", "ZYX"]


@pytest.mark.parametrize(
    "name",
    ["csv", "kuper", "arc", "chan", "flair", "ae", "aejson", "bvh", "anim", "gltf", "usd"],
)
@pytest.mark.parametrize("kind", RIGS)
@settings(max_examples=5)
@given(
    seed=st.integers(0, 10**6),
    heading=st.integers(-180, 180),
    order=st.sampled_from(["", *ORDERS]),
    up=st.sampled_from(["", "y", "z"]),
)
@example(seed=1, heading=0, order="", up="z")
@example(seed=1, heading=0, order="ZYX", up="")
def test_a_pose_file_leads_back_to_the_same_steps(name, kind, seed, heading, order, up):
    _, steps = drawn(kind, 8, seed)
    more = f'order = "{order}"\n' * bool(order) + f'up = "{up}"\n' * bool(up)
    toml = axes_toml(kind, f'origin = [1, -2, 3]\nheading = {heading}\nfile_unit = "cm"\n{more}')
    axes = rig_axes.of_text(toml, "axes.toml")
    names = {axis.motor: axis.name for axis in axes.list}
    move = Move(5, names, dict(enumerate(steps.T.tolist(), 1)), 25.0)
    chosen = FORMATS[name]
    table = to_pose_table(move, axes.list, rig_of(axes), chosen.CAMERA)
    text = chosen.write(table, None)
    recording = chosen.read(text, "f")
    fps = 25.0 if recording.seconds else None
    rig = rig_of(axes)
    found, left = to_move(recording, axes.list, "f", fps, camera=rig, unwrap=False)
    assert left == []
    whole_turns = chosen.CAMERA.changed(order, up).is_direct and name not in ("gltf", "usd")
    for axis in axes.list:
        turn = 360 * DEG if axis.name == "pan" else 0  # matrices know no full turns
        off = np.array(found.positions[axis.motor]) - move.positions[axis.motor]
        if turn and not whole_turns:
            off -= round(off[0] / turn) * turn
            off = (off + turn // 2) % turn - turn // 2
        if axis.name == "roll" and not whole_turns:
            off = (off + 180 * DEG) % (360 * DEG) - 180 * DEG
        assert np.abs(off).max() <= 1, axis.name


def rotated(order, x, y, z):
    """Return the matrix of rotations about x, y, z, the first letter of `order` first."""
    found = np.eye(3)
    for letter in order:
        i = "XYZ".index(letter)
        c, s = np.cos(np.radians((x, y, z)[i])), np.sin(np.radians((x, y, z)[i]))
        turn = np.eye(3)
        j, k = (i + 1) % 3, (i + 2) % 3
        turn[j, j] = turn[k, k] = c
        turn[k, j], turn[j, k] = s, -s
        found = turn @ found
    return found


def looks(move):
    """Return the directions of the camera's back, up and right in the world, at the first frame."""
    pan, tilt, roll = (move.positions[motor][0] / DEG for motor in (4, 5, 6))
    to_world = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
    return to_world @ reference.rotation(pan, tilt, roll) @ to_world.T


@pytest.mark.parametrize("order", ORDERS)
def test_orders_of_rotations(order):
    toml = axes_toml("X-Y-Z", f'order = "{order}"\n')
    move = moved("1 0 0 0 20 30 40\n", "a.chan", toml)
    assert looks(move) == pytest.approx(rotated(order, 20, 30, 40), abs=1e-4)


def test_a_scene_with_z_up():
    """Blender: a camera with rotation 0 looks down, one turned by 90 about x looks along y."""
    toml = axes_toml("X-Y-Z", 'order = "XYZ"\nup = "z"\nnodal = [0, 0, 0]\n').replace(
        "nodal = [120, -80, 60]\n", ""
    )
    move = moved("1 1 2 3 90 0 0\n", "a.chan", toml)
    assert [move.positions[m][0] for m in range(1, 7)] == [1000, 3000, -2000, 0, 0, 0]
    move = moved("1 0 0 0 0 0 0\n", "a.chan", toml)
    assert move.positions[5] == [-90 * DEG]
    move = moved("1 0 0 0 90 0 90\n", "a.chan", toml)  # looks along -x: to the left
    assert move.positions[4] == [90 * DEG]


def test_directions_of_each_program():
    toml = axes_toml("X-Y-Z").replace("nodal = [120, -80, 60]\n", 'file_unit = "cm"\n')
    flair = """DATA_TYPE CARTS_RAW MRMC_COORDS IN_CENTIMETRES
POINTS 1 SPEED 25
FRAME XV YV ZV XT YT ZT ROLL
1 10 20 30 10 120 30 5
"""  # forward 10, left 20, up 30; looks to the left
    move = moved(flair, "a.txt", toml)
    assert [move.positions[m][0] for m in range(1, 7)] == [
        -200_000, 300_000, -100_000, 90 * DEG, 0, -5 * DEG,
    ]  # fmt: skip
    ae = """Adobe After Effects 8.0 Keyframe Data

\tUnits Per Second\t25
Transform\tPosition
\tFrame\tX pixels\tY pixels\tZ pixels
\t0\t10\t20\t30
Transform\tY Rotation
\tFrame\tdegrees
\t0\t10
End of Keyframe Data
"""  # right 10, down 20, ahead 30; turned to the right
    move = moved(ae, "a.txt", toml)
    assert [move.positions[m][0] for m in range(1, 7)] == [
        100_000, -200_000, -300_000, -10 * DEG, 0, 0,
    ]  # fmt: skip
    point = "Transform\tPoint of Interest\n\tFrame\tX\tY\tZ\n\t0\t10\t-80\t130\n"
    aimed = ae.replace("End of", point + "End of")
    move = moved(aimed, "a.txt", toml)  # as far up as ahead, and then turned
    ahead = looks(move) @ (0, 0, -1)
    up = np.array([0, 1, 1]) / np.sqrt(2)
    assert ahead == pytest.approx(
        np.cos(np.radians(10)) * np.array([0, up[1], -up[2]])
        + np.sin(np.radians(10)) * np.eye(3)[0],
        abs=1e-3,
    )
    maya = "animVersion 1.1;\ntimeUnit pal;\nlinearUnit m;\n" + "".join(
        f"anim t {name} cam 0 0 0;\nanimData {{\n input time;\n output {kind};\n"
        f" keys {{\n 1 {value} linear linear 1 1 0;\n }}\n}}\n"
        for name, kind, value in [
            ("translateX", "linear", 1), ("translateY", "linear", 2), ("translateZ", "linear", 3),
            ("rotateX", "angular", 10), ("rotateY", "angular", 20), ("rotateZ", "angular", 30),
        ]
    )  # fmt: skip
    move = moved(maya, "a.anim", toml)
    assert [move.positions[m][0] for m in (1, 2, 3)] == [10**6, 2 * 10**6, 3 * 10**6]
    assert looks(move) == pytest.approx(rotated("XYZ", 10, 20, 30), abs=1e-4)
    bvh = """HIERARCHY
ROOT cam
{
  CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
}
MOTION
Frames: 1
Frame Time: 0.04
1 2 3 30 10 20
"""
    move = moved(bvh, "a.bvh", toml)
    assert [move.positions[m][0] for m in (1, 2, 3)] == [10_000, 20_000, 30_000]
    assert looks(move) == pytest.approx(rotated("YXZ", 10, 20, 30), abs=1e-4)


def test_a_boom_table_is_used():
    table = [round(2000 * k + 3 * k * k) for k in range(-60, 61)]
    toml = axes_toml("boom-swing-track", f"boom_table = {table}\n")
    rig, _ = drawn("boom-swing-track")
    joints = np.array([[30.5, 10, 5, 1, 2, 3], [-20.25, -10, 50, 1, 2, 3]])
    home = rig.forward(rig.home) * (1, 1, 1, 0, 0, 0)
    move = moved(chan([rig.forward(row) - home for row in joints]), "a.chan", toml)
    expected = [round(np.interp(boom, range(-60, 61), table)) for boom in joints[:, 0]]
    assert move.positions[1] == pytest.approx(expected, abs=1)
    axes = rig_axes.of_text(toml, "axes.toml")
    poses = rig_of(axes).poses(move.positions, 1)
    assert poses[:, 1] == pytest.approx([rig.forward(row)[2] - home[2] for row in joints], abs=0.01)


def test_swing_pan_keeps_the_heading():
    toml = (
        '[[axis]]\nname = "swing"\nmotor = 1\nsteps_per_unit = 10\nunit = "deg"\nhold = 20\n'
        '[[axis]]\nname = "pan"\nmotor = 2\nsteps_per_unit = 100\nunit = "deg"\n'
        '[camera]\ntype = "swing-pan"\n'
    )
    move = moved("1 0 0 0 1 50 2\n2 9 9 9 1 51 2\n", "a.chan", toml)
    assert move.positions == {1: [200, 200], 2: [3000, 3100]}
    assert "keeps the heading only" in " ".join(move.said)
    swung = toml.replace("hold = 20", 'in_file = "vfov"')
    move = moved("1 0 0 0 1 50 2 10\n2 9 9 9 1 51 2 11\n", "a.chan", swung)
    assert move.positions == {1: [100, 110], 2: [4000, 4000]}


SLIDER = """[[axis]]
name = "slide"
motor = 1
steps_per_unit = 80
unit = "mm"
limits = [0, 1450]

[[axis]]
name = "pan"
motor = 2
steps_per_unit = 225
unit = "deg"
zero = -90
invert = true

[[axis]]
name = "focus"
motor = 3
steps_per_unit = 1
unit = "deg"
in_file = "vfov"

[camera]
type = "X-Y-Z"
x = "slide"
"""
SHOT = "1 100 1500 20 0 10 0 7\n2 110 1500 20 0 11 0 8\n"


@pytest.fixture
def slider(shot):
    (shot / "axes.toml").write_text(SLIDER)
    return shot


def test_a_slider_with_pan_begins_where_the_file_does(slider):
    move = imported(slider, SHOT, "--camera", "origin=first", name="a.chan")
    assert move.positions == {1: [0, 800], 2: [-22500, -22725], 3: [7, 8]}


def test_a_slider_may_be_called_track():
    """It is z of an X-Y-Z rig, unless it is said to be another one."""
    toml = SLIDER.replace('"slide"', '"track"')
    move = moved("1 5 0 0 0 0 0 7\n", "a.chan", toml)
    assert move.positions[1] == [400]
    move = moved("1 0 0 5 0 0 0 7\n", "a.chan", toml.replace('x = "track"\n', ""))
    assert move.positions[1] == [400]


def test_every_command_and_the_page_take_poses(shot, capsys):
    (shot / "axes.toml").write_text(SLIDER + 'origin = "first"\nignore = ["tilt"]\n')
    (shot / "a.chan").write_text(SHOT.replace("20 0 11", "20 5 11"))
    asked = json.dumps({"name": "a.chan", "text": (shot / "a.chan").read_text(), "fps": 24})
    found = MoveWork(AxesText(shot / "axes.toml")).read_move(asked)
    assert found["positions"] == [[0, 800], [-22500, -22725], [7, 8]]
    assert (
        "tilt: left out, the rig has no such axis; in frame 2 it would be at 5 deg" in found["said"]
    )
    assert run(shot, "check", str(shot / "a.chan"), "--json") in (0, 1, 7)
    assert json.loads(capsys.readouterr().out)["motors"][0]["name"] == "slide"
    assert run(shot, "export", str(shot / "a.chan"), "--pose", "-o", str(shot / "b.chan")) == 0
    assert (shot / "b.chan").read_text().splitlines()[1].split()[:2] == ["2", "10.000000"]
    assert "left out, no part of the camera's pose: focus\n" in capsys.readouterr().err


COLUMNS = "0.1 0 0 5 7\n0.2 0 0 6 8\n"


def named(columns):
    return [word for text in columns.split() for word in ("--column", text)]


def test_columns_that_are_named_count_as_framestep_does(slider):
    options = [*named("x=1 y=2 z=3 pan=4 focus=5"), "--camera", "file_unit=m"]
    move = imported(slider, COLUMNS, *options, name="a.txt")
    assert move.positions[1] == [8000, 16000]
    assert move.positions[3] == [7, 8]


@pytest.mark.parametrize(
    ("columns", "said"),
    [
        ("x=9 y=2 z=3", "a.txt has no column '9' for x; it has column 1, column 2, column 3"),
        ("x=1 y=2", "a.txt has no column for z, name it too; it has column 1, column 2, co"),
        ("x=1 y=2 z=3 roll=rz", "a.txt has no column 'rz' for roll; it has column 1"),
    ],
)
def test_columns_that_are_not_there(columns, said, slider, not_imported):
    assert said in not_imported(COLUMNS, *named(columns), name="a.txt")


@pytest.mark.parametrize(
    ("row", "said"),
    [
        ("2 0 1300 0 0 0 0", "a.chan, frame 2: y at 1300 mm is out of the rig's reach, allowed: "
         "-1199.414 to 1199.414 mm"),
        ("2 -1600 0 0 0 0 0", "a.chan, frame 2: x at -1600 mm is out of the rig's reach, allowed: "
         "-1499.267 to 1499.267 mm"),
        ("2 9000 5000 0 0 0 0", "frame 2: y at 5000 mm is out of the rig's reach, allowed: -1199"),
        ("2 0 0 1e9 0 0 0", "frame 2, axis track: 1000000000 mm is step 1000000000000, which"),
        ("2 1e14 1e14 1e14 1e14 1e14 1e14", "frame 2"),
    ],
)  # fmt: skip
def test_the_first_frame_out_of_reach_is_named(row, said, shot, not_imported):
    toml = axes_toml("boom-swing-track").replace("120, -80, 60", "0, 0, 0")
    (shot / "axes.toml").write_text(toml)
    assert said in not_imported(f"1 0 0 0 0 0 0\n{row}\n3{row[1:]}\n", name="a.chan")


def test_an_axis_that_the_rig_does_not_have_is_named(shot):
    said = (
        "a.chan, frame 1: y would be at 1500 mm, and the rig has no such axis, allowed: "
        '0 ± 0.01 mm; ignore = ["y"] in [camera] leaves it out'
    )
    with pytest.raises(ToolError, match=f"^{re.escape(said)}$"):
        moved(SHOT, "a.chan", SLIDER)


@pytest.mark.parametrize(
    ("camera", "said"),
    [
        ("camera = 3\n", "expected a table [camera], found 3"),
        ("", '"type" is missing: one of boom-swing-track, swing-pan, Y-swing-track, X-Y-Z'),
        ('type = "dolly"', '"type": expected one of boom-swing-track, '),
        ('type = "X-Y-Z"\nlens = 1', 'no key "lens"; there are type, boom'),
        ('type = "X-Y-Z"\nx = "trolley"', "the name of an axis (slide, pan, focus), found"),
        ('type = "X-Y-Z"\nx = "focus"', "expected axis focus in a unit such as mm, found deg"),
        ('type = "X-Y-Z"\nx = "slide"\nz = "slide"', "another axis for each joint"),
        ('type = "X-Y-Z"\nboom = "slide"', '"boom" is no joint of X-Y-Z, which has x, y, z'),
        ('type = "X-Y-Z"\norigin = [1, 2]', 'expected three numbers [x, y, z], or "first"'),
        ('type = "X-Y-Z"\nboom_table = [1, 2]', '"boom_table": expected 121 whole numbers'),
        ('type = "X-Y-Z"\nnodal = [1e9, 0, 0]', "expected lengths below 2 km"),
        ('type = "swing-pan"', "swing-pan needs both axes, swing and pan"),
        ('type = "boom-swing-track"', "an arm that is longer than 0"),
        ('type = "X-Y-Z"\nup = "x"', '"up": expected one of y, z, found '),
        ('type = "X-Y-Z"\npan = ""\ntilt = "x y"', '"tilt": expected the name of an axis'),
    ],
)  # fmt: skip
def test_mistakes_in_the_camera_table(camera, said):
    axes = SLIDER[: SLIDER.index("[camera]")]
    text = f"{camera}{axes}" if "camera =" in camera else f"{axes}[camera]\n{camera}\n"
    with pytest.raises(ToolError, match=f"^axes.toml.*{re.escape(said)}"):
        moved(SHOT, "a.chan", text)


def test_the_pose_is_named_and_has_to_be_there(slider, capsys, not_imported):
    imported(slider, "1 0 0 0 0 0 0 7\n", name="a.chan")
    assert "tx, ty, tz, rz, rx, ry: the camera's pose, by [camera]\n" in capsys.readouterr().err
    without = "seconds,slide,pan,vfov\n0,1,2,3\n"
    imported(slider, without, "--fps", "24")
    assert capsys.readouterr().err == ""
    said = not_imported(without, "--fps", "24", "--camera", "up=z")
    assert "source has no camera's pose: expected columns such as x" in said


def pose_file(name):
    axes = rig_axes.of_text(axes_toml("X-Y-Z"), "axes.toml")
    move = Move(1, {}, {i: [40 * i, 90 * i, 7] for i in range(1, 7)})
    table = to_pose_table(move, axes.list, rig_of(axes), FORMATS[name].CAMERA)
    return FORMATS[name].write(table, None)


POSES = [*map(pose_file, ("chan", "csv", "flair", "ae", "aejson", "bvh", "anim", "gltf"))]


@settings(max_examples=300)
@given(
    st.sampled_from(POSES),
    st.sampled_from(sorted(RIGS)),
    st.sampled_from(
        ["", 'origin = "first"\n', 'up = "z"\n', 'order = "XYZ"\n', "heading = 1e14\n"]
    ),
    st.floats(0, 1),
    st.integers(0, 10),
    st.sampled_from(["", "-", "1e308", "1e15", "nan", "9" * 12, "\n", "\t", "x", "}", '"', "0"]),
)
def test_a_spoilt_pose_is_read_or_refused(text, kind, more, at, length, put):
    """Nothing comes out but the error that a command prints as a sentence."""
    begin = int(at * len(text))
    axes = rig_axes.of_text(axes_toml(kind, more), "axes.toml")
    with suppress(ToolError):
        spoilt = text[:begin] + put + text[begin + length :]
        recording = of_content(spoilt, "a.chan").read(spoilt, "a.chan")
        fps = 24.0 if recording.seconds else None
        to_move(recording, axes.list, "a.chan", fps, camera=rig_of(axes))


@pytest.mark.parametrize(
    ("option", "status", "said"),
    [
        ("up", 2, "--camera: expected KEY=VALUE with one of type, boom"),
        ("lens=3", 2, "--camera: expected KEY=VALUE with one of type, boom"),
        ("up=x", 1, "[camera]: \"up\": expected one of y, z, found 'x'"),
        ("origin=1,2", 1, '"origin": expected three numbers'),
    ],
)
def test_camera_options_that_are_wrong(option, status, said, slider, not_imported):
    assert said in not_imported(SHOT, "--camera", option, status=status, name="a.chan")


def test_a_pose_needs_the_camera_in_axes_toml(shot, refusal):
    (shot / "axes.toml").write_text(SLIDER[: SLIDER.index("[camera]")])
    (shot / "m.csv").write_text("frame,slide,pan,focus\n1,1,2,3\n")
    said = refusal("export", str(shot / "m.csv"), "--pose", "-o", str(shot / "x.chan"))
    assert "--pose needs [camera] in" in said
