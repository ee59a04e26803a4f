"""A bench for the tick kernel: motors on pulse engines, a clock, and a timer whose interrupts may
come late.

Time is in engine cycles of 8 ns. The pulse engines are those of the host board (hal/host.py), but
each command is checked as well, and it is noted when an engine had nothing to do.
"""

import random

import numpy as np

from framestep.base.native_cpython import map_device
from framestep.hal.host import PulseModel
from framestep.pulse import stepper
from framestep.pulse.engine import HIGH_CYCLES, WIDTH, WIDTHS
from framestep.pulse.kernel import StepKernel, wider

PER_US = 125
PER_TICK = 1000 * PER_US
REPLAY = 7 * PER_US  # between missed interrupts for which the timer makes up
PER_COMMAND = 250  # about the time in which the kernel writes a command


def signed(word):
    """Return a 32-bit word as viper code sees it."""
    return (word + 0x8000_0000) % 0x1_0000_0000 - 0x8000_0000


class Engine(PulseModel):
    """One motor's pulse engine. Its lists hold times in cycles."""

    def __init__(self, bench, width, both_edges=False):
        self.rises = []  # if the driver steps on both edges, falling edges as well
        self.ways = []  # +1 or -1 for each of them
        self.turns = []  # times at which the direction pin changed
        self.dry = []  # (from, to): idle between two commands
        self.fullest = 0
        self.bench = bench
        self.width = width
        self.up = 1
        super().__init__(
            lambda: bench.now,
            width,
            self._rise,
            lambda at, level: self.turns.append(at),
            both_edges,
        )

    def _rise(self, at, level):
        self.rises.append(at)
        self.ways.append(1 if level == self.up else -1)

    def __setitem__(self, index, command):
        word = command & 0xFFFF_FFFF
        assert -0x8000_0000 <= command <= 0x7FFF_FFFF, (
            f"a command of more than 32 bits: {command:#x}"
        )
        assert word >> WIDTH == self.width % WIDTHS, (
            f"gap or pulses overflow in command {word:#010x}"
        )
        now = self.bench.now
        if now > self.free_at:
            self.dry.append((self.free_at, now))
        super().__setitem__(index, command)
        assert not self.lost, f"a command found the FIFO full at {now / PER_TICK:.3f} ms"
        self.fullest = max(self.fullest, len([at for at in self.waiting if at > now]))
        self.bench.now += PER_COMMAND

    @property
    def position(self):
        """Return the sum of all steps commanded so far."""
        return sum(self.ways)

    @property
    def high_cycles(self):
        return HIGH_CYCLES + wider(self.width)


class Clock:
    """The free running microsecond counter, 32 bits; reading it takes some cycles."""

    def __init__(self, bench):
        self.bench = bench

    def __getitem__(self, index):
        self.bench.now += 15
        return signed(self.bench.now // PER_US + self.bench.offset_us)


class Bench:
    """`motors` on a kernel whose tick is called by an emulated timer. As much of a HAL as Axes
    needs.

    offset_us: microsecond counter at time 0. jitter_us: greatest lateness of an interrupt. off(us,
    length_us) switches interrupts off for some time; the timer makes up for the missed ticks.
    """

    def __init__(
        self,
        motors=1,
        width=0,
        setup=625,
        invert=False,
        offset_us=0,
        jitter_us=3.0,
        seed=1,
        hold=0,
        apart=0,
    ):
        self.port = self
        self.now = 0
        self.offset_us = offset_us
        self.jitter_us = jitter_us
        self.random = random.Random(seed)
        self.clock = Clock(self)
        self.kernel = StepKernel(motors, PER_TICK, map_device(self.clock))
        self.engines = [Engine(self, width, apart > 0) for _ in range(motors)]
        self.setup = setup
        for i, engine in enumerate(self.engines):
            self.kernel.configure(i, map_device(engine), width, setup, invert, hold, apart)
            engine.up = 0 if invert else 1
        self.due = PER_TICK  # the timer's next interrupt
        self.free = 0  # when the last interrupt ended
        self.holes = []
        self.calls = 0
        self.after_tick = []  # functions called after each interrupt

    def glance(self):
        """As a port: no questions come."""

    def irq_off(self):
        return 0

    def irq_on(self, state):
        pass

    def off(self, us, length_us):
        """Switch interrupts off, `us` from now, for `length_us`."""
        start = self.now + int(us * PER_US)
        self.holes.append((start, start + int(length_us * PER_US)))

    def tick(self):
        """Run the timer's next interrupt."""
        at = self.due + int(self.random.uniform(0, self.jitter_us) * PER_US)
        for start, end in self.holes:
            if start <= at < end:
                at = end
        self.now = max(at, self.free + REPLAY)
        self.kernel.tick(None)
        self.free = self.now
        self.due += PER_TICK
        self.calls += 1
        for function in self.after_tick:
            function()

    def run(self, ticks, each=None):
        """Run a number of interrupts; `each` is called before every one, like the main loop."""
        for _ in range(ticks):
            if each:
                each()
            self.tick()

    @property
    def state(self):
        return self.kernel.state

    def block(self, motor=0):
        return self.kernel.blocks[motor]

    def put(self, motor, segments):
        """Queue segments (ticks, whole steps, fraction, velocity, acceleration, jerk) in the
        kernel's numbers."""
        block = self.block(motor)
        queue = self.kernel.queues[motor]
        for segment in segments:
            assert self.room(motor), "the segment queue is full"
            at = (block[stepper.WRITE_INDEX] % stepper.SEGMENTS) * stepper.SEGMENT_WORDS
            for i, word in enumerate((*segment, 0, PER_TICK)):
                queue[at + i] = word
            block[stepper.WRITE_INDEX] = (block[stepper.WRITE_INDEX] + 1) & 0x3FFF_FFFF

    def room(self, motor=0):
        block = self.block(motor)
        return stepper.SEGMENTS - (
            (block[stepper.WRITE_INDEX] - block[stepper.READ_INDEX]) & 0x3FFF_FFFF
        )

    def start(self, *motors):
        """Start motors at the next tick, like Axis.start()."""
        for motor in motors:
            self.block(motor)[stepper.MODE] |= stepper.RUN | stepper.START

    def settle(self, ticks=120):
        """Let the kernel find the timer's grid, as it does soon after boot."""
        self.run(ticks)
        return self

    def play(self, segments, ticks=None, motors=(0,)):
        """Start motors in the same tick on a list of segments each, keep the queues filled, and
        run.

        Runs until they are at rest, or for `ticks`. Returns when the first pulses of the first tick
        may come.
        """
        waiting = {motor: list(made) for motor, made in zip(motors, segments, strict=True)}

        def feed():
            for motor, made in waiting.items():
                while made and self.room(motor) > 8:
                    self.put(motor, [made.pop(0)])

        feed()
        self.start(*motors)
        start = self.due + self.state[stepper.AHEAD]
        limit = 100_000 if ticks is None else ticks
        while limit and (
            ticks is not None or any(self.block(motor)[stepper.MODE] for motor in motors)
        ):
            feed()
            self.tick()
            limit -= 1
        assert limit or ticks is not None, "the motion does not end"
        return start

    def times(self, motor=0):
        """Return times of a motor's rising edges (cycles) and the direction of each step."""
        engine = self.engines[motor]
        return np.array(engine.rises, dtype=float), np.array(engine.ways, dtype=int)
