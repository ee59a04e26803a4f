"""Ramps: from a position and a velocity to a target at rest, as a few phases (phases.py).

A plan has at most: a ramp to a stop (if the target lies behind), a ramp to the cruising velocity, a
cruise, and a ramp onto the target. The last one aims: it absorbs the rounding errors of the other
phases, so the motor comes to rest exactly on the step. With a jerk limit each ramp is three phases.
A ramp is symmetric, so with or without jerk its distance is its duration times the mean of its two
velocities, which is all that the plan needs.

Moves and stops are in one file, as both are made of the same ramps in the same registers.

Time in ticks of 1 ms, position in steps, in the direction of the motion. Nothing allocates.
"""

from array import array

from framestep.base.native import const
from framestep.motion import reals
from framestep.motion.compute import compute
from framestep.motion.formula import formula
from framestep.motion.phases import (
    AIM,
    PHASE_WORDS,
    PLANNER,
    RAMP,
    TARGET,
    THIRD,
    WRITE_INDEX,
    ZERO,
    scratch,
)
from framestep.motion.segments import G1, G2, WHOLE, distance, velocity

# Results of plan()
NOTHING = const(0)
PLANNED = const(1)
STOP_FIRST = const(2)

# Registers of the planner
_MAX_V = const(PLANNER)  # limits: velocity, acceleration, jerk (0 for none)
_A = const(PLANNER + 2)
_J = const(PLANNER + 4)
_V = const(PLANNER + 6)  # velocity at the start, in the direction of the target
_S = const(PLANNER + 8)  # distance to go
_CRUISE = const(PLANNER + 10)  # velocity
_FROM = const(PLANNER + 12)  # velocities of a ramp
_TO = const(PLANNER + 14)
_CHANGE = const(PLANNER + 16)  # change of the velocity
_T = const(PLANNER + 18)  # duration of a ramp or of the cruise
_DISTANCE = const(PLANNER + 20)  # of a ramp
_DISTANCE_UP = const(PLANNER + 22)  # of the ramp before it
_T1 = const(PLANNER + 24)  # duration of each of the two jerk phases of an S-curve
_T2 = const(PLANNER + 26)  # duration of the phase of full acceleration between them
_G2 = const(PLANNER + 28)  # half an acceleration
_G3 = const(PLANNER + 30)  # a sixth of a jerk
_LOW = const(PLANNER + 32)  # bounds of the cruising velocity, see _D and _SINCE
_HIGH = const(PLANNER + 34)
_REST = const(PLANNER + 36)  # distance of the cruise; in a stop, velocity after the first jerk
_PEAK = const(PLANNER + 38)  # deceleration of a stop
# A stop has no cruising velocity, so it uses the registers of _LOW and _HIGH
_D = const(PLANNER + 32)  # deceleration at the beginning of a stop
_SINCE = const(PLANNER + 34)  # ticks for which the jerk would have lasted by then
_THIRD = const(PLANNER + 40)
_SIXTH = const(PLANNER + 42)
_MIN_PHASE = const(PLANNER + 44)  # ticks; shorter phases are left out
_MIN_JERK = const(PLANNER + 46)  # ticks; shorter phases of jerk are left out
_X = const(PLANNER + 48)
SCRATCH = const(0)  # registers that formulas may use: those of phases.load()
SCRATCH_END = const(16)

_FARTHEST = const(0x20000000)  # steps

_whole = array("i", [0])

_CONSTANTS = formula(
    globals(),
    """
    _MIN_PHASE = 2 ** -8
    _MIN_JERK = 4
    three = 3
    _THIRD = 1 / three
    _SIXTH = _THIRD / 2
    """,
)
compute(scratch, _CONSTANTS)

# ---------------------------------------------------------------- one ramp

# Velocities of a ramp
_TO_REST = formula(
    globals(),
    """
    _FROM = _V
    _TO = 0
    _CHANGE = max(_V, -_V)
    """,
)
_TO_CRUISE = formula(
    globals(),
    """
    _FROM = _V
    _TO = _CRUISE
    _CHANGE = max(_CRUISE - _V, _V - _CRUISE)
    """,
)
_CRUISE_TO_REST = formula(
    globals(),
    """
    _DISTANCE_UP = _DISTANCE
    _FROM = _CRUISE
    _TO = 0
    _CHANGE = _CRUISE
    """,
)

# Duration and distance of a ramp
_LINEAR = formula(
    globals(),
    """
    _T = _CHANGE / _A
    _DISTANCE = (_FROM + _TO) * _T / 2
    """,
)
_WITHOUT_FULL_ACCELERATION = formula(
    globals(),
    """
    assert _CHANGE < _A / _J * _A
    _T = 2 * sqrt(_CHANGE / _J)
    _DISTANCE = (_FROM + _TO) * _T / 2
    """,
)
_WITH_FULL_ACCELERATION = formula(
    globals(),
    """
    _T = _A / _J + _CHANGE / _A
    _DISTANCE = (_FROM + _TO) * _T / 2
    """,
)

# The phase of a ramp without a jerk limit
_STEADY = formula(globals(), "_G2 = _CHANGE / _T / 2")

# S-curve of duration T: jerk for T1, full acceleration for T2, jerk for T1. With the peak
# acceleration a = j·T1 and the change of velocity D = a·(T1 + T2) = j·T1·(T - T1):
# T1 = T/2 - sqrt(T²/4 - D/j), written so that no digits cancel. A jerk of only a few ticks is left
# out.
_S_CURVE = formula(
    globals(),
    """
    half = _T / 2
    ratio = _CHANGE / _J
    root = sqrt(half * half - ratio)
    _T1 = ratio / (half + root)
    _T2 = 2 * root
    assert _T1 >= _MIN_JERK
    _G3 = _J * _SIXTH
    _G2 = _J * _T1 / 2  # at its peak
    """,
)
_AFTER_JERK = formula(globals(), "_FROM = _FROM + _G2 * _T1")
_AFTER_FULL_ACCELERATION = formula(globals(), "_FROM = _FROM + 2 * (_G2 * _T2)")

# ---------------------------------------------------------------- a plan

# a = 2·G2, j = 6·G3, so T = a/j = G2/(3·G3). S decreases by V·T + G2·T² + G3·T³, V increases by
# 2·G2·T + 3·G3·T² = G2·T.
_ACCELERATION_ENDS = formula(globals(), "_T = -(_G2 / _G3 * _THIRD)")
_AFTER_ACCELERATION = formula(
    globals(),
    """
    _S = _S - ((_G3 * _T + _G2) * _T + _V) * _T
    _V = _V + _G2 * _T
    """,
)

# The tolerance is a 64th of a step, so that a plan made again during the last ramp ends where the
# first one does.
_CANNOT_STOP = formula(globals(), "assert _DISTANCE > _S + 2 ** -6")

# Triangle: A·S = C² - V²/2
_TRIANGLE = formula(globals(), "_CRUISE = max(min(sqrt(_A * _S + _V * _V / 2), _MAX_V), _V)")
_BOTH_TOO_LONG = formula(globals(), "assert _DISTANCE + _DISTANCE_UP > _S")
_BISECT = formula(
    globals(),
    """
    _LOW = _V
    _HIGH = _CRUISE
    """,
)
_BETWEEN = formula(globals(), "_CRUISE = (_LOW + _HIGH) / 2")
_LESS_DISTANCE = formula(globals(), "_S = _S - _DISTANCE")
_CRUISED = formula(
    globals(),
    """
    _REST = _S - _DISTANCE
    assert _REST > ZERO
    _T = _REST / _CRUISE
    assert _T > _MIN_PHASE
    _S = _S - _REST
    """,
)
_LAST_RAMP = formula(globals(), "_T = 2 * (_S / _CRUISE)")


def _ramp(between):
    """Find _FROM, _TO, _CHANGE, _T and _DISTANCE of the shortest ramp between two velocities.

    between: the formula that gives the velocities.
    """
    r = scratch
    compute(r, between)
    if reals.sign(r, _J) <= 0:
        compute(r, _LINEAR)
    elif not compute(r, _WITHOUT_FULL_ACCELERATION):
        compute(r, _WITH_FULL_ACCELERATION)


def _append_ramp(phases, last, down, targets, i):
    """Append the ramp from FROM to TO >= 0 in T ticks. last: it ends on the step targets[i]."""
    r = scratch
    if reals.compare(r, _T, _MIN_PHASE) < 0:
        return
    up = reals.compare(r, _FROM, _TO) < 0
    if reals.sign(r, _J) <= 0 or not compute(r, _S_CURVE):
        if last:
            _append_aim(phases, _T, _FROM, _TO, down, targets, i)
            return
        compute(r, _STEADY)
        if not up:
            reals.negate(r, _G2, _G2)
        phases.append(RAMP, _T, _FROM, _G2, ZERO, down)
        return
    if not up:
        reals.negate(r, _G3, _G3)
        reals.negate(r, _G2, _G2)
    phases.append(RAMP, _T1, _FROM, ZERO, _G3, down)
    compute(r, _AFTER_JERK)
    if reals.compare(r, _T2, _MIN_PHASE) > 0:
        phases.append(RAMP, _T2, _FROM, _G2, ZERO, down)
        compute(r, _AFTER_FULL_ACCELERATION)
    if last:
        _append_aim(phases, _T1, _FROM, _TO, down, targets, i)
    else:
        reals.negate(r, _G3, _G3)
        phases.append(RAMP, _T1, _FROM, _G2, _G3, down)


def _append_aim(phases, duration, start, end, down, targets, i, part=0):
    at = phases.words[WRITE_INDEX] * PHASE_WORDS
    phases.append(AIM, duration, start, end, ZERO, down)
    reals.copy_word(phases.words, at + TARGET, targets, i)
    phases.words[at + THIRD] = part


def _level(phases):
    """With a jerk limit, first bring the acceleration 2·G2 to 0, as the plan begins without one.

    If the motor speeds up and this takes only a few ticks, the acceleration is dropped at once. The
    ramp under way may do so too, as it may have no jerk phases; otherwise a turn or a stop would
    end beyond that ramp's target.
    """
    r = scratch
    if reals.sign(r, _J) <= 0:
        return
    rising = reals.sign(r, _G2)
    if not rising:
        return
    reals.multiply(r, _G3, _J, _SIXTH)
    if rising > 0:
        reals.negate(r, _G3, _G3)
    compute(r, _ACCELERATION_ENDS)
    if reals.compare(r, _T, _MIN_JERK if reals.sign(r, _V) == rising else _MIN_PHASE) < 0:
        return
    phases.append(RAMP, _T, _V, _G2, _G3, False)
    compute(r, _AFTER_ACCELERATION)


def plan(phases, cubic, targets, i, limits, top, acceleration, jerk, port=None):
    """Plan from where the cubic is, at its velocity G1, to rest on the step targets[i].

    limits[top], limits[acceleration], limits[jerk]: reals in steps per tick, tick², tick³ (jerk 0:
    no limit). Returns NOTHING if there is nothing to do, PLANNED, or STOP_FIRST if the motor must
    turn, has a jerk limit and slows down already. Bringing its acceleration to 0 first would then
    take it past the end of the plan that it follows, and perhaps past a soft limit. So nothing is
    planned, and plan_stop() has to plan the stop. port: one that may begin a stop meanwhile.
    """
    r = scratch
    phases.clear()
    reals.fetch(r, _MAX_V, limits, top)
    reals.fetch(r, _A, limits, acceleration)
    reals.fetch(r, _J, limits, jerk)
    distance(r, _S, targets, i, cubic)
    velocity(r, _V, cubic, G1)
    velocity(r, _G2, cubic, G2)
    slowing = reals.sign(r, _J) > 0 and reals.sign(r, _V) * reals.sign(r, _G2) < 0
    _level(phases)
    moving = reals.sign(r, _V)
    ahead = reals.sign(r, _S)
    if not moving and not ahead:
        return NOTHING
    down = ahead < 0 if ahead else moving < 0
    if down:
        reals.negate(r, _S, _S)
        reals.negate(r, _V, _V)
    if moving:
        # Stop first if the target lies behind, or nearer than the motor can stop.
        against = reals.sign(r, _V) < 0
        if against:
            reals.negate(r, _V, _V)
        _ramp(_TO_REST)
        if against or compute(r, _CANNOT_STOP):
            if slowing:
                phases.clear()
                return STOP_FIRST
            _append_ramp(phases, False, down != against, targets, i)
            if against:
                reals.add(r, _S, _S, _DISTANCE)
            else:
                reals.subtract(r, _S, _S, _DISTANCE)
                if reals.sign(r, _S) < 0:
                    down = not down
                    reals.negate(r, _S, _S)
            reals.put(r, _V, 0, 0)
            if reals.compare(r, _S, _MIN_PHASE) < 0:
                return PLANNED
    if port:
        port.look_for_stop()
    _choose_cruise()
    if port:
        port.look_for_stop()
    # The cruise covers what the two ramps leave; the last ramp covers what then remains.
    _ramp(_TO_CRUISE)
    compute(r, _LESS_DISTANCE)
    _append_ramp(phases, False, down, targets, i)
    if port:
        port.look_for_stop()
    _ramp(_CRUISE_TO_REST)
    if compute(r, _CRUISED):
        phases.append(RAMP, _T, _CRUISE, ZERO, ZERO, down)
    compute(r, _LAST_RAMP)
    _append_ramp(phases, True, down, targets, i)
    return PLANNED


def _choose_cruise():
    """Choose the velocity CRUISE: the highest that the distance S allows, starting from V."""
    r = scratch
    if reals.compare(r, _V, _MAX_V) >= 0:
        reals.copy(r, _CRUISE, _MAX_V)
        if _too_long():
            # The target is nearer than the end of the ramp to the new velocity: stop directly.
            reals.copy(r, _CRUISE, _V)
        return
    compute(r, _TRIANGLE)
    if reals.sign(r, _J) > 0:
        # No closed form with both limits. Bisect below that velocity, since a jerk limit can only
        # lower it. The cruise makes up for the difference from the highest velocity possible.
        compute(r, _BISECT)
        for _ in range(16):
            if _too_long():
                reals.copy(r, _HIGH, _CRUISE)
            elif reals.compare(r, _CRUISE, _HIGH) >= 0:
                return
            else:
                reals.copy(r, _LOW, _CRUISE)
            compute(r, _BETWEEN)
        if reals.sign(r, _LOW) > 0:
            reals.copy(r, _CRUISE, _LOW)


def _too_long():
    """Return whether the ramps to CRUISE and from there to rest cover more than S."""
    _ramp(_TO_CRUISE)
    _ramp(_CRUISE_TO_REST)
    return compute(scratch, _BOTH_TOO_LONG)


# ---------------------------------------------------------------- a stop

_SLOWING = formula(
    globals(),
    """
    _D = max(2 * _G2, -(2 * _G2))
    _A = max(_A, _D)
    """,
)
# A deceleration d at velocity v is the state of an S-curve from v + d²/2j after a time of d/j.
_BEGUN = formula(
    globals(),
    """
    _SINCE = _D / _J
    _CHANGE = _D * _SINCE / 2
    _FROM = _V
    """,
)
# In the last part of an S-curve deceleration and velocity end together: T = 2·v/d, distance v·T/3
_LAST_PART = formula(
    globals(),
    """
    assert _V <= _CHANGE
    _T1 = 2 * (_V / _D)
    _S = _S + _V * _T1 * _THIRD
    """,
)
_JERK_LASTS = formula(
    globals(),
    """
    _CHANGE = _V + _CHANGE
    _T1 = min(sqrt(_CHANGE / _J), _A / _J)
    assert _T1 >= _MIN_JERK
    """,
)
_STOP_WITHOUT_JERK = formula(
    globals(),
    """
    _T1 = _V / _A
    _S = _S + _V * _T1 / 2
    """,
)
# The distance is D·(2·T1 + T2)/2, D the change of velocity, less the part before: D·t - j·t³/6
_STOP_CURVE = formula(
    globals(),
    """
    _PEAK = _J * _T1
    _T2 = _CHANGE / _PEAK - _T1
    _S = _S + _CHANGE * (_T2 / 2 + _T1 - _SINCE)
    _G3 = _J * _SIXTH
    _S = _S + _G3 * _SINCE * _SINCE * _SINCE
    _T = _T1 - _SINCE
    _G3 = -_G3
    _G2 = -(_D / 2)
    _FROM = _PEAK * _T1 / 2  # where the last part begins
    """,
)
_FULL_DECELERATION = formula(
    globals(),
    """
    _REST = _PEAK * _T2 + _FROM
    _G2 = -(_PEAK / 2)
    """,
)
_FRACTION = formula(globals(), "_S = (_S - _X) * 65536")


def plan_stop(phases, cubic, targets, i, limits, acceleration, jerk):
    """Plan the shortest ramp to rest with a jerk limit. targets[i] becomes the step at or below its
    end.

    limits[acceleration], limits[jerk]: as for plan(). A motor that slows down already continues
    with its present deceleration, so it does not get past the end of a plan within the same limits.
    Returns False if the distance is longer than the planner can count (2^29 steps): nothing is
    planned then.
    """
    r = scratch
    phases.clear()
    reals.fetch(r, _A, limits, acceleration)
    reals.fetch(r, _J, limits, jerk)
    velocity(r, _V, cubic, G1)
    velocity(r, _G2, cubic, G2)
    reals.put(r, _S, 0, 0)
    slowing = reals.sign(r, _V) * reals.sign(r, _G2) < 0
    if slowing:
        compute(r, _SLOWING)
    else:
        _level(phases)
        reals.put(r, _D, 0, 0)
    down = reals.sign(r, _V) < 0
    if down:
        reals.negate(r, _V, _V)
    else:
        reals.negate(r, _S, _S)  # _level() counts a remaining distance
    compute(r, _BEGUN)
    if not slowing or not compute(r, _LAST_PART):
        if compute(r, _JERK_LASTS):
            _append_stop(phases, down)
        else:
            compute(r, _STOP_WITHOUT_JERK)
    part = _find_end(targets, i, cubic, down)
    if part < 0:
        phases.clear()
        return False
    if reals.compare(r, _T1, _MIN_PHASE) < 0:
        reals.copy(r, _T1, _MIN_JERK)  # at rest already
    _append_aim(phases, _T1, _FROM, ZERO, down, targets, i, part)
    return True


def _append_stop(phases, down):
    """Append an S-curve from CHANGE to rest, without its first SINCE ticks and its last part.

    T1: duration of the jerk; D: deceleration after SINCE ticks. Leaves the velocity of the last
    part in FROM, and adds the distance of the whole stop to S.
    """
    r = scratch
    compute(r, _STOP_CURVE)
    if reals.compare(r, _T, _MIN_PHASE) > 0:
        phases.append(RAMP, _T, _V, _G2, _G3, down)
    if reals.compare(r, _T2, _MIN_PHASE) > 0:
        compute(r, _FULL_DECELERATION)
        phases.append(RAMP, _T2, _REST, _G2, ZERO, down)


def _find_end(targets, i, cubic, down):
    """Find where a distance of S ends: set targets[i] to the step at or below it, and return the
    rest (Q16), or -1 if it is too far.

    A stop ends between two steps, since reaching the next step in the time that remains could take
    any acceleration.
    """
    r = scratch
    if reals.floor(r, _S, _FARTHEST) == _FARTHEST:
        return -1
    if down:
        reals.negate(r, _S, _S)
    distance(r, _X, cubic, WHOLE, cubic)
    reals.subtract(r, _S, _S, _X)
    _whole[0] = reals.floor(r, _S, _FARTHEST)
    if not reals.add_words(targets, i, cubic, WHOLE, _whole, 0, 0):
        return 0  # rounding took it past the end of the range
    reals.put(r, _X, _whole[0], 0)
    compute(r, _FRACTION)
    return reals.floor(r, _S, 0xFFFF)
