"""Measurement of each figure."""

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from typing import Any

import numpy as np

from framestep.protocol import messages

from ..building.board_files import board_data
from ..client.client import Client, upload_requests
from ..client.wire import encode
from ..errors import ToolError
from ..judge.virtual_reference import Axis, Rig
from ..payloads import (
    Ack,
    Hi,
    MotorGetPosition,
    MotorMove,
    MotorResetPosition,
    MotorSetSpeed,
    MotorStatus,
    MotorStopAll,
    Positions,
    Request,
    RtEnd,
    RtGo,
    RtRunMove,
    RtUploadMoveDmx,
    RtUploadMoveEnd,
    RtUploadMoveTriggers,
    Trigger,
    VirtConfig,
    VirtJogOnLine,
    VirtMove,
    VirtStop,
)
from ..simulator.boards import EmulatedBoard
from .figures import FIGURES
from .lateness import worst_late_us
from .moves import MOTORS, READY_S, STEADY_RATES, STEEPEST, WINDOW, mixed_move
from .rates import rates_by_edges, top_rate
from .session import Session
from .smoothness import smoothing_figures
from .stops import (
    APART_NS,
    planned_stops,
    stops_amid_requests,
    stops_in_jogs,
    stops_in_moves,
    stops_in_run,
    stops_in_shot,
)
from .virtual_cost import virtual_update_us

_CHANNELS = 512
SMALL_BYTES = 5 + 4 * 16  # a section of 16 positions
SMALL_FRAMES = 2000
# figures that each run of the tests compares with the record
QUICK = (
    "upload_frames_8",
    "rx_bytes_per_s",
    "rx_bytes_per_s_small",
    "tick_us_8",
    "reply_ms_median",
)
LEVELS_AT_ONCE = 1000
PLAYS = 4  # of the mixed move, because one has too few replies for a median
TRIGGERS_AT_ONCE = 100
PULSE_US = 0.5
AT_ONCE = 40  # requests without pauses, right after GO
# moves that are played for GO: motors, frames per second, pre-roll in ms, steps/s
GO_MOVES = (
    (1, 100, 20, 10_000),
    (8, 100, 20, 10_000),
    (4, 25, 100, 5_000),
    (8, 60, 50, 12_000),
    (2, 24, 40, 2_400),
    (6, 30, 200, 15_000),
)
GO_RUNS = 400
APART_MS = 0.05
# the rig of the virtual motions: steps per degree or millimetre, and the host's pose
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
# steps of its motors in that pose: boom at 3 degrees, swing at 10
ARM_STANDS = (750, 3_000, 0, -2_500, -750, 0)
ARM_SPEED = (20_000, 50_000)  # steps/s, steps/s²
# What virtual_stops() stops, and after how many seconds
_ON_LINE = (
    (VirtMove(messages.VIRT_MOTOR_EW, 98 * 100_000), 0.2),
    (VirtJogOnLine(messages.LINE_X, -8000), 0.6),
)


def upload_rate(
    session: Session,
    frames: int,
    during: AbstractContextManager[Any] | None = None,
    section_bytes: int = messages.LARGEST_PAYLOAD,
) -> float:
    """Return bytes per second of an upload for all motors, while they move."""
    client = session.client
    t = np.arange(frames)
    positions = {
        motor: (100 * motor * np.sin(t / 300)).astype(np.int64)
        for motor in range(1, session.info.motors + 1)
    }
    first, *sections, last = upload_requests(1, frames, positions, section_bytes)
    size = sum(len(encode(request.TYPE, request.pack(), 1)) for request in sections)
    for motor, stands in session.positions.items():
        client.request(MotorSetSpeed(motor, 5000, 5000))
        client.request(MotorMove(motor, stands + 100_000))
    client.pump(0.2)
    client.request(first)
    client.events.clear()
    begun = client.clock()
    with during or nullcontext():
        client.stream(sections, WINDOW)
    took = client.clock() - begun
    if not any(isinstance(event.message, Positions) for event in client.events):
        raise ToolError("no positions were reported during the upload")
    client.request(last)
    client.request(MotorStopAll())
    client.wait_idle()
    return size / took


def go_times(session: Session, runs: int = GO_RUNS) -> list[float]:
    """Return the times from writing GO to the start of motion, in ms, for runs of GO_MOVES in turn.

    The pre-roll is a ramp from rest: its n-th edge comes √(2·T·n/v) after its start.
    """
    client, board = session.client, session.board
    random = np.random.default_rng(1)
    found = []
    for index, (motors, fps, roll_ms, rate) in enumerate(GO_MOVES):
        stands = session.positions
        frames = 3
        steps = rate // fps * np.arange(frames)
        for motor in range(1, motors + 1):
            client.request(MotorSetSpeed(motor, 2 * rate, STEEPEST))
        client.upload_move(1, frames, {m: stands[m] + steps for m in range(1, motors + 1)})
        edges = np.arange(1, 21)
        behind_ms = np.sqrt(2 * roll_ms * edges / (rate / 1000))
        pins = board.pins.step[:motors]
        for _ in range(len(range(index, runs, len(GO_MOVES)))):
            client.request(RtRunMove(1000 * fps, 1, frames, roll_ms, roll_ms))
            client.wait_idle()
            client.pump(READY_S + random.uniform(0, 0.005))
            board.emulator.trace_start(pins)
            begun_ns = board.now_ns
            client.request(RtGo())
            client.wait_event(RtEnd, 10)
            records = board.emulator.trace_stop()
            client.wait_idle()  # on the end frame again
            starts = []
            for pin in pins:
                rising = records["t"][(records["pin"] == pin) & (records["level"] == 1)]
                ms = (rising[: len(edges)].astype(float) - begun_ns) / 1e6
                starts.append(float(np.median(ms - behind_ms)))
            if max(starts) - min(starts) > APART_MS:
                raise ToolError(f"motors of one GO start {max(starts) - min(starts)} ms apart")
            found.append(float(np.median(starts)))
    return found


def light_channels(session: Session, frames: int) -> int:
    """Return how many channels with a random level at each frame fit next to eight motors and a
    trigger on each frame."""
    client = session.client
    random = np.random.default_rng(1)
    t = np.arange(frames)
    positions = {
        motor: np.rint(800 * np.sin(t / (20 + 3 * motor))).astype(np.int64)
        for motor in range(1, MOTORS + 1)
    }
    triggers = [
        RtUploadMoveTriggers(3, [Trigger(int(i), int(i % 3) + 1) for i in part])
        for part in np.array_split(t, 1 + frames // TRIGGERS_AT_ONCE)
    ]
    client.stream(list(upload_requests(1, frames, positions, lights=triggers))[:-1], WINDOW)
    for channel in range(1, _CHANNELS + 1):
        levels = random.integers(0, 256, frames).tolist()
        for at in range(0, frames, LEVELS_AT_ONCE):
            section = RtUploadMoveDmx(channel, at, levels[at : at + LEVELS_AT_ONCE])
            if client.code(section) != Ack.OK:
                client.request(RtUploadMoveEnd())
                return channel - 1
    client.request(RtUploadMoveEnd())
    return _CHANNELS


def rig_of(mhz: int, board: str = "pico") -> dict[str, Any]:
    """Return the rig file of a board with eight motors at a clock of the processor."""
    rig: dict[str, Any] = {"clock_mhz": mhz, "motors": [{"pulse_us": PULSE_US}] * MOTORS}
    if len(board_data(board)["step"]) != MOTORS:
        rig["motor_count"] = MOTORS
    return rig


def first_figures(
    session: Session, mhz: int, say: Callable[[str], None] = lambda text: None
) -> dict[str, float]:
    """Measure the figures that take little time, on a board that has just come up. Each run of the
    tests compares them with the record."""
    figures: dict[str, float] = {"upload_frames_8": session.info.upload_frames}
    say("upload")
    figures["rx_bytes_per_s"] = upload_rate(session, session.info.upload_frames)
    say("lights and triggers")
    figures["light_channels_with_2000_frames"] = light_channels(session, 2000)
    say("mixed move")
    return figures | _mixed(session, mhz)


def measure(
    mhz: int, cache: bool, say: Callable[[str], None], board: str = "pico"
) -> dict[str, float]:
    """Measure all figures at a clock of the processor, with the flash-cache model or without."""
    args = [] if cache else ["--xip-miss", "0"]
    rig = rig_of(mhz, board)
    say("booting the frozen image")
    with EmulatedBoard(rig, trace=False, board=board, args=args) as emulated:
        session = Session(emulated)
        figures = first_figures(session, mhz, say)
        say(f"GO, {GO_RUNS} times")
        times = go_times(session)
        figures["go_ms_median"] = float(np.median(times))
        figures["go_ms_spread"] = max(times) - min(times)
        say("stops")
        times = stops_in_moves(session) + stops_amid_requests(session)
        times += stops_in_run(session, mixed_move(), max(STEADY_RATES) * 11 // 10)
        times += stops_in_shot(session, max(STEADY_RATES))
        times += stops_in_jogs(session, max(STEADY_RATES))
        figures["stop_ms_worst"] = max(times)
        figures["virtual_stop_ms_worst"] = max(virtual_stops(session))
        say("virtual axes")
        figures["virtual_update_us"] = virtual_update_us(session.repl)
        figures["virtual_reply_ms_max"] = max(virtual_replies(session))
        figures["tick_late_us_worst"] = worst_late_us(session, ARM, ARM_SPEED)
        figures["steps_per_s_8"] = top_rate(session, MOTORS, say)
        figures["steps_per_s_1"] = top_rate(session, 1, say)
        say("upload in small sections")
        rate = upload_rate(session, SMALL_FRAMES, section_bytes=SMALL_BYTES)
        figures["rx_bytes_per_s_small"] = rate
    with EmulatedBoard(rig, trace=False, board=board, args=args) as emulated:
        # a board of its own, as what it types on the REPL takes most of the memory
        figures |= rates_by_edges(Session(emulated), say)
    say("upload through a single port")
    with EmulatedBoard({**rig, "ports": 1}, trace=False, board=board, args=args) as emulated:
        figures["rx_bytes_per_s_single_port"] = upload_rate(Session(emulated), 1000)
    figures |= smoothing_figures(rig, args, say, board)
    return {figure.key: figures[figure.key] for figure in FIGURES}


class Asker:
    """Sends a request when it is called, and notes the answer's delay in `ms`."""

    KINDS: tuple[type[Request[Any]], ...] = (MotorStatus, MotorGetPosition, Hi)

    def __init__(self, client: Client, at_once: int = AT_ONCE, seed: int = 1):
        """at_once: number of requests without pauses; later ones come at random moments."""
        self.client = client
        self.at_once = at_once
        self.ms: list[float] = []
        self._random = np.random.default_rng(seed)

    def __call__(self) -> None:
        client = self.client
        if len(self.ms) >= self.at_once:
            client.pump(self._random.uniform(0.001, 0.02))
        self.ask()

    def ask(self) -> None:
        """Send the next request now."""
        client = self.client
        begun = client.clock()
        client.answer_to(client.send(self.KINDS[len(self.ms) % len(self.KINDS)]()))
        self.ms.append(1000 * (client.clock() - begun))

    def until_idle(self) -> None:
        """Send requests until nothing moves."""
        while not self.client.request(MotorStatus()).idle:
            self()


def _take_arm(session: Session) -> None:
    """Configure the rig ARM with its motors at ARM_STANDS."""
    client = session.client
    for axis, step in zip(ARM.axes, ARM_STANDS, strict=True):
        client.request(MotorSetSpeed(axis.motor, *ARM_SPEED))
        client.request(MotorResetPosition(axis.motor, step))
    client.request(VirtConfig.unpack(ARM.payload()))


def virtual_stops(session: Session, apart_ns: int = APART_NS) -> list[float]:
    """Return how long it takes from STOP_ALL, or a STOP, until a rig is slower that moves or jogs
    along a line, in ms. apart_ns: between the moments."""
    times = []
    for start, steady_s in _ON_LINE:
        _take_arm(session)
        times += planned_stops(session, [start], steady_s, apart_ns)
        session.client.request(VirtConfig.unpack(b"\0"))
    return times


def virtual_replies(session: Session) -> list[float]:
    """Return the delays of answers while a rig moves along lines, in ms."""
    client = session.client
    _take_arm(session)
    ask = Asker(client)
    (move, _), (on_line, _) = _ON_LINE
    client.request(move)
    ask.until_idle()
    jog = Asker(client)
    client.request(on_line)
    begun = client.clock()
    while client.clock() - begun < 1:
        jog()
    client.request(VirtStop(messages.VIRT_MOTOR_EW))
    jog.until_idle()
    # none, else later measurements would report virtual positions as well
    client.request(VirtConfig.unpack(b"\0"))
    return ask.ms + jog.ms


def _mixed(session: Session, mhz: int) -> dict[str, float]:
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
    replies = [ask.ms]
    for seed in range(2, PLAYS + 1):
        ask = Asker(client, seed=seed)
        session.play(session.prepare(mixed_move(), max(STEADY_RATES) * 11 // 10), ask)
        replies.append(ask.ms)
    return {
        "edge_error_steady_us": float(np.nanmax(played.errors_us(ramps=False))),
        "edge_error_ramp_us": float(np.nanmax(played.errors_us(ramps=True))),
        "frame_error_us": played.verdict.worst_time_us,
        "tick_us_8": ticks["cycles"] / mhz / played.measured["ms"],
        "cpu_load_8_percent": 100 * played.measured["load"],
        "reply_ms_median": float(np.median([ms for each in replies for ms in each[AT_ONCE:]])),
        "reply_ms_max": max(ms for each in replies for ms in each),
        "heap_bytes_per_hour": (taken[2] - 2 * taken[1] + taken[0]) / hours,
    }
