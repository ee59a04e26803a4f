"""Runs on MicroPython, for stream_cost.py: RATE MS. Does what the main loop of an ESP32 does for
eight motors, a pass each millisecond, with a stand-in for I2S. Prints the speed of the last ticks,
steps/s."""

import sys
from array import array


class Clock:
    """In the place of `time`."""

    us = 0

    @staticmethod
    def ticks_us():
        return Clock.us


class Machine:
    """In the place of `machine` and `select`: an I2S that takes a buffer whenever one has been
    played."""

    POLLOUT = TX = STEREO = taken = 0

    def __init__(self, *_, **__):
        pass

    def write(self, frames):
        if Machine.taken * 1024 > Clock.us:
            return 0
        Machine.taken += 1
        return len(frames)

    def ipoll(self, *_):
        pass

    register = ipoll


Machine.I2S = Machine.Pin = Machine.poll = Machine  # type: ignore[attr-defined]
sys.modules["time"] = Clock  # type: ignore[assignment]
sys.modules["machine"] = sys.modules["select"] = Machine  # type: ignore[assignment]

from framestep.hal.esp32.chain import Chain  # noqa: E402
from framestep.hal.stream import Stream  # noqa: E402
from framestep.motors.axes import Axes  # noqa: E402
from framestep.pulse.engine import CYCLES  # type: ignore[attr-defined]  # noqa: E402
from framestep.pulse.kernel import StepKernel  # noqa: E402
from framestep.pulse.stepper import POSITION, TICKS  # noqa: E402

MOTORS = 8
SETUP = 640  # cycles: 5 µs
BUFFERS = 24
ACCELERATION = 2_000_000
LAST = 100  # ms


class Hal:
    """As much of a HAL as axes need."""

    def __init__(self):
        steps = [1 << 2 * i for i in range(MOTORS)]
        stream = Stream(steps, [2 << 2 * i for i in range(MOTORS)])
        self.port = self
        self.kernel = StepKernel(MOTORS, CYCLES, stream.clock)
        for i in range(MOTORS):
            self.kernel.configure(i, stream.fifo(i), 0, SETUP, False)
        self.chain = Chain(stream, self.kernel, steps, BUFFERS, 0, 0, 0)

    def glance(self):
        """As a port: no questions come."""

    look_for_stop = glance

    def irq_off(self):
        return 0

    def irq_on(self, state):
        pass


def build(rate, ms):
    hal = Hal()
    axes = Axes(hal)
    for axis in axes:
        axis.set_speed(rate, ACCELERATION)
        axis.move_to(hal, array("i", [0, 10 * rate]), 1)
    state = hal.kernel.state
    ticks = position = 0
    for ms_left in range(ms, 0, -1):
        if ms_left == LAST:
            ticks = state[TICKS]
            position = hal.kernel.blocks[0][POSITION]
        axes.feed()
        hal.chain.serve()
        Clock.us += 1000
    made = hal.kernel.blocks[0][POSITION] - position
    print("speed", 1000 * made // (state[TICKS] - ticks))


build(int(sys.argv[1]), int(sys.argv[2]))
