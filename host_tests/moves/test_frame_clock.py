"""When each frame of a lap comes: round(N · 10^9 / fps_milli) microseconds after the first, by
fractions."""

import itertools
from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from framestep.moves.frame_clock import FrameClock
from framestep.moves.path.move_check import FASTEST_FPS

WRAP = 2**29  # ticks
SMALL = 2**30  # numbers below it take no memory on a board
# of 1000 s
RATES = (1, 999, 1000, 12_000, 23_976, 24_000, 25_000, 29_970, 59_940, 120_000, FASTEST_FPS)


def begun(fps_milli, tick=0):
    clock = FrameClock()
    clock.begin(fps_milli, tick)
    return clock


def moments(clock, frames):
    """Return the microseconds from the first frame to each of `frames`; the counter wraps."""
    past, before = 0, clock.tick
    for _ in range(frames):
        past += (clock.tick - before) % WRAP
        before = clock.tick
        yield past * 1000 + clock.us
        clock.advance()


def due(number, fps_milli):
    """Return the same for one frame, by the rule; halves round up."""
    return (Fraction(number * 10**9, fps_milli) + Fraction(1, 2)).__floor__()


@pytest.mark.parametrize("fps_milli", RATES)
def test_the_first_frame_is_at_the_tick_given(fps_milli):
    clock = begun(fps_milli, 12_345)
    assert (clock.tick, clock.us) == (12_345, 0)


@given(st.integers(1, FASTEST_FPS), st.integers(1, 400))
def test_each_frame_is_at_its_own_rounded_time(fps_milli, frames):
    assert list(moments(begun(fps_milli), frames)) == [due(n, fps_milli) for n in range(frames)]


@pytest.mark.parametrize("fps_milli", [1000, 23_976, 29_970, 59_940, 120_000])
def test_rounding_never_adds_up_in_65535_frames(fps_milli):
    *_, last = moments(begun(fps_milli), 65_535)
    assert last == due(65_534, fps_milli)


def test_at_a_thousandth_of_a_frame_per_second_a_frame_lasts_a_thousand_seconds():
    assert list(moments(begun(1), 3)) == [0, 10**9, 2 * 10**9]


@pytest.mark.parametrize("tick", [WRAP - 1, WRAP - 41, WRAP - 42, WRAP // 2])
def test_the_counter_of_ticks_may_wrap(tick):
    clock = begun(24_000, tick)
    assert list(moments(clock, 50)) == [due(n, 24_000) for n in range(50)]
    assert 0 <= clock.tick < WRAP


def test_a_tick_past_the_end_of_the_counter_is_taken_modulo_it():
    assert begun(24_000, WRAP + 7).tick == 7


@pytest.mark.parametrize("fps_milli", RATES)
def test_a_frame_lasts_the_quotient_or_a_microsecond_more(fps_milli):
    lengths = {
        after - before for before, after in itertools.pairwise(moments(begun(fps_milli), 1000))
    }
    assert lengths <= {10**9 // fps_milli, 10**9 // fps_milli + 1}


@given(st.integers(1, FASTEST_FPS), st.integers(1, 200))
def test_longer_says_which_of_the_two_without_moving_on(fps_milli, frames):
    """RunMove queues its frames by longer(): the same frames last a microsecond more."""
    clock = begun(fps_milli)
    longer = [clock.longer() for _ in range(frames)]
    assert (clock.tick, clock.us) == (0, 0)
    whole = [due(n + 1, fps_milli) - due(n, fps_milli) for n in range(frames)]
    assert [10**9 // fps_milli + more for more in longer] == whole


@given(st.integers(1, FASTEST_FPS), st.integers(0, WRAP - 1), st.integers(1, 50))
def test_no_number_of_it_takes_memory_on_a_board(fps_milli, tick, frames):
    clock = begun(fps_milli, tick)
    for _ in range(frames):
        clock.advance()
        sums = (
            clock.error + clock.remainder,
            clock.us + clock.quotient + 1,
            clock.tick + clock.quotient // 1000 + 1,
        )
        assert max(sums) < SMALL
        assert min(vars(clock).values()) >= 0
