"""Runs on the simulated ESP32: the lines of host_tests/runtime/stream_replay.py, but words leave by
I2S instead of into a file. Instead of `batch n` there are

    pass us      the main loop's part, once; then time passes
    flash us     a sector of flash is written

and `new` takes the arguments `motors width buffers`. After each pass it prints the time in µs, how
many ticks are done, and the reported positions of the motors; at the end, the motors whose position
is lost, then each motor's mode, fault and position.
"""

import sys

import chip
from micropython import heap_lock, heap_unlock
from stream_replay import Rig, request

from framestep.hal.esp32.chain import Chain
from framestep.motors.samples import sample
from framestep.pulse.stepper import FAULT, MODE, POSITION, TICKS


class ChainRig(Rig):
    """Motors behind a chain: steps of motor i on output 20·i, its direction, inverted if i is odd,
    on output 20·i + 1."""

    def __init__(self, motors, width, buffers):
        self.buffers = buffers
        super().__init__(motors, width, (0, 20))

    def attach(self, steps):
        self.chain = Chain(self.stream, self.kernel, steps, self.buffers, 16, 17, 21)

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
            rig = ChainRig(*numbers)
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
            request(rig, what, numbers)
    print("end", rig.chain.take_lost())
    for block in rig.kernel.blocks:
        print("motor", block[MODE], block[FAULT], block[POSITION])


chip.record(sys.argv[1])
play(sys.stdin)
