"""Traces of a board's pins, as CSV and as arrays.

A trace is CSV with the header `time_ns,signal,value`, written as it happens and in the order of
time:

    m1 … m8        a step of a motor, at its pin's rising edge, or at each edge if its driver
                   steps on both: +1 or -1 in the motor's own counting direction
    dir1 … dir8    level of a direction pin, 0 or 1, at each change and once at the start
    servo1 … servo8    level of a servo's pin, instead of both
    enable, estop, shutter, meter, gio1 …    levels of the other pins likewise (enable1 … if each
                                             motor has its own)

Times are nanoseconds of the board's own (virtual) time.
"""

import heapq
import os
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TextIO

import numpy as np

from framestep.hal.host import pin_names
from framestep.rig import Rig, RigError

from ..building.board_files import board_data
from ..errors import ToolError

HEADER = "time_ns,signal,value"
_ROW = np.dtype([("time_ns", "i8"), ("signal", "U12"), ("value", "i4")])
_STEP = re.compile(r"m\d+")

Edge = tuple[int, str, int]  # time in ns, signal, value


class TraceError(ToolError):
    """A trace, or a board's pin map, is invalid."""


# ---- a board's pins ------------------------------------------------------------------------------


@dataclass(frozen=True)
class BoardPins:
    """A board's pin map (boards/<board>/board.json): pins of the motors in their order, and the
    level signals. both_edges: step pins at which each edge is a step."""

    step: tuple[int, ...]
    dir: tuple[int, ...]
    levels: Mapping[int, str]  # pin -> signal, for all pins but step pins
    both_edges: frozenset[int] = frozenset()

    @property
    def pins(self) -> list[int]:
        """List every pin of a trace."""
        return sorted({*self.step, *self.levels})


def load_board(name: str = "pico", rig: Mapping[str, Any] | None = None) -> BoardPins:
    """Read the pin map of a board with the settings of a rig file. name: its folder in boards/.

    Raises ToolError if there is no such board. If the rig file has a mistake, the defaults apply,
    as on the board.
    """
    return pins_of(board_data(name), rig, name)


def pins_of(data: Mapping[str, Any], rig: Mapping[str, Any] | None, name: str) -> BoardPins:
    """Return the pin map for a board's data."""
    try:
        try:
            settings = Rig(dict(rig) if rig else None, data)
        except RigError:
            settings = Rig(None, data)
        board = settings.board
        levels = {pin: f"dir{i}" for i, pin in enumerate(board["dir"], 1)}
        enable = board["enable"]
        levels |= (
            {pin: f"enable{i}" for i, pin in enumerate(enable, 1)}
            if isinstance(enable, list)
            else {enable: "enable"}
        )
        levels |= pin_names(board)
        servos = enumerate(zip(board["step"], board["dir"], strict=True), 1)
        levels |= {step: f"servo{i}" for i, (step, turn) in servos if step == turn}
        both_edges = frozenset(
            step
            for step, motor in zip(board["step"], settings.motors, strict=False)
            if motor["driver"] and motor["driver"]["both_edges"]
        )
        return BoardPins(tuple(board["step"]), tuple(board["dir"]), levels, both_edges)
    except (KeyError, TypeError) as error:
        raise TraceError(
            f"boards/{name}/board.json: expected pins for step, dir, enable, found no {error}"
        ) from error


class PinDecoder:
    """Turns records of pin levels (fields t, pin, level) into signals, chunk after chunk.

    The first record of a pin is the level that it had when the trace began, as the emulator writes
    it. A motor's step counts +1 while its direction pin is high, or low for the motors in
    `inverted` (numbers from 1).
    """

    def __init__(self, board: BoardPins, inverted: Iterable[int] = ()):
        self.board = board
        self.inverted = frozenset(inverted)
        self._level: dict[int, int] = {}  # last known level of each pin
        self._motor = {pin: i for i, pin in enumerate(board.step, 1) if pin != board.dir[i - 1]}

    def feed(self, records: np.ndarray) -> list[Edge]:
        """Return the edges in these records, in their order."""
        edges: list[Edge] = []
        level = self._level
        for time_ns, pin, value in zip(
            records["t"].tolist(), records["pin"].tolist(), records["level"].tolist(), strict=True
        ):
            before = level.get(pin)
            if before == value:
                continue
            level[pin] = value
            motor = self._motor.get(pin)
            if motor is None:
                name = self.board.levels.get(pin)
                if name:
                    edges.append((time_ns, name, value))
            elif (value or pin in self.board.both_edges) and before is not None:
                forward = level.get(self.board.dir[motor - 1], 0) != (motor in self.inverted)
                edges.append((time_ns, f"m{motor}", 1 if forward else -1))
        return edges


# ---- CSV -----------------------------------------------------------------------------------------


def _created(path: str | os.PathLike[str]) -> TextIO:
    try:
        return open(path, "w")
    except OSError as error:
        raise TraceError(f"cannot write the trace {path}: {error.strerror}") from None


class TraceWriter:
    """Writes a trace as it happens. Until `release`, edges may come in any order."""

    def __init__(self, file: str | os.PathLike[str] | TextIO):
        self.file: TextIO = _created(file) if isinstance(file, str | os.PathLike) else file
        self.written = 0
        self._heap: list[tuple[int, int, str, int]] = []
        self._order = 0  # keeps the order of edges with equal times
        self.file.write(HEADER + "\n")
        self.file.flush()

    def add(self, edges: Iterable[Edge]) -> None:
        """Add edges. `release` writes them once their time has come."""
        for time_ns, signal, value in edges:
            heapq.heappush(self._heap, (time_ns, self._order, signal, value))
            self._order += 1

    def release(self, now_ns: int) -> None:
        """Write the edges up to this moment. No earlier edge may come after this call."""
        heap, rows = self._heap, []
        while heap and heap[0][0] <= now_ns:
            time_ns, _, signal, value = heapq.heappop(heap)
            rows.append(f"{time_ns},{signal},{value}\n")
        self.written += len(rows)
        self.file.write("".join(rows))

    def flush(self) -> None:
        """Flush, so readers of the file see all written edges."""
        self.file.flush()

    def close(self) -> None:
        """Write the remaining edges and close the file."""
        if not self.file.closed:
            self.release((self._heap and max(self._heap)[0]) or 0)
            self.file.close()

    def __enter__(self) -> "TraceWriter":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


class Trace:
    """Edges by signal: ascending times in ns, and values, as numpy arrays."""

    def __init__(self, signals: Mapping[str, tuple[np.ndarray, np.ndarray]]):
        self.signals = dict(signals)

    @classmethod
    def from_edges(cls, edges: Iterable[Edge]) -> "Trace":
        """Make a trace from single edges in any order."""
        return cls({}).with_edges(edges)

    def with_edges(self, edges: Iterable[Edge]) -> "Trace":
        """Return a trace that has these edges, in any order, as well."""
        grouped: dict[str, tuple[list[int], list[int]]] = {}
        for time_ns, signal, value in edges:
            found = grouped.get(signal)
            if found is None:
                found = grouped[signal] = [], []
            found[0].append(time_ns)
            found[1].append(value)
        signals = dict(self.signals)
        for signal, (more_times, more_values) in grouped.items():
            times, values = np.array(more_times, np.int64), np.array(more_values, np.int64)
            if signal in signals:
                before = signals[signal]
                times = np.concatenate((before[0], times))
                values = np.concatenate((before[1], values))
            signals[signal] = _sorted(times, values)
        return Trace(signals)

    @classmethod
    def from_records(cls, records: np.ndarray, board: BoardPins) -> "Trace":
        """Make a trace from all records of pin levels of a run (see PinDecoder), much faster than
        edge by edge."""
        signals = {}
        for pin, name in board.levels.items():
            mine = records[records["pin"] == pin]
            signals[name] = mine["t"].astype(np.int64), mine["level"].astype(np.int64)
        for motor, (step, direction) in enumerate(zip(board.step, board.dir, strict=True), 1):
            if step == direction:
                continue  # a servo's pin
            mine = records[records["pin"] == step][1:]  # the first record is the level before
            if step not in board.both_edges:
                mine = mine[mine["level"] == 1]
            times = mine["t"].astype(np.int64)
            turns = records[records["pin"] == direction]
            level = turns["level"][np.searchsorted(turns["t"], times, side="right") - 1].astype(
                np.int64
            )
            if len(times):
                signals[f"m{motor}"] = times, 2 * level - 1
        return cls(signals)

    @classmethod
    def read(cls, path: str | os.PathLike[str]) -> "Trace":
        """Read a CSV file. Raises TraceError if it is not a trace."""
        with open(path) as file:
            header = file.readline().strip()
            if header != HEADER:
                raise TraceError(f"{path}: expected the header {HEADER!r}, found {header[:60]!r}")
            first = file.tell()
            if not file.readline():
                return cls({})
            file.seek(first)
            try:
                rows = np.loadtxt(file, dtype=_ROW, delimiter=",", ndmin=1)
            except ValueError as error:
                raise TraceError(
                    f"{path}: expected rows of time, signal and value: {error}"
                ) from None
        signals = {}
        for signal in np.unique(rows["signal"]):
            mine = rows[rows["signal"] == signal]
            signals[str(signal)] = _sorted(mine["time_ns"], mine["value"].astype(np.int64))
        return cls(signals)

    @property
    def motors(self) -> list[int]:
        """List the motors that made steps."""
        return sorted(int(name[1:]) for name in self.signals if _STEP.fullmatch(name))

    def steps(self, motor: int) -> tuple[np.ndarray, np.ndarray]:
        """Return times and directions (+1, -1) of a motor's steps; empty arrays if it made none."""
        return self.signals.get(f"m{motor}", (np.zeros(0, np.int64), np.zeros(0, np.int64)))

    def positions(self, motor: int, start: int = 0) -> tuple[np.ndarray, np.ndarray]:
        """Return the times of a motor's steps, and its position after each. start: the position
        before the first."""
        times, signs = self.steps(motor)
        return times, start + np.cumsum(signs)

    def position_at(
        self, motor: int, times_ns: np.ndarray | Sequence[int], start: int = 0
    ) -> np.ndarray:
        """Return a motor's position at these times. A step at exactly such a time counts."""
        times, positions = self.positions(motor, start)
        made = np.searchsorted(times, times_ns, side="right")
        return np.concatenate(([start], positions))[made]


def _sorted(times: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    if np.all(times[:-1] <= times[1:]):
        return times, values
    order = np.argsort(times, kind="stable")
    return times[order], values[order]
