"""One motor: its settings and position, and how a request or a played move becomes segments in its
queue.

An axis has a list of phases (phases.py). It cuts them into segments and puts these into the tick
kernel's queue, some tenths of a second ahead. All motion of a motor is planned here.

Hosts ask for the position of the load, and it is reported to them. The motor's own position differs
from it by the backlash (backlash.py). A `direction` is 1 for up, -1 for down, 0 for either.
Positions are steps, int32, passed as (array, index), since a large one would be an object on the
heap. Nothing allocates after construction.
"""

from array import array

from framestep.base.native import addressof, as_word, const, micropython, ptr32
from framestep.motion import ramps, reals, segments
from framestep.motion.phases import DURATION_WORDS, Phases, scratch
from framestep.motion.reals import add_words, order_words
from framestep.motors import bounds, feeder, queue_cut
from framestep.motors.backlash import BACKLASH, LOAD, MOTOR, PLANNED_LOAD, TARGET, make_backlash
from framestep.motors.rates import (
    ACCELERATION_LIMIT,
    DEFAULT_ACCELERATION,
    DEFAULT_VELOCITY,
    MAX_ACCELERATION,
    MAX_JERK,
    MAX_VELOCITY,
    TICKS_PER_SECOND,
    VELOCITY_FLOOR,
    kernel_rate,
)
from framestep.pulse import stepper

FULL_SPEED = const(10000)  # a jog's speed is in ten-thousandths of velocity and acceleration
SPEED_FLOOR = const(100)  # lowest speed of a jog (field note 4.2)

MOST_SEGMENTS = const(14)  # leaves room in the ring for the two segments that end a motion
FIRST_TICKS = const(100)  # queued before a motion starts: the main loop may be away for that long
SPLICE_TICKS = const(12)  # from a request to the beginning of the new plan
ALL_SPLICE_TICKS = const(40)  # from a request to a new plan for all motors of a motion
_HIGHEST_JERK = const(200000)  # 1000 steps/s³
SLOW_SPLICE_TICKS = const(32)  # with a jerk limit, which an RP2040 plans in up to 20 ms

# Registers of `numbers`, after those of rates.py
MOTION_VELOCITY = const(6)  # greatest velocity of the motion under way, by its `speed`
MOTION_ACCELERATION = const(8)
_X = const(12)
_Y = const(14)

_RUNS = const(stepper.RUN | stepper.STOP)
UNLIMITED = const(0x3FFFFFFF)


class Axis:
    """A motor: its settings, limits, position and motion.

    kernel: the StepKernel. motor: from 0. positions: the Positions of all motors.
    """

    def __init__(self, kernel, motor, positions):
        self.block = kernel.blocks[motor]
        self.numbers = array("i", [0] * 16)
        self.lower_enabled = False
        self.upper_enabled = False
        self.ends = bounds.ENDS  # the range of positions
        self.bounds = array("i", [0] * bounds.BOUNDS_WORDS)  # of the load
        self.own_velocity = 0  # set by set_speed(), steps/s
        self.own_acceleration = 0  # steps/s²
        self.own_jerk = 0  # 1000 steps/s³
        self.jerk = 0  # the one in force in Q27 steps per tick³, or less
        self.velocity = 0  # in force: no more than a coupled motor can do as well
        self.acceleration = 0
        self.rates_outdated = True  # numbers derived from these settings must be computed again
        self.backlash = make_backlash(self.block)  # also has the position of the load
        self.partner = None  # the motor that does what this one does
        self.leader = None  # the motor that this one follows
        self.reversed = 0  # 1: the partner turns in the opposite sense
        # the partner's position minus this motor's; if reversed, their sum
        self.base = array("i", [0])
        self.word = array("i", [0] * 3)
        self.positions = positions
        self.state = array("i", [0] * segments.OPEN_WORDS)
        self.cubic = array("i", [0] * segments.CUBIC_WORDS)
        self.phases = Phases()
        self.whole = array("i", [0] * DURATION_WORDS)
        self.knot = array("i", [0] * stepper.AT_WORDS)  # where the phase under way ends
        self.work = array("i", [0] * feeder.WORK_WORDS)
        self.block[stepper.WORK] = as_word(addressof(self.work))
        self.block[stepper.PHASES] = as_word(addressof(self.phases.words))
        self.parts = (
            self.work,
            self.cubic,
            self.block,
            self.state,
            self.whole,
            self.knot,
            self.phases.words,
            scratch,
        )
        self.speed = 0  # of the motion under way, in ten-thousandths
        self.direction = 0  # direction for which the backlash must be taken up at TARGET
        self.stopping_smoothly = False  # a stop within the jerk limit is under way
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
        self.jerk = min(jerk, _HIGHEST_JERK) * 134  # 2^27 / 10^6
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

    # ---------------------------------------------------------------- state

    @property
    def stopping(self):
        """Whether the kernel ramps it down."""
        return self.block[stepper.MODE] & stepper.STOP != 0

    def heads_for(self, target, i, speed):
        """Return whether the motion under way is the one that move_to() would plan."""
        return (
            self.speed == speed
            and not self.rates_outdated
            and (self.block[stepper.PLANNED] & stepper.PLAN_SEGMENTS or self._follows_plan())
            and order_words(target, i, self.backlash, TARGET) == 0
        )

    def _follows_plan(self):
        """Return whether the kernel takes queued segments now or from the next tick on."""
        return self.block[stepper.MODE] & (stepper.RUN | stepper.STOP) == stepper.RUN

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

    # ---------------------------------------------------------------- motion

    def keep_to_limits(self, hal):
        """After set_limits(): end a motion of move_to() at the new limit if it goes beyond."""
        if not bounds.outside(self, self.backlash, TARGET):
            return
        if self.at_rest or self.stopping or self.stopping_smoothly:
            # for resume_target(), which may follow
            if bounds.clamp(self, self.backlash, TARGET) and self.partner:
                self.block[stepper.PLANNED] &= stepper.PLAN_SEGMENTS
        else:
            self.move_to(hal, self.backlash, TARGET, self.speed, self.direction)

    def begin_plan(self, hal, ticks=SPLICE_TICKS):
        """Drop the present plan and make the cubic the state from which a new plan starts.

        Every motion begins here. ticks: from now to the beginning of the new plan. Return False if
        the motor comes to rest before that: then the whole plan is queued and runs to its end.
        """
        if self.positions.saved:
            self.positions.about_to_change()
        block = self.block
        taken = self._cut(hal, ticks)
        if not taken and block[stepper.PLANNED] & stepper.PLAN_SEGMENTS:
            self.feed(MOST_SEGMENTS, ticks)
            taken = self._cut(hal, ticks)
        if not taken:
            return False
        queue_cut.start_cubic(self.cubic, self.work)
        self.phases.clear()
        work = self.work
        work[feeder.LEFT] = work[feeder.PART] = work[feeder.AIMED] = work[feeder.MARKED] = work[
            feeder.MORE
        ] = 0
        block[stepper.PLANNED] = 0
        self.stopping_smoothly = False
        self.backlash.refresh()
        self.backlash.plan_from(self.backlash, LOAD)
        return True

    def _cut(self, hal, ticks):
        bits = 3 if self.partner else 1
        irq = hal.irq_off()
        taken = queue_cut.cut(hal.kernel.state, self.block, bits, ticks)
        hal.irq_on(irq)
        return taken != queue_cut.TOO_SOON

    def move_to(self, hal, target, i, speed=FULL_SPEED, direction=0, resumed=False):
        """Move to the position target[i]. Return whether anything moves, from the next tick on.

        speed: of velocity and acceleration, in ten-thousandths. direction: of the motion that comes
        next. The motor comes to rest with its backlash taken up for that direction, if need be by a
        second motion (see rests_on()).

        A moving motor bends to the new target, and stops first if it must turn (field note 4.8). A
        target out of bounds is clamped (bounds.clamp), as they may have become narrower since the
        target was checked. resumed: it is TARGET, clamped already; a motor that came from outside
        may have overshot it, and be inside now. Coupled motors out of bounds only stop: the way
        back would take up backlash, which moves the other motor.
        """
        r = self.numbers
        hal.port.look_for_stop()
        if speed != self.speed or self.rates_outdated:
            self.speed = speed
            self.rates_outdated = False
            reals.put(r, _X, max(speed, SPEED_FLOOR), 0)
            reals.put(r, _Y, FULL_SPEED, 0)
            reals.divide(r, _X, _X, _Y)
            reals.multiply(r, MOTION_VELOCITY, MAX_VELOCITY, _X)
            reals.multiply(r, _Y, MAX_ACCELERATION, _X)
            if not self.at_rest and reals.compare(r, _Y, MOTION_ACCELERATION) < 0:
                # The motor must be able to stop as planned; the lower acceleration waits.
                self.rates_outdated = True
            else:
                reals.copy(r, MOTION_ACCELERATION, _Y)
        backlash = self.backlash
        reals.copy_word(backlash, TARGET, target, i)
        if (
            not resumed
            and bounds.clamp(self, backlash, TARGET)
            and self.partner
            and not self.at_rest
        ):
            self.stop(hal, smooth=True)
            return self.moving
        hal.port.look_for_stop()
        self.direction = direction
        # The kernel's stops have no jerk limit, so a plan with one cannot begin within a stop.
        smooth = reals.sign(r, MAX_JERK) > 0
        # Without one a stop of this motor is a ramp of the kernel's, as if at a limit switch.
        port = None if smooth else hal.port
        if (
            (self.block[stepper.PENDING] or stepper.waking(hal.kernel.state))
            and self.at_rest
            or smooth
            and self.stopping
            or not self.begin_plan(hal, SLOW_SPLICE_TICKS if smooth else SPLICE_TICKS)
        ):
            self.block[stepper.PLANNED] = stepper.PLAN_TARGET  # resume_target() continues
            return True
        if port:
            port.look_for_stop()
        if reals.equal_words(backlash, TARGET, backlash, PLANNED_LOAD):
            backlash.take_up(direction)
        else:
            backlash.turn_to(backlash, TARGET, 0)
        self.block[stepper.PLANNED] = stepper.PLAN_TARGET if backlash[BACKLASH] else 0
        planned = ramps.plan(
            self.phases,
            self.cubic,
            backlash,
            MOTOR,
            r,
            MOTION_VELOCITY,
            MOTION_ACCELERATION,
            MAX_JERK,
            port,
        )
        if planned == ramps.STOP_FIRST:
            if not ramps.plan_stop(
                self.phases, self.cubic, backlash, MOTOR, r, MAX_ACCELERATION, MAX_JERK
            ):
                self.stop(hal)
                self.block[stepper.PLANNED] = stepper.PLAN_TARGET
                return True
            self.block[stepper.PLANNED] = stepper.PLAN_TARGET
        elif planned == ramps.NOTHING:
            if not self._follows_plan():
                return self.moving
            # The motion ends there already, but begin_plan() has cut its end off the queue.
        self.block[stepper.PLANNED] |= stepper.PLAN_SEGMENTS
        for _ in range(2):
            if port:
                port.look_for_stop()
            self.feed(MOST_SEGMENTS, FIRST_TICKS // 2)
        self.start(hal)
        hal.port.look_for_stop()
        return True

    def append_phase(self, duration, start, end, numbers, targets, i, part=0):
        """Append an AIM phase to the position targets[i]: see Phases.aim().

        If the phase turns the motion, the backlash is taken up on the way.
        """
        self.backlash.turn_to(targets, i, part)
        self.phases.aim(duration, start, end, numbers, self.backlash, MOTOR, part)

    def append_coasting_phase(self, duration, start, end, numbers, positions, i, part=0, beyond=0):
        """Append an AIM phase but keep the offset of the backlash: for ramps and virtual motion.

        If the phase turns the motion, the load stays behind. beyond: an additional Q16 of a step,
        which does not count for the load's position.
        """
        self.backlash.coast_to(positions, i, part)
        self.phases.aim(duration, start, end, numbers, self.backlash, MOTOR, part + beyond)

    def resume_from_cut(self, positions, i):
        """Continue from where queue_cut.cut() has cut; further phases follow.

        positions[i]: a position of the load before the cut, from which it came in the same
        direction.
        """
        queue_cut.start_cubic(self.cubic, self.work)
        self.phases.clear()
        work = self.work
        work[feeder.LEFT] = work[feeder.PART] = work[feeder.AIMED] = work[feeder.MARKED] = 0
        work[feeder.MORE] = 1
        self.block[stepper.PLANNED] = stepper.PLAN_SEGMENTS | stepper.PLAN_TIMED
        self.backlash.refresh()
        self.backlash.plan_from(positions, i)

    def resume_at_phase_end(self, positions, i):
        """Continue from where queue_cut.cut_at() has cut; append_coasting_phase() then adds phases.

        positions[i] = whole steps of the load there. Return the rest in Q16 of a step. Works only
        among AIM phases of whole ticks.
        """
        self.phases.clear()
        work = self.work
        work[feeder.LEFT] = work[feeder.PART] = work[feeder.MARKED] = 0
        queue_cut.dropped(work, self.knot)
        work[feeder.AIMED] = work[feeder.MORE] = 1
        self.block[stepper.PLANNED] = stepper.PLAN_SEGMENTS
        return self.backlash.plan_from_cut(self.knot, positions, i)

    def set_more_to_come(self, more):
        """Set whether phases will be appended. If not, the motion ends with the last one."""
        self.work[feeder.MORE] = 1 if more else 0

    def resume_target(self, hal):
        """At rest: move to the target if the motor is not there, and take up the backlash there.

        It is not there after a stop on the way, or after a turn with backlash.
        """
        self.block[stepper.PLANNED] = 0
        if not self._is_on(self.backlash, TARGET, self.direction):
            speed = self.speed or FULL_SPEED
            self.move_to(hal, self.backlash, TARGET, speed, self.direction, True)

    def start(self, hal):
        """Make the kernel take the queue from the next tick on."""
        bits = 3 if self.partner else 1
        irq = hal.irq_off()
        stepper.release(self.block, bits)
        hal.irq_on(irq)

    # ---------------------------------------------------------------- coupling

    def couple(self, partner, inverted):
        """Make the next motor do what this one does; `inverted`: in the opposite sense.

        Both must be at rest. Their present positions then belong together. The stricter settings
        and limits of the two apply, whenever they are set. Return False, and change nothing, if the
        positions differ by more than an int32 holds, or the next motor is at the lower end of the
        range of positions: the path of this one may be half a step beside the motor.
        """
        if not order_words(partner.block, stepper.POSITION, bounds.ENDS, 0) or not add_words(
            self.word,
            0,
            partner.block,
            stepper.POSITION,
            self.block,
            stepper.POSITION,
            0 if inverted else 1,
        ):
            return False
        self.uncouple()
        reals.copy_word(self.base, 0, self.word, 0)
        self.partner = partner
        self.reversed = 1 if inverted else 0
        self.work[feeder.MIRRORED] = 1 + self.reversed
        partner.leader = self
        self._apply()
        bounds.update(self)
        return True

    def uncouple(self):
        """End the coupling. Both must be at rest."""
        partner = self.partner
        if partner:
            partner.leader = None
            self.partner = None
            self.work[feeder.MIRRORED] = 0
            partner._apply()
            bounds.update(partner)
            self._apply()
            bounds.update(self)

    # ---------------------------------------------------------------- stopping, feeding

    def stop(self, hal, factor=1, smooth=False, on_path=False):
        """Ramp down from the next tick on, with `factor` times the set acceleration.

        smooth: within the jerk limit, if the motor has one. Such a stop is planned, begins some
        ticks from now and has to be fed. on_path: the motor follows an uploaded path. Within its
        bounds the ramp may have to be steeper, see bounds.stop_rate(). Coupled motors stop
        together, whichever is named.
        """
        if self.leader:
            self.leader.stop(hal, factor, smooth, on_path)
            return
        self.block[stepper.PLANNED] &= stepper.PLAN_SEGMENTS
        if smooth and self._stop_smoothly(hal):
            return
        self.stopping_smoothly = False
        self.phases.clear()
        self.work[feeder.LEFT] = 0
        self.block[stepper.PLANNED] = 0
        self.work[feeder.MORE] = 0
        rate = kernel_rate(min(self.acceleration * factor, ACCELERATION_LIMIT))
        bits = 3 if self.partner else 1
        irq = hal.irq_off()
        rate = bounds.stop_rate(self.block, self.bounds, rate, on_path)
        stepper.halt(self.block, bits, rate, 0)
        hal.irq_on(irq)

    @micropython.viper
    def begin_stop(self, hal):
        """Slow down from the next tick on with the jerk limit, ahead of a smooth stop(), which has
        to follow within EASY_TICKS. For the USB port's callbacks: bytecode would let MicroPython's
        USB task run again in it, which is an error."""
        jerk = int(self.jerk)
        if jerk and not self.stopping_smoothly:
            other = self.block
            if self.partner:
                other = self.partner.block
            mirrored = ptr32(self.work)[feeder.MIRRORED]
            queue_cut.ease(hal, self.block, other, self.base, mirrored, jerk)

    def _stop_smoothly(self, hal):
        """Plan a stop within the jerk limit. Return False without a limit or a motion to stop."""
        r = self.numbers
        if reals.sign(r, MAX_JERK) <= 0 or self.block[stepper.MODE] != stepper.RUN:
            return False
        if self.stopping_smoothly:
            return True  # a repeated request does not start a second stop
        if not self.begin_plan(hal):
            self.block[stepper.PLANNED] = 0
            return True  # it is about to come to rest
        if not ramps.plan_stop(
            self.phases, self.cubic, self.backlash, MOTOR, r, MAX_ACCELERATION, MAX_JERK
        ):
            return False
        self.stopping_smoothly = True
        self.block[stepper.PLANNED] |= stepper.PLAN_SEGMENTS
        self.feed(MOST_SEGMENTS, FIRST_TICKS)
        self.start(hal)
        return True

    def feed(self, most=MOST_SEGMENTS, enough=UNLIMITED, port=None):
        """Cut phases until `most` segments are queued, or `enough` ticks more than before.

        port: see feeder.feed().
        """
        if self.partner:
            feeder.feed(self.parts, self.partner.block, self.base, most, enough, port)
        else:
            feeder.feed(self.parts, None, self.base, most, enough, port)
