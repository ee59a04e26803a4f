"""Motors: their settings, and the way from a request or a played move to segments in the queue.

An axis has a list of phases (ramps.py) and feeds them, as segments, to the tick kernel's queue
some tenths of a second ahead. Everything that moves a motor goes through here.

Positions are steps, int32, and never become Python numbers where they may be large: they are
handed over as (array, index). Nothing allocates after construction.
"""

from array import array

from framestep.motion import ramps, reals, segments, stepper
from framestep.motion.positions import Positions
from framestep.motion.ramps import load
from framestep.motion.reals import add_words, order_words
from framestep.motion.segments import bridge, cut, knot, mark, mirror, settle, shift, snap
from framestep.native import addressof, as_word, const, micropython, ptr32

TICKS_PER_SECOND = const(1000)
SLOWEST = const(10)  # steps/s below which a set velocity is lifted (field note 4.1)
FASTEST = const(500000)  # steps/s: what the kernel's numbers hold
STEEPEST = const(4000000)  # steps/s²: the same; a higher setting is taken as this
DEFAULT_VELOCITY = const(5000)  # field note 4.1
DEFAULT_ACCELERATION = const(20000)
INCHING = const(100)  # least share of a jog, in ten-thousandths (field note 4.2: a small floor)

AHEAD = const(11)  # segments to keep queued
LOW = const(5)  # with fewer a moving motor is filled up in any pass
_PIECE = const(4)  # segments cut in a pass, at least
_CALL = const(2)  # so many could have been cut in the time that it takes to begin with a motor
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

# Words of `limits`
LOWER = const(0)
UPPER = const(1)
TARGET = const(2)

PHYSICAL = const(3)  # the motor's own step for a target, with the play

# Words of `planned`
_PLACE = const(0)
_OFFSET = const(1)
_PLAY = const(2)

# Words of `work`: what of the phases has been queued
_LEFT = const(0)  # ticks of the cubic's phase still to be queued
_PART = const(1)  # Q30 of a tick: what remains of the phase after them
_AIMED = const(2)  # the phase under way ends on the step in `knot`
_MARKED = const(3)  # the tick that is open has its start in `state`
_MORE = const(4)  # further phases will be appended: do not come to rest
_LED = const(5)  # a partner does the same: 1, in the opposite sense 2
_WORK_WORDS = const(6)

_ENDS = array("i", [-(1 << 31), (1 << 31) - 1])  # of the range of positions; LOWER and UPPER

_ALL_BITS = const(0x3FFFFFFF)
_PHASE_MASK = const(ramps.PHASES - 1)
_GOES = const(stepper.RUN | stepper.STOP)


@micropython.viper
def _set_cubic(cubic: ptr32, state: ptr32):
    """Start a cubic from the state that stepper.splice tells."""
    cubic[0] = state[0]
    cubic[1] = state[1] >> 6
    cubic[2] = (state[1] & 63) << 24
    # the kernel's velocity is the displacement of a tick: half the acceleration more
    v = state[2] - (state[3] >> 6)
    cubic[3] = v >> 6
    cubic[4] = (v & 63) << 24
    a = state[3]
    cubic[5] = a >> 12
    cubic[6] = (a & 0xFFF) << 18
    cubic[7] = 0
    cubic[8] = 0


@micropython.viper
def lead(planned: ptr32, limits: ptr32, targets, i: int, part: int):
    """limits[PHYSICAL] = the motor's step for the place targets[i], coming from where it is planned to be.

    part: Q16 of a step that the place is beyond; whether it lies ahead or behind is decided by the nearest step.
    """
    step = ptr32(targets)[i + 0]
    place = step + (part >> 15)
    if place > planned[_PLACE]:
        planned[_OFFSET] = 0
    elif place < planned[_PLACE]:
        planned[_OFFSET] = 0 - planned[_PLAY]
    planned[_PLACE] = place
    limits[PHYSICAL] = step + planned[_OFFSET]


@micropython.viper
def _follow(planned: ptr32, limits: ptr32, places, i: int, part: int):
    """limits[PHYSICAL] = the motor's step for the place places[i] with the play as it is, whichever way that is.

    part: Q16 of a step that the place is beyond.
    """
    step = ptr32(places)[i + 0]
    planned[_PLACE] = step + (part >> 15)
    limits[PHYSICAL] = step + planned[_OFFSET]


@micropython.viper
def _take_up(planned: ptr32, limits: ptr32, way: int):
    if way > 0:
        planned[_OFFSET] = 0
    elif way < 0:
        planned[_OFFSET] = 0 - planned[_PLAY]
    limits[PHYSICAL] = planned[_PLACE] + planned[_OFFSET]


@micropython.viper
def _replan(planned: ptr32, cut: ptr32, places, i: int) -> int:
    """Plan from where the motor is on the step cut[0] and cut[1] (Q16) of one more: places[i] is that step of the load,
    with the play as it is. cut[1] again."""
    step = cut[0] - planned[_OFFSET]
    part = cut[1]
    place = ptr32(places)
    place[i] = step
    planned[_PLACE] = step + (part >> 15)
    return part


@micropython.viper
def _play(place: ptr32, block: ptr32, backlash: int):
    """Where the load is: it lags behind the motor by the play of the gears, whichever way it goes."""
    p = block[stepper.POSITION]
    if place[0] < p:
        place[0] = p
    elif place[0] - p > backlash:
        place[0] = p + backlash


@micropython.viper
def _gap(place: ptr32, block: ptr32) -> int:
    """Steps from the load's place to the motor's."""
    return block[stepper.POSITION] - place[0]


@micropython.viper
def _taken_up(place: ptr32, block: ptr32, backlash: int, way: int) -> int:
    """Whether the play is taken up for a motion up (way > 0) or down (< 0); 0: whatever it is."""
    gap = block[stepper.POSITION] - place[0]
    if way > 0:
        return 1 if gap == 0 else 0
    if way < 0:
        return 1 if gap + backlash == 0 else 0
    return 1


@micropython.viper
def _feed(parts, other, base, most: int, enough: int):
    """Cut phases into segments until `most` of them are queued, or `enough` ticks more than before.

    parts: see Axis; other: the block of a motor that does the same, and base: see segments.mirror().

    A phase ends within a tick, as a rule. That tick is a segment of its own, from where the old phase begins it to
    where the new one, or the one after that, ends it. At the end of the last phase the motor comes to rest.
    """
    work = parts[0]
    cubic = parts[1]
    block = parts[2]
    state = parts[3]
    whole = parts[4]
    words = parts[6]
    w = ptr32(work)
    b = ptr32(block)
    out = ptr32(whole)
    p = ptr32(words)
    led = w[_LED]
    while (
        b[stepper.PLANNED] & stepper.PLAN_SEGMENTS
        and enough > 0
        and (b[stepper.TAIL] - b[stepper.HEAD]) & _ALL_BITS < most
    ):
        n = w[_LEFT]
        if n:
            if n > segments.LONGEST:
                n = segments.LONGEST
            cut(cubic, block, n)
            if led:
                mirror(block, other, base, led - 1)
            shift(cubic, n << 24, 6, 0)
            w[_LEFT] = w[_LEFT] - n
            enough -= n
            continue
        if w[_MORE] and p[ramps.HEAD] == p[ramps.TAIL]:
            return
        part = w[_PART]
        if part:
            if w[_MARKED] == 0:
                mark(state, cubic)
            w[_MARKED] = 0
            shift(cubic, part, 0, 0)
        while True:
            if w[_AIMED]:
                snap(cubic, parts[5])
                if part:
                    knot(state, parts[5], part)
            if p[ramps.HEAD] == p[ramps.TAIL]:
                settle(cubic)
                if part:
                    bridge(state, cubic, block, part)
                    if led:
                        mirror(block, other, base, led - 1)
                cut(cubic, block, 1)
                if led:
                    mirror(block, other, base, led - 1)
                w[_PART] = 0
                w[_AIMED] = 0
                b[stepper.PLANNED] = b[stepper.PLANNED] & (-1 - stepper.PLAN_SEGMENTS - stepper.PLAN_TIMED)
                break
            took = int(load(words, p[ramps.HEAD] * ramps.PHASE_WORDS, cubic, whole, parts[5], parts[7]))
            if took:
                p[ramps.HEAD] = (p[ramps.HEAD] + 1) & _PHASE_MASK
            w[_AIMED] = took >> 1
            if part == 0:
                w[_LEFT] = out[0]
                w[_PART] = out[1]
                break
            rest = _ALL_BITS - part + 1  # of the tick, below 2^30
            # A phase that ends with the tick is over before what follows it: within a tick an AIM phase may miss its
            # step, and is put there in this tick's segment, not between two.
            if out[0] or out[1] > rest:
                shift(cubic, rest, 0, 0)
                bridge(state, cubic, block, part)
                if led:
                    mirror(block, other, base, led - 1)
                w[_LEFT] = out[0]
                w[_PART] = out[1] - rest
                if w[_PART] < 0:
                    w[_LEFT] = out[0] - 1
                    w[_PART] = w[_PART] + _ALL_BITS + 1
                break
            shift(cubic, out[1], 0, 0)
            part += out[1]
            if w[_MORE] and p[ramps.HEAD] == p[ramps.TAIL]:
                # What follows is still to come: keep the tick open
                shift(cubic, part, 0, 1)
                w[_PART] = part
                w[_MARKED] = 1
                return


@micropython.viper
def _neediest(m: ptr32, least: int, modes: int) -> int:
    """Whose queue is to be filled next: 32 times the motor, from 1, and how many segments it has; 0 for none.

    It has the fewest of those with fewer than `least` (up to 16) and something to cut more from. m: the header.
    modes: only motors in one of them (MODE's bits), 0: any.
    """
    found = 0
    motor = 0
    a = m[stepper.FIRST]
    while a:
        m = ptr32(a)
        a = m[stepper.NEXT]
        motor += 32
        if m[stepper.PLANNED] & stepper.PLAN_SEGMENTS:
            n = (m[stepper.TAIL] - m[stepper.HEAD]) & _ALL_BITS
            if modes and m[stepper.MODE] & modes == 0:
                n = least
            if n < least:
                w = ptr32(m[stepper.WORK])
                p = ptr32(m[stepper.PHASES])
                if w[_LEFT] or w[_MORE] == 0 or p[ramps.HEAD] != p[ramps.TAIL]:
                    least = n
                    found = motor + n
    return found


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
        self.work = array("i", [0] * _WORK_WORDS)
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
        self.bounds = array("i", [0] * 3)  # how far the load may go: see _bound()
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
        self._bound()
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
        reals.copy_word(self.limits, LOWER, source, i)
        reals.copy_word(self.limits, UPPER, source, i + 1)
        self.lower_enabled = lower_enabled
        self.upper_enabled = upper_enabled
        (self.leader or self)._bound()
        return True

    def _bound(self):
        """`bounds`: the lowest and the highest place for the load.

        Those of the soft limits that are enabled, and of the range of positions, to whose lower end the motor must be
        able to take up its play; for coupled motors also what the partner's own bounds are for this one. Then whether
        there is any play.
        """
        bounds = self.bounds
        self._own_bounds(bounds)
        partner = self.partner
        bounds[2] = self.backlash
        if not partner:
            return
        bounds[2] |= partner.backlash
        # The partner's motor goes from its lower bound less its play up to its upper bound.
        word = self.word
        partner._own_bounds(partner.bounds, 1)  # by rounding it may be a hair past the end of its range
        word[2] = partner.backlash
        add_words(word, 0, partner.bounds, 0, word, 2, 1)
        reals.copy_word(word, 1, partner.bounds, 1)
        low = 0
        if self.turned:
            add_words(word, 0, self.base, 0, word, 0, 1)
            add_words(word, 1, self.base, 0, word, 1, 1)
            low = 1
        else:
            add_words(word, 0, word, 0, self.base, 0, 1)
            add_words(word, 1, word, 1, self.base, 0, 1)
        word[2] = self.backlash
        add_words(word, low, word, low, word, 2, 0)
        if order_words(word, low, bounds, 0) > 0:
            reals.copy_word(bounds, 0, word, low)
        if order_words(word, 1 - low, bounds, 1) < 0:
            reals.copy_word(bounds, 1, word, 1 - low)

    def _own_bounds(self, bounds, margin=0):
        word = self.word
        word[2] = self.backlash + margin
        add_words(bounds, 0, _ENDS, 0, word, 2, 0)
        reals.copy_word(bounds, 1, _ENDS, 1)
        if self.lower_enabled and order_words(self.limits, LOWER, bounds, 0) > 0:
            reals.copy_word(bounds, 0, self.limits, LOWER)
        if self.upper_enabled:
            reals.copy_word(bounds, 1, self.limits, UPPER)

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
        word[2] = _gap(self.place, self.block)
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
        leader._bound()
        return True

    def refresh(self):
        """Bring `place` up to date: before it is read, and often enough to see every turn."""
        _play(self.place, self.block, self.backlash)

    def stands_on(self, source, i, way=0):
        """Whether it stands still on source[i], with its play taken up for a motion `way` (1 up, -1 down, 0 either)."""
        return not self.moving and self._is_on(source, i, way)

    def _is_on(self, source, i, way):
        self.refresh()
        return (
            reals.equal_words(self.place, 0, source, i) != 0
            and _taken_up(self.place, self.block, self.backlash, way) != 0
        )

    def heading(self):
        """For what direction the play is taken up where the phases lead to: 1 up, -1 down, 0 without play."""
        if not self.backlash:
            return 0
        return -1 if self.planned[_OFFSET] else 1

    def set_backlash(self, steps):
        """Steps of play, 0 … 10000. Only at rest."""
        self.backlash = steps
        self.planned[_PLAY] = steps
        self._bound()
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
        _set_cubic(self.cubic, self.state)
        self.phases.clear()
        work = self.work
        work[_LEFT] = work[_PART] = work[_AIMED] = work[_MARKED] = work[_MORE] = 0
        block[stepper.PLANNED] = 0
        self.easing = False
        self.refresh()
        reals.copy_word(self.planned, 0, self.place, 0)
        self.planned[_OFFSET] = _gap(self.place, block)
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
        if reals.equal_words(self.limits, TARGET, self.planned, _PLACE):
            _take_up(self.planned, self.limits, way)
        else:
            lead(self.planned, self.limits, self.limits, TARGET, 0)
        self.block[stepper.PLANNED] = stepper.PLAN_TARGET if self.backlash else 0
        planned = ramps.plan(self.phases, self.cubic, self.limits, PHYSICAL, r, SHARE_TOP, SHARE_STEEP, JERK)
        if planned == ramps.STOP_FIRST:
            if not ramps.plan_stop(self.phases, self.cubic, self.limits, PHYSICAL, r, STEEP, JERK):
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
        lead(self.planned, self.limits, targets, i, part)
        self.phases.aim(duration, start, end, numbers, self.limits, PHYSICAL, part)

    def coast(self, duration, start, end, numbers, places, i, part=0):
        """Append an AIM phase to the place places[i] with the play as it is, so that none of it is taken up on the
        way: for ramps and virtual motion. Where that is the other way than the motion before it, the load stays behind
        by the play."""
        _follow(self.planned, self.limits, places, i, part)
        self.phases.aim(duration, start, end, numbers, self.limits, PHYSICAL, part)

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
        _set_cubic(self.cubic, self.state)
        self.phases.clear()
        work = self.work
        work[_LEFT] = work[_PART] = work[_AIMED] = work[_MARKED] = 0
        work[_MORE] = 1
        self.block[stepper.PLANNED] = stepper.PLAN_SEGMENTS | stepper.PLAN_TIMED
        self.refresh()
        self.planned[_OFFSET] = _gap(self.place, self.block)
        reals.copy_word(self.planned, _PLACE, places, i)

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
        work[_LEFT] = work[_PART] = work[_MARKED] = 0
        reals.copy_word(self.knot, 0, self.cut, 0)
        self.knot[1] = self.cut[1]
        work[_AIMED] = work[_MORE] = 1
        self.block[stepper.PLANNED] = stepper.PLAN_SEGMENTS
        return _replan(self.planned, self.cut, places, i)

    def expect(self, more):
        """Whether further phases will be appended: then it does not come to rest behind the last one."""
        self.work[_MORE] = 1 if more else 0

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
        self.work[_LED] = 1 + self.turned
        partner.leader = self
        self._apply()
        self._bound()
        return True

    def uncouple(self):
        """Let the partner go. Both at rest."""
        partner = self.partner
        if partner:
            partner.leader = None
            self.partner = None
            self.work[_LED] = 0
            partner._apply()
            partner._bound()
            self._apply()
            self._bound()

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
        self.work[_LEFT] = 0
        self.block[stepper.PLANNED] = 0
        self.work[_MORE] = 0
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
        if not ramps.plan_stop(self.phases, self.cubic, self.limits, PHYSICAL, r, STEEP, JERK):
            return False
        self.easing = True
        self.block[stepper.PLANNED] |= stepper.PLAN_SEGMENTS
        self.feed(MOST, FIRST_TICKS)
        self.start(hal)
        return True

    # ---------------------------------------------------------------- feeding the queue

    def feed(self, most=MOST, enough=_ALL_BITS):
        """Cut phases into segments until `most` of them are queued, or `enough` ticks more than before."""
        if self.partner:
            _feed(self.parts, self.partner.block, self.base, most, enough)
        else:
            _feed(self.parts, None, self.base, most, enough)


class Axes:
    """All motors of the controller.

    The pins are behind the kernel: what it queues in a tick is pulsed `BEHIND` ticks later. So what is told of
    positions comes from samples taken some ticks ago: all of one moment, and of pulses that have been made.
    """

    def __init__(self, hal):
        self.hal = hal
        self.kernel = hal.kernel
        self.count = hal.kernel.motors
        self.positions = Positions(self.count)
        self.axes = [Axis(hal.kernel, i, self.positions) for i in range(self.count)]
        self.loose = []  # those with backlash
        self.samples = stepper.samples(self.count)  # each pass of the main loop begins with another
        self.told = array("i", [0] * self.count)  # where the loads are by the pulses made until then: see choose()

    def __getitem__(self, motor):
        return self.axes[motor]

    def set_backlash(self, motor, steps):
        """As Axis.set_backlash()."""
        self[motor].set_backlash(steps)
        self.loose = [axis for axis in self.axes if axis.backlash]

    def feed(self, urgent=False):
        """Fill the queue of the motor that has the fewest segments, if fewer than AHEAD; whether there was one.

        When that takes little, the next one's as well: in one pass of the main loop a piece of the work is done, so
        that requests are answered between. But a pass may be the only one between two long absences, so it leaves no
        motor that moves with fewer than LOW. urgent: no others.
        """
        state = self.kernel.state
        left = _PIECE
        more = True
        while True:
            found = _neediest(state, LOW, stepper.RUN)
            if not found:
                if left <= 0:
                    break
                if not urgent:
                    found = _neediest(state, AHEAD, 0)
                if not found:
                    more = False
                    break
            axis = self.axes[(found >> 5) - 1]
            tail = axis.block[stepper.TAIL]
            axis.feed(min((found & 31) + AHEAD, MOST))
            left -= ((axis.block[stepper.TAIL] - tail) & _ALL_BITS) + _CALL
        for axis in self.loose:
            axis.refresh()
        bits = stepper.seeking(self.kernel.state)
        if not bits:
            return more
        motor = 0
        while not bits & 1:
            bits >>= 1
            motor += 1
        self.axes[motor].seek(self.hal)
        return True

    @property
    def filled(self):
        """Whether every queue has AHEAD segments, or all that there is to cut."""
        return _neediest(self.kernel.state, AHEAD, 0) == 0

    def choose(self):
        """`told` = where the pulses made until now have taken the loads. The tick (modulo 2^29) whose pulses were the
        last of them."""
        return stepper.choose(self.kernel.state, self.samples, self.told)

    def alarm(self, tick):
        """Have stepper.sample() tell from when this tick (modulo 2^29) is over; -1: no longer."""
        self.samples[stepper.ALARM] = tick

    def renumbered(self, motor):
        """A motor at rest has been given another position."""
        stepper.renumber(self.samples, motor, self.axes[motor].place)

    def moving_bits(self):
        """One bit per motor that moves."""
        return stepper.moving(self.kernel.state)

    @property
    def moving(self):
        return stepper.moving(self.kernel.state) != 0

    def release(self, bits):
        """Start the motors of these bits in the next tick, all in the same. Interrupts are off."""
        for i in range(self.count):
            if bits >> i & 1:
                self.axes[i].release()

    def discard(self, bits):
        """Drop what has been prepared for the motors of these bits, which are at rest and not planned to move."""
        for i in range(self.count):
            if bits >> i & 1 and self.axes[i].partner:
                bits |= 2 << i
        irq = self.hal.irq_off()
        stepper.discard(self.kernel.state, bits)
        self.hal.irq_on(irq)

    def stop(self, factor=1, spared=0, smooth=False):
        """Ramp all motors down but those of the bits `spared`, and those that they lead; see Axis.stop."""
        for i in range(self.count):
            axis = self.axes[i]
            if axis.moving and not axis.leader and not spared >> i & 1:
                axis.stop(self.hal, factor, smooth)
