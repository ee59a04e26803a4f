"""Figures that take little time to measure, at 125 MHz, are not worse than recorded: what `make
bench` compares each night for all of them."""

import pytest

from framestep_tools.bench.figures import FIGURES
from framestep_tools.bench.measure import (
    SMALL_BYTES,
    SMALL_FRAMES,
    first_figures,
    rig_of,
    upload_rate,
)
from framestep_tools.bench.moves import CLOCK_MHZ
from framestep_tools.bench.record import recorded, worse
from framestep_tools.bench.session import Session
from framestep_tools.simulator.boards import EmulatedBoard

KEYS = {"upload_frames_8", "rx_bytes_per_s", "rx_bytes_per_s_small", "tick_us_8", "reply_ms_median"}


@pytest.fixture(scope="module")
def values():
    """The figures of a board on which nothing else has been measured, as in the bench."""
    with EmulatedBoard(rig_of(CLOCK_MHZ), trace=False) as board:
        session = Session(board)
        values = first_figures(session, CLOCK_MHZ)
        rate = upload_rate(session, SMALL_FRAMES, section_bytes=SMALL_BYTES)
        return values | {"rx_bytes_per_s_small": rate}


def test_no_figure_is_worse_than_recorded(values):
    kept = recorded()
    assert values.keys() & kept.keys() >= KEYS
    lines = worse(FIGURES, values, {key: kept[key] for key in values if key in kept})
    assert not lines, "worse than recorded (Rules in CONTRIBUTING.md): " + "; ".join(lines)


def test_a_record_that_was_better_by_6_percent_is_missed(values):
    for figure in FIGURES:
        if figure.key in KEYS:
            better = values[figure.key] * (0.94 if figure.at_least is None else 1 / 0.94)
            [line] = worse(FIGURES, values, {figure.key: better})
            assert line.startswith(f"{figure.key}: ")
            assert ", recorded " in line
