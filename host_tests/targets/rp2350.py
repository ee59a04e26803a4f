"""The Pico 2's image on the emulated RP2350, with the pins of a Pico."""

from collections.abc import Mapping
from typing import Any

from host_tests.observers import Tolerances
from host_tests.targets import rp2040

NAME = "pico2"
LACKS = rp2040.LACKS | {"120 frames/s"}
_MOTORS = 8  # with more, the scenarios' inputs and outputs are motors' pins


class Target(rp2040.Target):
    """In the place of boards.SimulatedBoard."""

    # pulses break off at 1.8 ms; how much earlier ticks come has not been measured
    shows = Tolerances(lag_ms=5, report_s=0.005, late_us=1800, masked_us=1800)

    def __init__(
        self, rig: Mapping[str, Any] | None = None, motors: int | None = None, board: str = NAME
    ):
        super().__init__(
            {"motor_count": min(motors or _MOTORS, _MOTORS), **(rig or {})}, None, board
        )
