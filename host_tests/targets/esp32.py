"""The simulated ESP32-S3, with its protocol on USB.

Rig files here have a Pico's pins. They become the S3's. Pulses come EARLIER_NS later than on the
host, after the queue of I2S, and so do the reports of positions. Tests compare edges either with
requests or with reports, or with the present. So a test gets edges with times that are this much
earlier, unless it is marked `with_reports`.
"""

import contextlib
from collections.abc import Mapping
from types import SimpleNamespace
from typing import Any

import pytest

from framestep_tools.building.board_files import board_data
from framestep_tools.judge.trace import Edge
from framestep_tools.simulator.esp32_board import Esp32Board
from host_tests.observers import ON_PINS, Tolerances
from host_tests.targets import FirstLevels

NAME = "esp32_s3_595"
# A Pico's general pins, gio1 to gio4, of which the first two are outputs by default; and what takes
# their place: a chip's pin for an input, an output of the chain for an output
GENERAL = (22, 26, 27, 28)
INPUTS = dict(zip(GENERAL, (15, 16, 17, 18), strict=True))
OUTPUTS = dict(zip(GENERAL, (83, 84, 85, 86), strict=True))
SERVOS = (12, 13, 14, 21, 38, 39, 40, 41)  # a chip's pin for each motor's servo
_SIGNALS = {f"out{number}": f"gio{number}" for number in range(1, 5)}


EARLIER_NS = 25_000_000
_QUEUE_NS = 30_000_000  # by then what the ticks have commanded has been played
_shift_ns = EARLIER_NS  # of the running test

# What it cannot show, of NEEDS in __init__.py: edges lie on a grid of 4 µs, and a request takes
# effect once the queue of I2S has been played. DMX leaves a UART (esp32/test_lines.py), the E-stop
# ends all pulses at once (esp32/test_board.py), and machine.PWM sets widths in steps of 0.3 µs, and
# a period late at most.
LACKS = {
    "inside", "boards", "lights", "fine edges", "prompt", "ramped E-stop", "little memory",
    "short pulses", "instants", "servo edges",
}  # fmt: skip
FEEDS = ON_PINS


def begin(item: pytest.Item) -> None:
    """Choose how a test sees time."""
    global _shift_ns
    _shift_ns = 0 if item.get_closest_marker("with_reports") else EARLIER_NS


class Inside:
    """What HostBoard offers beyond Board, as far as it can be done from outside."""

    def __init__(self, board: "Target"):
        self._board = board

    def set_input(self, name: int | str, level: int) -> None:
        board = self._board
        data = board.rig.board
        if isinstance(name, int):
            pin = INPUTS.get(name, name)
        elif name == "estop":
            pin = data["estop"]
        else:
            pin = INPUTS[GENERAL[int(name.removeprefix("gio")) - 1]]
        board.set_pin(pin, level)

    @property
    def controller(self) -> Any:
        return SimpleNamespace(rig=self._board.rig)

    def __getattr__(self, name: str) -> Any:
        raise AssertionError(f"{name} is inside the board")


class Target(Esp32Board):
    """In the place of boards.SimulatedBoard."""

    def __init__(
        self, rig: Mapping[str, Any] | None = None, motors: int | None = None, **more: Any
    ):
        assert not more, f"this board has no {', '.join(more)}"
        count = len(board_data(NAME)["step"])
        settings = translated(rig or {})
        if motors not in (None, count):
            settings.setdefault("motor_count", motors)
        self._first = FirstLevels()
        super().__init__(settings, NAME)
        self._board = Inside(self)

    # the protocol's port, as it is of a SimulatedBoard

    def receive(self, data: bytes) -> None:
        self.protocol.receive(data)

    def transmit(self) -> bytes:
        return super().transmit() if self.protocol is self else self.protocol.transmit()

    def open_port(self, on: bool) -> None:
        self.protocol.open_port(on)

    @property
    def pending(self) -> int:
        return self.protocol.pending

    @property
    def shows(self) -> Tolerances:
        return Tolerances(lag_ms=40, report_s=0.01, keeps_unread=True, earlier_ns=_shift_ns)

    def edges(self) -> list[Edge]:
        """Return the edges, with a Pico's names of the general outputs."""
        if _shift_ns:
            self.run_until(self.now_ns + _QUEUE_NS)
        found = [
            (time - _shift_ns, _SIGNALS.get(signal, signal), value)
            for time, signal, value in self._first.drop(super().edges())
        ]
        for number, motor in enumerate(self.rig.motors, 1):
            if motor["servo"]:
                times, levels = self.line_edges(motor["servo"]["pin"])
                for time, level in zip(times.tolist(), levels.tolist(), strict=True):
                    found.append((time - _shift_ns, f"servo{number}", level))
        return found

    def __del__(self) -> None:
        with contextlib.suppress(OSError, AttributeError):
            self.close()


def translated(rig: Mapping[str, Any]) -> dict[str, Any]:
    """Return a rig file with this board's pins."""
    found = dict(rig)
    taken = {limit.get(end) for limit in rig.get("limits", ()) for end in ("high", "low")}
    found["outputs"] = [{"pin": OUTPUTS[pin]} for pin in GENERAL[:2] if pin not in taken]
    found["inputs"] = [{"pin": INPUTS[pin]} for pin in GENERAL[2:] if pin not in taken]
    if "outputs" in rig:
        found["outputs"] = [_moved(item, ("pin",), OUTPUTS) for item in rig["outputs"]]
    if "inputs" in rig:
        found["inputs"] = [_moved(item, ("pin",), INPUTS) for item in rig["inputs"]]
    if "motors" in rig:
        found["motors"] = [
            {**motor, "servo": {"pin": pin, **motor["servo"]}} if "servo" in motor else motor
            for motor, pin in zip(rig["motors"], SERVOS, strict=False)
        ]
    if "limits" in rig:
        found["limits"] = [_moved(item, ("high", "low"), INPUTS) for item in rig["limits"]]
    return found


def _moved(item: Any, keys: tuple[str, ...], pins: Mapping[int, int]) -> Any:
    if not isinstance(item, Mapping):
        return item
    return {key: pins.get(value, value) if key in keys else value for key, value in item.items()}
