"""Phases cut into segments with the heap locked."""

from pathlib import Path

SCRIPT = Path(__file__).parent / "short_phase.py"


def test_a_short_phase_that_ends_with_the_tick(runtime):
    """10.25 ticks, then 0.75: of the tick 2^30 parts are over, which is an object on the heap."""
    assert int(runtime.run(SCRIPT)) >= 4
