"""MSG_RT_RUN_MOVE: a section of the move in real time, with pre-roll and post-roll, once or in a
loop.

A lap is a list of phases for each motor: pre-roll, one cubic per frame, post-roll. All motors'
phases have the same durations, so the motors stay together if they start in the same tick.

Time. Frame N of a lap, counted from 0 at the first frame played, begins round(N · 10^9 /
fps_milli) microseconds after the first. Durations are differences of such times, so that rounding
errors do not add up.

Ping-pong: the next lap runs in the other direction. The ramp that ends a lap and the one that
begins the next have the same duration, so the motors turn where they are. Loop: the motors go back
to where the lap began, by ramps of their own, and run again.

The last lap (field note 6.11): the end frame lasts its period, in which the motors keep their
velocity, and the post-roll follows. When the motors are at rest, RT_END is due, and they go back to
the end frame as in POSITION_FRAME.
"""

from framestep.base.clock import HALF, after, elapsed, reached
from framestep.base.native import const, micropython, ptr32
from framestep.base.results import ERR_GENERAL, ERR_NOT_IN_POSITION, ERR_RANGE, OK
from framestep.motion import reals
from framestep.motion.compute import compute
from framestep.motion.formula import formula
from framestep.motors.rates import MAX_ACCELERATION
from framestep.moves.frame_clock import FrameClock
from framestep.moves.frame_positions import find_blocking_switch
from framestep.moves.operation import Operation
from framestep.moves.path import registers
from framestep.moves.path.move_check import FASTEST_FPS
from framestep.moves.path.registers import (
    FRAME_SPEED,
    FRAME_TICKS,
    LONGER_FRAME_TICKS,
    ROLL_TICKS,
    SPEEDS,
    TOPS,
    ZERO,
)
from framestep.moves.run_plan import (
    DEFAULT_CLOSE,
    DEFAULT_OPEN,
    LONGEST_ROLL,
    Plan,
    RunPlanner,
)
from framestep.moves.upload.store import READY as UPLOADED
from framestep.pulse import stepper

_AHEAD = const(3)  # the next phase is queued when fewer than this wait
# Smoothing a frame takes 0.4 ms a motor, so these motors get theirs in the next pass, or a host
# would wait.
_LATER = const(0x3FFFFFF0)

# Whether a ramp of ROLL_TICKS between rest and a velocity may be a step longer or shorter than
# one of constant acceleration, or one and a half with the rounding of its other end: 6 times that,
# over ROLL_TICKS², is added to its acceleration at one end and taken from it at the other. It keeps
# within the acceleration, and no part of it is faster than that velocity or the motor's, `top`.
_GENTLE_RAMP = formula(
    registers,
    "velocity, top, acceleration",
    """
    speed = max(velocity, -velocity)
    assert (ROLL_TICKS * acceleration - speed) * ROLL_TICKS >= 9
    assert max(speed, 4 * (top - speed)) * ROLL_TICKS >= 9
    """,
)
# Waiting time of a motor whose ramp is shorter than the lap's.
_WAIT = formula(
    registers,
    "ramp -> ticks",
    """
    ticks = ramp - ROLL_TICKS
    assert ticks > ZERO
    """,
)


class RunMove(Operation):
    """A RUN_MOVE; see operation.Operation. run_outputs: lights, triggers and camera."""

    def __init__(self, operations, run_outputs):
        Operation.__init__(self, operations)
        self.player = operations.player
        self.store = operations.store
        self.run_outputs = run_outputs
        self.planner = RunPlanner(self.player, operations.move_check)
        self.plan = Plan(self.player.count)
        self.draft = Plan(self.player.count)
        self.looping = False
        self.first = 0  # of this lap: ping-pong alternates
        self.step = 1
        self.begin_ms = 0
        self.end_ms = 0
        self.queued = 0
        self.unclosed = 0  # bits of motors that have yet to get their post-roll
        self.unqueued = 0  # bits of motors that have yet to get the queued frame
        self.period = FRAME_TICKS  # register with the queued frame's duration
        self.last = False  # the queued lap is the last one
        self.closed = False
        self.reported = 0
        self.clock = FrameClock()  # of the queued frames
        self.report_clock = FrameClock()
        self.end = 0  # index of the frame at the end of the last queued lap

    # ---------------------------------------------------------------- the request

    def prepare(self, fps_milli, start, end, pre_ms, post_ms, open_angle, close_angle):
        """Check a run of scene frames start … end, and move the motors to where it begins.

        pre_ms, post_ms: 0 for the shortest that each motor can do. open_angle, close_angle: of the
        shutter, 0 … 360 degrees, for stills. The caller has filled in the draft's loops, turns,
        video, stills, sync and bloop fields. Return a code; nothing changes unless it is OK.
        """
        store = self.store
        player = self.player
        if store.state != UPLOADED:
            return ERR_GENERAL
        if fps_milli > FASTEST_FPS:
            return self.planner.move_check.refuse_rate(fps_milli)
        if fps_milli < 1 or pre_ms < 0 or post_ms < 0:
            return ERR_RANGE
        if pre_ms > LONGEST_ROLL or post_ms > LONGEST_ROLL or open_angle > 360 or close_angle > 360:
            return ERR_RANGE
        if start < store.start or start > store.end or end < store.start or end > store.end:
            return ERR_RANGE
        plan = self.draft
        plan.bits = player.motors()
        plan.pre_asked = pre_ms
        plan.post_asked = post_ms
        plan.first = start - store.start
        plan.step = -1 if end < start else 1
        plan.frames = (end - start) * plan.step
        plan.fps_milli = fps_milli
        if open_angle >= close_angle:  # field note 6.9: as if the request had none
            open_angle = DEFAULT_OPEN
            close_angle = DEFAULT_CLOSE
        plan.open_angle = open_angle
        plan.close_angle = close_angle
        code = self.planner.settle(plan)
        if code == OK:
            code = find_blocking_switch(self.player, self.operations.safety, plan.bits, plan.begins)
        if code != OK:
            self._restore()
            return code
        self.draft = self.plan
        self.plan = plan
        self.bits = plan.bits
        self.first = plan.first
        self.step = plan.step
        self.begin_ms = plan.pre_ms
        self.end_ms = plan.post_ms
        self.looping = plan.loops or plan.turns
        self.operations.prepare(self, plan.begins, plan.begin_directions, start)
        return OK

    def recheck(self, waiting):
        player = self.player
        old = self.plan
        plan = self.draft
        plan.bits = player.motors() if waiting else old.bits
        plan.pre_asked = old.pre_asked
        plan.post_asked = old.post_asked
        plan.first = old.first
        plan.step = old.step
        plan.frames = old.frames
        plan.fps_milli = old.fps_milli
        plan.loops = old.loops
        plan.turns = old.turns
        plan.video = old.video
        plan.stills = old.stills
        plan.open_angle = old.open_angle
        plan.close_angle = old.close_angle
        plan.sync = old.sync
        plan.bloop_bits = old.bloop_bits
        plan.bloop_channel = old.bloop_channel
        plan.bloop_ms = old.bloop_ms
        code = self.planner.settle(plan)
        if code == OK and waiting:
            for motor in range(player.count):
                if (plan.bits >> motor) & 1 and not player.axes[motor].rests_on(
                    plan.begins, motor, plan.begin_directions[motor]
                ):
                    code = ERR_NOT_IN_POSITION
        if code != OK:
            self._restore()
            return code
        self.draft = old
        self.plan = plan
        self.bits = plan.bits
        onward = self.step == plan.step
        self.begin_ms = plan.pre_ms if onward else plan.post_ms
        self.end_ms = plan.post_ms if onward else plan.pre_ms
        self.operations.start_positions = plan.begins if onward else plan.ends
        self.operations.directions = plan.begin_directions if onward else plan.end_directions
        return OK

    def _restore(self):
        """After a refusal of the draft, set the registers for the plan again."""
        if self.plan.fps_milli:
            self.player.set_frame_rate(self.plan.fps_milli)
            self.planner.set_durations(self.plan.fps_milli)

    def heading(self, motor):
        plan = self.plan
        position = self.player.position
        self.store.position(motor, plan.first, position, 0)
        return reals.order_words(position, 0, plan.begins, motor) or self.player.first_direction(
            motor, plan.first, plan.step, plan.frames + 1, True
        )

    def stop_loop(self):
        """Make this lap the last one (spec: MSG_RT_STOP_LOOP).

        While the motors go back to the start, no further lap follows.
        """
        self.looping = False
        self.run_outputs.close()

    # ---------------------------------------------------------------- the lap

    def begin_lap(self):
        player = self.player
        plan = self.plan
        player.set_frame_rate(plan.fps_milli)
        self.planner.set_durations(plan.fps_milli)
        self.clock.begin(plan.fps_milli, 0)
        self.queued = 0
        self.unclosed = 0
        self.unqueued = 0
        self.closed = False
        self.reported = 0

    def queue_first_phases(self, motor):
        player = self.player
        plan = self.plan
        r = player.numbers
        axis = player.axes[motor]
        onward = self.step == plan.step
        own = SPEEDS + 2 * motor
        beyond = 0
        if plan.frames:
            beyond = player.velocity(own, motor, self.first, self.step)
        else:
            reals.put(r, own, 0, 0)
        reals.fetch(r, ROLL_TICKS, plan.pre_rolls if onward else plan.post_rolls, 2 * motor)
        # motors with a shorter ramp wait, so that all reach the first frame together
        reals.put(r, _WAIT.ramp, self.begin_ms, 0)
        if compute(r, _WAIT):
            axis.append_coasting_phase(
                _WAIT.ticks, ZERO, ZERO, r, plan.begins if onward else plan.ends, motor
            )
        if reals.sign(r, ROLL_TICKS):
            self.store.position(motor, self.first, player.position, 0)
            beyond = self._possible(beyond, motor)
            axis.append_coasting_phase(ROLL_TICKS, ZERO, own, r, player.position, 0, 0, beyond)

    def started(self, tick):
        first = after(tick, self.begin_ms)
        self.report_clock.begin(self.plan.fps_milli, first)
        self.operations.axes.alarm(first)
        self.run_outputs.begin(self.plan, self.first, self.step, tick, first, not self.looping)

    def feed(self):
        self.run_outputs.feed()
        if self.closed:
            return False
        if self.unqueued:
            self._append(self.unqueued)
            self.unqueued = 0
            return True
        if self.unclosed:
            self._close()
            return True
        if self.bits:
            if self.player.phases_ahead(self.bits) >= _AHEAD:
                return False
        elif self.queued > self.reported:  # only lights: there are no queues that fill up
            return False
        self._queue()
        return True

    def _queue(self):
        """Append the cubic up to the next frame to each motor; after the last one the post-roll."""
        player = self.player
        plan = self.plan
        k = self.queued + 1
        duration = LONGER_FRAME_TICKS if self.clock.longer() else FRAME_TICKS
        self.period = duration
        if k > plan.frames:
            self.end = self.first + self.step * plan.frames
            self.last = not self.looping
            self.unclosed = plan.bits
            self._close()
            return
        self.queued = k
        bits = plan.bits
        if player.view is player.values:  # smoothing
            self.unqueued = bits & _LATER
            bits ^= self.unqueued
        self._append(bits)

    def _append(self, bits):
        """Append the cubic up to the queued frame to these motors."""
        player = self.player
        player.axes.hal.port.glance()
        player.append_frame(
            bits,
            self.first + self.step * self.queued,
            self.step,
            self.period,
            registers.SCALE,
            player.view,
            player.curve,
        )

    def _close(self):
        """Append the next motor's post-roll; in the last lap first the end frame's period."""
        player = self.player
        r = player.numbers
        plan = self.plan
        bits = self.unclosed
        if bits:
            motor = 0
            while not (bits >> motor) & 1:
                motor += 1
            self.unclosed = bits ^ (1 << motor)
            onward = self.step == plan.step
            positions = plan.ends if onward else plan.begins
            axis = player.axes[motor]
            own = SPEEDS + 2 * motor
            reals.fetch(r, ROLL_TICKS, plan.post_rolls if onward else plan.pre_rolls, 2 * motor)
            if self.last:
                beyond = 0
                if plan.frames:
                    beyond = self._possible(
                        player.velocity(FRAME_SPEED, motor, self.end, self.step), motor
                    )
                self.planner.find_end(motor, self.end)
                axis.append_coasting_phase(
                    self.period, own, own, r, self.planner.lasts, motor, 0, beyond
                )
                positions = self.planner.rests
            if reals.sign(r, ROLL_TICKS):
                axis.append_coasting_phase(ROLL_TICKS, own, ZERO, r, positions, motor)
        if not self.unclosed:
            player.end_phases(plan.bits)
            self.closed = True

    def _possible(self, beyond, motor):
        """Return how far beyond an end of the lap the motor may go: 0 if its ramp to or from there,
        in ROLL_TICKS, would exceed its limits."""
        r = self.player.numbers
        reals.copy(r, _GENTLE_RAMP.velocity, SPEEDS + 2 * motor)
        reals.copy(r, _GENTLE_RAMP.top, TOPS + 2 * motor)
        numbers = self.player.axes[motor].numbers
        reals.fetch(r, _GENTLE_RAMP.acceleration, numbers, MAX_ACCELERATION)
        return beyond if compute(r, _GENTLE_RAMP) else 0

    @micropython.viper
    def play_head(self, tick: int, frame: int) -> int:
        reported = int(self.reported)
        step = int(self.step)
        begin = int(self.store.start)
        here = begin + int(self.first) + step * (reported - 1)  # last frame reported
        if reported == 0:
            return (here + step) * 1000  # in the pre-roll
        operations = self.operations
        clock = self.report_clock
        us = int(clock.us)
        quotient = int(clock.quotient)
        kernel = ptr32(operations.axes.kernel.state)
        # ticks to the next frame to be reported
        ahead = elapsed(int(clock.tick), tick + 1 + kernel[stepper.LEAD])
        last = reported > int(self.plan.frames)
        left = ahead * 1000 + us if ahead < HALF else 0
        if left == 0:
            if not last:
                # it is reached, but not yet reported: do not count beyond it
                here += step
                left = quotient
            elif not frame:
                return here * 1000
        elif last and left < quotient and not frame:
            return here * 1000
        if frame or left >= quotient:
            operations.reported_frame = here - begin
            return here * 1000
        if left < 0x100000:
            part = left * 1000 // quotient
        else:
            part = left // (quotient // 1000)
        return here * 1000 + step * (1000 - part)

    def frame_reached(self, ticks):
        clock = self.report_clock
        if self.reported > self.plan.frames or not reached(ticks, clock.tick + 1):
            return False
        self.operations.move_time = (
            self.store.start + self.first + self.step * self.reported
        ) * 1000
        self.reported += 1
        clock.advance()
        self.operations.axes.alarm(clock.tick if self.reported <= self.plan.frames else -1)
        return True

    def finished(self):
        return self.closed and self.reported > self.plan.frames and self.run_outputs.finished()

    def still_wanted(self):
        return self.looping

    def next_lap(self):
        if not self.looping:
            return False
        plan = self.plan
        if plan.turns:
            self.first += self.step * plan.frames
            self.step = -self.step
            self.begin_ms, self.end_ms = self.end_ms, self.begin_ms
            onward = self.step == plan.step
            self.operations.start_positions = plan.begins if onward else plan.ends
            self.operations.directions = plan.begin_directions if onward else plan.end_directions
        return True

    def ended(self):
        self.looping = False
        self.run_outputs.end()

    def leave_end(self):
        self.operations.return_to_frame(self.store.start + self.end, self.planner.lasts, self.bits)
