"""MSG_RT_JOG_ALL: all motors along the uploaded path, as one axis whose unit is the frame.

Its velocity is at most FPS, or less where a motor could not follow (field note 5.5), its acceleration
4 frames/s² (field note 6.10), and it comes to rest on whole frames only. From one frame to the next its
acceleration is constant, and the motors follow the cubics through the frames' positions with the path's slope
times the axis' velocity at either end.

What is queued is noted, a row for each phase: from it comes where on the path the axis is at a moment. A stop
cuts all queues at the same moment and goes on from there.
"""

from array import array

from framestep.clock import HALF as _HALF
from framestep.clock import WRAP as _WRAP
from framestep.motion import reals, stepper
from framestep.motion.segments import G1, WHOLE, velocity
from framestep.motors import axis as motion
from framestep.motors.backlash import PHYSICAL, motor_step
from framestep.moves import path
from framestep.moves.follow import FASTEST_FPS, HALF, THOUSAND, T, X, Y, speed
from framestep.moves.stage import ENDING, POSITIONING, Operation
from framestep.moves.store import READY as UPLOADED
from framestep.native import const
from framestep.results import ERR_GENERAL, ERR_MOVING, ERR_NOT_IN_POSITION, ERR_RANGE, OK

ACCELERATION = const(4)  # frames/s² (field note 6.10)
LANDING_MS = const(2000)  # what takes longer goes at a frame per second instead (the same)
_AHEAD = const(1)
_MOST_CHECKED = const(6000)  # frames, all motors together: under way there is no time to look at more
_BATCH = const(32)
_NOTICE = const(40)  # ticks from a stop to where the queues are cut: time to plan for all motors
_LEAST = const(16)  # with fewer queued nothing is cut
_BRIEF = const(8)  # ticks: a rest of a frame that is shorter is played as one with the next frame

# Words of a row: a phase of the axis, Hermite as the motors' are
_ROWS = const(32)
_ROW = const(14)
_WHOLE = const(0)  # ticks from the begin to that of the phase
_FRACTION = const(1)  # real: what that is more
_TIME = const(3)  # reals: its duration in ticks,
_FROM = const(5)  # velocities at its ends, frames per tick,
_TO = const(7)
_PASSED = const(9)  # frames from `index` to where it begins,
_WAY = const(11)  # and on to its end
_INDEX = const(13)  # of the last frame before it

# Registers: frames and ticks; follow.OWN is the first that is free
_TOP = const(36)
_TWICE = const(38)  # twice the acceleration, 8·10^-6 frames per tick²
_RATE = const(40)  # velocity at the last frame queued
_NEXT = const(42)
_SLOWEST = const(44)  # ticks that one frame takes from rest to rest: 2/sqrt(4·10^-6)
_SINCE = const(46)  # what is to be added to `whole`
_SCALE = const(48)
_U = const(50)  # where the axis is: frames from a row's index, and its velocity
_W = const(52)
_D = const(54)  # way to go, frames
_P = const(56)
_Q = const(58)
_Z = const(60)
_LIMIT = const(62)


class JogAll(Operation):
    """The operation; see stage.Operation."""

    tells_end = False

    def __init__(self, stage):
        Operation.__init__(self, stage)
        self.follower = stage.follower
        self.store = stage.store
        self.values = array("i", [0] * _BATCH)
        self.at = 0  # index of the last frame queued
        self.to = 0
        self.step = 1
        self.closed = True
        self.later = -1  # a destination for after the turn
        self.fps_milli = 0  # as asked for
        self.asked = 0  # to land: 1 by STOP, 2 by STOP_ALL
        self.hurry = False  # the last frame of a landing goes at a frame per second
        self.rows = array("i", [0] * (_ROWS * _ROW))
        self.count = 0  # rows so far
        self.whole = 0  # ticks to the end of what is queued
        self.begun = 0  # the tick in which the first pulse comes
        self.places = array("i", [0] * stage.axes.count)
        self.ways = array("i", [0] * stage.axes.count)  # which way each motor goes from there
        self.draft = array("i", [0] * stage.axes.count)  # the same, of a request that may be refused

    # ---------------------------------------------------------------- the request

    def request(self, fps_milli, frame):
        """Jog to a scene frame. A code; nothing has changed unless it is OK."""
        store = self.store
        stage = self.stage
        if store.state != UPLOADED:
            return ERR_GENERAL
        if fps_milli < 1 or fps_milli > FASTEST_FPS or frame < store.start or frame > store.end:
            return ERR_RANGE
        under_way = stage.running
        if under_way and (stage.operation is not self or stage.state == ENDING):
            return ERR_MOVING
        to = frame - store.start
        going = False  # on from where it is in motion, without a rest
        bits = self.bits if under_way else self.follower.motors()
        if not under_way:
            if stage.axes.moving:
                return ERR_MOVING
            at = self._standing(bits)
            if at < 0:
                return ERR_NOT_IN_POSITION
        else:
            at = self.at
            if not self.closed and reals.sign(self.follower.numbers, _RATE):
                landing = self._landing()
                going = (to - landing) * self.step >= 0
                if not going:
                    at = landing  # where it turns
        step = 1 if to >= at else -1
        frames = (to - at) * step + 1
        if under_way and frames * self._motors(bits) > _MOST_CHECKED:
            return ERR_MOVING
        self._ways(self.draft, bits, at, step, frames, going)
        code = self.follower.check(bits, at, frames, fps_milli, step, self.draft, ACCELERATION, going)
        if code == OK and not under_way:
            code = self._barred(bits, at, to)
        if code != OK:
            return code
        self.fps_milli = fps_milli
        self._top()
        if under_way:
            self._retarget(to)
            return OK
        self.at = at
        self.bits = bits
        stage.drop()
        stage.move_time = (store.start + at) * 1000
        if to == at:
            return OK
        self._aim(to)
        self._approach()
        return OK

    def _motors(self, bits):
        n = 0
        while bits:
            n += bits & 1
            bits >>= 1
        return n

    def _ways(self, ways, bits, at, step, frames, going):
        """Which way each motor goes first in so many frames from the index `at` on. going: it comes there in motion."""
        follower = self.follower
        for motor in range(follower.count):
            ways[motor] = 0
            if bits >> motor & 1:
                ways[motor] = follower.axes[motor].heading() if going else follower.way(motor, at, step, frames)

    def _approach(self):
        """From where the motors stand take up their play for the way to `to`, then go."""
        follower = self.follower
        for motor in range(follower.count):
            if self.bits >> motor & 1:
                self.store.position(motor, self.at, self.places, motor)
        self._ways(self.ways, self.bits, self.at, self.step, (self.to - self.at) * self.step + 1, False)
        self.stage.approach(self, self.places, self.ways)

    def _aim(self, to):
        self.to = to
        self.step = 1 if to > self.at else -1
        self.later = -1
        self.asked = 0
        self.hurry = False
        self.closed = False
        reals.put(self.follower.numbers, _RATE, 0, 0)

    def recheck(self, waiting):
        frames = (self.to - self.at) * self.step + 1
        follower = self.follower
        code = follower.check(self.bits, self.at, frames, self.fps_milli, self.step, self.ways, ACCELERATION)
        if code == OK:
            self._top()
        return code

    def _top(self):
        """Go at the rate that the check has found."""
        r = self.follower.numbers
        reals.put(r, _TOP, self.follower.rate, 0)
        reals.divide(r, _TOP, _TOP, THOUSAND)
        reals.divide(r, _TOP, _TOP, THOUSAND)
        reals.put(r, _TWICE, 8, 0)
        reals.divide(r, _TWICE, _TWICE, THOUSAND)
        reals.divide(r, _TWICE, _TWICE, THOUSAND)
        reals.put(r, _SLOWEST, 1000, 0)

    def _retarget(self, to):
        """Under way: bend to the new destination; where it lies behind, land first and turn.

        Where it cannot come down to the new top on the way that was found good for its velocity, it lands as well.
        """
        self.asked = 0
        self.hurry = False
        if self.stage.state == POSITIONING:
            # before it has begun, or between a landing and the way back
            self._aim(to)
            self.closed = to == self.at
            self._approach()
            return
        if self.closed:
            self.later = to
            return
        if reals.sign(self.follower.numbers, _RATE) == 0:
            if (to - self.at) * self.step > 0:
                self.to = to
                self.later = -1
            else:
                self.follower.close(self.bits)
                self.closed = True
                self.later = to
            return
        landing = self._landing()
        r = self.follower.numbers
        reals.multiply(r, X, _RATE, _RATE)
        reals.multiply(r, Y, _TOP, _TOP)
        reals.subtract(r, X, X, Y)
        reals.divide(r, X, X, _TWICE)
        slows = reals.floor(r, X, HALF) + 1
        if (to - landing) * self.step >= 0 and slows <= (self.to - self.at) * self.step:
            self.to = to
            self.later = -1
        else:
            self.to = landing
            self.later = to

    def _landing(self):
        """The first whole frame on which the motion can end."""
        r = self.follower.numbers
        reals.multiply(r, X, _RATE, _RATE)
        reals.divide(r, X, X, _TWICE)
        frames = reals.floor(r, X, HALF)
        # up to a hundredth of a frame more than fits is rounding
        reals.put(r, Y, frames, 0)
        reals.subtract(r, X, X, Y)
        reals.put(r, Y, 100, 0)
        reals.multiply(r, X, X, Y)
        if reals.floor(r, X, HALF) >= 1 or frames == 0 and reals.sign(r, _RATE):
            frames += 1
        return self.at + self.step * frames

    def _standing(self, bits):
        """The index of the frame on which all motors stand; -1 if there is none."""
        store = self.store
        if not bits:
            return -1
        near = self.stage.move_time // 1000 - store.start
        last = store.end - store.start
        if 0 <= near <= last and self._stand_on(bits, near):
            return near
        motor = 0
        while not bits >> motor & 1:
            motor += 1
        axis = self.follower.axes[motor]
        index = 0
        while index <= last:
            count = min(last + 1 - index, _BATCH)
            store.positions(motor, index, count, self.values, 0)
            for i in range(count):
                if axis.stands_on(self.values, i) and self._stand_on(bits, index + i):
                    return index + i
            index += count
        return -1

    def _stand_on(self, bits, index):
        place = self.follower.place
        for motor in range(self.follower.count):
            if bits >> motor & 1:
                self.store.position(motor, index, place, 0)
                if not self.follower.axes[motor].stands_on(place, 0):
                    return False
        return True

    def _barred(self, bits, at, to):
        """OK, or why a motor may not leave the frame with index `at` toward `to`: straight into a limit switch."""
        safety = self.stage.safety
        step = 1 if to > at else -1
        for motor in range(self.follower.count):
            if bits >> motor & 1 and safety.ends(motor):
                axis = self.follower.axes[motor]
                index = at
                while index != to:
                    index += step
                    self.store.position(motor, index, self.places, motor)
                    if not axis.stands_on(self.places, motor):
                        # the first frame that lies elsewhere tells which way it goes
                        code = safety.bars(motor, self.places, motor)
                        if code != OK:
                            return code
                        break
        return OK

    # ---------------------------------------------------------------- the motion

    def start(self):
        self.count = 0
        self.whole = 0
        reals.put(self.follower.numbers, _SINCE, 0, 0)

    def started(self, tick):
        self.begun = tick

    def lead(self, motor):
        reals.put(self.follower.numbers, speed(motor), 0, 0)
        if self.closed:  # sent back before it has begun
            self.follower.axes[motor].expect(False)

    def feed(self):
        if self.closed or self.follower.ahead(self.bits) >= _AHEAD:
            return False
        self._queue()
        return True

    def _queue(self):
        """Append the way to the next frame to each motor."""
        follower = self.follower
        r = follower.numbers
        left = (self.to - self.at) * self.step
        # The velocity at the next frame: as fast as the one before, the top and the way that is
        # then left allow.
        reals.multiply(r, X, _RATE, _RATE)
        reals.add(r, X, X, _TWICE)
        reals.put(r, Y, left - 1, 0)
        reals.multiply(r, Y, Y, _TWICE)
        if reals.compare(r, X, Y) > 0:
            reals.copy(r, X, Y)
        reals.root(r, _NEXT, X)
        if reals.compare(r, _NEXT, _TOP) > 0:
            # A top that has been lowered on the way is come down to as steeply as anything else.
            reals.multiply(r, X, _RATE, _RATE)
            reals.subtract(r, X, X, _TWICE)
            reals.root(r, _NEXT, X)
            if reals.compare(r, _NEXT, _TOP) < 0:
                reals.copy(r, _NEXT, _TOP)
        # one frame at the mean of the two velocities
        reals.add(r, X, _RATE, _NEXT)
        reals.put(r, _U, 0, 0)
        reals.put(r, _D, 1, 0)
        if self.hurry and left == 1:
            self._hurry_time(self.at + self.step, False)
        elif reals.sign(r, X):
            reals.put(r, Y, 2, 0)
            reals.divide(r, T, Y, X)
        else:
            reals.copy(r, T, _SLOWEST)
            reals.put(r, Y, 1, 0)
            reals.divide(r, Y, Y, _TOP)
            if reals.compare(r, Y, T) > 0:
                reals.copy(r, T, Y)
        self._hop(self.at, self.at + self.step)

    def _hop(self, begin, end):
        """Append the phase to the frame `end`: _D frames in T ticks, from the velocity _RATE to _NEXT.

        It begins _U frames after the frame `begin`.
        """
        follower = self.follower
        r = follower.numbers
        k = self.count % _ROWS * _ROW
        rows = self.rows
        rows[k + _WHOLE] = self.whole
        reals.fetch(rows, k + _FRACTION, r, _SINCE)
        reals.fetch(rows, k + _TIME, r, T)
        reals.fetch(rows, k + _FROM, r, _RATE)
        reals.fetch(rows, k + _TO, r, _NEXT)
        reals.fetch(rows, k + _PASSED, r, _U)
        reals.fetch(rows, k + _WAY, r, _D)
        rows[k + _INDEX] = begin
        self.count += 1
        reals.add(r, _SINCE, _SINCE, T)
        ticks = reals.floor(r, _SINCE, HALF)
        self.whole = (self.whole + ticks) & _WRAP
        reals.put(r, X, ticks, 0)
        reals.subtract(r, _SINCE, _SINCE, X)
        reals.put(r, Y, 12, 0)
        reals.divide(r, _SCALE, _NEXT, Y)
        follower.window[path.MOST] = path.FROM_REST
        follower.hop(self.bits, end, self.step, T, _SCALE)
        follower.window[path.MOST] = path.MONOTONE
        reals.copy(r, _RATE, _NEXT)
        self.at = end
        if end == self.to:
            follower.close(self.bits)
            self.closed = True

    def _locate(self, ticks):
        """Where the axis is so many ticks after the begin: _U, _W. The words of the row, -1 where there is none."""
        r = self.follower.numbers
        rows = self.rows
        n = self.count
        last = max(n - _ROWS, 0)
        while n > last:
            n -= 1
            k = n % _ROWS * _ROW
            since = (ticks - rows[k + _WHOLE]) & _WRAP
            if since < _HALF:
                reals.put(r, X, since, 0)
                reals.fetch(r, Y, rows, k + _FRACTION)
                reals.subtract(r, X, X, Y)
                if reals.sign(r, X) >= 0:
                    break
        else:
            return -1
        reals.fetch(r, Y, rows, k + _TIME)
        if reals.compare(r, X, Y) > 0:
            reals.copy(r, X, Y)
        # with z = x/T: u = from·x + z·(p + z·q)·x, velocity = from + z·(2p + 3z·q)
        reals.divide(r, _Z, X, Y)
        reals.fetch(r, _W, rows, k + _FROM)
        reals.fetch(r, _D, rows, k + _TO)
        reals.fetch(r, T, rows, k + _WAY)
        reals.divide(r, T, T, Y)
        reals.add(r, _Q, _W, _D)
        reals.subtract(r, _Q, _Q, T)
        reals.subtract(r, _Q, _Q, T)  # from + to - 2·mean
        reals.subtract(r, _P, T, _W)
        reals.subtract(r, _P, _P, _Q)  # 3·mean - 2·from - to
        reals.multiply(r, _Q, _Q, _Z)
        reals.add(r, _U, _P, _Q)
        reals.multiply(r, _U, _U, _Z)
        reals.add(r, _U, _U, _W)
        reals.multiply(r, _U, _U, X)
        reals.fetch(r, Y, rows, k + _PASSED)
        reals.add(r, _U, _U, Y)
        reals.double(r, _P, _P, 1)
        reals.add(r, _P, _P, _Q)
        reals.double(r, _Q, _Q, 1)
        reals.add(r, _P, _P, _Q)
        reals.multiply(r, _P, _P, _Z)
        reals.add(r, _W, _W, _P)
        if reals.sign(r, _W) < 0:
            reals.put(r, _W, 0, 0)
        return k

    def play_head(self, tick, frame):
        kernel = self.stage.axes.kernel.state
        k = self._locate((tick + 1 + kernel[stepper.LEAD] - self.begun) & _WRAP)
        if k < 0:
            return self.stage.move_time
        r = self.follower.numbers
        reals.multiply(r, X, _U, THOUSAND)
        reals.put(r, Y, 1, -1)
        reals.add(r, X, X, Y)
        return (self.store.start + self.rows[k + _INDEX]) * 1000 + self.step * reals.floor(r, X, HALF)

    def finished(self):
        if self.closed and not self.stage.moving():
            self.stage.move_time = (self.store.start + self.at) * 1000
        return self.closed

    def again(self):
        """After a landing on the way back."""
        if self.later < 0 or self.later == self.at:
            return False
        self._aim(self.later)
        self._approach()
        return True

    def wanted(self):
        return not self.closed

    # ---------------------------------------------------------------- landing

    def landing(self):
        return self.asked == 2

    def land(self, everything):
        """On the next frame that can be reached, or where that takes long, at a frame per second (field note 6.10)."""
        first = not self.asked
        if everything:
            self.asked = 2
        elif first:
            self.asked = 1
        self.later = -1
        if not first:
            return True
        axes = self.stage.axes
        kernel = axes.kernel.state
        bits = self.bits
        uneven = False
        irq = axes.hal.irq_off()
        ticks = min(stepper.queued(kernel, bits), _NOTICE)
        tick = kernel[stepper.TICKS] + kernel[stepper.LEAD] + 1
        if ticks >= _LEAST:
            before = 0
            for motor in range(axes.count):
                if bits >> motor & 1:
                    taken = axes[motor].cut_off(ticks)
                    uneven = uneven or before != 0 and taken != before
                    before = taken
            ticks = before
        axes.hal.irq_on(irq)
        if uneven:
            return False
        if ticks >= _LEAST:
            self._land_from((tick + ticks - self.begun) & _WRAP)
        elif not self.closed:
            # frames so short, or the end so near, that what is queued is over soon
            self.to = self._landing()
            if self.to == self.at:
                self.follower.close(self.bits)
                self.closed = True
        return True

    def _land_from(self, ticks):
        """The queues are cut so many ticks after the begin: go on from there to rest on a frame."""
        follower = self.follower
        axes = self.stage.axes
        r = follower.numbers
        step = self.step
        at = self.rows[self._locate(ticks) + _INDEX]
        for motor in range(follower.count):
            if self.bits >> motor & 1:
                self.store.position(motor, at, follower.place, 0)
                axes[motor].go_on(follower.place, 0)
                velocity(r, speed(motor), axes[motor].cubic, G1)
        self.whole = ticks
        reals.put(r, _SINCE, 0, 0)
        self.closed = False
        reals.copy(r, _RATE, _W)
        end = at + step * (reals.floor(r, _U, HALF) + 1)
        if (self.to - end) * step < 0:
            end = self.to
        reals.put(r, X, (end - at) * step, 0)
        reals.subtract(r, _D, X, _U)  # to the next frame
        if reals.sign(r, _D) <= 0:
            reals.put(r, _D, 1, -20)  # it is there, but for rounding
        # The way that it takes to stop, and so many frames more than the next one
        self._steepest(at, end)
        reals.multiply(r, X, _RATE, _RATE)
        reals.double(r, Y, _LIMIT, 1)
        reals.divide(r, X, X, Y)
        reals.subtract(r, X, X, _D)
        reals.negate(r, X, X)
        more = min(max(-reals.floor(r, X, HALF), 0), (self.to - end) * step)
        self.to = end + step * more
        reals.put(r, X, more, 0)
        reals.add(r, X, X, _D)  # all the way
        # At a constant deceleration it takes 2·way/velocity
        reals.multiply(r, Y, _RATE, _RATE)
        reals.divide(r, _TWICE, Y, X)
        reals.double(r, X, X, 1)
        reals.put(r, Y, LANDING_MS, 0)
        reals.multiply(r, Y, Y, _RATE)
        slow = reals.compare(r, X, Y) > 0
        reals.put(r, Y, 2, 0)
        reals.divide(r, Y, Y, THOUSAND)
        self.hurry = slow and reals.compare(r, _RATE, Y) < 0
        if more:
            reals.put(r, X, _BRIEF, 0)
            reals.multiply(r, X, X, _RATE)
            if reals.compare(r, _D, X) < 0:
                for motor in range(follower.count):
                    if self.bits >> motor & 1:
                        # by way of that frame, where it may turn
                        self.store.position(motor, end, follower.place, 0)
                        motor_step(axes[motor].planned, axes[motor].limits, follower.place, 0, 0)
                end += step
                more -= 1
                reals.put(r, X, 1, 0)
                reals.add(r, _D, _D, X)
        reals.put(r, X, more, 0)
        if self.hurry:
            reals.double(r, _TWICE, _LIMIT, 1)
        reals.multiply(r, X, X, _TWICE)
        reals.root(r, _NEXT, X)
        if reals.compare(r, _NEXT, _RATE) > 0:
            reals.copy(r, _NEXT, _RATE)
        if self.hurry and not more:
            self._hurry_time(end, True)
        else:
            reals.add(r, X, _RATE, _NEXT)
            reals.double(r, T, _D, 1)
            reals.divide(r, T, T, X)
        if not more:
            self._stay_before(end)
        self._hop(at, end)
        for motor in range(follower.count):
            if self.bits >> motor & 1:
                axes[motor].feed(motion.MOST, motion.FIRST_TICKS)

    def _stay_before(self, end):
        """Shorten T, by a quarter at most, where on the way to rest on the frame `end` a motor would go past its step.

        That is where its velocity is more than three times the mean: a fast cubic that has been cut late.
        """
        follower = self.follower
        r = follower.numbers
        reals.double(r, _P, T, -2)
        reals.subtract(r, _P, T, _P)
        for motor in range(follower.count):
            if self.bits >> motor & 1:
                axis = follower.axes[motor]
                own = speed(motor)
                if not reals.sign(r, own):
                    continue
                self.store.position(motor, end, follower.place, 0)
                motor_step(axis.planned, axis.limits, follower.place, 0, 0)
                reals.put_difference(r, X, axis.limits, PHYSICAL, axis.cubic, WHOLE)
                reals.divide(r, X, X, own)
                reals.put(r, Y, 3, 0)
                reals.multiply(r, X, X, Y)
                if reals.sign(r, X) > 0 and reals.compare(r, X, T) < 0:
                    reals.copy(r, T, X if reals.compare(r, X, _P) > 0 else _P)

    def _steepest(self, at, end):
        """_LIMIT = the acceleration, frames per tick², within which the motors can stop there: what the check has found
        for this rate, or more up to ACCELERATION where the frames around `end` allow it."""
        follower = self.follower
        r = follower.numbers
        store = self.store
        values = self.values
        reals.put(r, _LIMIT, ACCELERATION, 0)
        reals.divide(r, _LIMIT, _LIMIT, THOUSAND)
        reals.divide(r, _LIMIT, _LIMIT, THOUSAND)
        # from rest to the rate within a frame
        reals.multiply(r, _P, _TOP, _TOP)
        reals.double(r, _P, _P, -1)
        if reals.compare(r, _P, _LIMIT) >= 0:
            return
        reals.multiply(r, _Q, _RATE, _RATE)
        for motor in range(follower.count):
            if self.bits >> motor & 1:
                store.position(motor, at, values, 0)
                store.position(motor, end, values, 1)
                store.position(motor, min(max(end + self.step, 0), store.end - store.start), values, 2)
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
                # what the bend of the path leaves of the motor's acceleration, with a half more for the slopes
                reals.multiply(r, T, T, _Q)
                reals.fetch(r, Y, follower.axes[motor].numbers, motion.STEEP)
                reals.subtract(r, Y, Y, T)
                reals.double(r, T, X, -1)
                reals.add(r, X, X, T)
                reals.divide(r, Y, Y, X)
                if reals.compare(r, Y, _LIMIT) < 0:
                    reals.copy(r, _LIMIT, Y)
        if reals.compare(r, _LIMIT, _P) < 0:
            reals.copy(r, _LIMIT, _P)

    def _hurry_time(self, end, cut):
        """T = how long the way _D to rest on the frame `end` takes at a frame per second, or as fast as all motors can.

        cut: from where the queues have been cut, otherwise from the last frame queued. Never longer than at a constant
        deceleration.
        """
        follower = self.follower
        r = follower.numbers
        # A cubic from rest to rest is half as fast again as its mean, and its greatest acceleration 6·way/T². One that
        # begins in motion stays within both; one that has to turn within twice as much, if that has the time.
        reals.double(r, T, _D, -1)
        reals.add(r, T, T, _D)
        reals.root(r, X, T)
        if reals.compare(r, T, X) < 0:
            reals.copy(r, T, X)
        reals.multiply(r, T, T, THOUSAND)
        for motor in range(follower.count):
            if self.bits >> motor & 1:
                axis = follower.axes[motor]
                own = speed(motor)
                reals.copy_word(self.values, 0, axis.limits, PHYSICAL)
                if cut:
                    reals.copy_word(self.values, 0, axis.cubic, WHOLE)
                self.store.position(motor, end, follower.place, 0)
                motor_step(axis.planned, axis.limits, follower.place, 0, 0)
                reals.put_difference(r, X, axis.limits, PHYSICAL, self.values, 0)
                turns = reals.sign(r, X) * reals.sign(r, own) < 0
                if reals.sign(r, X) < 0:
                    reals.negate(r, X, X)
                reals.put(r, Y, 1, 0)
                reals.add(r, X, X, Y)
                reals.put(r, Y, 3, -1)
                reals.multiply(r, Y, Y, X)
                reals.fetch(r, _P, axis.numbers, motion.TOP)
                reals.divide(r, Y, Y, _P)
                if reals.compare(r, T, Y) < 0:
                    reals.copy(r, T, Y)
                reals.put(r, Y, 12 if turns else 6, 0)
                reals.multiply(r, Y, Y, X)
                reals.fetch(r, _P, axis.numbers, motion.STEEP)
                reals.divide(r, Y, Y, _P)
                reals.root(r, Y, Y)
                if reals.compare(r, T, Y) < 0:
                    reals.copy(r, T, Y)
                if turns:
                    reals.double(r, Y, own, 3)
                    if reals.sign(r, Y) < 0:
                        reals.negate(r, Y, Y)
                    reals.divide(r, Y, Y, _P)
                    if reals.compare(r, T, Y) < 0:
                        reals.copy(r, T, Y)
        if reals.sign(r, _RATE):
            reals.double(r, X, _D, 1)
            reals.divide(r, X, X, _RATE)
            if reals.compare(r, X, T) < 0:
                reals.copy(r, T, X)
