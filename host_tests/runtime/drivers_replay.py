"""Runs on MicroPython and on CPython: the set-up and the checks of TMC2209 drivers, with the heap
locked in every pass.

A line on standard input is a pass: the time, then in order the bytes that the wire returns (r and
bytes) and those that it should receive (s and bytes). The effect is printed. See test_drivers.py.
"""

import sys

from framestep.io.tmc2209 import Drivers
from framestep.rig import Rig

try:
    from micropython import heap_lock, heap_unlock
except ImportError:

    def heap_lock():
        pass

    heap_unlock = heap_lock

RIG = {
    "motors": [
        {"driver": {"run_ma": 800}},
        {},
        {"driver": {"run_ma": 400, "mode": "spread", "hold_percent": 0}},
    ]
}
BOARD = {
    "chip": "rp2040",
    "step": [11, 6, 19, 14],
    "dir": [10, 5, 28, 13],
    "enable": [12, 7, 2, 15],
    "drivers": {"uart": 1, "tx": 8, "rx": 9, "address": [0, 2, 1, 3]},
}


class Wire:
    """Plays a script, and counts differences between the script and the bytes sent."""

    def __init__(self):
        self.kinds = ""
        self.data = []
        self.at = 0
        self.wrong = 0

    def select(self, motor):
        pass

    def send(self, buffer, count):
        at = self.at
        self.at = at + 1
        if at >= len(self.kinds) or self.kinds[at] != "s" or len(self.data[at]) != count:
            self.wrong += 1
            return
        data = self.data[at]
        for i in range(count):
            if buffer[i] != data[i]:
                self.wrong += 1

    def receive(self, buffer, at, limit):
        now = self.at
        self.at = now + 1
        if now >= len(self.kinds) or self.kinds[now] != "r":
            self.wrong += 1
            return 0
        data = self.data[now]
        for i in range(len(data)):
            buffer[at + i] = data[i]
        return len(data)


class Hal:
    def __init__(self):
        self.motors = 4
        self.board = BOARD
        self.driver_wire = Wire()
        self.said = 0
        self.motor = 0
        self.text = ""

    def report_driver(self, motor, text):
        self.said += 1
        self.motor = motor
        self.text = text


def from_hex(text):
    return bytes([int(text[i : i + 2], 16) for i in range(0, len(text), 2)])


def main():
    hal = Hal()
    drivers = Drivers(hal, Rig(RIG, BOARD))
    wire = hal.driver_wire
    for line in sys.stdin:
        now, *script = line.split()
        now = int(now)
        wire.kinds = "".join([each[0] for each in script])
        wire.data = [from_hex(each[1:]) for each in script]
        wire.at = 0
        heap_lock()
        try:
            failed = drivers.poll(now)
        finally:
            heap_unlock()
        wire.wrong += len(script) - wire.at
        print(failed, drivers.ready, drivers.writes, wire.wrong, hal.said, hal.motor, hal.text)


if __name__ == "__main__":
    main()
