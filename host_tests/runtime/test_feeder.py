"""Phases cut into segments with the heap locked."""

from pathlib import Path

SCRIPT = Path(__file__).parent / "short_phase.py"


def test_a_short_phase_that_ends_with_the_tick(runtime):
    """10.25 ticks, then 0.75: 2^30 parts of the tick are over, and that number is a heap object."""
    assert int(runtime.run(SCRIPT)) >= 4
