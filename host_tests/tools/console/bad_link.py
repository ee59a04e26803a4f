"""How soon a held jog ends over a bad link, in virtual time: the server's own code between a page
that holds a button, as page/holds.js does, and a simulated board.

python -m host_tests.tools.console.bad_link          print the figures of docs/use/console.md
"""

import asyncio
import random
import re
import selectors
import time
from concurrent.futures import Future, ThreadPoolExecutor
from itertools import pairwise
from statistics import median
from typing import NamedTuple

from framestep_tools.client.wire import FrameDecoder, encode
from framestep_tools.console import page_files
from framestep_tools.console.board_requests import BoardWork
from framestep_tools.console.device import SILENCE_S, ConsoleDevice
from framestep_tools.console.page_session import Visit
from framestep_tools.payloads import MotorJog, MotorStatus, MotorStop
from framestep_tools.simulator.boards import SimulatedBoard

REPEAT_S = int(re.search(rb"REPEAT_MS = (\d+)", page_files.files()["holds.js"])[1]) / 1000
POLL_S = int(re.search(rb"const MOVING_MS = (\d+)", page_files.files()["device.js"])[1]) / 1000
SLICE_S = 0.002  # of the board
HELD_S = 2.0
LATEST_S = 5.0  # by then everything rests
FAR = 2_000_000_000
VELOCITY = 5000  # of a started board
SLOWER_NS = 10**9 / VELOCITY * 1.05  # from step to step, so the motor is no longer at full velocity
RETRANSMIT_S = 0.2  # beyond a round trip, for the first time; then twice as much each time


class Link(NamedTuple):
    """A link: its delay each way in seconds, and how often a message is lost and sent again."""

    delay_s: float
    lost: float


LINKS = {
    "this computer": Link(0.0, 0.0),
    "200 ms each way": Link(0.2, 0.0),
    "200 ms there and back, 5 % lost": Link(0.1, 0.05),
}


class _Selector(selectors.SelectSelector):
    """Waits in virtual time."""

    now = 0.0

    def select(self, timeout=None):
        assert timeout is not None, "nothing would ever happen"
        self.now += timeout
        return super().select(0)


class _Loop(asyncio.SelectorEventLoop):
    def __init__(self):
        self._virtual = _Selector()
        super().__init__(self._virtual)
        self.set_default_executor(_Inline())

    def time(self):
        return self._virtual.now


class _Inline(ThreadPoolExecutor):
    """Runs everything at once, in the caller's thread."""

    def submit(self, call, *given):
        done = Future()
        try:
            done.set_result(call(*given))
        except Exception as error:
            done.set_exception(error)
        return done


class _Way:
    """One direction of a TCP connection: all messages arrive, in their order."""

    def __init__(self, link, chance, deliver):
        self._link = link
        self._chance = chance
        self._deliver = deliver
        self._last_s = 0.0
        self.cut = False

    def send(self, message):
        if self.cut:
            return
        loop = asyncio.get_running_loop()
        at, again = loop.time() + self._link.delay_s, 2 * self._link.delay_s + RETRANSMIT_S
        while self._chance.random() < self._link.lost:
            at, again = at + again, 2 * again
        self._last_s = max(at, self._last_s)
        loop.call_at(self._last_s, self._deliver, message)


class _Page:
    """A page that holds a button. To its server it is a WebSocket."""

    def __init__(self, link, chance):
        self._came = asyncio.Queue()
        self._up = _Way(link, chance, self._arrive)
        self._down = _Way(link, chance, self._hear)
        self._decoder = FrameDecoder()
        self._holding = False
        self._number = 0
        self._waiting = {}  # number of a request -> what follows its answer
        self.last_jog_s = self.last_s = 0.0  # the last arrivals at the server

    # ---- as the server sees it

    def __aiter__(self):
        return self

    async def __anext__(self):
        return await self._came.get()

    async def send(self, message):
        self._down.send(message)

    async def close(self):
        self._up.cut = self._down.cut = True

    def _arrive(self, message):
        self.last_s = asyncio.get_running_loop().time()
        if any(frame.type == MotorJog.TYPE for frame in FrameDecoder().feed(message)):
            self.last_jog_s = self.last_s
        self._came.put_nowait(message)

    # ---- the user's side

    def _hear(self, message):
        if isinstance(message, str):
            return
        for frame in self._decoder.feed(message):
            if then := self._waiting.pop(frame.id, None):
                asyncio.get_running_loop().call_soon(then)

    def _ask(self, request, then=None):
        self._number += 1
        if then:
            self._waiting[self._number] = then
        self._up.send(encode(request.TYPE, request.pack(), self._number))

    def _jog(self):
        """Repeat the jog 150 ms after the last one, but not before its answer."""
        if not self._holding:
            return
        loop = asyncio.get_running_loop()
        due = loop.time() + REPEAT_S
        self._ask(MotorJog(1, 10_000, FAR), lambda: loop.call_at(due, self._jog))

    def _poll(self):
        loop = asyncio.get_running_loop()
        self._ask(MotorStatus(), lambda: loop.call_later(POLL_S, self._poll))

    def hold(self):
        self._holding = True
        self._jog()
        self._poll()

    def let_go(self):
        self._holding = False
        self._ask(MotorStop(1))

    def lose(self):
        """Cut the link: neither side notices."""
        self._up.cut = self._down.cut = True


class _Port:
    """The board's port, for the server. `_pass_time` passes on what the board sends."""

    timeout = None
    in_waiting = 0

    def __init__(self, board):
        self._board = board

    def read(self, size=1):
        time.sleep(0.001)  # in a thread of its own, which only waits
        return b""

    def write(self, data):
        self._board.receive(data)

    def close(self):
        pass


class Ending(NamedTuple):
    """How a hold ended. stop_s: from its end (the button, or the link) to the beginning of the
    motor's stop; pauses: how often the motor slowed down before; jog_s, message_s: from its end to
    the arrival of the last jog and of the last message at the server, 0 if that was before."""

    stop_s: float
    pauses: int
    jog_s: float
    message_s: float


async def _pass_time(board, device):
    loop = asyncio.get_running_loop()
    while True:
        board.run_until(round(loop.time() * 1e9))
        if (data := board.transmit()) and device.bridge:
            device.bridge.on_bytes(data)
        await asyncio.sleep(SLICE_S)


async def _hold(link, seed, cut, jog_timeout_ms, silence_s):
    board = SimulatedBoard({"jog_timeout_ms": jog_timeout_ms}, 1)
    board.open_port(True)
    device = ConsoleDevice(lambda: _Port(board), "socket://board", BoardWork(None, "board"))
    device.silence_s = silence_s
    page = _Page(link, random.Random(seed))
    loop = asyncio.get_running_loop()
    tasks = [
        asyncio.ensure_future(Visit(device, page).run()),
        asyncio.ensure_future(_pass_time(board, device)),
    ]
    await asyncio.sleep(0.1)
    page.hold()
    # the phase of the page's requests is another one each time
    await asyncio.sleep(HELD_S + random.Random(-1 - seed).random())
    end = loop.time()
    (page.lose if cut else page.let_go)()
    await asyncio.sleep(LATEST_S)
    for task in tasks:
        task.cancel()
    await asyncio.gather(*tasks, return_exceptions=True)
    await device.let_go()
    steps = [at for at, signal, _ in board.edges() if signal == "m1"]
    late = (max(0.0, at - end) for at in (page.last_jog_s, page.last_s))
    return Ending(*_judge(steps, round(end * 1e9)), *late)


def _judge(steps, end_ns):
    """Return how long after `end_ns` the last step at full velocity came, in seconds, and how often
    the motor slowed down before."""
    fast = [step - before <= SLOWER_NS for before, step in pairwise(steps)]
    last = max(step for step, at_full in zip(steps[1:], fast, strict=True) if at_full)
    slowed = (
        was and not now and step < end_ns
        for (was, now), step in zip(pairwise(fast), steps[2:], strict=True)
    )
    return max(0, last - end_ns) / 1e9, sum(slowed)


def hold(link, seed, cut=False, jog_timeout_ms=500, silence_s=SILENCE_S):
    """Hold a button, then let it go, or cut the link. jog_timeout_ms, silence_s: the limits of the
    device (0: none) and of the server."""

    def run():
        with asyncio.Runner(loop_factory=_Loop) as runner:
            return runner.run(_hold(link, seed, cut, jog_timeout_ms, silence_s))

    with ThreadPoolExecutor(1) as apart:  # tests with a browser have a loop in this thread
        return apart.submit(run).result()


def figures(holds=50):
    """Yield the lines of a table."""
    yield "| link | let go: median, latest | link cut: median, latest | holds that pause |"
    yield "|---|---|---|---|"
    for name, link in LINKS.items():
        ends = {cut: [hold(link, seed, cut) for seed in range(holds)] for cut in (False, True)}
        times = [
            f"{median(each.stop_s for each in found):.2f} s, "
            f"{max(each.stop_s for each in found):.2f} s"
            for found in ends.values()
        ]
        pausing = sum(each.pauses > 0 for found in ends.values() for each in found)
        yield f"| {name} | {' | '.join(times)} | {100 * pausing // (2 * holds)} % |"


if __name__ == "__main__":
    for line in figures():
        print(line, flush=True)
