"""Fakes of the parts around a module under test, in one place, so that all tests use the same ones.

Motors that are only numbers, an uploaded move that is only lists, switches that nobody touches,
lights and a camera that record their calls. `Pins` in host_tests/io/pins.py does the same for a HAL
that has only pins, `Bench` in host_tests/pulse/engine.py for the pulse engines.
"""

from array import array
from itertools import pairwise

from framestep.base.native import addressof, as_word
from framestep.motors import samples
from framestep.motors.axes import Axes
from framestep.motors.axis import Axis
from framestep.motors.backlash import make_backlash
from framestep.motors.feeder import MIRRORED, WORK_WORDS
from framestep.motors.positions import Positions
from framestep.moves.operation_runner import OperationRunner
from framestep.moves.upload.store import EMPTY, READY
from framestep.protocol.messages import OK
from framestep.pulse import stepper
from host_tests.pulse.engine import Bench

STEPS_PER_S = 4194  # of the kernel's velocity, roughly


class Motor:
    """An axis that is only its words: it does not move unless a test says so."""

    partner = leader = None
    reversed = 0

    def __init__(self):
        self.block = array("i", [0] * stepper.BLOCK_WORDS)
        self.work = array("i", [0] * WORK_WORDS)
        self.block[stepper.WORK] = as_word(addressof(self.work))
        self.backlash = make_backlash(self.block)

    position_to = Axis.position_to

    def couple(self, partner):
        """Make the next motor do the same."""
        self.partner, partner.leader = partner, self
        self.work[MIRRORED] = 1

    def moves(self, velocity, mode=stepper.RUN):
        """Move at `velocity` steps/s; 0: at rest."""
        self.block[stepper.MODE] = mode if velocity else stepper.IDLE
        self.block[stepper.VELOCITY] = velocity * STEPS_PER_S
        if velocity:
            self.block[stepper.DOWN] = -1 if velocity < 0 else 0


class Motors(list):
    """Some motors, with as much of Axes as io/ needs."""

    def __init__(self, count=8):
        self.kernel = self
        self.state = array("i", [0] * stepper.HEADER_WORDS)
        super().__init__(Motor() for _ in range(count))
        for motor, following in pairwise(self):
            motor.block[stepper.NEXT] = as_word(addressof(following.block))
        self.state[stepper.FIRST] = as_word(addressof(self[0].block))
        self.count = count
        self.positions = Positions(count)


class UploadedMove:
    """An upload as lists of positions, one for each motor, or None for a motor without; the first
    frame is `start`."""

    def __init__(self, *paths, start=1):
        self.paths = paths
        frames = max((len(path) for path in paths if path is not None), default=0)
        self.state = READY if frames else EMPTY
        self.start = start
        self.end = start + frames - 1

    def has(self, motor):
        return self.paths[motor] is not None

    def position(self, motor, index, words, k):
        words[k] = int(self.paths[motor][index])

    def positions(self, motor, index, count, words, k):
        path = self.paths[motor]
        for i in range(count):
            words[k + i] = int(path[min(max(index + i, 0), len(path) - 1)])


class NoSwitches:
    """Safety inputs that nobody touches. code: refuses every motor if not OK; held: its active
    limits."""

    code = OK
    held = 0
    active = False

    def limit_blocking(self, motor, target, i):
        return self.code

    def active_limits(self, motor):
        return self.held


class RecordedOutputs:
    """Lights and camera that record `calls`, and the `signals` as (tick, mask, values)."""

    delay_ms = hold_ms = 0

    def __init__(self):
        self.calls = []
        self.signals = []

    def schedule(self, tick, mask, values):
        self.signals.append((tick, mask, values))

    def __getattr__(self, name):
        return lambda *arguments: self.calls.append((name, *arguments))

    def finished(self):
        return True


class OperationBench:
    """Motors on a kernel, and an OperationRunner with their upload; a pass of the main loop after
    each tick.

    paths: as for UploadedMove. ticks: first value of the kernel's counter of ticks.
    """

    def __init__(self, *paths, start=1, ticks=None, velocity=50_000, acceleration=1_000_000):
        self.bench = Bench(len(paths)).settle()
        self.kernel = self.bench.state
        if ticks is not None:
            self.kernel[stepper.TICKS] = ticks
        self.axes = Axes(self.bench)
        for axis in self.axes.axes:
            axis.set_speed(velocity, acceleration)
        self.store = UploadedMove(*paths, start=start)
        self.safety = NoSwitches()
        self.run_outputs = RecordedOutputs()
        self.operations = OperationRunner(self.axes, self.store, self.safety)
        self.player = self.operations.player
        self.move_check = self.operations.move_check
        self.reported = []  # MOVE TIME of each reported frame
        self.ends = 0  # RT_ENDs

    def run(self, ticks=1):
        for _ in range(ticks):
            self.bench.tick()
            alarm = samples.sample(self.kernel, self.axes.samples)
            if alarm and self.operations.running and self.operations.reached():
                self.reported.append(self.operations.move_time)
            while self.operations.poll() | self.axes.feed():
                pass
            if self.operations.rt_end_due:
                self.operations.rt_end_due = False
                self.ends += 1
        return self

    def until(self, state, limit=20_000):
        """Run until the OperationRunner has that state."""
        while self.operations.state != state:
            self.run()
            limit -= 1
            assert limit, f"the runner of operations stays in state {self.operations.state}"
        return self

    def rest(self, limit=30_000):
        """Run until nothing is under way and everything is at rest."""
        while self.operations.state or self.axes.moving:
            self.run()
            limit -= 1
            assert limit, f"no rest; the runner of operations is in state {self.operations.state}"
        return self

    def place(self, motor=0):
        return self.axes[motor].block[stepper.POSITION]

    def stand_on(self, *places):
        """Put the motors there, at rest."""
        for axis, place in zip(self.axes.axes, places, strict=True):
            assert axis.set_position(array("i", [place]), 0)

    def limit(self, lower=None, upper=None, motor=0):
        """Set soft limits of a motor, in steps; None for none."""
        words = array("i", [0 if lower is None else lower, 0 if upper is None else upper])
        assert self.axes[motor].set_limits(lower is not None, upper is not None, words, 0)

    def now(self):
        """Return when the pulses of the next tick begin, engine cycles."""
        return self.bench.due + self.kernel[stepper.AHEAD]

    def place_at(self, cycle, motor=0):
        """Return a motor's position at a moment by the edges on its pins, if it was 0 before the
        first edge."""
        times, ways = self.bench.times(motor)
        return int(ways[times <= cycle].sum())
