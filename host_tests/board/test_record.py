"""Figures that take little time to measure are not worse than recorded: without cache misses, as
these depend on where a build puts code. `make bench` compares all figures each night."""

import pytest

from framestep_tools.bench.figures import FIGURES
from framestep_tools.bench.measure import (
    QUICK,
    SMALL_BYTES,
    SMALL_FRAMES,
    first_figures,
    rig_of,
    upload_rate,
)
from framestep_tools.bench.moves import CLOCK_MHZ
from framestep_tools.bench.record import IDEAL, recorded, worse
from framestep_tools.bench.session import Session
from framestep_tools.simulator.boards import EmulatedBoard


@pytest.fixture(scope="module")
def values():
    """The figures of a board on which nothing else has been measured, as in the bench."""
    with EmulatedBoard(rig_of(CLOCK_MHZ), trace=False, args=["--xip-miss", "0"]) as board:
        session = Session(board)
        values = first_figures(session, CLOCK_MHZ)
        rate = upload_rate(session, SMALL_FRAMES, section_bytes=SMALL_BYTES)
    values["rx_bytes_per_s_small"] = rate
    return {key + IDEAL: values[key] for key in QUICK}


def test_no_figure_is_worse_than_recorded(values):
    kept = recorded()
    lines = worse(FIGURES, values, {key: kept[key] for key in values})
    assert not lines, "worse than recorded (Rules in CONTRIBUTING.md): " + "; ".join(lines)


def test_a_record_that_was_better_by_6_percent_is_missed(values):
    for figure in FIGURES:
        if figure.key in QUICK:
            key = figure.key + IDEAL
            better = values[key] * (0.94 if figure.at_least is None else 1 / 0.94)
            [line] = worse(FIGURES, values, {key: better})
            assert line.startswith(f"{key}: ")
            assert ", recorded " in line
