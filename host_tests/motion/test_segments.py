"""Cubics and their segments compared with exact fractions."""

import random
from array import array
from fractions import Fraction

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from framestep.base.native import addressof
from framestep.motion import reals, segments
from framestep.motors import feeder, queue_cut
from framestep.pulse import stepper
from host_tests.pulse.engine import FINE, ONE

CYCLES = 125_000
UNIT = Fraction(1, 2**46)  # of a coefficient


def number(cubic, k):
    """Return a coefficient: P (without whole steps), G1, G2 or G3."""
    assert 0 <= cubic[k + 1] < 2**30
    bits = 58 if k == segments.G3 else 46
    return Fraction(cubic[k] * 2**30 + cubic[k + 1], 2**bits)


def coefficients(cubic):
    p = cubic[segments.WHOLE] + number(cubic, segments.P)
    return [p, number(cubic, segments.G1), number(cubic, segments.G2), number(cubic, segments.G3)]


def polynomial(p, x):
    return p[0] + x * (p[1] + x * (p[2] + x * p[3]))


def moved(p, h):
    """Return the coefficients as seen from x = h."""
    return [
        polynomial(p, h), p[1] + 2 * h * p[2] + 3 * h * h * p[3], p[2] + 3 * h * p[3], p[3],
    ]  # fmt: skip


@st.composite
def cubics(draw):
    """Draw cubics of real motors: 500 steps per tick, 4 steps per tick², and jerks that lead there
    within some ticks."""
    cubic = array("i", [0] * segments.CUBIC_WORDS)
    cubic[segments.WHOLE] = draw(st.integers(-(2**31) + 2**15, 2**31 - 2**15))
    low = st.integers(0, 2**30 - 1)
    cubic[segments.P], cubic[segments.P + 1] = draw(st.integers(0, 2**16 - 1)), draw(low)
    for k, greatest, bits in (segments.G1, 500, 16), (segments.G2, 2, 16), (segments.G3, 1 / 8, 28):
        high = int(greatest * 2**bits)
        cubic[k], cubic[k + 1] = draw(st.integers(-high, high - 1)), draw(low)
    return cubic


@given(cubics(), st.integers(0, 2**30 - 1), st.integers(0, 4), st.booleans())
@example(array("i", [0, 0, 0, -1, 2**30 - 1, -1, 2**30 - 1, -1, 2**30 - 1]), 2**30 - 1, 4, True)
@example(array("i", [0, 0, 0, -1, 0, -1, 0, -1, 0]), 1, 0, False)
def test_shift(cubic, fraction, powers, back):
    h = Fraction(fraction, 2**30) * 2**powers * (-1 if back else 1)
    before = coefficients(cubic)
    segments.shift(cubic, fraction, powers, back)
    # each product is cut off at its 46th bit, before the powers of two are restored
    n = 2**powers
    for k, (is_, ideal) in enumerate(zip(coefficients(cubic), moved(before, h), strict=True)):
        bound = UNIT * (16 * n * n if k == 0 else 16 * n * n if k == 1 else 8 * n)
        assert abs(is_ - ideal) <= bound
    assert 0 <= cubic[segments.P] < 2**16


@pytest.mark.parametrize("above", [0, 1, 8])
def test_shifted_a_hair_past_the_end_of_the_range(above):
    """From `above` steps over the lowest position, by as much and 2^-24 of a step more."""
    cubic = array("i", [0] * segments.CUBIC_WORDS)
    cubic[segments.WHOLE] = above - 2**31
    cubic[segments.G1], cubic[segments.G1 + 1] = -(above << 14) - 1, 2**30 - 2**20
    segments.shift(cubic, 2**30 - 1, 2, 0)
    assert coefficients(cubic)[0] == -(2**31)


@pytest.mark.parametrize("ticks", [1009, 10_007, 30_011])
@pytest.mark.parametrize("top", [499, -499, 50, -1])
def test_moved_along_for_half_a_minute(ticks, top):
    """In steps of up to 32 ticks, from full velocity to rest: the error is below 0.01 step."""
    cubic = array("i", [0] * segments.CUBIC_WORDS)
    r = array("i", [0] * 8)
    # a curve that comes to rest at the end: v·(1 - (x/T)²)
    reals.put(r, 0, top, 0)
    segments.coefficient(cubic, segments.G1, r, 0)
    reals.put(r, 2, ticks, 0)
    reals.put(r, 4, -3, 0)
    reals.multiply(r, 4, 4, 2)
    reals.multiply(r, 4, 4, 2)
    reals.divide(r, 6, 0, 4)
    segments.coefficient(cubic, segments.G3, r, 6)
    ideal = coefficients(cubic)
    done = 0
    while done < ticks:
        step = min(32, ticks - done)
        segments.shift(cubic, step << 24, 6, 0)
        done += step
    assert abs(coefficients(cubic)[0] - polynomial(ideal, ticks)) < Fraction(1, 100)
    assert abs(coefficients(cubic)[1] - moved(ideal, Fraction(ticks))[1]) < Fraction(1, 10**6)


def new_block():
    block = array("i", [0] * stepper.BLOCK_WORDS)
    queue = array("i", [0] * (stepper.SEGMENTS * stepper.SEGMENT_WORDS))
    block[stepper.QUEUE] = addressof(queue)
    block[stepper.WHOLE_SPAN] = CYCLES
    return block, queue


def added_up(segment):
    """Return where the kernel gets with a segment, and its velocity and acceleration there."""
    ticks, whole, rem, v, a, j = segment[:6]
    position = whole * ONE + rem
    for _ in range(ticks):
        position += v
        v += a >> 5
        a += j
    return Fraction(position, ONE), Fraction(v, ONE), Fraction(a, FINE)


@pytest.mark.parametrize(("above", "at"), [(-(2**31), (-(2**31), 0)), (-(2**31) + 5, None)])
def test_cut_a_hair_past_the_end_of_the_range(above, at):
    """Rounding may take the place of a cut there."""
    work = array("i", [0] * feeder.WORK_WORDS)
    ticks, velocity = 4, -3
    work[feeder.CUT :] = array("i", [above, 2, velocity, 0, 0, ticks])
    cubic = array("i", [0] * segments.CUBIC_WORDS)
    queue_cut.start_cubic(cubic, work)
    expected = at or (above - 1, (ONE - 10) >> 6)
    assert (cubic[segments.WHOLE], cubic[segments.P]) == expected


@given(cubics(), st.integers(1, segments.LONGEST))
def test_cut(cubic, ticks):
    """A segment leads to the cubic's position, but for some thousandths of a step of rounding."""
    block, queue = new_block()
    block[stepper.WRITE_INDEX] = 2**30 - 1  # the last slot, then the first
    before = coefficients(cubic)
    segments.cut(cubic, block, ticks)
    assert block[stepper.WRITE_INDEX] == 0
    segment = list(queue[15 * stepper.SEGMENT_WORDS :])
    assert segment[0] == ticks
    assert segment[6:] == [0, CYCLES]
    start = Fraction(segment[1] * ONE + segment[2], ONE)
    assert 0 <= before[0] - start < Fraction(1, ONE)
    end, *_ = added_up(segment)
    # velocity is cut off at Q22, acceleration rounded to Q22 tick by tick, jerk cut off at Q27
    bound = (
        Fraction(1 + 2 * ticks, ONE) + Fraction(ticks**2, 2 * ONE) + Fraction(ticks**3, 6 * FINE)
    )
    assert abs(end - polynomial(before, ticks)) <= bound


@given(cubics(), st.integers(1, 2**30 - 1))
def test_bridge(cubic, part):
    """A tick in which the phase changes: its displacement is exact."""
    block, queue = new_block()
    state = array("i", [0] * segments.OPEN_WORDS)
    before = coefficients(cubic)
    segments.mark(state, cubic)
    segments.shift(cubic, part, 0, 0)
    for k in segments.G2, segments.G3:
        cubic[k] = cubic[k + 1] = 0
    segments.shift(cubic, 2**30 - part, 0, 0)
    segments.bridge(state, cubic, block, part)
    segment = list(queue[: stepper.SEGMENT_WORDS])
    assert (segment[0], segment[5], segment[6]) == (1, 0, 1)
    start = Fraction(segment[1] * ONE + segment[2], ONE)
    assert 0 <= before[0] - start < Fraction(1, ONE)
    end, *_ = added_up(segment)
    assert 0 <= coefficients(cubic)[0] - end < Fraction(1, ONE)
    assert segment[7] == CYCLES or cubic[segments.G1] == cubic[segments.G1 + 1] == 0


@given(st.integers(1, 2**30 - 1))
@example(2**30 - 1)
@example(2**29 + 1)
def test_the_tick_in_which_a_motor_comes_to_rest(part):
    block, queue = new_block()
    state = array("i", [0] * segments.OPEN_WORDS)
    cubic = array("i", [7, 0, 0, 0, 0, 0, 0, 0, 0])
    segments.mark(state, cubic)
    segments.bridge(state, cubic, block, part)
    assert queue[7] == pytest.approx(part / 2**30 * CYCLES, abs=CYCLES / 2**14 + 1)


@given(cubics())
def test_settle(cubic):
    before = coefficients(cubic)[0]
    segments.settle(cubic)
    whole = cubic[segments.WHOLE]
    rest = abs(before - round(before))
    if rest < Fraction(1, 16):
        assert list(cubic) == [round(before), 0, 0, 0, 0, 0, 0, 0, 0]
    else:
        assert list(cubic) == [whole, cubic[segments.P], 0, 0, 0, 0, 0, 0, 0]
        assert 0 <= before - whole - Fraction(cubic[segments.P], 2**16) < Fraction(1, 2**16)


@pytest.mark.parametrize("step", [-58, 0, 7, -(2**31)])
@pytest.mark.parametrize("part", [-4095, -1536, -1, 1, 4095])
def test_settled_beside_its_step(step, part):
    """A cubic that rests next to a step (smoothing.py) settles on that step."""
    cubic = array("i", [0] * segments.CUBIC_WORDS)
    segments.snap(cubic, array("i", [step, part]))
    segments.settle(cubic)
    assert list(cubic) == [step, 0, 0, 0, 0, 0, 0, 0, 0]


@given(st.integers(-(2**31), 2**31 - 1), st.integers(0, 65535), cubics())
def test_snap(step, part, cubic):
    before = coefficients(cubic)
    segments.snap(cubic, array("i", [step, part]))
    assert coefficients(cubic) == [step + Fraction(part, 65536), *before[1:]]


@given(
    st.integers(-(2**30) + 1, 2**30 - 1),
    st.integers(-75, -17),
    st.sampled_from([segments.G1, segments.G2]),
)
def test_coefficient(mantissa, exponent, k):
    r = array("i", [0] * 4)
    cubic = array("i", [0] * segments.CUBIC_WORDS)
    reals.put(r, 0, mantissa, exponent)
    value = r[0] * Fraction(2) ** r[1]
    segments.coefficient(cubic, k, r, 0)
    assert 0 <= value - number(cubic, k) < UNIT
    # and back
    segments.velocity(r, 2, cubic, k)
    exact = number(cubic, k)
    assert abs(r[2] * Fraction(2) ** r[3] - exact) <= abs(exact) * Fraction(1, 2**28)


@given(st.integers(-(2**30) + 1, 2**30 - 1), st.integers(-90, -29))
def test_third_coefficient(mantissa, exponent):
    r = array("i", [0] * 4)
    cubic = array("i", [0] * segments.CUBIC_WORDS)
    reals.put(r, 0, mantissa, exponent)
    segments.coefficient(cubic, segments.G3, r, 0)
    assert 0 <= r[0] * Fraction(2) ** r[1] - number(cubic, segments.G3) < Fraction(1, 2**58)


STEPS = st.one_of(
    st.integers(-(2**31), 2**31 - 1),
    st.integers(-(2**31), -(2**31) + 1000),
    st.integers(2**31 - 1000, 2**31 - 1),
    st.integers(-1000, 1000),
    st.integers(-(2**22), 2**22),
)


@given(STEPS, STEPS, st.integers(0, 2**16 - 1), st.integers(0, 2**30 - 1))
@example(2**31 - 1, -(2**31), 0, 0)
@example(-(2**31), 2**31 - 1, 2**16 - 1, 2**30 - 1)
@example(2**21, 0, 0, 0)
@example(-(2**21), 0, 0, 1)
@example(5, 5, 1, 0)
def test_distance(target, whole, fraction, low):
    """From any position to any other, at most 2^32 steps away."""
    cubic = array("i", [0] * segments.CUBIC_WORDS)
    cubic[segments.WHOLE], cubic[segments.P], cubic[segments.P + 1] = whole, fraction, low
    r = array("i", [0] * 2)
    segments.distance(r, 0, array("i", [0, target]), 1, cubic)
    ideal = target - coefficients(cubic)[0]
    size = abs(ideal)
    bound = (
        Fraction(1, 2**16)
        if size < 2**14 - 1
        else Fraction(1, 2**9)
        if size < 2**21 - 1
        else 1 + size / 2**28
    )
    assert abs(r[0] * Fraction(2) ** r[1] - ideal) <= bound


def test_mirror():
    """A coupled motor moves alike, or in the opposite sense, from its own base."""
    cubic = array("i", [0] * segments.CUBIC_WORDS)
    for turned in 0, 1:
        for seed in range(300):
            rng = random.Random(seed)
            cubic[:] = array(
                "i",
                [
                    rng.randrange(-(10**6), 10**6),
                    rng.randrange(2**16),
                    rng.randrange(2**30),
                    *(
                        n
                        for high in (500 << 16, 2 << 16, 2**25)
                        for n in (rng.randrange(-high, high), rng.randrange(2**30))
                    ),
                ],
            )
            (block, queue), (other, others) = new_block(), new_block()
            base = array("i", [rng.randrange(-(10**6), 10**6)])
            ticks = rng.randrange(1, 33)
            segments.cut(cubic, block, ticks)
            segments.mirror(block, other, base, turned)
            end, *_ = added_up(queue[:8])
            mirrored, *_ = added_up(others[:8])
            assert mirrored - base[0] == (-end if turned else end)
            assert 0 <= others[2] < ONE
