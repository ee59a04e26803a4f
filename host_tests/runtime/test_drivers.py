"""TMC2209 drivers as machine code on 32 bits, with the heap locked: the same telegrams and findings
as on CPython."""

import contextlib
import io
import sys
from pathlib import Path
from unittest import mock

from framestep.io.tmc2209 import Drivers
from framestep.rig import Rig
from framestep_tools.simulator.driver_chips import STANDSTILL, Chip, Chips
from host_tests.runtime import drivers_replay

REPLAY = Path(__file__).parent / "drivers_replay.py"


class Recorder(drivers_replay.Hal):
    """Drivers on CPython with simulated chips, and the script of the bytes on the wire."""

    def __init__(self):
        super().__init__()
        self.now_us = 0
        self.chips = [Chip(0), Chip(1)]
        self.bus = Chips(self.chips, lambda: self.now_us * 1000)
        self.driver_wire = self
        self.events = []
        self.lines = []
        self.drivers = Drivers(self, Rig(drivers_replay.RIG, drivers_replay.BOARD))

    def select(self, motor):
        pass

    def send(self, buffer, count):
        self.events.append("s" + bytes(buffer[:count]).hex())
        self.bus.send(buffer, count)

    def receive(self, buffer, at, limit):
        count = self.bus.receive(buffer, at, limit)
        self.events.append("r" + bytes(buffer[at : at + count]).hex())
        return count

    def run(self, ms, clock=0):
        for _ in range(ms):
            self.events = []
            now = self.now_us // 1000 + clock & 0x3FFFFFFF
            self.drivers.poll(now)
            self.lines.append(f"{now} {' '.join(self.events)}\n")
            self.now_us += 1000


def story():
    """Play a set-up with losses, checks, heat, a reset, an open coil, silence, a return; the clock
    wraps on the way."""
    recorder = Recorder()
    clock = 2**30 - 700
    lost = iter(range(10**6))
    recorder.bus.spoil = lambda way, data: data[:-1] if next(lost) % 7 == 3 else data
    recorder.run(400, clock)
    recorder.bus.spoil = lambda way, data: data
    first, second = recorder.chips
    assert recorder.drivers.ready == 15
    for status in (STANDSTILL | 1, 0x40, STANDSTILL, 2):
        first.status = status
        recorder.run(400, clock)
    first.status = STANDSTILL
    second.reset()
    recorder.run(1500, clock)
    assert recorder.drivers.ready == 15
    second.powered = False
    recorder.run(400, clock)
    assert recorder.drivers.ready == 0b1011
    return "".join(recorder.lines)


def on_cpython(text):
    out = io.StringIO()
    with mock.patch.object(sys, "stdin", io.StringIO(text)), contextlib.redirect_stdout(out):
        drivers_replay.main()
    return out.getvalue()


def test_a_story(runtime):
    text = story()
    expected = on_cpython(text).split("\n")
    texts = {line.split(" ", 6)[6] for line in expected if line}
    assert len(texts) == 7, texts  # nothing yet, and six things to say
    assert expected[-2].split()[3] == "0"  # CPython itself keeps to the script
    answers = runtime.run(REPLAY, stdin=text.encode()).split("\n")
    wrong = [pair for pair in zip(answers, expected, strict=True) if pair[0] != pair[1]]
    assert not wrong, wrong[0]
