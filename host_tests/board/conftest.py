"""Tests that ask for `chip` run on each chip: on the Pico 2 one case of each, with --all only."""

import pytest

from host_tests.board.chips import PICO, PICO2
from host_tests.covering import one_of_each, parameters


@pytest.fixture(
    scope="module",
    params=[PICO, pytest.param(PICO2, marks=pytest.mark.repeats)],
    ids=lambda chip: chip.board,
)
def chip(request):
    return request.param


def pytest_collection_modifyitems(config, items):
    pico2 = {item for item in items if parameters(item).get("chip") is PICO2}
    left_out = pico2 - one_of_each(pico2)
    config.hook.pytest_deselected(items=[item for item in items if item in left_out])
    items[:] = [item for item in items if item not in left_out]
