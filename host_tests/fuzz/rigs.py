"""Random rigs and boards."""

import json
import re
from random import Random

from framestep.rig import Rig, RigError
from framestep.rig.homes import least_back_off
from framestep_tools.building.board_files import board_data, image_boards
from host_tests.script import Script

from .chip_player import CHIPS


def draw_rig(dice: Random, board: str) -> dict:
    """Return what a rig file for this board may contain."""
    data = board_data(board)
    some = dice.random
    rig: dict = {}
    if some() < 0.85:
        rig["motor_count"] = min(data["motors"], dice.choice((1, 2, 2, 3, 3, 4, 6, data["motors"])))
    count = rig.get("motor_count", data["motors"])
    motors = []
    for _ in range(count):
        motor: dict = {}
        if some() < 0.3:
            motor["invert"] = True
        if some() < 0.2:
            motor["pulse_us"] = dice.choice((0.25, 2.0, 4.0, 30.0, 50.0))
        if some() < 0.2:
            motor["setup_us"] = dice.choice((0, 1, 50, 200))
        if some() < 0.1:
            motor["enable_ms"] = dice.choice((1, 50, 500, 2000))
        if some() < 0.1:
            motor["hold_us"] = dice.choice((1, 50))
        if some() < 0.2:
            motor["backlash"] = dice.choice((1, 2, 24, 200, 1000, dice.randint(1, 10000)))
        if some() < 0.3:
            motor["jerk"] = dice.choice((1, 20, 100, 500, 2000, 30000, 1000000))
        if some() < 0.1:
            motor["enable_high"] = True
        motors.append(motor)
    if some() < 0.8:
        rig["motors"] = motors
    for name, chance, values in (
        ("hard_stop_factor", 0.4, (1, 2, 8, 16)),
        ("jog_timeout_ms", 0.5, (0, 20, 100, 2000)),
        ("report_ms", 0.4, (20, 33, 250, 1000)),
        ("dialect", 0.4, ("dmc-lite",)),
        ("virtuals", 0.5, (0, 8, 60, 64, 124)),
        ("dmx_ramp_ms", 0.3, (0, 20, 60000)),
        ("shutter_on", 0.2, ("low",)),
        ("meter_on", 0.2, ("low",)),
        ("dmx", 0.2, (False,)),
        ("watchdog", 0.2, (False,)),
        ("remember_positions", 0.25, (True,)),
        ("estop_cuts_power", 0.2, (True,)),
        ("strict_moves", 0.3, (True,)),
        ("go_input", 0.15, (1, 2)),
        ("smoothing", 0.4, (False,)),
    ):
        if some() < chance:
            rig[name] = dice.choice(values)
    if "estop" in data and some() < 0.5:
        rig["estop"] = dice.choice(("nc", "no"))
    if "chain" in data:
        pins, outputs = list(data["inputs"]), data["outputs"]
    else:
        pins = outputs = data.get("stops", []) + [22, 26, 27, 28]
    if some() < 0.4:
        dice.shuffle(pins)
        sets = []
        while len(pins) >= 2 and len(sets) < dice.randint(1, 2):
            sets.append(
                {
                    "high": pins.pop(),
                    "low": pins.pop() if some() < 0.8 else -1,
                    "contact": dice.choice(("nc", "no")),
                }
            )
        if sets:
            rig["limits"] = sets
            for motor in motors:
                if some() < 0.5:
                    motor["home"] = draw_home(dice, sets, rig.get("hard_stop_factor", 4))
    if some() < 0.15:
        rig["outputs"] = [
            {
                "pin": pin,
                "safe": dice.choice(("off", "on", "hold")),
                "on": dice.choice(("high", "low")),
            }
            for pin in outputs[:2]
        ]
    while True:
        try:
            Rig(rig, data)
            return rig
        except RigError as error:
            del rig[re.split(r"\W", str(error))[0]]  # a mistake begins with its key


def draw_home(dice: Random, sets: list, hard_stop_factor: int) -> dict:
    """Return how a motor homes at one of these sets of limit switches."""
    number = dice.randrange(len(sets))
    back_off = dice.choice((1, 20, 200, 1000))
    slow = dice.choice((10, 100, 1000))
    speed = slow * dice.choice((1, 5, 20))
    back_off = max(back_off, least_back_off(speed, hard_stop_factor))
    return {
        "limit": number + 1,
        "toward": "high" if sets[number]["low"] < 0 else dice.choice(("low", "high")),
        "position": dice.choice((0, 0, -200, 5000, -(10**9), 10**9)),
        "speed": speed,
        "slow_speed": slow,
        "back_off": back_off,
        "travel": back_off * dice.choice((1, 3, 20)),
        "order": dice.choice((0, 0, 1, 2)),
    }


def draw_script(dice: Random, target: str = "host") -> Script:
    """Return a script with a rig for a target's board. On the host it is any board with an image,
    which sometimes lacks something."""
    if target != "host":
        board = CHIPS[target].board
        script = Script(board, draw_rig(dice, board))
        script.target = target
        return script
    board = dice.choice((*image_boards(), "pico", "pico"))
    script = Script(board, draw_rig(dice, board))
    if dice.random() < 0.02:
        text = json.dumps(script.rig)
        script.rig, script.rig_text = None, text[: dice.randrange(1, max(2, len(text) - 1))]
    if dice.random() < 0.08:
        script.memory = dice.choice((0, 16, 200, 1000, 4096, 12000))
    if script.rig and script.rig.get("remember_positions"):
        if dice.random() < 0.15:
            script.flash = None
        else:
            for block in (0, 1):
                if dice.random() < 0.3:
                    script.flash[block] = dice.randbytes(dice.choice((1, 100, 128, 1024)))
    return script
