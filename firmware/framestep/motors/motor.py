"""One motor: its settings, limits and position.

Hosts ask for the position of the load, and it is reported to them. The motor's own position differs
from it by the backlash (backlash.py). A `direction` is 1 for up, -1 for down, 0 for either.
Positions are steps, int32, passed as (array, index), since a large one would be an object on the
heap. Nothing allocates after construction.
"""

from array import array

from framestep.base.native import const
from framestep.motion import reals
from framestep.motion.reals import add_words, order_words
from framestep.motors import bounds
from framestep.motors.backlash import BACKLASH, LOAD, make_backlash
from framestep.pulse import stepper

TICKS_PER_SECOND = const(1000)
VELOCITY_FLOOR = const(10)  # steps/s: lower settings are raised to this (field note 4.1)
VELOCITY_LIMIT = const(500000)  # steps/s: limit of the kernel's numbers
ACCELERATION_LIMIT = const(4000000)  # steps/s²: likewise; higher settings are lowered to this
DEFAULT_VELOCITY = const(5000)  # field note 4.1
DEFAULT_ACCELERATION = const(20000)

# Registers of `numbers`
MAX_VELOCITY = const(0)  # steps per tick
MAX_ACCELERATION = const(2)  # steps per tick²
MAX_JERK = const(4)  # steps per tick³, 0 for no limit
_Y = const(14)

_RUNS = const(stepper.RUN | stepper.STOP)


def kernel_rate(acceleration):
    """Return the kernel's deceleration, Q22 steps per tick², at least 1.

    acceleration: steps/s², ACCELERATION_LIMIT at most.
    """
    rate = acceleration * 4 + acceleration * 199 // 1024  # 2^22 / 10^6 = 4.194304
    return rate if rate else 1


class Motor:
    """Settings, limits and position of one motor; motors/axis.py moves it.

    block: the motor's words in the StepKernel.
    """

    def __init__(self, block):
        self.block = block
        self.numbers = array("i", [0] * 16)
        self.lower_enabled = False
        self.upper_enabled = False
        self.ends = bounds.ENDS  # the range of positions
        self.bounds = array("i", [0] * bounds.BOUNDS_WORDS)  # of the load
        self.own_velocity = 0  # set by set_speed(), steps/s
        self.own_acceleration = 0  # steps/s²
        self.own_jerk = 0  # 1000 steps/s³
        self.velocity = 0  # in force: no more than a coupled motor can do as well
        self.acceleration = 0
        self.rates_outdated = True  # numbers derived from these settings must be computed again
        self.backlash = make_backlash(block)  # also has the position of the load
        self.partner = None  # the motor that does what this one does
        self.leader = None  # the motor that this one follows
        self.reversed = 0  # 1: the partner turns in the opposite sense
        # the partner's position minus this motor's; if reversed, their sum
        self.base = array("i", [0])
        self.word = array("i", [0] * 3)
        bounds.update(self)
        self.set_speed(DEFAULT_VELOCITY, DEFAULT_ACCELERATION)

    # ---------------------------------------------------------------- settings

    def set_speed(self, velocity, acceleration):
        """Set the greatest velocity and acceleration.

        velocity: steps/s, 1 … VELOCITY_LIMIT. acceleration: steps/s²; 0: half the velocity.

        Of coupled motors the stricter setting applies. While the motor moves, an acceleration below
        its motion's waits, because the motor could no longer stop in time, for example at a soft
        limit. apply_pending() applies it when the motor is at rest.
        """
        if velocity < VELOCITY_FLOOR:
            velocity = VELOCITY_FLOOR
        if acceleration == 0:
            acceleration = max(velocity // 2, 1)
        if acceleration > ACCELERATION_LIMIT:
            acceleration = ACCELERATION_LIMIT
        self.own_velocity = velocity
        self.own_acceleration = acceleration
        (self.leader or self)._apply()

    def _apply(self):
        """Put the settings in force: the stricter ones of this motor and its partner."""
        velocity = self.own_velocity
        acceleration = self.own_acceleration
        jerk = self.own_jerk
        partner = self.partner
        if partner:
            velocity = min(velocity, partner.own_velocity)
            acceleration = min(acceleration, partner.own_acceleration)
            if not jerk or 0 < partner.own_jerk < jerk:
                jerk = partner.own_jerk
        self.block[stepper.PENDING] = 0
        if acceleration < self.acceleration and not self.at_rest:
            self.block[stepper.PENDING] = 1
            acceleration = self.acceleration
        self.velocity = velocity
        self.acceleration = acceleration
        self.rates_outdated = True
        r = self.numbers
        reals.put(r, _Y, TICKS_PER_SECOND, 0)
        reals.put(r, MAX_VELOCITY, velocity, 0)
        reals.divide(r, MAX_VELOCITY, MAX_VELOCITY, _Y)
        reals.put(r, MAX_ACCELERATION, acceleration, 0)
        reals.divide(r, MAX_ACCELERATION, MAX_ACCELERATION, _Y)
        reals.divide(r, MAX_ACCELERATION, MAX_ACCELERATION, _Y)
        reals.put(r, MAX_JERK, jerk, 0)
        reals.divide(r, MAX_JERK, MAX_JERK, _Y)
        reals.divide(r, MAX_JERK, MAX_JERK, _Y)
        self.block[stepper.BRAKE] = kernel_rate(acceleration)
        if partner:
            # the same ramp for both, whatever stops them
            partner.block[stepper.BRAKE] = self.block[stepper.BRAKE]

    def apply_pending(self):
        """If the motor is at rest, apply the waiting settings. Return False if they still wait."""
        if self.block[stepper.PENDING] and self.at_rest:
            self._apply()
        return not self.block[stepper.PENDING]

    def set_jerk(self, jerk):
        """Set the greatest jerk, 1000 steps/s³, at most 2^30 - 1; 0: no limit. Only at rest."""
        self.own_jerk = jerk
        (self.leader or self)._apply()

    def set_limits(self, lower_enabled, upper_enabled, source, i):
        """Set the soft limits to source[i] and source[i + 1], in steps.

        Return False, and set nothing, if they cross.
        """
        if lower_enabled and upper_enabled and order_words(source, i, source, i + 1) > 0:
            return False
        reals.copy_word(self.bounds, bounds.SOFT_LOWER, source, i)
        reals.copy_word(self.bounds, bounds.SOFT_UPPER, source, i + 1)
        self.lower_enabled = lower_enabled
        self.upper_enabled = upper_enabled
        bounds.update(self.leader or self)
        return True

    def set_ends(self, lowest, highest):
        """Make it a servo, whose positions are limited to this range of steps. At the start."""
        self.ends = array("i", [lowest, highest])
        bounds.update(self)

    def set_backlash(self, steps):
        """Set the backlash in steps, 0 … 10000. Only at rest."""
        self.backlash[BACKLASH] = steps
        bounds.update(self)

    # ---------------------------------------------------------------- limits

    def clamp(self, target, i):
        """Bring target[i] within `bounds`. If the motor itself is outside, or there is no room,
        make it where the load is, and return True."""
        side = self.outside(target, i)
        if not side:
            return False
        end = 1 if side > 0 else 0
        reals.copy_word(target, i, self.bounds, end)
        if not self.outside(target, i):
            self._find_place(side)
            if order_words(self.word, 0, self.bounds, end) != side and not (
                self.at_rest and order_words(self.backlash, LOAD, self.bounds, end) == side
            ):
                return False
        reals.copy_word(target, i, self.backlash, LOAD)
        return True

    def outside(self, target, i):
        """Return whether target[i] is out of bounds: 1 above, -1 below, 0 not.

        A motor that is outside already may move toward the allowed range (field note 4.3).
        """
        # Check both ends, since there may be no room between them.
        side = 1
        while side >= -1:
            end = 1 if side > 0 else 0
            if order_words(target, i, self.bounds, end) == side:
                self._find_place(side)
                if (
                    order_words(self.word, 0, self.bounds, end) != side
                    or order_words(target, i, self.word, 0) == side
                ):
                    return side
            side -= 2
        return 0

    def _find_place(self, side):
        """Set word[0] to where the load is; of coupled motors to where it would be if it moved
        outward, to `side`.

        A motor that stops on its way back from outside may turn, and take up its backlash outward.
        That moves a coupled motor at once, perhaps past its own limits.
        """
        self.backlash.refresh()
        reals.copy_word(self.word, 0, self.backlash, LOAD)
        if self.partner:
            if side > 0:
                reals.copy_word(self.word, 0, self.block, stepper.POSITION)
            else:
                add_words(self.word, 0, self.block, stepper.POSITION, self.backlash, BACKLASH, 0)

    def beyond(self, target, i):
        """Return the same as outside(), but regardless of where the motor is now."""
        if order_words(target, i, self.bounds, 1) > 0:
            return 1
        if order_words(target, i, self.bounds, 0) < 0:
            return -1
        return 0

    # ---------------------------------------------------------------- state

    @property
    def moving(self):
        """Whether it moves: from the request for a motion until its last pulse is out."""
        block = (self.leader or self).block
        return (block[stepper.PLANNED] | block[stepper.MODE] | block[stepper.PENDING]) != 0

    @property
    def at_rest(self):
        """Whether no motion is queued; the last pulses may still be on their way out."""
        return (
            not self.block[stepper.MODE] & _RUNS
            and not self.block[stepper.PLANNED] & stepper.PLAN_SEGMENTS
        )

    def position_to(self, target, i):
        """target[i] = the position of the load, in steps"""
        self.backlash.refresh()
        reals.copy_word(target, i, self.backlash, LOAD)

    def set_position(self, source, i):
        """Make source[i] the position of the load. Only at rest.

        Return False, and change nothing, if the motor's own position, which differs by the offset,
        would lie outside the range of positions, or differ from the coupled motor's by more than an
        int32 holds, or if it follows another motor and would be at the lower end. A servo's
        position cannot be changed: the servo would have to move.
        """
        self.backlash.refresh()
        if self.ends is not bounds.ENDS:
            return reals.equal_words(self.backlash, LOAD, source, i) != 0
        word = self.word
        word[2] = self.backlash[BACKLASH]
        if not add_words(word, 1, source, i, word, 2, 1):
            return False
        word[2] = self.backlash.offset()
        add_words(word, 1, source, i, word, 2, 0)
        leader = self.leader or self
        if self.leader and not order_words(word, 1, bounds.ENDS, 0):
            return False
        if leader.partner:
            other = leader.block if self.leader else leader.partner.block
            if leader.reversed:
                fits = add_words(word, 0, word, 1, other, stepper.POSITION, 0)
            elif self.leader:
                fits = add_words(word, 0, word, 1, other, stepper.POSITION, 1)
            else:
                fits = add_words(word, 0, other, stepper.POSITION, word, 1, 1)
            if not fits:
                return False
            reals.copy_word(leader.base, 0, word, 0)
        reals.copy_word(self.block, stepper.POSITION, word, 1)
        reals.copy_word(self.backlash, LOAD, source, i)
        bounds.update(leader)
        return True

    def rests_on(self, source, i, direction=0):
        """Return whether it is at rest on source[i], with its backlash taken up for a motion in
        that direction."""
        return not self.moving and self._is_on(source, i, direction)

    def _is_on(self, source, i, direction):
        self.backlash.refresh()
        return (
            reals.equal_words(self.backlash, LOAD, source, i) != 0
            and self.backlash.taken_up(direction) != 0
        )
