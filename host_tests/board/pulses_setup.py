"""Runs on the board: kernel and engine, fed with segments.

The test puts numbers in place of the constants of `stepper`, and of APART and MICROSECONDS.
"""

# ruff: noqa: F821 - the test replaces these names by numbers
import time

import machine

from framestep.hal.rp2.pulses import PulseEngine, lost_commands
from framestep.pulse.kernel import StepKernel

# APART: for each motor 0, or cycles between edges that are steps; MICROSECONDS: the chip's timer
HZ = machine.freq()
N = len(APART)
pins = range(2, 2 + 2 * N, 2)
shapes = [(0, 625, False, 0, apart) for apart in APART]
engine = PulseEngine(list(pins), [pin + 1 for pin in pins], HZ, shapes)
kernel = StepKernel(N, HZ // 1000, MICROSECONDS)


def configure(width, setup, invert):
    for i in range(N):
        apart = APART[i]
        kernel.configure(i, engine.fifo(i), 0 if apart else width, setup, invert, 0, apart)


# A list of segments for all motors, fed when there is room
moves = []


def feed():
    while moves:
        for i in range(N):
            b = kernel.blocks[i]
            if (b[stepper.WRITE_INDEX] - b[stepper.READ_INDEX]) & 0x3FFFFFFF > 14:
                return
        segment = moves.pop(0)
        for i in range(used):
            b = kernel.blocks[i]
            q = kernel.queues[i]
            at = (b[stepper.WRITE_INDEX] & 15) * 8
            for k in range(8):
                q[at + k] = segment[k]
            b[stepper.WRITE_INDEX] = (b[stepper.WRITE_INDEX] + 1) & 0x3FFFFFFF


def start(segments, motors, brake):
    global used
    used = motors
    moves.extend(segments)
    feed()
    state = machine.disable_irq()
    for i in range(used):
        kernel.blocks[i][stepper.BRAKE] = brake
        kernel.blocks[i][stepper.MODE] |= stepper.RUN | stepper.START
    machine.enable_irq(state)


def run(ms):
    begun = time.ticks_ms()
    while time.ticks_diff(time.ticks_ms(), begun) < ms:
        feed()
        time.sleep_ms(2)


def away(after, us):
    "Interrupts off for so long, from some microseconds after a tick on."
    ticks = kernel.state[stepper.TICKS]
    while kernel.state[stepper.TICKS] == ticks:
        pass
    begun = time.ticks_us()
    while time.ticks_diff(time.ticks_us(), begun) < after:
        pass
    state = machine.disable_irq()
    while time.ticks_diff(time.ticks_us(), begun) < after + us:
        pass
    machine.enable_irq(state)


def end():
    "What still moves, since its queue ran dry, stops at once."
    for b in kernel.blocks:
        b[stepper.BRAKE] = b[stepper.DECEL] = 100 << 22
    time.sleep_ms(60)


def fresh():
    kernel.state[stepper.FAULTS] = kernel.state[stepper.WORST_LATE] = 0
    for b in kernel.blocks:
        assert b[stepper.MODE] == stepper.IDLE
        b[stepper.POSITION] = b[stepper.FRACTION] = b[stepper.FAULT] = b[stepper.DECEL] = 0


def result():
    b = kernel.blocks
    return [
        b[0][stepper.POSITION],
        kernel.state[stepper.FAULTS],
        kernel.state[stepper.WORST_LATE],
        lost_commands(N),
        max(x[stepper.MODE] for x in b),
        max(x[stepper.POSITION] for x in b) - min(x[stepper.POSITION] for x in b),
    ]


configure(0, 625, False)
timer = machine.Timer(-1, period=1, mode=machine.Timer.PERIODIC, callback=kernel.tick, hard=True)
time.sleep_ms(150)
