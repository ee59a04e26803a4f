"""A move or jog along a line: all motors of a rig follow one point that moves along it.

Every `span` ticks there is a knot. Between two knots every motor follows a cubic (AIM phases,
motion/phases.py) with the exact positions at both ends. Its velocity there is the point's velocity
times the slope of the motor's step over s, from the knots on either side.

Knots are on whole ticks and a span is one segment. So the queues of all motors can be cut at the
same knot and planned again from there: that is how a point in motion is stopped on its line.

Time in ticks, positions of motors in steps. Nothing allocates after construction.
"""

from array import array

from framestep.base.clock import HALF, WRAP, after, elapsed
from framestep.base.native import const, micropython, ptr32
from framestep.motion import reals
from framestep.motion.compute import compute
from framestep.motion.formula import formula
from framestep.motors.axis import ALL_SPLICE_TICKS
from framestep.motors.feeder import coupled
from framestep.motors.queue_cut import cut_at, slow, take_slow
from framestep.pulse import stepper
from framestep.virtual_axes import registers
from framestep.virtual_axes.line import ROW
from framestep.virtual_axes.point import (
    last_step,
    nearest_step,
    next_step,
    place_knot,
    set_advance,
    velocity,
)

# States
IDLE = const(0)
STARTING = const(1)  # the first knots are being planned
MOVING = const(2)
HALTED = const(3)  # the motors ramp down by themselves
TAKING_UP = const(4)  # motors take up backlash for the direction in which they start
SETTLING = const(5)  # at the end of the line: motors that have turned take up their backlash

# Of `stopping`
_TO_LINE = const(1)  # on the line, with all backlash taken up at the end
_AT_ONCE = const(2)  # nothing begins to move any more

_BEGIN_TICKS = const(128)  # queued before anything moves
_AHEAD_TICKS = const(256)  # planned ahead
_SCARCE_TICKS = const(128)  # with fewer, a knot takes precedence over a survey
_KNOTS = const(16)  # kept
_TRIES = const(4)  # of a stop to slow down at once
_CUT_TICKS = const(ALL_SPLICE_TICKS - 4)  # some may pass until the queues are cut

# The point's velocity times the slope at S_HERE of the parabola through the three knots: factors of
# a motor's steps before and after that knot for its velocity there.
_RATES = formula(
    registers,
    """
    BEFORE_RATE = 0
    AFTER_RATE = 0
    before = S_HERE - S_BEFORE
    after = S_AFTER - S_HERE
    assert before > ZERO
    assert after > ZERO
    rate = V_HERE / (before + after)
    BEFORE_RATE = rate * (after / before)
    AFTER_RATE = rate * (before / after)
    """,
)


# Of `found`
_KNOT = const(0)
_TICKS = const(1)  # to it
_NOW = const(2)  # tick from which they count


@micropython.viper
def _find_cut(state, bits: int, times, newest: int, last: int, begun: int, found) -> int:
    """Find the first knot that is ALL_SPLICE_TICKS ahead or, up to `last`, one to which the motors
    can slow down: set `found`. Return how many ticks later they reach it then, see slow(), or 0.

    newest: the newest knot of `times`; begun: the tick in which the motion began.
    """
    at = ptr32(times)
    now = ptr32(state)[stepper.TICKS]
    knot = newest - (_KNOTS - 2)
    if knot < 1:
        knot = 1
    least = elapsed(now, begun) + 1 + ALL_SPLICE_TICKS
    while knot <= last and (at[knot & (_KNOTS - 1)] - least) & WRAP >= HALF:
        knot += 1
    least -= ALL_SPLICE_TICKS
    out = ptr32(found)
    out[_NOW] = now
    out[_KNOT] = knot
    out[_TICKS] = elapsed(at[knot & (_KNOTS - 1)], least)
    more = 0
    while knot <= last:
        ticks = elapsed(at[knot & (_KNOTS - 1)], least)
        more = int(slow(state, bits, after(now, ticks), 1, 256)) >> 8
        if more:
            out[_KNOT] = knot
            out[_TICKS] = ticks
            break
        knot += 1
    return more


class LinearMove:
    """Mover along one line at a time, which has been begun and surveyed."""

    def __init__(self, line, survey):
        self.line = line
        self.survey = survey
        self.axes = line.axes
        self.r = line.r
        self.motor = line.motor
        self.rows = line.rows
        self.ahead = None  # of a jog: the LookAhead that surveys its line
        self.state = IDLE
        self.owned = 0  # bits of the motors in the motion, from its acknowledgement to its end
        self.bits = 0  # the same, with the motors that are coupled to them
        self.speeds = array("i", [0] * (ROW * _KNOTS))  # reals: velocities of the motors at knots
        # reals: s and velocity of the point at each knot
        self.marks = array("i", [0] * (4 * _KNOTS))
        self.found = array("i", [0] * 3)
        self.times = array("i", [0] * _KNOTS)  # ticks from the start of the motion to each knot
        # advance of each motor's path at the last knot queued (point.py)
        self.advances = array("i", [0] * registers.AXES)
        self.word = array("i", [0] * 2)
        self.knot = 0  # the last knot at which the motors' positions are known
        self.queued = 0  # the last knot to which a phase leads
        self.tick = 0  # tick in which the motion began
        self.closed = True  # no further knots follow
        self.stopping = 0  # or one of the two below
        # The knot to which the motors slow down ahead of stop(), or 0; by how many ticks later they
        # reach it, and in how many
        self.slowed = 0
        self.lost = 0
        self.way = 0

    # ---------------------------------------------------------------- start and end

    def begin(self, ahead=None):
        """Start along the line, first by taking up backlash. ahead: LookAhead of a jog."""
        line = self.line
        line.forget_end()
        self.ahead = ahead
        self.state = TAKING_UP
        self.owned = line.bits
        directions = self.survey.directions
        for i in range(registers.AXES):
            motor = self.motor[i] - 1
            if motor >= 0 and not self.axes[motor].rests_on(line.present, motor, directions[i]):
                self.axes[motor].move_to(self.axes.hal, line.present, motor, 10000, directions[i])
            if i & 1:
                self.axes.hal.port.look_for_stop()

    def _set_out(self):
        """Begin to plan. All motors must be at rest where the line begins."""
        hal = self.axes.hal
        line = self.line
        r = self.r
        hal.port.look_for_stop()
        line.positions_at(registers.ZERO, 0)
        hal.port.look_for_stop()
        for i in range(registers.AXES):
            motor = self.motor[i] - 1
            if motor >= 0:
                axis = self.axes[motor]
                axis.begin_plan(hal)
                axis.set_more_to_come(True)
                axis.block[stepper.PLANNED] = stepper.PLAN_SEGMENTS
                set_advance(self.advances, i, line.present, motor, 0, self.rows, 2 * i)
                reals.fetch(self.speeds, 2 * i, r, registers.ZERO)
                hal.port.glance()
        reals.put(r, registers.S, 0, 0)
        reals.put(r, registers.V, 0, 0)
        self._note(0)
        self.times[0] = 0
        self.knot = 0
        self.queued = 0
        self.closed = False
        self.stopping = 0
        self.slowed = 0
        self.state = STARTING

    def _release(self):
        """Start all motors in the same tick."""
        self.tick = self.axes.release(self.line.bits)
        self.bits = coupled(self.axes.kernel.blocks[0], self.line.bits)
        self.state = MOVING

    def _settle(self):
        """At the end of the line, let the loads of motors that have turned on it follow, except
        after a stop of everything.

        Return whether there was such a motor.
        """
        row = ROW * (self.knot % _KNOTS)
        for i in range(registers.AXES):
            motor = self.motor[i] - 1
            if motor >= 0:
                line = self.line
                at = row + 2 * i
                nearest_step(self.word, 0, self.rows, at, line.present, motor, line.bounds, i)
                axis = self.axes[motor]
                if not axis.rests_on(self.word, 0):
                    if self.stopping == _AT_ONCE:
                        self.state = HALTED  # not where the line ends
                        return True
                    axis.move_to(self.axes.hal, self.word, 0)
                    self.state = SETTLING
        return self.state == SETTLING

    def stop(self, at_once=False):
        """Slow down along the line, as steeply as its motors allow.

        at_once: motors that have turned on the line do not take up their backlash at its end.
        """
        if self.state == MOVING:
            if not self.stopping:
                if self._cut():
                    self.stopping = _TO_LINE
                    if self.ahead and not self.ahead.back():
                        self.halt()
                elif not self.closed:
                    self.halt()
            if at_once:
                self.stopping = _AT_ONCE
        elif at_once or self.state != SETTLING:
            if self.state != HALTED:
                self.halt()

    def halt(self, factor=1):
        """Let each motor ramp down by itself, with `factor` times its acceleration."""
        if self.state:
            for i in range(registers.AXES):
                if self.motor[i]:
                    self.axes[self.motor[i] - 1].stop(self.axes.hal, factor)
            self.state = HALTED
            self.closed = True

    def slow_down(self):
        """Adapt to motors that may now be slower than the present motion assumes.

        A move does so from its next knot on, a jog where it has not been surveyed yet.
        """
        if self.state and not self.ahead:
            self.survey.slow_down()

    # ---------------------------------------------------------------- passes of the main loop

    def poll(self):
        """Plan ahead, in each pass. Return whether it has planned, so that there may be more to
        plan at once."""
        state = self.state
        if state == IDLE:
            return False
        if state == TAKING_UP:
            if self.axes.moving_bits() & self.line.bits:
                return False
            self._set_out()
            return True
        if state == STARTING:
            if self.closed or self.times[self.queued % _KNOTS] >= _BEGIN_TICKS:
                if self.axes.filled:
                    self._release()
                return False
            if self.ahead and self.ahead.extend():
                return True
            if not self._plan() and self.ahead and not self.ahead.extend(True):
                self.ahead.closed = True
            if not self.closed and self.ahead and not self.ahead.count:
                self.halt()  # no way to go
            return True
        if state == MOVING and not self.closed:
            left = self._ticks_to(self.queued)
            if self.ahead and left > _SCARCE_TICKS and self.ahead.extend():
                return True
            if left < _AHEAD_TICKS:
                if not self._plan() and self.ahead and not self.ahead.extend(True):
                    self.ahead.closed = True  # a survey that cannot get longer ends here
                return True
        elif not self.axes.moving_bits() & self.line.bits:
            if state == MOVING and self._settle():
                return True
            if state != HALTED:
                self.line.remember_end()
            self.state = IDLE
            self.owned = 0
        return False

    def _ticks_to(self, knot):
        """Return the ticks until a knot; negative once it has been passed."""
        done = self.axes.kernel.state[stepper.TICKS] - self.tick + 1
        return ((self.times[knot % _KNOTS] - done + HALF) & WRAP) - HALF

    # ---------------------------------------------------------------- knots

    def _note(self, knot):
        """Keep s and velocity of a knot."""
        k = 4 * (knot % _KNOTS)
        reals.fetch(self.marks, k, self.r, registers.S)
        reals.fetch(self.marks, k + 2, self.r, registers.V)

    def _plan(self):
        """Place the next knot, or queue the phases to the one before it. Return False if the survey
        of a jog does not reach far enough.

        The velocity of a motor at a knot is known only with the knot after it.
        """
        knot = self.knot
        r = self.r
        if self.queued < knot - 1:
            self._queue(knot - 1)
        elif self.queued < knot and reals.sign(r, registers.V) == 0:
            self._finish(knot)
        elif place_knot(r, self.survey, self.ahead, self.stopping):
            knot += 1
            self.axes.hal.port.glance()
            if self.line.positions_at(registers.S, ROW * (knot % _KNOTS)):
                self.halt()  # though the survey has found that it can be reached
                return True
            self._note(knot)
            ticks = reals.floor(r, registers.TICKS, HALF)
            self.times[knot % _KNOTS] = after(self.times[(knot - 1) % _KNOTS], ticks)
            self.knot = knot
        else:
            return False
        return True

    def _queue(self, knot):
        """Append the phases to a knot that has one on either side."""
        r = self.r
        marks = self.marks
        rows = self.rows
        before = (knot - 1) % _KNOTS
        here = knot % _KNOTS
        ahead = (knot + 1) % _KNOTS
        reals.fetch(r, registers.S_BEFORE, marks, 4 * before)
        reals.fetch(r, registers.S_HERE, marks, 4 * here)
        reals.fetch(r, registers.S_AFTER, marks, 4 * ahead)
        reals.fetch(r, registers.V_HERE, marks, 4 * here + 2)
        compute(r, _RATES)
        reals.put(r, registers.PHASE_TICKS, elapsed(self.times[here], self.times[before]), 0)
        a = ROW * before
        b = ROW * here
        c = ROW * ahead
        word = self.word
        speeds = self.speeds
        port = self.axes.hal.port
        port.glance()
        for i in range(registers.AXES):
            motor = self.motor[i]
            if motor:
                velocity(
                    r,
                    registers.TO_V,
                    rows,
                    a,
                    b,
                    c,
                    registers.BEFORE_RATE,
                    registers.AFTER_RATE,
                    registers.SPARE,
                )
                part = next_step(word, rows, a, b, c, self.advances, i, self.line.bounds)
                reals.fetch(r, registers.FROM_V, speeds, a)
                reals.fetch(speeds, b, r, registers.TO_V)
                self.axes[motor - 1].append_coasting_phase(
                    registers.PHASE_TICKS, registers.FROM_V, registers.TO_V, r, word, 0, part
                )
                port.glance()
            a += 2
            b += 2
            c += 2
        self.queued = knot

    def _finish(self, knot):
        """Append the phases to the knot at which all come to rest."""
        line = self.line
        r = self.r
        rows = self.rows
        word = self.word
        a = ROW * ((knot - 1) % _KNOTS)
        b = ROW * (knot % _KNOTS)
        for i in range(registers.AXES):
            motor = self.motor[i] - 1
            if motor >= 0:
                axis = self.axes[motor]
                reals.fetch(r, registers.FROM_V, self.speeds, a)
                part = next_step(word, rows, a, b, b, self.advances, i, line.bounds)
                up = self.advances[i] > 0
                part = last_step(word, part, rows, b, line.present, motor, up, line.bounds, i)
                axis.append_coasting_phase(
                    registers.TICKS, registers.FROM_V, registers.ZERO, r, word, 0, part
                )
                axis.set_more_to_come(False)
                line.axes.hal.port.glance()
            a += 2
            b += 2
        self.queued = knot
        self.closed = True

    # ---------------------------------------------------------------- changing the plan

    @micropython.viper
    def begin_stop(self):
        """Slow down from the next tick on, ahead of stop(), which has to follow soon.

        What is planned until then is in vain. Does nothing where the motors cannot slow down, and
        where stop() is to do more. For the USB port's callbacks, see Axis.begin_stop().
        """
        if int(self.state) == MOVING and not self.stopping and not self.slowed:
            self._drop(1)

    @micropython.viper
    def _drop(self, slow_only: int) -> int:
        """Drop the plan from the first knot on that is far enough ahead, and get there ever more
        slowly, from the next tick on, or to a later one if that has more room. If the motors
        cannot, only drop it, or do nothing (slow_only: 1).

        Return the knot, or 0 if nothing was dropped.
        """
        hal = self.axes.hal
        state = hal.kernel.state
        found = ptr32(self.found)
        bits = int(self.bits)
        newest = int(self.knot)
        last = newest - 1
        if not self.closed:
            last = int(self.queued) - 1
        knot = more = ticks = 0
        dropped = -1
        tries = _TRIES  # as a tick may pass meanwhile
        while dropped < 0:
            tries -= 1
            more = int(_find_cut(state, bits, self.times, newest, last, int(self.tick), self.found))
            knot = found[_KNOT]
            if knot > last or (slow_only and more == 0):
                return 0
            ticks = found[_TICKS]
            at = int(after(found[_NOW], ticks))
            irq = hal.irq_off()
            if ptr32(state)[stepper.TICKS] == found[_NOW]:  # else slow() may have mixed two states
                dropped = int(cut_at(state, bits, at, _CUT_TICKS))
                if dropped and more:
                    take_slow(state, bits, ticks + more)
            elif tries == 0:
                more = dropped = 0
                if slow_only == 0:
                    dropped = int(cut_at(state, bits, at, _CUT_TICKS))
            hal.irq_on(irq)
        if dropped == 0:
            return 0
        if more:
            self.slowed = knot
            self.lost = more
            self.way = ticks + more
        return knot

    def _cut(self):
        """Drop the plan from the first knot on that is far enough ahead, and slow down on the way
        to it. Return False if there is none."""
        axes = self.axes
        knot = self.slowed
        drop = True
        if not knot:
            knot = self._drop(0)
            if not knot:
                for i in range(registers.AXES):
                    if self.motor[i]:
                        axes[self.motor[i] - 1].feed()
                knot = self._drop(0)
            if not knot:
                knot = self.queued
                if self.closed or self._ticks_to(knot) < ALL_SPLICE_TICKS:
                    return False
                drop = False
        k = knot % _KNOTS
        if self.slowed:
            # begin_stop() may have come while a segment was being queued
            hal = axes.hal
            irq = hal.irq_off()
            stepper.discard(hal.kernel.state, self.bits)
            hal.irq_on(irq)
            self._lose(k)
            self.slowed = 0
        r = self.r
        reals.fetch(r, registers.S, self.marks, 4 * k)
        reals.fetch(r, registers.V, self.marks, 4 * k + 2)
        if drop:
            for i in range(registers.AXES):
                if self.motor[i]:
                    row = ROW * k + 2 * i
                    part = axes[self.motor[i] - 1].resume_at_phase_end(self.word, 0)
                    set_advance(self.advances, i, self.word, 0, part, self.rows, row)
        self.knot = knot
        self.queued = knot
        self.closed = False
        return True

    def _lose(self, k):
        """Adapt a knot to being reached `lost` ticks later, as slow() has it. k: its place."""
        r = self.r
        self.times[k] = after(self.times[k], self.lost)
        reals.put(r, registers.SPARE, self.way - 2 * self.lost, 0)
        reals.put(r, registers.V_HERE, self.way, 0)
        reals.divide(r, registers.SPARE, registers.SPARE, registers.V_HERE)
        self._share(self.marks, 4 * k + 2)
        for i in range(registers.AXES):
            if self.motor[i]:
                self._share(self.speeds, ROW * k + 2 * i)

    def _share(self, kept, i):
        """Multiply the real number kept[i] by SPARE."""
        r = self.r
        reals.fetch(r, registers.V_HERE, kept, i)
        reals.multiply(r, registers.V_HERE, registers.V_HERE, registers.SPARE)
        reals.fetch(kept, i, r, registers.V_HERE)
