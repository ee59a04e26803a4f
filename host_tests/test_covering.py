"""Combinations of parameters in each run."""

import itertools
from types import SimpleNamespace

import hypothesis
from hypothesis import strategies

from host_tests.selection import (
    by_test,
    fewer_examples,
    left_out_repeats,
    one_of_each,
    spare,
)


class Case(SimpleNamespace):
    __hash__ = object.__hash__


def test_each_value_is_in_a_case_that_stays():
    cases = [
        Case(callspec=SimpleNamespace(params={"a": a, "b": b, "c": c}))
        for a, b, c in itertools.product(range(3), range(2), range(2))
    ]
    left = [each for each in cases if each not in spare(cases)]
    assert len(left) == 3
    for name, values in (("a", {0, 1, 2}), ("b", {0, 1}), ("c", {0, 1})):
        assert {each.callspec.params[name] for each in left} == values


def test_a_parameter_that_does_not_count_decides_nothing():
    cases = [
        Case(callspec=SimpleNamespace(params={"a": a, "on": on})) for a in (1, 2) for on in "xy"
    ]
    assert len(spare(cases, ("on",))) == 2


def test_a_share_of_what_repeats_is_the_same_in_each_run():
    def items():
        return [
            Case(path="f", name=f"t{i}", nodeid=f"f::t{i}", get_closest_marker=mark)
            for i in range(300)
            for mark in ([lambda name: name == "repeats", lambda name: None][i % 2],)
        ]

    def left(items, one_in):
        return {item.name for item in items} - {i.name for i in left_out_repeats(items, one_in)}

    always = {f"t{i}" for i in range(1, 300, 2)}
    assert left(items(), 0) == always
    assert left(items(), 1) == {item.name for item in items()}
    third = left(items(), 3)
    assert third == left(items()[::-1], 3)
    assert third > always
    assert 30 < len(third - always) < 70


def test_one_case_stays():
    assert spare([Case()]) == []
    assert by_test([]) == {}


def test_the_case_that_stays_is_in_each_run_and_chips_do_not_count_as_cases():
    def case(marks, **params):
        return Case(
            path="file",
            name="test",
            callspec=SimpleNamespace(params=params),
            iter_markers=lambda name: iter(range(marks)),
        )

    cases = [case(2, chip=2, a=1), case(1, chip=2, a=2), case(1, chip=1, a=1), case(0, chip=1, a=2)]
    assert one_of_each(cases) == {cases[1], cases[3]}


def test_hypothesis_draws_the_first_examples():
    drawn = []

    @hypothesis.settings(max_examples=31)
    @hypothesis.given(strategies.integers())
    def draw(number):
        drawn.append(number)

    draw()
    every, drawn = drawn, []
    fewer_examples([SimpleNamespace(obj=draw)])
    draw()
    assert len(every) == 31
    assert drawn == every[:7]
