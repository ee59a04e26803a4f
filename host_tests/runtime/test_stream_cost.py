"""The number of instructions that building an ESP32's stream takes."""

import pytest

from framestep_tools.bench import stream_cost


@pytest.mark.parametrize("stream_runtime", ["xtensa"], indirect=True)
def test_a_faster_rate_costs_more(stream_runtime):
    """The script has reached the rate, else it fails."""
    slow, fast = stream_cost.us(1000), stream_cost.us(60_000)
    assert 50 < slow < fast < 1000
