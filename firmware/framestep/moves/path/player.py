"""The path that the motors follow, as phases; shared by all operations on an uploaded move.

The checks are in move_check.py. Nothing allocates after construction.
"""

from framestep.base.native import micropython, ptr32
from framestep.motion import phases, reals
from framestep.motion.compute import compute
from framestep.motion.formula import formula
from framestep.motion.phases import put_aim
from framestep.motors.backlash import MOTOR
from framestep.motors.motor import MAX_ACCELERATION
from framestep.moves.path import path, registers
from framestep.moves.path.move_check import HALF, MoveCheck
from framestep.moves.path.registers import FRAME_SPEED, SCALE, SPEEDS, TOPS
from framestep.pulse import stepper

# A ramp between rest and a velocity exceeds the acceleration, apart from rounding.
_TOO_STEEP = formula(
    registers,
    "velocity, ticks, acceleration",
    """
    rate = velocity / ticks
    assert max(rate, -rate) > acceleration + acceleration / 2 ** 20
    """,
)
# steps/s²
_RAMP_NEEDS = formula(
    registers, "velocity, ticks -> needed", "needed = velocity / ticks * THOUSAND * THOUSAND"
)
_RAMP_LENGTH = formula(registers, "velocity, ticks -> steps", "steps = velocity * ticks / 2")
# Half a step is added so that floor() rounds.
_ROUNDED = formula(registers, "steps -> rounded", "rounded = steps + 0.5")


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


class UploadPlayer(MoveCheck):
    """Player of the path through the uploaded frames on the axes."""

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

    def apply_roll(self, motor, velocity, ticks, backward, positions):
        """Move positions[motor] by the length of a ramp from or to rest (field note 6.2).

        velocity, ticks: registers; the length is half of their product, subtracted if `backward`.
        Return False if that is outside a soft limit or the range of positions, or exceeds the
        motor's acceleration.
        """
        r = self.numbers
        axis = self.axes[motor]
        if not reals.sign(r, velocity):
            return axis.beyond(positions, motor) == 0
        if self.too_steep(motor, velocity, ticks):
            return False
        reals.copy(r, _RAMP_LENGTH.velocity, velocity)
        reals.copy(r, _RAMP_LENGTH.ticks, ticks)
        compute(r, _RAMP_LENGTH)
        shifted = self.shift(positions, motor, _RAMP_LENGTH.steps, backward)
        return shifted and axis.beyond(positions, motor) == 0

    def too_steep(self, motor, velocity, ticks):
        """Return whether a ramp from rest to a velocity, both registers, exceeds the motor's
        acceleration."""
        r = self.numbers
        if not reals.sign(r, velocity):
            return False
        reals.copy(r, _TOO_STEEP.velocity, velocity)
        reals.copy(r, _TOO_STEEP.ticks, ticks)
        reals.fetch(r, _TOO_STEEP.acceleration, self.axes[motor].numbers, MAX_ACCELERATION)
        return compute(r, _TOO_STEEP)

    def blame_roll(self, what, motor, index, code, velocity, ticks):
        """Note a refused ramp, like blame(). BY: excess acceleration, 0 if a limit is passed."""
        self.blame(what, motor, index, code)
        if self.too_steep(motor, velocity, ticks):
            r = self.numbers
            reals.copy(r, _RAMP_NEEDS.velocity, velocity)
            reals.copy(r, _RAMP_NEEDS.ticks, ticks)
            compute(r, _RAMP_NEEDS)
            self.note_excess(_RAMP_NEEDS.needed, self.axes[motor].acceleration)
        return code

    def shift(self, positions, motor, register, backward):
        """Add a number, rounded to a step, to positions[motor]; subtract it if `backward`.

        Return False, without a change, if that leaves the range of positions.
        """
        r = self.numbers
        reals.copy(r, _ROUNDED.steps, register)
        if backward:
            reals.negate(r, _ROUNDED.steps, _ROUNDED.steps)
        compute(r, _ROUNDED)
        steps = reals.floor(r, _ROUNDED.rounded, HALF)
        return (
            -HALF < steps < HALF
            and reals.add_within(positions, motor, positions, motor, steps) != 0
        )

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
