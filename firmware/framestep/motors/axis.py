"""Motors: their settings, and the way from a request or a played move to segments in the queue.

An axis has a list of phases (ramps.py) and feeds them, as segments, to the tick kernel's queue
some tenths of a second ahead. Everything that moves a motor goes through here.

Positions are steps, int32, and never become Python numbers where they may be large: they are
handed over as (array, index). Nothing allocates after construction.
"""

from array import array

from framestep.motion import ramps, reals, segments, stepper
from framestep.motion.reals import add_words, order_words
from framestep.motors import backlash, bounds, feeder
from framestep.motors.backlash import drag, motor_step, offset, replan_from, same_side, take_up, taken_up
from framestep.motors.feeder import set_cubic
from framestep.native import addressof, as_word, const

TICKS_PER_SECOND = const(1000)
SLOWEST = const(10)  # steps/s below which a set velocity is lifted (field note 4.1)
FASTEST = const(500000)  # steps/s: what the kernel's numbers hold
STEEPEST = const(4000000)  # steps/s²: the same; a higher setting is taken as this
DEFAULT_VELOCITY = const(5000)  # field note 4.1
DEFAULT_ACCELERATION = const(20000)
INCHING = const(100)  # least share of a jog, in ten-thousandths (field note 4.2: a small floor)

MOST = const(14)  # that the ring takes, with room for the two that an end is
FIRST_TICKS = const(100)  # queued before a motion starts: the main loop may be away for so long
SPLICE_TICKS = const(12)  # from a request to the place where the new plan takes over
SLOW_SPLICE_TICKS = const(32)  # the same where the jerk is limited: such a plan takes up to 20 ms on an RP2040

# Numbers of an axis, registers of `numbers`
TOP = const(0)  # greatest velocity, steps per tick
STEEP = const(2)  # greatest acceleration, steps per tick²
JERK = const(4)  # greatest jerk, steps per tick³, 0 for none
SHARE_TOP = const(6)  # the same for the motion under way (a jog has a share of them)
SHARE_STEEP = const(8)
_X = const(12)
_Y = const(14)

# Words of `limits`, after bounds.LOWER and bounds.UPPER
TARGET = const(2)

_UNLIMITED = const(0x3FFFFFFF)
_GOES = const(stepper.RUN | stepper.STOP)


def kernel_rate(acceleration):
    """steps/s² (up to STEEPEST) as the kernel's deceleration, Q22 steps per tick²; at least 1."""
    rate = acceleration * 4 + acceleration * 199 // 1024  # 2^22 / 10^6 = 4.194304
    return rate if rate else 1


class Axis:
    """One motor."""

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
        self.cut = array("i", [0] * 2)  # the same where trim() has cut the queue
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
        self.own_velocity = 0  # as set_speed() has it; in force is what the coupled motor can do as well
        self.own_acceleration = 0
        self.own_jerk = 0
        self.velocity = 0
        self.acceleration = 0
        self.gentler = False  # a lower acceleration waits
        self.share = 0
        self.stale = True  # what travel() has computed from share and settings no longer holds
        self.backlash = 0  # steps of play that the motor takes up before the load moves
        self.place = array("i", [0])  # where the load is, with what has been queued to the engine: what is asked for
        self.block[stepper.PLACE] = as_word(addressof(self.place))
        # The place that the phases lead to, from there to the motor's step (-backlash where the load is moved down),
        # and the backlash
        self.planned = array("i", [0] * 3)
        self.way = 0  # for what direction the play is to be taken up at TARGET: 1 up, -1 down, 0 for either
        self.easing = False  # a stop within the jerk limit is under way
        self.partner = None  # the motor that does what this one does
        self.leader = None  # the motor that this one follows
        self.turned = 0
        self.base = array("i", [0])  # from this motor's steps to the partner's: their difference, or turned their sum
        self.word = array("i", [0] * 3)
        bounds.update(self)
        self.set_speed(DEFAULT_VELOCITY, DEFAULT_ACCELERATION)

    # ---------------------------------------------------------------- settings

    def set_speed(self, velocity, acceleration):
        """Greatest velocity (steps/s, 1 … FASTEST) and acceleration (steps/s²; 0: half the velocity).

        Of coupled motors the stricter setting counts. A lower acceleration than that of the motion under way waits
        for calm() (`gentler` is True): with less the motor could not stop where it has to, at a soft limit for one.
        """
        if velocity < SLOWEST:
            velocity = SLOWEST
        if acceleration == 0:
            acceleration = max(velocity // 2, 1)
        if acceleration > STEEPEST:
            acceleration = STEEPEST
        self.own_velocity = velocity
        self.own_acceleration = acceleration
        (self.leader or self)._apply()

    def _apply(self):
        """Bring the settings into force, the stricter ones of this motor and its partner."""
        velocity = self.own_velocity
        acceleration = self.own_acceleration
        jerk = self.own_jerk
        partner = self.partner
        if partner:
            velocity = min(velocity, partner.own_velocity)
            acceleration = min(acceleration, partner.own_acceleration)
            if not jerk or 0 < partner.own_jerk < jerk:
                jerk = partner.own_jerk
        self.gentler = False
        if acceleration < self.acceleration and not self.stands:
            self.gentler = True
            acceleration = self.acceleration
        self.velocity = velocity
        self.acceleration = acceleration
        self.stale = True
        r = self.numbers
        reals.put(r, _Y, TICKS_PER_SECOND, 0)
        reals.put(r, TOP, velocity, 0)
        reals.divide(r, TOP, TOP, _Y)
        reals.put(r, STEEP, acceleration, 0)
        reals.divide(r, STEEP, STEEP, _Y)
        reals.divide(r, STEEP, STEEP, _Y)
        reals.put(r, JERK, jerk, 0)
        reals.divide(r, JERK, JERK, _Y)
        reals.divide(r, JERK, JERK, _Y)
        self.block[stepper.BRAKE] = kernel_rate(acceleration)
        if partner:
            partner.block[stepper.BRAKE] = self.block[stepper.BRAKE]  # one ramp for both, whoever stops them

    def calm(self):
        """Take a lower acceleration that has waited for the motor to stand; False where it still moves."""
        if self.leader:
            return self.leader.calm()
        if not self.stands:
            return False
        if self.gentler:
            self._apply()
        return True

    def set_jerk(self, jerk):
        """Greatest jerk in 1000 steps/s³ (up to 2^30 - 1), 0 for plain trapezoids. Only at rest."""
        self.own_jerk = jerk
        (self.leader or self)._apply()

    def set_limits(self, lower_enabled, upper_enabled, source, i):
        """Soft limits source[i] and source[i + 1], in steps. False where they cross: nothing is set."""
        if lower_enabled and upper_enabled and order_words(source, i, source, i + 1) > 0:
            return False
        reals.copy_word(self.limits, bounds.LOWER, source, i)
        reals.copy_word(self.limits, bounds.UPPER, source, i + 1)
        self.lower_enabled = lower_enabled
        self.upper_enabled = upper_enabled
        bounds.update(self.leader or self)
        return True

    def clamp(self, target, i):
        """Hold target[i] within `bounds`; a motor past one stays where it is at most."""
        side = self.outside(target, i)
        if side:
            end = 1 if side > 0 else 0
            reals.copy_word(target, i, self.bounds, end)
            if self.outside(target, i) or order_words(self.place, 0, self.bounds, end) == side:
                reals.copy_word(target, i, self.place, 0)

    def heed(self, hal):
        """After set_limits() in a motion by travel(): end it at the new limit, if it leads past that."""
        if self.moving and not self.stopping and not self.easing and self.outside(self.limits, TARGET):
            self.travel(hal, self.limits, TARGET, self.share, self.way)

    def heads_for(self, target, i, share):
        """Whether the motion under way is the one that travel() would plan."""
        return (
            self.share == share
            and not self.stale
            and (self.block[stepper.PLANNED] & stepper.PLAN_SEGMENTS or self.block[stepper.MODE] == stepper.RUN)
            and order_words(target, i, self.limits, TARGET) == 0
        )

    def outside(self, target, i):
        """Where target[i] lies past `bounds`: 1 above, -1 below, else 0.

        A motor that is already past one may move toward the allowed range (field note 4.3).
        """
        self.refresh()
        side = self.beyond(target, i)
        if side and order_words(self.place, 0, self.bounds, 1 if side > 0 else 0) == side:
            if order_words(target, i, self.place, 0) != side:
                return 0
        return side

    def beyond(self, target, i):
        """Where target[i] lies past `bounds`, wherever the motor is: 1, -1 or 0."""
        if order_words(target, i, self.bounds, 1) > 0:
            return 1
        if order_words(target, i, self.bounds, 0) < 0:
            return -1
        return 0

    # ---------------------------------------------------------------- state

    @property
    def moving(self):
        """From the moment a motion is asked for until the last pulse is out."""
        block = (self.leader or self).block
        return (block[stepper.PLANNED] | block[stepper.MODE]) != 0

    @property
    def stands(self):
        """Whether nothing is queued that it moves by; the last pulses may still be on their way out."""
        return not self.block[stepper.MODE] & _GOES and not self.block[stepper.PLANNED] & stepper.PLAN_SEGMENTS

    @property
    def stopping(self):
        """Whether the kernel slows it down."""
        return self.block[stepper.MODE] & stepper.STOP != 0

    def position_to(self, target, i):
        """target[i] = where the motor is, in steps."""
        self.refresh()
        reals.copy_word(target, i, self.place, 0)

    def set_position(self, source, i):
        """Give the place where the motor stands another number. Only at rest.

        False where it cannot have it, since the motor's own step, with the play, would lie past the end of the range
        of positions, or be farther from the coupled motor's than that is wide: then nothing has changed.
        """
        self.refresh()
        word = self.word
        word[2] = self.backlash
        if not add_words(word, 1, source, i, word, 2, 1):
            return False
        word[2] = offset(self.place, self.block)
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
        reals.copy_word(self.place, 0, source, i)
        bounds.update(leader)
        return True

    def refresh(self):
        """Bring `place` up to date: before it is read, and often enough to see every turn."""
        drag(self.place, self.block, self.backlash)

    def stands_on(self, source, i, way=0):
        """Whether it stands still on source[i], with its play taken up for a motion `way` (1 up, -1 down, 0 either)."""
        return not self.moving and self._is_on(source, i, way)

    def _is_on(self, source, i, way):
        self.refresh()
        return (
            reals.equal_words(self.place, 0, source, i) != 0
            and taken_up(self.place, self.block, self.backlash, way) != 0
        )

    def heading(self):
        """For what direction the play is taken up where the phases lead to: 1 up, -1 down, 0 without play."""
        if not self.backlash:
            return 0
        return -1 if self.planned[backlash.OFFSET] else 1

    def set_backlash(self, steps):
        """Steps of play, 0 … 10000. Only at rest."""
        self.backlash = steps
        self.planned[backlash.PLAY] = steps
        bounds.update(self)
        self.block[stepper.PLAY] = steps

    # ---------------------------------------------------------------- motion

    def prepare(self, hal, ticks=SPLICE_TICKS):
        """Make the cubic the state that a new plan starts from, and drop what was planned. Everything that moves
        begins here.

        ticks: from now to where it takes over. False where the motor comes to rest so soon that a plan would not be
        made in time: then it does that first, and what was planned has been queued.
        """
        if self.positions.settled:
            self.positions.touch()
        block = self.block
        taken = self._splice(hal, ticks)
        if taken < 0 and block[stepper.PLANNED] & stepper.PLAN_SEGMENTS:
            self.feed(MOST, ticks)
            taken = self._splice(hal, ticks)
        if taken < 0:
            return False
        set_cubic(self.cubic, self.state)
        self.phases.clear()
        work = self.work
        work[feeder.LEFT] = work[feeder.PART] = work[feeder.AIMED] = work[feeder.MARKED] = work[feeder.MORE] = 0
        block[stepper.PLANNED] = 0
        self.easing = False
        self.refresh()
        reals.copy_word(self.planned, 0, self.place, 0)
        self.planned[backlash.OFFSET] = offset(self.place, block)
        return True

    def _splice(self, hal, ticks):
        irq = hal.irq_off()
        taken = stepper.splice(self.block, ticks, self.state)
        if taken >= 0 and self.partner:
            stepper.splice(self.partner.block, ticks, self.partner.state)
        hal.irq_on(irq)
        return taken

    def travel(self, hal, target, i, share=10000, way=0):
        """Move to the step target[i]; `share` of velocity and acceleration in ten-thousandths.

        way: what the motor is to do next, 1 up, -1 down, 0 unknown. It comes to rest with its play taken up for that
        direction, by a second motion where it comes from the other side (see stands_on).
        Under way it bends to the new target, stopping first where it must turn (field note 4.8). A target past `bounds`
        is held there, see clamp(): they may have become narrower since it was checked.
        Returns whether anything moves. The motion starts with the next tick.
        """
        r = self.numbers
        if share != self.share or self.stale:
            self.share = share
            self.stale = False
            reals.put(r, _X, max(share, INCHING), 0)
            reals.put(r, _Y, 10000, 0)
            reals.divide(r, _X, _X, _Y)
            reals.multiply(r, SHARE_TOP, TOP, _X)
            reals.multiply(r, _Y, STEEP, _X)
            if not self.stands and reals.compare(r, _Y, SHARE_STEEP) < 0:
                self.stale = True  # under way it must be able to stop as planned before; done again when it stands
            else:
                reals.copy(r, SHARE_STEEP, _Y)
        reals.copy_word(self.limits, TARGET, target, i)
        self.clamp(self.limits, TARGET)
        self.way = way
        # A stop by the kernel keeps no limit of the jerk: a plan within one cannot begin in the midst of it.
        smooth = reals.sign(r, JERK) > 0
        if smooth and self.stopping or not self.prepare(hal, SLOW_SPLICE_TICKS if smooth else SPLICE_TICKS):
            self.block[stepper.PLANNED] = stepper.PLAN_TARGET  # seek() goes on from there
            return True
        if reals.equal_words(self.limits, TARGET, self.planned, backlash.PLACE):
            take_up(self.planned, self.limits, way)
        else:
            motor_step(self.planned, self.limits, self.limits, TARGET, 0)
        self.block[stepper.PLANNED] = stepper.PLAN_TARGET if self.backlash else 0
        planned = ramps.plan(self.phases, self.cubic, self.limits, backlash.PHYSICAL, r, SHARE_TOP, SHARE_STEEP, JERK)
        if planned == ramps.STOP_FIRST:
            if not ramps.plan_stop(self.phases, self.cubic, self.limits, backlash.PHYSICAL, r, STEEP, JERK):
                self.stop(hal)
                self.block[stepper.PLANNED] = stepper.PLAN_TARGET
                return True
            self.block[stepper.PLANNED] = stepper.PLAN_TARGET
        elif planned == ramps.NOTHING:
            if self.block[stepper.MODE] != stepper.RUN:
                return self.moving
            # It comes to rest there already, and prepare() has taken the end off the queue.
        self.block[stepper.PLANNED] |= stepper.PLAN_SEGMENTS
        self.feed(MOST, FIRST_TICKS)
        self.start(hal)
        return True

    def aim(self, duration, start, end, numbers, targets, i, part=0):
        """Append an AIM phase to the place targets[i]: see ramps.Phases.aim."""
        motor_step(self.planned, self.limits, targets, i, part)
        self.phases.aim(duration, start, end, numbers, self.limits, backlash.PHYSICAL, part)

    def coast(self, duration, start, end, numbers, places, i, part=0):
        """Append an AIM phase to the place places[i] with the play as it is, so that none of it is taken up on the
        way: for ramps and virtual motion. Where that is the other way than the motion before it, the load stays behind
        by the play."""
        same_side(self.planned, self.limits, places, i, part)
        self.phases.aim(duration, start, end, numbers, self.limits, backlash.PHYSICAL, part)

    def cut_off(self, ticks):
        """End the queue about `ticks` from now, to go on from there otherwise: go_on(). When that is, in ticks.

        With interrupts off. Motors that play the same phases in time are cut at the same moment.
        """
        taken = stepper.splice(self.block, ticks, self.state)
        if taken >= 0 and self.partner:
            stepper.splice(self.partner.block, ticks, self.partner.state)
        return taken

    def go_on(self, places, i):
        """After cut_off(): further phases follow, from where the cubic is now. places[i]: where the load was before, on
        its way in the same direction."""
        set_cubic(self.cubic, self.state)
        self.phases.clear()
        work = self.work
        work[feeder.LEFT] = work[feeder.PART] = work[feeder.AIMED] = work[feeder.MARKED] = 0
        work[feeder.MORE] = 1
        self.block[stepper.PLANNED] = stepper.PLAN_SEGMENTS | stepper.PLAN_TIMED
        self.refresh()
        self.planned[backlash.OFFSET] = offset(self.place, self.block)
        reals.copy_word(self.planned, backlash.PLACE, places, i)

    def trim(self, ticks, put):
        """Whether what is queued can be cut off at the end of a phase, `ticks` from now; if `put`, cut it off there.

        With interrupts off. Only among AIM phases of whole ticks. What is to follow is for resume().
        """
        if not stepper.trim(self.block, ticks, put, self.cut):
            return False
        if put and self.partner:
            stepper.trim(self.partner.block, ticks, put, self.state)
        return True

    def resume(self, places, i):
        """After trim(): go on from there with further phases of coast(). places[i] = the place that it is; Q16 of one
        more."""
        self.phases.clear()
        work = self.work
        work[feeder.LEFT] = work[feeder.PART] = work[feeder.MARKED] = 0
        reals.copy_word(self.knot, 0, self.cut, 0)
        self.knot[1] = self.cut[1]
        work[feeder.AIMED] = work[feeder.MORE] = 1
        self.block[stepper.PLANNED] = stepper.PLAN_SEGMENTS
        return replan_from(self.planned, self.cut, places, i)

    def expect(self, more):
        """Whether further phases will be appended: then it does not come to rest behind the last one."""
        self.work[feeder.MORE] = 1 if more else 0

    def seek(self, hal):
        """At rest: go on to a target that turning round has missed by the play, or that a stop came before, and take
        up the play there."""
        self.block[stepper.PLANNED] = 0
        self.calm()
        if not self._is_on(self.limits, TARGET, self.way):
            self.travel(hal, self.limits, TARGET, self.share or 10000, self.way)

    def start(self, hal):
        """Let the kernel take the queue from the next tick on."""
        irq = hal.irq_off()
        self.release()
        hal.irq_on(irq)

    def release(self):
        """As start(), with interrupts off already: for several motors in the same tick."""
        block = self.block
        mode = block[stepper.MODE]
        if mode == stepper.IDLE or mode == stepper.DRAIN:
            block[stepper.MODE] = mode | stepper.RUN | stepper.START
        if self.partner:
            self.partner.release()

    def couple(self, partner, turned):
        """Make another motor do what this one does from now on, with the sign turned or not. Both at rest.

        The places where both stand now are the same from then on. The stricter settings and limits of the two count,
        whenever they are set. False where the motors' steps lie farther apart than the range of positions is wide:
        nothing has changed.
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
        """Let the partner go. Both at rest."""
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
        """Ramp down from the next tick on, `factor` times as steeply as the motor is set to.

        smooth: within the jerk limit, if the motor has one. That is a plan, which begins some ticks
        from now and must be fed. Coupled motors stop together, whichever is meant.
        """
        if self.leader:
            self.leader.stop(hal, factor, smooth)
            return
        self.block[stepper.PLANNED] &= stepper.PLAN_SEGMENTS
        if smooth and self._ease(hal):
            return
        self.easing = False
        self.phases.clear()
        self.work[feeder.LEFT] = 0
        self.block[stepper.PLANNED] = 0
        self.work[feeder.MORE] = 0
        rate = kernel_rate(min(self.acceleration * factor, STEEPEST))
        irq = hal.irq_off()
        stepper.halt(self.block, rate)
        if self.partner:
            stepper.halt(self.partner.block, rate)
        hal.irq_on(irq)

    def _ease(self, hal):
        """Plan a stop within the jerk limit; False where the motor has none, or does not move by segments."""
        r = self.numbers
        if reals.sign(r, JERK) <= 0 or self.block[stepper.MODE] != stepper.RUN:
            return False
        if self.easing:
            return True  # a further request does not make it longer
        if not self.prepare(hal):
            self.block[stepper.PLANNED] = 0
            return True  # it is about to come to rest
        if not ramps.plan_stop(self.phases, self.cubic, self.limits, backlash.PHYSICAL, r, STEEP, JERK):
            return False
        self.easing = True
        self.block[stepper.PLANNED] |= stepper.PLAN_SEGMENTS
        self.feed(MOST, FIRST_TICKS)
        self.start(hal)
        return True

    # ---------------------------------------------------------------- feeding the queue

    def feed(self, most=MOST, enough=_UNLIMITED):
        """Cut phases into segments until `most` of them are queued, or `enough` ticks more than before."""
        if self.partner:
            feeder.feed(self.parts, self.partner.block, self.base, most, enough)
        else:
            feeder.feed(self.parts, None, self.base, most, enough)
