"""Passes of the main loop: their number and length, and the queues."""

from rich.table import Table

from framestep.pulse import stepper

from ..payloads import RtEnd, RtGo
from ..simulator.boards import EmulatedBoard
from .moves import CLOCK_MHZ, STEADY_RATES, mixed_move
from .session import Session

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
                    queued = (block[{WRITE_INDEX}] - block[{READ_INDEX}]) & 0x3FFFFFFF
                    if queued < self.least:
                        self.least = queued
        return busy

watch = Watch(boot.controller)
boot.controller.poll = watch.poll
"""
LOOP_FPS = (25, 60)


def loops() -> list[tuple[str, int, int, int, int]]:
    """Return [(what, passes in a second, mean and longest time in µs, fewest queued segments)]."""
    names = {
        name: getattr(stepper, name)
        for name in ("PLANNED", "PLAN_SEGMENTS", "WRITE_INDEX", "READ_INDEX")
    }
    found = []
    with EmulatedBoard({"clock_mhz": CLOCK_MHZ}, trace=False) as board:
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
    """Return a table of loops()."""
    result = Table(
        title=f"passes of the main loop at {CLOCK_MHZ} MHz, flash-cache model on, frozen image",
        title_justify="left",
    )
    for name in ("", "in a second", "mean, µs", "longest, µs", "fewest segments queued"):
        result.add_column(name, justify="right" if name else "left", no_wrap=True)
    for what, *figures in rows:
        result.add_row(what, *map(str, figures))
    return result
