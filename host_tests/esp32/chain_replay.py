"""Runs on the simulated ESP32: the lines of host_tests/runtime/stream_replay.py, but words leave by
I2S instead of into a file. Instead of `batch n` there are

    pass us      the main loop's part, once; then time passes
    flash us     a sector of flash is written

and `new` takes the arguments `motors width buffers`. After each pass it prints the time in µs, how
many ticks are done, and the reported positions of the motors; at the end, the motors whose position
is lost, then each motor's mode, fault and position.
"""

import sys
from array import array

import chip
from micropython import heap_lock, heap_unlock

from framestep.hal.esp32.chain import Chain
from framestep.hal.stream import Stream
from framestep.motors.axes import Axes
from framestep.motors.samples import sample
from framestep.pulse.engine import CYCLES
from framestep.pulse.kernel import StepKernel
from framestep.pulse.stepper import FAULT, MODE, POSITION, TICKS

SETUP = 640  # cycles: 5 µs


class Rig:
    """Motors behind a chain: steps of motor i on output 20·i, its direction, inverted if i is odd,
    on output 20·i + 1. It is a HAL, as far as axes need one."""

    def __init__(self, motors, width, buffers):
        steps = [1 << 20 * i for i in range(motors)]
        self.stream = Stream(steps, [2 << 20 * i for i in range(motors)])
        self.kernel = StepKernel(motors, CYCLES, self.stream.clock)
        for i in range(motors):
            self.kernel.configure(i, self.stream.fifo(i), width, SETUP, i % 2 == 1)
        self.chain = Chain(self.stream, self.kernel, steps, buffers, 16, 17, 21)
        self.port = self
        self.axes = Axes(self)
        self.target = array("i", [0, 0])

    def glance(self):
        """As a port: no questions come."""

    def irq_off(self):
        return 0

    def irq_on(self, state):
        pass

    def loop(self):
        self.axes.feed()
        self.chain.serve()
        sample(self.kernel.state, self.axes.samples)
        self.axes.choose_sample()


def play(lines):
    rig = None
    for line in lines:
        what, *words = line.split()
        numbers = [int(word) for word in words]
        if what == "new":
            rig = Rig(*numbers)
        elif what == "speed":
            rig.axes[numbers[0]].set_speed(numbers[1], numbers[2])
        elif what == "travel":
            rig.target[1] = numbers[1]
            rig.axes[numbers[0]].move_to(rig, rig.target, 1)
        elif what == "stop":
            rig.axes[numbers[0]].stop(rig, numbers[1])
        elif what == "cue":
            rig.kernel.cue(*numbers)
        elif what == "drive":
            rig.stream.drive(*numbers)
        elif what == "pass":
            heap_lock()
            rig.loop()
            heap_unlock()
            print("pass", chip.now(), rig.kernel.state[TICKS], *rig.axes.reported)
            chip.advance(numbers[0])
        elif what == "flash":
            chip.flash(numbers[0])
        elif what == "deinit":
            rig.chain.deinit()
        else:
            raise ValueError(line)
    print("end", rig.chain.take_lost())
    for block in rig.kernel.blocks:
        print("motor", block[MODE], block[FAULT], block[POSITION])


chip.record(sys.argv[1])
play(sys.stdin)
