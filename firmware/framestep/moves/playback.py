"""Real-time play of an uploaded move: to the pre-roll position, wait for GO, run, tell each frame.

                 prepare()                   all there                go()
    IDLE ----------------------> POSITIONING ---------> READY ----------------> RUNNING
      ^                               |                   |                        |
      |            stop()             |                   |       stop(), fault    | last phase out
      +---- ENDING <------------------+-------------------+------------------------+
             all at rest: RT_END

A run is one list of phases per motor: pre-roll, one cubic per frame, post-roll. All motors have the
same phases in time, so they need no further synchronization than to start in the same tick.

Time. Frame N of a run begins round(N · 10^9 / fps_milli) microseconds after its first
(design rule; N counts from 0 at the first frame played); durations are differences of such times,
so nothing adds up.
"""

from array import array

from framestep.motion import axes as motion
from framestep.motion import reals, stepper
from framestep.moves import path
from framestep.moves.store import READY as UPLOADED
from framestep.native import const
from framestep.protocol.messages import (
    ERR_GENERAL,
    ERR_MOVING,
    ERR_NOT_IN_POSITION,
    ERR_POSTROLL,
    ERR_PREROLL,
    ERR_RANGE,
    ERR_SOFT_LOW,
    ERR_SOFT_UP,
    OK,
)

# States
IDLE = const(0)
POSITIONING = const(1)
READY = const(2)
RUNNING = const(3)
ENDING = const(4)  # ramping down or running out: RT_END follows

FASTEST_FPS = const(200000)  # thousandths of a frame per second: a frame of 5 ms
LONGEST_ROLL = const(600000)  # ms
_MICROSECONDS = const(1000000000)  # in 1000 seconds
_WRAP = const(0x3FFFFFFF)
_HALF = const(0x20000000)
_FAR = const(0x3FFFFFFF)  # stands for no soft limit
_BATCH = const(32)  # frames checked at a time
_AHEAD = const(3)  # frames of phases to keep ahead
_SEGMENTS_AHEAD = const(12)

# Registers
_THOUSAND = const(0)
_DURATION = const(2)  # of a frame in ticks, the shorter and the longer one
_DURATION_PLUS = const(4)
_SCALE = const(6)  # twelfths of a step per frame to steps per tick: 1 / (12 · ticks)
_X = const(8)
_Y = const(10)
_T = const(12)
_ZERO = const(14)
_ROLL = const(16)  # pre-roll, then post-roll, in ticks
_SPEEDS = const(18)  # per motor: velocity at the last frame queued


class Run:
    """What a request for a run has settled."""

    def __init__(self, motors):
        self.bits = 0  # motors that have a part in it
        self.first = 0  # index of the first frame played
        self.step = 1  # 1 forward, -1 backward
        self.frames = 0  # frames after the first
        self.fps_milli = 0
        self.quotient = 0  # of a frame's microseconds
        self.remainder = 0
        self.pre_ms = 0
        self.post_ms = 0
        self.begins = array("i", [0] * motors)  # where each motor waits
        self.ends = array("i", [0] * motors)  # where it comes to rest


class Playback:
    """Plays the moves of a store on the axes. One run at a time."""

    def __init__(self, axes, store):
        count = axes.count
        self.axes = axes
        self.store = store
        self.state = IDLE
        self.run = Run(count)
        self.draft = Run(count)  # a request that is refused leaves the run that waits as it was
        self.numbers = array("i", [0] * (_SPEEDS + 2 * count))
        self.window = array("i", [0] * path.WINDOW_WORDS)
        self.words = array("i", [0] * path.CHECK_WORDS)
        self.values = array("i", [0] * _BATCH)
        self.place = array("i", [0])
        self.excluded = 0  # motors that are not to run (disabled, under live control)
        self.queued = 0
        self.reported = 0  # frames told so far
        self.queue_error = 0  # of the rational frame time, for the frame to be queued
        self.report_error = 0  # the same for the frame to be told
        self.report_tick = 0
        self.report_us = 0
        self.move_time = 0  # thousandths of a scene frame
        self.ended = False  # RT_END is due
        reals.put(self.numbers, _THOUSAND, 1000, 0)

    # ---------------------------------------------------------------- what the controller asks

    @property
    def busy(self):
        """A run is being prepared, waits or runs: uploads and motion requests must wait."""
        return self.state != IDLE

    def position_frame(self, frame):
        """Send all motors to a frame (scene number). A code; nothing moves unless it is OK."""
        store = self.store
        if store.state != UPLOADED:
            return ERR_GENERAL
        if frame < store.start or frame > store.end:
            return ERR_RANGE
        axes = self.axes
        run = self.draft
        self._choose(run)
        for motor in range(axes.count):
            if run.bits >> motor & 1:
                store.position(motor, frame - store.start, run.begins, motor)
                side = axes[motor].outside(run.begins, motor)
                if side:
                    return ERR_SOFT_UP if side > 0 else ERR_SOFT_LOW
        self._go_to_begin(run)
        self.move_time = frame * 1000
        return OK

    def prepare(self, fps_milli, start, end, pre_ms, post_ms):
        """Check a run of scene frames start … end and send the motors to their pre-roll positions.

        A code; nothing has changed unless it is OK.
        """
        store = self.store
        if store.state != UPLOADED:
            return ERR_GENERAL
        if fps_milli < 1 or fps_milli > FASTEST_FPS or pre_ms < 0 or post_ms < 0:
            return ERR_RANGE
        if pre_ms > LONGEST_ROLL or post_ms > LONGEST_ROLL:
            return ERR_RANGE
        if start < store.start or start > store.end or end < store.start or end > store.end:
            return ERR_RANGE
        run = self.draft
        self._choose(run)
        run.first = start - store.start
        run.step = -1 if end < start else 1
        run.frames = (end - start) * run.step
        run.fps_milli = fps_milli
        run.quotient = _MICROSECONDS // fps_milli
        run.remainder = _MICROSECONDS % fps_milli
        self._scale(run)
        code = self._check(run)
        if code == OK:
            code = self._rolls(run, pre_ms, post_ms)
        if code != OK:
            self._scale(self.run)
            return code
        self.draft = self.run
        self.run = run
        self._go_to_begin(run)
        self.move_time = start * 1000
        self.state = POSITIONING
        self.ended = False
        return OK

    @property
    def running(self):
        """A run has begun and not yet ended."""
        return self.state == RUNNING or self.state == ENDING

    def takes(self, motor):
        """Whether the motor has a part in the run."""
        return self.run.bits >> motor & 1

    def may_go(self):
        """OK where a run waits and every motor stands where it is to begin; otherwise why not."""
        state = self.state
        if state != READY:
            if state == POSITIONING:
                return ERR_NOT_IN_POSITION
            return ERR_GENERAL if state == IDLE else ERR_MOVING
        run = self.run
        axes = self.axes
        for motor in range(axes.count):
            if run.bits >> motor & 1:
                axis = axes[motor]
                if axis.moving or not reals.equal_words(axis.block, stepper.POSITION, run.begins, motor):
                    return ERR_NOT_IN_POSITION
        return OK

    def go(self):
        """Start the run that waits; may_go() has said OK."""
        axes = self.axes
        run = self.run
        self._queue_start()
        self.state = RUNNING
        self._feed()
        kernel = axes.kernel.state
        irq = axes.hal.irq_off()
        begin = kernel[stepper.TICKS] + 1
        axes.release(run.bits)
        axes.hal.irq_on(irq)
        # the pulses come LEAD ticks after the tick that queues them
        self.report_tick = (begin + kernel[stepper.LEAD] + run.pre_ms) & _WRAP
        self.report_us = 0

    def stop(self, factor=1):
        """Ramp down whatever this moves; RT_END follows once all stand."""
        if self.state == IDLE:
            return
        for motor in range(self.axes.count):
            if self.run.bits >> motor & 1:
                self.axes[motor].stop(self.axes.hal, factor)
        self.state = ENDING

    def drop(self):
        """Forget a run that is prepared but does not move."""
        if self.state == READY or self.state == POSITIONING:
            self.state = IDLE

    def poll(self):
        """One pass: feed the queues. True where a frame has been reached that is to be told."""
        state = self.state
        if state == IDLE:
            return False
        if state == POSITIONING:
            if not self._moving():
                self.state = READY
            return False
        if state == READY:
            return False
        if state == RUNNING:
            self._feed()
            told = self._frame_reached()
            if self.reported > self.run.frames and not self._moving():
                self._end()
            return told
        if not self._moving():
            self._end()
        return False

    # ---------------------------------------------------------------- preparation

    def _choose(self, run):
        """The motors that have a part in this upload (field notes 3.1 and 5.4)."""
        run.bits = 0
        for motor in range(self.axes.count):
            if self.store.has(motor) and not self.excluded >> motor & 1:
                run.bits |= 1 << motor

    def _go_to_begin(self, run):
        axes = self.axes
        for motor in range(axes.count):
            if run.bits >> motor & 1:
                axes[motor].travel(axes.hal, run.begins, motor)

    def _scale(self, run):
        """The registers that follow from the frame rate."""
        if not run.fps_milli:
            return
        r = self.numbers
        reals.put(r, _DURATION, run.quotient, 0)
        reals.put(r, _DURATION_PLUS, run.quotient + 1, 0)
        reals.divide(r, _DURATION, _DURATION, _THOUSAND)
        reals.divide(r, _DURATION_PLUS, _DURATION_PLUS, _THOUSAND)
        # by the mean duration, 10^6 / fps_milli ticks, so that velocities do not feel the rounding
        reals.put(r, _X, run.fps_milli, 0)
        reals.put(r, _Y, path.TWELFTHS * 1000, 0)
        reals.divide(r, _X, _X, _Y)
        reals.divide(r, _SCALE, _X, _THOUSAND)

    def _slope(self, run, motor, k):
        """Fill the window around frame k of the run; the slope there, in twelfths."""
        store = self.store
        index = run.first + run.step * k
        last = store.end - store.start
        window = self.window
        store.positions(motor, index - 2, 5, window, path.FRAMES)
        before = index
        after = last - index
        if run.step < 0:
            path.turn(window)
            before = after
            after = index
        axis = self.axes[motor]
        if axis.lower_enabled:
            reals.copy_word(window, path.LOWER, axis.limits, motion.LOWER)
        else:
            window[path.LOWER] = -_FAR
        if axis.upper_enabled:
            reals.copy_word(window, path.UPPER, axis.limits, motion.UPPER)
        else:
            window[path.UPPER] = _FAR
        return path.slope(window, 2 if before > 2 else before, 2 if after > 2 else after)

    def _check(self, run):
        """Whether each motor can follow (field note 5.5), inside its soft limits."""
        r = self.numbers
        words = self.words
        values = self.values
        count = run.frames + 1
        begin = run.first if run.step > 0 else run.first - run.frames
        for motor in range(self.axes.count):
            if not run.bits >> motor & 1:
                continue
            axis = self.axes[motor]
            # What the limits allow from frame to frame, in steps. Positions are rounded to steps
            # before they come here, which alone makes differences of ±1 and changes of ±2.
            reals.put(r, _Y, run.fps_milli, 0)
            reals.divide(r, _Y, _Y, _THOUSAND)  # frames per second
            reals.put(r, _X, axis.velocity, 0)
            reals.divide(r, _X, _X, _Y)
            words[path.FASTEST] = reals.floor(r, _X, _HALF) + 1
            reals.put(r, _X, axis.acceleration, 0)
            reals.divide(r, _X, _X, _Y)
            reals.divide(r, _X, _X, _Y)
            words[path.STEEPEST] = reals.floor(r, _X, _HALF) + 2
            words[path.SEEN] = 0
            words[path.LOW_SET] = 1 if axis.lower_enabled else 0
            words[path.HIGH_SET] = 1 if axis.upper_enabled else 0
            reals.copy_word(words, path.LOWEST, axis.limits, motion.LOWER)
            reals.copy_word(words, path.HIGHEST, axis.limits, motion.UPPER)
            done = 0
            while done < count:
                batch = min(count - done, _BATCH)
                self.store.positions(motor, begin + done, batch, values, 0)
                found = path.check(words, values, batch)
                if found != path.FITS:
                    if found == path.TOO_FAST:
                        return ERR_RANGE
                    return ERR_SOFT_UP if found == path.TOO_HIGH else ERR_SOFT_LOW
                done += batch
        return OK

    def _velocity(self, run, to, motor, k):
        """numbers[to] = velocity at frame k of the run, steps per tick."""
        r = self.numbers
        reals.put(r, to, self._slope(run, motor, k) if run.frames else 0, 0)
        reals.multiply(r, to, to, _SCALE)

    def _rolls(self, run, pre_ms, post_ms):
        """Find where the motors wait and where they come to rest (field note 6.2)."""
        # With a roll of no time, all motors take as long as the slowest to gather speed needs.
        run.pre_ms = pre_ms if pre_ms else self._shortest_roll(run, 0)
        run.post_ms = post_ms if post_ms else self._shortest_roll(run, run.frames)
        for motor in range(self.axes.count):
            if run.bits >> motor & 1:
                if not self._roll(run, motor, 0, run.pre_ms, run.begins):
                    return ERR_PREROLL
                if not self._roll(run, motor, run.frames, run.post_ms, run.ends):
                    return ERR_POSTROLL
        return OK

    def _shortest_roll(self, run, k):
        """The milliseconds in which every motor can reach its velocity at frame k."""
        r = self.numbers
        longest = 0
        for motor in range(self.axes.count):
            if run.bits >> motor & 1:
                self._velocity(run, _X, motor, k)
                if reals.sign(r, _X) < 0:
                    reals.negate(r, _X, _X)
                if reals.sign(r, _X):
                    reals.fetch(r, _Y, self.axes[motor].numbers, motion.STEEP)
                    reals.divide(r, _X, _X, _Y)
                    longest = max(longest, reals.floor(r, _X, LONGEST_ROLL) + 1)
        return longest

    def _roll(self, run, motor, k, ms, places):
        """places[motor] = frame k's position, less or more half of its velocity times the time.

        False where that is past a soft limit or asks for more than the motor's acceleration.
        """
        r = self.numbers
        axis = self.axes[motor]
        self.store.position(motor, run.first + run.step * k, places, motor)
        if ms == 0:
            return True
        self._velocity(run, _X, motor, k)
        reals.put(r, _T, ms, 0)
        reals.divide(r, _Y, _X, _T)
        if reals.sign(r, _Y) < 0:
            reals.negate(r, _Y, _Y)
        reals.fetch(r, _ROLL, axis.numbers, motion.STEEP)
        if reals.compare(r, _Y, _ROLL) > 0:
            return False
        reals.multiply(r, _X, _X, _T)
        if k == 0:
            reals.negate(r, _X, _X)
        reals.put(r, _Y, 1, 0)
        reals.add(r, _X, _X, _Y)  # rounded: floor((v·T + 1) / 2)
        reals.double(r, _X, _X, -1)
        reals.add_word(places, motor, places, motor, reals.floor(r, _X, _HALF))
        return axis.beyond(places, motor) == 0

    # ---------------------------------------------------------------- the run

    def _queue_start(self):
        """The pre-roll of each motor, from where it waits to the first frame at speed."""
        r = self.numbers
        run = self.run
        reals.put(r, _ZERO, 0, 0)
        reals.put(r, _ROLL, run.pre_ms, 0)
        for motor in range(self.axes.count):
            if not run.bits >> motor & 1:
                continue
            axis = self.axes[motor]
            axis.prepare(self.axes.hal)
            axis.active = True
            axis.more = True
            speed = _SPEEDS + 2 * motor
            self._velocity(run, speed, motor, 0)
            if run.pre_ms:
                self.store.position(motor, run.first, self.place, 0)
                axis.phases.aim(_ROLL, _ZERO, speed, r, self.place, 0)
        self.queue_error = run.fps_milli // 2
        self.report_error = run.fps_milli // 2
        self.queued = 0
        self.reported = 0

    def _feed(self):
        """Queue the next frames and the post-roll, as far as there is room."""
        axes = self.axes
        bits = self.run.bits
        while self.queued <= self.run.frames and self._room(bits):
            self._queue_frame()
        for motor in range(axes.count):
            if bits >> motor & 1:
                axes[motor].feed(_SEGMENTS_AHEAD)

    def _room(self, bits):
        """Whether no motor has enough phases ahead of it."""
        for motor in range(self.axes.count):
            if bits >> motor & 1 and self.axes[motor].phases.count() >= _AHEAD:
                return False
        return True

    def _queue_frame(self):
        """Append the cubic to the next frame to each motor, after the last one the post-roll."""
        r = self.numbers
        run = self.run
        k = self.queued + 1
        self.queued = k
        if k > run.frames:
            reals.put(r, _ZERO, 0, 0)
            reals.put(r, _ROLL, run.post_ms, 0)
            for motor in range(self.axes.count):
                if run.bits >> motor & 1:
                    axis = self.axes[motor]
                    if run.post_ms:
                        axis.phases.aim(_ROLL, _SPEEDS + 2 * motor, _ZERO, r, run.ends, motor)
                    axis.more = False
            return
        self.queue_error += run.remainder
        duration = _DURATION
        if self.queue_error >= run.fps_milli:
            self.queue_error -= run.fps_milli
            duration = _DURATION_PLUS
        for motor in range(self.axes.count):
            if run.bits >> motor & 1:
                speed = _SPEEDS + 2 * motor
                self._velocity(run, _X, motor, k)
                reals.copy_word(self.place, 0, self.window, 2)
                self.axes[motor].phases.aim(duration, speed, _X, r, self.place, 0)
                reals.copy(r, speed, _X)

    def _frame_reached(self):
        """Whether the next frame's time has come; then on to the one after it."""
        run = self.run
        if self.reported > run.frames:
            return False
        ticks = self.axes.kernel.state[stepper.TICKS]
        if (ticks - self.report_tick - 1) & _WRAP >= _HALF:
            return False
        self.move_time = (self.store.start + run.first + run.step * self.reported) * 1000
        self.reported += 1
        self.report_error += run.remainder
        us = self.report_us + run.quotient
        if self.report_error >= run.fps_milli:
            self.report_error -= run.fps_milli
            us += 1
        self.report_tick = (self.report_tick + us // 1000) & _WRAP
        self.report_us = us % 1000
        return True

    def _moving(self):
        for motor in range(self.axes.count):
            if self.run.bits >> motor & 1 and self.axes[motor].moving:
                return True
        return False

    def _end(self):
        self.state = IDLE
        self.ended = True
