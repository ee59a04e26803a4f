"""Operations of formulas: each compared with `reals` bit by bit, angles with double precision."""

import math
from array import array
from fractions import Fraction

import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st

from framestep.motion import compute as f
from framestep.motion import reals
from framestep_tools.move.kinematics import put

A, B, C, D = 0, 2, 4, 6
END = (f.END, 0, 0, 0)


@st.composite
def numbers(draw):
    """Draw a mantissa and an exponent as in a register, or 0."""
    size = draw(
        st.one_of(st.integers(2**29, 2**30 - 1), st.integers(0, 3).map(lambda n: 2**29 + n))
    )
    if not draw(st.integers(0, 9)):
        return 0, 0
    return draw(st.sampled_from([1, -1])) * size, draw(st.integers(-75, 15))


def registers(a, b=(0, 0)):
    return array("i", [*a, *b, 0, 0, 0, 0])


def computed(r, *operation):
    return f.compute(r, bytes(operation + END))


@given(numbers(), numbers())
@example((2**30 - 1, 0), (-(2**30) + 1, 0))
@example((2**30 - 1, 0), (2**30 - 1, 0))
@example((2**30 - 1, -1), (2**29, 0))  # the next smaller number: their difference is rounded to 0
@example((-(2**29), 0), (1 - 2**30, -1))
@example((2**29, 0), (2**30 - 1, -31))  # nothing remains of the smaller one
@example((2**30 - 1, -31), (2**29, 0))
def test_the_same_bits_as_reals(a, b):
    r = registers(a, b)
    for what, function in (
        (f.ADD, reals.add),
        (f.SUBTRACT, reals.subtract),
        (f.MULTIPLY, reals.multiply),
        (f.DIVIDE, reals.divide),
    ):
        if function is reals.divide and not b[0]:
            continue
        function(r, D, A, B)
        assert computed(r, what, C, A, B) == 1
        assert r[C : C + 2] == r[D : D + 2], what
    for what, function in ((f.COPY, reals.copy), (f.NEGATE, reals.negate)):
        function(r, D, A)
        computed(r, what, C, A, 0)
        assert r[C : C + 2] == r[D : D + 2], what
    assert r[:C] == array("i", [*a, *b])
    computed(r, f.SUBTRACT, A, A, B)
    reals.subtract(r, D, C, B)  # a register may be both operand and result
    order = reals.compare(registers(a, b), A, B)
    assert computed(registers(a, b), f.ABOVE, 0, A, B) == (order > 0)
    assert computed(registers(a, b), f.NOT_ABOVE, 0, A, B) == (order <= 0)
    for what, chosen in ((f.LESSER, a if order <= 0 else b), (f.GREATER, b if order <= 0 else a)):
        computed(r := registers(a, b), what, C, A, B)
        assert tuple(r[C : C + 2]) == chosen


@given(numbers())
@example((2**30 - 1, 0))
@example((2**30 - 1, 1))
@example((2**29, -3))
@example((2**29 + 1, -75))
def test_root(a):
    """Of a number below 0 it is 0."""
    computed(r := registers(a), f.ROOT, C, A, A)
    assert r[C] == 0 or 2**29 <= r[C] < 2**30
    of = max(Fraction(0), Fraction(a[0]) * Fraction(2) ** a[1])
    root = Fraction(r[C]) * Fraction(2) ** r[C + 1]
    assert abs(root * root - of) <= of * Fraction(1, 2**28)


@given(numbers(), st.integers(-128, 127))
def test_scaled_by_a_power_of_two(a, power):
    r = registers(a)
    reals.double(r, D, A, power)
    assert computed(r, f.SCALE, C, A, A, power + 128, 0, 0, 0) == 1
    assert r[C : C + 2] == r[D : D + 2]


@given(st.integers(0, 0xFFFF), st.integers(-128, 127))
def test_a_number(mantissa, exponent):
    r = registers((1, 1))
    reals.put(r, D, mantissa, exponent)
    assert computed(r, f.NUMBER, C, C, C, mantissa & 0xFF, mantissa >> 8, exponent + 128, 0) == 1
    assert r[C : C + 2] == r[D : D + 2]


@given(numbers())
@example((-(2**29), -29))
@example((2**29 + 1, -1))
@example((-1 - 2**29, -75))
def test_floor(a):
    computed(r := registers(a), f.FLOOR, C, A, A)
    assert Fraction(r[C]) * Fraction(2) ** r[C + 1] == math.floor(
        Fraction(a[0]) * Fraction(2) ** a[1]
    )


def test_what_does_not_hold_ends_the_formula():
    r = registers((2**29, -29), (2**29, -29))
    assert f.compute(r, bytes((f.ABOVE, 0, A, B) + (f.ADD, C, A, B) + END)) == 0
    assert r[C] == 0
    reals.put(r, A, 2, 0)
    assert f.compute(r, bytes((f.ABOVE, 0, A, B) + (f.ADD, C, A, B) + END)) == 1
    assert reals.value(r, C) == 3


DEGREES = st.one_of(
    st.floats(-50, 50),
    st.floats(-1e5, 1e5),
    st.integers(-40, 40).map(lambda n: 45.0 * n),
    st.floats(-1e-6, 1e-6),
)


@given(DEGREES)
@example(2.0**27 + 0.25)  # the greatest angles whose turns are counted have quarters of a degree
def test_sines(degrees):
    r = registers((0, 0))
    put(r, A, degrees)
    degrees = reals.value(r, A)
    computed(r, f.SINES, C, A, D)
    assert reals.value(r, C) == pytest.approx(math.sin(math.radians(degrees)), abs=2**-28)
    assert reals.value(r, D) == pytest.approx(math.cos(math.radians(degrees)), abs=2**-28)
    if degrees % 90 == 0:
        assert {abs(reals.value(r, C)), abs(reals.value(r, D))} == {0, 1}
    for at in (C, D):
        assert r[at] == 0 or 2**29 <= abs(r[at]) < 2**30 or r[at] == -(2**29)


PART = st.one_of(st.floats(-1, 1), st.floats(-1e-9, 1e-9), st.sampled_from([0.0, 1.0, -1.0, 0.5]))


@given(PART, PART)
@example(1.0, 1.0)
@example(-1.0, 2.0**-30)
def test_angle(y, x):
    assume(abs(y) > 1e-12 or abs(x) > 1e-12)
    r = registers((0, 0))
    put(r, A, y)
    put(r, B, x)
    y, x = reals.value(r, A), reals.value(r, B)
    computed(r, f.ANGLE, C, A, B)
    difference = reals.value(r, C) - math.degrees(math.atan2(y, x))
    assert min(abs(difference), abs(abs(difference) - 360)) < 4e-7


@pytest.mark.parametrize("k", range(16))
@pytest.mark.parametrize("beside", [-(2.0**-20), 0, 2.0**-20])
def test_angles_half_way_between_two_sixteenths(k, beside):
    """Here the series contributes most."""
    r = registers((0, 0))
    put(r, A, (2 * k + 1) / 32 + beside)
    put(r, B, 1)
    y = reals.value(r, A)
    computed(r, f.ANGLE, C, A, B)
    assert reals.value(r, C) == pytest.approx(math.degrees(math.atan(y)), abs=2e-7)


@pytest.mark.parametrize(
    "y, x, degrees", [(0, 0, 0), (0, -1, 180), (1, 0, 90), (-1, 0, -90), (1, 1, 45), (-1, -1, -135)]
)
def test_angles_of_corners(y, x, degrees):
    r = registers((0, 0))
    put(r, A, y)
    put(r, B, x)
    computed(r, f.ANGLE, C, A, B)
    assert reals.value(r, C) == degrees
