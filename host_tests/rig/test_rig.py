"""What the rig file may say about pins, and the errors if it says something else."""

import pytest

from framestep.hal.host import BOARD
from framestep.rig import Rig, RigError, load
from framestep_tools.building.board_files import board_data


def test_the_simulated_board_is_a_pico():
    data = board_data("pico")
    assert {key: data[key] for key in BOARD} == BOARD


@pytest.mark.parametrize(
    ("settings", "text"),
    [
        ({"outputs": [{"pin": 2}]}, "outputs[1].pin: found 2, which is the board's step 1 already"),
        ({"inputs": [{"pin": 18}]}, "inputs[1].pin: found 18, which is the board's enable already"),
        ({"inputs": [{"pin": 0}]}, "inputs[1].pin: found 0, which is the board's DMX tx already"),
        ({"outputs": [{"pin": 22}, {"pin": 22}]},
         "outputs[2].pin: found 22, which is outputs[1].pin already"),
        ({"limits": [{"high": 22, "low": 22}]},
         "limits[1].low: found 22, which is limits[1].high already"),
        ({"limits": [{"high": 22}], "inputs": [{"pin": 22}]},
         "inputs[1].pin: found 22, which is limits[1].high"),
        ({"outputs": [{"pin": 30}]}, "outputs[1].pin: found 30, allowed is a pin from 0 to 29"),
        ({"outputs": [{}]}, "outputs[1].pin: is missing, expected is a whole number from 0 to 93"),
        ({"outputs": [{"pin": 22, "on": 1}]},
         'outputs[1].on: found 1, allowed is one of "high", "low"'),
        ({"outputs": None}, "outputs: found None, allowed is a list of at most 16 objects"),
        ({"virtuals": 7}, "virtuals: found 7, allowed is a sum of 4, 8, 16, 32 and 64"),
        ({"limits": [{"low": 22}, {}]},
         "limits[2]: found no switch; allowed is `high`, `low` or both, or `pin`"),
        ({"inputs": [{"pin": 22, "safe": "on"}]}, "inputs[1].safe: no such setting"),
        ({"estop": True}, "estop: found True"),
        ({"motors": [{"servo": {"pin": 19}}]},
         "motors[1].servo.pin: found 19, which is the board's estop already"),
        ({"motors": [{"servo": {"pin": 22}}, {"servo": {"pin": 22}}]},
         "motors[2].servo.pin: found 22, which is motors[1].servo.pin already"),
        ({"motors": [{"servo": {"pin": 22}}], "outputs": [{"pin": 22}]},
         "outputs[1].pin: found 22, which is motors[1].servo.pin already"),
        ({"motors": [{"servo": {"pin": 4}}]},
         "motors[1].servo.pin: found 4, which is the board's step 2 already"),
        ({"motors": [{"servo": {"low_us": 1500, "high_us": 1400}}]},
         "motors[1].servo.high_us: found 1400, allowed is 100 µs more than low_us at least"),
        ({"motors": [{"servo": {"low": 0, "high": 99}}]},
         "motors[1].servo.high: found 99, allowed is 100 steps more than `low` at least"),
        ({"motors": [{"servo": {"low": 0}, "backlash": 20}]},
         "motors[1].servo.low: found 0, allowed is -20 at most, for the backlash"),
        ({"motors": [{"servo": {}, "driver": {"run_ma": 500}}]},
         "motors[1].servo: found an object, but the motor has `driver`"),
        ({"motors": [{"servo": {}, "home": {"limit": 1, "travel": 10}}]},
         "motors[1].servo: found an object, but the motor has `home`"),
        ({"motors": [{}, {"servo": {}, "enable_ms": 200}]},
         "motors[2].enable_ms: found 200, allowed is 0, as the motor is a servo"),
        ({"motors": [{"servo": {}, "off_after_s": 5}]},
         "motors[1].off_after_s: found 5, allowed is 0, as the motor is a servo"),
        ({"home_input": 1}, "home_input: found 1, but no motor has `home`"),
        ({"home_input": 5, "motors": [{}]}, "home_input: found 5, but there are 2 inputs"),
        ({"motors": [{}, {"home": {"limit": 1, "travel": 1000}}]},
         "motors[2].home.limit: found 1, but there are 0 limit switch sets"),
        ({"limits": [{"high": 22}], "motors": [{"home": {"limit": 1, "travel": 1000}}]},
         "motors[1].home.limit: found 1, but limits[1].low has no pin"),
        ({"motors": [{"type": "a4989"}]},
         'motors[1].type: found \'a4989\', allowed is one of "other", "a4988", "drv8825"'),
        ({"motors": [{"type": "a4988", "servo": {}}]},
         'motors[1].type: found "a4988", but the motor is a servo'),
        ({"limits": [{"low": 22}], "motors": [{"home": {"limit": 1, "travel": 1000, "square": 5}}]},
         "motors[1].home.square: found 5, but square_within is 0"),
        (
            {
                "limits": [{"low": 22}],
                "motors": [{"home": {"limit": 1, "travel": 1000, "square_within": 50}}, {}],
            },
            "motors[1].home.square_within: found 50, but motors[2] has no `home`",
        ),
        (
            {
                "limits": [{"low": 22}],
                "motors": [
                    {"home": {"limit": 1, "travel": 1000, "square_within": 50}},
                    {"home": {"limit": 1, "travel": 1000}},
                ],
            },
            "motors[1].home.square_within: found 50, but the two sides do not have a home switch "
            "with an input of its own each",
        ),
        (
            {
                "limits": [{"low": 22}, {"low": 26}],
                "motors": [
                    {"home": {"limit": 1, "travel": 1000, "square_within": 50, "square": -195}},
                    {"home": {"limit": 2, "travel": 1000}},
                ],
            },
            "motors[1].home.square: found -195, allowed is -191 at least",
        ),
        ({"pendant": {"a": 2, "b": 26, "enable": 27}},
         "pendant.a: found 2, which is the board's step 1 already; allowed is a free pin"),
        ({"pendant": {"a": 22, "b": 22, "enable": 27}},
         "pendant.b: found 22, which is pendant.a already; allowed is a free pin"),
        ({"pendant": {"a": 22, "b": 26}},
         "pendant.enable: is missing, expected is a whole number from 0 to 47"),
        ({"pendant": {"a": 22, "b": 26, "enable": 27, "click": 0}},
         "pendant.click: found 0, allowed is a whole number from 1 to 10000 steps"),
        ({"shoot_input": 3}, "shoot_input: found 3, but there are 2 inputs"),
        ({"shoot_input": 1, "go_input": 1},
         "shoot_input: found 1, which is go_input already; allowed is another input"),
        ({"go_input": 2, "home_input": 2},
         "home_input: found 2, which is go_input already; allowed is another input"),
        ({"shoot_input": 1, "home_input": 1},
         "home_input: found 1, which is shoot_input already; allowed is another input"),
        ({"shutter_delay_ms": 5001},
         "shutter_delay_ms: found 5001, allowed is a whole number from 0 to 5000 ms"),
        (
            {"limits": [{"pin": 22, "ends": "both", "high": 26}]},
            "limits[1].pin: found 22, but `high` and `low` are for switches with inputs of their "
            "own; allowed is one or the other",
        ),
        ({"limits": [{"low": 22, "ends": "both"}]},
         'limits[1].ends: found "both", but there is no `pin`'),
        ({"limits": [{"pin": 22, "ends": "all"}]},
         "limits[1].ends: found 'all', allowed is one of \"both\""),
        ({"limits": [{"pin": 2}]},
         "limits[1].pin: found 2, which is the board's step 1 already; allowed is a free pin"),
        ({"limits": [{"low": 22}], "motors": [{"home": {"limit": 1}}]},
         "motors[1].home.travel: is missing, expected is a whole number from 1 to 100000000"),
        ({"limits": [{"low": 22}], "motors": [{"home": {"limit": 1, "travel": 1000, "speed": 99}}]},
         "motors[1].home.slow_speed: found 100, allowed is at most the speed, 99"),
        ({"limits": [{"low": 22}], "motors": [{"home": {"limit": 1, "travel": 199}}]},
         "motors[1].home.back_off: found 200, allowed is at most the travel, 199"),
        (
            {
                "limits": [{"low": 22}],
                "motors": [{"home": {"limit": 1, "travel": 999, "speed": 2000, "back_off": 29}}],
            },
            "motors[1].home.back_off: found 29, allowed is 30 at least: "
            "at its speed the motor runs on that far",
        ),
        (
            {
                "hard_stop_factor": 1,
                "limits": [{"low": 22}],
                # at power-up a motor has 5000 steps/s at most
                "motors": [{"home": {"limit": 1, "travel": 999, "speed": 9000}}],
            },
            "motors[1].home.back_off: found 200, allowed is 636 at least",
        ),
        ({"limits": [{"low": 22}], "motors": [{"home": {"limit": 1, "travel": 1000, "stall": 9}}]},
         'motors[1].home.stall: found 9, allowed is 0 without a `driver` in mode "stealth"'),
        ({"dmx_break_us": 91},
         "dmx_break_us: found 91, allowed is a whole number from 92 to 1000 µs"),
        ({"uart_baud": 460800}, "uart_baud: found 460800, but this board's port is USB"),
    ],
)  # fmt: skip
def test_mistakes(settings, text):
    with pytest.raises(RigError) as error:
        Rig(settings, BOARD)
    assert text in str(error.value)


def test_an_esp32_has_no_pendant():
    with pytest.raises(RigError, match="pendant: found an object, but this chip is too slow"):
        Rig({"pendant": {"a": 34, "b": 35, "enable": 32}}, board_data("esp32_595"))


def test_steps_on_both_edges_are_for_engines_and_drivers_that_can_make_them():
    motor = {"driver": {"run_ma": 500, "both_edges": True}}
    with pytest.raises(RigError, match=r"motors\[1\].driver.both_edges: .* this board makes only"):
        Rig({"motors": [motor]}, board_data("esp32_595"))
    with pytest.raises(RigError, match=r"motors\[1\].type: found \"a4988\", but `driver` sets up"):
        Rig({"motors": [{"type": "a4988", **motor}]}, board_data("skr_pico"))
    with pytest.raises(RigError, match=r"motors\[1\].both_edges: no such setting"):
        Rig({"motors": [{"both_edges": True}]}, board_data("skr_pico"))
    assert Rig({"motors": [motor]}, board_data("skr_pico")).motor(0)["driver"]["both_edges"]


def test_a_type_of_driver_sets_what_is_not_given():
    rig = Rig(
        {
            "motors": [
                {"type": "tb6600", "hold_us": 2},
                {"type": "tmc2209"},
                {"type": "dm542", "pulse_us": 2.0},
                {},
            ]
        },
        BOARD,
    )
    keys = ("pulse_us", "setup_us", "hold_us", "enable_ms", "enable_high")
    assert [tuple(rig.motor(i)[key] for key in keys) for i in range(4)] == [
        (30.0, 15.0, 2, 1, False),
        (1.0, 5.0, 0.02, 0, False),
        (2.0, 5.0, 5.0, 200, False),
        (1.0, 5.0, 0.0, 0, False),
    ]


def test_a_board_without_estop_pin():
    with pytest.raises(RigError, match="no E-stop pin"):
        Rig({"estop": "nc"}, {"gio": []})


def test_limits_take_pins_from_the_defaults():
    rig = Rig({"limits": [{"high": 26, "low": 27}]}, BOARD)
    assert [o["pin"] for o in rig.outputs] == [22]
    assert [i["pin"] for i in rig.inputs] == [28]


SKR_PICO = board_data("skr_pico")


@pytest.mark.parametrize(
    ("settings", "text"),
    [
        ({"motor_count": 5}, "motor_count: found 5, this board has 4 motors"),
        ({"motors": [{"type": "a4988", "driver": {"run_ma": 500}}]},
         'motors[1].type: found "a4988", but `driver` sets up a TMC2209'),
        ({"motors": [{}] * 5}, "motors: found 5, allowed is a list of at most 4 here"),
        ({"motor_count": 1, "motors": [{}, {}]},
         "motors: found 2, allowed is a list of at most 1 here"),
        ({"outputs": [{"pin": 4}]},
         "outputs[1].pin: found 4, which is wired as an input on this board"),
        ({"inputs": [{"pin": 23}]},
         "inputs[1].pin: found 23, which is wired as an output on this board"),
        ({"limits": [{"low": 20}]},
         "limits[1].low: found 20, which is wired as an output on this board"),
        ({"inputs": [{"pin": 27}]}, "inputs[1].pin: found 27, which is the board's jumper already"),
        ({"inputs": [{"pin": 12}]},
         "inputs[1].pin: found 12, which is the board's enable 1 already"),
    ],
)  # fmt: skip
def test_mistakes_on_a_board_with_sockets(settings, text):
    with pytest.raises(RigError) as error:
        Rig(settings, SKR_PICO)
    assert text in str(error.value)


def test_outputs_and_inputs_of_a_board_with_sockets():
    rig = Rig({}, SKR_PICO)
    assert [o["pin"] for o in rig.outputs] == [20, 21, 23]
    assert [i["pin"] for i in rig.inputs] == [22]
    rig = Rig(
        {"limits": [{"low": 4, "high": 3}], "outputs": [{"pin": 29}], "inputs": [{"pin": 25}]},
        SKR_PICO,
    )
    assert rig.limits[0]["low"] == 4
    assert rig.outputs[0]["pin"] == 29
    assert rig.inputs[0]["pin"] == 25


REGISTERS = board_data("pico2_595")


@pytest.mark.parametrize(
    ("settings", "text"),
    [
        ({"motors": [{}, {"servo": {}}]},
         "motors[2].servo: found an object, but shift registers make only steps"),
        ({"motors": [{"driver": {"run_ma": 500, "both_edges": True}}]},
         "motors[1].driver.both_edges: found true, allowed is false"),
        ({"motor_count": 17}, "motor_count: found 17, this board has 16 motors"),
        ({"motors": [{}] * 17}, "motors: found 17, allowed is a list of at most 16 here"),
        ({"outputs": [{"pin": 64}]}, "outputs[1].pin: found 64, allowed is a pin from 0 to 29"),
        ({"inputs": [{"pin": 4}]},
         "inputs[1].pin: found 4, which is the board's shift registers' latch already"),
    ],
)  # fmt: skip
def test_mistakes_on_a_board_with_shift_registers(settings, text):
    with pytest.raises(RigError) as error:
        Rig(settings, REGISTERS)
    assert text in str(error.value)


def test_sixteen_motors_and_their_limits():
    limits = [{"pin": pin} for pin in (6, 7, *range(10, 18))]
    rig = Rig({"motors": [{}] * 16, "limits": limits}, REGISTERS)
    assert rig.board["motors"] == 16
    assert [limit["high"] for limit in rig.limits] == [6, 7, *range(10, 18)]
    assert Rig({"motor_count": 3}, REGISTERS).board["step"] == [64, 66, 68]


def test_fewer_motors_leave_pins_for_other_things():
    rig = Rig({"motor_count": 7, "outputs": [{"pin": 16}], "inputs": [{"pin": 17}]}, BOARD)
    assert rig.board["step"] == BOARD["step"][:7]
    assert rig.board["motors"] == 7
    assert rig.outputs[0]["pin"] == 16
    rig = Rig({"motor_count": 2, "inputs": [{"pin": 14}]}, SKR_PICO)
    assert rig.board["enable"] == [12, 7]


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("dmx", True),
        ("dmx_ramp_ms", 5),
        ("shutter_on", "low"),
        ("shutter_hold_ms", 9),
        ("meter_on", "low"),
    ],
)
def test_settings_of_pins_that_motors_have(key, value):
    board = board_data("pico2")
    with pytest.raises(RigError, match=f"{key}: found .*, but this board has no pin for it"):
        Rig({key: value}, board)
    Rig({key: value, "motor_count": 8}, board)


def test_dmx_frees_its_pins():
    rig = Rig({"dmx": False, "inputs": [{"pin": 0}, {"pin": 1}]}, BOARD)
    assert [i["pin"] for i in rig.inputs] == [0, 1]


def test_a_file_with_a_mistake_leaves_the_defaults_of_the_board(tmp_path):
    path = tmp_path / "rig.json"
    path.write_text('{"outputs": [{"pin": 99}]}')
    rig, mistake = load(str(path), BOARD)
    assert "outputs[1].pin: found 99" in mistake
    assert [o["pin"] for o in rig.outputs] == [22, 26]


def test_a_servo_frees_its_motors_pins():
    rig = Rig({"motors": [{}, {"servo": {"pin": 22}}], "outputs": [{"pin": 4}, {"pin": 5}]}, BOARD)
    assert rig.servos == 2
    assert (rig.board["step"][:3], rig.board["dir"][:3]) == ([2, 22, 6], [3, 22, 7])
    assert [item["pin"] for item in rig.inputs] == [27, 28]
    assert BOARD["step"][1] == 4
    own = Rig({"motors": [{"servo": {}}]}, BOARD)
    assert (own.board["step"][0], own.board["dir"][0]) == (2, 2)


@pytest.mark.parametrize(
    ("board", "own", "others"),
    [("pico", 200, (125, 150)), ("pico2", 150, ()), ("skr_pico", 125, (150, 200))],
)
def test_clock(board, own, others):
    """A board has a clock of its own, and its chip may run at others."""
    data = board_data(board)
    assert Rig({}, data).board["clock_mhz"] == own
    for mhz in (own, *others):
        assert Rig({"clock_mhz": mhz}, data).board["clock_mhz"] == mhz


def test_clocks_that_a_chip_has_not():
    with pytest.raises(RigError, match=r"clock_mhz: found 200, allowed is one of 0, 150 here"):
        Rig({"clock_mhz": 200}, board_data("pico2"))
    with pytest.raises(RigError, match="clock_mhz: found 133, allowed is one of 0, 125, 150, 160"):
        Rig({"clock_mhz": 133}, board_data("pico"))
    with pytest.raises(RigError, match=r"clock_mhz: found 125, allowed is one of 0 here"):
        Rig({"clock_mhz": 125})
    for board in ("esp32_595", "esp32_s3_595"):
        assert Rig({"clock_mhz": 160}, board_data(board)).board["clock_mhz"] == 160
