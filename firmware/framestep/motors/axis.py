"""One motor: its settings, and how a request or a played move becomes segments in its queue.

An axis has a list of phases (ramps.py). It cuts them into segments, which it puts into the tick
kernel's queue some tenths of a second ahead. Everything that moves a motor goes through here.

The position of the load is what hosts ask for and are told; the motor's own position differs from
it by the backlash (backlash.py). `way` is a direction: 1 up, -1 down, 0 either. Positions are
steps, int32. They are handed over as (array, index), since a large one would be an object on the
heap. Nothing allocates after construction.
"""

from array import array

from framestep.motion import ramps, reals, segments, stepper
from framestep.motion.reals import add_words, order_words
from framestep.motors import backlash, bounds, feeder
from framestep.motors.backlash import drag, motor_step, offset, replan_from, same_side, take_up, taken_up
from framestep.motors.feeder import set_cubic
from framestep.native import addressof, as_word, const

TICKS_PER_SECOND = const(1000)
VELOCITY_FLOOR = const(10)  # steps/s: a lower setting is taken as this (field note 4.1)
VELOCITY_LIMIT = const(500000)  # steps/s: what the kernel's numbers hold
ACCELERATION_LIMIT = const(4000000)  # steps/s²: the same; a higher setting is taken as this
DEFAULT_VELOCITY = const(5000)  # field note 4.1
DEFAULT_ACCELERATION = const(20000)
FULL_SPEED = const(10000)  # a jog's speed is in ten-thousandths of velocity and acceleration
SPEED_FLOOR = const(100)  # a jog's least speed (field note 4.2)

MOST_SEGMENTS = const(14)  # fills the ring but for the two segments that end a motion
FIRST_TICKS = const(100)  # queued before a motion starts: the main loop may be away for that long
SPLICE_TICKS = const(12)  # from a request to where the new plan takes over
SLOW_SPLICE_TICKS = const(32)  # the same with a jerk limit: an RP2040 plans it in up to 20 ms

# Numbers of an axis, registers of `numbers`
MAX_VELOCITY = const(0)  # steps per tick
MAX_ACCELERATION = const(2)  # steps per tick²
MAX_JERK = const(4)  # steps per tick³, 0 for no limit
MOTION_VELOCITY = const(6)  # the same for the motion under way, which has a speed of its own
MOTION_ACCELERATION = const(8)
_X = const(12)
_Y = const(14)

# Words of `limits`, after bounds.LOWER and bounds.UPPER
TARGET = const(2)

_UNLIMITED = const(0x3FFFFFFF)
_RUNS = const(stepper.RUN | stepper.STOP)


def kernel_rate(acceleration):
    """The kernel's deceleration, Q22 steps per tick², 1 or more.

    acceleration: steps/s², ACCELERATION_LIMIT at most.
    """
    rate = acceleration * 4 + acceleration * 199 // 1024  # 2^22 / 10^6 = 4.194304
    return rate if rate else 1


class Axis:
    """One motor.

    kernel: the StepKernel. motor: from 0. positions: the Positions of all motors.
    """

    def __init__(self, kernel, motor, positions):
        self.positions = positions
        self.block = kernel.blocks[motor]
        self.state = array("i", [0] * 5)
        self.cubic = array("i", [0] * segments.CUBIC_WORDS)
        self.numbers = array("i", [0] * 16)
        self.limits = array("i", [0] * 4)
        self.phases = ramps.Phases()
        self.whole = array("i", [0] * 2)
        self.knot = array("i", [0] * 2)  # where the phase under way ends: a step, Q16 of one more
        self.cut = array("i", [0] * 2)  # the same, where cut_at_phase_end() has cut the queue
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
            ramps.scratch,
        )
        self.lower_enabled = False
        self.upper_enabled = False
        self.bounds = array("i", [0] * 3)  # how far the load may go: see motors/bounds.py
        self.own_velocity = 0  # as set_speed() has set it, steps/s
        self.own_acceleration = 0  # steps/s²
        self.own_jerk = 0  # 1000 steps/s³
        self.velocity = 0  # in force: no more than a coupled motor can do as well
        self.acceleration = 0
        self.pending_acceleration = False  # a lower acceleration waits until the motor stands
        self.speed = 0  # of the motion under way, in ten-thousandths
        self.rates_outdated = True  # MOTION_VELOCITY and MOTION_ACCELERATION are to be computed anew
        self.backlash = 0  # steps of play that the motor takes up before the load moves
        # where the load is, counting all that has been queued to the engine
        self.load_position = array("i", [0])
        self.block[stepper.PLACE] = as_word(addressof(self.load_position))
        self.planned = array("i", [0] * 3)  # where the phases lead to: see motors/backlash.py
        self.way = 0  # the direction for which the play is to be taken up at TARGET
        self.stopping_smoothly = False  # a stop within the jerk limit is under way
        self.partner = None  # the motor that does what this one does
        self.leader = None  # the motor that this one follows
        self.turned = 0  # 1: the partner turns in the opposite sense
        # from this motor's steps to the partner's: their difference, or turned their sum
        self.base = array("i", [0])
        self.word = array("i", [0] * 3)
        bounds.update(self)
        self.set_speed(DEFAULT_VELOCITY, DEFAULT_ACCELERATION)

    # ---------------------------------------------------------------- settings

    def set_speed(self, velocity, acceleration):
        """Set the greatest velocity and acceleration.

        velocity: steps/s, 1 … VELOCITY_LIMIT. acceleration: steps/s²; 0: half the velocity.

        Of coupled motors the stricter setting counts. An acceleration lower than that of the motion
        under way is not taken before the motor stands, as the motor could no longer stop in time,
        for example at a soft limit: `pending_acceleration` is True until then.
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
        """Bring the settings into force: the stricter ones of this motor and its partner."""
        velocity = self.own_velocity
        acceleration = self.own_acceleration
        jerk = self.own_jerk
        partner = self.partner
        if partner:
            velocity = min(velocity, partner.own_velocity)
            acceleration = min(acceleration, partner.own_acceleration)
            if not jerk or 0 < partner.own_jerk < jerk:
                jerk = partner.own_jerk
        self.pending_acceleration = False
        if acceleration < self.acceleration and not self.stands:
            self.pending_acceleration = True
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
            partner.block[stepper.BRAKE] = self.block[stepper.BRAKE]  # one ramp for both, whoever stops them

    def apply_pending_acceleration(self):
        """Take the lower acceleration that waits, once the motor stands. False while it moves."""
        if self.leader:
            return self.leader.apply_pending_acceleration()
        if not self.stands:
            return False
        if self.pending_acceleration:
            self._apply()
        return True

    def set_jerk(self, jerk):
        """Set the greatest jerk in 1000 steps/s³, 2^30 - 1 at most; 0: no limit. Only at rest."""
        self.own_jerk = jerk
        (self.leader or self)._apply()

    def set_limits(self, lower_enabled, upper_enabled, source, i):
        """Set the soft limits to source[i] and source[i + 1], in steps.

        False, and nothing is set, if they cross.
        """
        if lower_enabled and upper_enabled and order_words(source, i, source, i + 1) > 0:
            return False
        reals.copy_word(self.limits, bounds.LOWER, source, i)
        reals.copy_word(self.limits, bounds.UPPER, source, i + 1)
        self.lower_enabled = lower_enabled
        self.upper_enabled = upper_enabled
        bounds.update(self.leader or self)
        return True

    def clamp(self, target, i):
        """Bring target[i] within `bounds`; for a motor past one of them at most to where it is."""
        side = self.outside(target, i)
        if side:
            end = 1 if side > 0 else 0
            reals.copy_word(target, i, self.bounds, end)
            if self.outside(target, i) or order_words(self.load_position, 0, self.bounds, end) == side:
                reals.copy_word(target, i, self.load_position, 0)

    def keep_to_limits(self, hal):
        """After set_limits(): end a motion of move_to() at the new limit if it leads past that."""
        if self.moving and not self.stopping and not self.stopping_smoothly and self.outside(self.limits, TARGET):
            self.move_to(hal, self.limits, TARGET, self.speed, self.way)

    def heads_for(self, target, i, speed):
        """Whether the motion under way is the one that move_to() would plan."""
        return (
            self.speed == speed
            and not self.rates_outdated
            and (self.block[stepper.PLANNED] & stepper.PLAN_SEGMENTS or self.block[stepper.MODE] == stepper.RUN)
            and order_words(target, i, self.limits, TARGET) == 0
        )

    def outside(self, target, i):
        """Whether target[i] is out of bounds: 1 above, -1 below, 0 not.

        A motor that is past a bound already may move toward the allowed range (field note 4.3).
        """
        self.refresh()
        side = self.beyond(target, i)
        if side and order_words(self.load_position, 0, self.bounds, 1 if side > 0 else 0) == side:
            if order_words(target, i, self.load_position, 0) != side:
                return 0
        return side

    def beyond(self, target, i):
        """As outside(), wherever the motor is now."""
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
        return (block[stepper.PLANNED] | block[stepper.MODE]) != 0

    @property
    def stands(self):
        """Whether no motion is queued; the last pulses may still be on their way out."""
        return not self.block[stepper.MODE] & _RUNS and not self.block[stepper.PLANNED] & stepper.PLAN_SEGMENTS

    @property
    def stopping(self):
        """Whether the kernel ramps it down."""
        return self.block[stepper.MODE] & stepper.STOP != 0

    def position_to(self, target, i):
        """target[i] = the position of the load, in steps."""
        self.refresh()
        reals.copy_word(target, i, self.load_position, 0)

    def set_position(self, source, i):
        """Make source[i] the position of the load. Only at rest.

        False, and nothing has changed, if the motor's own position, which is off by the play, would
        lie outside the range of positions, or differ from the coupled motor's by more than an int32
        holds.
        """
        self.refresh()
        word = self.word
        word[2] = self.backlash
        if not add_words(word, 1, source, i, word, 2, 1):
            return False
        word[2] = offset(self.load_position, self.block)
        add_words(word, 1, source, i, word, 2, 0)
        leader = self.leader or self
        if leader.partner:
            other = leader.block if self.leader else leader.partner.block
            if leader.turned:
                fits = add_words(word, 0, word, 1, other, stepper.POSITION, 0)
            elif self.leader:
                fits = add_words(word, 0, word, 1, other, stepper.POSITION, 1)
            else:
                fits = add_words(word, 0, other, stepper.POSITION, word, 1, 1)
            if not fits:
                return False
            reals.copy_word(leader.base, 0, word, 0)
        reals.copy_word(self.block, stepper.POSITION, word, 1)
        reals.copy_word(self.load_position, 0, source, i)
        bounds.update(leader)
        return True

    def refresh(self):
        """Bring `load_position` up to date: before it is read, and often enough to see each turn."""
        drag(self.load_position, self.block, self.backlash)

    def stands_on(self, source, i, way=0):
        """Whether it stands on source[i] with its play taken up for a motion in direction `way`."""
        return not self.moving and self._is_on(source, i, way)

    def _is_on(self, source, i, way):
        self.refresh()
        return (
            reals.equal_words(self.load_position, 0, source, i) != 0
            and taken_up(self.load_position, self.block, self.backlash, way) != 0
        )

    def heading(self):
        """The direction for which the play is taken up where the phases end; 0 without play."""
        if not self.backlash:
            return 0
        return -1 if self.planned[backlash.OFFSET] else 1

    def set_backlash(self, steps):
        """Set the play in steps, 0 … 10000. Only at rest."""
        self.backlash = steps
        self.planned[backlash.PLAY] = steps
        bounds.update(self)
        self.block[stepper.PLAY] = steps

    # ---------------------------------------------------------------- motion

    def begin_plan(self, hal, ticks=SPLICE_TICKS):
        """Drop what was planned and make the cubic the state from which a new plan starts.

        Everything that moves begins here. ticks: from now to where the new plan takes over. False
        if the motor comes to rest before that: then it does, and all that was planned is queued.
        """
        if self.positions.saved:
            self.positions.about_to_change()
        block = self.block
        taken = self._splice(hal, ticks)
        if taken < 0 and block[stepper.PLANNED] & stepper.PLAN_SEGMENTS:
            self.feed(MOST_SEGMENTS, ticks)
            taken = self._splice(hal, ticks)
        if taken < 0:
            return False
        set_cubic(self.cubic, self.state)
        self.phases.clear()
        work = self.work
        work[feeder.LEFT] = work[feeder.PART] = work[feeder.AIMED] = work[feeder.MARKED] = work[feeder.MORE] = 0
        block[stepper.PLANNED] = 0
        self.stopping_smoothly = False
        self.refresh()
        reals.copy_word(self.planned, 0, self.load_position, 0)
        self.planned[backlash.OFFSET] = offset(self.load_position, block)
        return True

    def _splice(self, hal, ticks):
        irq = hal.irq_off()
        taken = stepper.splice(self.block, ticks, self.state)
        if taken >= 0 and self.partner:
            stepper.splice(self.partner.block, ticks, self.partner.state)
        hal.irq_on(irq)
        return taken

    def move_to(self, hal, target, i, speed=FULL_SPEED, way=0):
        """Move to the position target[i]. Returns whether anything moves, from the next tick on.

        speed: of velocity and acceleration, in ten-thousandths. way: the direction of what comes
        next; the motor comes to rest with its play taken up for it, if need be by a second motion
        (see stands_on()).

        A motor that moves bends to the new target, and stops first where it must turn (field note
        4.8). A target out of bounds is brought within them, see clamp(): they may have become
        narrower since it was checked.
        """
        r = self.numbers
        if speed != self.speed or self.rates_outdated:
            self.speed = speed
            self.rates_outdated = False
            reals.put(r, _X, max(speed, SPEED_FLOOR), 0)
            reals.put(r, _Y, FULL_SPEED, 0)
            reals.divide(r, _X, _X, _Y)
            reals.multiply(r, MOTION_VELOCITY, MAX_VELOCITY, _X)
            reals.multiply(r, _Y, MAX_ACCELERATION, _X)
            if not self.stands and reals.compare(r, _Y, MOTION_ACCELERATION) < 0:
                # It must be able to stop as planned before; the lower acceleration waits.
                self.rates_outdated = True
            else:
                reals.copy(r, MOTION_ACCELERATION, _Y)
        reals.copy_word(self.limits, TARGET, target, i)
        self.clamp(self.limits, TARGET)
        self.way = way
        # The kernel's stops have no jerk limit, so a plan that has one cannot begin within one.
        smooth = reals.sign(r, MAX_JERK) > 0
        if smooth and self.stopping or not self.begin_plan(hal, SLOW_SPLICE_TICKS if smooth else SPLICE_TICKS):
            self.block[stepper.PLANNED] = stepper.PLAN_TARGET  # resume_target() goes on from there
            return True
        if reals.equal_words(self.limits, TARGET, self.planned, backlash.PLACE):
            take_up(self.planned, self.limits, way)
        else:
            motor_step(self.planned, self.limits, self.limits, TARGET, 0)
        self.block[stepper.PLANNED] = stepper.PLAN_TARGET if self.backlash else 0
        planned = ramps.plan(
            self.phases, self.cubic, self.limits, backlash.PHYSICAL, r, MOTION_VELOCITY, MOTION_ACCELERATION, MAX_JERK
        )
        if planned == ramps.STOP_FIRST:
            if not ramps.plan_stop(
                self.phases, self.cubic, self.limits, backlash.PHYSICAL, r, MAX_ACCELERATION, MAX_JERK
            ):
                self.stop(hal)
                self.block[stepper.PLANNED] = stepper.PLAN_TARGET
                return True
            self.block[stepper.PLANNED] = stepper.PLAN_TARGET
        elif planned == ramps.NOTHING:
            if self.block[stepper.MODE] != stepper.RUN:
                return self.moving
            # It comes to rest there already, and begin_plan() has taken the end off the queue.
        self.block[stepper.PLANNED] |= stepper.PLAN_SEGMENTS
        self.feed(MOST_SEGMENTS, FIRST_TICKS)
        self.start(hal)
        return True

    def append_phase(self, duration, start, end, numbers, targets, i, part=0):
        """Append an AIM phase to the position targets[i]: see ramps.Phases.aim().

        The play is taken up on the way if the phase turns the motion.
        """
        motor_step(self.planned, self.limits, targets, i, part)
        self.phases.aim(duration, start, end, numbers, self.limits, backlash.PHYSICAL, part)

    def append_coasting_phase(self, duration, start, end, numbers, places, i, part=0):
        """As append_phase(), but leave the play as it is: for ramps and virtual motion.

        If the phase turns the motion, the load lags by the play.
        """
        same_side(self.planned, self.limits, places, i, part)
        self.phases.aim(duration, start, end, numbers, self.limits, backlash.PHYSICAL, part)

    def cut_queue(self, ticks):
        """Cut the queue off about `ticks` from now; resume_from_cut() goes on from there.

        Returns the ticks from now to the cut. With interrupts off. Motors whose phases last equally
        long are cut at the same moment.
        """
        taken = stepper.splice(self.block, ticks, self.state)
        if taken >= 0 and self.partner:
            stepper.splice(self.partner.block, ticks, self.partner.state)
        return taken

    def resume_from_cut(self, places, i):
        """After cut_queue(): further phases follow from there.

        places[i]: a position of the load before the cut, from which it came in the same direction.
        """
        set_cubic(self.cubic, self.state)
        self.phases.clear()
        work = self.work
        work[feeder.LEFT] = work[feeder.PART] = work[feeder.AIMED] = work[feeder.MARKED] = 0
        work[feeder.MORE] = 1
        self.block[stepper.PLANNED] = stepper.PLAN_SEGMENTS | stepper.PLAN_TIMED
        self.refresh()
        self.planned[backlash.OFFSET] = offset(self.load_position, self.block)
        reals.copy_word(self.planned, backlash.PLACE, places, i)

    def cut_at_phase_end(self, ticks, put):
        """Whether the queue can be cut at the end of a phase `ticks` from now; if `put`, cut it.

        With interrupts off. Only among AIM phases of whole ticks. resume_at_phase_end() goes on
        from there.
        """
        if not stepper.trim(self.block, ticks, put, self.cut):
            return False
        if put and self.partner:
            stepper.trim(self.partner.block, ticks, put, self.state)
        return True

    def resume_at_phase_end(self, places, i):
        """After cut_at_phase_end(): append_coasting_phase() adds further phases from there.

        places[i] = the position there, in whole steps; returns the rest in Q16 of a step.
        """
        self.phases.clear()
        work = self.work
        work[feeder.LEFT] = work[feeder.PART] = work[feeder.MARKED] = 0
        reals.copy_word(self.knot, 0, self.cut, 0)
        self.knot[1] = self.cut[1]
        work[feeder.AIMED] = work[feeder.MORE] = 1
        self.block[stepper.PLANNED] = stepper.PLAN_SEGMENTS
        return replan_from(self.planned, self.cut, places, i)

    def set_more_to_come(self, more):
        """Say whether phases will be appended; if not, the motion ends with the last one."""
        self.work[feeder.MORE] = 1 if more else 0

    def resume_target(self, hal):
        """At rest: go on to the target, if the motor is not there, and take up the play there.

        It is not there after a stop on the way to it, or after turning round with play.
        """
        self.block[stepper.PLANNED] = 0
        self.apply_pending_acceleration()
        if not self._is_on(self.limits, TARGET, self.way):
            self.move_to(hal, self.limits, TARGET, self.speed or FULL_SPEED, self.way)

    def start(self, hal):
        """Let the kernel take the queue from the next tick on."""
        irq = hal.irq_off()
        self.release()
        hal.irq_on(irq)

    def release(self):
        """As start(), but with interrupts off already: for several motors in the same tick."""
        block = self.block
        mode = block[stepper.MODE]
        if mode == stepper.IDLE or mode == stepper.DRAIN:
            block[stepper.MODE] = mode | stepper.RUN | stepper.START
        if self.partner:
            self.partner.release()

    def couple(self, partner, turned):
        """Make another motor do what this one does, if `turned` in the opposite sense.

        Only while both are at rest.

        The positions in which both stand now belong together from then on. The stricter settings
        and limits of the two count, whenever they are set. False, and nothing has changed, if the
        positions differ by more than an int32 holds.
        """
        if not add_words(
            self.word, 0, partner.block, stepper.POSITION, self.block, stepper.POSITION, 0 if turned else 1
        ):
            return False
        self.uncouple()
        reals.copy_word(self.base, 0, self.word, 0)
        self.partner = partner
        self.turned = 1 if turned else 0
        self.work[feeder.MIRRORED] = 1 + self.turned
        partner.leader = self
        self._apply()
        bounds.update(self)
        return True

    def uncouple(self):
        """End the coupling. Both at rest."""
        partner = self.partner
        if partner:
            partner.leader = None
            self.partner = None
            self.work[feeder.MIRRORED] = 0
            partner._apply()
            bounds.update(partner)
            self._apply()
            bounds.update(self)

    def stop(self, hal, factor=1, smooth=False):
        """Ramp down from the next tick on, with `factor` times the acceleration that is set.

        smooth: within the jerk limit, if the motor has one. That takes a plan, which begins some
        ticks from now and has to be fed. Coupled motors stop together, whichever is meant.
        """
        if self.leader:
            self.leader.stop(hal, factor, smooth)
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
        irq = hal.irq_off()
        stepper.halt(self.block, rate)
        if self.partner:
            stepper.halt(self.partner.block, rate)
        hal.irq_on(irq)

    def _stop_smoothly(self, hal):
        """Plan a stop within the jerk limit. False if there is none, or no motion to plan on."""
        r = self.numbers
        if reals.sign(r, MAX_JERK) <= 0 or self.block[stepper.MODE] != stepper.RUN:
            return False
        if self.stopping_smoothly:
            return True  # asked again, it does not begin anew
        if not self.begin_plan(hal):
            self.block[stepper.PLANNED] = 0
            return True  # it is about to come to rest
        if not ramps.plan_stop(self.phases, self.cubic, self.limits, backlash.PHYSICAL, r, MAX_ACCELERATION, MAX_JERK):
            return False
        self.stopping_smoothly = True
        self.block[stepper.PLANNED] |= stepper.PLAN_SEGMENTS
        self.feed(MOST_SEGMENTS, FIRST_TICKS)
        self.start(hal)
        return True

    # ---------------------------------------------------------------- feeding the queue

    def feed(self, most=MOST_SEGMENTS, enough=_UNLIMITED):
        """Cut phases into segments until `most` are queued, or `enough` ticks more than before."""
        if self.partner:
            feeder.feed(self.parts, self.partner.block, self.base, most, enough)
        else:
            feeder.feed(self.parts, None, self.base, most, enough)
