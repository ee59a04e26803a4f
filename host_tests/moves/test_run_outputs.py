"""What accompanies a run besides the motors: at which tick each output, the camera and the lights
change."""

from array import array
from fractions import Fraction

import pytest

from framestep.io.camera import Camera
from framestep.io.gio import Gio
from framestep.io.lights import Lights
from framestep.moves.run_outputs import METER, SHUTTER, VIDEO_PULSE_MS, RunOutputs
from framestep.moves.run_plan import Plan
from framestep.pulse import stepper
from host_tests.io.pins import Pins, rig

WRAP = 2**29
BOTH = ("meter", "shutter")


class Kernel:
    """Gives each cue in its tick, as the tick does; cues must arrive in the order of their
    times."""

    SLOTS = 4

    def __init__(self, pins, ticks):
        self.pins = pins
        self.state = array("i", [0] * stepper.HEADER_WORDS)
        self.state[stepper.TICKS] = ticks
        self.cues = []

    def cue(self, tick, raised, lowered):
        assert not self.cues or (tick - self.cues[-1][0]) % WRAP < WRAP // 2, (
            "a cue before the one handed over last"
        )
        if len(self.cues) >= self.SLOTS:
            return False
        self.cues.append((tick, raised, lowered))
        return True

    def drop_cues(self):
        self.cues.clear()

    def tick(self):
        ticks = self.state[stepper.TICKS] = (self.state[stepper.TICKS] + 1) % WRAP
        while self.cues and (ticks - self.cues[0][0]) % WRAP < WRAP // 2:
            _, raised, lowered = self.cues.pop(0)
            self.pins.drive(raised, lowered)


class Levels:
    """Uploaded lights: {frame index: level of channel 1}."""

    def __init__(self, levels):
        self.ready = levels is not None
        self.levels = levels or {}
        self.asked = []

    def seek(self, index, lights):
        self.asked.append(index)
        lights.set(1, self.levels[index])

    def step(self, index, lights):
        self.seek(index, lights)


class Triggers:
    """Uploaded triggers: {frame index: values}."""

    def __init__(self, mask, triggers):
        self.ready = triggers is not None
        self.mask, self.values = mask, triggers or {}

    def mask_to(self, words, at):
        words[at] = self.mask

    def values_to(self, index, words, at):
        words[at] = self.values.get(index, 0)


class OutputsBench:
    """The outputs of a run and their pins; a pass of the main loop after each tick.

    `changes`: {name: [(tick, level)]}.
    """

    def __init__(self, ticks=1000, levels=None, mask=0, triggers=None):
        self.pins = Pins()
        self.origin = ticks
        self.kernel = Kernel(self.pins, ticks)
        settings = rig()
        self.camera, self.gio = Camera(self.pins, settings), Gio(self.pins, settings)
        self.lights = Lights(512, 0)
        self.uploaded = Levels(levels)

        class Io:
            gio, camera, lights, hal = self.gio, self.camera, self.lights, self

        class Axes:
            kernel, hal = self.kernel, self.pins

        self.dmx = self
        self.show_ = RunOutputs(Axes(), Io(), self.uploaded, Triggers(mask, triggers))
        board = self.pins.board
        self.names = {"shutter": board["shutter"], "meter": board["meter"], "gio1": board["gio"][0]}
        self.names["gio2"] = board["gio"][1]
        self.changes = {name: [] for name in self.names}
        self.levels = []

    def show(self, lights):
        """Do what the DMX port does."""
        self.levels.append((self.now, lights.level(1)))

    @property
    def now(self):
        """Return the ticks since the beginning."""
        return (self.kernel.state[stepper.TICKS] - self.origin) % WRAP

    def schedule(self, tick, mask, values):
        self.show_.schedule((self.origin + tick) % WRAP, mask, values)

    def play(
        self,
        frames=3,
        fps=25,
        first=0,
        step=1,
        lead=100,
        sync=True,
        again=False,
        closing=True,
        **plan,
    ):
        """Begin a lap, whose first frame is `lead` ticks from now."""
        if not again:
            self.plan = Plan(1)
            self.plan.fps_milli, self.plan.frames, self.plan.sync = (
                round(fps * 1000),
                frames - 1,
                sync,
            )
            for name, value in plan.items():
                assert hasattr(self.plan, name)
                setattr(self.plan, name, value)
        ticks = self.kernel.state[stepper.TICKS]
        # as in OperationRunner: the next tick's pulses come two later
        self.start = self.now + 3
        self.show_.begin(self.plan, first, step, (ticks + 3) % WRAP, (ticks + lead) % WRAP, closing)
        self.first = self.now + lead
        return self

    def run(self, ticks=1):
        for _ in range(ticks):
            before = {name: self.pins.at(pin) for name, pin in self.names.items()}
            self.kernel.tick()
            for name, pin in self.names.items():
                if self.pins.at(pin) != before[name]:
                    self.changes[name].append((self.now, self.pins.at(pin)))
            self.show_.feed()
            if self.show_.busy:
                self.show_.poll()
        return self

    def after(self, name):
        """Return [(milliseconds after the first frame, level)]."""
        return [(tick - self.first, level) for tick, level in self.changes[name]]


def tick_of(frame, fps, angle=0):
    """Return the ticks, rounded, from the first frame to an angle of another."""
    us = (
        round(Fraction(frame * 10**9, round(fps * 1000)))
        + 10**9 // round(fps * 1000) * angle // 360
    )
    return (us + 400) // 1000


# ---------------------------------------------------------------- signals


def test_signals_come_in_the_order_of_their_times():
    hand = OutputsBench()
    hand.schedule(300, METER, METER)
    hand.schedule(50, SHUTTER, SHUTTER)
    hand.schedule(400, SHUTTER | METER, 0)
    hand.schedule(100, SHUTTER, 0)
    hand.run(500)
    assert hand.changes["shutter"] == [(50, 1), (100, 0)]
    assert hand.changes["meter"] == [(300, 1), (400, 0)]


def test_signals_for_the_same_tick_keep_their_order():
    hand = OutputsBench()
    hand.schedule(50, SHUTTER, SHUTTER)
    hand.schedule(50, SHUTTER, 0)
    hand.run(60)
    assert hand.pins.at(hand.names["shutter"]) == 0


def test_a_signal_that_is_late_comes_at_once():
    hand = OutputsBench()
    hand.run(20)
    hand.schedule(5, SHUTTER, SHUTTER)
    hand.run(2)
    assert hand.changes["shutter"][0][0] <= 22


def test_a_signal_changes_the_outputs_of_its_mask_only():
    hand = OutputsBench()
    hand.schedule(5, 0b11, 0b11)
    hand.schedule(9, 0b01, 0b00)
    hand.run(20)
    assert hand.changes["gio1"] == [(5, 1), (9, 0)]
    assert hand.changes["gio2"] == [(5, 1)]


def test_more_signals_than_the_kernel_takes_wait():
    hand = OutputsBench()
    for k in range(10):
        hand.schedule(50, SHUTTER, SHUTTER * (k % 2))
    hand.schedule(51, METER, METER)
    hand.run(60)
    assert hand.changes["meter"][0][0] <= 54
    assert hand.pins.at(hand.names["shutter"]) == 1


@pytest.mark.parametrize("ticks", [WRAP - 1, WRAP - 60, WRAP - 200])
def test_the_counter_of_ticks_may_wrap_before_a_signal(ticks):
    hand = OutputsBench(ticks)
    hand.schedule(100, METER, METER)
    hand.schedule(50, SHUTTER, SHUTTER)
    hand.run(250)
    assert (hand.changes["shutter"], hand.changes["meter"]) == ([(50, 1)], [(100, 1)])


# ---------------------------------------------------------------- triggers


@pytest.mark.parametrize("fps", [1, 23.976, 25, 120])
def test_triggers_come_at_the_beginning_of_their_frame(fps):
    """The run ends when the last frame ends: then they are off."""
    hand = OutputsBench(mask=0b01, triggers={1: 1, 2: 1, 3: 0, 4: 1}).play(5, fps)
    hand.run(hand.first + tick_of(5, fps) + 10)
    wanted = [(tick_of(frame, fps), level) for frame, level in ((1, 1), (3, 0), (4, 1), (5, 0))]
    assert hand.after("gio1") == wanted


def test_backward_the_triggers_are_those_of_the_frames_played():
    hand = OutputsBench(mask=0b01, triggers={0: 0, 1: 1, 2: 0}).play(3, first=2, step=-1)
    hand.run(300)
    assert hand.after("gio1") == [(40, 1), (80, 0)]


def test_outputs_outside_the_mask_are_left_alone():
    """field note 6.8"""
    hand = OutputsBench(mask=0b01, triggers={0: 0b11, 1: 0b10, 2: 0b11})
    hand.play()
    hand.run(300)
    assert hand.changes["gio2"] == []


def test_sync_gates_triggers_and_lights():
    """field note 6.8"""
    hand = OutputsBench(levels={0: 10, 1: 20, 2: 30}, mask=0b01, triggers={0: 1, 1: 0, 2: 1}).play(
        sync=False
    )
    hand.run(300)
    assert hand.changes["gio1"] == []
    assert hand.levels == []


# ---------------------------------------------------------------- lights


@pytest.mark.parametrize(
    "first, step, played", [(0, 1, [10, 20, 30]), (2, -1, [30, 20, 10]), (1, 1, [20])]
)
def test_levels_are_set_in_the_tick_of_their_frame(first, step, played):
    hand = OutputsBench(levels={0: 10, 1: 20, 2: 30}).play(len(played), 23.976, first, step)
    hand.run(300)
    assert hand.levels == [
        (hand.first + tick_of(n, 23.976), level) for n, level in enumerate(played)
    ]


def test_a_pass_is_finished_when_its_last_frame_is_over():
    hand = OutputsBench(levels={0: 10, 1: 20, 2: 30}).play(3)
    hand.run(hand.first + 119)
    assert not hand.show_.finished()
    assert hand.run(1).show_.finished()


def test_at_a_frame_without_a_run_lights_and_triggers_are_those_of_the_frame():
    """spec: MSG_RT_POSITION_FRAME"""
    hand = OutputsBench(levels={0: 10, 7: 20}, mask=0b11, triggers={7: 0b10})
    hand.show_.show_frame(7)
    assert hand.lights.level(1) == 20
    assert (hand.pins.at(hand.names["gio1"]), hand.pins.at(hand.names["gio2"])) == (0, 1)


# ---------------------------------------------------------------- the camera (field note 6.9)


@pytest.mark.parametrize("fps", [1, 24, 120])
@pytest.mark.parametrize("angles", [(90, 180), (0, 180), (180, 360)])
def test_stills_are_exposed_from_one_angle_of_each_frame_to_the_other(fps, angles):
    hand = OutputsBench().play(3, fps, stills=True, open_angle=angles[0], close_angle=angles[1])
    hand.run(hand.first + tick_of(3, fps) + 10)
    wanted = []
    for frame in range(3):
        wanted += [(tick_of(frame, fps, angles[0]), 1), (tick_of(frame, fps, angles[1]), 0)]
    for name in BOTH:
        assert hand.after(name) == wanted


def test_a_shutter_open_all_round_closes_for_a_moment_between_two_frames():
    hand = OutputsBench().play(3, 25, stills=True, open_angle=0, close_angle=360)
    hand.run(300)
    assert hand.after("shutter") == [(0, 1), (35, 0), (40, 1), (75, 0), (80, 1), (115, 0)]


def test_an_exposure_shorter_than_a_tick_lasts_one():
    hand = OutputsBench().play(1, 200, stills=True, open_angle=90, close_angle=91)
    hand.run(150)
    (opened, _), (closed, _) = hand.after("shutter")
    assert closed - opened == 1


def test_a_video_camera_gets_a_pulse_at_go_and_another_at_the_end():
    hand = OutputsBench().play(3, video=True)
    hand.run(400)
    hand.show_.end()
    hand.run(300)
    for name in BOTH:
        start, over, stop, stopped = hand.changes[name]
        assert (over[0] - start[0], stopped[0] - stop[0]) == (VIDEO_PULSE_MS, VIDEO_PULSE_MS)
        assert (start[0], stop[0]) == (hand.start, 401)
        assert (start[1], over[1], stop[1], stopped[1]) == (1, 0, 1, 0)


def test_the_pulse_that_stops_it_comes_a_hundred_milliseconds_after_the_one_that_started_it():
    """If the run ends at once: the camera would see one long pulse otherwise."""
    hand = OutputsBench().play(3, video=True)
    hand.run(10)
    hand.show_.end()
    hand.run(500)
    assert hand.changes["shutter"] == [(3, 1), (103, 0), (203, 1), (303, 0)]


def test_a_run_that_is_broken_off_leaves_no_shutter_open_and_no_trigger_on():
    hand = OutputsBench(mask=0b01, triggers={0: 1, 1: 1, 2: 1})
    hand.play(3, 25, stills=True, open_angle=0, close_angle=360)
    hand.run(hand.first + 15)
    hand.show_.end()
    hand.run(300)
    assert hand.after("shutter") == [(0, 1), (16, 0)]
    assert hand.after("gio1") == [(0, 1), (16, 0)]


# ---------------------------------------------------------------- bloop (field note 6.7)


@pytest.mark.parametrize("ms", [1, 50, 59, 60, 61, 1000])
def test_the_bloop_is_on_for_its_time_from_the_first_frame(ms):
    hand = OutputsBench().play(bloop_ms=ms, bloop_bits=0b10)
    hand.run(ms + 200)
    assert hand.after("gio2") == [(0, 1), (ms, 0)]


def test_a_bloop_of_no_time_is_none():
    hand = OutputsBench().play(bloop_ms=0, bloop_bits=0b10)
    hand.run(300)
    assert hand.changes["gio2"] == []


def test_its_light_goes_to_full_and_back():
    hand = OutputsBench()
    hand.lights.set(7, 33)
    hand.play(bloop_ms=50, bloop_channel=7)
    seen = []
    for _ in range(300):
        hand.run()
        seen.append(hand.lights.level(7))
    assert seen.count(255) == 50
    assert (seen[0], seen[-1]) == (33, 33)


def test_it_outlives_its_run():
    hand = OutputsBench().play(bloop_ms=500, bloop_bits=0b01)
    hand.run(hand.first + 5)
    hand.show_.end()
    hand.run(800)
    assert hand.after("gio1") == [(0, 1), (500, 0)]


def test_a_run_that_never_comes_to_its_first_frame_has_none():
    hand = OutputsBench().play(bloop_ms=500, bloop_bits=0b01)
    hand.run(hand.first - 50)
    hand.show_.end()
    hand.run(800)
    assert hand.changes["gio1"] == []


def test_a_loop_has_one_bloop():
    hand = OutputsBench().play(3, bloop_ms=50, bloop_bits=0b01, closing=False)
    hand.run(250)
    hand.play(again=True)
    hand.run(400)
    assert len(hand.changes["gio1"]) == 2


def test_outputs_gone_to_their_safe_levels_stay_there():
    hand = OutputsBench(mask=0b01, triggers={0: 0, 1: 1}).play(bloop_ms=500, bloop_bits=0b10)
    hand.run(hand.first + 5)
    hand.gio.outputs.safe()
    hand.show_.plan = None
    hand.show_.abort()
    hand.run(600)
    assert hand.after("gio1") == []
    assert hand.pins.at(hand.names["gio2"]) == 0
