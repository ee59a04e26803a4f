"""Axis and Axes at single ticks: settings that wait, stops while a motion is planned, phases from
outside. What a host sees of them is in end_to_end/motors."""

from array import array

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from framestep.motion import reals
from framestep.motors.axes import AHEAD, LOW, Axes
from framestep.motors.axis import MOST_SEGMENTS, UNLIMITED
from framestep.motors.rates import ACCELERATION_LIMIT, kernel_rate
from framestep.pulse import stepper
from framestep.pulse.engine import LEAD
from host_tests.pulse.engine import PER_TICK, PER_US, Bench


def word(value):
    return array("i", [7, value])


class Rig:
    """Some axes on a bench."""

    def __init__(self, motors=1, **options):
        self.bench = Bench(motors, **options).settle()
        self.axes = Axes(self.bench)

    def __getitem__(self, motor):
        return self.axes[motor]

    def move_to(self, motor, target, share=10_000):
        return self.axes[motor].move_to(self.bench, word(target), 1, share)

    def append(self, motor, ticks, step, flags=0):
        """Begin a plan with a phase that takes `ticks` and ends at rest on a step."""
        axis, numbers = self.axes[motor], array("i", [0] * 4)
        reals.put(numbers, 0, ticks, 0)
        axis.begin_plan(self.bench)
        axis.block[stepper.PLANNED] = stepper.PLAN_SEGMENTS | flags
        axis.append_phase(0, 2, 2, numbers, word(step), 1)
        return axis

    def run(self, ticks):
        self.bench.run(ticks, self.axes.feed)

    def to_rest(self, limit=20_000):
        ticks = 0
        while self.axes.moving:
            self.run(1)
            ticks += 1
            assert ticks < limit
        return ticks

    def place(self, motor=0):
        target = array("i", [0, 0])
        self.axes[motor].position_to(target, 1)
        assert target[1] == self.axes[motor].block[stepper.POSITION]
        return target[1]


# ---------------------------------------------------------------- settings


@given(st.integers(1, ACCELERATION_LIMIT))
def test_kernel_rate(acceleration):
    assert kernel_rate(acceleration) == pytest.approx(acceleration * 2**22 / 1e6, rel=2e-4, abs=1)
    assert kernel_rate(acceleration) >= 1


def test_a_lower_acceleration_set_in_motion():
    """It waits until the motor is at rest. Until then the motor counts as moving, and a motion that
    is requested in between waits as well."""
    rig = Rig()
    axis = rig[0]
    rig.move_to(0, 100)
    rig.run(50)
    rig.axes.set_speed(0, 5000, 3000)
    while not axis.at_rest:
        rig.axes.apply_pending()
        assert axis.acceleration == 20_000
        rig.run(1)
    rig.run(20)
    assert axis.moving
    assert rig.axes.moving
    assert rig.move_to(0, 300)
    rig.run(20)
    assert rig.place() == 100
    rig.axes.apply_pending()
    assert not rig.axes.pending
    rig.run(20)
    begun = rig.place()
    rig.run(80)
    assert rig.place() - 100 == pytest.approx(0.5 * 3000 * 0.1**2, abs=3)
    assert begun < 103
    rig.to_rest()
    assert rig.place() == 300


# ---------------------------------------------------------------- several motors


@pytest.mark.parametrize("speed, ticks", [(0, 0), (0, 2), (15, 0), (15, 6)])
def test_an_interrupt_stops_the_motor_while_its_plan_is_made(speed, ticks):
    """speed: of the motor before. ticks: between the stop and the rest of the plan. From its
    middle the plan must not begin."""
    rig = Rig()
    axis, bench = rig[0], rig.bench
    axis.set_speed(speed or 1000, 20_000)
    if speed:
        rig.move_to(0, 1000)
        rig.run(100)
        axis.set_speed(1000, 20_000)
    feed, place = axis.feed, axis.block[stepper.POSITION]

    def interrupted(most, enough):
        feed(1)
        stepper.halt(axis.block, 1, kernel_rate(80_000), 0)
        bench.run(ticks)
        feed(most, enough)

    axis.feed = interrupted
    rig.move_to(0, 2000)
    axis.feed = feed
    rig.run(10)
    axis.stop(bench)
    rig.to_rest()
    assert bench.kernel.state[stepper.FAULTS] == 0
    assert abs(rig.place() - place) <= 1
    rig.move_to(0, 300)
    rig.to_rest()
    assert rig.place() == 300
    assert bench.kernel.state[stepper.FAULTS] == 0


def test_a_stop_that_waits_for_a_pass_does_not_hold_up_a_feed():
    """While a motor does not move yet, each look for the stop empties its queue."""

    class Port:
        looks = 0

        def glance(self):
            self.looks += 1
            assert self.looks <= 2 * MOST_SEGMENTS
            stepper.halt(axis.block, 1, kernel_rate(80_000), 0)

    axis = Rig().append(0, 400_000, 1_000_000)
    axis.feed(MOST_SEGMENTS, UNLIMITED, Port())
    assert axis.block[stepper.WRITE_INDEX] == MOST_SEGMENTS


def test_a_move_in_each_tick_of_a_motion():
    """Also in the tick after its last segment, in which it stops without any speed."""
    for ticks in range(170):
        rig = Rig()
        rig[0].set_speed(1000, 20_000)
        rig.move_to(0, 100)
        rig.run(ticks)
        rig.move_to(0, 300)
        rig.to_rest()
        assert rig.place() == 300
        assert rig.bench.state[stepper.FAULTS] == 0


def test_release_starts_all_in_one_tick():
    """Queued with begin_plan(), append_phase() and feed(), started by release(): their first pulses
    come together."""
    rig = Rig(4)
    for motor, target in enumerate((1000, 1000, -1000, 1000)):
        rig.append(motor, 400, target).feed()
    rig.run(7)
    assert not any(engine.rises for engine in rig.bench.engines)
    rig.axes.release(0b1011)
    rig.run(500)
    rises = [np.array(rig.bench.engines[motor].rises) for motor in (0, 1, 3)]
    assert np.ptp(rises, axis=0).max() / PER_US < 2.5
    assert [rig.place(motor) for motor in range(4)] == [1000, 1000, 0, 1000]
    assert rig[2].moving


# ------------------------------------------------------- phases from outside, as a run appends them


class Sine:
    """A path from rest to rest through whole steps, one for each frame of so many ticks."""

    def __init__(self, ticks):
        self.ticks = ticks
        self.frames = 40 if ticks > 1 else 300
        self.wave = max(0.4 * self.frames * ticks, 60.0)  # ticks
        self.size = min(0.02 * self.wave * self.wave, 20_000)  # steps

    def step(self, frame):
        return round(self.size * (1 - np.cos(2 * np.pi * frame * self.ticks / self.wave)) / 2)

    def velocity(self, frame):
        if not 0 < frame < self.frames:
            return 0.0
        turn = 2 * np.pi * frame * self.ticks / self.wave
        return self.size * np.pi / self.wave * np.sin(turn)


def put_real(numbers, register, value):
    m, e = np.frexp(value)
    reals.put(numbers, register, round(m * 2**29), int(e) - 29)


def play_appended(rig, path):
    """Play a path whose frames are appended while it runs, as a run does. Return when it begins, in
    cycles of the bench."""
    axis = rig[0]
    numbers = array("i", [0] * 16)
    put_real(numbers, 0, path.ticks)
    axis.begin_plan(rig.bench)
    axis.block[stepper.PLANNED] = stepper.PLAN_SEGMENTS
    axis.set_more_to_come(True)
    begun = rig.bench.due + rig.bench.state[stepper.AHEAD]
    frame = 0
    started = False
    while rig.axes.moving or not started:
        while frame < path.frames and axis.phases.count() < 3:
            put_real(numbers, 2, path.velocity(frame))
            frame += 1
            put_real(numbers, 4, path.velocity(frame))
            axis.append_phase(0, 2, 4, numbers, word(path.step(frame)), 1)
            axis.set_more_to_come(frame < path.frames)
        if not started:
            axis.feed()
            axis.start(rig.bench)
            started = True
        rig.run(1)
        assert rig.bench.state[stepper.FAULTS] == 0
    return begun


@pytest.mark.parametrize("period", ["41.70837", "33.3667", "7.3", "1.9", "0.4", "1000.25"])
def test_phases_appended_on_the_way_meet_each_frame(period):
    """Within 20 µs of its time, which is between two ticks, a motor is within a step of it."""
    rig = Rig(jitter_us=0)
    path = Sine(float(period))
    begun = play_appended(rig, path)
    assert rig.place() == path.step(path.frames)
    rises = np.array(rig.bench.engines[0].rises, dtype=float)
    places = np.concatenate(([0], np.cumsum(rig.bench.engines[0].ways)))
    for frame in range(1, path.frames + 1):
        at = begun + frame * path.ticks * PER_TICK
        first, last = np.searchsorted(rises, [at - 20 * PER_US, at + 20 * PER_US])
        off = np.abs(places[first : last + 1] - path.step(frame)).min()
        assert off <= (1 if path.ticks > 1 else 2), f"frame {frame}: {off} steps off"


def test_a_frame_of_minutes_stays_on_its_path():
    """From rest to rest by three steps in five minutes, as in a time lapse."""
    rig = Rig(jitter_us=0)
    ticks = 300_000
    axis = rig.append(0, ticks, 3)
    axis.feed()
    axis.start(rig.bench)
    rig.run(ticks + 500)
    rises = np.array(rig.bench.engines[0].rises, dtype=float) / PER_TICK
    assert list(rig.bench.engines[0].ways) == [1, 1, 1]
    path = np.array([1, 2, 3]) / 3
    x = (rises - LEAD) / ticks
    assert 3 * x**2 - 2 * x**3 == pytest.approx(path, abs=0.005)


def test_an_axis_whose_feed_stops_faults():
    rig = Rig()
    rig[0].set_speed(10_000, 100_000)
    rig.move_to(0, 1_000_000)
    rig.run(300)
    rig.bench.run(900)
    assert rig.bench.state[stepper.FAULTS] == stepper.FAULT_DRY
    rises = np.array(rig.bench.engines[0].rises, dtype=float)
    assert (1e6 * PER_US / np.diff(rises)).max() < 10_050
    assert rig.place() == len(rises)


@pytest.mark.parametrize("timed", [stepper.PLAN_TIMED, 0])
def test_a_motor_that_stands_in_a_timed_motion_faults_without_its_feed(timed):
    rig = Rig()
    axis = rig.append(0, 50, 0, timed)
    axis.set_more_to_come(True)
    axis.feed()
    axis.start(rig.bench)
    rig.bench.run(40)
    assert rig.bench.state[stepper.FAULTS] == 0
    rig.bench.run(40)
    assert rig.bench.state[stepper.FAULTS] == (stepper.FAULT_DRY if timed else 0)
    assert not rig.bench.engines[0].rises


@pytest.mark.parametrize("young", [0, 3, 20, 300])
def test_one_pass_between_two_long_absences(young):
    """Two long calls on the REPL with a single pass of the main loop between them: no motor's queue
    runs dry.

    sum(range(30000)) keeps the passes away for 64 ms on an RP2040, os.statvfs("/") for 47.
    """
    rig = Rig(8)
    for motor in range(8):
        rig[motor].set_speed(20_000, 100_000)
        rig.move_to(motor, 40_000)
    rig.run(young)
    for absence in 64, 47, 64:
        rig.bench.run(absence)
        rig.axes.feed()
    rig.bench.run(47)
    assert rig.bench.state[stepper.FAULTS] == 0


def test_a_pass_fills_many_low_queues_only_as_far_as_needed():
    """One queue is filled, the others only until they are no longer low."""
    rig = Rig(8)
    for motor in range(8):
        rig[motor].set_speed(20_000, 100_000)
        rig.move_to(motor, 40_000)
    rig.run(400)

    def queued():
        blocks = [rig[motor].block for motor in range(8)]
        return [(b[stepper.WRITE_INDEX] - b[stepper.READ_INDEX]) & 0xFFFFFFFF for b in blocks]

    while max(queued()) >= LOW:
        rig.bench.run(1)
    rig.axes.feed(True)
    assert sorted(queued())[:-1] == [LOW] * 7
    assert max(queued()) > AHEAD


# ---------------------------------------------------------- phases that begin and end within a tick


def play(phases):
    """Play (duration in 1/64 tick, step at its end, velocity there in 1/64 step per tick) from rest
    at step 0."""
    rig = Rig()
    axis = rig[0]
    axis.begin_plan(rig.bench)
    axis.block[stepper.PLANNED] = stepper.PLAN_SEGMENTS | stepper.PLAN_TIMED
    axis.set_more_to_come(True)
    r = array("i", [0] * 6)
    before = 0
    for duration, step, velocity in phases:
        for register, number in ((0, duration), (2, before), (4, velocity)):
            reals.put(r, register, number, -6)
        axis.append_phase(0, 2, 4, r, word(step), 1)
        before = velocity
    axis.set_more_to_come(False)
    axis.feed()
    axis.start(rig.bench)
    rig.to_rest()
    assert axis.block[stepper.FAULT] == 0, phases
    assert rig.place() == rig.bench.engines[0].position == phases[-1][1], phases


@pytest.mark.parametrize("sense", [1, -1])
@pytest.mark.parametrize("wait", [0, 1, 13, 32, 40, 63, 64, 65, 100])
def test_a_phase_that_ends_in_the_tick_of_its_start(wait, sense):
    """A ramp of a tick, less or next to nothing, beginning anywhere in the first ticks: its whole
    steps are not quite where its velocities lead, but each segment begins where the one before it
    ended."""
    for duration in sorted({0, 1, 7, 33, 60, 63, 64, 65, 128, 64 - wait % 64}):
        for velocity in (0, 20, 90, 237):
            if velocity > 4 * duration:
                continue  # more than 4 000 000 steps/s²
            way = round(velocity * duration / 64 / 64 / 2)
            on = way + round(velocity * 10 / 64)
            rest = on + round(velocity * 10 / 64)
            play(
                [
                    *([(wait, 0, 0)] if wait else []),
                    (duration, sense * way, sense * velocity),
                    (640, sense * on, sense * velocity),
                    (1280, sense * rest, 0),
                ]
            )
