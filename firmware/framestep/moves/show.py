"""What goes with a run besides the motors: lights, triggers, camera, bloop.

Pins change as cues, given by the tick itself (stepper.StepKernel.cue), so they keep the motors' time
to half a millisecond and some microseconds: a tick is what they are rounded to. The kernel takes
cues in the order of their times only, so they wait here, sorted, until they are near. Light levels are set by
the main loop in the tick of their frame.
"""

from array import array

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
_WRAP = const(0x3FFFFFFF)
_HALF = const(0x20000000)


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
        self.starts = 0  # tick of its first frame
        self.stops = -1  # tick of the pulse that stops a video camera, once that is known
        self.bloop_waits = False
        self.bloop_on = False
        self.bloop_level = 0

    # ---------------------------------------------------------------- signals

    def signal(self, tick, mask, values):
        """Set the signals of `mask` (SHUTTER, METER, outputs) to the bits of `values` at a tick.

        One of those put for the same tick earlier is given earlier.
        """
        count = self.count
        if count >= _SLOTS:
            return
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
        """Forget every signal that has not been given."""
        self.count = 0
        irq = self.axes.hal.irq_off()
        self.axes.kernel.drop_cues()
        self.axes.hal.irq_on(irq)

    # ---------------------------------------------------------------- a run

    def begin(self, plan, first, step, tick, closing):
        """A pass begins; its first frame is at `tick` (of the pulses). closing: no further pass follows."""
        again = self.plan is plan
        self.plan = plan
        self.first = first
        self.step = step
        self.closing = closing
        self.cue_clock.begin(plan.fps_milli, tick)
        self.level_clock.begin(plan.fps_milli, tick)
        self.queued = 0
        self.shown = 0
        self.until = tick
        self.triggers = 0
        if not again:
            self.starts = tick
            self.stops = -1
            self.bloop_on = False
            self.bloop_waits = plan.bloop_ms > 0 and plan.bloop_channel > 0
            if plan.bloop_ms and plan.bloop_bits:
                self.signal(tick, plan.bloop_bits, plan.bloop_bits)
                self.signal(tick + plan.bloop_ms, plan.bloop_bits, 0)
            if plan.flags & RUN_VIDEO:
                self._pulse(tick)
        self.feed()
        self.pass_on()

    def _pulse(self, tick):
        """One for a video camera. Returns nothing; the frames' cues end with it at the earliest."""
        self.signal(tick, _BOTH, _BOTH)
        self.signal(tick + VIDEO_PULSE_MS, _BOTH, 0)
        self._lasts(tick + VIDEO_PULSE_MS)

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
        if plan.flags & RUN_STILLS and plan.close_angle > plan.open_angle:
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
        if last and self.closing and plan.flags & RUN_VIDEO:
            self._stop_camera(tick)
        self.queued += 1
        clock.advance()
        if last and self.triggers:
            # the last frame lasts as long as any other
            tick = clock.tick + (clock.us + _ROUND_US) // 1000
            self.signal(tick, mask, 0)
            self._lasts(tick)

    def _share(self, angle):
        """Microseconds from a frame's beginning to an angle of it, 0 … 360."""
        frame_us = self.cue_clock.quotient
        return frame_us // 360 * angle + frame_us % 360 * angle // 360

    def _stop_camera(self, tick):
        """The pulse that stops a video camera, apart from the one that started it."""
        earliest = self.starts + 2 * VIDEO_PULSE_MS
        if (tick - earliest) & _WRAP >= _HALF:
            tick = earliest
        self.stops = tick & _WRAP
        self._pulse(tick)

    def close(self):
        """The pass under way is the last after all."""
        if self.plan is not None:
            self.closing = True

    def finished(self):
        """Whether all that goes with the pass has been given."""
        plan = self.plan
        ticks = self.axes.kernel.state[stepper.TICKS]
        if self.queued <= plan.frames or self.shown <= plan.frames and plan.sync:
            return False
        if self.closing and plan.flags & RUN_VIDEO and self.stops < 0:
            self._stop_camera(ticks + 1)  # the last frame had gone by when that was known
        return (ticks - self.until) & _WRAP < _HALF

    def poll(self):
        """Once per pass: what is due."""
        if self.count:
            self.pass_on()
        plan = self.plan
        if plan is None:
            return
        ticks = self.axes.kernel.state[stepper.TICKS]
        changed = False
        if plan.sync:
            changed = self._levels(plan.frames, ticks, self.level_clock)
        if self.bloop_on or self.bloop_waits:
            changed |= self._bloop(plan, (ticks - self.starts) & _WRAP)
        if changed:
            self.dmx.show(self.lights)

    def _levels(self, frames, ticks, clock):
        """Set the levels of the frames that are due; whether there were any."""
        changed = False
        while self.shown <= frames:
            if (ticks - clock.tick - (clock.us + _ROUND_US) // 1000) & _WRAP >= _HALF:
                break
            if self.cues.has_levels:
                index = self.first + self.step * self.shown
                if self.shown:
                    self.cues.step(index, self.step < 0, self.lights)
                else:
                    self.cues.seek(index, self.lights)
                changed = True
            self.shown += 1
            clock.advance()
        return changed

    def _bloop(self, plan, since):
        """The light of the bloop, `since` ticks after the run's first frame; whether it has been set."""
        lights = self.lights
        if self.bloop_on:
            level = lights.level(plan.bloop_channel)
            if level != 255:
                self.bloop_level = level  # what the program has it at meanwhile
            if since >= plan.bloop_ms:
                self.bloop_on = False
                level = self.bloop_level
            else:
                level = 255
            lights.set(plan.bloop_channel, level)
            return True
        if since < _HALF:
            self.bloop_waits = False
            self.bloop_on = True
            self.bloop_level = lights.level(plan.bloop_channel)
            lights.set(plan.bloop_channel, 255)
            return True
        return False

    def place(self, index):
        """Lights as they are at a frame, without a run (spec: MSG_RT_POSITION_FRAME). Triggers belong to runs."""
        if self.cues.has_levels:
            self.cues.seek(index, self.lights)

    def end(self):
        """The run is over, in whatever way: nothing stays on, a video camera is stopped."""
        plan = self.plan
        if plan is None:
            return
        self.plan = None
        self.cancel()
        if self.bloop_on:
            self.bloop_on = False
            self.lights.set(plan.bloop_channel, self.bloop_level)
        self.bloop_waits = False
        ticks = self.axes.kernel.state[stepper.TICKS]
        now = ticks + 1
        mask = plan.bloop_bits if plan.bloop_ms else 0
        if plan.sync and self.cues.has_triggers:
            self.cues.trigger_mask_to(self.words, 0)
            mask |= _outputs(self.words, 0)
        if plan.flags & RUN_STILLS:
            mask |= _BOTH
        if mask:
            self.signal(now, mask, 0)
        if plan.flags & RUN_VIDEO and (ticks - self.starts) & _WRAP < _HALF:
            # The camera has been started. What is left of a pulse under way comes first.
            if self.stops >= 0 and (ticks - self.stops) & _WRAP < _HALF:
                self.signal(self.stops + VIDEO_PULSE_MS, _BOTH, 0)
            else:
                self.signal(self.starts + VIDEO_PULSE_MS, _BOTH, 0)
                self._stop_camera(now)
        self.pass_on()
