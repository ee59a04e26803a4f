"""MSG_RT_JOG_ALL: all motors along the uploaded path, as one axis whose unit is the frame.

The axis moves at FPS, or slower if a motor could not follow (field note 5.5). It accelerates with
4 frames/s² (field note 6.10), and comes to rest on whole frames only. From one frame to the next
its acceleration is constant. The motors follow cubics through the frames' positions. Their velocity
at a frame is the path's slope times the velocity of the axis.

jog_phases.py keeps what has been queued, so that the place on the path is known at any moment. A
stop cuts all queues at one moment; from there jog_landing.py brings the motors to rest on a frame.
On the way there the motors slow down already, from the tick after the request on (begin_stop).
"""

from array import array

from framestep.base.clock import after, elapsed
from framestep.base.native import const, micropython, ptr32
from framestep.base.results import ERR_GENERAL, ERR_MOVING, ERR_NOT_IN_POSITION, ERR_RANGE, OK
from framestep.motion import reals
from framestep.motion.compute import compute
from framestep.motion.formula import formula
from framestep.motion.segments import G1, velocity
from framestep.motors.axis import ALL_SPLICE_TICKS, FIRST_TICKS, MOST_SEGMENTS
from framestep.motors.feeder import coupled
from framestep.motors.queue_cut import boundary, cut, cut_at, queued, slow, take_slow
from framestep.moves.frame_positions import find_frame, find_switch_on_path
from framestep.moves.jog_landing import (
    ACCELERATION,
    DESTINATION,
    END,
    FOUND_WORDS,
    HURRY,
    hurry_time,
    plan_landing,
)
from framestep.moves.jog_phases import INDEX, JogPhases
from framestep.moves.operation import Operation
from framestep.moves.operation_runner import ENDING, POSITIONING
from framestep.moves.path import path, registers
from framestep.moves.path.move_check import FASTEST_FPS, HALF
from framestep.moves.path.registers import DURATION, FRAME_SCALE, NEXT, RATE, SPEEDS, TOP
from framestep.moves.upload.store import READY as UPLOADED
from framestep.pulse import stepper

_AHEAD = const(1)  # the next phase is queued when fewer than this wait
_MOST_CHECKED = const(6000)  # frames times motors: during a jog there is no time to check more
_LEAST = const(16)  # with fewer ticks queued, nothing is cut
_PASSING = const(2)  # ticks that may pass until the cut
# Of begin_stop()
_AMPLE = const(64)  # ticks in which the pass ends and the landing is planned
_FINEST = const(32)  # 1/256 tick
_TRIES = const(3)  # a boundary may be too near, and a tick may pass meanwhile

# TOP from thousandths of a frame per second; the acceleration is 4 frames/s².
_RATES = formula(
    registers,
    """
    TOP = TOP / THOUSAND / THOUSAND
    TWICE = 8 / THOUSAND / THOUSAND  # twice ACCELERATION
    SLOWEST = THOUSAND
    """,
)
# to the top velocity
_SLOWING_DISTANCE = formula(registers, "-> frames", "frames = (RATE * RATE - TOP * TOP) / TWICE")

# The stopping distance: whole frames, and hundredths of a frame.
_STOPPING_DISTANCE = formula(
    registers,
    "-> frames, hundredths",
    """
    distance = RATE * RATE / TWICE
    frames = floor(distance)
    hundredths = (distance - frames) * 100
    """,
)
# The velocity at the next frame, as high as the last one, the top velocity and the frames from
# there on allow. If the top velocity is lowered during the jog, the axis slows down to it at its
# normal acceleration.
_NEXT_RATE = formula(
    registers,
    "frames",
    """
    NEXT = sqrt(min(RATE * RATE + TWICE, frames * TWICE))
    assert NEXT > TOP
    NEXT = max(sqrt(RATE * RATE - TWICE), TOP)
    """,
)
# Half the time to stop from the higher of the two velocities.
_HALF_STOP = formula(registers, "-> ticks", "ticks = max(RATE, NEXT) / TWICE")
# One frame, at the mean of the two velocities.
_NEXT_FRAME = formula(
    registers,
    """
    HERE = 0
    DISTANCE = 1
    both = RATE + NEXT
    assert both > ZERO
    DURATION = 2 / both
    """,
)
_FROM_REST_TO_REST = formula(registers, "DURATION = max(SLOWEST, 1 / TOP)")
_FRAME_SCALE = formula(registers, "FRAME_SCALE = NEXT / 12")  # from slopes to steps per tick
_THOUSANDTHS = formula(registers, "-> rounded", "rounded = HERE * THOUSAND + 0.5")
# Where slow() leads: the fraction of a tick beyond HERE, slower by twice the share of the time that
# is lost. LIMIT keeps the place.
_SLOWED = formula(
    registers,
    "beyond, lost, ticks",
    """
    LIMIT = HERE + HERE_RATE * beyond / 256
    NEXT = HERE_RATE - HERE_RATE * lost / ticks / 128
    DURATION = ticks
    """,
)
# frames: from the INDEX where the way there begins to the one where it ends
_SLOW_WAY = formula(
    registers,
    "frames",
    """
    RATE = HERE_RATE
    DISTANCE = LIMIT - HERE + frames
    """,
)
_AFTER_IT = formula(
    registers,
    """
    HERE = LIMIT
    HERE_RATE = NEXT
    """,
)


class JogAll(Operation):
    """A JOG_ALL; see operation.Operation."""

    sends_rt_end = False
    at_once = False

    def __init__(self, operations):
        Operation.__init__(self, operations)
        self.player = operations.player
        self.move_check = operations.move_check
        self.store = operations.store
        self.last_queued = 0  # index of the last frame queued
        self.destination = 0  # index of the frame to come to rest on
        self.step = 1  # direction along the path: 1 or -1
        self.closed = True  # the phase that ends at rest has been queued
        # index of a destination behind the motors, for after they have turned; -1: none
        self.after_turn = -1
        self.fps_milli = 0  # as requested
        self.stop_asked = 0  # a stop on a frame is under way: 1 for STOP, 2 for STOP_ALL
        self.hurry = False  # the last frame before the stop takes a second at most
        self.phases = JogPhases(self.player.numbers)
        self.found = array("i", [0] * FOUND_WORDS)  # of a landing
        self.begun = 0  # tick of the first pulse
        self.stop_ticks = 0  # of a stop from the velocity that is queued
        # of begin_stop(), until stop_on_frame() has followed
        self.slowed = 0  # ticks in which the motors slow down; 0: they do not
        self.slow_from = 0  # the tick before them
        self.slow_way = 0  # ticks to the same place without it
        self.lost = 0  # 1/256 tick
        self.positions = array("i", [0] * operations.axes.count)
        # direction in which each motor starts from there
        self.directions = array("i", [0] * operations.axes.count)
        # the same for a request that may be refused
        self.draft = array("i", [0] * operations.axes.count)

    # ---------------------------------------------------------------- the request

    def prepare(self, fps_milli, frame):
        """Jog to a scene frame, at fps_milli thousandths of a frame per second.

        Return a code; nothing changes unless it is OK.
        """
        store = self.store
        operations = self.operations
        if store.state != UPLOADED:
            return ERR_GENERAL
        if fps_milli > FASTEST_FPS:
            return self.move_check.refuse_rate(fps_milli)
        if fps_milli < 1 or frame < store.start or frame > store.end:
            return ERR_RANGE
        under_way = operations.running
        if under_way and (operations.operation is not self or operations.state == ENDING):
            return ERR_MOVING
        to = frame - store.start
        going = False  # it goes on without coming to rest
        bits = self.bits if under_way else self.player.motors()
        if not under_way:
            if operations.axes.moving:
                return ERR_MOVING
            at = find_frame(self.player, bits, operations.move_time // 1000 - store.start)
            if at < 0:
                return ERR_NOT_IN_POSITION
        else:
            at = self.last_queued
            if not self.closed and reals.sign(self.player.numbers, RATE):
                landing = self._landing()
                going = (to - landing) * self.step >= 0
                if not going:
                    at = landing  # where it turns
        step = 1 if to >= at else -1
        frames = (to - at) * step + 1
        if under_way and frames * self._motors(bits) > _MOST_CHECKED:
            return ERR_MOVING
        if not going:
            self._find_directions(self.draft, bits, at, step, frames)
        code = self.move_check.check(
            bits, at, frames, fps_milli, step, self.draft, ACCELERATION, going
        )
        if code == OK and not under_way:
            code = find_switch_on_path(self.player, operations.safety, bits, at, to, self.positions)
        if code != OK:
            return code
        self.fps_milli = fps_milli
        self._top()
        if under_way:
            self._retarget(to)
            return OK
        self.last_queued = at
        self.bits = bits
        operations.drop_prepared()
        operations.move_time = (store.start + at) * 1000
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

    def _find_directions(self, directions, bits, at, step, frames):
        """directions[motor] = its first direction in `frames` frames from index `at` on."""
        player = self.player
        for motor in range(player.count):
            directions[motor] = 0
            if (bits >> motor) & 1:
                directions[motor] = player.first_direction(motor, at, step, frames)

    def _approach(self):
        """Take up the motors' backlash for the motion to the destination, then start."""
        player = self.player
        for motor in range(player.count):
            if (self.bits >> motor) & 1:
                self.store.position(motor, self.last_queued, self.positions, motor)
        self._find_directions(
            self.directions,
            self.bits,
            self.last_queued,
            self.step,
            (self.destination - self.last_queued) * self.step + 1,
        )
        self.operations.approach(self, self.positions, self.directions)

    def _aim(self, to):
        self.destination = to
        self.step = 1 if to > self.last_queued else -1
        self.after_turn = -1
        self.stop_asked = 0
        self.hurry = False
        self.closed = False
        reals.put(self.player.numbers, RATE, 0, 0)

    def recheck(self, waiting):
        frames = (self.destination - self.last_queued) * self.step + 1
        code = self.move_check.check(
            self.bits,
            self.last_queued,
            frames,
            self.fps_milli,
            self.step,
            self.directions,
            ACCELERATION,
        )
        if code == OK:
            self._top()
        return code

    def _top(self):
        """Set TOP to the rate that the check has found possible."""
        r = self.player.numbers
        reals.put(r, TOP, self.move_check.rate, 0)
        compute(r, _RATES)

    def _retarget(self, to):
        """Change the destination during a jog. If it lies behind, stop on a frame first and turn.

        The jog also stops first if it cannot slow down to a lower top velocity on the part of the
        path that has been checked.
        """
        self.stop_asked = 0
        self.hurry = False
        if self.operations.state == POSITIONING:
            # before it has begun, or between a landing and the way back
            self._aim(to)
            self.closed = to == self.last_queued
            self._approach()
            return
        if self.closed:
            self.after_turn = to
            return
        if reals.sign(self.player.numbers, RATE) == 0:
            if (to - self.last_queued) * self.step > 0:
                self.destination = to
                self.after_turn = -1
            else:
                self.player.end_phases(self.bits)
                self.closed = True
                self.after_turn = to
            return
        landing = self._landing()
        r = self.player.numbers
        compute(r, _SLOWING_DISTANCE)
        slows = reals.floor(r, _SLOWING_DISTANCE.frames, HALF) + 1
        if (to - landing) * self.step >= 0 and slows <= (
            self.destination - self.last_queued
        ) * self.step:
            self.destination = to
            self.after_turn = -1
        else:
            self.destination = landing
            self.after_turn = to

    def _landing(self):
        """Return the index of the first frame on which the motion can end."""
        r = self.player.numbers
        compute(r, _STOPPING_DISTANCE)
        frames = reals.floor(r, _STOPPING_DISTANCE.frames, HALF)
        # up to a hundredth of a frame too many comes from rounding
        rest = reals.floor(r, _STOPPING_DISTANCE.hundredths, HALF)
        if rest >= 1 or frames == 0 and reals.sign(r, RATE):
            frames += 1
        return self.last_queued + self.step * frames

    # ---------------------------------------------------------------- the motion

    def begin_lap(self):
        self.slowed = 0
        self.phases.count = 0
        self.phases.begin(0)

    def started(self, tick):
        self.begun = tick

    def queue_first_phases(self, motor):
        reals.put(self.player.numbers, SPEEDS + 2 * motor, 0, 0)
        if self.closed:  # it was sent back before it began
            self.player.axes[motor].set_more_to_come(False)

    def feed(self):
        if self.closed or self.player.phases_ahead(self.bits) >= _AHEAD:
            return False
        self._queue()
        return True

    def _queue(self):
        """Append the phase up to the next frame to each motor."""
        player = self.player
        r = player.numbers
        left = (self.destination - self.last_queued) * self.step
        reals.put(r, _NEXT_RATE.frames, left - 1, 0)
        compute(r, _NEXT_RATE)
        compute(r, _HALF_STOP)
        self.stop_ticks = 2 * reals.floor(r, _HALF_STOP.ticks, HALF)
        moves = compute(r, _NEXT_FRAME)
        if self.hurry and left == 1:
            hurry_time(player, self.bits, self.last_queued + self.step, False)
        elif not moves:
            compute(r, _FROM_REST_TO_REST)
        self.append_phase(self.last_queued, self.last_queued + self.step)

    def append_phase(self, begin, end):
        """Append the phase up to the frame `end`: DISTANCE frames in DURATION, from RATE to NEXT.

        It begins HERE frames after the frame `begin`. Both are indexes.
        """
        player = self.player
        r = player.numbers
        self.phases.add(begin)
        compute(r, _FRAME_SCALE)
        player.window[path.MOST] = path.FROM_REST
        player.append_frame(
            self.bits, end, self.step, DURATION, FRAME_SCALE, player.window, path.velocity
        )
        player.window[path.MOST] = path.MONOTONE
        reals.copy(r, RATE, NEXT)
        self.last_queued = end
        if end == self.destination:
            player.end_phases(self.bits)
            self.closed = True

    def play_head(self, tick, frame):
        kernel = self.operations.axes.kernel.state
        k = self.phases.locate(elapsed(tick + 1 + kernel[stepper.LEAD], self.begun))
        if k < 0:
            return self.operations.move_time
        r = self.player.numbers
        compute(r, _THOUSANDTHS)
        return (self.store.start + self.phases.rows[k + INDEX]) * 1000 + self.step * reals.floor(
            r, _THOUSANDTHS.rounded, HALF
        )

    def finished(self):
        if self.closed and not self.operations.moving():
            self.operations.move_time = (self.store.start + self.last_queued) * 1000
        return self.closed

    def next_lap(self):
        """Go on to the destination behind, after the stop before the turn."""
        if self.after_turn < 0 or self.after_turn == self.last_queued:
            return False
        self._aim(self.after_turn)
        self._approach()
        return True

    def still_wanted(self):
        return not self.closed

    # ---------------------------------------------------------------- landing

    def stopping_on_frame(self):
        return self.stop_asked == 2

    def stop_on_frame(self, everything):
        """Stop on the next frame possible; if that takes long, at a frame per second (field note
        6.10)."""
        first = not self.stop_asked
        self.begin_stop()
        if everything:
            self.stop_asked = 2
        elif first:
            self.stop_asked = 1
        self.after_turn = -1
        if not first:
            return True
        axes = self.operations.axes
        state = axes.kernel.state
        block = axes.kernel.blocks[0]
        bits = coupled(block, self.bits)
        ticks = ALL_SPLICE_TICKS + _PASSING
        ticks = queued(block, bits, self.slowed or ticks) - _PASSING
        if ticks >= _LEAST:
            hal = axes.hal
            irq = hal.irq_off()
            if self.slowed:
                ticks = elapsed(self.slow_from + self.slowed, state[stepper.TICKS])
            ticks = cut(state, block, bits, ticks)
            tick = state[stepper.TICKS]
            hal.irq_on(irq)
            if ticks < 0:
                return False
            if self.slowed:
                at = self._find_slow_end()
            else:
                at = self._find(tick + ticks)
            self._land(at)
        elif self.slowed:
            return False  # too late to plan
        elif not self.closed:
            # The queues end soon: the frames are short, or the end is near.
            self.destination = self._landing()
            if self.destination == self.last_queued:
                self.player.end_phases(self.bits)
                self.closed = True
        return True

    def _since(self, tick):
        """Return how many ticks after the beginning the motors end with this tick."""
        return elapsed(tick + self.operations.axes.kernel.state[stepper.LEAD] + 1, self.begun)

    def _find(self, tick):
        """Set HERE and HERE_RATE, and the beginning of the next phase: after this tick. Return the
        index."""
        phases = self.phases
        ticks = self._since(tick)
        k = phases.locate(ticks)
        phases.begin(ticks)
        return phases.rows[k + INDEX]

    def _find_slow_end(self):
        """The same for where begin_stop() leads; the way there becomes a phase."""
        phases = self.phases
        r = self.player.numbers
        at = self._find(self.slow_from + self.slow_way)
        reals.put(r, _SLOWED.beyond, -self.lost & 255, 0)
        reals.put(r, _SLOWED.lost, self.lost, 0)
        reals.put(r, _SLOWED.ticks, self.slowed, 0)
        compute(r, _SLOWED)
        begin = self._find(self.slow_from)
        reals.put(r, _SLOW_WAY.frames, (at - begin) * self.step, 0)
        compute(r, _SLOW_WAY)
        phases.add(begin)
        compute(r, _AFTER_IT)
        return at

    @micropython.viper
    def begin_stop(self):
        """Slow down from the next tick on, ahead of stop_on_frame(), which has to follow soon.

        What is queued beyond is in vain. Does nothing where the motors cannot slow down together
        along the path, or where they stop already. For the USB port's callbacks, see
        Axis.begin_stop().
        """
        if self.slowed or self.stop_asked:
            return
        axes = self.operations.axes
        hal = axes.hal
        state = axes.kernel.state
        block = axes.kernel.blocks[0]
        bits = int(coupled(block, int(self.bits)))
        stop_ticks = int(self.stop_ticks)
        ticks = _AMPLE
        tries = _TRIES
        while tries:
            tries -= 1
            now = ptr32(state)[stepper.TICKS]
            ticks = int(boundary(block, bits, ticks))
            if ticks == 0:
                return
            at = int(after(now, ticks))
            lost = int(slow(state, bits, at, stop_ticks, _FINEST))
            if lost == 0:
                ticks += 1
            else:
                way = ticks + (lost + 255 >> 8)
                dropped = 0
                irq = hal.irq_off()
                if ptr32(state)[stepper.TICKS] == now:  # else slow() may have mixed two states
                    tries = 0
                    dropped = int(cut_at(state, bits, at, ALL_SPLICE_TICKS))
                    if dropped:
                        take_slow(state, bits, way)
                hal.irq_on(irq)
                if dropped:
                    self.slowed = way
                    self.slow_from = now
                    self.slow_way = ticks
                    self.lost = lost

    def _land(self, at):
        """Come to rest on a frame from where the queues have been cut, HERE frames after the index
        `at`."""
        self.slowed = 0
        player = self.player
        axes = player.axes
        for motor in range(player.count):
            if (self.bits >> motor) & 1:
                self.store.position(motor, at, player.position, 0)
                axes[motor].resume_from_cut(player.position, 0)
                velocity(player.numbers, SPEEDS + 2 * motor, axes[motor].cubic, G1)
        found = self.found
        plan_landing(player, self.bits, at, self.step, self.destination, found)
        self.closed = False
        self.destination = found[DESTINATION]
        self.hurry = found[HURRY] != 0
        self.append_phase(at, found[END])
        for motor in range(player.count):
            if (self.bits >> motor) & 1:
                axes[motor].feed(MOST_SEGMENTS, FIRST_TICKS)
