"""What is measured, one figure of figures.py after another."""

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress

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
from . import flash
from .board import Board
from .borrowed import BLOCK_MACHINES
from .check import check
from .instrument import Edges

DEFAULT_PULSE_US = 1.0
STEADY_HZ, FASTEST_HZ = 350_000, 500_000
STEEPEST = 4_000_000  # steps/s²
KEPT = 2000  # edges of a motor at constant velocity
CRUISE, SHORT_CRUISE = 12_000, 4_000  # steps at constant velocity
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
_WRAP_US = 1 << 32
_BREAK_US = 60  # a longer low on a DMX line is no slot
_TICK = re.compile(r"interrupts: (\d+) us .*, (\d+) us at a time")
_LATE = re.compile(r"worst lateness of a tick in motion: (\d+) us")


class Measuring:
    """Measures a board; the figures gather in `figures`. say: told what comes next. short: the
    motors of one PIO block, and one frame rate."""

    def __init__(self, board: Board, say: Callable[[str], None], short: bool = False):
        self.board, self.client, self._say, self._short = board, board.client, say, short
        self.figures: dict[str, float] = {"steps_wrong": 0}
        self.complaints: list[str] = []
        self._began_at: Sequence[int] = ()

    def everything(self) -> dict[str, float]:
        """All of it, one after the other; motors stand again where they began. ToolError before
        anything moves where something would keep them from it."""
        layout = self.board.layout
        self._began_at = self._stands()
        check(self.client, layout.measured, self._began_at)
        begun = self._clocks()
        self.figures["upload_frames"] = self.board.info.upload_frames
        self.figures["heap_bytes"] = self.board.free_bytes
        for motor, why in layout.left_out.items():
            self._say(f"motor {motor} is left out: it {why}")
        groups = layout.groups[: 1 if self._short else None]
        for motors in groups:
            self._say(f"{_named(motors)} at 350 000 steps/s")
            self._steady(motors, STEADY_HZ, "rate_350k", "edge_350k_us")
        self._together()
        last = layout.measured[-1:]
        self._say(f"{_named(last)} at 500 000 steps/s")
        self._steady(last, FASTEST_HZ, "rate_500k", "edge_500k_us")
        for motors in groups:
            self._say(f"turns, retargets and a hard stop of {_named(motors[:2])}")
            self._turns(motors[:2])
        for key, fps_milli in list(RUNS.items())[: 1 if self._short else None]:
            for motors in groups:
                self._say(f"a run of {_named(motors)} at {fps_milli / 1000} fps")
                self._run_frames(motors, fps_milli, key)
        self._say("DMX, answers, an upload, the interrupt")
        self._dmx()
        self._replies()
        self._upload()
        self._passes()
        self._tick(layout.groups[0], "tick_us", "tick_us_most")
        self._tick(layout.measured, "tick_all_us", "tick_all_us_most")
        self._flash()
        self._go_back()
        ended = self._clocks()
        host, own = ended[0] - begun[0], (ended[1] - begun[1]) % _WRAP_US
        self.figures["clock_ppm"] = own / host - 1e6
        return self.figures

    # ---- help

    def _stands(self) -> Sequence[int]:
        return self.client.request(MotorGetPosition()).steps[: self.board.layout.motors]

    def _go_back(self) -> None:
        """Every motor to where it stood at the begin, fast if its pulses allow it."""
        for motor in self.board.layout.measured:
            with suppress(RequestRefused):
                self.client.request(MotorSetSpeed(motor, STEADY_HZ, STEEPEST))
            self.client.request(MotorMove(motor, self._began_at[motor - 1]))
        self.client.wait_idle()

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

    def _away(self, motor: int, stands: Sequence[int], way: int) -> int:
        """So many steps from where a motor stands: back where that is not past its begin, so that
        it stays near that."""
        at = stands[motor - 1]
        return at - way if at - way >= self._began_at[motor - 1] else at + way

    def _up(self, motor: int) -> int:
        """The level of a motor's direction pin when it counts up."""
        return 0 if self.board.settings(motor).get("invert") else 1

    # ---- edges

    def _watched(
        self, moving: Sequence[int], pins_of_one: int = 1, only: Sequence[int] = ()
    ) -> Iterator[tuple[list[int], Sequence[int]]]:
        """Which state machines watch which of these motors (or only those), so many pins of each;
        with few machines some motors at a time."""
        machines = self.board.layout.watchers(moving)
        at_once = min(len(machines), BLOCK_MACHINES) // pins_of_one
        watched = only or moving
        for begin in range(0, len(watched), at_once):
            yield machines, watched[begin : begin + at_once]

    def _steady(
        self,
        motors: Sequence[int],
        rate: int,
        rate_key: str,
        edge_key: str,
        only: Sequence[int] = (),
    ) -> None:
        """Motors at a rate, all of them watched or only some."""
        try:
            for motor in motors:
                self.client.request(MotorSetSpeed(motor, rate, STEEPEST))
        except RequestRefused:
            self._say(f"left out: pulse_us of the rig file is too long for {rate} steps/s")
            return
        for machines, watched in self._watched(motors, only=only):
            self._cruise(motors, machines, watched, rate, rate_key, edge_key)

    def _cruise(
        self,
        motors: Sequence[int],
        machines: Sequence[int],
        watched: Sequence[int],
        rate: int,
        rate_key: str,
        edge_key: str,
    ) -> None:
        """Motors at this rate, which has been set; some of them are watched."""
        ramp = rate * rate // (2 * STEEPEST)
        cruise = SHORT_CRUISE if self._short else CRUISE
        before = self._stands()

        def move() -> None:
            for motor in motors:
                self.client.request(MotorMove(motor, self._away(motor, before, 2 * ramp + cruise)))
            self.client.wait_idle()

        found = self.board.instrument.capture(
            machines,
            [self.board.step(motor) for motor in watched],
            move,
            skip=ramp + cruise // 4,
            most=KEPT // 4 if self._short else KEPT,
        )
        after = self._stands()
        for motor, edges in zip(watched, found, strict=True):
            self._count(motor, edges.count, abs(after[motor - 1] - before[motor - 1]))
            times = edges.times_ns
            if len(times) < 2:
                raise ToolError(f"motor {motor} made no steps at its pin: is it in the rig file?")
            line = np.polyfit(np.arange(len(times)), times, 1)
            off = np.abs(times - np.polyval(line, np.arange(len(times)))).max()
            self._note(rate_key, 1e9 / float(line[0]), min)
            self._note(edge_key, float(off) / 1000, max)

    def _together(self) -> None:
        """As many motors at once as can be watched: all, if machines are left that no motor has;
        else all but one, whose machine watches one of the others."""
        motors = self.board.layout.measured
        keys = "rate_together", "edge_together_us"
        if self.board.layout.watchers(motors):
            self._say(f"{_named(motors)} at once")
            self._steady(motors, STEADY_HZ, *keys)
            return
        self._say(f"{len(motors) - 1} of {_named(motors)} at once")
        for motor in (motors[0], motors[-1]) if self._short else motors:
            rests = motors[0] if motor == motors[-1] else motors[-1]
            moving = [m for m in motors if m != rests]
            self._steady(moving, STEADY_HZ, *keys, only=[motor])

    def _turns(self, motors: Sequence[int]) -> None:
        """To and fro: retargeted in motion, turned, stopped hard."""
        for machines, watched in self._watched(motors, pins_of_one=2):
            self._turn(machines, watched)

    def _turn(self, machines: Sequence[int], motors: Sequence[int]) -> None:
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
        found = board.instrument.capture(machines, pins, move, both=True)
        after = self._stands()
        for i, motor in enumerate(motors):
            steps, turns = found[2 * i], found[2 * i + 1]
            self._count(
                motor, self._signed(motor, steps, turns), after[motor - 1] - before[motor - 1]
            )
            if board.settings(motor).get("pulse_us", DEFAULT_PULSE_US) == DEFAULT_PULSE_US:
                wide = (steps.falls_ns - steps.rises_ns[: len(steps.falls_ns)]) / 1000
                self._note("pulse_us_least", float(wide.min()), min)
                self._note("pulse_us_most", float(wide.max()), max)
            self._note("turns_rate_most", 1e9 / float(np.diff(steps.rises_ns).min()), max)
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
        stands = self._stands()
        positions = {
            motor: steps * (1 if motor % 2 else -1) + stands[motor - 1]
            for motor, steps in zip(motors, trapezoids(fps_milli), strict=False)
        }
        for machines, watched in self._watched(motors):
            self._run_once(positions, machines, watched, fps_milli, key)

    def _run_once(
        self,
        positions: Mapping[int, np.ndarray],
        machines: Sequence[int],
        motors: Sequence[int],
        fps_milli: int,
        key: str,
    ) -> None:
        """A run of all these positions, of which those of some motors are watched."""
        client, board = self.client, self.board
        for motor in positions:
            client.request(MotorSetSpeed(motor, 20_000, STEEPEST))
        count = len(next(iter(positions.values())))
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
        found = board.instrument.capture(machines, pins, play)
        after = self._stands()
        signals = {}
        for motor, edges in zip(motors, found, strict=True):
            sign = 1 if motor % 2 else -1
            self._count(motor, sign * edges.count, after[motor - 1] - before[motor - 1])
            times = edges.times_ns.astype(np.int64)
            signals[f"m{motor}"] = times, np.full(len(times), sign, np.int64)
        seen = {motor: positions[motor] for motor in motors}
        path = Reference(seen, fps_milli, ROLL_MS, ROLL_MS)
        start = {motor: before[motor - 1] for motor in motors}
        verdict = judge(
            Trace(signals), seen, fps_milli, start, None, path, limits=Limits(velocity_share=1)
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
        machines = self.board.layout.watchers(())
        seen = self.board.instrument.capture(
            machines, [pin], lambda: self.client.pump(0.06), both=True
        )[0]
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

    def _turning(self, seconds: float, motors: Sequence[int] = ()) -> None:
        """These motors, or the first four, on their way for so long at least."""
        stands = self._stands()
        for motor in motors or self.board.layout.groups[0]:
            way = round(TICK_HZ * (seconds + 0.2))
            self.client.request(MotorSetSpeed(motor, TICK_HZ, STEEPEST))
            self.client.request(MotorMove(motor, self._away(motor, stands, way)))

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
            for motor in range(1, self.board.layout.motors + 1)
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

    def _tick(self, motors: Sequence[int], mean_key: str, most_key: str) -> None:
        self._turning(1.0, motors)
        said = self.board.run("from framestep.repl import timing\ntiming()")
        self.client.request(MotorStopAll())
        self.client.wait_idle()
        cost, late = _TICK.search(said), _LATE.search(said)
        if not cost or not late:
            raise ToolError(f"timing() on the board's REPL said something else: {said.strip()}")
        self.figures[mean_key], self.figures[most_key] = map(float, cost.groups())
        self.figures["late_us"] = float(late[1])

    def _flash(self) -> None:
        found = flash.measure(self.board.run)
        for key, value in found._asdict().items():
            if value is not None:
                self.figures[key] = value


def _named(motors: Sequence[int]) -> str:
    """Such as "motor 3" or "motors 1, 2"."""
    return f"motor{'s' * (len(motors) > 1)} {', '.join(map(str, motors))}"


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
