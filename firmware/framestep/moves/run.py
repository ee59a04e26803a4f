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
from framestep.motion import reals
from framestep.motion.compute import compute
from framestep.motion.formula import formula
from framestep.motors.motor import MAX_ACCELERATION
from framestep.moves.frame_clock import FrameClock
from framestep.moves.path import registers
from framestep.moves.path.registers import (
    FRAME_SPEED,
    FRAME_TICKS,
    LONGER_FRAME_TICKS,
    ROLL_TICKS,
    SPEEDS,
    TOPS,
    ZERO,
)
from framestep.moves.run_plan import PreparedRun
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


class RunMove(PreparedRun):
    """A RUN_MOVE; see operation.Operation."""

    def __init__(self, operations, run_outputs):
        PreparedRun.__init__(self, operations)
        self.run_outputs = run_outputs  # lights, triggers and camera: moves/run_outputs.py
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
        self.set_durations(plan.fps_milli)
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
                self.find_end(motor, self.end)
                axis.append_coasting_phase(self.period, own, own, r, self.lasts, motor, 0, beyond)
                positions = self.rests
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
        self.operations.return_to_frame(self.store.start + self.end, self.lasts, self.bits)
