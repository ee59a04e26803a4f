"""The Pico 2's image on the emulated RP2350, with the pins of a Pico."""

from collections.abc import Mapping
from typing import Any

from host_tests.targets import rp2040

NAME = "pico2"
LACKS = rp2040.LACKS | {"120 frames/s"}
FEEDS = rp2040.FEEDS
_MOTORS = 8  # with more, the scenarios' inputs and outputs are motors' pins


class Target(rp2040.Target):
    """In the place of boards.SimulatedBoard."""

    def __init__(
        self, rig: Mapping[str, Any] | None = None, motors: int | None = None, board: str = NAME
    ):
        super().__init__(
            {"motor_count": min(motors or _MOTORS, _MOTORS), **(rig or {})}, None, board
        )
