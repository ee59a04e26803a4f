"""Rounds of a host's work with one board: moves, jogs, runs, loops, lights, reports, reconnects.

Round after round the same session goes on. After each motion every position is exact: what the
board reports is what the edges on the pins add up to, and where the motor was sent.
"""

import itertools
import math
import random

from framestep_tools.client.client import upload_requests
from framestep_tools.payloads import (
    LAST_SECTION,
    DeviceInfo,
    Dmx,
    GioIn,
    GioOut,
    HardStop,
    MotorJog,
    MotorMove,
    MotorResetPosition,
    MotorSetSpeed,
    MotorStop,
    Positions,
    RtEnd,
    RtGo,
    RtRunMove,
    RtStopLoop,
    RtUploadMoveBegin,
    RtUploadMoveDmx,
    RtUploadMoveEnd,
    RtUploadMoveTriggers,
    Trigger,
)

MOTORS = 4
RIG = {"outputs": [{"pin": 22}, {"pin": 26}], "inputs": [{"pin": 27}]}
VELOCITY, ACCELERATION = 20_000, 100_000
FRAMES = 60
FPS = 24
_REACH = 6000  # steps
_REPORT_S = 0.1
_LOOP = 3  # loop, ping-pong


class Rounds:
    """Plays rounds; AssertionError for what is not as it should be.

    session: an end_to_end Session. runs: [(begin, end)] of the runs, in seconds of the board.
    """

    def __init__(self, session, seed):
        self.session = session
        self.dice = random.Random(seed)
        self.runs: list[tuple[float, float]] = []
        self.motions = 0
        self._made = [0] * MOTORS  # edges so far, up less down
        self._names = [0] * MOTORS  # what RESET_POSITION has added
        for motor in range(1, MOTORS + 1):
            session.accept(MotorSetSpeed(motor, VELOCITY, ACCELERATION))

    def round(self):
        """All of it once, in an order of its own; the first begins with a run."""
        parts = [self._moves, self._retarget, self._jog, self._loop, self._lights, self._reconnect]
        self.dice.shuffle(parts)
        for part in (self._run, *parts, self._lost_host):
            part()
            self._exact()
            client = self.session.client
            assert not self.session.events(HardStop), self.session.events(HardStop)
            assert (client.skipped, client.stray) == (0, 0)
            client.events.clear()

    # ---- what is checked

    def _exact(self, wanted=None):
        """Reports, edges, and where the motors were sent agree to the step.

        wanted: {motor: position}. Returns the positions.
        """
        session = self.session
        session.wait_idle()
        for _, signal, value in session.board.edges():
            if signal[0] == "m" and signal[1:].isdigit():
                self._made[int(signal[1:]) - 1] += value
        told = list(session.ask_positions().steps)[:MOTORS]
        made = [made + name for made, name in zip(self._made, self._names, strict=True)]
        assert told == made, f"at {session.now:.3f} s: reported {told}, by the edges {made}"
        last = [told for _, told in session.events(Positions)][-1:]
        assert all(list(each.steps)[:MOTORS] == told for each in last), (last, told)
        for motor, position in (wanted or {}).items():
            assert told[motor - 1] == position, f"motor {motor} is at {told[motor - 1]}"
        self.motions += 1
        return told

    def _reported(self, began):
        """While motors moved, positions came ten times a second."""
        session = self.session
        times = [time_s for time_s, _ in session.events(Positions) if time_s >= began]
        gaps = [b - a for a, b in itertools.pairwise(times)]
        assert len(times) >= 5, times
        assert sorted(gaps)[len(gaps) // 2] <= _REPORT_S * 1.2, gaps

    # ---- what a host does

    def _target(self):
        return self.dice.randrange(-_REACH, _REACH)

    def _moves(self):
        wanted = {motor: self._target() for motor in range(1, MOTORS + 1)}
        for motor, position in wanted.items():
            self.session.ask(MotorMove(motor, position))
        self._exact(wanted)

    def _retarget(self):
        motor = self.dice.randint(1, MOTORS)
        self.session.ask(MotorMove(motor, 3 * _REACH))
        self.session.run(self.dice.uniform(0.01, 0.5))
        position = self._target()
        self.session.ask(MotorMove(motor, position))
        self._exact({motor: position})

    def _jog(self):
        motor = self.dice.randint(1, MOTORS)
        destination = self.dice.choice((-10, 10)) * _REACH
        self.session.accept(MotorJog(motor, self.dice.randint(500, 10_000), destination))
        self.session.run(self.dice.uniform(0.05, 1))
        self.session.accept(MotorStop(motor))
        self._exact()
        named = self._target()  # the place gets another number, so that jogs do not lead away
        told = self._exact()
        self.session.accept(MotorResetPosition(motor, named))
        self._names[motor - 1] += named - told[motor - 1]
        self._exact({motor: named})

    def _path(self, motor):
        """A camera's way from where the motor is: sines, within its velocity and acceleration."""
        start = self._told[motor - 1]
        reach, turns = self.dice.randint(200, 2500), self.dice.choice((0.5, 1, 1.5))
        return [
            start + round(reach * (1 - math.cos(2 * math.pi * turns * i / (FRAMES - 1))) / 2)
            for i in range(FRAMES)
        ]

    def _upload(self):
        self._told = self._exact()
        paths = {motor: self._path(motor) for motor in range(1, MOTORS + 1)}
        requests = list(upload_requests(1, FRAMES, paths))
        assert isinstance(requests[0], RtUploadMoveBegin)
        assert isinstance(requests[-1], RtUploadMoveEnd)
        levels = [self.dice.randrange(256) for _ in range(FRAMES)]
        requests[-1:-1] = [
            RtUploadMoveDmx(self.dice.randint(1, 512), LAST_SECTION, levels),
            RtUploadMoveTriggers(3, [Trigger(i, i % 4) for i in range(0, FRAMES, 5)]),
        ]
        self.session.client.stream(requests, 4)
        return paths

    def _play(self, flags, stop_after=None):
        session = self.session
        run = RtRunMove(FPS * 1000, 1, FRAMES, 500, 500, 1, flags=flags)
        session.accept(run)
        session.wait_idle()
        session.client.events.clear()
        session.accept(RtGo())
        began = session.now
        if stop_after:
            session.run(stop_after)
            session.accept(RtStopLoop())
        session.client.wait_event(RtEnd, 30)
        self.runs.append((began, session.now))
        session.run(0.3)
        self._reported(began)

    def _run(self):
        paths = self._upload()
        self._play(0)
        self._exact({motor: path[-1] for motor, path in paths.items()})

    def _loop(self):
        paths = self._upload()
        self._play(_LOOP, self.dice.uniform(1, 6))
        told = self._exact()
        ends = [[path[at] for path in paths.values()] for at in (0, -1)]
        assert told in ends, (told, ends)

    def _lights(self):
        session = self.session
        channel = self.dice.randint(1, 500)
        levels = [self.dice.randrange(256) for _ in range(10)]
        session.accept(
            Dmx(self.dice.randint(0, 1), channel, levels), GioOut(self.dice.randint(0, 3))
        )
        session.ask(GioIn())
        session.run(1)

    def _reconnect(self):
        """At rest nothing changes by it."""
        before = self._exact()
        self.session.leave()
        self.session.run(self.dice.uniform(0.05, 3))
        self._greeted()
        self._exact(dict(enumerate(before, 1)))

    def _lost_host(self):
        """In motion the motors ramp down, and their positions stay exact."""
        motor = self.dice.randint(1, MOTORS)
        position = self._told[motor - 1]
        self.session.ask(MotorMove(motor, position + self.dice.choice((-3, 3)) * _REACH))
        self.session.run(self.dice.uniform(0.1, 0.8))
        self.session.leave()
        self.session.run(2)
        self._greeted()
        self._exact()

    def _greeted(self):
        self.session.client.events.clear()
        self.session.come_back()
        self.session.client.wait_event(DeviceInfo, 5)
