"""Runs on MicroPython and on CPython: lights, inputs, outputs and stop inputs, with the heap locked
while they work.

A line on standard input is an operation; its visible effect is printed. See test_io.py.
"""

import sys
from array import array

from framestep.base.native import addressof, as_word
from framestep.hal import CHANNELS
from framestep.io.camera import Camera
from framestep.io.gio import Gio
from framestep.io.lights import Lights
from framestep.io.requests import send_stops
from framestep.io.safety import Safety
from framestep.motion.reals import copy_word
from framestep.motors.feeder import WORK_WORDS
from framestep.protocol.frames import FrameWriter
from framestep.pulse.stepper import (
    BLOCK_WORDS,
    BRAKE,
    DECEL,
    DOWN,
    FIRST,
    HEADER_WORDS,
    MODE,
    NEXT,
    POSITION,
    RUN,
    STOP,
    VELOCITY,
    WORK,
)
from framestep.rig import Rig

try:
    from micropython import heap_lock, heap_unlock
except ImportError:

    def heap_lock():
        pass

    heap_unlock = heap_lock

RIG = {
    "outputs": [{"pin": 2, "safe": "on"}, {"pin": 3, "on": "low", "safe": "hold"}, {"pin": 29}],
    "inputs": [{"pin": 28}, {"pin": 4, "on": "high", "pull": "down"}, {"pin": 29 - 1 - 1}],
    "limits": [{"high": 10, "low": 11}, {"high": 12, "low": 13, "contact": "no"}],
    "estop": "nc",
    "meter_on": "low",
}
BOARD = {"estop": 19, "shutter": 20, "meter": 21}


class Hal:
    def __init__(self):
        self.board = BOARD
        self.level = 0

    def output(self, pin, level):
        self.level |= level << pin
        return 1 << pin

    def input(self, pin, pull):
        self.level |= (1 if pull == "up" else 0) << pin
        return 1 << pin

    def drive(self, high, low):
        self.level = (self.level | high) & ~low

    def levels(self):
        return self.level

    def watch(self, bits, handler):
        self.watched = (bits, handler)

    def irq_off(self):
        return 0

    def irq_on(self, state):
        pass


class Motor:
    partner = leader = None
    turned = 0

    def __init__(self):
        self.block = array("i", [0] * BLOCK_WORDS)
        self.work = array("i", [0] * WORK_WORDS)
        self.block[WORK] = as_word(addressof(self.work))

    def position_to(self, target, i):
        copy_word(target, i, self.block, POSITION)


class Motors:
    count = 8

    def __init__(self):
        self.kernel = self
        self.state = array("i", [0] * HEADER_WORDS)
        self.motors = [Motor() for _ in range(self.count)]
        self.state[FIRST] = as_word(addressof(self.motors[0].block))
        for i in range(self.count - 1):
            self.motors[i].block[NEXT] = as_word(addressof(self.motors[i + 1].block))

    def __getitem__(self, i):
        return self.motors[i]


class Bench:
    def __init__(self):
        rig = Rig(RIG, BOARD)
        self.hal = Hal()
        self.lights = Lights(512, 500)
        self.gio = Gio(self.hal, rig)
        self.camera = Camera(self.hal, rig)
        self.motors = Motors()
        for i in range(8):
            self.motors[i].block[BRAKE] = 1000 + 2000000 * i
        self.safety = Safety(self.hal, rig, self.motors)
        self.writer = FrameWriter()
        self.target = array("i", [0])
        self.now = 0
        self.flags = 0
        self.data = bytearray(600)

    def poll(self, ms):
        for _ in range(ms):
            self.now = 0 if self.now == 0x3FFFFFFF else self.now + 1
            level = self.hal.levels()
            if self.gio.poll(self.now, level):
                self.flags |= 1
            if self.safety.poll(self.now, level):
                self.flags |= 2
            self.lights.poll(self.now)
        send_stops(self.writer, self.safety, True)

    def work(self, kind, a, b):
        """Do one operation with the heap locked."""
        if kind == "poll":
            self.poll(a)
        elif kind == "clock":
            self.now = a
        elif kind == "light":
            self.lights.set(a, b)
        elif kind == "lights":
            self.lights.put(a, self.data, 1, b)
        elif kind == "ramp":
            self.lights.ramp(self.now, a, self.data, 1, b)
        elif kind == "put":
            self.gio.put(a, b)
        elif kind == "cue":
            self.flags = self.gio.outputs.pins(a, b) ^ self.gio.outputs.down
        elif kind == "safe":
            self.gio.safe()
            self.camera.safe()
        elif kind == "camera":
            self.camera.set(a, b)
        elif kind == "assign":
            self.safety.assign(a, b & 0x7F, b & 0x80)
        elif kind == "bars":
            self.flags = self.safety.limit_blocking(a, self.target, 0)
        elif kind == "pin":
            self.hal.level = self.hal.level & ~(1 << a) | b << a
            self.safety.on_switch_change(None)


def main():
    bench = Bench()
    out = bytearray(4096)
    lights = bench.lights
    for line in sys.stdin:
        kind, a, b = line.split()
        a, b = int(a), int(b)
        if kind == "data":
            for i in range(len(bench.data)):
                bench.data[i] = (a * i + b) & 0xFF
            continue
        if kind == "target":
            bench.target[0] = b
            continue
        if kind == "moves":
            block = bench.motors[a].block
            block[MODE] = RUN if b else 0
            block[VELOCITY] = b
            block[DOWN] = -1 if b < 0 and b & 2 else 0
            continue
        if kind == "stands":
            bench.motors[a].block[POSITION] = b
            continue
        bench.flags = 0
        heap_lock()
        try:
            bench.work(kind, a, b)
            adjusting = lights.adjusting
            values = bench.gio.inputs.values
            motors = bench.safety.motors_at_limit()
        finally:
            heap_unlock()
        total = 0
        for channel in range(CHANNELS + 1):
            total = (total * 31 + lights.level(channel)) % 65521
        count = bench.writer.take(out, len(out))
        # MicroPython's b"".hex() is not a string
        sent = bytes(memoryview(out)[:count]).hex() if count else "-"
        slowing = [motor.block[DECEL] for motor in bench.motors.motors if motor.block[MODE] == STOP]
        print(
            kind,
            slowing,
            total,
            adjusting,
            bench.hal.level,
            values,
            motors,
            bench.safety.tripped,
            bench.flags,
            sent,
        )


if __name__ == "__main__":
    main()
