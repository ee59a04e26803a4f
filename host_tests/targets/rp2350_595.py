"""The image of a Pico 2 with shift registers on the emulated RP2350. It has the pins of a Pico, but
steps and directions, of the first eight motors, are outputs of the registers."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from host_tests.observers import CHIP
from host_tests.targets import rp2350

NAME = "pico2_595"
# Edges lie on a grid of 4 µs, and no pulse is shorter. The engine has no servos.
LACKS = rp2350.LACKS | {"fine edges", "short pulses", "servos"}
FEEDS = rp2350.FEEDS


class Target(rp2350.Target):
    """In the place of boards.SimulatedBoard."""

    shows = replace(CHIP, lag_ms=6, report_s=0.006)  # pulses come a millisecond later

    def __init__(
        self, rig: Mapping[str, Any] | None = None, motors: int | None = None, board: str = NAME
    ):
        super().__init__(rig, motors, board)
