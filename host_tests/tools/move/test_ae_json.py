"""After Effects' camera, as scripts export it to JSON."""

import copy
import json
import re

import pytest

from framestep_tools.axes.axes_file import Axis
from framestep_tools.errors import ToolError
from framestep_tools.move.move_conversion import to_move
from framestep_tools.move.move_formats import FORMATS, of_content


def calculated(values, first=0, each=1):
    return {
        "isKeyframed": True, "keyframesFormat": "calculated", "startFrame": first,
        "supersampling": each, "keyframes": values,
    }  # fmt: skip


def fixed(value):
    return {"isKeyframed": False, "value": value}


def key(time, value, speed=0.0, influence=100.0 / 3, way="bezier"):
    ease = {"speed": speed, "influence": influence}
    return {
        "time": time, "value": value, "easeIn": ease, "easeOut": ease,
        "interpolationIn": way, "interpolationOut": way,
    }  # fmt: skip


def eased(*keys):
    return {"isKeyframed": True, "keyframesFormat": "bezier", "keyframes": list(keys)}


KEYED = {
    "comp": {"width": 1920, "height": 1080, "frameRate": 25},
    "layers": [
        {"type": "av", "name": "text", "position": {"channels": []}},
        {
            "type": "camera",
            "name": "Camera 1",
            "parentIndex": None,
            "position": {
                "numDimensions": 3,
                "channels": [calculated([0.5, 0.6, 0.7]), fixed(540), fixed(-1866)],
            },
            "rotationY": {"numDimensions": 1, "channels": [eased(key(0, 2), key(0.08, 3))]},
            "zoom": {"numDimensions": 1, "channels": [fixed(1866)]},
        },
    ],
    "transformsBaked": False,
    "version": 3,
}
BAKED = {
    "comp": {"frameRate": 25},
    "layers": [
        {
            "type": "camera",
            "transform": {
                "startFrame": 3,
                "supersampling": 1,
                # turned to the right, 10 right, 20 down, 30 ahead
                "keyframes": [[0, 0, 1, 10, 0, 1, 0, 20, -1, 0, 0, 30]] * 2,
            },
        }
    ],
    "transformsBaked": True,
    "version": 3,
}
KEYS = {
    "fps": 25,
    "camera": {
        "positionKeyframes": [{"time": i / 25, "value": [0.5 + i / 10, 1, 2]} for i in range(3)],
        "rotationKeyframes": [],
    },
}


def read(content):
    return FORMATS["aejson"].read(json.dumps(content), "f")


def steps(content, *names):
    """Return the move of axes with these names in the file."""
    axes = []
    for motor, name in enumerate(names, 1):
        unit = "deg" if "otation" in name or name == "pan" else "units"
        axes.append(Axis(f"axis {motor}", motor, 10.0, unit, name, file_unit=unit))
    return to_move(read(content), axes, "f")[0]


def test_the_small_file_of_each_script():
    move = steps(KEYED, "Position X", "Y Rotation", "Position Y")
    assert (move.start_frame, move.fps) == (0, 25)
    assert move.positions == {1: [5, 6, 7], 2: [20, 25, 30], 3: [5400] * 3}
    move = steps(BAKED, "x", "y", "z", "pan")
    assert (move.start_frame, move.fps) == (3, 25)
    assert move.positions == {1: [100] * 2, 2: [-200] * 2, 3: [-300] * 2, 4: [-900] * 2}
    move = steps(KEYS, "Position X", "Position Z")
    assert move.positions == {1: [5, 6, 7], 2: [20] * 3}
    for content in (KEYED, BAKED, KEYS):
        assert of_content(json.dumps(content), "f").NAME == "aejson"


def turning(*keys):
    content = change(KEYED, *CAMERA, "rotationY", "channels", [eased(*keys)])
    return steps(content, "Y Rotation").positions[1]


def test_eases_are_handles_of_a_curve():
    second = 1.0
    # no speed at either end, a third of the time: 3 t^2 - 2 t^3
    found = turning(key(0, 0), key(second, 100))
    assert found[5] == round(1000 * (3 * 0.2**2 - 2 * 0.2**3))
    assert found[-1] == 1000
    # as fast as the straight line
    assert turning(key(0, 0, 100), key(second, 100, 100))[5] == 200
    assert turning(key(0, 0, way="linear"), key(second, 100, way="linear"))[5] == 200
    assert turning(key(0, 0, way="hold"), key(second, 100))[24:] == [0, 1000]
    # all speed is at the beginning: influence 100 % there with speed, none at the end
    fast = turning(key(0, 0, 300, 100 / 3), key(second, 100, 0, 100 / 3))
    assert fast[5] == round(1000 * (3 * 0.2 * 0.64 + 3 * 0.04 * 0.8 + 0.008))


def test_values_between_frames():
    doubled = calculated([0, 1, 2, 3, 4], 1, 2)
    content = change(KEYED, *CAMERA, "position", "channels", 0, doubled)
    assert steps(content, "Position X").positions[1] == [0, 20, 40]


def change(content, *path_and_value):
    *path, last, value = path_and_value
    at = content = copy.deepcopy(content)
    for each in path:
        at = at[each]
    at[last] = value
    return content


CAMERA = ("layers", 1)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ([], "JSON: expected an object, found"),
        (change(KEYED, "comp", "frameRate", 0), "frameRate: expected frames per second from 0.001"),
        (change(KEYED, "comp", "frameRate", True), "frameRate: expected a number, found 'true'"),
        (change(KEYED, "layers", 7), "layers: expected a list, found '7'"),
        (change(KEYED, "layers", []), "expected a camera among the layers, found none"),
        (change(KEYED, *CAMERA, "parentIndex", 3), "the camera hangs on another layer: export"),
        (change(KEYED, *CAMERA, "zoom", 3), "layers[1].zoom: expected an object, found '3'"),
        (change(KEYED, *CAMERA, "zoom", "channels", []), "zoom.channels: expected 1 or 3 channels"),
        (change(KEYED, *CAMERA, "zoom", "channels", 0, "value", float("nan")),
         "layers[1].zoom.channels[0].value: expected a number, found 'NaN'"),
        (change(KEYED, *CAMERA, "rotationY", "channels", 0, "keyframes", 1, "time", 0),
         "rotationY.channels[0].keyframes[1].time: expected a time after the one before"),
        (change(KEYED, *CAMERA, "rotationY", "channels", 0, "keyframes", 1, "easeIn", {}),
         "rotationY.channels[0].keyframes[0].easeIn.influence: expected a number, found 'null'"),
        (change(KEYED, *CAMERA, "rotationY", "channels", 0, "keyframesFormat", "x"),
         "expected bezier or calculated"),
        (change(KEYED, *CAMERA, "position", "channels", 0, "supersampling", 0),
         "supersampling: expected 1 to 1000, found '0.0'"),
        (change(BAKED, "layers", 0, "transform", "keyframes", [[1]]), "expected 12 numbers, found"),
        (change(BAKED, "layers", 0, "transform", "keyframes", [[0] * 12]), "matrices that turn"),
        (change(KEYS, "camera", "positionKeyframes", []), "positionKeyframes: expected keyframes"),
        (change(KEYS, "camera", "positionKeyframes", 0, "value", [1]), "expected three numbers"),
    ],
)  # fmt: skip
def test_a_mistake_is_a_sentence(content, said):
    with pytest.raises(ToolError, match=rf"\A.*{re.escape(said)}.*\Z"):
        read(content)


def test_json_that_ends_early(not_imported):
    assert "a.json: not valid JSON: Expecting" in not_imported(
        json.dumps(KEYED)[:-1], name="a.json"
    )


def test_keyframes_far_apart_do_not_say_what_is_between_them():
    far = change(KEYS, "camera", "positionKeyframes", 2, "time", 9)
    with pytest.raises(ToolError, match="does not say how it goes on between the keyframes at 1"):
        steps(far, "Position X")
