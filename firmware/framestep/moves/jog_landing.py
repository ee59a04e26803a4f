"""How a JOG_ALL that is stopped comes to rest on a frame (field note 6.10).

The queues have been cut at one moment; from there the motion goes on to rest on the next frame that
can be reached, or, where that takes long, at a frame per second. Nothing allocates.
"""

from framestep.motion import reals
from framestep.motion.segments import G1, WHOLE, velocity
from framestep.motors.axis import FIRST_TICKS, MOST_SEGMENTS
from framestep.motors.backlash import PHYSICAL, motor_step
from framestep.motors.motor import MAX_ACCELERATION, MAX_VELOCITY
from framestep.moves.jog_phases import HERE, HERE_RATE, INDEX, LIMIT, NEXT, RATE, TOP, TWICE, WAY, P, Q
from framestep.moves.move_check import HALF, THOUSAND, T, X, Y
from framestep.moves.player import frame_velocity
from framestep.native import const

ACCELERATION = const(4)  # frames/s² (field note 6.10)
LANDING_MS = const(2000)  # what takes longer goes at a frame per second instead (the same)
_BRIEF = const(8)  # ticks: a rest of a frame that is shorter is played as one with the next frame


def land_from(jog, ticks):
    """From where the queues have been cut, `ticks` after the beginning, go on to rest on a frame."""
    player = jog.player
    axes = jog.operations.axes
    r = player.numbers
    step = jog.step
    at = jog.phases.rows[jog.phases.locate(ticks) + INDEX]
    for motor in range(player.count):
        if (jog.bits >> motor) & 1:
            jog.store.position(motor, at, player.place, 0)
            axes[motor].resume_from_cut(player.place, 0)
            velocity(r, frame_velocity(motor), axes[motor].cubic, G1)
    jog.phases.begin(ticks)
    jog.closed = False
    reals.copy(r, RATE, HERE_RATE)
    end = at + step * (reals.floor(r, HERE, HALF) + 1)
    if (jog.destination - end) * step < 0:
        end = jog.destination
    reals.put(r, X, (end - at) * step, 0)
    reals.subtract(r, WAY, X, HERE)  # to the next frame
    if reals.sign(r, WAY) <= 0:
        reals.put(r, WAY, 1, -20)  # it is there, but for rounding
    # The way that it takes to stop: `more` frames beyond the next one
    _steepest(jog, at, end)
    reals.multiply(r, X, RATE, RATE)
    reals.double(r, Y, LIMIT, 1)
    reals.divide(r, X, X, Y)
    reals.subtract(r, X, X, WAY)
    reals.negate(r, X, X)
    more = min(max(-reals.floor(r, X, HALF), 0), (jog.destination - end) * step)
    jog.destination = end + step * more
    reals.put(r, X, more, 0)
    reals.add(r, X, X, WAY)  # all the way
    # At a constant deceleration it takes 2·way/velocity
    reals.multiply(r, Y, RATE, RATE)
    reals.divide(r, TWICE, Y, X)
    reals.double(r, X, X, 1)
    reals.put(r, Y, LANDING_MS, 0)
    reals.multiply(r, Y, Y, RATE)
    slow = reals.compare(r, X, Y) > 0
    reals.put(r, Y, 2, 0)
    reals.divide(r, Y, Y, THOUSAND)
    jog.hurry = slow and reals.compare(r, RATE, Y) < 0
    if more:
        reals.put(r, X, _BRIEF, 0)
        reals.multiply(r, X, X, RATE)
        if reals.compare(r, WAY, X) < 0:
            for motor in range(player.count):
                if (jog.bits >> motor) & 1:
                    # by way of that frame, where it may turn
                    jog.store.position(motor, end, player.place, 0)
                    motor_step(axes[motor].planned, axes[motor].limits, player.place, 0, 0)
            end += step
            more -= 1
            reals.put(r, X, 1, 0)
            reals.add(r, WAY, WAY, X)
    reals.put(r, X, more, 0)
    if jog.hurry:
        reals.double(r, TWICE, LIMIT, 1)
    reals.multiply(r, X, X, TWICE)
    reals.root(r, NEXT, X)
    if reals.compare(r, NEXT, RATE) > 0:
        reals.copy(r, NEXT, RATE)
    if jog.hurry and not more:
        hurry_time(jog, end, True)
    else:
        reals.add(r, X, RATE, NEXT)
        reals.double(r, T, WAY, 1)
        reals.divide(r, T, T, X)
    if not more:
        _stay_before(jog, end)
    jog.append_phase(at, end)
    for motor in range(player.count):
        if (jog.bits >> motor) & 1:
            axes[motor].feed(MOST_SEGMENTS, FIRST_TICKS)


def _stay_before(jog, end):
    """Shorten T, by a quarter at most, if a motor would overshoot the frame `end`.

    It would where its velocity is more than three times the mean: a fast cubic that has been cut
    late.
    """
    player = jog.player
    r = player.numbers
    reals.double(r, P, T, -2)
    reals.subtract(r, P, T, P)
    for motor in range(player.count):
        if (jog.bits >> motor) & 1:
            axis = player.axes[motor]
            own = frame_velocity(motor)
            if not reals.sign(r, own):
                continue
            jog.store.position(motor, end, player.place, 0)
            motor_step(axis.planned, axis.limits, player.place, 0, 0)
            reals.put_difference(r, X, axis.limits, PHYSICAL, axis.cubic, WHOLE)
            reals.divide(r, X, X, own)
            reals.put(r, Y, 3, 0)
            reals.multiply(r, X, X, Y)
            if reals.sign(r, X) > 0 and reals.compare(r, X, T) < 0:
                reals.copy(r, T, X if reals.compare(r, X, P) > 0 else P)


def _steepest(jog, at, end):
    """LIMIT = the deceleration, in frames per tick², with which the motors can stop there.

    That is what the check has found for this rate, or more, up to ACCELERATION, where the frames
    around `end` allow it.
    """
    player = jog.player
    r = player.numbers
    store = jog.store
    values = jog.values
    reals.put(r, LIMIT, ACCELERATION, 0)
    reals.divide(r, LIMIT, LIMIT, THOUSAND)
    reals.divide(r, LIMIT, LIMIT, THOUSAND)
    # from rest to the rate within a frame
    reals.multiply(r, P, TOP, TOP)
    reals.double(r, P, P, -1)
    if reals.compare(r, P, LIMIT) >= 0:
        return
    reals.multiply(r, Q, RATE, RATE)
    for motor in range(player.count):
        if (jog.bits >> motor) & 1:
            store.position(motor, at, values, 0)
            store.position(motor, end, values, 1)
            store.position(motor, min(max(end + jog.step, 0), store.end - store.start), values, 2)
            reals.put_difference(r, X, values, 1, values, 0)
            reals.put_difference(r, Y, values, 2, values, 1)
            reals.subtract(r, T, Y, X)
            for register in (X, Y, T):
                if reals.sign(r, register) < 0:
                    reals.negate(r, register, register)
            if reals.compare(r, X, Y) < 0:
                reals.copy(r, X, Y)
            if not reals.sign(r, X):
                continue
            # what the bend of the path leaves of the motor's acceleration, with a half more for the
            # slopes
            reals.multiply(r, T, T, Q)
            reals.fetch(r, Y, player.axes[motor].numbers, MAX_ACCELERATION)
            reals.subtract(r, Y, Y, T)
            reals.double(r, T, X, -1)
            reals.add(r, X, X, T)
            reals.divide(r, Y, Y, X)
            if reals.compare(r, Y, LIMIT) < 0:
                reals.copy(r, LIMIT, Y)
    if reals.compare(r, LIMIT, P) < 0:
        reals.copy(r, LIMIT, P)


def hurry_time(jog, end, cut):
    """T = ticks to rest on the frame `end`, WAY frames away, at a frame per second or what motors can.

    cut: from where the queues have been cut; otherwise from the last frame queued. Never longer
    than at a constant deceleration.
    """
    player = jog.player
    r = player.numbers
    # A cubic from rest to rest is half as fast again as its mean, and its greatest acceleration
    # 6·way/T². One that begins in motion stays within both; one that has to turn within twice as
    # much, if that has the time.
    reals.double(r, T, WAY, -1)
    reals.add(r, T, T, WAY)
    reals.root(r, X, T)
    if reals.compare(r, T, X) < 0:
        reals.copy(r, T, X)
    reals.multiply(r, T, T, THOUSAND)
    for motor in range(player.count):
        if (jog.bits >> motor) & 1:
            axis = player.axes[motor]
            own = frame_velocity(motor)
            reals.copy_word(jog.values, 0, axis.limits, PHYSICAL)
            if cut:
                reals.copy_word(jog.values, 0, axis.cubic, WHOLE)
            jog.store.position(motor, end, player.place, 0)
            motor_step(axis.planned, axis.limits, player.place, 0, 0)
            reals.put_difference(r, X, axis.limits, PHYSICAL, jog.values, 0)
            turns = reals.sign(r, X) * reals.sign(r, own) < 0
            if reals.sign(r, X) < 0:
                reals.negate(r, X, X)
            reals.put(r, Y, 1, 0)
            reals.add(r, X, X, Y)
            reals.put(r, Y, 3, -1)
            reals.multiply(r, Y, Y, X)
            reals.fetch(r, P, axis.numbers, MAX_VELOCITY)
            reals.divide(r, Y, Y, P)
            if reals.compare(r, T, Y) < 0:
                reals.copy(r, T, Y)
            reals.put(r, Y, 12 if turns else 6, 0)
            reals.multiply(r, Y, Y, X)
            reals.fetch(r, P, axis.numbers, MAX_ACCELERATION)
            reals.divide(r, Y, Y, P)
            reals.root(r, Y, Y)
            if reals.compare(r, T, Y) < 0:
                reals.copy(r, T, Y)
            if turns:
                reals.double(r, Y, own, 3)
                if reals.sign(r, Y) < 0:
                    reals.negate(r, Y, Y)
                reals.divide(r, Y, Y, P)
                if reals.compare(r, T, Y) < 0:
                    reals.copy(r, T, Y)
    if reals.sign(r, RATE):
        reals.double(r, X, WAY, 1)
        reals.divide(r, X, X, RATE)
        if reals.compare(r, X, T) < 0:
            reals.copy(r, T, X)
