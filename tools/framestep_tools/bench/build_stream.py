"""Runs on MicroPython, for builder_cost.py: RATE MS. Does what the main loop of an ESP32 does for
eight motors, a pass each millisecond, without I2S. Prints the speed of the last 100 ms, steps/s."""

import sys
from array import array


class Absent:
    I2S = Pin = POLLOUT = poll = None


sys.modules["machine"] = sys.modules["select"] = Absent  # type: ignore[assignment]

from framestep.hal.esp32.chain import FRAMES, WORDS, move_down, to_frames  # noqa: E402
from framestep.hal.stream import Stream  # noqa: E402
from framestep.motors.axes import Axes  # noqa: E402
from framestep.pulse.engine import CYCLES  # type: ignore[attr-defined]  # noqa: E402
from framestep.pulse.kernel import StepKernel  # noqa: E402
from framestep.pulse.stepper import POSITION  # noqa: E402

MOTORS = 8
SETUP = 640  # cycles: 5 µs
AHEAD = 28  # ticks, of 24 buffers
ACCELERATION = 2_000_000


class Hal:
    """As much of a HAL as axes need."""

    def __init__(self):
        steps = [1 << 2 * i for i in range(MOTORS)]
        self.stream = Stream(steps, [2 << 2 * i for i in range(MOTORS)])
        self.kernel = StepKernel(MOTORS, CYCLES, self.stream.clock)
        for i in range(MOTORS):
            self.kernel.configure(i, self.stream.fifo(i), 0, SETUP, False)
        self.stream.attach(self.kernel, AHEAD)

    def irq_off(self):
        return 0

    def irq_on(self, state):
        pass


def build(rate, ms):
    hal = Hal()
    axes = Axes(hal)
    words = array("i", [0] * (FRAMES + 4 * WORDS))
    frames = bytearray(FRAMES * 4)
    for axis in axes:
        axis.set_speed(rate, ACCELERATION)
        axis.move_to(hal, array("i", [0, 10 * rate]), 1)
    count = 0
    before = 0
    for tick in range(ms):
        if tick == ms - 100:
            before = hal.kernel.blocks[0][POSITION]
        axes.feed()
        hal.stream.fill(words, 1, count)
        count += WORDS
        if count > FRAMES:
            to_frames(frames, words)
            count -= FRAMES
            move_down(words, count, FRAMES)
    print("speed", 10 * (hal.kernel.blocks[0][POSITION] - before))


build(int(sys.argv[1]), int(sys.argv[2]))
