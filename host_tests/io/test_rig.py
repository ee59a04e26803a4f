"""What the rig file may say about pins, and what it is told when it says something else."""

import json

import pytest

from framestep.hal.host import BOARD
from framestep.rig import Rig, RigError, load
from framestep_tools.files import ROOT


def test_the_simulated_board_is_a_pico():
    data = json.loads((ROOT / "boards/pico/board.json").read_text())
    assert {key: data[key] for key in BOARD} == BOARD


@pytest.mark.parametrize(
    ("settings", "text"),
    [
        ({"outputs": [{"pin": 2}]}, "outputs[1].pin: found 2, which is the board's step 1 already"),
        ({"inputs": [{"pin": 18}]}, "inputs[1].pin: found 18, which is the board's enable already"),
        ({"inputs": [{"pin": 0}]}, "inputs[1].pin: found 0, which is the board's DMX tx already"),
        ({"outputs": [{"pin": 22}, {"pin": 22}]}, "outputs[2].pin: found 22, which is outputs[1].pin already"),
        ({"limits": [{"high": 22, "low": 22}]}, "limits[1].low: found 22, which is limits[1].high already"),
        ({"limits": [{"high": 22}], "inputs": [{"pin": 22}]}, "inputs[1].pin: found 22, which is limits[1].high"),
        ({"outputs": [{"pin": 30}]}, "outputs[1].pin: found 30, allowed is a pin from 0 to 29"),
        ({"outputs": [{}]}, "outputs[1].pin: is missing, expected is a whole number from 0 to 47"),
        ({"outputs": [{"pin": 22, "on": 1}]}, 'outputs[1].on: found 1, allowed is one of "high", "low"'),
        ({"outputs": None}, "outputs: found None, allowed is a list of at most 16 objects"),
        ({"inputs": [{"pin": 22, "safe": "on"}]}, "inputs[1].safe: no such setting"),
        ({"estop": True}, "estop: found True"),
        ({"dmx_break_us": 91}, "dmx_break_us: found 91, allowed is a whole number from 92 to 1000 µs"),
    ],
)
def test_mistakes(settings, text):
    with pytest.raises(RigError) as error:
        Rig(settings, BOARD)
    assert text in str(error.value)


def test_a_board_without_estop_pin():
    with pytest.raises(RigError, match="no E-stop pin"):
        Rig({"estop": "nc"}, {"gio": []})


def test_limits_take_pins_from_the_defaults():
    rig = Rig({"limits": [{"high": 26, "low": 27}]}, BOARD)
    assert [o["pin"] for o in rig.outputs] == [22]
    assert [i["pin"] for i in rig.inputs] == [28]


def test_dmx_frees_its_pins():
    rig = Rig({"dmx": False, "inputs": [{"pin": 0}, {"pin": 1}]}, BOARD)
    assert [i["pin"] for i in rig.inputs] == [0, 1]


def test_a_file_with_a_mistake_leaves_the_defaults_of_the_board(tmp_path):
    path = tmp_path / "rig.json"
    path.write_text('{"outputs": [{"pin": 99}]}')
    rig, mistake = load(str(path), BOARD)
    assert "outputs[1].pin: found 99" in mistake
    assert [o["pin"] for o in rig.outputs] == [22, 26]
