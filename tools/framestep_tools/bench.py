"""Measures the firmware on the emulated board against its goals: `make bench`.

All eight motors play an uploaded move with positions reported, and every figure comes from the
edges on the pins, the emulated clock, or counters of the runtime; FIGURES says how for each. The
board is run twice: with the model of the flash cache, which gives build/bench.json, and without.
How far the emulator's computing times have been checked against a real board stands in TRUST.
"""

import json
import time
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from rich.console import Console
from rich.table import Table

from framestep.motion import stepper
from framestep.protocol import messages

from . import builds, tick_cost
from .boards import EmulatedBoard, LockstepPort
from .client import Client, upload_requests
from .errors import Command, ToolError
from .files import ROOT
from .judge import Limits, Verdict, judge
from .payloads import (
    DeviceInfo,
    HardStop,
    Hi,
    MotorGetPosition,
    MotorMove,
    MotorResetPosition,
    MotorSetSpeed,
    MotorStatus,
    MotorStopAll,
    Positions,
    RtEnd,
    RtGo,
    RtRunMove,
    RtUploadMoveEnd,
    VirtConfig,
    VirtJogOnLine,
    VirtMove,
    VirtStop,
)
from .reference import Reference
from .trace import Trace
from .virtual_cost import virtual_update_us
from .virtual_reference import Axis, Rig
from .wire import encode

RESULT = ROOT / "build" / "bench.json"
MOTORS = 8
FPS = 25  # of the moves below, so that their steps per frame are whole numbers
RAMP = 100_000  # steps/s²
STEEPEST = 4_000_000  # steps/s²: the acceleration that the motors are allowed
ROLL_MS = 200
PULSE_US = 0.5  # a pulse of the default 1 µs ends at 480 000 steps/s
TOP_RATES = (
    500_000,
    475_000,
    450_000,
    425_000,
    400_000,
    375_000,
    350_000,
    325_000,
    300_000,
    250_000,
    200_000,
)
STEADY_US = 0.5  # a rate counts as reached if every edge is so close to the ideal
# of the motors in the mixed move
STEADY_RATES = (99_700, 80_000, 61_000, 50_000, 33_325, 20_000, 9_975, 1_000)
_WIDTH = 120  # of the table where there is no terminal
AT_ONCE = 40  # requests that follow each other at once, right after GO
# the rig of the virtual motions: steps per degree or millimetre, and what the host calls the pose
ARM = Rig(
    1,
    tuple(
        Axis(motor, steps, place)
        for motor, (steps, place) in enumerate(
            (
                (250.0, 3.0),
                (300.0, 10.0),
                (80.0, 4000.0),
                (250.0, -10.0),
                (250.0, -3.0),
                (250.0, 0.0),
            ),
            1,
        )
    ),
    length=857.7,
    extension=78.0,
    nodal=(20.0, 35.5, -12.0),
)
# the steps of its motors then: boom at 3 degrees, swing at 10
ARM_STANDS = (750, 3_000, 0, -2_500, -750, 0)
ARM_SPEED = (20_000, 50_000)  # steps/s, steps/s²
WINDOW = 4  # sections of an upload on their way at once


# ---- the figures ---------------------------------------------------------------------------------


@dataclass(frozen=True)
class Figure:
    """One figure: its key in bench.json, its unit, its goal, and how it is measured."""

    key: str
    unit: str
    at_least: float | None
    at_most: float | None
    how: str

    @property
    def goal(self) -> str:
        """The goal as it stands in the table."""
        if self.at_least is not None:
            return f"≥ {_number(self.at_least)}"
        return "–" if self.at_most is None else f"≤ {_number(self.at_most)}"

    def reached(self, value: float) -> bool | None:
        """Whether the goal is reached; None where there is none."""
        if self.at_least is not None:
            return value >= self.at_least
        return None if self.at_most is None else value <= self.at_most


FIGURES = (
    Figure(
        "steps_per_s_8",
        "steps/s",
        350_000,
        None,
        "rising edges of each motor from its first to its last frame over that time, "
        "the slowest of the eight, in the fastest move at constant velocity in which every edge "
        "is within 0.5 µs of the ideal and no fault occurs; motors can be set to 500 000 at most",
    ),
    Figure("steps_per_s_1", "steps/s", 500_000, None, "the same for one motor, the others at rest"),
    Figure(
        "edge_error_steady_us",
        "µs",
        None,
        0.5,
        "pins: worst distance of a rising edge from where the ideal path crosses that step, "
        "at constant velocity, of eight motors at 1 000 to 99 700 steps/s; "
        "each motor has its own origin of time, the median of its edges",
    ),
    Figure(
        "edge_error_ramp_us",
        "µs",
        None,
        2,
        "the same where the path accelerates: "
        "ramps of 100 000 steps/s² of all eight motors, but for the last step before a standstill",
    ),
    Figure(
        "frame_error_us",
        "µs",
        None,
        5,
        "pins: worst distance between the time of a frame and the edge onto the frame's step, "
        "over all frames in motion; one origin of time for all motors",
    ),
    Figure(
        "tick_us_8",
        "µs",
        None,
        60,
        "emulated clock: cycles spent in the timer's interrupt per millisecond of the mixed move, "
        "entry and exit too",
    ),
    Figure(
        "cpu_load_8_percent",
        "%",
        None,
        None,
        "emulated clock: share of the mixed move in which the processor did not sleep",
    ),
    Figure(
        "upload_frames_8",
        "frames",
        10_000,
        None,
        "HI's UPLOAD FRAME COUNT with the code frozen into the firmware; "
        "so many are then uploaded for eight motors",
    ),
    Figure(
        "rx_bytes_per_s",
        "bytes/s",
        400_000,
        None,
        "emulated clock: bytes of that upload over its time, first byte to last answer, "
        "while eight motors move and positions are reported "
        "(no move can be played while it is uploaded)",
    ),
    Figure(
        "rx_bytes_per_s_single_port",
        "bytes/s",
        80_000,
        None,
        "the same with ports: 1 in the rig file",
    ),
    Figure(
        "reply_ms_median",
        "ms",
        None,
        2,
        "emulated clock: from the host writing a request to having its whole reply, "
        "one after the other right after GO and then at random moments of that move",
    ),
    Figure("reply_ms_max", "ms", None, 10, "the slowest of these"),
    Figure(
        "virtual_reply_ms_max",
        "ms",
        None,
        15,
        "the same, the slowest, while a boom-swing-track rig of six motors "
        "does a virtual move and a jog on line; "
        "the requests that start and stop them are not counted",
    ),
    Figure(
        "heap_bytes_per_hour",
        "bytes/h",
        None,
        0,
        "gc.mem_alloc() after the mixed move less that before it, the collector off, "
        "scaled to an hour",
    ),
    Figure(
        "virtual_update_us",
        "µs",
        None,
        None,
        "the board's clock: from a boom-swing-track pose to the steps of six motors, "
        "with nodal offset and boom table, nothing playing; "
        "a virtual axis in motion needs it for each knot",
    ),
)


def _number(value: float) -> str:
    if isinstance(value, int) or value >= 1000:
        return f"{value:,.0f}".replace(",", " ")
    return f"{value:.3g}"


# ---- the moves -----------------------------------------------------------------------------------


def mixed_move(seconds: float = 2.4, fps: int = FPS) -> dict[int, np.ndarray]:
    """Positions of eight motors that ramp up with RAMP, hold each a velocity of STEADY_RATES, and
    ramp down.

    The odd motors go up, the even ones down. Those that have not the time for their velocity turn
    at the middle.
    """
    frames = round(seconds * fps) + 1
    t = np.arange(frames) / fps
    total = t[-1]
    moves = {}
    for motor, rate in enumerate(STEADY_RATES, 1):
        begun = min(rate / RAMP, total / 2)
        rate = RAMP * begun
        # in halves of steps per s², exact where the frames are
        x = np.minimum(t, begun)
        way = RAMP * x * x / 2 + rate * np.clip(t - begun, 0, total - 2 * begun)
        x = np.clip(t - (total - begun), 0, None)
        way += rate * x - RAMP * x * x / 2
        moves[motor] = np.floor(way + 0.25).astype(np.int64) * (1 if motor % 2 else -1)
    return moves


def steady_move(rate: int, motors: int, frames: int = 11) -> dict[int, np.ndarray]:
    """Positions of so many motors at a constant velocity, a multiple of FPS."""
    return {
        motor: rate // FPS * np.arange(frames) * (1 if motor % 2 else -1)
        for motor in range(1, motors + 1)
    }


# ---- measuring -----------------------------------------------------------------------------------


class Session:
    """A board with a client on its protocol port."""

    def __init__(self, board: EmulatedBoard):
        self.board = board
        self.client = Client(LockstepPort(board))
        self.info = self.client.wait_event(DeviceInfo, 10)

    def repl(self, code: str) -> str:
        """Run code on the board's REPL."""
        return self.board.emulator.repl().exec(code)

    @property
    def positions(self) -> dict[int, int]:
        """Where the motors say they are."""
        return dict(enumerate(self.client.request(MotorGetPosition()).steps, 1))

    def prepare(
        self, positions: Mapping[int, np.ndarray], velocity: int, fps: int = FPS
    ) -> dict[int, np.ndarray]:
        """Upload a move that begins where the motors stand, and bring them to where it begins.
        Gives the positions."""
        client = self.client
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
        """Play what prepare() has prepared."""
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
        client.wait_idle()  # on the end frame again
        client.pump(0.05)
        records = board.emulator.trace_stop()
        reports = sum(isinstance(event.message, Positions) for event in client.events)
        faults = [event.message for event in client.events if isinstance(event.message, HardStop)]
        trace = Trace.from_records(records, board.pins)
        path = Reference(positions, FPS * 1000, ROLL_MS, ROLL_MS)
        verdict = judge(
            trace,
            positions,
            FPS * 1000,
            start,
            self.positions,
            path,
            limits=Limits(velocity_share=1.0),
        )
        return Played(verdict, path, measured, reports, faults)


@dataclass
class Played:
    """A move that has been played: its verdict, what the emulator measured, position reports and
    faults that came."""

    verdict: Verdict
    path: Reference
    measured: dict[str, Any]
    reports: int
    faults: list[HardStop]

    def errors_us(self, ramps: bool) -> np.ndarray:
        """Errors of the edges against the path in its ramps, or where it holds a velocity."""
        found = []
        for motor in self.verdict.motors:
            error = motor.edge_error_us - np.nanmedian(motor.edge_error_us)
            accelerates = np.abs(self.path.acceleration(motor.motor, motor.edge_times_s)) > 1
            found.append(np.abs(error[accelerates == ramps]))
        return np.concatenate(found)

    def rate(self) -> float:
        """Steps per second between the first and the last frame, of the slowest motor."""
        slowest = min(
            (len(m.edge_times_s) - 1) / np.ptp(m.edge_times_s) for m in self.verdict.motors
        )
        return round(float(slowest), -1)  # an edge is known to 8 ns

    @property
    def complaints(self) -> list[str]:
        """What was wrong with it."""
        return self.verdict.complaints + [
            f"HARD_STOP {fault.motor} was sent" for fault in self.faults
        ]


def top_rate(session: Session, motors: int, say: Callable[[str], None]) -> float:
    """The highest of TOP_RATES at which so many motors play a move with every edge in its place."""
    for wanted in TOP_RATES:
        say(f"{motors} motors at {wanted} steps/s")
        positions = session.prepare(
            steady_move(wanted, motors), min(wanted + wanted // 100, 500_000)
        )
        played = session.play(positions)
        worst = float(np.nanmax(played.errors_us(ramps=False)))
        if not played.complaints and worst <= STEADY_US:
            return played.rate()
        say(f"  not reached: worst edge {worst:.2f} µs; {'; '.join(played.complaints[:2])}")
        session.client.wait_idle()
    return 0.0


def upload_rate(
    session: Session, frames: int, during: AbstractContextManager[Any] | None = None
) -> float:
    """Bytes per second of an upload of so many frames for eight motors, while they all move."""
    client = session.client
    t = np.arange(frames)
    positions = {
        motor: (100 * motor * np.sin(t / 300)).astype(np.int64) for motor in range(1, MOTORS + 1)
    }
    requests = list(upload_requests(1, frames, positions))
    size = sum(len(encode(request.TYPE, request.pack(), 1)) for request in requests[1:-1])
    for motor, stands in session.positions.items():
        client.request(MotorSetSpeed(motor, 5000, 5000))
        client.request(MotorMove(motor, stands + 100_000))
    client.pump(0.2)
    client.request(requests[0])
    client.events.clear()
    begun = client.clock()
    with during or nullcontext():
        client.stream(requests[1:-1], WINDOW)
    took = client.clock() - begun
    if not any(isinstance(event.message, Positions) for event in client.events):
        raise ToolError("no positions were reported during the upload")
    client.request(RtUploadMoveEnd())
    client.request(MotorStopAll())
    client.wait_idle()
    return size / took


def measure(cache: bool, say: Callable[[str], None]) -> dict[str, float]:
    """All figures, with the flash-cache model or without."""
    args = [] if cache else ["--xip-miss", "0"]
    rig: dict[str, Any] = {"motors": [{"pulse_us": PULSE_US}] * MOTORS}
    figures: dict[str, float] = {}
    say("booting the frozen image")
    with EmulatedBoard(rig, trace=False, frozen=True, args=args) as board:
        session = Session(board)
        figures["upload_frames_8"] = session.info.upload_frames
        say("upload")
        figures["rx_bytes_per_s"] = upload_rate(session, session.info.upload_frames)
        say("mixed move")
        _mixed(session, figures)
        say("virtual axes")
        figures["virtual_update_us"] = virtual_update_us(session.repl)
        figures["virtual_reply_ms_max"] = max(virtual_replies(session))
        figures["steps_per_s_8"] = top_rate(session, MOTORS, say)
        figures["steps_per_s_1"] = top_rate(session, 1, say)
    say("upload through a single port")
    with EmulatedBoard({**rig, "ports": 1}, trace=False, frozen=True, args=args) as board:
        figures["rx_bytes_per_s_single_port"] = upload_rate(Session(board), 1000)
    return {figure.key: figures[figure.key] for figure in FIGURES}


class Asker:
    """Asks for something when it is called, and notes in `ms` how long the answer takes."""

    KINDS = (MotorStatus, MotorGetPosition, Hi)

    def __init__(self, client: Client, at_once: int = AT_ONCE):
        """at_once: so many requests follow each other at once, those after them at random
        moments."""
        self.client = client
        self.at_once = at_once
        self.ms: list[float] = []
        self._random = np.random.default_rng(1)

    def __call__(self) -> None:
        client = self.client
        if len(self.ms) >= self.at_once:
            client.pump(self._random.uniform(0.001, 0.02))
        begun = client.clock()
        client.answer_to(client.send(self.KINDS[len(self.ms) % len(self.KINDS)]()))
        self.ms.append(1000 * (client.clock() - begun))

    def until_idle(self) -> None:
        """Ask until nothing moves any more."""
        while not self.client.request(MotorStatus()).idle:
            self()


def virtual_replies(session: Session) -> list[float]:
    """How long answers take while a rig moves along lines, ms."""
    client = session.client
    for axis, step in zip(ARM.axes, ARM_STANDS, strict=True):
        client.request(MotorSetSpeed(axis.motor, *ARM_SPEED))
        client.request(MotorResetPosition(axis.motor, step))
    client.request(VirtConfig.unpack(ARM.payload()))
    ask = Asker(client)
    client.request(VirtMove(messages.VIRT_MOTOR_EW, 98 * 100_000))
    ask.until_idle()
    jog = Asker(client)
    client.request(VirtJogOnLine(messages.LINE_X, -8000))
    begun = client.clock()
    while client.clock() - begun < 1:
        jog()
    client.request(VirtStop(messages.VIRT_MOTOR_EW))
    jog.until_idle()
    # none: else what is measured next has virtual positions reported as well
    client.request(VirtConfig.unpack(b"\0"))
    return ask.ms + jog.ms


def _mixed(session: Session, figures: dict[str, float]) -> None:
    client = session.client
    positions = session.prepare(mixed_move(), max(STEADY_RATES) * 11 // 10)
    ask = Asker(client)
    session.repl("import gc\ngc.collect()\ngc.disable()")
    taken = [int(session.repl("print(gc.mem_alloc())")) for _ in range(2)]
    begun = client.clock()
    played = session.play(positions, ask)
    hours = (client.clock() - begun) / 3600
    taken.append(int(session.repl("print(gc.mem_alloc())")))
    session.repl("gc.enable()")
    if played.complaints:
        raise ToolError(
            "the mixed move was not played as uploaded: " + "; ".join(played.complaints)
        )
    if played.reports < 10:
        raise ToolError(
            f"only {played.reports} position reports came while the mixed move was played"
        )
    ticks = played.measured["exceptions"]["irq3"]
    figures["edge_error_steady_us"] = float(np.nanmax(played.errors_us(ramps=False)))
    figures["edge_error_ramp_us"] = float(np.nanmax(played.errors_us(ramps=True)))
    figures["frame_error_us"] = played.verdict.worst_time_us
    figures["tick_us_8"] = ticks["cycles"] / 125 / played.measured["ms"]
    figures["cpu_load_8_percent"] = 100 * played.measured["load"]
    figures["reply_ms_median"] = float(np.median(ask.ms[AT_ONCE:]))
    figures["reply_ms_max"] = max(ask.ms)
    figures["heap_bytes_per_hour"] = (taken[2] - 2 * taken[1] + taken[0]) / hours


_WATCH = """
import time
import framestep.boot as boot

class Watch:
    def __init__(self, controller):
        self.inner = controller.poll
        self.blocks = controller.axes.kernel.blocks
        self.clear()
    def clear(self):
        self.count = self.sum = self.worst = 0
        self.least = 16
    def poll(self, now):
        begun = time.ticks_us()
        busy = self.inner(now)
        took = time.ticks_diff(time.ticks_us(), begun)
        self.count += 1
        self.sum += took
        if took > self.worst:
            self.worst = took
        if self.count & 7 == 0:
            for block in self.blocks:
                if block[{PLANNED}] & {PLAN_SEGMENTS}:
                    queued = (block[{TAIL}] - block[{HEAD}]) & 0x3FFFFFFF
                    if queued < self.least:
                        self.least = queued
        return busy

watch = Watch(boot.controller)
boot.controller.poll = watch.poll
"""
LOOP_FPS = (25, 60)


def loops() -> list[tuple[str, int, int, int, int]]:
    """[(what, passes in a second, their mean and their longest time in µs, fewest segments
    queued)]."""
    names = {name: getattr(stepper, name) for name in ("PLANNED", "PLAN_SEGMENTS", "TAIL", "HEAD")}
    found = []
    with EmulatedBoard(trace=False, frozen=True) as board:
        session = Session(board)
        client = session.client
        session.repl(_WATCH.format(**names))

        def watch(what: str) -> None:
            client.pump(0.3)
            session.repl("watch.clear()")
            client.pump(1.0)
            count, total, worst, least = session.repl(
                "print(watch.count, watch.sum, watch.worst, watch.least)"
            ).split()
            found.append((what, int(count), int(total) // int(count), int(worst), int(least)))

        watch("at rest")
        for fps in LOOP_FPS:
            positions = mixed_move(2.4, fps)
            session.prepare(positions, max(STEADY_RATES) * 11 // 10, fps)
            client.request(RtGo())
            watch(f"eight motors at {fps} fps")
            client.wait_event(RtEnd, 10)
            client.wait_idle()
    return found


def loop_table(rows: list[tuple[str, int, int, int, int]]) -> Table:
    """loops() as a table."""
    result = Table(
        title="passes of the main loop, flash-cache model on, frozen image", title_justify="left"
    )
    for name in ("", "in a second", "mean, µs", "longest, µs", "fewest segments queued"):
        result.add_column(name, justify="right" if name else "left", no_wrap=True)
    for what, *figures in rows:
        result.add_row(what, *map(str, figures))
    return result


# ---- showing -------------------------------------------------------------------------------------


def table(
    modelled: Mapping[str, float], ideal: Mapping[str, float], explain: bool = False
) -> Table:
    """The figures beside their goals: with the flash-cache model, and without it."""
    result = Table(title="RP2040 at 125 MHz, emulated", title_justify="left", show_lines=explain)
    result.add_column("figure", no_wrap=True)
    for name in ("goal", "measured", "without cache misses"):
        result.add_column(name, justify="right", no_wrap=True)
    result.add_column("unit", no_wrap=True)
    result.add_column("", no_wrap=True)
    if explain:
        result.add_column("how")
    for figure in FIGURES:
        value = modelled[figure.key]
        verdict = {True: "[green]reached[/]", False: "[red]missed[/]", None: ""}[
            figure.reached(value)
        ]
        cells = [
            figure.key,
            figure.goal,
            _number(value),
            _number(ideal[figure.key]),
            figure.unit,
            verdict,
        ]
        result.add_row(*cells, *([figure.how] if explain else []))
    return result


TRUST = (
    "Computing times of the emulator have been checked against a real board only "
    "by MicroPython's own benchmarks: they run at 0.91 of the speed published for a Pico, "
    "at 1.12 without cache misses, single ones at 0.6 to 1.26 (make emulator-measure, "
    "tools/emulator/README.md). Take what rests on computing time as right to about 20 %. "
    "Edges are exact to the clock cycle of the model of the PIO."
)

app = Command("bench")


@app.command()
def main(
    explain: Annotated[
        bool, typer.Option("--explain", help="say how each figure is measured")
    ] = False,
    out: Annotated[Path, typer.Option(help="file for the figures", metavar="FILE")] = RESULT,
) -> None:
    """Measure the firmware on the emulated board against its goals."""
    console = Console(highlight=False)
    if not console.is_terminal:
        console.width = _WIDTH
    console.print("making the frozen image, if it is not there (two minutes)")
    builds.frozen()
    began = time.monotonic()

    def run(cache: bool) -> dict[str, float]:
        name = "cache model on" if cache else "no cache misses"
        return measure(
            cache, lambda text: console.print(f"{time.monotonic() - began:5.0f} s  {name}: {text}")
        )

    with ThreadPoolExecutor(2) as pool:
        modelled, ideal = pool.map(run, (True, False))
    with EmulatedBoard(trace=False) as board:
        copied = Session(board).info.upload_frames
    parts = tick_cost.both()
    passes = loops()
    out.parent.mkdir(parents=True, exist_ok=True)
    out.write_text(json.dumps(modelled, indent=2) + "\n")
    console.print(table(modelled, ideal, explain))
    console.print(
        f"with copied files instead of a frozen image: {_number(copied)} frames (goal 5 000)"
    )
    console.print(loop_table(passes))
    console.print(tick_cost.table(parts))
    console.print(TRUST)
    console.print(f"figures with the cache model in {out}")


if __name__ == "__main__":
    app()
