"""The planner's numbers compared with exact fractions."""

import math
from array import array
from fractions import Fraction

from hypothesis import assume, example, given
from hypothesis import strategies as st

from framestep.motion import reals

INT32 = st.integers(-(2**31), 2**31 - 1)
EXACT = Fraction(1, 2**29)  # of the result's size

A, B, C, D = 0, 2, 4, 6  # registers


def exact(r, a) -> Fraction:
    m, e = r[a], r[a + 1]
    assert m == 0 or 2**29 <= abs(m) < 2**30 or m == -(2**29), "not normalized"
    assert m or e == 0
    return Fraction(m) * Fraction(2) ** e


@st.composite
def registers(draw, count=2):
    """Draw registers with numbers of any size that occur in planning: 2^-60 to 2^60, and 0."""
    r = array("i", [0] * 16)
    for i in range(count):
        reals.put(r, 2 * i, draw(INT32), 0)
        if r[2 * i]:
            r[2 * i + 1] += draw(st.integers(-60, 30))
    return r


@given(INT32, st.integers(-40, 40))
@example(-(2**31), 0)
@example(2**31 - 1, 0)
@example(-(2**29), 3)
@example(2**30, -5)
@example(1, 0)
def test_put(value, exponent):
    r = array("i", [0, 0])
    reals.put(r, 0, value, exponent)
    assert (
        abs(exact(r, 0) - value * Fraction(2) ** exponent)
        <= EXACT * abs(value) * Fraction(2) ** exponent
    )


@given(INT32, INT32)
@example(2**31 - 1, -(2**31))
@example(-(2**31), 2**31 - 1)
@example(2**31 - 1, 2**31 - 2)
@example(0, 0)
def test_put_difference(x, y):
    r = array("i", [0, 0])
    reals.put_difference(r, 0, array("i", [7, x]), 1, array("i", [7, 7, y]), 2)
    assert abs(exact(r, 0) - (x - y)) <= EXACT * abs(x - y)


@given(registers())
def test_sums(r):
    a, b = exact(r, A), exact(r, B)
    reals.add(r, C, A, B)
    reals.subtract(r, D, A, B)
    # exact to the size of the greater number: cancelled digits are lost
    assert abs(exact(r, C) - (a + b)) <= EXACT * max(abs(a), abs(b))
    assert abs(exact(r, D) - (a - b)) <= EXACT * max(abs(a), abs(b))


@given(registers(1))
def test_a_number_less_itself_is_nothing(r):
    reals.subtract(r, C, A, A)
    assert exact(r, C) == 0
    reals.negate(r, B, A)
    assert exact(r, B) == -exact(r, A)
    reals.add(r, C, A, B)
    assert exact(r, C) == 0


@given(registers())
def test_products(r):
    a, b = exact(r, A), exact(r, B)
    reals.multiply(r, C, A, B)
    assert abs(exact(r, C) - a * b) <= EXACT * abs(a * b)
    assume(b)
    reals.divide(r, D, A, B)
    assert abs(exact(r, D) - a / b) <= EXACT * abs(a / b)


def test_a_quotient_that_is_rounded_to_the_greatest_mantissa():
    r = array("i", [825_955_248, 0, 825_955_249, 0, 0, 0, 0, 0])
    reals.divide(r, C, A, B)
    assert (r[C], r[C + 1]) == (2**30 - 1, -30)


@given(registers())
def test_order(r):
    a, b = exact(r, A), exact(r, B)
    assert reals.compare(r, A, B) == (a > b) - (a < b)
    assert reals.compare(r, B, A) == (a < b) - (a > b)
    assert reals.compare(r, A, A) == 0
    assert reals.sign(r, A) == (a > 0) - (a < 0)


@given(registers(1), st.integers(-70, 70))
def test_powers_of_two(r, powers):
    a = exact(r, A)
    reals.double(r, B, A, powers)
    assert exact(r, B) == a * Fraction(2) ** powers
    reals.copy(r, C, B)
    reals.fetch(r, D, r, A)
    assert (exact(r, C), exact(r, D)) == (exact(r, B), a)


@given(registers(1), st.integers(0, 2**30 - 1))
def test_floor(r, limit):
    assert reals.floor(r, A, limit) == max(-limit, min(limit, math.floor(exact(r, A))))


@given(registers(1))
def test_split(r):
    a = exact(r, A)
    out = array("i", [-1, -1])
    reals.split(r, A, out)
    assert 0 <= out[1] < 2**30
    if a <= 0:
        assert list(out) == [0, 0]
    elif a >= 2**30:
        assert out[0] == 2**30 - 1
    else:
        assert 0 <= a - (out[0] + Fraction(out[1], 2**30)) < Fraction(1, 2**30)


@given(INT32, INT32)
def test_words(x, y):
    a, b = array("i", [x, y, 0]), array("i", [0, 5, y])
    reals.copy_word(b, 0, a, 0)
    assert list(b) == [x, 5, y]
    assert bool(reals.equal_words(a, 0, b, 2)) == (x == y)
    assert reals.equal_words(a, 1, b, 2)
    if -(2**31) <= x + 77 < 2**31:
        reals.add_word(b, 1, a, 0, 77)
        assert b[1] == x + 77
