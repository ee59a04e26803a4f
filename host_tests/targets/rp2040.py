"""The Pico's image on the emulated RP2040."""

import contextlib
import os
from collections.abc import Mapping
from types import SimpleNamespace
from typing import Any

from framestep.pulse.engine import FASTEST_HZ
from framestep.rig import Rig
from framestep_tools.building.board_files import board_data
from framestep_tools.judge.trace import Edge
from framestep_tools.simulator.boards import EmulatedBoard
from host_tests.observers import CHIP, IN_CHIPS, ON_PINS
from host_tests.targets import FirstLevels

NAME = "pico"
# DMX is not decoded from its pin (host_tests/board/test_io.py), the memory for uploads is the
# board's, and a request takes effect some ticks later than on the host simulation.
LACKS = {"inside", "boards", "lights", "little memory", "prompt", "150 frames/s"}
FEEDS = ON_PINS | IN_CHIPS


FAULT = "FRAMESTEP_TIMING_FAULT"  # the environment variable that names one for all boards


def _files() -> Mapping[str, bytes]:
    """Return the files of a board, beside its rig file."""
    from host_tests.board import timing_faults

    name = os.environ.get(FAULT)
    return timing_faults.files(timing_faults.FAULTS[name]) if name else {}


class Inside:
    """What HostBoard offers beyond Board, as far as it can be done from outside."""

    def __init__(self, board: "Target"):
        self._board = board

    def set_input(self, name: int | str, level: int) -> None:
        data = self.controller.rig.board
        if isinstance(name, int):
            pin = name
        elif name == "estop":
            pin = data["estop"]
        else:
            pin = data["gio"][int(name.removeprefix("gio")) - 1]
        self._board.emulator.set_pin(pin, level)

    @property
    def controller(self) -> Any:
        return SimpleNamespace(rig=Rig(self._board._rig or None, self._board._data))

    def __getattr__(self, name: str) -> Any:
        raise AssertionError(f"{name} is inside the board")


class Target(EmulatedBoard):
    """In the place of boards.SimulatedBoard."""

    shows = CHIP

    def __init__(
        self, rig: Mapping[str, Any] | None = None, motors: int | None = None, board: str = NAME
    ):
        settings = dict(rig or {})
        if motors not in (None, len(board_data(board)["step"])):
            settings.setdefault("motor_count", motors)
        self._first = FirstLevels()
        super().__init__(settings, board=board, files=_files())
        self._board = Inside(self)

    # the protocol's port, as it is of a SimulatedBoard

    def receive(self, data: bytes) -> None:
        self.protocol.receive(data)

    def transmit(self) -> bytes:
        return self.protocol.transmit()

    def open_port(self, on: bool) -> None:
        self.protocol.open_port(on)

    @property
    def pending(self) -> int:
        return self.protocol.pending

    @property
    def engine_mhz(self) -> int:
        """The clock of the pulse engine, as the HAL divides the processor's."""
        mhz = self._board.controller.rig.board["clock_mhz"]
        while mhz * 1_000_000 > FASTEST_HZ:
            mhz //= 2
        return mhz

    def edges(self) -> list[Edge]:
        return self._first.drop(super().edges())

    def __del__(self) -> None:
        with contextlib.suppress(OSError, AttributeError):
            self.close()
