"""Runs on the board: claims pins as an engine does, some microseconds after a request."""

import time

import machine
import rp2

from framestep.hal.rp2 import pulses

STEP, DIRECTION = 14, 15  # of motor 7 on a Pico


def forget():
    "The pins as after a reset."
    rp2.PIO(1).remove_program()
    for pin in (STEP, DIRECTION):
        machine.mem32[0x40014004 + 8 * pin] = 31
        machine.mem32[0x4001C004 + 4 * pin] = 0x56


def claim():
    engine = pulses.PulseEngine(
        [STEP] * 5, [DIRECTION] * 5, machine.freq(), [(0, 625, False, 0, 0)] * 5
    )
    for command in (0, 1, 0, 1, 0):
        machine.mem32[engine.fifo(4)] = command | 1 << 1 | 5000 << 10


def try_after(us):
    begun = time.ticks_us()
    print("go")
    while time.ticks_diff(time.ticks_us(), begun) < us:
        pass
    claim()
    time.sleep_ms(30)
