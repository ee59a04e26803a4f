"""MSG_RT_JOG_ALL: all motors along the uploaded path, as one axis whose unit is the frame.

Its velocity is at most FPS, its acceleration 4 frames/s² (field note 6.10), and it comes to rest on whole
frames only. From one frame to the next its acceleration is constant, and the motors follow the
cubics through the frames' positions with the path's slope times the axis' velocity at either end.
"""

from array import array

from framestep.motion import reals
from framestep.moves.follow import FASTEST_FPS, HALF, THOUSAND, T, X, Y, speed
from framestep.moves.stage import ENDING, POSITIONING, Operation
from framestep.moves.store import READY as UPLOADED
from framestep.native import const
from framestep.protocol.messages import ERR_GENERAL, ERR_MOVING, ERR_NOT_IN_POSITION, ERR_RANGE, OK

ACCELERATION = const(4)  # frames/s² (field note 6.10)
_AHEAD = const(1)
_BATCH = const(32)

# Registers: frames and ticks; follow.OWN is the first that is free
_TOP = const(36)
_TWICE = const(38)  # twice the acceleration, 8·10^-6 frames per tick²
_RATE = const(40)  # velocity at the last frame queued
_NEXT = const(42)
_SLOWEST = const(44)  # ticks that one frame takes from rest to rest: 2/sqrt(4·10^-6)
_SCALE = const(48)


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
        self._ways(self.draft, bits, at, step, frames, going)
        code = self.follower.check(bits, at, frames, fps_milli, step, self.draft, ACCELERATION)
        if code == OK and not under_way:
            code = self._barred(bits, at, to)
        if code != OK:
            return code
        self._top(fps_milli)
        if under_way:
            self._retarget(to)
            return OK
        self.at = at
        self.bits = bits
        stage.drop()
        if to == at:
            return OK
        self._aim(to)
        self._approach()
        return OK

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
        self.closed = False
        reals.put(self.follower.numbers, _RATE, 0, 0)

    def _top(self, fps_milli):
        r = self.follower.numbers
        reals.put(r, _TOP, fps_milli, 0)
        reals.divide(r, _TOP, _TOP, THOUSAND)
        reals.divide(r, _TOP, _TOP, THOUSAND)
        reals.put(r, _TWICE, 8, 0)
        reals.divide(r, _TWICE, _TWICE, THOUSAND)
        reals.divide(r, _TWICE, _TWICE, THOUSAND)
        reals.put(r, _SLOWEST, 1000, 0)

    def _retarget(self, to):
        """Under way: bend to the new destination; where it lies behind, land first and turn."""
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
        if (to - landing) * self.step >= 0:
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
        if reals.sign(r, X):
            reals.put(r, Y, 2, 0)
            reals.divide(r, T, Y, X)
        else:
            reals.copy(r, T, _SLOWEST)
            reals.put(r, Y, 1, 0)
            reals.divide(r, Y, Y, _TOP)
            if reals.compare(r, Y, T) > 0:
                reals.copy(r, T, Y)
        self.at += self.step
        reals.put(r, Y, 12, 0)
        reals.divide(r, _SCALE, _NEXT, Y)
        follower.hop(self.bits, self.at, self.step, T, _SCALE)
        reals.copy(r, _RATE, _NEXT)
        if self.at == self.to:
            follower.close(self.bits)
            self.closed = True

    def reached(self, ticks):
        # Between frames the time of the move is that of the last frame queued, at rest it is exact.
        if self.closed and not self.stage.moving():
            self.stage.move_time = (self.store.start + self.at) * 1000
        return False

    def finished(self):
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

    def land(self):
        if not self.closed:
            self.to = self._landing()
            if self.to == self.at:
                self.follower.close(self.bits)
                self.closed = True
        self.later = -1
        return True
