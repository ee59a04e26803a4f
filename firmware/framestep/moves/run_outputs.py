"""Signals of a run: lights, triggers, camera, bloop.

Pins change by cues, which the tick itself carries out (kernel.StepKernel.cue). So they keep in time
with the motors, except for rounding by half a tick and some microseconds. The kernel takes cues
only in the order of their times, so signals wait here, sorted, until they are due soon. The main
loop sets light levels in the tick of their frame.
"""

from array import array

from framestep.base.clock import HALF, WRAP, after, elapsed, reached
from framestep.base.native import const, micropython, ptr32
from framestep.moves.frame_clock import FrameClock
from framestep.pulse import stepper

SHUTTER = const(0x10000000)  # signals; the bits below are the general outputs
METER = const(0x08000000)
OUTPUTS = const(0x07FFFFFF)
VIDEO_PULSE_MS = const(100)  # field note 6.9
_BOTH = const(0x18000000)
# ticks before its time at which a signal becomes a cue: longer than any pass of the main loop
_NEAR = const(60)
_AHEAD = const(200)  # ticks before its time at which a frame's signals are scheduled
_SLOTS = const(32)  # signals that wait
_SLOT_MASK = const(31)
_FULL = const(20)  # with this many, frames wait: the rest is for signals outside of frames
_LONGEST_GAP = const(10)  # ms between the pulses of two stills, of an eighth of a frame at most
_ROUND_US = const(400)  # rounds to a tick; a tick's pulses come 100 µs before its cues
_NO_BLOOP = const(0)
_BLOOP_WAITS = const(1)  # for the first frame
_BLOOP_ON = const(2)
_BLOOP_ENDS = const(3)  # its end has been handed to the kernel


@micropython.viper
def _outputs(words: ptr32, i: int) -> int:
    """Return the outputs' bits of words[i], which may be of any size."""
    return words[i + 0] & OUTPUTS


class RunOutputs:
    """Lights, triggers, camera and bloop of a run.

    io: framestep.io.requests.Io. levels, triggers: of the upload.
    """

    def __init__(self, axes, io, levels, triggers):
        self.axes = axes
        self.gio = io.gio
        self.camera = io.camera
        self.lights = io.lights
        self.dmx = io.hal.dmx
        self.delay_ms = io.camera.delay_ms  # from the shutter's signal to the exposure
        self.hold_ms = io.camera.hold_ms  # from the end of the exposure to the signal's
        self.levels = levels
        self.triggers = triggers
        self.words = array("i", [0] * 2)
        self.busy = False  # whether poll() has anything to do
        # waiting signals, a ring sorted by time
        self.times = array("i", [0] * _SLOTS)
        self.masks = array("i", [0] * _SLOTS)
        self.values = array("i", [0] * _SLOTS)
        self.head = 0
        self.count = 0
        # the lap under way
        self.plan = None
        self.first = 0
        self.step = 1
        self.closing = True  # no further lap follows
        self.cue_clock = FrameClock()
        self.clock = FrameClock()  # of the light levels
        self.queued = 0  # frames whose signals have been scheduled
        self.shown = 0  # frames whose levels are out
        self.until = 0  # tick of the last signal that belongs to the lap
        self.outputs = 0  # outputs that are on after the last frame's triggers
        # the run under way
        self.starts = 0  # tick of GO, in which it starts
        # the pulse that stops a video camera, from tick to tick, while `stopping`
        self.stopping = False
        self.stop_from = 0
        self.stop_until = 0
        # the bloop, which outlives its run (field note 6.7)
        self.bloop = _NO_BLOOP
        self.bloop_from = 0  # tick of the run's first frame
        self.bloop_ms = 0
        self.bloop_bits = 0
        self.bloop_channel = 0
        self.bloop_level = 0  # level to which the channel returns

    # ---------------------------------------------------------------- signals

    def schedule(self, tick, mask, values):
        """Set the signals of `mask` (SHUTTER, METER, outputs) to the bits of `values` at a tick.

        Signals for the same tick keep their order.
        """
        count = self.count
        if count >= _SLOTS:
            return
        self.busy = True
        times = self.times
        tick &= WRAP
        i = self.head + count
        while count and not reached(tick, times[(i - 1) & _SLOT_MASK]):
            count -= 1
            i -= 1
            times[(i + 1) & _SLOT_MASK] = times[i & _SLOT_MASK]
            self.masks[(i + 1) & _SLOT_MASK] = self.masks[i & _SLOT_MASK]
            self.values[(i + 1) & _SLOT_MASK] = self.values[i & _SLOT_MASK]
        i &= _SLOT_MASK
        times[i] = tick
        self.masks[i] = mask
        self.values[i] = values
        self.count += 1

    def hand_over(self):
        """Pass the signals that are due soon to the kernel, as cues."""
        kernel = self.axes.kernel
        ticks = kernel.state[stepper.TICKS]
        while self.count:
            i = self.head
            ahead = elapsed(self.times[i], ticks)
            if _NEAR < ahead < HALF:
                return
            mask = self.masks[i]
            values = self.values[i]
            raised = lowered = 0
            if mask & OUTPUTS:
                raised = self.gio.outputs.pins(mask & OUTPUTS, values & OUTPUTS)
                lowered = self.gio.outputs.down
            if mask & _BOTH:
                raised |= self.camera.pins(
                    mask & SHUTTER, mask & METER, values & SHUTTER, values & METER
                )
                lowered |= self.camera.down
            if not kernel.cue(self.times[i], raised, lowered):
                return
            self.head = (i + 1) & _SLOT_MASK
            self.count -= 1

    def drop_scheduled(self):
        """Drop all signals not yet given, except those that outlive a run: bloop, stop of a
        camera."""
        self.count = 0
        irq = self.axes.hal.irq_off()
        self.axes.kernel.drop_cues()
        self.axes.hal.irq_on(irq)
        ticks = self.axes.kernel.state[stepper.TICKS]
        if self.bloop == _BLOOP_ENDS:
            self.bloop = _BLOOP_ON  # poll() schedules its end again
        if self.bloop and not reached(ticks, self.bloop_from):
            self.bloop = _NO_BLOOP  # its run did not reach the first frame
        if self.stopping:
            if reached(self.stop_from, ticks + 1):
                self.schedule(self.stop_from, _BOTH, _BOTH)
            self.schedule(self.stop_until, _BOTH, 0)

    # ---------------------------------------------------------------- a run

    def begin(self, plan, first, step, starts, tick, closing):
        """Begin a lap of `plan`, from index `first` in direction `step`.

        starts: tick in which the motors start; tick: of the first frame. Both are those of the
        pulses. closing: no further lap follows.
        """
        again = self.plan is plan
        self.plan = plan
        self.busy = True
        self.first = first
        self.step = step
        self.closing = closing
        self.cue_clock.begin(plan.fps_milli, tick)
        self.clock.begin(plan.fps_milli, tick)
        self.queued = 0
        self.shown = 0 if plan.sync and self.levels.ready else plan.frames + 1
        self.until = tick
        self.outputs = 0
        if not again:
            self.starts = starts
            if plan.bloop_ms and (plan.bloop_bits or plan.bloop_channel):
                self._end_bloop()  # of the previous run
                self.bloop = _BLOOP_WAITS
                self.bloop_from = tick
                self.bloop_ms = plan.bloop_ms
                self.bloop_bits = plan.bloop_bits
                self.bloop_channel = plan.bloop_channel
                if plan.bloop_bits:
                    self.schedule(tick, plan.bloop_bits, plan.bloop_bits)
            if plan.video:
                self.schedule(starts, _BOTH, _BOTH)
                self.schedule(starts + VIDEO_PULSE_MS, _BOTH, 0)
        self.feed()
        self.hand_over()

    def _lasts(self, tick):
        tick &= WRAP
        if reached(tick, self.until):
            self.until = tick

    def feed(self):
        """Schedule the signals of the next frames."""
        plan = self.plan
        if plan is None:
            return
        ticks = self.axes.kernel.state[stepper.TICKS]
        clock = self.cue_clock
        while self.queued <= plan.frames and self.count < _FULL:
            ahead = elapsed(clock.tick, ticks)
            if _AHEAD + self.delay_ms < ahead < HALF and self.queued:
                return
            self._frame()

    def _frame(self):
        """Schedule one frame's signals: triggers at its beginning, the shutter within it."""
        plan = self.plan
        clock = self.cue_clock
        last = self.queued == plan.frames
        tick = clock.tick + (clock.us + _ROUND_US) // 1000
        mask = 0
        if plan.sync and self.triggers.ready:
            words = self.words
            self.triggers.mask_to(words, 0)
            self.triggers.values_to(self.first + self.step * self.queued, words, 1)
            mask = _outputs(words, 0)
            values = _outputs(words, 1) & mask
            if values != self.outputs or self.queued == 0:
                self.schedule(tick, mask, values)
                self._lasts(tick)
            self.outputs = values
        if plan.stills:
            opened = clock.tick + (clock.us + self._share(plan.open_angle) + _ROUND_US) // 1000
            closed = clock.tick + (clock.us + self._share(plan.close_angle) + _ROUND_US) // 1000
            opened -= self.delay_ms
            closed += self.hold_ms
            # A camera has to see where one frame's pulse ends and the next one's begins.
            frame = clock.quotient // 1000
            closed = min(closed, opened + frame - max(1, min(_LONGEST_GAP, frame >> 3)))
            closed = max(closed, opened + 1)
            self.schedule(opened, _BOTH, _BOTH)
            self.schedule(closed, _BOTH, 0)
            self._lasts(closed)
        self.queued += 1
        clock.advance()
        if last:
            # the last frame lasts as long as the others
            tick = clock.tick + (clock.us + _ROUND_US) // 1000
            if self.outputs:
                self.schedule(tick, mask, 0)
            if self.outputs or self.closing:
                self._lasts(tick)

    def _share(self, angle):
        """Return the microseconds from a frame's beginning to an angle of it, 0 … 360."""
        frame_us = self.cue_clock.quotient
        return frame_us // 360 * angle + frame_us % 360 * angle // 360

    def _stop_camera(self, ticks):
        """Schedule the pulse that stops a video camera, at least 100 ms after its start pulse."""
        tick = ticks + 1
        earliest = self.starts + 2 * VIDEO_PULSE_MS
        if not reached(tick, earliest):
            tick = earliest
        self.stopping = True
        self.stop_from = tick & WRAP
        self.stop_until = after(tick, VIDEO_PULSE_MS)
        self.schedule(self.stop_from, _BOTH, _BOTH)
        self.schedule(self.stop_until, _BOTH, 0)

    def close(self):
        """Make the present lap the last."""
        if self.plan is not None:
            self.closing = True

    def finished(self):
        """Return whether all signals of the lap have been given."""
        plan = self.plan
        ticks = self.axes.kernel.state[stepper.TICKS]
        if self.queued <= plan.frames or self.shown <= plan.frames:
            return False
        return reached(ticks, self.until)

    def poll(self):
        """Do what is due. To be called in each pass of the main loop while `busy`."""
        if self.count:
            self.hand_over()
        ticks = self.axes.kernel.state[stepper.TICKS]
        plan = self.plan
        levels = plan is not None and self.shown <= plan.frames
        changed = levels and self._levels(plan.frames, ticks, self.clock)
        if self.bloop:
            changed |= self._bloop(elapsed(ticks, self.bloop_from))
        if changed:
            self.dmx.show(self.lights)
        if self.stopping and reached(ticks, self.stop_until):
            self.stopping = False
        self.busy = levels or self.count > 0 or self.bloop != _NO_BLOOP or self.stopping

    def _levels(self, frames, ticks, clock):
        """Set the levels of the frames that are due. Return whether there were any."""
        changed = False
        while self.shown <= frames:
            if not reached(ticks, clock.tick + (clock.us + _ROUND_US) // 1000):
                break
            index = self.first + self.step * self.shown
            if self.shown:
                self.levels.step(index, self.lights)
            else:
                self.levels.seek(index, self.lights)
            changed = True
            self.shown += 1
            clock.advance()
        return changed

    def _bloop(self, since):
        """Carry out the bloop, `since` ticks after the run's first frame.

        Return whether a light has been set.
        """
        if since >= HALF:
            return False
        if self.bloop == _BLOOP_WAITS:
            self.bloop = _BLOOP_ON
            if self.bloop_channel:
                self.bloop_level = self.lights.level(self.bloop_channel)
        if self.bloop == _BLOOP_ON and since + _NEAR >= self.bloop_ms:
            self.bloop = _BLOOP_ENDS
            if self.bloop_bits:
                self.schedule(self.bloop_from + self.bloop_ms, self.bloop_bits, 0)
                self.hand_over()
        if since < self.bloop_ms:
            return self._bloop_light(255)
        self.bloop = _NO_BLOOP
        return self._bloop_light(self.bloop_level)

    def _bloop_light(self, level):
        """Set the bloop's light to a level. Return whether it has one."""
        channel = self.bloop_channel
        if not channel:
            return False
        now = self.lights.level(channel)
        if now != 255 and now != self.bloop_level:
            # the program has set it in the meantime
            if level == self.bloop_level:
                level = now
            self.bloop_level = now
        self.lights.set(channel, level)
        return True

    def _end_bloop(self):
        """End a bloop at once."""
        if self.bloop and self._drop_bloop() and self.bloop_bits:
            self.schedule(self.axes.kernel.state[stepper.TICKS] + 1, self.bloop_bits, 0)

    def _drop_bloop(self):
        """Drop a bloop and restore its light. Return whether the bloop had begun."""
        bloop = self.bloop
        self.bloop = _NO_BLOOP
        if bloop == _NO_BLOOP or bloop == _BLOOP_WAITS:
            return False
        if self._bloop_light(self.bloop_level):
            self.dmx.show(self.lights)
        return True

    def abort(self):
        """Drop everything scheduled except a video camera's stop: outputs have gone to safe
        levels."""
        self._drop_bloop()
        self.drop_scheduled()

    def show_frame(self, index):
        """Set lights and triggers as at a frame, without a run (spec: MSG_RT_POSITION_FRAME)."""
        if self.levels.ready:
            self.levels.seek(index, self.lights)
        if self.triggers.ready:
            words = self.words
            self.triggers.mask_to(words, 0)
            self.triggers.values_to(index, words, 1)
            self.gio.put(_outputs(words, 0), _outputs(words, 1))

    def end(self):
        """End the run: turn all off except a bloop for its time; stop a video camera."""
        plan = self.plan
        if plan is None:
            return
        self.plan = None
        self.drop_scheduled()
        ticks = self.axes.kernel.state[stepper.TICKS]
        mask = 0
        if plan.sync and self.triggers.ready:
            self.triggers.mask_to(self.words, 0)
            mask = _outputs(self.words, 0)
            if self.bloop:
                mask &= ~self.bloop_bits
        if plan.stills:
            mask |= _BOTH
        if mask:
            self.schedule(ticks + 1, mask, 0)
        if plan.video and reached(ticks, self.starts):
            # The camera was started. First finish the start pulse.
            if not reached(ticks, self.starts + VIDEO_PULSE_MS):
                self.schedule(self.starts + VIDEO_PULSE_MS, _BOTH, 0)
            self._stop_camera(ticks)
        self.hand_over()
