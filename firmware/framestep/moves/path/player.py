"""The path that the motors follow, as phases; shared by all operations on an uploaded move.

The checks are in move_check.py. Nothing allocates after construction.
"""

from array import array

from framestep.base.native import micropython, ptr32
from framestep.motion import phases, reals
from framestep.motion.compute import compute
from framestep.motion.formula import formula
from framestep.motion.phases import put_aim
from framestep.motors.backlash import BACKLASH, MOTOR
from framestep.moves.path import path, path_check, registers
from framestep.moves.path.move_check import BATCH
from framestep.moves.path.registers import FRAME_SPEED, SCALE, SPEEDS, TOPS
from framestep.pulse import stepper

# 1 / (12 · ticks of a frame), from thousandths of a frame per second
_SCALE = formula(registers, "SCALE = SCALE / 12000 / THOUSAND")


@micropython.viper
def _ahead(axes, bits: int) -> int:
    i = 0
    while bits & 1 == 0:
        bits >>= 1
        i += 1
    p = ptr32(axes[i].phases.words)
    return (p[phases.WRITE_INDEX] - p[phases.READ_INDEX]) & (phases.PHASES - 1)


@micropython.viper
def _append_frame(
    axes,
    bits: int,
    store,
    window,
    velocity,
    r,
    position,
    index: int,
    step: int,
    last: int,
    duration: int,
    scale: int,
    port,
):
    motor = 0
    own = SPEEDS
    part = 0
    beside = 2
    if int(len(window)) > path.WINDOW_WORDS:
        beside = path.BESIDE
    before = index
    after = last - index
    if step < 0:
        before = after
        after = index
    while bits:
        if bits & 1:
            axis = axes[motor]
            store.positions(motor, index - beside, beside + beside + 1, window, 0)
            ptr32(position)[0] = ptr32(window)[beside]
            if step < 0:
                path.reverse(window, beside)
            velocity(r, FRAME_SPEED, window, axis.bounds, before, after, scale, own + TOPS - SPEEDS)
            if beside > 2:
                part = ptr32(window)[path.PART]
            backlash = axis.backlash
            backlash.turn_to(position, 0, 0)
            put_aim(axis.phases.words, r, duration, own, FRAME_SPEED, backlash, MOTOR, part)
            ptr32(r)[own] = ptr32(r)[FRAME_SPEED]
            ptr32(r)[own + 1] = ptr32(r)[FRAME_SPEED + 1]
            port.glance()
        bits >>= 1
        motor += 1
        own += 2


class UploadPlayer:
    """Player of the path through the uploaded frames on the axes.

    `numbers`, `window`, `values` and `position` are scratch for everything that plays the move.
    """

    def __init__(self, axes, store):
        self.axes = axes
        self.store = store
        self.count = axes.count
        self.excluded = 0  # bits of motors left out: disabled, under live control
        self.numbers = array("i", [0] * registers.REGISTERS)
        self.window = array("i", [0] * path.WINDOW_WORDS)  # MOST is a run's most of the time
        self.window[path.MOST] = path.MONOTONE
        # both are replaced if runs are smoothed
        self.view = self.window  # window of a run
        self.curve = path.velocity  # the function for a run's velocities
        self.values = array("i", [0] * BATCH)
        self.position = array("i", [0])
        reals.put(self.numbers, registers.THOUSAND, 1000, 0)
        reals.put(self.numbers, registers.ZERO, 0, 0)

    def motors(self):
        """Return the bits of the motors that this upload moves (field notes 3.1 and 5.4)."""
        bits = 0
        for motor in range(self.count):
            if self.store.has(motor) and not (self.excluded >> motor) & 1:
                bits |= 1 << motor
        return bits

    def set_frame_rate(self, fps_milli):
        """Set SCALE = 1 / (12 · ticks of a frame). fps_milli: thousandths of a frame per second."""
        r = self.numbers
        reals.put(r, registers.SCALE, fps_milli, 0)
        compute(r, _SCALE)

    def smooth(self, velocity):
        """Make runs use the velocities of this function, smoothing.velocity()."""
        self.view = self.values  # at least path.SMOOTH_WORDS long
        self.curve = velocity

    def slope(self, motor, index, step):
        """Return the slope at a frame, in twelfths of a step per frame, played in direction `step`.

        index: from 0 at the first frame of the upload. Leaves the frame's position in window[2].
        """
        window = self.window
        after = self._fill(window, 2, motor, index, step)
        if step < 0:
            return path.slope(window, self.axes.axes[motor].bounds, after, index)
        return path.slope(window, self.axes.axes[motor].bounds, index, after)

    def _fill(self, window, beside, motor, index, step):
        """Fill a window around a frame, with `beside` frames on either side. Return how many follow
        it in the upload."""
        store = self.store
        store.positions(motor, index - beside, 2 * beside + 1, window, 0)
        if step < 0:
            path.reverse(window, beside)
        return store.end - store.start - index

    def velocity(self, to, motor, index, step):
        """numbers[to] = a run's velocity at a frame, at the rate of SCALE, in steps per tick.

        index, step: as for slope(). It is at most the motor's top velocity at the last check().
        Return how far beyond its position the run passes the frame, Q16 of a step.
        """
        window = self.view
        bounds = self.axes.axes[motor].bounds
        top = TOPS + 2 * motor
        beside = 2 if window is self.window else path.BESIDE
        after = self._fill(window, beside, motor, index, step)
        if step < 0:
            self.curve(self.numbers, to, window, bounds, after, index, SCALE, top)
        else:
            self.curve(self.numbers, to, window, bounds, index, after, SCALE, top)
        return 0 if beside == 2 else window[path.PART]

    def first_direction(self, motor, index, step, count, always=False):
        """Return the direction of the load's first motion in `count` frames from `index` on: 1 up,
        -1 down.

        step: 1 played forward, -1 backward. Return 0 if the load does not move, or if the motor has
        no backlash, as the direction does not matter then. always: find it for such a motor, too.
        """
        if not always and not self.axes.axes[motor].backlash[BACKLASH]:
            return 0
        found = 0
        while not found and count > 1:
            batch = min(count, BATCH)
            self.store.positions(
                motor, index if step > 0 else index - batch + 1, batch, self.values, 0
            )
            found = path_check.first_direction(self.values, batch, step)
            index += step * (batch - 1)
            count -= batch - 1
        return found

    def prepare_motor(self, motor):
        """Make a motor ready for phases."""
        axis = self.axes[motor]
        axis.begin_plan(self.axes.hal)
        axis.block[stepper.PLANNED] = stepper.PLAN_SEGMENTS | stepper.PLAN_TIMED
        axis.set_more_to_come(True)

    def end_phases(self, bits):
        """Let the motors come to rest at the end of the last phase: no further ones follow."""
        for motor in range(self.count):
            if (bits >> motor) & 1:
                self.axes[motor].set_more_to_come(False)

    def phases_ahead(self, bits):
        """Return how many phases wait for the first of these motors; the others have about as
        many."""
        return _ahead(self.axes.axes, bits)

    def append_frame(self, bits, index, step, duration, scale, window, velocity):
        """Append the cubic to frame `index` for each motor of these bits; step: 1 or -1 (backward).

        window, velocity: view and curve, or `window` and path.velocity for a path through the
        positions themselves.

        duration: register, in ticks. The cubic begins with the motor's velocity in SPEEDS and ends
        with the frame's velocity, at the rate of the register `scale`. That one is then kept in
        SPEEDS.
        """
        store = self.store
        _append_frame(
            self.axes.axes,
            bits,
            store,
            window,
            velocity,
            self.numbers,
            self.position,
            index,
            step,
            store.end - store.start,
            duration,
            scale,
            self.axes.hal.port,
        )
