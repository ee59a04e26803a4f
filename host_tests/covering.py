"""Choose enough of a test's parameters and of their combinations."""

import zlib

import hypothesis
import pytest

_SHARE = 5  # each run has one of this many examples that hypothesis draws with --all


def sweep(values, *kept):
    """Return the parameters of a test: each run has those in `kept`, --all has the others, too."""
    return [
        pytest.param(value, marks=() if value in kept else pytest.mark.repeats) for value in values
    ]


def parameters(item):
    """Return {name: value} of a test's case."""
    return item.callspec.params if hasattr(item, "callspec") else {}


def spare(cases, but=()):
    """Return cases of one test that are not needed, because the others have each value of each
    parameter. but: parameters that do not count."""

    def values(item):
        return {(name, repr(value)) for name, value in parameters(item).items() if name not in but}

    left = {item: values(item) for item in cases}
    missing = set().union(*left.values())
    while missing:
        best = max(left, key=lambda item: len(left[item] & missing))
        missing -= left.pop(best)
    return list(left) if len(cases) > 1 else []


def by_test(items):
    """Return {(file, test, chip): its cases}."""
    found = {}
    for item in items:
        name = getattr(item, "originalname", item.name)
        found.setdefault((item.path, name, parameters(item).get("chip")), []).append(item)
    return found


def one_of_each(items):
    """Return a case of each test, if possible one that is in each run."""
    return {
        min(cases, key=lambda item: len(list(item.iter_markers("repeats"))))
        for cases in by_test(items).values()
    }


def left_out_repeats(items, one_in):
    """Return the tests that a run leaves out. All of these repeat what others show. A run plays one
    in `one_in` of such tests, always the same ones; with 0 it plays none."""
    for cases in by_test(items).values():
        for item in spare(cases) if len(parameters(cases[0])) > 1 else ():
            item.add_marker(pytest.mark.repeats)
    return {
        item
        for item in items
        if item.get_closest_marker("repeats")
        and not (one_in and zlib.crc32(item.nodeid.encode()) % one_in == 0)
    }


def fewer_examples(items):
    """Have hypothesis draw the first of its examples only."""
    for function in {getattr(item.obj, "__func__", item.obj) for item in items}:
        # hypothesis' own decorator passes them in this way
        whole = getattr(function, "_hypothesis_internal_use_settings", None)
        if whole is not None:
            function._hypothesis_internal_use_settings = hypothesis.settings(
                whole, max_examples=-(-whole.max_examples // _SHARE)
            )
