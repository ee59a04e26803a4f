"""What is measured, one figure of figures.py after another."""

import re
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from ..bench.moves import WINDOW
from ..bench.session import Played
from ..client import RequestRefused, upload_requests
from ..errors import ToolError
from ..judge import Limits, judge
from ..payloads import (
    Hi,
    MotorGetPosition,
    MotorMove,
    MotorSetSpeed,
    MotorStatus,
    MotorStopAll,
    RtEnd,
    RtGo,
    RtRunMove,
)
from ..reference import Reference
from ..trace import Trace
from ..wire import encode
from .board import MOTORS_OF_A_BLOCK, Board
from .instrument import Edges

FIRST_HALF, SECOND_HALF = (1, 2, 3, 4), (5, 6, 7, 8)
STEEPEST = 4_000_000  # steps/s²
KEPT = 2000  # edges of a motor at constant velocity
CRUISE = 12_000  # steps at constant velocity
RATES = (5000, 3000, 1500, 600)  # steps/s of the four motors of a run
RAMP = 25_000  # steps/s²
RUN_S = 0.6
HELD = 2  # frames at both ends of a run: a motor that holds there needs no roll
ROLL_MS = 200
RUNS = {"frame_us_23976": 23_976, "frame_us_24": 24_000, "frame_us_60": 60_000}
TURNING_HZ, TURNING_RAMP = 5_000, 100_000
ASKED = 60
TICK_HZ = 20_000
UPLOADED = 800
WATCHED_S = 0.5
_WATCH = """
from time import ticks_diff, ticks_us
class Watch:
    def __init__(self):
        self.inner = boot.controller.poll
        self.count = self.sum = self.most = 0
    def poll(self, now):
        begun = ticks_us()
        busy = self.inner(now)
        took = ticks_diff(ticks_us(), begun)
        self.count += 1
        self.sum += took
        if took > self.most: self.most = took
        return busy
prove_watch = Watch()
boot.controller.poll = prove_watch.poll
"""
_WATCHED = """
del boot.controller.poll
print(prove_watch.count, prove_watch.sum, prove_watch.most)
del Watch, prove_watch
"""
_WRITE = """
import os
from time import ticks_diff, ticks_us
piece = bytes(256)
begun = ticks_us()
with open("/prove.tmp", "wb") as file:
    for _ in range(16): file.write(piece)
took = ticks_diff(ticks_us(), begun)
os.remove("/prove.tmp")
print(took)
"""
_WRAP_US = 1 << 32
_BREAK_US = 60  # a longer low on a DMX line is no slot
_TICK = re.compile(r"interrupts: (\d+) us .*, (\d+) us at a time")
_LATE = re.compile(r"worst lateness of a tick in motion: (\d+) us")


class Measuring:
    """Measures a board; the figures gather in `figures`. say: told what comes next. short: one
    half of the motors, and one frame rate."""

    def __init__(self, board: Board, say: Callable[[str], None], short: bool = False):
        self.board, self.client, self._say, self._short = board, board.client, say, short
        self.figures: dict[str, float] = {"steps_wrong": 0}
        self.complaints: list[str] = []

    def everything(self) -> dict[str, float]:
        """All of it, one after the other; motors stand again where they began."""
        stood = self._stands()
        begun = self._clocks()
        self.figures["upload_frames"] = self.board.info.upload_frames
        self.figures["heap_bytes"] = self.board.free_bytes
        halves = (FIRST_HALF,) if self._short else (FIRST_HALF, SECOND_HALF)
        for motors in halves:
            self._say(f"motors {motors[0]} to {motors[-1]} at 350 000 steps/s")
            self._steady(motors, 350_000, "rate_350k", "edge_350k_us")
        self._say("motor 8 at 500 000 steps/s")
        self._steady(SECOND_HALF[-1:], 500_000, "rate_500k", "edge_500k_us")
        for motors in halves:
            self._say(f"turns, retargets and a hard stop of motors {motors[0]} and {motors[1]}")
            self._turns(motors[:2])
        for key, fps_milli in list(RUNS.items())[: 1 if self._short else None]:
            for motors in halves:
                self._say(f"a run of motors {motors[0]} to {motors[-1]} at {fps_milli / 1000} fps")
                self._run_frames(motors, fps_milli, key)
        self._say("DMX, answers, an upload, the interrupt")
        self._dmx()
        self._replies()
        self._upload()
        self._passes()
        self._tick()
        self.figures["file_ms"] = int(self.board.run(_WRITE)) / 1000
        for motor, at in enumerate(stood, 1):
            self.client.request(MotorMove(motor, at))
        self.client.wait_idle()
        ended = self._clocks()
        host, own = ended[0] - begun[0], (ended[1] - begun[1]) % _WRAP_US
        self.figures["clock_ppm"] = own / host - 1e6
        return self.figures

    # ---- help

    def _stands(self) -> Sequence[int]:
        return self.client.request(MotorGetPosition()).steps[: 2 * MOTORS_OF_A_BLOCK]

    def _clocks(self) -> tuple[float, int]:
        """The host's clock in seconds, and the board's in microseconds, at one moment: of some
        looks, the one that took least."""
        looks = []
        for _ in range(5):
            before = self.client.clock()
            own = self.board.instrument.now_us()
            after = self.client.clock()
            looks.append((after - before, (before + after) / 2, own))
        _, host, own = min(looks)
        return host, own

    def _note(self, key: str, value: float, worst: Callable[..., float]) -> None:
        """Keep the worst of a figure that is measured more than once."""
        self.figures[key] = worst(value, self.figures.get(key, value))

    def _count(self, motor: int, made: int, moved: int) -> None:
        if made != moved:
            self.figures["steps_wrong"] += abs(made - moved)
            self.complaints.append(f"motor {motor}: {made} steps at its pin, {moved} reported")

    def _up(self, motor: int) -> int:
        """The level of a motor's direction pin when it counts up."""
        motors = self.board.rig.get("motors") or []
        inverted = motor <= len(motors) and bool((motors[motor - 1] or {}).get("invert"))
        return 0 if inverted else 1

    # ---- edges

    def _steady(self, motors: Sequence[int], rate: int, rate_key: str, edge_key: str) -> None:
        ramp = rate * rate // (2 * STEEPEST)
        way = 2 * ramp + CRUISE
        before = self._stands()

        try:
            for motor in motors:
                self.client.request(MotorSetSpeed(motor, rate, STEEPEST))
        except RequestRefused:
            self._say(f"left out: pulse_us of the rig file is too long for {rate} steps/s")
            return

        def move() -> None:
            for motor in motors:
                self.client.request(MotorMove(motor, before[motor - 1] + way))
            self.client.wait_idle()

        pins = [self.board.step(motor) for motor in motors]
        found = self.board.instrument.capture(
            self.board.watchers(motors[0]),
            pins,
            move,
            skip=ramp + CRUISE // 4,
            most=KEPT // 4 if self._short else KEPT,
        )
        after = self._stands()
        for motor, edges in zip(motors, found, strict=True):
            self._count(motor, edges.count, abs(after[motor - 1] - before[motor - 1]))
            times = edges.times_ns
            if len(times) < 2:
                raise ToolError(f"motor {motor} made no steps at its pin: is it in the rig file?")
            line = np.polyfit(np.arange(len(times)), times, 1)
            off = np.abs(times - np.polyval(line, np.arange(len(times)))).max()
            self._note(rate_key, 1e9 / float(line[0]), min)
            self._note(edge_key, float(off) / 1000, max)

    def _turns(self, motors: Sequence[int]) -> None:
        """To and fro: retargeted in motion, turned, stopped hard."""
        before = self._stands()
        client = self.client

        def move() -> None:
            for motor in motors:
                client.request(MotorSetSpeed(motor, TURNING_HZ, TURNING_RAMP))
            for way in (300, -100, 250):
                for motor in motors:
                    client.request(MotorMove(motor, before[motor - 1] + way))
                client.pump(0.04)
            client.wait_idle()
            for way in (0, 200):  # turned at rest, however slow the host is
                for motor in motors:
                    client.request(MotorMove(motor, before[motor - 1] + way))
                client.wait_idle()
            for motor in motors:
                client.request(MotorMove(motor, before[motor - 1] + 2000))
            client.pump(0.1)
            client.request(MotorStopAll())
            client.request(MotorStopAll())  # the second one is the hard stop (field note 4.4)
            client.wait_idle()

        board = self.board
        pins = [pin for m in motors for pin in (board.step(m), board.direction(m))]
        found = board.instrument.capture(board.watchers(motors[0]), pins, move, both=True)
        after = self._stands()
        for i, motor in enumerate(motors):
            steps, turns = found[2 * i], found[2 * i + 1]
            self._count(
                motor, self._signed(motor, steps, turns), after[motor - 1] - before[motor - 1]
            )
            wide = (steps.falls_ns - steps.rises_ns[: len(steps.falls_ns)]) / 1000
            self._note("pulse_us_least", float(wide.min()), min)
            self._note("pulse_us_most", float(wide.max()), max)
            later = np.searchsorted(steps.rises_ns, turns.times_ns)
            within = later < len(steps.rises_ns)
            setup = steps.rises_ns[later[within]] - turns.times_ns[within]
            if len(setup):
                self._note("setup_us_least", float(setup.min()) / 1000, min)

    def _signed(self, motor: int, steps: Edges, turns: Edges) -> int:
        """Steps up less steps down, by the level of the direction pin at each."""
        levels = turns.level ^ np.searchsorted(turns.times_ns, steps.rises_ns) & 1
        up = int(np.count_nonzero(levels == self._up(motor)))
        return up - (len(levels) - up)

    def _run_frames(self, motors: Sequence[int], fps_milli: int, key: str) -> None:
        client, board = self.client, self.board
        stands = self._stands()
        positions = {
            motor: steps * (1 if motor % 2 else -1) + stands[motor - 1]
            for motor, steps in zip(motors, trapezoids(fps_milli), strict=True)
        }
        for motor in motors:
            client.request(MotorSetSpeed(motor, 20_000, STEEPEST))
        count = len(positions[motors[0]])
        client.upload_move(1, count, positions, WINDOW)
        client.request(RtRunMove(fps_milli, 1, count, ROLL_MS, ROLL_MS))
        client.wait_idle()
        client.pump(0.05)
        before = self._stands()
        client.events.clear()
        host, own = self._clocks()
        gone: list[float] = []

        def play() -> None:
            gone.append(client.clock())
            client.request(RtGo())
            client.wait_event(RtEnd, 30)
            client.wait_idle()

        pins = [board.step(motor) for motor in motors]
        found = board.instrument.capture(board.watchers(motors[0]), pins, play)
        after = self._stands()
        signals = {}
        for motor, edges in zip(motors, found, strict=True):
            sign = 1 if motor % 2 else -1
            self._count(motor, sign * edges.count, after[motor - 1] - before[motor - 1])
            times = edges.times_ns.astype(np.int64)
            signals[f"m{motor}"] = times, np.full(len(times), sign, np.int64)
        path = Reference(positions, fps_milli, ROLL_MS, ROLL_MS)
        start = {motor: before[motor - 1] for motor in motors}
        verdict = judge(
            Trace(signals), positions, fps_milli, start, None, path, limits=Limits(velocity_share=1)
        )
        self.complaints += [f"{fps_milli / 1000} fps: {text}" for text in verdict.complaints]
        played = Played(verdict, path, {}, 0, [])
        self._note(key, verdict.worst_time_us, max)
        self._note("edge_ramp_us", float(np.nanmax(played.errors_us(ramps=True))), max)
        self._note("edge_steady_us", float(np.nanmax(played.errors_us(ramps=False))), max)
        began = (board.instrument.begun_us - own) % _WRAP_US / 1000 + verdict.origin_ns / 1e6
        self._note("go_ms", began - (gone[0] - host) * 1000 - ROLL_MS, max)

    def _dmx(self) -> None:
        """The frames on the pin of DMX, all levels 0: each slot is low for 36 µs and high for 8."""
        wiring = self.board.data.get("dmx")
        if not wiring or self.board.rig.get("dmx") is False:
            return
        pin = wiring["tx"]
        seen = self.board.instrument.capture(1, [pin], lambda: self.client.pump(0.06), both=True)[0]
        rises, falls = seen.rises_ns / 1000, seen.falls_ns / 1000
        rises = rises[np.searchsorted(rises, falls[0]) :]
        count = min(len(rises), len(falls) - 1)
        low, high = rises[:count] - falls[:count], falls[1 : count + 1] - rises[:count]
        breaks = np.flatnonzero(low > _BREAK_US)
        if not len(breaks):
            self.complaints.append("no break was seen on the pin of DMX")
            return
        self.figures["dmx_break_us"] = float(np.median(low[breaks]))
        self.figures["dmx_mark_us"] = float(np.median(high[breaks]))
        self.figures["dmx_slot_us"] = float(np.median((low + high)[low < _BREAK_US]))

    # ---- the processor, the ports, memory

    def _turning(self, seconds: float) -> None:
        """Four motors on their way for so long at least."""
        stands = self._stands()
        for motor in FIRST_HALF:
            self.client.request(MotorSetSpeed(motor, TICK_HZ, STEEPEST))
            self.client.request(
                MotorMove(motor, stands[motor - 1] + round(TICK_HZ * (seconds + 0.2)))
            )

    def _replies(self) -> None:
        client = self.client
        self._turning(ASKED * 0.015)
        kinds = (MotorStatus, MotorGetPosition, Hi)
        taken = []
        for i in range(ASKED):
            begun = client.clock()
            client.answer_to(client.send(kinds[i % len(kinds)]()))
            taken.append(1000 * (client.clock() - begun))
            client.pump(0.0005 * (i % 7))  # at any moment of the board's passes
        client.request(MotorStopAll())
        client.wait_idle()
        self.figures["reply_ms_median"] = float(np.median(taken))
        self.figures["reply_ms_most"] = max(taken)

    def _upload(self) -> None:
        client = self.client
        t = np.arange(UPLOADED)
        positions: Mapping[int, np.ndarray] = {
            motor: (100 * motor * np.sin(t / 300)).astype(np.int64)
            for motor in FIRST_HALF + SECOND_HALF
        }
        requests = list(upload_requests(1, UPLOADED, positions))
        size = sum(len(encode(request.TYPE, request.pack(), 1)) for request in requests[1:-1])
        client.request(requests[0])
        begun = client.clock()
        client.stream(requests[1:-1], WINDOW)
        self.figures["upload_bytes_s"] = size / (client.clock() - begun)
        client.request(requests[-1])

    def _passes(self) -> None:
        """Passes of the main loop while four motors move, by something that counts around each."""
        self._turning(WATCHED_S)
        self.client.pump(0.1)
        begun = self.client.clock()
        self.board.run(_WATCH)
        self.client.pump(WATCHED_S / 2)
        count, total, most = map(int, self.board.run(_WATCHED).split())
        took = self.client.clock() - begun
        self.client.request(MotorStopAll())
        self.client.wait_idle()
        self.figures["passes_s"] = count / took
        self.figures["pass_us"] = total / count
        self.figures["pass_us_most"] = most

    def _tick(self) -> None:
        self._turning(1.0)
        said = self.board.run("from framestep.repl import timing\ntiming()")
        self.client.request(MotorStopAll())
        self.client.wait_idle()
        cost, late = _TICK.search(said), _LATE.search(said)
        if not cost or not late:
            raise ToolError(f"timing() on the board's REPL said something else: {said.strip()}")
        self.figures["tick_us"], self.figures["tick_us_most"] = map(float, cost.groups())
        self.figures["late_us"] = float(late[1])


def trapezoids(fps_milli: int) -> list[np.ndarray]:
    """Positions of four motors, frame by frame: from rest to their RATES, and to rest again."""
    t = np.arange(round(RUN_S * fps_milli / 1000) + 1) * 1000 / fps_milli
    total = t[-1]
    moves = []
    for rate in RATES:
        ramp = min(rate / RAMP, total / 2)
        up, down = np.minimum(t, ramp), np.clip(t - (total - ramp), 0, None)
        way = RAMP * (up * up - down * down) / 2
        way += RAMP * ramp * (np.clip(t - ramp, 0, total - 2 * ramp) + down)
        steps = np.floor(way + 0.25).astype(np.int64)
        moves.append(np.concatenate(([0] * HELD, steps, [steps[-1]] * HELD)))
    return moves
