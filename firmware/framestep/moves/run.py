"""MSG_RT_RUN_MOVE: a section of the move, live, with pre-roll and post-roll, once or in a loop.

A pass is a list of phases for each motor: pre-roll, one cubic per frame, post-roll. The phases of
all motors have the same durations, so the motors only have to start in the same tick to stay
together.

Time. Frame N of a pass, counted from 0 at the first frame played, begins round(N · 10^9 /
fps_milli) microseconds after the first. Durations are differences of such times, so that rounding
does not add up.

Ping-pong: the next pass runs the other way. The ramp that ends a pass and the one that begins the
next have the same duration, so the motors turn where they are. Loop: the motors go back to where
the pass began, by ramps of their own, and run again.

The last pass (field note 6.11): the end frame lasts its period, in which the motors keep their
velocity; the post-roll follows. When the motors stand, RT_END is due, and they go back to the end
frame as by POSITION_FRAME.
"""

from array import array

from framestep.clock import HALF, after, elapsed, reached
from framestep.motion import reals, stepper
from framestep.motion.compute import compute
from framestep.motion.formula import formula
from framestep.motors.motor import MAX_ACCELERATION
from framestep.moves import registers
from framestep.moves.frame_clock import MICROSECONDS, FrameClock
from framestep.moves.move_check import FASTEST_FPS
from framestep.moves.operation import Operation
from framestep.moves.player import frame_velocity
from framestep.moves.registers import FRAME_TICKS, LONGER_FRAME_TICKS, ROLL_TICKS, ZERO, X, Y
from framestep.moves.upload_store import READY as UPLOADED
from framestep.native import const
from framestep.results import (
    ERR_GENERAL,
    ERR_NOT_IN_POSITION,
    ERR_POSTROLL,
    ERR_PREROLL,
    ERR_RANGE,
    EXCEEDED_POSTROLL,
    EXCEEDED_PREROLL,
    OK,
)

LONGEST_ROLL = const(600000)  # ms
DEFAULT_OPEN = const(90)  # degrees, for stills whose request has no angles (field note 6.9)
DEFAULT_CLOSE = const(180)
_AHEAD = const(3)  # phases that wait before the next is queued

# From microseconds
_FRAME_TICKS = formula(
    registers,
    """
    LONGER_FRAME_TICKS = (FRAME_TICKS + 1) / THOUSAND
    FRAME_TICKS = FRAME_TICKS / THOUSAND
    """,
)
# How long a motor waits whose ramp is shorter than X.
_WAIT = formula(
    registers,
    """
    X = X - ROLL_TICKS
    assert X > ZERO
    """,
)
# The shortest ramp between rest and the velocity X, with the acceleration Y: 2 ms at least, since
# the next phase must not begin in the tick in which the ramp does.
_SHORTEST_RAMP = formula(
    registers,
    """
    assert max(X, -X) > ZERO
    ROLL_TICKS = max(max(X, -X) / Y, 2)
    """,
)


class Plan:
    """What a request asks for, and what has been found for it.

    There are two, so that a refusal changes nothing.
    """

    def __init__(self, motors):
        self.bits = 0
        self.first = 0  # index of the first frame played
        self.step = 1  # 1 forward, -1 backward
        self.frames = 0  # frames after the first
        self.fps_milli = 0
        self.pre_asked = 0  # ms, 0 for the shortest possible
        self.post_asked = 0
        self.pre_ms = 0  # from the start to the first frame
        self.post_ms = 0  # from the end of the last frame to the end
        self.pre_rolls = array("i", [0] * (2 * motors))  # reals, by motor: its ramp, in ticks
        self.post_rolls = array("i", [0] * (2 * motors))
        self.loops = False  # pass after pass from the start,
        self.turns = False  # or there and back (ping-pong), until STOP_LOOP
        self.video = False  # a video camera runs during the pass,
        self.stills = False  # or the shutter opens at each frame
        self.open_angle = 0
        self.close_angle = 0
        self.sync = False
        self.bloop_bits = 0
        self.bloop_channel = 0
        self.bloop_ms = 0
        self.begins = array("i", [0] * motors)  # by motor: where it waits,
        self.begin_directions = array(
            "i", [0] * motors
        )  # and the direction in which it sets out: 1 up, -1 down, 0 not at all
        # where it comes to rest after a pass other than the last,
        self.ends = array("i", [0] * motors)
        # and the direction in which it sets out when played the other way
        self.end_directions = array("i", [0] * motors)


class RunMove(Operation):
    """The operation; see operation.Operation."""

    def __init__(self, operations, run_outputs):
        Operation.__init__(self, operations)
        self.player = operations.player
        self.store = operations.store
        self.run_outputs = run_outputs  # lights, triggers and camera: moves/run_outputs.py
        self.plan = Plan(operations.axes.count)
        self.draft = Plan(operations.axes.count)
        self.looping = False
        self.first = 0  # of this pass: ping-pong turns
        self.step = 1
        self.begin_ms = 0
        self.end_ms = 0
        self.queued = 0
        self.unclosed = 0  # bits of motors that have yet to get their post-roll
        self.period = FRAME_TICKS  # register of the end frame's duration
        self.last_pass = False
        self.closed = False
        self.reported = 0
        self.queue_clock = FrameClock()
        self.report_clock = FrameClock()
        # by motor, for the last pass: where it is at the end of the end frame, and where it comes
        # to rest
        self.lasts = array("i", [0] * operations.axes.count)
        self.rests = array("i", [0] * operations.axes.count)
        self.end = 0  # index of the frame with which the last pass queued ends

    # ---------------------------------------------------------------- the request

    def prepare(self, fps_milli, start, end, pre_ms, post_ms, open_angle, close_angle):
        """Check a run of scene frames start … end and send the motors to where it begins.

        pre_ms, post_ms: 0 for the shortest that each motor can do. A code; only OK changes
        anything. open_angle, close_angle: of the shutter, 0 … 360 degrees, for stills. The caller
        has filled in the draft's loops, turns, video, stills, sync and bloop fields.
        """
        store = self.store
        player = self.player
        if store.state != UPLOADED:
            return ERR_GENERAL
        if fps_milli < 1 or fps_milli > FASTEST_FPS or pre_ms < 0 or post_ms < 0:
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
        if open_angle >= close_angle:  # field note 6.9: as if there were none
            open_angle = DEFAULT_OPEN
            close_angle = DEFAULT_CLOSE
        plan.open_angle = open_angle
        plan.close_angle = close_angle
        code = self._settle(plan)
        if code == OK:
            code = self.operations.blocked(plan.bits, plan.begins)
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

    def _settle(self, plan):
        """Check what a plan asks for and find where the motors begin and end. Returns a code."""
        player = self.player
        fps_milli = plan.fps_milli
        player.set_frame_rate(fps_milli)
        self._durations(fps_milli)
        last = plan.first + plan.step * plan.frames
        self._find_directions(plan, plan.begin_directions, plan.first, plan.step)
        self._find_directions(plan, plan.end_directions, last, -plan.step)
        code = player.check(
            plan.bits, plan.first, plan.frames + 1, fps_milli, plan.step, plan.begin_directions
        )
        if code == OK and plan.turns:
            code = player.check(
                plan.bits, last, plan.frames + 1, fps_milli, -plan.step, plan.end_directions
            )
        if code == OK:
            code = self._rolls(plan, plan.pre_asked, plan.post_asked)
        return code

    def _restore(self):
        """The draft has been refused: set the registers for the plan again."""
        if self.plan.fps_milli:
            self.player.set_frame_rate(self.plan.fps_milli)
            self._durations(self.plan.fps_milli)

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
        code = self._settle(plan)
        if code == OK and waiting:
            for motor in range(player.count):
                if (plan.bits >> motor) & 1 and not player.axes[motor].stands_on(
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

    def heading(self, motor):
        plan = self.plan
        position = self.player.position
        self.store.position(motor, plan.first, position, 0)
        return reals.order_words(position, 0, plan.begins, motor) or self.player.first_direction(
            motor, plan.first, plan.step, plan.frames + 1, True
        )

    def _find_directions(self, plan, directions, index, step):
        """directions[motor] = the direction in which it sets out, played from `index` in direction
        `step`."""
        player = self.player
        r = player.numbers
        for motor in range(player.count):
            directions[motor] = 0
            if (plan.bits >> motor) & 1 and plan.frames and player.axes[motor].backlash:
                player.velocity(X, motor, index, step)
                directions[motor] = reals.sign(r, X) or player.first_direction(
                    motor, index, step, plan.frames + 1
                )

    def _rolls(self, plan, pre_ms, post_ms):
        """Find where the motors wait and where they come to rest (field note 6.2)."""
        player = self.player
        r = player.numbers
        last = plan.first + plan.step * plan.frames
        plan.pre_ms = self._roll_times(plan, plan.first, pre_ms, plan.pre_rolls)
        plan.post_ms = self._roll_times(plan, last, post_ms, plan.post_rolls)
        for motor in range(player.count):
            if (plan.bits >> motor) & 1:
                self.store.position(motor, plan.first, plan.begins, motor)
                self.store.position(motor, last, plan.ends, motor)
                if not plan.frames:
                    continue
                own = frame_velocity(motor)
                player.velocity(own, motor, plan.first, plan.step)
                reals.fetch(r, ROLL_TICKS, plan.pre_rolls, 2 * motor)
                if not player.apply_roll(motor, own, ROLL_TICKS, True, plan.begins):
                    return player.blame_roll(
                        EXCEEDED_PREROLL, motor, plan.first, ERR_PREROLL, own, ROLL_TICKS
                    )
                player.velocity(own, motor, last, plan.step)
                reals.fetch(r, ROLL_TICKS, plan.post_rolls, 2 * motor)
                if (plan.loops or plan.turns) and not player.apply_roll(
                    motor, own, ROLL_TICKS, False, plan.ends
                ):
                    return player.blame_roll(
                        EXCEEDED_POSTROLL, motor, last, ERR_POSTROLL, own, ROLL_TICKS
                    )
                if not self._last(motor, last):
                    return player.blame_roll(
                        EXCEEDED_POSTROLL, motor, last, ERR_POSTROLL, own, ROLL_TICKS
                    )
                if plan.turns:
                    player.velocity(own, motor, plan.first, -plan.step)
                    reals.fetch(r, ROLL_TICKS, plan.pre_rolls, 2 * motor)
                    if not self._last(motor, plan.first):
                        return player.blame_roll(
                            EXCEEDED_POSTROLL, motor, plan.first, ERR_POSTROLL, own, ROLL_TICKS
                        )
        return OK

    def _last(self, motor, index):
        """Find where a motor is at the end of the last frame, `index`, and where it comes to rest.

        It keeps frame_velocity(motor) through the frame's period and then takes ROLL_TICKS to
        stop. False where that is past a limit or steeper than the motor can.
        """
        player = self.player
        r = player.numbers
        lasts = self.lasts
        self.store.position(motor, index, lasts, motor)
        reals.multiply(r, X, frame_velocity(motor), FRAME_TICKS)
        if not player.shift_by_x(lasts, motor, False):
            return False
        reals.copy_word(self.rests, motor, lasts, motor)
        return player.apply_roll(motor, frame_velocity(motor), ROLL_TICKS, False, self.rests)

    def _durations(self, fps_milli):
        """Set FRAME_TICKS and LONGER_FRAME_TICKS."""
        r = self.player.numbers
        reals.put(r, FRAME_TICKS, MICROSECONDS // fps_milli, 0)
        compute(0, 0, r, _FRAME_TICKS)

    def _roll_times(self, plan, index, ms, rolls):
        """rolls = ticks for which each motor ramps between rest and its velocity at frame `index`.

        ms: for all motors; 0: as long as each needs with its acceleration (field note 6.2),
        two at least. Returns the longest in whole ms.
        """
        player = self.player
        r = player.numbers
        longest = ms
        for motor in range(player.count):
            if (plan.bits >> motor) & 1:
                reals.put(r, ROLL_TICKS, ms, 0)
                if ms == 0 and plan.frames:
                    player.velocity(X, motor, index, plan.step)
                    reals.fetch(r, Y, player.axes[motor].numbers, MAX_ACCELERATION)
                    if compute(0, 0, r, _SHORTEST_RAMP):
                        longest = max(longest, reals.floor(r, ROLL_TICKS, LONGEST_ROLL) + 1)
                reals.fetch(rolls, 2 * motor, r, ROLL_TICKS)
        return longest

    def stop_loop(self):
        """Make this pass the last one (spec: MSG_RT_STOP_LOOP).

        On the way back to the start none follows.
        """
        self.looping = False
        self.run_outputs.close()

    # ---------------------------------------------------------------- the pass

    def begin_pass(self):
        player = self.player
        plan = self.plan
        player.set_frame_rate(plan.fps_milli)
        self._durations(plan.fps_milli)
        self.queue_clock.begin(plan.fps_milli, 0)
        self.queued = 0
        self.unclosed = 0
        self.closed = False
        self.reported = 0

    def queue_first_phases(self, motor):
        player = self.player
        plan = self.plan
        r = player.numbers
        axis = player.axes[motor]
        onward = self.step == plan.step
        own = frame_velocity(motor)
        if plan.frames:
            player.velocity(own, motor, self.first, self.step)
        else:
            reals.put(r, own, 0, 0)
        reals.fetch(r, ROLL_TICKS, plan.pre_rolls if onward else plan.post_rolls, 2 * motor)
        # motors with a shorter ramp wait, so that all reach the first frame at the same time
        reals.put(r, X, self.begin_ms, 0)
        if compute(0, 0, r, _WAIT):
            axis.append_coasting_phase(
                X, ZERO, ZERO, r, plan.begins if onward else plan.ends, motor
            )
        if reals.sign(r, ROLL_TICKS):
            self.store.position(motor, self.first, player.position, 0)
            axis.append_coasting_phase(ROLL_TICKS, ZERO, own, r, player.position, 0)

    def started(self, tick):
        first = after(tick, self.begin_ms)
        self.report_clock.begin(self.plan.fps_milli, first)
        self.operations.axes.alarm(first)
        self.run_outputs.begin(self.plan, self.first, self.step, tick, first, not self.looping)

    def feed(self):
        self.run_outputs.feed()
        if self.closed:
            return False
        if self.unclosed:
            self._close()
            return True
        if self.bits:
            if self.player.phases_ahead(self.bits) >= _AHEAD:
                return False
        elif self.queued > self.reported:  # lights alone: no queue fills up
            return False
        self._queue()
        return True

    def _queue(self):
        """Append the cubic to the next frame to each motor; after the last frame the post-roll."""
        player = self.player
        plan = self.plan
        k = self.queued + 1
        duration = LONGER_FRAME_TICKS if self.queue_clock.longer() else FRAME_TICKS
        if k > plan.frames:
            self.period = duration
            self.end = self.first + self.step * plan.frames
            self.last_pass = not self.looping
            self.unclosed = plan.bits
            self._close()
            return
        self.queued = k
        player.append_frame(plan.bits, self.first + self.step * k, self.step, duration)

    def _close(self):
        """Append the post-roll of the next motor, in the last pass after the end frame's period."""
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
            own = frame_velocity(motor)
            reals.fetch(r, ROLL_TICKS, plan.post_rolls if onward else plan.pre_rolls, 2 * motor)
            if self.last_pass:
                self._last(motor, self.end)
                axis.append_coasting_phase(self.period, own, own, r, self.lasts, motor)
                positions = self.rests
            if reals.sign(r, ROLL_TICKS):
                axis.append_coasting_phase(ROLL_TICKS, own, ZERO, r, positions, motor)
        if not self.unclosed:
            player.end_phases(plan.bits)
            self.closed = True

    def play_head(self, tick, frame):
        reported = self.reported
        here = self.store.start + self.first + self.step * (reported - 1)  # the frame reported last
        if reported == 0:
            return (here + self.step) * 1000  # in the pre-roll
        clock = self.report_clock
        kernel = self.operations.axes.kernel.state
        # ticks to the next frame to be reported
        ahead = elapsed(clock.tick, tick + 1 + kernel[stepper.LEAD])
        last = reported > self.plan.frames
        if ahead >= HALF or ahead == 0 and clock.us == 0:
            if last:
                return here * 1000
            # it has been reached in this pass: before it is reported, nothing beyond it is
            here += self.step
            left = clock.quotient
        else:
            left = ahead * 1000 + clock.us
            if last and left < clock.quotient:
                return here * 1000
        if frame or left >= clock.quotient:
            self.operations.reported_frame = here - self.store.start
            return here * 1000
        if left < 0x100000:
            part = left * 1000 // clock.quotient
        else:
            part = left // (clock.quotient // 1000)
        return here * 1000 + self.step * (1000 - part)

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

    def next_pass(self):
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
