"""Measurements of the processor, the ports, the memory and the flash."""

import re
from collections.abc import Mapping, Sequence

import numpy as np

from ..bench.moves import WINDOW
from ..client.client import upload_requests
from ..client.wire import encode
from ..errors import ToolError
from ..payloads import (
    Hi,
    MotorGetPosition,
    MotorMove,
    MotorSetSpeed,
    MotorStatus,
    MotorStopAll,
)
from . import flash
from .collector import STEEPEST, Gathering

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
_TICK = re.compile(r"interrupts: (\d+) us .*, (\d+) us at a time")
_LATE = re.compile(r"worst lateness of a tick in motion: (\d+) us")


class Processor(Gathering):
    """Measures requests, uploads and the processor's load while motors move."""

    def _turning(self, seconds: float, motors: Sequence[int] = ()) -> None:
        """Keep these motors, or the first four, moving for at least this long."""
        origins = self._positions()
        for motor in motors or self.board.layout.groups[0]:
            way = round(TICK_HZ * (seconds + 0.2))
            self.client.request(MotorSetSpeed(motor, TICK_HZ, STEEPEST))
            self.client.request(MotorMove(motor, self._away(motor, origins, way)))

    def _replies(self) -> None:
        client = self.client
        self._turning(ASKED * 0.015)
        kinds = (MotorStatus, MotorGetPosition, Hi)
        taken = []
        for i in range(ASKED):
            begun = client.clock()
            client.answer_to(client.send(kinds[i % len(kinds)]()))
            taken.append(1000 * (client.clock() - begun))
            client.pump(0.0005 * (i % 7))  # at varying moments of the board's passes
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
        """Measure passes of the main loop while four motors move, with a wrapper around each
        pass."""
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
        try:
            found = flash.measure(self.board.run)
        except ToolError as error:
            self._say(f"left out: {error}")
            return
        for key, value in found._asdict().items():
            if value is not None:
                self.figures[key] = value
