"""A board that plays moves, and the judgement of its edges."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..client.client import Client
from ..errors import ToolError
from ..judge.judge import Limits, Verdict, judge
from ..judge.reference import Reference
from ..judge.trace import Trace
from ..payloads import (
    DeviceInfo,
    HardStop,
    MotorGetPosition,
    MotorSetSpeed,
    Positions,
    RtEnd,
    RtGo,
    RtRunMove,
)
from ..simulator.boards import EmulatedBoard, LockstepPort
from .moves import FPS, ROLL_MS, STEEPEST, WINDOW

_TICK_S = 0.001


class Session:
    """A board with a client on its protocol port."""

    fps = FPS  # of the prepared move

    def __init__(self, board: EmulatedBoard):
        self.board = board
        self.client = Client(LockstepPort(board))
        self.info = self.client.wait_event(DeviceInfo, 10)

    def repl(self, code: str) -> str:
        """Run code on the board's REPL."""
        return self.board.emulator.repl().exec(code)

    @property
    def positions(self) -> dict[int, int]:
        """Return the reported positions."""
        return dict(enumerate(self.client.request(MotorGetPosition()).steps, 1))

    def prepare(
        self, positions: Mapping[int, np.ndarray], velocity: int, fps: int = FPS
    ) -> dict[int, np.ndarray]:
        """Upload a move that begins at the motors' positions, and bring them to its start. Return
        the uploaded positions."""
        client = self.client
        self.fps = fps
        stands = self.positions
        moved = {motor: steps + stands[motor] for motor, steps in positions.items()}
        for motor in moved:
            client.request(MotorSetSpeed(motor, velocity, STEEPEST))
        count = len(next(iter(moved.values())))
        client.upload_move(1, count, moved, WINDOW)
        client.request(RtRunMove(fps * 1000, 1, count, ROLL_MS, ROLL_MS))
        client.wait_idle()
        client.pump(0.05)
        return moved

    def play(
        self, positions: Mapping[int, np.ndarray], meanwhile: Callable[[], None] | None = None
    ) -> "Played":
        """Play the prepared move."""
        client, board = self.client, self.board
        start = self.positions
        client.events.clear()
        board.emulator.trace_start(board.pins.pins)
        with board.emulator.measure() as measured:
            client.request(RtGo())
            begun = client.clock()
            while not client.take_event(RtEnd):
                if client.clock() - begun > 60:
                    raise ToolError("the run did not end: no RT_END came from the board")
                if meanwhile:
                    meanwhile()
                else:
                    client.pump(0.05)
        client.wait_idle()  # back on the end frame
        client.pump(0.05)
        records = board.emulator.trace_stop()
        reports = sum(isinstance(event.message, Positions) for event in client.events)
        faults = [event.message for event in client.events if isinstance(event.message, HardStop)]
        trace = Trace.from_records(records, board.pins)
        path = Reference(positions, self.fps * 1000, ROLL_MS, ROLL_MS)
        verdict = judge(
            trace,
            positions,
            self.fps * 1000,
            start,
            self.positions,
            path,
            limits=Limits(velocity_share=1.0),
        )
        return Played(verdict, path, measured, reports, faults)


@dataclass
class Played:
    """A played move: its verdict, the emulator's measurement, received position reports and
    faults."""

    verdict: Verdict
    path: Reference
    measured: dict[str, Any]
    reports: int
    faults: list[HardStop]

    def errors_us(self, ramps: bool) -> np.ndarray:
        """Return the edges' errors against the path, in its ramps or at constant velocity. The
        first tick after a ramp belongs to it: there the engine makes up for the ramp's last step.
        """
        found = []
        for motor in self.verdict.motors:
            error = motor.edge_error_us - np.nanmedian(motor.edge_error_us)
            times = motor.edge_times_s
            accelerates = np.abs(self.path.acceleration(motor.motor, times)) > 1
            accelerates |= np.abs(self.path.acceleration(motor.motor, times - _TICK_S)) > 1
            found.append(np.abs(error[accelerates == ramps]))
        return np.concatenate(found)

    def rate(self) -> float:
        """Return steps per second between the first and the last frame, of the slowest motor."""
        slowest = min(
            (len(m.edge_times_s) - 1) / np.ptp(m.edge_times_s) for m in self.verdict.motors
        )
        return round(float(slowest), -1)  # the resolution of an edge is 8 ns

    @property
    def complaints(self) -> list[str]:
        """List the faults of the move."""
        return self.verdict.complaints + [
            f"HARD_STOP {fault.motor} was sent" for fault in self.faults
        ]
