"""The rig of `framestep console --demo`: a crane of eight axes, and its example move."""

import json
from typing import NamedTuple

from ..client.client import Client
from ..payloads import MotorResetPosition, MotorSetLimits, MotorSetSpeed

RIG = {"name": "crane", "motor_count": 8, "estop": "nc"}
FPS = 24
_FRAMES = (1, 72, 150, 240)
_TO_TOP_SPEED_S = 0.5


class _Axis(NamedTuple):
    name: str
    unit: str
    steps_per_unit: int
    limits: tuple[int, int]
    speed: int  # units per second
    keys: tuple[int, int, int, int]  # positions at the keyframes


_CRANE = (
    _Axis("track", "mm", 10, (0, 2000), 400, (100, 260, 1150, 1900)),
    _Axis("boom", "deg", 200, (-35, 45), 20, (-18, -18, 12, 30)),
    _Axis("swing", "deg", 100, (-90, 90), 40, (-26, -5, 40, 45)),
    _Axis("pan", "deg", 100, (-170, 170), 50, (-3, 20, -48, -56)),
    _Axis("tilt", "deg", 100, (-60, 40), 30, (12, 12, -6, -20)),
    _Axis("roll", "deg", 100, (-45, 45), 30, (0, 0, 0, 4)),
    _Axis("focus", "mm", 20, (0, 270), 250, (60, 75, 140, 210)),
    _Axis("zoom", "units", 50, (0, 100), 60, (0, 0, 35, 35)),
)


def axes_toml() -> str:
    """Return names and units of its motors."""
    return "\n".join(
        f'[[axis]]\nname = "{axis.name}"\nmotor = {motor}\nunit = "{axis.unit}"\n'
        f"steps_per_unit = {axis.steps_per_unit}\nlimits = {list(axis.limits)}\n"
        for motor, axis in enumerate(_CRANE, 1)
    )


def keyframes() -> str:
    """Return the example move, as the page's keyframes."""
    keys = [
        {"frame": frame, "steps": [axis.keys[i] * axis.steps_per_unit for axis in _CRANE]}
        for i, frame in enumerate(_FRAMES)
    ]
    return json.dumps({"framestep keyframes": 1, "fps": FPS, "keyframes": keys})


def set_up(client: Client) -> None:
    """Give the motors their positions, speeds and soft limits."""
    for motor, axis in enumerate(_CRANE, 1):
        steps = axis.steps_per_unit
        speed = axis.speed * steps
        low, high = axis.limits
        client.request(MotorResetPosition(motor, axis.keys[0] * steps))
        client.request(MotorSetSpeed(motor, speed, round(speed / _TO_TOP_SPEED_S)))
        client.request(MotorSetLimits(motor, 1, low * steps, 1, high * steps, 0))
