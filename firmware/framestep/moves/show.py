"""What goes with a run besides the motors: lights, triggers, camera, bloop.

Pins change as cues, given by the tick itself (kernel.StepKernel.cue), so they keep the motors' time
to half a millisecond and some microseconds: a tick is what they are rounded to. The kernel takes
cues in the order of their times only, so they wait here, sorted, until they are near. Light levels are set by
the main loop in the tick of their frame.
"""

from array import array

from framestep.clock import HALF as _HALF
from framestep.clock import WRAP as _WRAP
from framestep.motion import stepper
from framestep.moves.frame_clock import FrameClock
from framestep.native import const, micropython, ptr32
from framestep.protocol.messages import RUN_STILLS, RUN_VIDEO

SHUTTER = const(0x10000000)  # signals: the general outputs are the bits below
METER = const(0x08000000)
OUTPUTS = const(0x07FFFFFF)
VIDEO_PULSE_MS = const(100)  # field note 6.9
_BOTH = const(0x18000000)
_NEAR = const(60)  # ticks before its time that a cue is handed to the kernel: longer than any pass of the main loop
_AHEAD = const(200)  # ticks before its time that a frame's cues are made
_SLOTS = const(32)  # cues that wait
_SLOT_MASK = const(31)
_FULL = const(20)  # from so many on no frame adds to them: the rest is for cues that come alone
_ROUND_US = const(400)  # a tick's pulses come 100 µs before the cues of the tick that they are meant for
_NO_BLOOP = const(0)
_BLOOP_WAITS = const(1)  # for the first frame
_BLOOP_ON = const(2)
_BLOOP_ENDS = const(3)  # its end has been handed over


@micropython.viper
def _outputs(words: ptr32, i: int) -> int:
    """words[i], of any size, as far as it stands for outputs."""
    return words[i + 0] & OUTPUTS


class Show:
    """The things that go with the frames. io: framestep.io.requests.Io; cues: the uploaded ones."""

    def __init__(self, axes, io, cues):
        self.axes = axes
        self.gio = io.gio
        self.camera = io.camera
        self.lights = io.lights
        self.dmx = io.hal.dmx
        self.cues = cues
        self.words = array("i", [0] * 2)
        self.busy = False  # poll() has something to look after
        # signals that wait, a ring sorted by time
        self.times = array("i", [0] * _SLOTS)
        self.masks = array("i", [0] * _SLOTS)
        self.values = array("i", [0] * _SLOTS)
        self.head = 0
        self.count = 0
        # the pass under way
        self.plan = None
        self.first = 0
        self.step = 1
        self.closing = True  # no further pass follows
        self.cue_clock = FrameClock()
        self.level_clock = FrameClock()
        self.queued = 0  # frames whose cues have been made
        self.shown = 0  # frames whose levels are out
        self.until = 0  # tick of the last cue that belongs to a frame
        self.triggers = 0  # outputs that the last frame's triggers have on
        # the run under way
        self.starts = 0  # tick in which it starts: of GO
        # the pulse that stops a video camera: from when to when, while `stopping`
        self.stopping = False
        self.stop_from = 0
        self.stop_until = 0
        # the bloop, which outlives its run (field note 6.7)
        self.bloop = _NO_BLOOP
        self.bloop_from = 0  # tick of the run's first frame
        self.bloop_ms = 0
        self.bloop_bits = 0
        self.bloop_channel = 0
        self.bloop_level = 0  # what the channel goes back to

    # ---------------------------------------------------------------- signals

    def signal(self, tick, mask, values):
        """Set the signals of `mask` (SHUTTER, METER, outputs) to the bits of `values` at a tick.

        One of those put for the same tick earlier is given earlier.
        """
        count = self.count
        if count >= _SLOTS:
            return
        self.busy = True
        times = self.times
        tick &= _WRAP
        i = self.head + count
        while count and (tick - times[(i - 1) & _SLOT_MASK]) & _WRAP >= _HALF:
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

    def pass_on(self):
        """Hand the signals that are near to the kernel."""
        kernel = self.axes.kernel
        ticks = kernel.state[stepper.TICKS]
        while self.count:
            i = self.head
            ahead = (self.times[i] - ticks) & _WRAP
            if _NEAR < ahead < _HALF:
                return
            mask = self.masks[i]
            values = self.values[i]
            raised = lowered = 0
            if mask & OUTPUTS:
                raised = self.gio.outputs.pins(mask & OUTPUTS, values & OUTPUTS)
                lowered = self.gio.outputs.down
            if mask & _BOTH:
                raised |= self.camera.pins(mask & SHUTTER, mask & METER, values & SHUTTER, values & METER)
                lowered |= self.camera.down
            irq = self.axes.hal.irq_off()
            taken = kernel.cue(self.times[i], raised, lowered)
            self.axes.hal.irq_on(irq)
            if not taken:
                return
            self.head = (i + 1) & _SLOT_MASK
            self.count -= 1

    def cancel(self):
        """Forget every signal that has not been given, but for those that outlive a run: bloop, stop of a camera."""
        self.count = 0
        irq = self.axes.hal.irq_off()
        self.axes.kernel.drop_cues()
        self.axes.hal.irq_on(irq)
        ticks = self.axes.kernel.state[stepper.TICKS]
        if self.bloop == _BLOOP_ENDS:
            self.bloop = _BLOOP_ON  # poll() hands it over again
        if self.bloop and (ticks - self.bloop_from) & _WRAP >= _HALF:
            self.bloop = _NO_BLOOP  # its run has not come to the first frame
        if self.stopping:
            if (self.stop_from - ticks - 1) & _WRAP < _HALF:
                self.signal(self.stop_from, _BOTH, _BOTH)
            self.signal(self.stop_until, _BOTH, 0)

    # ---------------------------------------------------------------- a run

    def begin(self, plan, first, step, starts, tick, closing):
        """A pass begins, in the tick `starts`; its first frame is at `tick` (both of the pulses). closing: no further
        pass follows."""
        again = self.plan is plan
        self.plan = plan
        self.busy = True
        self.first = first
        self.step = step
        self.closing = closing
        self.cue_clock.begin(plan.fps_milli, tick)
        self.level_clock.begin(plan.fps_milli, tick)
        self.queued = 0
        self.shown = 0 if plan.sync and self.cues.has_levels else plan.frames + 1
        self.until = tick
        self.triggers = 0
        if not again:
            self.starts = starts
            if plan.bloop_ms and (plan.bloop_bits or plan.bloop_channel):
                self._end_bloop()  # of the run before
                self.bloop = _BLOOP_WAITS
                self.bloop_from = tick
                self.bloop_ms = plan.bloop_ms
                self.bloop_bits = plan.bloop_bits
                self.bloop_channel = plan.bloop_channel
                if plan.bloop_bits:
                    self.signal(tick, plan.bloop_bits, plan.bloop_bits)
            if plan.flags & RUN_VIDEO:
                self.signal(starts, _BOTH, _BOTH)
                self.signal(starts + VIDEO_PULSE_MS, _BOTH, 0)
        self.feed()
        self.pass_on()

    def _lasts(self, tick):
        tick &= _WRAP
        if (tick - self.until) & _WRAP < _HALF:
            self.until = tick

    def feed(self):
        """Make the cues of the next frames."""
        plan = self.plan
        if plan is None:
            return
        ticks = self.axes.kernel.state[stepper.TICKS]
        clock = self.cue_clock
        while self.queued <= plan.frames and self.count < _FULL:
            ahead = (clock.tick - ticks) & _WRAP
            if _AHEAD < ahead < _HALF and self.queued:
                return
            self._frame()

    def _frame(self):
        """The cues of one frame: triggers at its beginning, the shutter within it; then on."""
        plan = self.plan
        clock = self.cue_clock
        last = self.queued == plan.frames
        tick = clock.tick + (clock.us + _ROUND_US) // 1000
        mask = 0
        if plan.sync and self.cues.has_triggers:
            words = self.words
            self.cues.trigger_mask_to(words, 0)
            self.cues.trigger_values_to(self.first + self.step * self.queued, words, 1)
            mask = _outputs(words, 0)
            values = _outputs(words, 1) & mask
            if values != self.triggers or self.queued == 0:
                self.signal(tick, mask, values)
                self._lasts(tick)
            self.triggers = values
        if plan.flags & RUN_STILLS:
            whole = plan.open_angle == 0 and plan.close_angle == 360  # no gap between two frames
            opened = clock.tick + (clock.us + self._share(plan.open_angle) + _ROUND_US) // 1000
            closed = clock.tick + (clock.us + self._share(plan.close_angle) + _ROUND_US) // 1000
            if closed == opened:
                closed += 1
            if not whole or self.queued == 0:
                self.signal(opened, _BOTH, _BOTH)
            if not whole or last:
                self.signal(closed, _BOTH, 0)
                self._lasts(closed)
        self.queued += 1
        clock.advance()
        if last:
            # the last frame lasts as long as any other
            tick = clock.tick + (clock.us + _ROUND_US) // 1000
            if self.triggers:
                self.signal(tick, mask, 0)
            if self.triggers or self.closing:
                self._lasts(tick)

    def _share(self, angle):
        """Microseconds from a frame's beginning to an angle of it, 0 … 360."""
        frame_us = self.cue_clock.quotient
        return frame_us // 360 * angle + frame_us % 360 * angle // 360

    def _stop_camera(self, ticks):
        """The pulse that stops a video camera: now, or 100 ms after the one that started it."""
        tick = ticks + 1
        earliest = self.starts + 2 * VIDEO_PULSE_MS
        if (tick - earliest) & _WRAP >= _HALF:
            tick = earliest
        self.stopping = True
        self.stop_from = tick & _WRAP
        self.stop_until = (tick + VIDEO_PULSE_MS) & _WRAP
        self.signal(self.stop_from, _BOTH, _BOTH)
        self.signal(self.stop_until, _BOTH, 0)

    def close(self):
        """The pass under way is the last after all."""
        if self.plan is not None:
            self.closing = True

    def finished(self):
        """Whether all that goes with the pass has been given."""
        plan = self.plan
        ticks = self.axes.kernel.state[stepper.TICKS]
        if self.queued <= plan.frames or self.shown <= plan.frames:
            return False
        return (ticks - self.until) & _WRAP < _HALF

    def poll(self):
        """Once per pass while `busy`: what is due."""
        if self.count:
            self.pass_on()
        ticks = self.axes.kernel.state[stepper.TICKS]
        plan = self.plan
        levels = plan is not None and self.shown <= plan.frames
        changed = levels and self._levels(plan.frames, ticks, self.level_clock)
        if self.bloop:
            changed |= self._bloop(ticks, (ticks - self.bloop_from) & _WRAP)
        if changed:
            self.dmx.show(self.lights)
        if self.stopping and (ticks - self.stop_until) & _WRAP < _HALF:
            self.stopping = False
        self.busy = levels or self.count > 0 or self.bloop != _NO_BLOOP or self.stopping

    def _levels(self, frames, ticks, clock):
        """Set the levels of the frames that are due; whether there were any."""
        changed = False
        while self.shown <= frames:
            if (ticks - clock.tick - (clock.us + _ROUND_US) // 1000) & _WRAP >= _HALF:
                break
            index = self.first + self.step * self.shown
            if self.shown:
                self.cues.step(index, self.step < 0, self.lights)
            else:
                self.cues.seek(index, self.lights)
            changed = True
            self.shown += 1
            clock.advance()
        return changed

    def _bloop(self, ticks, since):
        """The bloop, `since` ticks after the run's first frame; whether a light has been set."""
        if since >= _HALF:
            return False
        if self.bloop == _BLOOP_WAITS:
            self.bloop = _BLOOP_ON
            if self.bloop_channel:
                self.bloop_level = self.lights.level(self.bloop_channel)
        if self.bloop == _BLOOP_ON and since + _NEAR >= self.bloop_ms:
            self.bloop = _BLOOP_ENDS
            if self.bloop_bits:
                self.signal(self.bloop_from + self.bloop_ms, self.bloop_bits, 0)
                self.pass_on()
        if since < self.bloop_ms:
            return self._bloop_light(255)
        self.bloop = _NO_BLOOP
        return self._bloop_light(self.bloop_level)

    def _bloop_light(self, level):
        """Put the light of the bloop at a level; whether there is one."""
        channel = self.bloop_channel
        if not channel:
            return False
        now = self.lights.level(channel)
        if now != 255 and now != self.bloop_level:
            # what the program has it at meanwhile
            if level == self.bloop_level:
                level = now
            self.bloop_level = now
        self.lights.set(channel, level)
        return True

    def _end_bloop(self):
        """End a bloop at once."""
        if self.bloop and self._drop_bloop() and self.bloop_bits:
            self.signal(self.axes.kernel.state[stepper.TICKS] + 1, self.bloop_bits, 0)

    def _drop_bloop(self):
        """Forget a bloop; its light goes back. Whether it has begun."""
        bloop = self.bloop
        self.bloop = _NO_BLOOP
        if bloop == _NO_BLOOP or bloop == _BLOOP_WAITS:
            return False
        if self._bloop_light(self.bloop_level):
            self.dmx.show(self.lights)
        return True

    def abort(self):
        """Outputs have gone to their safe levels: of a run nothing comes after that but a video camera's stop."""
        self._drop_bloop()
        self.cancel()

    def place(self, index):
        """Lights and triggers as they are at a frame, without a run (spec: MSG_RT_POSITION_FRAME)."""
        cues = self.cues
        if cues.has_levels:
            cues.seek(index, self.lights)
        if cues.has_triggers:
            words = self.words
            cues.trigger_mask_to(words, 0)
            cues.trigger_values_to(index, words, 1)
            self.gio.put(_outputs(words, 0), _outputs(words, 1))

    def end(self):
        """The run is over, in whatever way: nothing stays on but a bloop for its time, a video camera is stopped."""
        plan = self.plan
        if plan is None:
            return
        self.plan = None
        self.cancel()
        ticks = self.axes.kernel.state[stepper.TICKS]
        mask = 0
        if plan.sync and self.cues.has_triggers:
            self.cues.trigger_mask_to(self.words, 0)
            mask = _outputs(self.words, 0)
            if self.bloop:
                mask &= ~self.bloop_bits
        if plan.flags & RUN_STILLS:
            mask |= _BOTH
        if mask:
            self.signal(ticks + 1, mask, 0)
        if plan.flags & RUN_VIDEO and (ticks - self.starts) & _WRAP < _HALF:
            # The camera has been started. What is left of that pulse comes first.
            if (ticks - self.starts - VIDEO_PULSE_MS) & _WRAP >= _HALF:
                self.signal(self.starts + VIDEO_PULSE_MS, _BOTH, 0)
            self._stop_camera(ticks)
        self.pass_on()
