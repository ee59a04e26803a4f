"""Measurements at the pins: steps, edges, pulses, runs, DMX."""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from ..bench.moves import WINDOW
from ..bench.session import Played
from ..client.client import RequestRefused
from ..errors import ToolError
from ..judge.judge import Limits, judge
from ..judge.reference import Reference
from ..judge.trace import Trace
from ..payloads import MotorMove, MotorSetSpeed, MotorStopAll, RtEnd, RtGo, RtRunMove
from .borrowed_machines import BLOCK_MACHINES
from .collector import STEEPEST, WRAP_US, Gathering, named
from .pin_capture import Edges

DEFAULT_PULSE_US = 1.0
STEADY_HZ, FASTEST_HZ = 350_000, 500_000
KEPT = 2000  # edges of a motor at constant velocity
CRUISE, SHORT_CRUISE = 12_000, 4_000  # steps at constant velocity
RATES = (5000, 3000, 1500, 600)  # steps/s of the four motors of a run
RAMP = 25_000  # steps/s²
RUN_S = 0.6
HELD = 2  # frames at rest at both ends of a run, so the motors need no roll
ROLL_MS = 200
TURNING_HZ, TURNING_RAMP = 5_000, 100_000
_BREAK_US = 60  # a longer low on a DMX line is a break


class Pins(Gathering):
    """Watches pins while motors move."""

    def _watched(
        self, moving: Sequence[int], pins_of_one: int = 1, only: Sequence[int] = ()
    ) -> Iterator[tuple[list[int], Sequence[int]]]:
        """Yield state machines with the moving motors (or only `only`) that they watch.

        If there are few machines, they watch some motors at a time.
        """
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
        """Measure motors at a rate, all of them or only some."""
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
        """Move motors at this rate, which has been set, and watch some of them."""
        ramp = rate * rate // (2 * STEEPEST)
        cruise = SHORT_CRUISE if self._short else CRUISE
        before = self._positions()

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
        after = self._positions()
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
        """Measure as many motors at once as possible: all, if there are machines without a motor,
        else all but one, whose machine watches one of the others."""
        motors = self.board.layout.measured
        keys = "rate_together", "edge_together_us"
        if self.board.layout.watchers(motors):
            self._say(f"{named(motors)} at once")
            self._steady(motors, STEADY_HZ, *keys)
            return
        self._say(f"{len(motors) - 1} of {named(motors)} at once")
        for motor in (motors[0], motors[-1]) if self._short else motors:
            rests = motors[0] if motor == motors[-1] else motors[-1]
            moving = [m for m in motors if m != rests]
            self._steady(moving, STEADY_HZ, *keys, only=[motor])

    def _turns(self, motors: Sequence[int]) -> None:
        """Measure motions to and fro: retargeted in motion, turned, stopped hard."""
        for machines, watched in self._watched(motors, pins_of_one=2):
            self._turn(machines, watched)

    def _turn(self, machines: Sequence[int], motors: Sequence[int]) -> None:
        before = self._positions()
        client = self.client

        def move() -> None:
            for motor in motors:
                client.request(MotorSetSpeed(motor, TURNING_HZ, TURNING_RAMP))
            for way in (300, -100, 250):
                for motor in motors:
                    client.request(MotorMove(motor, before[motor - 1] + way))
                client.pump(0.04)
            client.wait_idle()
            for way in (0, 200):  # turned at rest, even if the host is slow
                for motor in motors:
                    client.request(MotorMove(motor, before[motor - 1] + way))
                client.wait_idle()
            for motor in motors:
                client.request(MotorMove(motor, before[motor - 1] + 2000))
            client.pump(0.1)
            client.request(MotorStopAll())
            client.request(MotorStopAll())  # the second STOP_ALL is the hard stop (field note 4.4)
            client.wait_idle()

        board = self.board
        pins = [pin for m in motors for pin in (board.step(m), board.direction(m))]
        found = board.instrument.capture(machines, pins, move, both=True)
        after = self._positions()
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
        """Return steps up minus steps down, by the level of the direction pin at each."""
        levels = turns.level ^ np.searchsorted(turns.times_ns, steps.rises_ns) & 1
        up = int(np.count_nonzero(levels == self._up(motor)))
        return up - (len(levels) - up)

    def _run_frames(self, motors: Sequence[int], fps_milli: int, key: str) -> None:
        origins = self._positions()
        positions = {
            motor: steps * (1 if motor % 2 else -1) + origins[motor - 1]
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
        """Play these positions, and watch some of the motors."""
        client, board = self.client, self.board
        for motor in positions:
            client.request(MotorSetSpeed(motor, 20_000, STEEPEST))
        count = len(next(iter(positions.values())))
        client.upload_move(1, count, positions, WINDOW)
        client.request(RtRunMove(fps_milli, 1, count, ROLL_MS, ROLL_MS))
        client.wait_idle()
        client.pump(0.05)
        before = self._positions()
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
        after = self._positions()
        signals = {}
        for motor, edges in zip(motors, found, strict=True):
            sign = 1 if motor % 2 else -1
            self._count(motor, sign * edges.count, after[motor - 1] - before[motor - 1])
            times = edges.times_ns.astype(np.int64)
            signals[f"m{motor}"] = times, np.full(len(times), sign, np.int64)
        seen = {motor: positions[motor] for motor in motors}
        smooth = board.rig.get("smoothing", True)
        path = Reference(seen, fps_milli, ROLL_MS, ROLL_MS, smooth=smooth)
        start = {motor: before[motor - 1] for motor in motors}
        verdict = judge(
            Trace(signals),
            seen,
            fps_milli,
            start,
            None,
            path,
            limits=Limits(velocity_share=1),
            smooth=smooth,
        )
        self.complaints += [f"{fps_milli / 1000} fps: {text}" for text in verdict.complaints]
        played = Played(verdict, path, {}, 0, [])
        self._note(key, verdict.worst_time_us, max)
        self._note_largest("edge_ramp_us", played.errors_us(ramps=True))
        # none if the frames of no motor are equally many steps apart: smoothing bends its path
        self._note_largest("edge_steady_us", played.errors_us(ramps=False))
        began = (board.instrument.begun_us - own) % WRAP_US / 1000 + verdict.origin_ns / 1e6
        self._note("go_ms", began - (gone[0] - host) * 1000 - ROLL_MS, max)

    def _note_largest(self, key: str, values: np.ndarray) -> None:
        """Note the largest value, if there is any."""
        if not np.isnan(values).all():
            self._note(key, float(np.nanmax(values)), max)

    def _dmx(self) -> None:
        """Measure frames on the DMX pin with all levels 0: each slot is low for 36 µs, high for
        8."""
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


def trapezoids(fps_milli: int) -> list[np.ndarray]:
    """Return positions of four motors, frame by frame: from rest to their RATES and back to
    rest."""
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
