"""Cameras in three-dimensional scenes: glTF and USD. The test makes each file itself."""

import base64
import json
import struct
import subprocess
import sys
import time
from contextlib import suppress

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from framestep_tools.axes.axes_file import Axis
from framestep_tools.errors import ToolError
from framestep_tools.move.move_conversion import to_move
from framestep_tools.move.move_file import read_move
from framestep_tools.move.move_formats import FORMATS, of_content, usd
from framestep_tools.text.text_file import decoded
from host_tests.tools.conftest import named_in_file, run

PARTS = ("x", "y", "z", "pan", "tilt", "roll")
HALF = np.sqrt(0.5)


def gltf(tracks, nodes=None, times=(0.0, 0.04, 0.08), uri=None):
    """Return a glTF scene. tracks: (node, path, interpolation, rows of numbers), each a sampler."""
    data, views, accessors, samplers, channels = b"", [], [], [], []

    def add(rows, kind):
        nonlocal data
        content = np.array(rows, "<f4").tobytes() if not isinstance(rows, bytes) else rows
        views.append({"buffer": 0, "byteOffset": len(data), "byteLength": len(content)})
        accessors.append(
            {"bufferView": len(views) - 1, "componentType": 5126, "count": len(rows), "type": kind}
        )
        data += content

    add(list(times), "SCALAR")
    for node, path, way, rows in tracks:
        add(rows, "VEC4" if path == "rotation" else "VEC3")
        samplers.append({"input": 0, "output": len(views) - 1, "interpolation": way})
        target = {"node": node, "path": path}
        channels.append({"sampler": len(samplers) - 1, "target": target})
    buffer = {"byteLength": len(data)}
    if uri != "":
        buffer["uri"] = uri or "data:;base64," + base64.b64encode(data).decode()
    scene = {
        "asset": {"version": "2.0"},
        "nodes": nodes or [{"camera": 0}],
        "cameras": [{"type": "perspective", "perspective": {"yfov": 0.6, "znear": 0.01}}],
        "animations": [{"channels": channels, "samplers": samplers}],
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [buffer],
    }
    return scene, data


def glb(scene, data):
    """Return the bytes of a binary glTF file."""
    text = json.dumps(scene).encode()
    text += b" " * (-len(text) % 4)
    data += bytes(-len(data) % 4)
    chunks = b"".join(
        struct.pack("<I4s", len(content), kind) + content
        for kind, content in ((b"JSON", text), (b"BIN\0", data))
    )
    return b"glTF" + struct.pack("<II", 2, 12 + len(chunks)) + chunks


MOVING = [(0, "translation", "LINEAR", [[0.5, 1, 2], [0.6, 1, 2], [0.7, 1, 2]])]
USDA = """#usda 1.0
(
    metersPerUnit = 0.01
    timeCodesPerSecond = 25
    upAxis = "Z"
)

def Xform "crane"
{
    double3 xformOp:translate = (0, 0, 100)
    uniform token[] xformOpOrder = ["xformOp:translate"]

    def Camera "shot"
    {
        double3 xformOp:translate.timeSamples = {
            1001: (50, 0, 0),
            1002: (60, 0, 0),
            1004: (80, 10, 0),
        }
        float3 xformOp:rotateXYZ = (90, 0, 90)
        uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateXYZ"]
    }
}
"""


def values(recording):
    """Return {name: values at the samples}."""
    return {channel.name: channel.curve.values for channel in recording.channels}


def read(scene, name="gltf"):
    return FORMATS[name].read(json.dumps(scene) if isinstance(scene, dict) else scene, "f")


def test_the_small_file_of_each_format(shot):
    axes = named_in_file("x", "pan").replace("[-5, 100]", "[0, 1000]")
    (shot / "axes.toml").write_text(axes)
    scene, data = gltf(MOVING)
    binary, data = gltf(MOVING, uri="")
    (shot / "a.gltf").write_text(json.dumps(scene))
    (shot / "a.glb").write_bytes(glb(binary, data))
    (shot / "beside.gltf").write_text(json.dumps(gltf(MOVING, uri="beside.bin")[0]))
    (shot / "beside.bin").write_bytes(data)
    (shot / "a.usda").write_text(USDA)
    usdc(shot / "a.usda", shot / "a.usdc")
    (shot / "b.usd").write_bytes((shot / "a.usdc").read_bytes())
    for name in ("a.gltf", "a.glb", "beside.gltf", "a.usda", "a.usdc", "b.usd"):
        out = shot / "move.csv"
        rate = ["--fps", "25"] if "gl" in name else []
        assert run(shot, "import", str(shot / name), "-o", str(out), *rate) == 0
        move = read_move(out)
        assert move.fps == 25
        assert move.start_frame == (1 if rate else 1001)
        # with a third sample between frames 1002 and 1004
        assert move.positions[1] == [5000, 6000, 7000, *([] if rate else [8000])]


def usdc(source, target):
    code = "import sys; from pxr import Sdf; Sdf.Layer.FindOrOpen(sys.argv[1]).Export(sys.argv[2])"
    subprocess.run([sys.executable, "-c", code, source, target], check=True)


def test_nodes_above_the_camera_move_it_as_well():
    turned = {"rotation": [0, HALF, 0, HALF], "children": [1], "translation": [1, 0, 0]}
    matrix = [0, 1, 0, 0, -1, 0, 0, 0, 0, 0, 1, 0, 0, 0, 5, 1]  # rolled to the left, 5 m back
    nodes = [turned, {"camera": 0, "matrix": matrix}]
    scene, _ = gltf([(0, "scale", "LINEAR", [[1, 1, 1], [2, 2, 2], [3, 3, 3]])], nodes)
    found = values(read(scene))
    assert found["x"] == pytest.approx([6, 11, 16])
    assert found["z"] == pytest.approx([0, 0, 0], abs=1e-6)
    assert found["pan"] == pytest.approx([90, 90, 90], abs=1e-4)
    assert found["roll"] == pytest.approx([-90, -90, -90], abs=1e-4)


@pytest.mark.parametrize(
    ("way", "rows", "pan", "x"),
    [
        ("LINEAR", [[0, 0, 0, 1], [0, HALF, 0, HALF]], 45, 0.5),
        ("STEP", [[0, 0, 0, 1], [0, HALF, 0, HALF]], 0, 0),
        (
            "CUBICSPLINE",
            [[0, 0, 0, 0], [0, 0, 0, 1], [0, 0, 0, 0], [0, 0, 0, 0], [0, HALF, 0, HALF],
             [0, 0, 0, 0]],
            45, 0.5,
        ),
    ],
)  # fmt: skip
def test_values_between_keys(way, rows, pan, x):
    each = 3 if way == "CUBICSPLINE" else 1
    places = [[0.0, 0, 0]] * (each // 2) + [[0.0, 0, 0]] + [[0.0, 0, 0]] * (2 * (each // 2))
    places += [[1.0, 0, 0]] + [[0.0, 0, 0]] * (each // 2)
    tracks = [(0, "rotation", way, rows), (0, "translation", way, places)]
    recording = read(gltf(tracks, times=(0.0, 2.0))[0])
    by_name = {channel.name: channel.curve for channel in recording.channels}
    assert by_name["pan"].at(1.0) == pytest.approx(pan, abs=0.01)
    assert by_name["x"].at(1.0) == pytest.approx(x, abs=1e-4)
    assert by_name["pan"].at(2.0) == pytest.approx(90, abs=1e-4)
    assert by_name["pan"].at(0.5) == pytest.approx(
        {"LINEAR": 22.5, "STEP": 0}.get(way, by_name["pan"].at(0.5)), abs=0.01
    )


def test_a_pan_goes_on_beyond_half_a_turn():
    turns = [[0, np.sin(np.radians(a / 2)), 0, np.cos(np.radians(a / 2))] for a in (170, 180, 190)]
    assert values(read(gltf([(0, "rotation", "LINEAR", turns)])[0]))["pan"] == pytest.approx(
        [170, 180, 190], abs=1e-4
    )


def test_numbers_of_other_sizes_are_read():
    scene, _ = gltf([(0, "rotation", "LINEAR", [[0, 0, 0, 1]] * 3)])
    shorts = np.array([[0, 0, 0, 32767], [0, 23170, 0, 23170], [0, 32767, 0, 0]], "<i2").tobytes()
    scene["buffers"].append({"uri": "data:;base64," + base64.b64encode(shorts).decode()})
    scene["bufferViews"][1] = {"buffer": 1, "byteLength": len(shorts)}
    scene["accessors"][1] |= {"componentType": 5122, "normalized": True}
    assert values(read(scene))["pan"] == pytest.approx([0, 90, 180], abs=0.01)


def test_a_usd_scene_with_z_up_in_centimetres():
    recording = read(USDA, "usd")
    found = values(recording)
    assert recording.fps == 25
    assert recording.channels[0].curve.places == [1001, 1002, 1003, 1004]
    assert found["x"] == pytest.approx([0.5, 0.6, 0.7, 0.8])
    assert found["y"] == pytest.approx([1, 1, 1, 1])
    assert found["z"] == pytest.approx([0, 0, -0.05, -0.1], abs=1e-9)
    assert found["pan"] == pytest.approx([90] * 4)
    assert found["tilt"] == pytest.approx([0] * 4, abs=1e-4)


@pytest.mark.parametrize(("name", "ending"), [("gltf", ".gltf"), ("usd", ".usda")])
def test_ten_thousand_frames_of_axes_with_the_names_of_a_pose(name, ending, shot, capsys):
    (shot / "axes.toml").write_text(named_in_file("x", "pan"))
    rows = "".join(f"{i},{i % 977},{i % 9000}\n" for i in range(-5, 10_000))
    (shot / "move.csv").write_text(f"# fps: 25\nframe,track,pan\n{rows}")
    out, back = shot / f"out{ending}", shot / "back.csv"
    assert run(shot, "export", str(shot / "move.csv"), "-o", str(out)) == 0
    assert "(deg)" not in out.read_text()
    begin = time.process_time()
    rate = ["--start", "-5", "--fps", "25"] if name == "gltf" else []
    assert run(shot, "import", str(out), "-o", str(back), *rate) == 0
    assert time.process_time() - begin < 3
    assert read_move(back) == read_move(shot / "move.csv")


def test_of_several_cameras_the_first_that_moves(capsys):
    nodes = [{"camera": 0, "name": "still"}, {"camera": 0, "name": "a"}, {"camera": 0}]
    rows = MOVING[0][3]
    tracks = [(1, "translation", "LINEAR", rows), (2, "translation", "LINEAR", rows[::-1])]
    recording = read(gltf(tracks, nodes)[0])
    assert values(recording)["x"] == pytest.approx([0.5, 0.6, 0.7])
    assert recording.said == ("f: of 2 animated cameras the first",)
    still = USDA.replace('def Xform "crane"', 'def Camera "still" {}\n\ndef Xform "crane"')
    assert values(read(still, "usd")) == values(read(USDA, "usd"))


def change(**changes):
    scene, _ = gltf(MOVING)
    for path, value in changes.items():
        at = scene
        *keys, last = (int(key) if key.isdecimal() else key for key in path.split("__"))
        for key in keys:
            at = at[key]
        at[last] = value
    return json.dumps(scene)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (change(nodes=[{}]), "expected a node with a camera, found none"),
        (change(nodes=[{}, {"camera": 0}]), "expected an animated camera, found none"),
        (change(animations=[]), "expected an animated camera, found none"),
        (change(accessors__0__count=99), "accessor 0 is outside its buffer"),
        (change(accessors__1__type="VEC2"), "expected accessor 1 with 3 numbers, not sparse"),
        (change(accessors__1__count=2), "an animation's translation has no values for its keys"),
        (change(accessors__0__componentType=1), "not a glTF scene that can be read (KeyError: 1)"),
        (change(bufferViews__0__byteOffset=20), "expected times that increase and numbers for"),
        (change(buffers__0__uri="no.bin"), "its data are in 'no.bin', which is not beside it"),
        (change(buffers__0__uri="../f"), "its data are in '../f', which is not beside it: export"),
        (change(nodes=7), "not a glTF scene that can be read"),
        ('{"asset": {', "not a glTF scene that can be read (JSONDecodeError"),
        ("glTF\2\0\0\0\xff\0\0\0{}", "not a glTF scene that can be read"),
        (USDA.replace("Camera", "Cube"), "expected a Camera, found none"),
        (USDA.replace("timeSamples = {", "x = {"), "line 15: not a USD scene that can be read"),
        (USDA.replace(".timeSamples", "").replace("1001: ", ""), "not a USD scene"),
        (USDA.replace("= 25", "= 0"), "timeCodesPerSecond: expected frames per second from 0.001"),
        (USDA.replace("1001", "-1e300"), "expected at most 2000000 samples, found keys far apart"),
        (USDA.replace("(50, 0, 0)", "(50, 0, inf)"), "the camera's pose is not a number at some"),
        ("PXR-USDC" + "\1" * 200, "not a binary USD scene that can be read: it may be damaged"),
    ],
)  # fmt: skip
def test_a_mistake_is_a_sentence(text, said, shot, capfd):
    source = shot / "source"
    source.write_bytes(text.encode("latin-1"))
    assert run(shot, "import", str(source), "-o", str(shot / "o"), "--fps", "25") == 1
    error = capfd.readouterr().err
    assert said in error
    assert len(error.splitlines()) == 1
    assert not (shot / "o").exists()


@pytest.mark.parametrize(("library", "text"), [("pygltflib", change()), ("pxr", USDA)])
def test_without_the_library_a_sentence_says_what_to_install(
    library, text, monkeypatch, not_imported
):
    monkeypatch.setitem(sys.modules, library, None)
    package = {"pxr": "usd-core"}.get(library, library)
    said = f"needs {package}: pipx inject framestep {package}, or without pipx pip"
    assert said in not_imported(text)


BINARY = glb(*gltf(MOVING, uri=""))


@settings(max_examples=300)
@given(st.data())
def test_a_spoilt_scene_is_read_or_refused(data):
    """Nothing comes out but the error that a command prints as a sentence."""
    whole = data.draw(st.sampled_from([BINARY, change().encode(), USDA.encode()]))
    spoilt = bytearray(whole)
    for _ in range(data.draw(st.integers(1, 4))):
        at = data.draw(st.integers(0, len(spoilt) - 1))
        length = data.draw(st.integers(0, 4))
        spoilt[at : at + length] = data.draw(st.binary(max_size=4))
    axes = [Axis(name, i, 10.0, in_file=name) for i, name in enumerate(PARTS, 1)]
    with suppress(ToolError):
        text = decoded(bytes(spoilt), "f").text
        recording = of_content(text, "f").read(text, "f")
        to_move(recording, axes, "f", 24.0 if recording.seconds else None)


def test_a_damaged_binary_usd_file_cannot_hang_the_command(shot, monkeypatch):
    monkeypatch.setattr(usd, "_PATIENCE_S", 5)
    (shot / "a.usda").write_text(USDA)
    usdc(shot / "a.usda", shot / "a.usdc")
    whole = (shot / "a.usdc").read_bytes()
    random = np.random.default_rng(3)
    for _ in range(8):
        spoilt = bytearray(whole)
        for at in random.integers(8, len(whole), 20):
            spoilt[at] = random.integers(256)
        with suppress(ToolError):
            FORMATS["usd"].read(bytes(spoilt).decode("latin-1"), "f")
