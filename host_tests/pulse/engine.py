"""A bench for the tick kernel: motors on pulse engines, a clock, and a timer whose interrupts may
come late.

Time is in engine cycles of 8 ns. The pulse engines are those of the host board (hal/host.py), but
each command is checked as well, and it is noted when an engine had nothing to do.
"""

import random
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise

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
            lambda: bench.now, width, self._rise, lambda at, level: self.turns.append(at),
            both_edges,
        )  # fmt: skip

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

    look_for_stop = glance

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


ONE = 1 << 22
FINE = 1 << 27
LONGEST = 32


def rounded(x: Fraction) -> int:
    return int((x + Fraction(1, 2)) // 1)


@dataclass(frozen=True)
class Piece:
    """p + v·x + a·x²/2 + j·x³/6 for `ticks` ticks from the tick `at` on."""

    at: int
    ticks: int
    p: Fraction
    v: Fraction
    a: Fraction
    j: Fraction

    def position(self, x):
        return self.p + self.v * x + self.a * x * x / 2 + self.j * x**3 / 6

    def velocity(self, x):
        return self.v + self.a * x + self.j * x * x / 2

    def split(self):
        """Split it into pieces that fit a segment."""
        done = 0
        while done < self.ticks:
            ticks = min(LONGEST, self.ticks - done)
            yield Piece(
                self.at + done, ticks, self.position(done), self.velocity(done),
                self.a + self.j * done, self.j,
            )  # fmt: skip
            done += ticks

    def segment(self):
        """Convert to the kernel's numbers: it adds up displacements of ticks and differences."""
        whole = self.p // 1
        first = self.v + self.a / 2 + self.j / 6
        second = self.a + self.j
        # The kernel rounds the acceleration down from Q27 to Q22: add half a unit.
        return (
            self.ticks, int(whole), int((self.p - whole) * ONE), rounded(first * ONE),
            rounded(second * FINE) + 16, rounded(self.j * FINE),
        )  # fmt: skip


class Profile:
    """Pieces (ticks, acceleration) or (ticks, acceleration, jerk), from position p, velocity v."""

    def __init__(self, pieces, p=0, v=0):
        self.pieces = []
        p, v, at = Fraction(p), Fraction(v), 0
        for ticks, a, *j in pieces:
            piece = Piece(at, ticks, p, v, Fraction(a), Fraction(*j) if j else Fraction(0))
            self.pieces.append(piece)
            p, v, at = piece.position(ticks), piece.velocity(ticks), at + ticks
        self.end, self.final, self.ticks = p, v, at

    def segments(self, rest=True):
        """Return segments for the kernel; `rest`: with one at the end that comes to rest."""
        made = [part.segment() for piece in self.pieces for part in piece.split()]
        if rest:
            assert self.final == 0
            made.append((1, rounded(self.end), 0, 0, 0, 0))
        return made

    def velocity(self, times):
        """Return steps per tick at each of these times, in ticks."""
        times = np.asarray(times, dtype=float)
        result = np.zeros(len(times))
        for piece in self.pieces:
            x = times - piece.at
            inside = (x >= 0) & (x <= piece.ticks)
            x = x[inside]
            result[inside] = float(piece.v) + x * (float(piece.a) + x * float(piece.j) / 2)
        return result

    def steps(self):
        """Return (times in ticks, directions): step k is made when the position reaches k."""
        times, ways = [], []
        made = int(self.pieces[0].p // 1)
        for piece in self.pieces:
            v, a, j = float(piece.v), float(piece.a), float(piece.j)
            cuts = [0.0, float(piece.ticks)]
            # times at which the velocity is zero
            for root in np.roots([c for c in (j / 2, a, v)]) if (j or a) else []:
                if abs(root.imag) < 1e-12 and 0 < root.real < piece.ticks:
                    cuts.append(root.real)
            cuts.sort()
            p = float(piece.p - made)  # relative to the steps made, for precision
            base = made
            for start, end in pairwise(cuts):

                def at(x, p=p, v=v, a=a, j=j):
                    return p + x * (v + x * (a / 2 + x * j / 6))

                first, last = at(start), at(end)
                slack = 1e-9 * np.sign(last - first)  # a motion that ends on a step reaches it
                if last > first:
                    levels = np.arange(made - base + 1, np.floor(last + slack) + 1)
                else:
                    levels = np.arange(made - base - 1, np.ceil(last + slack) - 1, -1)
                if not len(levels):
                    continue
                low, high = np.full(len(levels), start), np.full(len(levels), end)
                rising = last > first
                for _ in range(60):
                    middle = (low + high) / 2
                    before = (at(middle) < levels) == rising
                    low, high = np.where(before, middle, low), np.where(before, high, middle)
                times.append(piece.at + high)
                ways.append(np.full(len(levels), 1 if rising else -1))
                made = base + int(levels[-1])
        if not times:
            return np.zeros(0), np.zeros(0, dtype=int)
        return np.concatenate(times), np.concatenate(ways)


def trapezoid(ticks_up, acceleration, ticks_cruise):
    """Ramp up, cruise, ramp down; the end is on a whole step if acceleration · ticks_up · (ticks_up
    + ticks_cruise) is whole."""
    return Profile(
        [(ticks_up, acceleration), (ticks_cruise, 0), (ticks_up, -Fraction(acceleration))]
    )


# ---- how far edges are from them ----------------------------------------------------------------

# At very low velocity, the kernel's rounding of the position is a long time.
ROUNDING_STEPS = 1e-4


def steady(rate, ticks, p=0):
    """Full velocity from the first tick on: no real motion begins like that."""
    return Profile([(ticks, 0)], p=p, v=Fraction(rate, 1000))


# How far a timer's grid may be off after a gap or at boot: it is not corrected below a sixteenth.
GRID_US = 16


def errors_us(bench, start, profile, motor=0, ticks=None, made=0):
    """Return the errors of a motion's edges, in µs, minus their median, which is within what a grid
    may be off.

    Near rest, the effect of rounding is subtracted. ticks: length of a steady motion that was cut
    off there; its first ticks are left out. made: edges of earlier motions.
    """
    times, ways = bench.times(motor)
    times, ways = times[made:], ways[made:]
    ideal, ideal_ways = profile.steps()
    if ticks is not None:
        count = np.count_nonzero(ideal < ticks - 0.01)
        first = np.count_nonzero(ideal <= 3)
        times, ways = times[first:count], ways[first:count]
        ideal, ideal_ways = ideal[first:count], ideal_ways[first:count]
    assert ways.tolist() == ideal_ways.tolist()
    assert len(ways) > 1
    error = (times - start) / PER_US - ideal * 1000
    offset = np.median(error)
    assert abs(offset) < GRID_US
    error -= offset
    # the velocity after the first ROUNDING_STEPS from rest
    steepest = max(float(abs(piece.a) + abs(piece.j) * piece.ticks) for piece in profile.pieces)
    slowest = np.sqrt(2 * ROUNDING_STEPS * steepest) + 1e-9
    if jerk := max(float(abs(piece.j)) for piece in profile.pieces):
        slowest = min(slowest, 2 * ROUNDING_STEPS / (6 * ROUNDING_STEPS / jerk) ** (1 / 3))
    slack = 1000 * 2 * ROUNDING_STEPS / np.maximum(np.abs(profile.velocity(ideal)), slowest)
    return np.sign(error) * np.maximum(np.abs(error) - slack, 0)


def at_rest(bench, motor=0):
    """Check a motor that has come to rest by itself."""
    block = bench.block(motor)
    assert block[stepper.MODE] == stepper.IDLE
    assert block[stepper.FAULT] == 0
    assert block[stepper.FRACTION] == block[stepper.VELOCITY] == 0
    assert bench.engines[motor].position == block[stepper.POSITION]
    engine = bench.engines[motor]
    assert not engine.rises or engine.rises[-1] + engine.high_cycles < bench.now, (
        "pulses are still on their way"
    )


def moving(rate=20_000, brake=Fraction(1, 50), motors=1, **options):
    """Make a bench with motors at a steady rate. Also returns that motion."""
    bench = Bench(motors, jitter_us=0, **options).settle()
    profile = steady(rate, 400)
    for motor in range(motors):
        bench.block(motor)[stepper.BRAKE] = int(brake * ONE)
    start = bench.play([profile.segments(rest=False)] * motors, 50, motors=range(motors))
    return bench, profile, start
