"""Figures of an ESP32, from the simulated chip (tools/micropython/esp32).

Time is virtual there and code takes none. So these figures say what the stream, the queue and the
protocol's UART allow, not how fast the processor is. That is estimated from the number of
instructions that a Xtensa processor executes in QEMU (stream_cost.py).
"""

from collections.abc import Callable, Mapping, Sequence
from functools import partial

import numpy as np

from ..errors import ToolError
from ..judge.judge import Limits, NoRun, judge
from ..judge.reference import Reference
from ..judge.trace import Trace
from ..payloads import HardStop, MotorMove, MotorSetSpeed, MotorStopAll, Positions, RtEnd, RtGo
from ..simulator.esp32_board import RATE, Esp32Board
from . import stream_cost
from .esp32_memory import HEAP_KB, memory
from .figures import Figure
from .moves import FPS, MOTORS, ROLL_MS, STEEPEST, mixed_move, steady_move
from .session import Played, Session

GRID_US = 1e6 / RATE
_RATES = (125_000, 100_000, 80_000, 60_000, 50_000, 40_000)
_STOP_SPEED = 20_000  # steps/s; at STEEPEST it ends within 5 ms
_PAUSES_MS = (20, 30, 40)
_RUN_S = 60  # of virtual time, for a run that does not end

TITLE = "ESP32, simulated: code takes no time"
FIGURES = (
    Figure(
        "esp32_steps_per_s_8",
        "steps/s",
        60_000,
        None,
        "rising edges behind the shift registers of each motor over the time of a move at constant "
        "velocity, for the slowest of the eight, in the fastest one with every edge within the "
        f"grid of {GRID_US:g} µs around the ideal and no fault; the highest setting is 125 000",
    ),
    Figure("esp32_steps_per_s_1", "steps/s", 125_000, None, "the same for one motor"),
    Figure(
        "esp32_edge_error_us",
        "µs",
        None,
        GRID_US / 2 + 2,
        "worst distance of a rising edge from the ideal at constant velocity, eight motors at "
        "1 000 to 99 700 steps/s; half of the grid is in it",
    ),
    Figure(
        "esp32_stop_ms",
        "ms",
        None,
        50,
        "from MOTOR_STOP_ALL to the last edge of a motor that could stop within 5 ms",
    ),
    Figure(
        "esp32_pause_ms",
        "ms",
        20,
        None,
        "the longest pause of the main loop, of 20, 30 and 40 ms, in a run that loses nothing",
    ),
    Figure(
        "esp32_builder_tick_us_8",
        "µs",
        None,
        200,
        "planning, the tick and the words for I2S, for each millisecond of eight motors at 60 000 "
        "steps/s, without I2S: instructions in QEMU, at best one each cycle of 240 MHz",
    ),
    Figure(
        "esp32_free_bytes",
        "bytes",
        None,
        None,
        f"memory for a move, of a heap of {HEAP_KB} kB, with eight motors; DMX and all types of "
        "virtual axes loaded",
    ),
)


class ChainSession(Session):
    """A simulated ESP32 with a client on its UART."""

    board: Esp32Board  # type: ignore[assignment]

    def __init__(self, board: Esp32Board):
        super().__init__(board)  # type: ignore[arg-type]

    def play(
        self, positions: Mapping[int, np.ndarray], meanwhile: Callable[[], None] | None = None
    ) -> Played:
        """Play the prepared move."""
        client = self.client
        start = self.positions
        client.events.clear()
        self.board.edges()
        client.request(RtGo())
        begun = client.clock()
        while not client.take_event(RtEnd):
            if client.clock() - begun > _RUN_S:
                raise ToolError("the run did not end: no RT_END came from the board")
            if meanwhile:
                meanwhile()
            client.pump(0.05)
        client.wait_idle()
        client.pump(0.05)
        path = Reference(positions, FPS * 1000, ROLL_MS, ROLL_MS)
        verdict = judge(
            Trace.from_edges(self.board.edges()),
            positions,
            FPS * 1000,
            start,
            self.positions,
            path,
            limits=Limits(velocity_share=1.0),
        )
        reports = sum(isinstance(event.message, Positions) for event in client.events)
        faults = [event.message for event in client.events if isinstance(event.message, HardStop)]
        return Played(verdict, path, {}, reports, faults)


def top_rate(session: ChainSession, motors: int) -> float:
    """Return the highest of the rates at which `motors` motors play a move with every edge
    right."""
    for wanted in _RATES:
        positions = session.prepare(steady_move(wanted, motors), wanted)
        played = session.play(positions)
        worst = float(np.nanmax(played.errors_us(ramps=False)))
        if not played.complaints and worst <= GRID_US:
            return played.rate()
    return 0.0


def stop_ms(session: ChainSession) -> float:
    """Return the time from a stop to the last edge."""
    client = session.client
    client.request(MotorSetSpeed(1, _STOP_SPEED, STEEPEST))
    client.request(MotorMove(1, session.positions[1] + 10 * _STOP_SPEED))
    client.pump(0.5)
    session.board.edges()
    asked = client.clock()
    client.request(MotorStopAll())
    client.wait_idle()
    client.pump(0.1)
    times, _ = Trace.from_edges(session.board.edges()).steps(1)
    return float(times[-1] * 1e-6 - 1000 * asked)


def pause_ms(session: ChainSession, pauses: Sequence[int] = _PAUSES_MS) -> float:
    """Return the longest of these pauses in a run that loses nothing, each in ms; 0 if none."""
    longest = 0
    for pause in pauses:
        positions = session.prepare(steady_move(20_000, MOTORS), 21_000)
        try:
            played = session.play(positions, partial(session.board.pause, pause))
        except NoRun:  # it was broken off
            break
        if played.complaints:
            break
        longest = pause
    return longest


def measure() -> dict[str, float]:
    """Measure all figures."""
    with Esp32Board({"motors": [{"pulse_us": GRID_US}] * MOTORS}) as board:
        session = ChainSession(board)
        figures = {
            "esp32_steps_per_s_8": top_rate(session, MOTORS),
            "esp32_steps_per_s_1": top_rate(session, 1),
        }
        positions = session.prepare(mixed_move(), 101_000)
        played = session.play(positions)
        figures["esp32_edge_error_us"] = float(np.nanmax(played.errors_us(ramps=False)))
        figures["esp32_stop_ms"] = stop_ms(session)
        figures["esp32_pause_ms"] = pause_ms(session)
    figures["esp32_builder_tick_us_8"] = stream_cost.us(60_000)
    figures["esp32_free_bytes"] = memory({}).move_bytes
    return figures
