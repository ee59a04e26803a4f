"""A board on a serial port, or `framestep sim`: answers and times, but no edges.

It keeps its own rig file, so only scenarios with the defaults are played. A scenario that turns out
to look at an edge or to set an input is left out there and then.
"""

import os
import time
import weakref
from collections.abc import Mapping
from types import SimpleNamespace
from typing import Any, ClassVar, NoReturn

import pytest
import serial

from framestep.motors.rates import DEFAULT_ACCELERATION, DEFAULT_VELOCITY
from framestep.rig import Rig
from framestep_tools import payloads as p
from framestep_tools.building.board_files import board_data
from framestep_tools.client.client import Client
from framestep_tools.judge.trace import Edge
from framestep_tools.simulator.boards import LockstepPort

PORT = "FRAMESTEP_DEVICE"  # the environment variable with its name
LACKS = {
    "inside", "boards", "lights", "fine edges", "prompt", "little memory", "instants", "cycles",
    "servo edges", "edges", "inputs",
}  # fmt: skip
FEEDS: set[str] = set()  # no observer
_SLICE_S = 0.001
_REST_S = 1.0  # from one session to the next: the port is closed, and all that moves comes to rest


class Inside:
    def __getattr__(self, name: str) -> Any:
        if name == "controller":
            return SimpleNamespace(rig=Rig(None, board_data("pico")))
        _leave_out(f"{name} is not on its port")


class Target:
    """In the place of boards.SimulatedBoard. Time is the computer's. The device has been through
    the scenarios before: it begins at rest, at 0, without limits, with the default speeds."""

    shows = None  # no pins, and so nothing to observe
    slice_ns = 1_000_000
    repl = None
    _before: ClassVar["weakref.ref[Target] | None"] = None  # which may still have the port

    def __init__(
        self, rig: Mapping[str, Any] | None = None, motors: int | None = None, **more: Any
    ):
        self._port: serial.Serial | None = None
        if rig or more or motors not in (None, 8):
            _leave_out("the device has a rig file of its own")
        if Target._before and (before := Target._before()):
            before.close()
        Target._before = weakref.ref(self)
        self._board = Inside()
        self._begun = time.monotonic_ns()
        self.protocol = self
        with Client(LockstepPort(self)) as client:
            client.wait_event(p.DeviceInfo)
            client.code(p.MotorStopAll())
            client.wait_idle(60)
            for number in range(1, 9):
                client.code(p.MotorSetLimits(number, 0, 0, 0, 0))
                client.code(p.MotorSetSpeed(number, DEFAULT_VELOCITY, DEFAULT_ACCELERATION))
                client.code(p.MotorResetPosition(number, 0))

    def receive(self, data: bytes) -> None:
        if self._port:
            self._port.write(data)

    def transmit(self) -> bytes:
        return self._port.read(self._port.in_waiting) if self._port else b""

    def open_port(self, on: bool) -> None:
        if on and not self._port:
            self._port = serial.Serial(os.environ[PORT], timeout=0, exclusive=True)
        elif not on and self._port:
            self._port.close()
            self._port = None
            time.sleep(_REST_S)

    @property
    def pending(self) -> int:
        return self._port.out_waiting if self._port else 0

    @property
    def now_ns(self) -> int:
        return time.monotonic_ns() - self._begun

    def run_until(self, ns: int, until_output: bool = False) -> None:
        while self.now_ns < ns and not (
            until_output and self._port is not None and self._port.in_waiting
        ):
            time.sleep(_SLICE_S)

    def edges(self) -> list[Edge]:
        _leave_out("it looks at the pins")

    def upload_bytes_for(self, frames: int) -> int:
        _leave_out("the device has its own memory")

    def wire_switches(self) -> None:
        _leave_out("it sets an input")

    def close(self) -> None:
        self.open_port(False)

    def __del__(self) -> None:
        self.close()


def _leave_out(why: str) -> NoReturn:
    pytest.skip(f"needs more than a port: {why}")
