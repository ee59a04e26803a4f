"""What all plays of an uploaded move share: which motors, whether they can, how fast at each frame.

Registers of real numbers live in `numbers`; the first ones belong to this class, an operation keeps
its own from OWN on. Nothing allocates after construction.
"""

from array import array

from framestep.motion import ramps, reals, stepper
from framestep.motion.ramps import put_aim
from framestep.motors import axis as motion
from framestep.motors.backlash import PHYSICAL, motor_step
from framestep.moves import path
from framestep.native import const, micropython, ptr32
from framestep.results import (
    ERR_RANGE,
    ERR_SOFT_LOW,
    ERR_SOFT_UP,
    EXCEEDED_ACCELERATION,
    EXCEEDED_BOARD,
    EXCEEDED_LOWER,
    EXCEEDED_NOTHING,
    EXCEEDED_SLOWED,
    EXCEEDED_UPPER,
    EXCEEDED_VELOCITY,
    OK,
)

# Registers
THOUSAND = const(0)
ZERO = const(2)
X = const(4)
Y = const(6)
T = const(8)
SCALE = const(10)  # twelfths of a step per frame to steps per tick
_SPEEDS = const(12)  # per motor: velocity at the last frame queued
OWN = const(36)  # after twelve motors' velocities
_TOPS = const(64)  # per motor: its velocity as set when the play was checked, which no slope exceeds
REGISTERS = const(88)

FASTEST_FPS = const(200000)  # thousandths of a frame per second: a frame of 5 ms
HALF = const(0x20000000)
HARDEST = const(2500000)  # steps/s²: a corner's cubics have at most six times that, which the kernel's numbers hold

# Words of `exceeded`
WHAT = const(0)  # EXCEEDED_
MOTOR = const(1)
FRAME = const(2)  # scene frame
BY = const(
    3
)  # steps/s or steps/s², by what it is asked for; SLOWED: the rate instead, thousandths of a frame per second
EXCEEDED_WORDS = const(4)
UNTOLD = const(0x200)  # bit of Controller.untold, after its FAULT_ bits: the REPL is to be told of it
_BATCH = const(32)  # frames checked at a time
_FARTHEST = const(1 << 23)  # steps from frame to frame that bends() can work with
_FINE = const(3000)  # from this rate on limits are numbers so small that they are counted in parts of steps
_EXACT = const(16)  # so often a motor lowers the rate by just what it needs, then by a 32nd at least


def speed(motor):
    """The register of a motor's velocity at the last frame queued, steps per tick."""
    return _SPEEDS + 2 * motor


@micropython.viper
def _ahead(axes, bits: int) -> int:
    i = 0
    while bits & 1 == 0:
        bits >>= 1
        i += 1
    p = ptr32(axes[i].phases.words)
    return (p[ramps.TAIL] - p[ramps.HEAD]) & (ramps.PHASES - 1)


@micropython.viper
def _hop(axes, bits: int, store, window, r, place, index: int, step: int, last: int, duration: int, scale: int):
    motor = 0
    own = _SPEEDS
    while bits:
        if bits & 1:
            axis = axes[motor]
            store.positions(motor, index - 2, 5, window, 0)
            if step < 0:
                path.turn(window)
                path.velocity(r, X, window, axis.bounds, last - index, index, scale, own + _TOPS - _SPEEDS)
            else:
                path.velocity(r, X, window, axis.bounds, index, last - index, scale, own + _TOPS - _SPEEDS)
            ptr32(place)[0] = ptr32(window)[2]
            limits = axis.limits
            motor_step(axis.planned, limits, place, 0, 0)
            put_aim(axis.phases.words, r, duration, own, X, limits, PHYSICAL, 0)
            ptr32(r)[own] = ptr32(r)[X]
            ptr32(r)[own + 1] = ptr32(r)[X + 1]
        bits >>= 1
        motor += 1
        own += 2


class Follower:
    """The path through the frames of the store, for the axes."""

    def __init__(self, axes, store):
        self.axes = axes
        self.store = store
        self.count = axes.count
        self.excluded = 0  # bits of motors that take no part (disabled, under live control)
        self.numbers = array("i", [0] * REGISTERS)
        self.window = array("i", [0] * path.WINDOW_WORDS)  # MOST is for a run, but while something else is worked out
        self.window[path.MOST] = path.MONOTONE
        self.words = array("i", [0] * path.CHECK_WORDS)
        self.rate = 0  # at which the motors can follow what was checked last, thousandths of a frame per second
        self.values = array("i", [0] * _BATCH)
        self.place = array("i", [0])
        self.strict = False  # setting `strict_moves`
        self.exceeded = array("i", [0] * EXCEEDED_WORDS)  # by what the last move checked was too much for a motor
        reals.put(self.numbers, THOUSAND, 1000, 0)
        reals.put(self.numbers, ZERO, 0, 0)

    def motors(self):
        """Bits of the motors that have a part in this upload (field notes 3.1 and 5.4)."""
        bits = 0
        for motor in range(self.count):
            if self.store.has(motor) and not self.excluded >> motor & 1:
                bits |= 1 << motor
        return bits

    def frame_rate(self, fps_milli):
        """Set SCALE for fps_milli frames in 1000 s: 1 / (12 · ticks of a frame)."""
        r = self.numbers
        reals.put(r, X, fps_milli, 0)
        reals.put(r, Y, path.TWELFTHS * 1000, 0)
        reals.divide(r, X, X, Y)
        reals.divide(r, SCALE, X, THOUSAND)

    def slope(self, motor, index, step):
        """The slope at a frame, in twelfths of a step per frame of travel in direction `step`.

        index: from 0 at the first frame of the upload. Leaves the frame's position in window[2].
        """
        after = self._look(motor, index, step)
        if step < 0:
            return path.slope(self.window, self.axes.axes[motor].bounds, after, index)
        return path.slope(self.window, self.axes.axes[motor].bounds, index, after)

    def _look(self, motor, index, step):
        """Fill the window around a frame; how many frames there are behind it in the upload."""
        store = self.store
        window = self.window
        store.positions(motor, index - 2, 5, window, path.FRAMES)
        if step < 0:
            path.turn(window)
        return store.end - store.start - index

    def velocity(self, to, motor, index, step):
        """numbers[to] = velocity at a frame, at the rate of SCALE, steps per tick: see slope(). No more than the
        motor's own as check() has found it."""
        after = self._look(motor, index, step)
        bounds = self.axes.axes[motor].bounds
        top = _TOPS + 2 * motor
        if step < 0:
            path.velocity(self.numbers, to, self.window, bounds, after, index, SCALE, top)
        else:
            path.velocity(self.numbers, to, self.window, bounds, index, after, SCALE, top)

    def way(self, motor, index, step, count, anyway=False):
        """Which way the load first moves in `count` frames from `index` on, played in direction `step`: 1 up, -1 down.

        0 if it does not move, or if the motor has no play, to which it would matter; anyway: that matters, too.
        """
        if not anyway and not self.axes.axes[motor].backlash:
            return 0
        found = 0
        while not found and count > 1:
            batch = min(count, _BATCH)
            self.store.positions(motor, index if step > 0 else index - batch + 1, batch, self.values, 0)
            found = path.way(self.values, batch, step)
            index += step * (batch - 1)
            count -= batch - 1
        return found

    def check(self, bits, begin, count, fps_milli, step, ways, ramp=0, going=False):
        """Whether the motors can follow `count` frames from `begin`, played in direction `step`, at that rate (field
        note 5.5).

        ways: for what direction each motor's play is taken up at the first frame. OK, ERR_RANGE where one is asked for
        more than its velocity, also to take up its play where the path turns, or more than the board can make, or the
        code of a soft limit. More than its acceleration is refused if `strict`. `exceeded` tells what was too much.

        ramp: frames/s² with which that rate is come to on the way, from rest unless `going`. With a ramp
        nothing is too much as long as there is a lower rate at which all motors can follow, on the curve between the
        frames as well: `rate` tells it, or the one asked for if that will do.
        """
        self.exceeded[WHAT] = EXCEEDED_NOTHING
        self.rate = fps_milli
        if ramp and count == 2 and not going:
            self.rate = min(fps_milli, 1000)  # from rest to rest
        words = self.words
        values = self.values
        for motor in range(self.count):
            if not bits >> motor & 1:
                continue
            axis = self.axes[motor]
            reals.fetch(self.numbers, _TOPS + 2 * motor, axis.numbers, motion.TOP)
            if ramp:
                words[path.FASTEST] = _FARTHEST
                words[path.STEEPEST] = words[path.HARDEST] = 0x3FFFFFFF
            else:
                self._allow(axis, fps_milli)
            words[path.SHARPEST] = 0
            words[path.SEEN] = 0
            words[path.PLAY] = axis.backlash
            words[path.OFFSET] = -axis.backlash if ways[motor] < 0 else 0
            words[path.TAKEN] = 0
            reals.copy_word(words, path.LOWEST, axis.bounds, path.LOWER)
            reals.copy_word(words, path.HIGHEST, axis.bounds, path.UPPER)
            # without play it does not matter which way they are played, and forward is faster to read
            order = step if axis.backlash else 1
            at = begin if order == step else begin + step * (count - 1)
            first = at
            done = 0
            while done < count:
                batch = min(count - done, _BATCH)
                self.store.positions(motor, at if order > 0 else at - batch + 1, batch, values, 0)
                at += order * batch
                found = path.check(words, values, batch, order)
                if found != path.FITS:
                    if found == path.TOO_FAST or found == path.TOO_STEEP or found == path.TOO_HARD:
                        self._exceeded(
                            path.TOO_HARD if ramp else found, motor, first + order * words[path.SEEN], words[path.FOUND]
                        )
                        return ERR_RANGE
                    high = found == path.TOO_HIGH
                    self.blame(EXCEEDED_UPPER if high else EXCEEDED_LOWER, motor, first + order * words[path.SEEN], OK)
                    if high:
                        return ERR_SOFT_UP if axis.upper_enabled or axis.partner else ERR_RANGE
                    return ERR_SOFT_LOW if axis.lower_enabled or axis.partner else ERR_RANGE
                done += batch
            if ramp:
                self.window[path.MOST] = path.FROM_REST
                fits = self._slow_down(motor, begin, count, step, ways, ramp, going)
                self.window[path.MOST] = path.MONOTONE
                if not fits:
                    return ERR_RANGE
            if words[path.SHARPEST]:
                self._exceeded(path.FITS, motor, first + order * words[path.SHARPEST_AT], words[path.SHARPEST])
        return OK

    def _allow(self, axis, fps_milli):
        """Put into `words` what a motor's limits allow from frame to frame, in steps. Y = frames per second.

        Positions are rounded to steps before they come here, which alone makes differences of ±1 and changes of ±2.
        """
        r = self.numbers
        words = self.words
        reals.put(r, Y, fps_milli, 0)
        reals.divide(r, Y, Y, THOUSAND)  # frames per second
        reals.put(r, X, axis.velocity, 0)
        reals.divide(r, X, X, Y)
        words[path.FASTEST] = reals.floor(r, X, HALF) + 1
        reals.put(r, X, axis.acceleration, 0)
        reals.divide(r, X, X, Y)
        reals.divide(r, X, X, Y)
        words[path.STEEPEST] = reals.floor(r, X, HALF) + 2
        # the kernel's sum of a frame's changes goes a tick further than the frame: by 2 / (its ticks)
        reals.put(r, X, HARDEST, 0)
        reals.multiply(r, X, X, THOUSAND)
        reals.double(r, T, Y, 1)
        reals.add(r, T, T, THOUSAND)
        reals.divide(r, X, X, T)
        reals.divide(r, X, X, Y)
        reals.divide(r, X, X, Y)
        words[path.HARDEST] = reals.floor(r, X, HALF) + 2
        words[path.STEEPEST] = min(words[path.STEEPEST], words[path.HARDEST])
        if self.strict:
            words[path.HARDEST] = words[path.STEEPEST]
        kernel = self.axes.kernel.state
        pulsed = min(motion.FASTEST, motion.TICKS_PER_SECOND * kernel[stepper.CYCLES] // axis.block[stepper.SHORTEST])
        reals.put(r, X, pulsed, 0)
        reals.divide(r, X, X, Y)
        words[path.PULSED] = reals.floor(r, X, HALF) + 2

    def _slow_down(self, motor, begin, count, step, ways, ramp, going):
        """Lower `rate` to one at which a motor can follow the curve through frames that check() has let pass.

        False if there is none. What fits at a rate fits at any lower one, so once through the frames will do.
        """
        words = self.words
        axis = self.axes[motor]
        store = self.store
        lowered = 0
        words[path.OFFSET] = -axis.backlash if ways[motor] < 0 else 0
        self._allow_bends(axis, ramp)
        rests = 0 if going else 1
        while True:
            batch = min(count, _BATCH - 4)
            if batch == count:
                rests |= 2
            store.positions(motor, (begin if step > 0 else begin - batch + 1) - 2, batch + 4, self.values, 0)
            done = 0
            while True:
                done = path.bends(
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
                told = self.exceeded
                told[WHAT] = EXCEEDED_SLOWED
                told[MOTOR] = motor
                told[FRAME] = store.start + begin + step * (done - 1)
                told[BY] = self._lower(axis, ramp)
                lowered += 1
                if lowered > _EXACT:
                    told[BY] = min(told[BY], self.rate - (self.rate >> 5))
                if told[BY] < 1:
                    told[WHAT] = EXCEEDED_BOARD
                    return False
                self.rate = told[BY]
                self._allow_bends(axis, ramp)
            if batch == count:
                return True
            rests = 0
            begin += step * (batch - 1)
            count -= batch - 1

    def _allow_bends(self, axis, ramp):
        """Put into `words` what bends() lets pass at `rate`."""
        r = self.numbers
        words = self.words
        reals.put(r, T, self.rate, 0)
        reals.divide(r, T, T, THOUSAND)
        reals.put(r, X, axis.velocity, 0)
        reals.divide(r, X, X, T)
        words[path.FASTEST] = reals.floor(r, X, HALF)
        reals.multiply(r, T, T, T)
        reals.put(r, X, axis.acceleration, 0)
        reals.divide(r, X, X, T)
        fine = self.rate >= _FINE
        words[path.FINE] = 1 if fine else 0
        reals.double(r, X, X, 8 if fine else 0)
        words[path.STEEPEST] = reals.floor(r, X, HALF)
        reals.put(r, X, ramp << (18 if fine else 15), 0)
        reals.divide(r, X, X, T)
        # within a frame no more than the rate itself is gathered
        words[path.RAMP] = reals.floor(r, X, 1 << (17 if fine else 14))

    def _lower(self, axis, ramp):
        """The rate, or 0, that what bends() has found allows."""
        r = self.numbers
        words = self.words
        rate = self.rate
        fast = words[path.FOUND]
        bent = words[path.BENT]
        gathered = words[path.GATHERED]
        if fast > 0:
            reals.put(r, X, axis.velocity, 0)
            reals.put(r, Y, fast, 0)
            reals.divide(r, X, X, Y)
            reals.multiply(r, X, X, THOUSAND)
            rate = min(rate, reals.floor(r, X, HALF))
        # acceleration = bent · rate² + gathered · ramp, or half of rate² for the ramp where that is less
        reals.put(r, Y, gathered, -1)
        reals.put(r, T, bent, 0)
        reals.add(r, Y, Y, T)
        if reals.sign(r, Y):
            reals.put(r, X, axis.acceleration, 0)
            reals.divide(r, Y, X, Y)
            reals.put(r, T, gathered * ramp, 0)
            reals.subtract(r, X, X, T)
            if reals.sign(r, X) >= 0:
                if not bent:
                    return rate
                reals.put(r, T, bent, 0)
                reals.divide(r, X, X, T)
                if reals.compare(r, Y, X) < 0:
                    reals.copy(r, Y, X)
            reals.root(r, Y, Y)
            reals.multiply(r, Y, Y, THOUSAND)
            rate = min(rate, reals.floor(r, Y, HALF))
        return rate

    def blame(self, what, motor, index, code):
        """Keep for `exceeded` at which motor and frame something is refused; the code."""
        told = self.exceeded
        told[WHAT] = what
        told[MOTOR] = motor
        told[FRAME] = self.store.start + index
        told[BY] = 0
        return code

    def _exceeded(self, found, motor, index, amount):
        """Keep for `exceeded` what check() has found at a frame: register Y holds frames per second."""
        told = self.exceeded
        r = self.numbers
        axis = self.axes[motor]
        steep = found == path.FITS or found == path.TOO_STEEP
        reals.put(r, X, amount, 0)
        reals.multiply(r, X, X, Y)
        if steep:
            reals.multiply(r, X, X, Y)
        amount = reals.floor(r, X, HALF)
        if found == path.FITS and told[WHAT] == EXCEEDED_ACCELERATION and amount - axis.acceleration <= told[BY]:
            return  # another motor's corner is sharper
        told[MOTOR] = motor
        told[FRAME] = self.store.start + index
        if found == path.TOO_HARD:
            told[WHAT] = EXCEEDED_BOARD
            told[BY] = 0
        else:
            told[WHAT] = EXCEEDED_ACCELERATION if steep else EXCEEDED_VELOCITY
            told[BY] = max(amount - (axis.acceleration if steep else axis.velocity), 1)

    def roll(self, motor, velocity, ticks, backward, places):
        """Move places[motor] by the way of a ramp between rest and a velocity (field note 6.2).

        velocity, ticks: registers; half of their product, taken off if `backward`. False where that
        is past a soft limit or the range of positions, or asks for more than the motor's acceleration.
        """
        r = self.numbers
        axis = self.axes[motor]
        if not reals.sign(r, velocity):
            return axis.beyond(places, motor) == 0
        if self.steep(motor, velocity, ticks):
            return False
        reals.multiply(r, X, velocity, ticks)
        reals.double(r, X, X, -1)
        return self.shift(places, motor, backward) and axis.beyond(places, motor) == 0

    def steep(self, motor, velocity, ticks):
        """Whether a ramp between rest and a velocity, both registers, asks for more than the motor's acceleration."""
        r = self.numbers
        if not reals.sign(r, velocity):
            return False
        reals.divide(r, Y, velocity, ticks)
        if reals.sign(r, Y) < 0:
            reals.negate(r, Y, Y)
        reals.fetch(r, X, self.axes[motor].numbers, motion.STEEP)
        reals.double(r, T, X, -20)  # of leave for rounding
        reals.add(r, X, X, T)
        return reals.compare(r, Y, X) > 0

    def shift(self, places, motor, backward):
        """Move places[motor] by the number in X, rounded to a step; the other way if `backward`. False, and no change,
        where that is past the range of positions. X and Y are lost."""
        r = self.numbers
        if backward:
            reals.negate(r, X, X)
        reals.put(r, Y, 1, -1)
        reals.add(r, X, X, Y)
        way = reals.floor(r, X, HALF)
        return -HALF < way < HALF and reals.add_within(places, motor, places, motor, way) != 0

    def begin(self, motor):
        """Make a motor ready for phases."""
        axis = self.axes[motor]
        axis.prepare(self.axes.hal)
        axis.block[stepper.PLANNED] = stepper.PLAN_SEGMENTS | stepper.PLAN_TIMED
        axis.expect(True)

    def close(self, bits):
        """No further phases come: the motors rest where the last one ends."""
        for motor in range(self.count):
            if bits >> motor & 1:
                self.axes[motor].expect(False)

    def ahead(self, bits):
        """The number of phases that wait before the first of these motors; the others have about as many."""
        return _ahead(self.axes.axes, bits)

    def hop(self, bits, index, step, duration, scale=SCALE):
        """Append to each motor of these bits the cubic to the frame `index`, played in direction `step`.

        duration: register; it begins at speed(motor), and the velocity at the frame, at the rate of the register
        `scale`, becomes that.
        """
        store = self.store
        _hop(
            self.axes.axes,
            bits,
            store,
            self.window,
            self.numbers,
            self.place,
            index,
            step,
            store.end - store.start,
            duration,
            scale,
        )
