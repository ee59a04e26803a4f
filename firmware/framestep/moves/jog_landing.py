"""How a JOG_ALL that is stopped comes to rest on a frame (field note 6.10).

The queues have been cut at one moment. From there the motion goes on to rest on the next frame that
can be reached or, if that takes long, at a frame per second. Nothing allocates.
"""

from framestep.base.native import const
from framestep.motion import reals
from framestep.motion.compute import compute
from framestep.motion.formula import formula
from framestep.motion.segments import WHOLE
from framestep.motors.backlash import MOTOR
from framestep.motors.rates import MAX_ACCELERATION, MAX_VELOCITY
from framestep.moves.path import registers
from framestep.moves.path.move_check import HALF
from framestep.moves.path.registers import HERE, HERE_RATE, RATE, SPEEDS

ACCELERATION = const(4)  # frames/s² (field note 6.10)

# The distance to the next frame, which is so many frames after the row's INDEX. Due to rounding the
# motion may be there already.
_TO_NEXT_FRAME = formula(
    registers,
    "frames",
    """
    DISTANCE = frames - HERE
    assert DISTANCE <= ZERO
    DISTANCE = 2 ** -20
    """,
)
# The stopping distance beyond the next frame, negative, so that floor() rounds it up.
_STOPPING_DISTANCE = formula(
    registers, "-> frames", "frames = -(RATE * RATE / (2 * LIMIT) - DISTANCE)"
)

# To rest some frames beyond the next one at a constant deceleration takes 2·distance/velocity. If
# that is more than two seconds and the motion is slow enough, it goes on at a frame per second
# (field note 6.10).
_DECELERATE = formula(
    registers,
    "frames",
    """
    distance = frames + DISTANCE
    TWICE = RATE * RATE / distance
    assert 2 * distance > 2000 * RATE
    assert RATE < 2 / THOUSAND
    """,
)
# If the remainder of a frame takes less than 8 ticks, it is joined to the next frame.
_IS_BRIEF = formula(registers, "assert DISTANCE < 8 * RATE")
_ONE_MORE_FRAME = formula(registers, "DISTANCE = DISTANCE + 1")

# The velocity at the next frame, so many frames before the end, and the time to it.
_TWICE_THE_LIMIT = formula(registers, "TWICE = 2 * LIMIT")
_NEXT_RATE = formula(registers, "frames", "NEXT = min(sqrt(frames * TWICE), RATE)")
_TIME = formula(registers, "DURATION = 2 * DISTANCE / (RATE + NEXT)")

_THREE_QUARTERS = formula(registers, "-> least", "least = DURATION - DURATION / 4")
# steps: to the frame; velocity: now, in steps per tick
_BEFORE_OVERSHOOT = formula(
    registers,
    "least, steps, velocity",
    """
    early = steps / velocity * 3
    assert early > ZERO
    assert early < DURATION
    DURATION = max(early, least)
    """,
    least=_THREE_QUARTERS.least,
)

# GENTLEST: acceleration from rest to TOP within a frame, which the check has allowed
_GENTLEST = formula(
    registers,
    """
    LIMIT = 4 / THOUSAND / THOUSAND  # ACCELERATION
    GENTLEST = TOP * TOP / 2
    SQUARE = RATE * RATE
    assert GENTLEST < LIMIT
    """,
)
# Steps in the frame before the end, and in the frame after it; a motor's acceleration. LIMIT is
# what the bend of the path leaves of that, for half as many steps again because of the slopes.
_STEEPEST = formula(
    registers,
    "before, beyond, acceleration",
    """
    bend = beyond - before
    bend = max(bend, -bend)
    steps = max(max(before, -before), max(beyond, -beyond))
    assert steps > ZERO
    LIMIT = min(LIMIT, (acceleration - bend * SQUARE) / (steps + steps / 2))
    """,
)
_AT_LEAST_GENTLEST = formula(registers, "LIMIT = max(LIMIT, GENTLEST)")

# A cubic from rest to rest has a top velocity of 1.5 times its mean, and a greatest acceleration of
# 6·distance/duration². One that begins in motion stays within both. One that has to turn stays
# within twice as much, if it has the time. steps: to go; velocity, acceleration: a motor's limits.
_A_FRAME_PER_SECOND = formula(
    registers,
    """
    DURATION = DISTANCE / 2 + DISTANCE
    DURATION = max(DURATION, sqrt(DURATION)) * THOUSAND
    """,
)
_AS_MOTORS_CAN = formula(
    registers,
    "steps, velocity, acceleration -> size",
    """
    size = max(steps, -steps) + 1
    DURATION = max(DURATION, 1.5 * size / velocity)
    DURATION = max(DURATION, sqrt(6 * size / acceleration))
    """,
)
# speed: at which it begins, steps per tick
_TURNING = formula(
    registers,
    "size, acceleration, speed",
    """
    DURATION = max(DURATION, sqrt(12 * size / acceleration))
    turn = 8 * speed
    DURATION = max(DURATION, max(turn, -turn) / acceleration)
    """,
    size=_AS_MOTORS_CAN.size,
    acceleration=_AS_MOTORS_CAN.acceleration,
)
_AT_CONSTANT_DECELERATION = formula(registers, "DURATION = min(DURATION, 2 * DISTANCE / RATE)")


# Words in which plan_landing() leaves what it has found
END = const(0)  # index of the next frame, to which the motors go first
DESTINATION = const(1)  # index of the frame to rest on
HURRY = const(2)  # 1: the last frame before the stop takes a second at most
FOUND_WORDS = const(3)


def plan_landing(player, bits, at, step, destination, found):
    """Plan from where the queues have been cut, HERE frames after the index `at` at HERE_RATE,
    to rest on a frame: set `found`, and DISTANCE, DURATION, RATE, NEXT of the first phase.

    step: 1 or -1. destination: index of the last frame possible.
    """
    axes = player.axes
    r = player.numbers
    reals.copy(r, RATE, HERE_RATE)
    end = at + step * (reals.floor(r, HERE, HALF) + 1)
    if (destination - end) * step < 0:
        end = destination
    reals.put(r, _TO_NEXT_FRAME.frames, (end - at) * step, 0)
    compute(r, _TO_NEXT_FRAME)
    # The end is `more` frames beyond the next one.
    _find_limit(player, bits, at, end, step)
    compute(r, _STOPPING_DISTANCE)
    more = min(max(-reals.floor(r, _STOPPING_DISTANCE.frames, HALF), 0), (destination - end) * step)
    found[DESTINATION] = end + step * more
    reals.put(r, _DECELERATE.frames, more, 0)
    found[HURRY] = 1 if compute(r, _DECELERATE) else 0
    if more:
        if compute(r, _IS_BRIEF):
            for motor in range(player.count):
                if (bits >> motor) & 1:
                    # by way of that frame, where the motor may turn
                    player.store.position(motor, end, player.position, 0)
                    axes[motor].backlash.turn_to(player.position, 0, 0)
            end += step
            more -= 1
            compute(r, _ONE_MORE_FRAME)
    if found[HURRY]:
        compute(r, _TWICE_THE_LIMIT)
    reals.put(r, _NEXT_RATE.frames, more, 0)
    compute(r, _NEXT_RATE)
    if found[HURRY] and not more:
        hurry_time(player, bits, end, True)
    else:
        compute(r, _TIME)
    if not more:
        _stay_before(player, bits, end)
    found[END] = end


def _stay_before(player, bits, end):
    """Shorten DURATION, by a quarter at most, if a motor would overshoot the frame `end`.

    It would if its velocity is more than three times the mean, as in a fast cubic that has been
    cut late.
    """
    r = player.numbers
    compute(r, _THREE_QUARTERS)
    for motor in range(player.count):
        if (bits >> motor) & 1:
            axis = player.axes[motor]
            own = SPEEDS + 2 * motor
            if not reals.sign(r, own):
                continue
            player.store.position(motor, end, player.position, 0)
            axis.backlash.turn_to(player.position, 0, 0)
            reals.put_difference(
                r, _BEFORE_OVERSHOOT.steps, axis.backlash, MOTOR, axis.cubic, WHOLE
            )
            reals.copy(r, _BEFORE_OVERSHOOT.velocity, own)
            compute(r, _BEFORE_OVERSHOOT)


def _find_limit(player, bits, at, end, step):
    """LIMIT = the deceleration, in frames per tick², with which the motors can stop there.

    It is at least what the check has found for this rate. It is higher, up to ACCELERATION, if
    the frames around `end` allow it.
    """
    r = player.numbers
    store = player.store
    values = player.values
    if not compute(r, _GENTLEST):
        return
    for motor in range(player.count):
        if (bits >> motor) & 1:
            store.position(motor, at, values, 0)
            store.position(motor, end, values, 1)
            store.position(motor, min(max(end + step, 0), store.end - store.start), values, 2)
            reals.put_difference(r, _STEEPEST.before, values, 1, values, 0)
            reals.put_difference(r, _STEEPEST.beyond, values, 2, values, 1)
            numbers = player.axes[motor].numbers
            reals.fetch(r, _STEEPEST.acceleration, numbers, MAX_ACCELERATION)
            compute(r, _STEEPEST)
    compute(r, _AT_LEAST_GENTLEST)


def hurry_time(player, bits, end, cut):
    """DURATION = ticks to rest on the frame `end`, DISTANCE frames away, at a frame per second
    or as fast as the motors of these bits can.

    cut: start from where the queues have been cut, else from the last frame queued. DURATION is
    never longer than at a constant deceleration.
    """
    r = player.numbers
    compute(r, _A_FRAME_PER_SECOND)
    for motor in range(player.count):
        if (bits >> motor) & 1:
            axis = player.axes[motor]
            own = SPEEDS + 2 * motor
            reals.copy_word(player.values, 0, axis.backlash, MOTOR)
            if cut:
                reals.copy_word(player.values, 0, axis.cubic, WHOLE)
            player.store.position(motor, end, player.position, 0)
            axis.backlash.turn_to(player.position, 0, 0)
            steps = _AS_MOTORS_CAN.steps
            reals.put_difference(r, steps, axis.backlash, MOTOR, player.values, 0)
            turns = reals.sign(r, steps) * reals.sign(r, own) < 0
            reals.fetch(r, _AS_MOTORS_CAN.velocity, axis.numbers, MAX_VELOCITY)
            reals.fetch(r, _AS_MOTORS_CAN.acceleration, axis.numbers, MAX_ACCELERATION)
            compute(r, _AS_MOTORS_CAN)
            if turns:
                reals.copy(r, _TURNING.speed, own)
                compute(r, _TURNING)
    if reals.sign(r, RATE):
        compute(r, _AT_CONSTANT_DECELERATION)
