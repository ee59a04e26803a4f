"""The tick kernel compared with ideal motions: the time of each edge, and the end of a motion.

Late interrupts are in test_stepper_clock.py.
"""

from fractions import Fraction

import numpy as np
import pytest

from framestep.pulse import stepper
from framestep.pulse.engine import LEAD
from host_tests.pulse.engine import (
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

# ---------------------------------------------------------------- edges


@pytest.mark.parametrize("way", [1, -1])
@pytest.mark.parametrize(
    "rate",
    [
        1, 7, 10, 333, 1000, 3001, 12_345, 50_000, 99_700, 100_000, 127_999, 128_001, 250_000,
        333_333, 350_000,
    ],
)  # fmt: skip
def test_steady(rate, way):
    """design: half a microsecond, whatever the rate."""
    bench = Bench().settle()
    ticks = 3100 if rate < 10 else 400
    profile = steady(rate * way, ticks)
    start = bench.play([profile.segments(rest=False)], ticks - 10)
    error = errors_us(bench, start, profile, ticks=ticks - 10)
    assert len(error) >= min(rate // 4, 2)
    assert np.abs(error).max() < 0.5


@pytest.mark.parametrize("rate", [400_000, 499_999, 500_000])
def test_fastest(rate):
    test_steady(rate, 1)


@pytest.mark.parametrize("acceleration", [1000, 20_000, 100_000])
def test_ramp(acceleration):
    """1.5 µs up to 100 000 steps/s²; sum and end exact."""
    bench = Bench().settle()
    profile = trapezoid(500, Fraction(acceleration, 10**6), 500)
    start = bench.play([profile.segments()])
    error = errors_us(bench, start, profile)
    assert np.abs(error).max() < 1.5
    assert bench.block()[stepper.POSITION] == profile.end
    at_rest(bench)


def test_two_steps_in_the_tick_after_one_without():
    """At a step per tick a ramp may have its steps just before a tick and just after it."""
    bench = Bench().settle()
    a = Fraction(1_999_999, 2_000_000_000)  # at 499.99975 after 1000 ticks
    profile = trapezoid(1100, a, 100)
    assert np.bincount(profile.steps()[0].astype(int))[998:1002].tolist() == [1, 0, 2, 1]
    start = bench.play([profile.segments()])
    assert np.abs(errors_us(bench, start, profile, ticks=1090)).max() < 2


@pytest.mark.parametrize("acceleration, limit_us", [(400_000, 8), (1_000_000, 20), (4_000_000, 60)])
def test_steep_ramp(acceleration, limit_us):
    """Beyond 100 000 steps/s² the first steps are less exact."""
    bench = Bench().settle()
    profile = trapezoid(100, Fraction(acceleration, 10**6), 100)
    start = bench.play([profile.segments()])
    error = errors_us(bench, start, profile)
    assert np.abs(error).max() < limit_us
    times, _ = profile.steps()
    assert np.abs(error[(times > 101) & (times < 199)]).max() < 0.5
    at_rest(bench)


def test_jerk_limited_ramp():
    """Segments with a jerk, along a cubic: 512 ticks up to 16 steps per tick."""
    j = Fraction(1, 4096)
    profile = Profile([(256, 0, j), (256, 256 * j, -j), (100, 0), (256, 0, -j), (256, -256 * j, j)])
    bench = Bench().settle()
    start = bench.play([profile.segments()])
    error = errors_us(bench, start, profile)
    assert np.abs(error).max() < 2
    assert bench.block()[stepper.POSITION] == profile.end
    at_rest(bench)


@pytest.mark.parametrize("hold_us", [0, 7, 50])
@pytest.mark.parametrize("setup_us", [0, 5, 20, 200])
@pytest.mark.parametrize("width", [0, 3, 15, 224 + 12])
@pytest.mark.parametrize("invert", [False, True])
def test_reversals(setup_us, width, invert, hold_us):
    """Back and forth: each change of direction is between two pulses, `hold` after the first and
    `setup` before the second."""
    bench = Bench(
        width=width, setup=setup_us * PER_US, invert=invert, hold=hold_us * PER_US
    ).settle()
    a = Fraction(1, 20)
    profile = Profile([(100, a), (200, -a), (173, a), (96, -a), (23, a)], p=0)
    assert profile.final == 0
    start = bench.play([profile.segments()])
    error = errors_us(bench, start, profile)
    engine = bench.engines[0]
    # A step directly after a turn waits for the set-up time; here only a long one matters.
    high_us = bench.engines[0].high_cycles / PER_US
    assert np.abs(error).max() < max(3, setup_us + hold_us + 2 * high_us)
    assert len(engine.turns) == np.count_nonzero(np.diff(engine.ways)) + (
        1 if invert == 0 else 0
    ) or len(engine.turns)
    rises = np.array(engine.rises)
    for at in engine.turns:
        later = rises[rises > at]
        earlier = rises[rises <= at]
        assert not len(later) or later[0] - at >= setup_us * PER_US
        assert not len(earlier) or at - earlier[-1] > engine.high_cycles + hold_us * PER_US
    assert np.diff(rises).min() >= 2 * engine.high_cycles
    at_rest(bench)


@pytest.mark.parametrize(
    ("setup_us", "hold_us", "apart_us"), [(0, 0, 0.25), (5, 0, 1), (0, 7, 1), (200, 50, 50)]
)
@pytest.mark.parametrize("invert", [False, True])
def test_reversals_with_steps_on_both_edges(setup_us, hold_us, apart_us, invert):
    """Each edge is a step, `apart` after the one before; a change of direction is `hold` after the
    edge before it and `setup` before the next."""
    apart = int(apart_us * PER_US)
    bench = Bench(
        setup=setup_us * PER_US, invert=invert, hold=hold_us * PER_US, apart=apart
    ).settle()
    a = Fraction(1, 40) if apart_us > 10 else Fraction(1, 10)
    profile = Profile([(100, a), (200, -a), (173, a), (96, -a), (23, a)], p=0)
    start = bench.play([profile.segments()])
    assert np.abs(errors_us(bench, start, profile)).max() < max(3, setup_us + hold_us + apart_us)
    engine = bench.engines[0]
    steps = np.array(engine.rises)
    assert engine.turns
    for at in engine.turns:
        later, earlier = steps[steps > at], steps[steps <= at]
        assert not len(later) or later[0] - at >= setup_us * PER_US
        assert not len(earlier) or at - earlier[-1] > max(hold_us * PER_US, 3)
    assert np.diff(steps).min() >= apart
    at_rest(bench)


@pytest.mark.parametrize("rate", [333, 100_000, 499_999])
def test_steady_with_steps_on_both_edges(rate):
    """As with pulses, at rates that pulses of this width do not allow."""
    bench = Bench(apart=PER_US).settle()
    ticks = 400
    profile = steady(rate, ticks)
    start = bench.play([profile.segments(rest=False)], ticks - 10)
    error = errors_us(bench, start, profile, ticks=ticks - 10)
    assert len(error) >= min(rate // 4, 2)
    assert np.abs(error).max() < 0.5


@pytest.mark.parametrize("apart_us", [0, 50])
def test_a_start_whether_or_not_the_engine_has_run_dry(apart_us):
    """A motor starts two ticks after its last step, which came at any time of its tick: the steps
    come when they are due."""
    offsets = []
    for part in range(0, 400, 3):
        bench = Bench(apart=apart_us * PER_US, jitter_us=0).settle()
        first = Profile([(3, 0)], v=Fraction(1000 + 3 * part, 2000))
        bench.play([first.segments(rest=False)], 3)
        block = bench.block()
        block[stepper.MODE] = stepper.IDLE
        block[stepper.VELOCITY] = block[stepper.FRACTION] = 0
        block[stepper.IDLE_AT] = bench.state[stepper.TICKS]
        bench.run(1)
        made = len(bench.engines[0].rises)
        then = Profile([(20, 0)], p=block[stepper.POSITION], v=Fraction(3))
        start = bench.play([then.segments(rest=False)], 15)
        steps = np.array(bench.engines[0].rises[made + 5 : made + 20]) - start
        offsets.append(float(np.median(steps / PER_TICK - np.arange(6, 21) / 3)) * 1000)
    assert np.ptp(offsets) < 0.1


def test_trembling_makes_no_steps():
    """A motor at rest on a step that moves by less than a step to either side makes none."""
    bench = Bench().settle()
    a = Fraction(9, 1000)
    profile = Profile([(10, a), (20, -a), (10, a)], p=5)
    assert profile.pieces[1].position(10) == Fraction(59, 10)
    bench.block()[stepper.POSITION] = 5
    bench.play([profile.segments()])
    assert bench.engines[0].rises == []
    assert bench.block()[stepper.POSITION] == 5


def test_direction_pin_stays_while_nothing_turns():
    bench = Bench().settle()
    for _ in range(3):
        bench.play([trapezoid(50, Fraction(1, 25), 0).segments()])
        bench.block()[stepper.POSITION] = 0
    assert len(bench.engines[0].turns) == 1  # up, once


@pytest.mark.parametrize("width", range(16))
def test_widths(width):
    """Nearly as fast as a pulse width allows, with equal times high and low."""
    bench = Bench(width=width).settle()
    least = 2 * (34 + 32 * width)
    rate = min(int(0.98 * 125e6 / least), 500_000)
    profile = steady(rate, 100)
    start = bench.play([profile.segments(rest=False)], 90)
    error = errors_us(bench, start, profile, ticks=90)
    assert np.abs(error).max() < 0.5
    assert np.diff(bench.engines[0].rises).min() >= least


def test_any_phase_within_a_tick():
    """A motion may begin and end between two steps and within a tick; each edge is at its right
    time."""
    for numerator in range(1, 200, 7):
        bench = Bench().settle()
        p = Fraction(numerator, 200)
        profile = Profile([(37, 0)], p=p, v=Fraction(numerator + 50, 60))
        bench.block()[stepper.FRACTION] = int(p * ONE)
        start = bench.play([profile.segments(rest=False)], 30)
        error = errors_us(bench, start, profile, ticks=30)
        assert np.abs(error).max() < 0.5


@pytest.mark.parametrize("rate", [125, 250, 500, 1000, 2000, 4000])
def test_steps_on_the_ends_of_ticks(rate):
    """If each step falls on the end of a tick, rounding must not move steps to another tick: none
    in one, two in the next."""
    for hair in range(-40, 41, 8):
        bench = Bench().settle()
        profile = Profile([(64, Fraction(rate, 64_000)), (300, 0)])
        segments = [
            (t, p, f, v + hair // 8, *rest) for t, p, f, v, *rest in profile.segments(rest=False)
        ]
        start = bench.play([segments], 340)
        error = errors_us(bench, start, profile, ticks=340)
        assert np.abs(error[-rate // 20 :]).max() < 0.5


# ---------------------------------------------------------------- several motors


@pytest.mark.parametrize("order", [(0, 1, 2, 3, 4, 5, 6, 7), (7, 3, 5, 1, 0, 2, 6, 4)])
def test_motors_start_in_step(order):
    bench = Bench(8).settle()
    profile = trapezoid(200, Fraction(1, 10), 100)
    bench.play([profile.segments()] * 8, motors=order)
    first = np.array([bench.times(motor)[0] for motor in range(8)])
    assert (np.ptp(first, axis=0) / PER_US).max() < 2.5
    for motor in range(8):
        at_rest(bench, motor)


def test_motors_that_start_later_are_in_step_too():
    """The same motion some ticks later has the same edges, as many ticks later."""
    bench = Bench(4, jitter_us=20).settle()
    profile = trapezoid(100, Fraction(1, 10), 50)
    segments = profile.segments()
    starts = []
    for motor in range(4):
        bench.put(motor, segments)
        bench.start(motor)
        starts.append(bench.due)
        bench.run(7 + motor)
    bench.run(500)
    first = [np.array(bench.engines[motor].rises) - starts[motor] for motor in range(4)]
    assert (np.ptp(first, axis=0) / PER_US).max() < 2.5


@pytest.mark.parametrize("pause", [0, 1, 2, 3, 4, 5, 10])
@pytest.mark.parametrize("late_us", [0, 700, 1600])
def test_start_again_soon(pause, late_us):
    """After any pause, the engine busy or not, a motion begins in step with the others."""
    bench = Bench(2, jitter_us=0).settle()
    short = trapezoid(20, Fraction(1, 10), 0)
    bench.put(0, short.segments())
    bench.start(0)
    while bench.block(0)[stepper.MODE] & stepper.DRAIN == 0:
        bench.tick()
    bench.run(pause)
    profile = trapezoid(60, Fraction(1, 10), 0)
    before = len(bench.engines[0].rises)
    bench.put(0, [(t, p + int(short.end), *rest) for t, p, *rest in profile.segments()])
    bench.put(1, profile.segments())
    bench.start(0, 1)
    if late_us:
        bench.off((bench.due - bench.now) / PER_US - 1, late_us)
    bench.run(200)
    again = np.array(bench.engines[0].rises[before:])
    other = np.array(bench.engines[1].rises)
    assert np.abs(again - other).max() / PER_US < 2.5
    for motor in 0, 1:
        at_rest(bench, motor)
        assert bench.engines[motor].fullest <= 8


def test_eight_motors_fill_no_fifo():
    """Three commands per tick in all motors for as long as possible: 3 steps per tick while the
    velocity changes."""
    bench = Bench(8, jitter_us=60).settle()
    profile = trapezoid(400, Fraction(1, 100), 0)  # a hundred ticks with three steps each, twice
    bench.play([profile.segments()] * 8, motors=range(8))
    assert max(engine.fullest for engine in bench.engines) <= 8  # a lost command fails by itself


# ---------------------------------------------------------------- the end of a motion


@pytest.mark.parametrize(
    "rate, brake", [(100, 4), (20_000, Fraction(1, 50)), (350_000, Fraction(3, 2))]
)
def test_queue_runs_dry(rate, brake):
    """A fault, and a ramp with BRAKE from the present velocity."""
    bench = Bench().settle()
    bench.block()[stepper.BRAKE] = int(Fraction(brake) * ONE)
    profile = steady(rate, 64)
    start = bench.play([profile.segments(rest=False)])
    block = bench.block()
    assert block[stepper.FAULT] == bench.state[stepper.FAULTS] == stepper.FAULT_DRY
    ticks = int(Fraction(rate, 1000) // brake)
    v = Fraction(rate, 1000)
    # displacements v, v - brake, v - 2·brake, … : the acceleration begins a tick later
    ideal = Profile([(64, 0), (1, 0), (ticks, -Fraction(brake))], v=v)
    assert abs(block[stepper.POSITION] - ideal.end) <= float(v) + 2
    times, ways = bench.times()
    assert (ways == 1).all()
    assert len(times) == block[stepper.POSITION]
    rates = 1e6 * PER_US / np.diff(times)
    assert rates.max() < rate * 1.01 + 1
    assert times[-1] < start + (64 + ticks + 3) * PER_TICK


def test_a_segment_that_begins_elsewhere():
    """The plan and the motor disagree: a fault and a ramp, and no step to make up for it."""
    for off in -1000, -3, -1, 1, 2, 5, 1024, 2**20:
        for fraction in 0, ONE // 4, ONE // 2:
            bench = Bench().settle()
            bench.block()[stepper.BRAKE] = ONE // 50
            profile = steady(3000, 64)
            first, second = profile.segments(rest=False)
            second = (second[0], second[1] + off, second[2] + fraction, *second[3:])
            bench.play([[first, second]])
            block = bench.block()
            assert block[stepper.FAULT] == bench.state[stepper.FAULTS] == stepper.FAULT_PIN
            times, ways = bench.times()
            assert (ways == 1).all()
            assert len(times) == block[stepper.POSITION]
            assert 96 + 225 - 6 <= len(times) <= 96 + 225 + 6
            assert np.diff(times).min() > 0.98 * PER_TICK / 3


def test_rounding_at_a_joint_is_taken_in():
    """Segments disagree by a rounding error: the next one's position counts, without a fault."""
    for hair in -30, -1, 1, 30:
        for p in Fraction(0), Fraction(999_999, 1_000_000), Fraction(1, 3):
            bench = Bench().settle()
            bench.block()[stepper.FRACTION] = int(p * ONE)
            profile = Profile([(32, 0), (32, 0), (1, 0)], p=p, v=1)
            segments = profile.segments(rest=False)
            t, whole, fraction, *rest = segments[1]
            place = whole * ONE + fraction + hair
            segments[1] = (t, place // ONE, place % ONE, *rest)
            bench.play([segments], 60)
            assert bench.state[stepper.FAULTS] == 0
            # full velocity from the first tick on: no real motion begins like that
            rises = bench.engines[0].rises[2:]
            assert np.abs(np.diff(rises) / PER_TICK - 1).max() < 1e-3


@pytest.mark.parametrize("rate", [-200_000, -777, 15, 5_000, 60_000, 350_000])
@pytest.mark.parametrize("decel", [Fraction(1, 1000), Fraction(1, 50), Fraction(1), Fraction(4)])
@pytest.mark.parametrize("after", [40, 41, 64])
def test_halt(rate, decel, after):
    """From the next tick on slower by `decel` in each tick; the motor is where its steps have taken
    it."""
    if abs(rate) / decel > 3_000_000:
        decel *= 100
    bench = Bench().settle()
    block = bench.block()
    bench.play([steady(rate, 200).segments(rest=False)], after)
    made = len(bench.engines[0].rises)
    places = []
    bench.after_tick.append(
        lambda: places.append(block[stepper.POSITION] + block[stepper.FRACTION] / ONE)
    )
    bench.tick()
    places.clear()
    places.append(block[stepper.POSITION] + block[stepper.FRACTION] / ONE)
    stepper.halt(block, 1, int(decel * ONE), 0)
    v = Fraction(abs(rate), 1000)
    ticks = int(v // decel)
    bench.run(ticks + 2 + LEAD)
    at_rest(bench)
    gone = np.abs(np.diff(places))
    expected = [float(v - (k + 1) * decel) for k in range(ticks)]
    assert np.abs(gone[:ticks] - expected).max(initial=0) < 1e-3
    assert gone[ticks] < 1  # the rest of a step is dropped
    assert not gone[ticks + 1 :].any()
    times, ways = bench.times()
    assert (ways == (1 if rate > 0 else -1)).all()
    rates = 1e6 * PER_US / np.diff(times[made:])
    assert rates.max(initial=0) < abs(rate) * 1.01 + 1


def test_halt_while_speeding_up():
    """The stop begins with the velocity of that moment: no tick is faster than the one before."""
    for after in range(1, 70, 3):
        bench = Bench().settle()
        block = bench.block()
        bench.play([trapezoid(64, Fraction(1, 10), 64).segments()], after)
        places = []
        bench.after_tick.append(
            lambda b=block, p=places: p.append(b[stepper.POSITION] + b[stepper.FRACTION] / ONE)
        )
        bench.tick()
        stepper.halt(block, 1, ONE // 5, 0)
        bench.run(60)
        at_rest(bench)
        gone = np.diff(places[: places.index(places[-1])])
        assert (np.diff(gone) < 1e-4).all()
        assert len(gone) < 2 or (np.abs(np.diff(gone)[:-1] + 0.2) < 1e-3).all()


def test_halt_twice_takes_the_steeper():
    def stop(*rates):
        bench, *_ = moving(60_000)
        for rate in rates:
            stepper.halt(bench.block(), 1, rate, 0)
            bench.run(3)
        bench.run(4000)
        at_rest(bench)
        return bench.block()[stepper.POSITION]

    gentle, hard = ONE // 50, ONE // 5
    assert stop(gentle, hard) < stop(gentle)
    assert stop(hard, gentle) == stop(hard)


@pytest.mark.parametrize("when", ["idle", "started", "drained", "started while draining"])
def test_halt_without_motion(when):
    """It moves nothing, whatever the motor did before."""
    bench = Bench().settle()
    block = bench.block()
    if "drain" in when:
        # leave a motion that was cut off while speeding up
        bench.play([trapezoid(64, Fraction(1, 10), 64).segments()], 20)
        stepper.halt(block, 1, ONE, 0)
        while block[stepper.MODE] != stepper.DRAIN:
            bench.tick()
    place = block[stepper.POSITION]
    if "started" in when:
        bench.put(
            0,
            [
                (t, p + place, *rest)
                for t, p, *rest in trapezoid(64, Fraction(1, 10), 64).segments()
            ],
        )
        bench.start(0)
    stepper.halt(block, 1, ONE // 50, 0)
    bench.run(20)
    at_rest(bench)
    assert block[stepper.POSITION] == place
    assert block[stepper.READ_INDEX] == block[stepper.WRITE_INDEX]
    assert bench.state[stepper.FAULTS] == 0


def test_hidden_plans_come_back_to_their_motors():
    """The motor between them, at rest, gets none."""
    bench = Bench(3)
    timed = stepper.PLAN_SEGMENTS | stepper.PLAN_TIMED
    for motor in (0, 2):
        bench.block(motor)[stepper.PLANNED] = timed
    hidden = stepper.hide_planned(bench.state)
    assert stepper.moving(bench.state) == 0
    stepper.restore_planned(bench.state, hidden)
    assert [bench.block(motor)[stepper.PLANNED] for motor in range(3)] == [timed, 0, timed]
