"""The tick and its clock: interrupts that come late or never, and counters that wrap."""

from fractions import Fraction

import numpy as np
import pytest

from framestep.pulse import stepper
from host_tests.pulse.engine import (
    GRID_US,
    ONE,
    PER_TICK,
    PER_US,
    Bench,
    Profile,
    at_rest,
    errors_us,
    moving,
    steady,
    trapezoid,
)


@pytest.mark.parametrize("late_us", [30, 200, 1000, 1500, 1750])
@pytest.mark.parametrize("rate", [50, 3_000, 20_000, 350_000])
def test_late_interrupts_move_no_edge(late_us, rate):
    bench, profile, start = moving(rate)
    bench.off(2300, late_us)
    bench.off(7900, late_us)
    bench.run(80)
    error = errors_us(bench, start, profile, ticks=125)
    assert np.abs(error).max() < 0.5
    assert bench.state[stepper.FAULTS] == 0
    assert max(late_us - 1000, 0) <= bench.state[stepper.WORST_LATE] <= late_us + 5
    assert bench.engines[0].fullest <= 8


@pytest.mark.parametrize("rate", [333, 700, 1011, 1499, 2750, 5500])
def test_a_late_interrupt_finds_an_engine_that_has_run_dry(rate):
    """Its last pulse came early in the tick before. It goes on in time."""
    for late_us in (900, 1300, 1700):
        bench, profile, start = moving(rate)
        for k in range(30):
            bench.off((bench.due - bench.now) / PER_US - 1, late_us)
            bench.run(5 + k % 2)
        assert bench.state[stepper.WORST_LATE] >= late_us - 10
        assert np.abs(errors_us(bench, start, profile, ticks=170)).max() < 2, late_us
        assert bench.state[stepper.FAULTS] == 0


@pytest.mark.parametrize("phase_us", [0, 1, 400, 999])
@pytest.mark.parametrize("hole_us", [1900, 2000, 3000, 3300, 3999, 4500, 50_000])
@pytest.mark.parametrize(
    "rate, brake", [(5_000, Fraction(1, 50)), (5_000, Fraction(4)), (300_000, Fraction(1, 2))]
)
def test_hole_in_time(hole_us, phase_us, rate, brake):
    """Engines that ran dry: a fault, a ramp from the remaining velocity, never a burst. Then
    everything is as before."""
    bench, profile, _ = moving(rate, brake)
    was = bench.state[stepper.TICKS]
    bench.off((bench.due - bench.now) / PER_US - phase_us, hole_us + phase_us)
    dry = bench.engines[0].free_at
    before = len(bench.engines[0].rises)
    bench.run(2 + hole_us // 1000)
    block = bench.block()
    assert block[stepper.FAULT] == bench.state[stepper.FAULTS] == stepper.FAULT_LATE
    assert bench.state[stepper.TICKS] - was < 5  # missed ticks are not made up for
    for _ in range(2000):
        bench.tick()
        if block[stepper.MODE] == stepper.IDLE:
            break
    times, ways = bench.times()
    assert (ways == 1).all()
    assert len(times) == block[stepper.POSITION]
    after = np.concatenate([[dry], times[before:]])
    if len(after) > 2:
        rates = 1e6 * PER_US / np.diff(after)  # steps/s
        assert rates.max() < rate * 1.01
        # slower by the brake for every tick without a pulse
        left = rate - 1000 * float(brake) * ((after[1] - dry) / PER_TICK - 2)
        assert rates.max() < left * 1.02 + 1000
        ramp = rates[1:]
        assert (np.diff(ramp) < 0.01 * rate + 5).all()  # decreasing all the time
    else:
        assert rate < 1000 * float(brake) * (hole_us / 1000 + 4)
    # and a motion after that is exact again
    block[stepper.FAULT] = 0
    bench.run(50)
    made = len(times)
    profile = Profile([(100, Fraction(1, 10)), (100, Fraction(-1, 10))], p=block[stepper.POSITION])
    start = bench.play([profile.segments()])
    assert np.abs(errors_us(bench, start, profile, made=made)).max() < 2
    at_rest(bench)


@pytest.mark.parametrize("part", [0, 1, 2, 3])
@pytest.mark.parametrize("rate", [5_000, -5_000, 4_300, -12_700, 1_500])
def test_hole_between_two_steps(rate, part):
    """Wherever between two steps the gap is, the motor goes on no faster than before."""
    brake = Fraction(1, 50)
    bench = Bench(jitter_us=0).settle()
    block = bench.block()
    block[stepper.BRAKE] = int(brake * ONE)
    p = Fraction(part, 4)
    block[stepper.FRACTION] = int(p * ONE)
    bench.play([steady(rate, 400, p=p).segments(rest=False)], 50)
    dry = bench.engines[0].free_at
    before = len(bench.engines[0].rises)
    bench.off(0, 3000)
    bench.run(1000)
    times, ways = bench.times()
    assert block[stepper.MODE] == stepper.IDLE
    assert block[stepper.FAULT] == stepper.FAULT_LATE
    assert (ways == np.sign(rate)).all()
    assert len(times) == abs(block[stepper.POSITION])
    rates = 1e6 * PER_US / np.diff(np.concatenate([[dry], times[before:]]))
    assert len(rates) > 20
    assert rates.max() < abs(rate) * 1.01
    assert (np.diff(rates[1:]) < 0.01 * abs(rate) + 5).all()


def test_hole_at_rest_is_no_fault():
    """Writing flash while nothing moves: interrupts are off for 46 ms, then come in a burst."""
    for hole_us in range(40_000, 50_000, 777):
        bench = Bench(2, jitter_us=2).settle()
        bench.off(100, hole_us)
        bench.run(70 + 40)
        assert bench.state[stepper.FAULTS] == 0
        # the grid has been found again: the next motion has the whole lead
        profile = trapezoid(60, Fraction(1, 10), 0)
        start = bench.play([profile.segments()])
        assert np.abs(errors_us(bench, start, profile)).max() < 2
        assert bench.state[stepper.WORST_LATE] <= GRID_US
        at_rest(bench)


@pytest.mark.parametrize("late_us", range(50, 1800, 50))
def test_a_motion_just_after_a_late_interrupt_has_its_lead(late_us):
    """An interrupt that came late at rest does not make later ones late."""
    bench = Bench(jitter_us=0).settle()
    bench.off((bench.due - bench.now) / PER_US - 1, late_us)
    bench.run(4)
    profile = trapezoid(60, Fraction(1, 10), 0)
    start = bench.play([profile.segments()])
    assert np.abs(errors_us(bench, start, profile)).max() < 2
    assert bench.state[stepper.WORST_LATE] <= 100


@pytest.mark.parametrize("phase", range(6))
def test_hole_before_the_first_pulse(phase):
    """A motion requested just before a gap begins after it; one that is over stays over."""
    bench = Bench(jitter_us=0).settle()
    short = trapezoid(20, Fraction(1, 10), 0)
    bench.put(0, short.segments())
    bench.start(0)
    while bench.block(0)[stepper.MODE] & stepper.DRAIN == 0:
        bench.tick()
    bench.run(phase)
    profile = Profile([(60, Fraction(1, 10)), (60, Fraction(-1, 10))], p=short.end)
    bench.off(0, 4321)
    before = len(bench.engines[0].rises)
    bench.play([profile.segments()])
    assert bench.state[stepper.FAULTS] == 0
    again = np.array(bench.engines[0].rises[before:])
    ideal = profile.steps()[0] * PER_TICK
    error = (again - again[3]) - (ideal - ideal[3])
    assert np.abs(error[:-1]).max() / PER_US < 3
    at_rest(bench)


def test_replayed_calls_do_nothing():
    bench, profile, start = moving(30_000)
    for _ in range(30):
        bench.tick()
        before = [list(bench.state), list(bench.block()), bench.engines[0].free_at]
        for _ in range(50):
            bench.now += 7 * PER_US
            bench.kernel.tick(None)
        assert before == [list(bench.state), list(bench.block()), bench.engines[0].free_at]
    error = errors_us(bench, start, profile, ticks=75)
    assert np.abs(error).max() < 0.5


@pytest.mark.parametrize(
    "offset_us", [0, 2**30 - 50_000, 2**31 - 50_000, 2**32 - 50_000, 2**29 - 50_000]
)
def test_the_counter_wraps(offset_us):
    """The microsecond counter has 32 bits, the kernel's times 30."""
    bench = Bench(offset_us=offset_us).settle()
    profile = trapezoid(100, Fraction(1, 10), 100)
    start = bench.play([profile.segments()])
    error = errors_us(bench, start, profile)
    assert np.abs(error).max() < 2
    at_rest(bench)


@pytest.mark.parametrize(
    "counter", [0, 1, 2**29 - 1, 2**29, 2**29 + 5000, 2**30 - 1, 2**31 - 1, 2**31, 2**32 - 1000]
)
def test_wherever_the_counter_is_at_the_start(counter):
    bench = Bench(offset_us=counter).settle()
    profile = trapezoid(50, Fraction(1, 10), 0)
    start = bench.play([profile.segments()])
    assert np.abs(errors_us(bench, start, profile)).max() < 2
    at_rest(bench)
