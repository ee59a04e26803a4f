"""Whether motors can follow an uploaded move, and which limit it exceeds (field note 5.5).

Registers of real numbers are in `numbers` (registers.py). Nothing allocates after construction.
"""

from array import array

from framestep.base import results
from framestep.base.native import const
from framestep.motion import reals
from framestep.motion.compute import compute
from framestep.motion.formula import formula
from framestep.motors import bounds
from framestep.motors.backlash import BACKLASH, OFFSET
from framestep.motors.bounds import LOWER, UPPER
from framestep.motors.rates import MAX_ACCELERATION, MAX_VELOCITY, TICKS_PER_SECOND, VELOCITY_LIMIT
from framestep.moves.path import path, path_check, registers
from framestep.pulse import stepper

FASTEST_FPS = const(200000)  # thousandths of a frame per second: a frame of 5 ms
HALF = const(0x20000000)
# steps/s²: a corner's cubics take up to six times this, the most that the kernel's numbers hold
HARDEST = const(2500000)

# bit of Stops.unreported above its FAULT_ bits: an exceeded limit to be reported on the REPL
UNREPORTED = const(0x200)
BATCH = const(32)  # frames checked in one call
_FARTHEST = const(1 << 23)  # steps from frame to frame that bends() can work with
# from this rate on, limits are so small that they are counted in 256ths of a step
_FINE = const(3000)
# times that a motor may lower the rate by just what it needs; after that by at least a 32nd
_EXACT = const(16)

# Limits of a motor from frame to frame. The kernel's sum of a frame's changes goes a tick beyond
# the frame: by 2 / (its ticks).
_FROM_FRAME_TO_FRAME = formula(
    registers,
    """
    FPS = FPS / THOUSAND
    TOP_VELOCITY = TOP_VELOCITY / FPS
    TOP_ACCELERATION = TOP_ACCELERATION / FPS / FPS
    TOP_CHANGE = TOP_CHANGE * THOUSAND / (2 * FPS + THOUSAND) / FPS / FPS
    TOP_PULSED = TOP_PULSED / FPS
    """,
)
_BENDS_ALLOWED = formula(
    registers,
    """
    FPS = FPS / THOUSAND
    TOP_VELOCITY = TOP_VELOCITY / FPS
    square = FPS * FPS
    TOP_ACCELERATION = TOP_ACCELERATION / square
    RAMP_RATE = RAMP_RATE / square
    """,
)

# Rates, in thousandths of a frame per second, at which a motor can follow what bends() has found
_RATE_FOR_VELOCITY = formula(registers, "-> rate", "rate = TOP_VELOCITY / STEPS * THOUSAND")
# acceleration = BENT · rate² + GATHERED · ramp, where ramp is RAMP_RATE or half of rate², whichever
# is less
_HALF_FOR_RAMP = formula(
    registers,
    """
    sum = GATHERED / 2 + BENT
    assert sum > ZERO
    FPS_SQUARED = TOP_ACCELERATION / sum
    TOP_ACCELERATION = TOP_ACCELERATION - GATHERED * RAMP_RATE
    """,
)
_REST_FOR_BEND = formula(registers, "FPS_SQUARED = max(FPS_SQUARED, TOP_ACCELERATION / BENT)")
_RATE_FOR_ACCELERATION = formula(registers, "-> rate", "rate = sqrt(FPS_SQUARED) * THOUSAND")
# The size of a number, negated, so that floor() rounds it up, but not because of a rounding error.
_ROUNDED_UP = formula(
    registers,
    "number -> below",
    """
    size = max(number, -number)
    below = size / 2 ** 20 - size
    """,
)
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


class MoveCheck:
    """Check of the path through the uploaded frames against the motors' settings.

    player: the UploadPlayer, whose registers and scratch it shares. strict: setting `strict_moves`.
    """

    def __init__(self, player, strict):
        self.axes = player.axes
        self.store = player.store
        self.count = player.count
        self.numbers = player.numbers
        self.window = player.window
        self.values = player.values
        self.words = array("i", [0] * path_check.CHECK_WORDS)
        # rate at which the motors can follow the last move checked, thousandths of a frame/s
        self.rate = 0
        self.strict = strict
        self.hardest = 0  # change of the steps from frame to frame that the board can play
        # the limit that the last move checked exceeds
        self.exceeded = array("i", [0] * results.EXCEEDED_WORDS)

    def check(self, bits, begin, count, fps_milli, step, directions, ramp=0, going=False):
        """Check that motors can follow `count` frames from index `begin` on (field note 5.5).

        step: 1 played forward, -1 backward. directions: those for which the motors' backlash is
        taken up at the first frame, unless `going`. Return OK; ERR_RANGE if a motor would need more
        than its velocity, including the backlash where the path turns, or more than the board can
        make; or the code of a soft limit. Too high an acceleration is refused only if `strict`.
        `exceeded` says what was exceeded; of frames that are too fast, the fastest of that motor.

        ramp: acceleration, in frames/s², with which that rate is reached, from rest unless `going`.
        With a ramp the check fails only if no lower rate is possible either, including the curve
        between the frames. Then `rate` is the rate at which all motors can follow, at most
        fps_milli.
        """
        self.exceeded[results.WHAT] = results.EXCEEDED_NOTHING
        self.rate = fps_milli
        if ramp and count == 2 and not going:
            self.rate = min(fps_milli, 1000)  # from rest to rest
        words = self.words
        values = self.values
        for motor in range(self.count):
            if not (bits >> motor) & 1:
                continue
            axis = self.axes[motor]
            reals.fetch(self.numbers, registers.TOPS + 2 * motor, axis.numbers, MAX_VELOCITY)
            if ramp:
                words[path_check.FASTEST] = _FARTHEST
                words[path_check.STEEPEST] = words[path_check.HARDEST] = 0x3FFFFFFF
            else:
                self._allow(axis, fps_milli)
            words[path_check.SHARPEST] = 0
            words[path_check.SEEN] = 0
            words[path_check.FASTEST_AT] = 0
            words[path_check.BACKLASH] = axis.backlash[BACKLASH]
            words[path_check.OFFSET] = self._offset(motor, directions, going)
            words[path_check.TAKEN] = 0
            reals.copy_word(words, path_check.LOWEST, axis.bounds, LOWER)
            reals.copy_word(words, path_check.HIGHEST, axis.bounds, UPPER)
            # Without backlash the direction makes no difference, and forward reads faster.
            order = step if axis.backlash[BACKLASH] else 1
            at = begin if order == step else begin + step * (count - 1)
            first = at
            done = 0
            while done < count:
                batch = min(count - done, BATCH)
                self.store.positions(motor, at if order > 0 else at - batch + 1, batch, values, 0)
                at += order * batch
                found = path_check.check(words, values, batch, order)
                if found == path_check.TOO_FAST:
                    break
                if found != path_check.FITS:
                    if found == path_check.TOO_STEEP or found == path_check.TOO_HARD:
                        self._exceeded(
                            path_check.TOO_HARD if ramp else found,
                            motor,
                            first + order * words[path_check.SEEN],
                            words[path_check.FOUND],
                        )
                        return results.ERR_RANGE
                    high = found == path_check.TOO_HIGH
                    self.blame(
                        results.EXCEEDED_UPPER if high else results.EXCEEDED_LOWER,
                        motor,
                        first + order * words[path_check.SEEN],
                        results.OK,
                    )
                    if high:
                        return (
                            results.ERR_SOFT_UP
                            if axis.upper_enabled or axis.partner
                            else results.ERR_RANGE
                        )
                    return (
                        results.ERR_SOFT_LOW
                        if axis.lower_enabled or axis.partner
                        else results.ERR_RANGE
                    )
                done += batch
            if words[path_check.FASTEST_AT]:
                self._exceeded(
                    path_check.TOO_HARD if ramp else path_check.TOO_FAST,
                    motor,
                    first + order * words[path_check.FASTEST_AT],
                    words[path_check.FASTEST],
                )
                return results.ERR_RANGE
            if not ramp and count > 1:
                end = begin
                if not self._bends_hard(motor, end, step):
                    end += step * (count - 1)
                if end == begin or self._bends_hard(motor, end, -step):
                    self._exceeded(path_check.TOO_HARD, motor, end, 0)
                    return results.ERR_RANGE
            if ramp:
                self.window[path.MOST] = path.FROM_REST
                fits = self._slow_down(motor, begin, count, step, directions, ramp, going)
                self.window[path.MOST] = path.MONOTONE
                if not fits:
                    return results.ERR_RANGE
            if words[path_check.SHARPEST]:
                self._exceeded(
                    path_check.FITS,
                    motor,
                    first + order * words[path_check.SHARPEST_AT],
                    words[path_check.SHARPEST],
                )
        return results.OK

    def _bends_hard(self, motor, index, inward):
        """Return whether the path bends harder than the board can play at a frame where a run ends,
        because of the frame beyond. inward: 1 or -1, to the next frame of the run.

        With few steps to that frame it does not matter: its cubic has no more than six times their
        acceleration.
        """
        store = self.store
        if not 0 < index < store.end - store.start:
            return False
        store.positions(motor, index - 1, 3, self.values, 0)
        return path_check.bend(self.values, 1 + inward) > self.hardest

    def _offset(self, motor, directions, going):
        """Return how far a motor is from its load at the first frame; `going`: as planned."""
        backlash = self.axes[motor].backlash
        return backlash[OFFSET] if going else backlash.offset_for(directions[motor])

    def _allow(self, axis, fps_milli):
        """Put a motor's limits from frame to frame, in steps, into `words`.

        Leaves frames per second in FPS.

        Positions are rounded to steps, which alone causes differences of ±1 and changes of ±2.
        """
        r = self.numbers
        words = self.words
        kernel = self.axes.kernel.state
        pulsed = min(
            VELOCITY_LIMIT,
            TICKS_PER_SECOND * kernel[stepper.CYCLES] // axis.block[stepper.SHORTEST],
        )
        reals.put(r, registers.FPS, fps_milli, 0)
        reals.put(r, registers.TOP_VELOCITY, axis.velocity, 0)
        reals.put(r, registers.TOP_ACCELERATION, axis.acceleration, 0)
        reals.put(r, registers.TOP_CHANGE, HARDEST, 0)
        reals.put(r, registers.TOP_PULSED, pulsed, 0)
        compute(r, _FROM_FRAME_TO_FRAME)
        words[path_check.FASTEST] = reals.floor(r, registers.TOP_VELOCITY, HALF) + 1
        words[path_check.HARDEST] = reals.floor(r, registers.TOP_CHANGE, HALF) + 2
        self.hardest = words[path_check.HARDEST]
        words[path_check.STEEPEST] = min(
            reals.floor(r, registers.TOP_ACCELERATION, HALF) + 2, self.hardest
        )
        if self.strict:
            words[path_check.HARDEST] = words[path_check.STEEPEST]
        words[path_check.PULSED] = reals.floor(r, registers.TOP_PULSED, HALF) + 2

    def _slow_down(self, motor, begin, count, step, directions, ramp, going):
        """Lower `rate` until a motor can follow the curve through the frames that check() accepted.

        Return False if no rate is low enough. What fits at a rate fits at any lower one, so one
        pass over the frames is enough.
        """
        words = self.words
        axis = self.axes[motor]
        store = self.store
        lowered = 0
        words[path_check.OFFSET] = self._offset(motor, directions, going)
        self._allow_bends(axis, ramp)
        rests = 0 if going else 1
        while True:
            batch = min(count, BATCH - 4)
            if batch == count:
                rests |= 2
            store.positions(
                motor, (begin if step > 0 else begin - batch + 1) - 2, batch + 4, self.values, 0
            )
            done = 0
            while True:
                done = path_check.bends(
                    words,
                    self.values,
                    axis.bounds,
                    self.window,
                    done,
                    batch,
                    begin,
                    store.end - store.start,
                    step,
                    rests,
                )
                if not done:
                    break
                exceeded = self.exceeded
                exceeded[results.WHAT] = results.EXCEEDED_SLOWED
                exceeded[results.MOTOR] = motor
                exceeded[results.FRAME] = store.start + begin + step * (done - 1)
                exceeded[results.BY] = self._lower(axis, ramp)
                lowered += 1
                if lowered > _EXACT:
                    exceeded[results.BY] = min(exceeded[results.BY], self.rate - (self.rate >> 5))
                if exceeded[results.BY] < 1:
                    exceeded[results.WHAT] = results.EXCEEDED_BOARD
                    return False
                self.rate = exceeded[results.BY]
                self._allow_bends(axis, ramp)
            if batch == count:
                return True
            rests = 0
            begin += step * (batch - 1)
            count -= batch - 1

    def _allow_bends(self, axis, ramp):
        """Put the limits for bends() at `rate` into `words`."""
        r = self.numbers
        words = self.words
        fine = self.rate >= _FINE
        words[path_check.FINE] = 1 if fine else 0
        reals.put(r, registers.FPS, self.rate, 0)
        reals.put(r, registers.TOP_VELOCITY, axis.velocity, 0)
        reals.put(r, registers.TOP_ACCELERATION, axis.acceleration, 8 if fine else 0)
        reals.put(r, registers.RAMP_RATE, ramp, 18 if fine else 15)
        compute(r, _BENDS_ALLOWED)
        words[path_check.FASTEST] = reals.floor(r, registers.TOP_VELOCITY, HALF)
        words[path_check.STEEPEST] = reals.floor(r, registers.TOP_ACCELERATION, HALF)
        # the rate changes by no more than itself within a frame
        words[path_check.RAMP] = reals.floor(r, registers.RAMP_RATE, 1 << (17 if fine else 14))

    def _lower(self, axis, ramp):
        """Return the highest rate at which the motor can follow what bends() has found, or 0."""
        r = self.numbers
        words = self.words
        rate = self.rate
        if words[path_check.FOUND] > 0:
            reals.put(r, registers.TOP_VELOCITY, axis.velocity, 0)
            reals.put(r, registers.STEPS, words[path_check.FOUND], 0)
            compute(r, _RATE_FOR_VELOCITY)
            rate = min(rate, reals.floor(r, _RATE_FOR_VELOCITY.rate, HALF))
        reals.put(r, registers.TOP_ACCELERATION, axis.acceleration, 0)
        reals.put(r, registers.RAMP_RATE, ramp, 0)
        reals.put(r, registers.BENT, words[path_check.BENT], 0)
        reals.put(r, registers.GATHERED, words[path_check.GATHERED], 0)
        if not compute(r, _HALF_FOR_RAMP):
            return rate
        if reals.sign(r, registers.TOP_ACCELERATION) >= 0:
            if not reals.sign(r, registers.BENT):
                return rate
            compute(r, _REST_FOR_BEND)
        compute(r, _RATE_FOR_ACCELERATION)
        return min(rate, reals.floor(r, _RATE_FOR_ACCELERATION.rate, HALF))

    def blame(self, what, motor, index, code):
        """Note in `exceeded` the motor and frame for which something is refused. Return the
        code."""
        exceeded = self.exceeded
        exceeded[results.WHAT] = what
        exceeded[results.MOTOR] = motor
        exceeded[results.FRAME] = self.store.start + index
        exceeded[results.BY] = 0
        return code

    def refuse_rate(self, fps_milli):
        """Note in `exceeded` that a frame rate is above FASTEST_FPS. Return the code."""
        exceeded = self.exceeded
        exceeded[results.WHAT] = results.EXCEEDED_RATE
        exceeded[results.MOTOR] = exceeded[results.FRAME] = 0
        exceeded[results.BY] = fps_milli
        exceeded[results.ROOM] = FASTEST_FPS
        return results.ERR_RANGE

    def note_excess(self, register, limit):
        """BY = how far the size of a number, steps/s or steps/s², is above a limit."""
        r = self.numbers
        reals.copy(r, _ROUNDED_UP.number, register)
        compute(r, _ROUNDED_UP)
        self.exceeded[results.BY] = max(-reals.floor(r, _ROUNDED_UP.below, HALF) - limit, 1)

    def _exceeded(self, found, motor, index, amount):
        """Note in `exceeded` what check() has found at a frame. FPS: frames per second, from
        _allow()."""
        exceeded = self.exceeded
        r = self.numbers
        axis = self.axes[motor]
        steep = found == path_check.FITS or found == path_check.TOO_STEEP
        reals.put(r, registers.STEPS, amount, 0)
        reals.multiply(r, registers.STEPS, registers.STEPS, registers.FPS)
        if steep:
            reals.multiply(r, registers.STEPS, registers.STEPS, registers.FPS)
        amount = reals.floor(r, registers.STEPS, HALF)
        if (
            found == path_check.FITS
            and exceeded[results.WHAT] == results.EXCEEDED_ACCELERATION
            and amount - axis.acceleration <= exceeded[results.BY]
        ):
            return  # another motor's corner is sharper
        exceeded[results.MOTOR] = motor
        exceeded[results.FRAME] = self.store.start + index
        if found == path_check.TOO_HARD:
            exceeded[results.WHAT] = results.EXCEEDED_BOARD
            exceeded[results.BY] = 0
        else:
            exceeded[results.WHAT] = (
                results.EXCEEDED_ACCELERATION if steep else results.EXCEEDED_VELOCITY
            )
            exceeded[results.BY] = max(amount - (axis.acceleration if steep else axis.velocity), 1)

    def apply_roll(self, motor, velocity, ticks, backward, positions):
        """Move positions[motor] by the length of a ramp from or to rest (field note 6.2).

        velocity, ticks: registers; the length is half of their product, subtracted if `backward`.
        Return False if that is outside a soft limit or the range of positions, or exceeds the
        motor's acceleration.
        """
        r = self.numbers
        axis = self.axes[motor]
        if not reals.sign(r, velocity):
            return bounds.beyond(axis, positions, motor) == 0
        if self.too_steep(motor, velocity, ticks):
            return False
        reals.copy(r, _RAMP_LENGTH.velocity, velocity)
        reals.copy(r, _RAMP_LENGTH.ticks, ticks)
        compute(r, _RAMP_LENGTH)
        shifted = self.shift(positions, motor, _RAMP_LENGTH.steps, backward)
        return shifted and bounds.beyond(axis, positions, motor) == 0

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
