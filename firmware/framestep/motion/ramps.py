"""Ramps: from a position and a velocity to a target at rest, as a few phases of constant jerk.

A phase is a stretch of a motor's motion with one cubic. Its duration is a real number of ticks and
need not end on a tick. Kinds:

    RAMP    G2 and G3 given (half the acceleration, a sixth of the jerk); ends where that leads
    AIM     the cubic that reaches a given place at a given velocity when the phase ends
    ONWARD  what is left of an AIM phase: a long one is taken in pieces, each aimed anew

A plan is at most: ramp to a stop (where the target lies behind), ramp to the cruising velocity,
cruise, ramp down onto the target. The last one aims, so what rounding the other phases left is
spread over it and the motor comes to rest on the step exactly. With a jerk limit each ramp is three
phases; since a ramp is symmetric it covers the mean of its two velocities times its duration
either way, which is all that the plan needs to know of it.

Time in ticks of 1 ms, position in steps, along the direction of the motion. Nothing allocates.
"""

from array import array

from framestep.motion import reals
from framestep.motion.reals import combine, divide, double, put, split
from framestep.motion.segments import G1, G2, G3, WHOLE, coefficient, distance, velocity
from framestep.native import const, micropython, ptr32

# Words of a phase
KIND = const(0)
TARGET = const(1)  # AIM: the step
DURATION = const(2)
START = const(4)  # velocity at the start
SECOND = const(6)  # RAMP: G2. AIM: velocity at the end
THIRD = const(8)  # RAMP: G3. AIM: in its first word what the place is beyond the step, Q16
PHASE_WORDS = const(10)
PHASES = const(16)  # in the ring of a motor, a power of 2
HEAD = const(160)  # words behind them: the first one to come, where the next one goes
TAIL = const(161)

RAMP = const(0)
AIM = const(1)
ONWARD = const(2)

# What plan() has done
NOTHING = const(0)
PLANNED = const(1)
STOP_FIRST = const(2)

_MASK = const(15)
_PIECE = const(256)  # ticks of an AIM phase that rounding leaves within a ten-thousandth of a step

# What load() has done with a phase; 0: taken a part of it
_TOOK = const(1)
_TOOK_AIM = const(2)

# Registers of the planner
_V = const(0)  # velocity at the start, along the way
_TOP = const(2)  # greatest velocity
_A = const(4)  # greatest acceleration
_J = const(6)  # greatest jerk, 0 for none
_S = const(8)  # way to go
_C = const(10)  # cruising velocity
_T = const(12)
_X = const(14)
_Y = const(16)
_Z = const(18)
_W = const(20)
_LOW = const(22)
_HIGH = const(24)
_D = const(26)  # difference of velocity of a ramp
_T1 = const(28)
_T2 = const(30)
_U = const(32)
_ZERO = const(34)
_LEAVE = const(36)
_SIXTH = const(38)
_THIRD = const(40)
_SHORT = const(42)
_SPARE = const(44)
_FEW = const(46)

_FARTHEST = const(0x20000000)  # steps

scratch = array("i", [0] * 48)
whole = array("i", [0])
reals.put(scratch, _LEAVE, 1, -6)
reals.put(scratch, _SHORT, 1, -8)  # phases shorter than this many ticks are left out
reals.put(scratch, _FEW, 4, 0)  # ticks
reals.put(scratch, _X, 3, 0)
reals.put(scratch, _Y, 1, 0)
reals.divide(scratch, _THIRD, _Y, _X)
reals.double(scratch, _SIXTH, _THIRD, -1)


def _number(words, to, register, turned):
    if turned:
        reals.negate(scratch, _SPARE, register)
        reals.fetch(words, to, scratch, _SPARE)
    else:
        reals.fetch(words, to, scratch, register)


def _push(phases, kind, duration, start, second, third, turned):
    """Append a phase made of scratch registers; velocities and accelerations change sign if turned."""
    words = phases.words
    at = words[TAIL] * PHASE_WORDS
    words[at + KIND] = kind
    reals.fetch(words, at + DURATION, scratch, duration)
    _number(words, at + START, start, turned)
    _number(words, at + SECOND, second, turned)
    _number(words, at + THIRD, third, turned)
    words[TAIL] = (words[TAIL] + 1) & _MASK


class Phases:
    """The phases that lie ahead of one motor, a ring."""

    def __init__(self):
        self.words = array("i", [0] * (PHASES * PHASE_WORDS + 2))

    def clear(self):
        self.words[HEAD] = self.words[TAIL] = 0

    def count(self):
        """Phases ahead."""
        return (self.words[TAIL] - self.words[HEAD]) & _MASK

    def aim(self, duration, start, end, numbers, targets, i, part=0):
        """Append an AIM phase: registers of `numbers`, the step targets[i] and `part` of one more (Q16)."""
        put_aim(self.words, numbers, duration, start, end, targets, i, part)


@micropython.viper
def put_aim(words: ptr32, r: ptr32, duration: int, start: int, end: int, targets, i: int, part: int):
    """Phases.aim() for the words of the phases."""
    at = words[TAIL] * PHASE_WORDS
    words[TAIL] = (words[TAIL] + 1) & _MASK
    words[at + KIND] = AIM
    words[at + DURATION] = r[duration + 0]
    words[at + DURATION + 1] = r[duration + 1]
    words[at + START] = r[start + 0]
    words[at + START + 1] = r[start + 1]
    words[at + SECOND] = r[end + 0]
    words[at + SECOND + 1] = r[end + 1]
    words[at + TARGET] = ptr32(targets)[i + 0]
    words[at + THIRD] = part


@micropython.viper
def load(words, at: int, cubic, whole, knot, r) -> int:
    """Take the phase at words[at]: set the cubic, whose position stays, and split its duration into whole ticks and a
    fraction in `whole`. If it aims, `knot` becomes where to: step, Q16 of one more. r: `scratch`.
    _TOOK, _TOOK_AIM, or 0 where a part of the phase is left."""
    w = ptr32(words)
    out = ptr32(whole)
    kind = w[at + KIND]
    split(words, at + DURATION, whole)
    if kind == ONWARD:
        velocity(words, at + START, cubic, G1)
    else:
        coefficient(cubic, G1, words, at + START)
    if kind == RAMP:
        coefficient(cubic, G2, words, at + SECOND)
        coefficient(cubic, G3, words, at + THIRD)
        return _TOOK
    ptr32(knot)[0] = w[at + TARGET]
    ptr32(knot)[1] = w[at + THIRD]
    # Cubic Hermite: G2 = (3·mean - 2·start - end)/T, G3 = (start + end - 2·mean)/T²
    s = ptr32(r)
    s[_T] = w[at + DURATION]
    s[_T + 1] = w[at + DURATION + 1]
    s[_V] = w[at + START]
    s[_V + 1] = w[at + START + 1]
    s[_C] = w[at + SECOND]
    s[_C + 1] = w[at + SECOND + 1]
    if out[0] == 0:
        # Within a tick there is nothing to bend; where it ends is up to what follows.
        combine(r, _X, _C, _V, 1)
        divide(r, _X, _X, _T)
        double(r, _X, _X, -1)
        coefficient(cubic, G2, r, _X)
        coefficient(cubic, G3, r, _ZERO)
        return _TOOK_AIM
    distance(r, _S, words, at + TARGET, cubic)
    if w[at + THIRD]:
        put(r, _X, w[at + THIRD], -16)
        combine(r, _S, _S, _X, 0)
    divide(r, _W, _S, _T)
    combine(r, _X, _W, _V, 1)  # mean - start
    combine(r, _Y, _W, _C, 1)  # mean - end
    combine(r, _Z, _X, _Y, 0)
    combine(r, _X, _X, _Z, 0)
    divide(r, _X, _X, _T)
    coefficient(cubic, G2, r, _X)
    s[_Z] = 0 - s[_Z]
    divide(r, _Z, _Z, _T)
    divide(r, _Z, _Z, _T)
    coefficient(cubic, G3, r, _Z)
    if out[0] <= _PIECE:
        return _TOOK_AIM
    out[0] = out[0] >> 1
    out[1] = 0
    put(r, _X, out[0], 0)
    combine(r, _T, _T, _X, 1)
    w[at + DURATION] = s[_T]
    w[at + DURATION + 1] = s[_T + 1]
    w[at + KIND] = ONWARD
    return 0


def _ramp_time(to, difference):
    """How long the velocity takes to change by r[difference] >= 0 within acceleration and jerk."""
    r = scratch
    if reals.sign(r, _J) > 0:
        reals.divide(r, _X, _A, _J)  # time to full acceleration
        reals.multiply(r, _Y, _X, _A)
        if reals.compare(r, difference, _Y) < 0:
            reals.divide(r, _X, difference, _J)
            reals.root(r, to, _X)
            reals.double(r, to, to, 1)
            return
        reals.divide(r, _Y, difference, _A)
        reals.add(r, to, _X, _Y)
        return
    reals.divide(r, to, difference, _A)


def _ramp_way(to, start, end):
    """The way of a ramp between two velocities; leaves its duration in _U."""
    r = scratch
    if reals.compare(r, start, end) < 0:
        reals.subtract(r, _D, end, start)
    else:
        reals.subtract(r, _D, start, end)
    _ramp_time(_U, _D)
    reals.add(r, to, start, end)
    reals.multiply(r, to, to, _U)
    reals.double(r, to, to, -1)


def _push_ramp(phases, start, end, last, turned, targets, i):
    """Append a ramp from r[start] to r[end] >= 0. If `last` it ends on the step targets[i].

    r[_U] is its duration when it is the last one, otherwise the shortest possible is taken.
    """
    r = scratch
    up = reals.compare(r, start, end) < 0
    if up:
        reals.subtract(r, _D, end, start)
    else:
        reals.subtract(r, _D, start, end)
    if not last:
        _ramp_time(_U, _D)
    if reals.compare(r, _U, _SHORT) < 0:
        return
    # S-curve of duration U: jerk for T1, full acceleration for T2, jerk for T1. With the peak
    # acceleration a = j·T1 and D = a·(T1 + T2) = j·T1·(U - T1): T1 = U/2 - sqrt(U²/4 - D/j),
    # written so that nothing cancels. A jerk that is over within a few ticks is none.
    if reals.sign(r, _J) > 0:
        reals.double(r, _T1, _U, -1)
        reals.multiply(r, _X, _T1, _T1)
        reals.divide(r, _Z, _D, _J)
        reals.subtract(r, _X, _X, _Z)
        reals.root(r, _Y, _X)
        reals.add(r, _T1, _T1, _Y)
        reals.divide(r, _T1, _Z, _T1)
    if reals.sign(r, _J) <= 0 or reals.compare(r, _T1, _FEW) < 0:
        if last:
            _push_aim(phases, _U, start, end, turned, targets, i)
            return
        reals.divide(r, _X, _D, _U)
        reals.double(r, _X, _X, -1)
        if not up:
            reals.negate(r, _X, _X)
        _push(phases, RAMP, _U, start, _X, _ZERO, turned)
        return
    reals.double(r, _T2, _Y, 1)
    reals.multiply(r, _Z, _J, _SIXTH)
    reals.multiply(r, _Y, _J, _T1)  # peak acceleration
    reals.double(r, _Y, _Y, -1)
    if not up:
        reals.negate(r, _Z, _Z)
        reals.negate(r, _Y, _Y)
    _push(phases, RAMP, _T1, start, _ZERO, _Z, turned)
    reals.multiply(r, _X, _Y, _T1)  # velocity gained: half the acceleration times the time
    reals.add(r, _W, start, _X)
    if reals.compare(r, _T2, _SHORT) > 0:
        _push(phases, RAMP, _T2, _W, _Y, _ZERO, turned)
        reals.multiply(r, _X, _Y, _T2)
        reals.double(r, _X, _X, 1)
        reals.add(r, _W, _W, _X)
    if last:
        _push_aim(phases, _T1, _W, end, turned, targets, i)
    else:
        reals.negate(r, _Z, _Z)
        _push(phases, RAMP, _T1, _W, _Y, _Z, turned)


def _push_aim(phases, duration, start, end, turned, targets, i, part=0):
    at = phases.words[TAIL] * PHASE_WORDS
    _push(phases, AIM, duration, start, end, _ZERO, turned)
    reals.copy_word(phases.words, at + TARGET, targets, i)
    phases.words[at + THIRD] = part


def _level(phases, cubic):
    """With a jerk limit, first let the acceleration G2 go; what follows begins without one."""
    r = scratch
    if reals.sign(r, _J) <= 0:
        return
    velocity(r, _X, cubic, G2)
    rising = reals.sign(r, _X)
    if not rising:
        return
    reals.multiply(r, _Z, _J, _SIXTH)
    if rising > 0:
        reals.negate(r, _Z, _Z)
    reals.divide(r, _T, _X, _Z)  # a = 2·G2, j = 6·G3: T = a/j = G2/(3·G3)
    reals.multiply(r, _T, _T, _THIRD)
    reals.negate(r, _T, _T)
    if reals.compare(r, _T, _SHORT) < 0:
        return
    _push(phases, RAMP, _T, _V, _X, _Z, False)
    # S less V·T + G2·T² + G3·T³, V more 2·G2·T + 3·G3·T² = G2·T
    reals.multiply(r, _Y, _Z, _T)
    reals.add(r, _Y, _Y, _X)
    reals.multiply(r, _Y, _Y, _T)
    reals.add(r, _Y, _Y, _V)
    reals.multiply(r, _Y, _Y, _T)
    reals.subtract(r, _S, _S, _Y)
    reals.multiply(r, _Y, _X, _T)
    reals.add(r, _V, _V, _Y)


def plan(phases, cubic, targets, i, limits, top, acceleration, jerk):
    """Plan from where the cubic is, at its velocity G1, to rest on the step targets[i].

    limits[top], limits[acceleration], limits[jerk]: reals in steps per tick, tick², tick³ (jerk 0
    for none). Returns NOTHING where there is nothing to do, PLANNED, or STOP_FIRST where the motor must turn and,
    within the jerk limit, slows down already: letting that go first would take it past the end of the plan that it
    follows, and perhaps past a soft limit. Then nothing is planned; plan_stop() is what does not.
    """
    r = scratch
    phases.clear()
    reals.fetch(r, _TOP, limits, top)
    reals.fetch(r, _A, limits, acceleration)
    reals.fetch(r, _J, limits, jerk)
    distance(r, _S, targets, i, cubic)
    velocity(r, _V, cubic, G1)
    velocity(r, _X, cubic, G2)
    slowing = reals.sign(r, _J) > 0 and reals.sign(r, _V) * reals.sign(r, _X) < 0
    _level(phases, cubic)
    moving = reals.sign(r, _V)
    way = reals.sign(r, _S)
    if not moving and not way:
        return NOTHING
    turned = way < 0 if way else moving < 0
    if turned:
        reals.negate(r, _S, _S)
        reals.negate(r, _V, _V)
    if moving:
        # Stop first where the target lies behind or nearer than the motor can stop; a 64th of
        # a step of leave, so that a plan made again on the way down ends where the first one would.
        _ramp_way(_X, _V, _ZERO)
        reals.add(r, _Y, _S, _LEAVE)
        if reals.sign(r, _V) < 0 or reals.compare(r, _X, _Y) > 0:
            if slowing:
                phases.clear()
                return STOP_FIRST
            against = reals.sign(r, _V) < 0
            if against:
                reals.negate(r, _V, _V)
            _ramp_way(_X, _V, _ZERO)
            reals.copy(r, _LOW, _X)
            _push_ramp(phases, _V, _ZERO, False, turned != against, targets, i)
            if against:
                reals.add(r, _S, _S, _LOW)
            else:
                reals.subtract(r, _S, _S, _LOW)
                if reals.sign(r, _S) < 0:
                    turned = not turned
                    reals.negate(r, _S, _S)
            reals.put(r, _V, 0, 0)
            if reals.compare(r, _S, _SHORT) < 0:
                return PLANNED
    _cruise()
    # The way that the two ramps leave is cruised; the last ramp takes what is then left.
    _ramp_way(_X, _V, _C)
    reals.subtract(r, _S, _S, _X)
    _push_ramp(phases, _V, _C, False, turned, targets, i)
    _ramp_way(_X, _C, _ZERO)
    reals.subtract(r, _Y, _S, _X)
    if reals.sign(r, _Y) > 0:
        reals.divide(r, _T, _Y, _C)
        if reals.compare(r, _T, _SHORT) > 0:
            _push(phases, RAMP, _T, _C, _ZERO, _ZERO, turned)
            reals.subtract(r, _S, _S, _Y)
    reals.divide(r, _U, _S, _C)
    reals.double(r, _U, _U, 1)
    _push_ramp(phases, _C, _ZERO, True, turned, targets, i)
    return PLANNED


def _cruise():
    """The velocity _C to cruise at: as high as the way _S allows, from _V."""
    r = scratch
    if reals.compare(r, _V, _TOP) >= 0:
        reals.copy(r, _C, _TOP)
        _ramp_way(_X, _V, _C)
        reals.copy(r, _W, _X)
        _ramp_way(_X, _C, _ZERO)
        reals.add(r, _X, _X, _W)
        if reals.compare(r, _X, _S) > 0:
            reals.copy(r, _C, _V)  # nearer than the way down to the new top: stop straight away
        return
    # Triangle: A·S = C² - V²/2
    reals.multiply(r, _X, _A, _S)
    reals.multiply(r, _Y, _V, _V)
    reals.double(r, _Y, _Y, -1)
    reals.add(r, _X, _X, _Y)
    reals.root(r, _C, _X)
    if reals.compare(r, _C, _TOP) > 0:
        reals.copy(r, _C, _TOP)
    elif reals.compare(r, _C, _V) < 0:
        reals.copy(r, _C, _V)
    if reals.sign(r, _J) > 0:
        # No closed form with both limits: bisection below that, since a limit of the jerk only takes away from it.
        # What is short of the greatest velocity possible is cruised.
        reals.copy(r, _LOW, _V)
        reals.copy(r, _HIGH, _C)
        for _ in range(16):
            _ramp_way(_X, _V, _C)
            reals.copy(r, _W, _X)
            _ramp_way(_X, _C, _ZERO)
            reals.add(r, _X, _X, _W)
            if reals.compare(r, _X, _S) > 0:
                reals.copy(r, _HIGH, _C)
            elif reals.compare(r, _C, _HIGH) >= 0:
                return
            else:
                reals.copy(r, _LOW, _C)
            reals.add(r, _C, _LOW, _HIGH)
            reals.double(r, _C, _C, -1)
        if reals.sign(r, _LOW) > 0:
            reals.copy(r, _C, _LOW)


def plan_stop(phases, cubic, targets, i, limits, acceleration, jerk):
    """Plan the shortest ramp to rest with a jerk limit; targets[i] becomes the step that it ends on or above.

    limits[acceleration], limits[jerk]: as for plan(). A motor that slows down already goes on from the
    deceleration it has, so it does not get past the end of a plan within the same limits. Returns False
    where the way is longer than the planner can count (2^29 steps): nothing is planned.
    """
    r = scratch
    phases.clear()
    reals.fetch(r, _A, limits, acceleration)
    reals.fetch(r, _J, limits, jerk)
    velocity(r, _V, cubic, G1)
    velocity(r, _HIGH, cubic, G2)
    reals.put(r, _S, 0, 0)
    slowing = reals.sign(r, _V) * reals.sign(r, _HIGH) < 0
    if slowing:
        reals.double(r, _HIGH, _HIGH, 1)
        if reals.sign(r, _HIGH) < 0:
            reals.negate(r, _HIGH, _HIGH)
        if reals.compare(r, _HIGH, _A) > 0:
            reals.copy(r, _A, _HIGH)
    else:
        _level(phases, cubic)
        reals.put(r, _HIGH, 0, 0)
    down = reals.sign(r, _V) < 0
    if down:
        reals.negate(r, _V, _V)
    else:
        reals.negate(r, _S, _S)  # _level() counts what is left of a way
    # A deceleration d at velocity v is what an S-curve from v + d²/2j has after d/j.
    reals.divide(r, _LOW, _HIGH, _J)
    reals.multiply(r, _X, _HIGH, _LOW)
    reals.double(r, _X, _X, -1)
    reals.copy(r, _W, _V)
    if slowing and reals.compare(r, _V, _X) <= 0:
        # In the last part of one: the deceleration ends with the velocity, T = 2·v/d, way v·T/3
        reals.divide(r, _T1, _V, _HIGH)
        reals.double(r, _T1, _T1, 1)
        reals.multiply(r, _X, _V, _T1)
        reals.multiply(r, _X, _X, _THIRD)
        reals.add(r, _S, _S, _X)
    else:
        reals.add(r, _D, _V, _X)
        reals.divide(r, _X, _D, _J)
        reals.root(r, _T1, _X)
        reals.divide(r, _X, _A, _J)
        if reals.compare(r, _T1, _X) > 0:
            reals.copy(r, _T1, _X)
        if reals.compare(r, _T1, _FEW) < 0:
            # as in _push_ramp: a jerk that is over within a few ticks is none
            reals.divide(r, _T1, _V, _A)
            reals.multiply(r, _X, _V, _T1)
            reals.double(r, _X, _X, -1)
            reals.add(r, _S, _S, _X)
        else:
            _push_stop(phases, down)
    part = _end(targets, i, cubic, down)
    if part < 0:
        phases.clear()
        return False
    if reals.compare(r, _T1, _SHORT) < 0:
        reals.copy(r, _T1, _FEW)  # at rest already
    _push_aim(phases, _T1, _W, _ZERO, down, targets, i, part)
    return True


def _push_stop(phases, down):
    """Append an S-curve from _D to rest but for what lies before _LOW ticks and for its last part.

    _T1: how long the jerk lasts, _HIGH: the deceleration after _LOW ticks. Leaves the velocity of the last
    part in _W, and adds the way of all to _S.
    """
    r = scratch
    reals.multiply(r, _Y, _J, _T1)  # peak deceleration
    reals.divide(r, _T2, _D, _Y)
    reals.subtract(r, _T2, _T2, _T1)
    # D·(2·T1 + T2)/2, less what lies before: D·t - j·t³/6
    reals.double(r, _U, _T2, -1)
    reals.add(r, _U, _U, _T1)
    reals.subtract(r, _U, _U, _LOW)
    reals.multiply(r, _X, _D, _U)
    reals.add(r, _S, _S, _X)
    reals.multiply(r, _Z, _J, _SIXTH)
    reals.multiply(r, _X, _Z, _LOW)
    reals.multiply(r, _X, _X, _LOW)
    reals.multiply(r, _X, _X, _LOW)
    reals.add(r, _S, _S, _X)
    reals.subtract(r, _X, _T1, _LOW)
    if reals.compare(r, _X, _SHORT) > 0:
        reals.negate(r, _Z, _Z)
        reals.double(r, _C, _HIGH, -1)
        reals.negate(r, _C, _C)
        _push(phases, RAMP, _X, _V, _C, _Z, down)
    reals.multiply(r, _W, _Y, _T1)
    reals.double(r, _W, _W, -1)
    if reals.compare(r, _T2, _SHORT) > 0:
        reals.multiply(r, _X, _Y, _T2)
        reals.add(r, _X, _X, _W)
        reals.double(r, _C, _Y, -1)
        reals.negate(r, _C, _C)
        _push(phases, RAMP, _T2, _X, _C, _ZERO, down)


def _end(targets, i, cubic, down):
    """Where a way of _S leads: targets[i] = the step on or below, and what it is beyond that (Q16); -1 if that is too
    far. A stop ends between two steps: to reach the next one in what time is left could ask for any acceleration."""
    r = scratch
    if reals.floor(r, _S, _FARTHEST) == _FARTHEST:
        return -1
    if down:
        reals.negate(r, _S, _S)
    distance(r, _X, cubic, WHOLE, cubic)
    reals.subtract(r, _S, _S, _X)
    whole[0] = reals.floor(r, _S, _FARTHEST)
    if not reals.add_words(targets, i, cubic, WHOLE, whole, 0, 0):
        return 0  # by rounding past the end of the range
    reals.put(r, _X, whole[0], 0)
    reals.subtract(r, _S, _S, _X)
    reals.double(r, _S, _S, 16)
    return reals.floor(r, _S, 0xFFFF)
