"""Runs on MicroPython and on CPython, with the core built for the stream engine: scripts of
requests and batches of ticks, with the heap locked from the first tick on; a file gets the painted
words, after one that has only the first early levels.

    new motors width     a new kernel; motor i has its step on bit STEPS[i] and its direction on the
                         next one, inverted if i is odd
    speed m v a          Axis.set_speed
    travel m target; stop m factor
    cue tick high low    StepKernel.cue, ticks counted from the beginning
    drive high low       Stream.drive
    batch n              n ticks at once, the main loop's part before
    miss n               the words ran out for n ticks
    end                  the motors that lost commands, and each motor's mode, fault and position
"""

import sys
from array import array

from framestep.hal.stream import Stream
from framestep.motors.axes import Axes
from framestep.motors.samples import sample
from framestep.pulse.engine import CYCLES, EARLY, WORDS
from framestep.pulse.kernel import StepKernel
from framestep.pulse.stepper import FAULT, MODE, POSITION

try:
    from micropython import heap_lock, heap_unlock
except ImportError:

    def heap_lock():
        pass

    heap_unlock = heap_lock

SETUP = 640  # cycles: 5 µs
AHEAD = 20
LONGEST = 20  # batch, ticks
# both early, or one of them; without early levels a word has 32
STEPS = (0, 16, 14, 3) if EARLY else (0, 30, 14, 3)


class Rig:
    """Motors on a stream. It is a HAL, as far as axes need one."""

    def __init__(self, motors, width, bits=STEPS):
        steps = [1 << bit for bit in bits[:motors]]
        self.stream = Stream(steps, [bit << 1 for bit in steps])
        self.kernel = StepKernel(motors, CYCLES, self.stream.clock)
        for i in range(motors):
            self.kernel.configure(i, self.stream.fifo(i), width, SETUP, i % 2 == 1)
        self.attach(steps)
        self.port = self
        self.axes = Axes(self)
        self.target = array("i", [0, 0])
        self.painted = array("i", [0] * (1 + LONGEST * WORDS))

    def attach(self, steps):
        self.stream.attach(self.kernel, AHEAD)

    def glance(self):
        """As a port: no questions come."""

    look_for_stop = glance

    def irq_off(self):
        return 0

    def irq_on(self, state):
        pass


def travel(rig, axis):
    heap_lock()
    axis.move_to(rig, rig.target, 1)
    heap_unlock()


def stop(rig, axis, factor):
    heap_lock()
    axis.stop(rig, factor)
    heap_unlock()


def cue(rig, tick, high, low):
    heap_lock()
    rig.kernel.cue(tick, high, low)
    heap_unlock()


def drive(rig, high, low):
    heap_lock()
    rig.stream.drive(high, low)
    heap_unlock()


def miss(rig, ticks):
    heap_lock()
    rig.stream.miss(rig.painted, ticks, 1)
    heap_unlock()


def batch(rig, ticks):
    heap_lock()
    rig.axes.feed()
    sample(rig.kernel.state, rig.axes.samples)
    at = 1
    while ticks:
        rig.stream.fill(rig.painted, at)
        at += WORDS
        ticks -= 1
    heap_unlock()


def write(rig, ticks, out):
    """Write what is complete of the painted words."""
    painted = rig.painted
    out.write(memoryview(painted)[: ticks * WORDS])
    painted[0] = painted[ticks * WORDS]


def request(rig, what, numbers):
    if what == "speed":
        rig.axes[numbers[0]].set_speed(numbers[1], numbers[2])
    elif what == "travel":
        rig.target[1] = numbers[1]
        travel(rig, rig.axes[numbers[0]])
    elif what == "stop":
        stop(rig, rig.axes[numbers[0]], numbers[1])
    elif what == "cue":
        cue(rig, *numbers)
    elif what == "drive":
        drive(rig, *numbers)
    else:
        raise ValueError(what)


def play(lines, out):
    rig = None
    for line in lines:
        what, *words = line.split()
        numbers = [int(word) for word in words]
        if what == "new":
            rig = Rig(*numbers)
        elif what == "batch":
            batch(rig, numbers[0])
            write(rig, numbers[0], out)
        elif what == "miss":
            miss(rig, numbers[0])
            write(rig, 1, out)
        elif what == "end":
            out.write(memoryview(rig.painted)[:1])
            out.write(array("i", [rig.stream.take_lost_commands()]))
            for block in rig.kernel.blocks:
                out.write(array("i", [block[MODE], block[FAULT], block[POSITION]]))
        else:
            request(rig, what, numbers)


def main():
    with open(sys.argv[1], "wb") as out:
        play(sys.stdin, out)


if __name__ == "__main__":
    main()
