"""What goes with a run besides the motors: lights, triggers, camera, bloop.

Pins change as cues, given by the tick itself (stepper.StepKernel.cue), so they keep the motors' time
to some microseconds; light levels are set by the main loop as the frame is reached.
"""

from array import array

from framestep.motion import stepper
from framestep.native import const
from framestep.protocol.messages import RUN_STILLS, RUN_VIDEO

SHUTTER = const(0x10000000)  # signals: the general outputs are the bits below
METER = const(0x08000000)
OUTPUTS = const(0x07FFFFFF)
VIDEO_PULSE_MS = const(100)  # field note 6.9
_AHEAD = const(2)  # frames whose cues are put ahead
_WRAP = const(0x3FFFFFFF)


class Show:
    """The things that go with the frames. gio, camera, lights: framestep.io; cues: the uploaded ones."""

    def __init__(self, axes, gio, camera, lights, cues):
        self.axes = axes
        self.gio = gio
        self.camera = camera
        self.lights = lights
        self.cues = cues
        self.words = array("i", [0] * 2)
        self.plan = None
        self.first = 0
        self.step = 1
        self.tick = 0
        self.us = 0
        self.error = 0
        self.queued = 0  # frames whose cues have been put
        self.shown = -1  # index of the frame whose levels are out
        self.bloop_at = -1
        self.bloop_level = 0
        self.now = 0

    # ---------------------------------------------------------------- signals

    def signal(self, tick, mask, values):
        """Set the signals of `mask` (SHUTTER, METER, outputs) to the bits of `values` at a tick."""
        kernel = self.axes.kernel
        raised = lowered = 0
        if mask & OUTPUTS:
            raised = self.gio.outputs.pins(mask & OUTPUTS, values & OUTPUTS)
            lowered = self.gio.outputs.down
        if mask & (SHUTTER | METER):
            raised |= self.camera.pins(mask & SHUTTER, mask & METER, values & SHUTTER, values & METER)
            lowered |= self.camera.down
        irq = self.axes.hal.irq_off()
        kernel.cue(tick, raised, lowered)
        self.axes.hal.irq_on(irq)

    # ---------------------------------------------------------------- a run

    def begin(self, plan, first, step, tick):
        """A pass begins; its first frame is at `tick` (of the pulses)."""
        again = self.plan is plan
        self.plan = plan
        self.first = first
        self.step = step
        self.tick = tick
        self.us = 0
        self.error = plan.fps_milli // 2
        self.queued = 0
        self.shown = -1
        if plan.bloop_ms and not again:
            if plan.bloop_bits:
                self.signal(tick, plan.bloop_bits, plan.bloop_bits)
                self.signal(tick + plan.bloop_ms, plan.bloop_bits, 0)
        if plan.flags & RUN_VIDEO and not again:
            self._video(tick)
        self.feed()

    def _video(self, tick):
        self.signal(tick, SHUTTER | METER, SHUTTER | METER)
        self.signal(tick + VIDEO_PULSE_MS, SHUTTER | METER, 0)

    def feed(self):
        """Put the cues of the next frames."""
        plan = self.plan
        if plan is None:
            return
        ticks = self.axes.kernel.state[stepper.TICKS]
        while self.queued <= plan.frames and ((self.tick - ticks) & _WRAP) - _WRAP // 2 < 0:
            ahead = (self.tick - ticks) & _WRAP
            if ahead < _WRAP // 2 and ahead > 2 * (plan.quotient // 1000) + 100:
                return
            self._frame()

    def _frame(self):
        """The cues of one frame: triggers at its beginning, the shutter within it; then on."""
        plan = self.plan
        index = self.first + self.step * self.queued
        tick = self.tick
        if plan.sync and self.cues.has_triggers:
            words = self.words
            self.cues.trigger_mask_to(words, 0)
            self.cues.trigger_values_to(index, words, 1)
            mask = words[0] & OUTPUTS
            if mask:
                self.signal(tick, mask, words[1] & OUTPUTS)
        if plan.flags & RUN_STILLS and plan.close_angle > plan.open_angle:
            frame_us = plan.quotient
            opened = self.us + plan.open_angle * (frame_us // 360)
            closed = self.us + plan.close_angle * (frame_us // 360)
            self.signal(tick + opened // 1000, SHUTTER | METER, SHUTTER | METER)
            self.signal(tick + closed // 1000, SHUTTER | METER, 0)
        self.queued += 1
        self.error += plan.remainder
        us = self.us + plan.quotient
        if self.error >= plan.fps_milli:
            self.error -= plan.fps_milli
            us += 1
        self.tick = (self.tick + us // 1000) & _WRAP
        self.us = us % 1000

    def frame(self, index, first):
        """A frame has been reached: its light levels."""
        plan = self.plan
        if plan.bloop_channel and plan.bloop_ms and first and self.bloop_at < 0:
            self.bloop_at = self.now
            self.bloop_level = self.lights.level(plan.bloop_channel)
            self.lights.set(plan.bloop_channel, 255)
        if plan.sync and self.cues.has_levels:
            if self.shown < 0:
                self.cues.seek(index, self.lights)
            else:
                self.cues.step(index, self.step < 0, self.lights)
            self.shown = index

    def poll(self, now):
        """Once per pass: the bloop channel goes back to what it was."""
        if self.bloop_at >= 0 and (now - self.bloop_at) & _WRAP >= self.plan.bloop_ms:
            self.lights.set(self.plan.bloop_channel, self.bloop_level)
            self.bloop_at = -1

    def finish(self, tick):
        """The last frame of the last pass: the pulse that stops a video camera."""
        if self.plan.flags & RUN_VIDEO:
            self._video(tick)

    def end(self):
        """The run is over, in whatever way: nothing stays on."""
        plan = self.plan
        if plan is None:
            return
        self.plan = None
        if self.bloop_at >= 0:
            self.lights.set(plan.bloop_channel, self.bloop_level)
            self.bloop_at = -1
        now = self.axes.kernel.state[stepper.TICKS] + 1
        mask = plan.bloop_bits if plan.bloop_ms else 0
        if plan.flags & RUN_STILLS:
            mask |= SHUTTER | METER
        if mask:
            self.signal(now, mask, 0)
