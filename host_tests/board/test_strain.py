"""A part of `make strain`: any requests on the emulated board together with work on its REPL. See
strain.py."""

import pytest

from host_tests.board.strain import strain

SEED = 3
OVERLAY_SEED = 7
REQUESTS = 500


@pytest.mark.repeats
def test_requests_beside_work_on_the_repl():
    counts = strain(SEED, REQUESTS).counts
    assert counts["answers"] + counts["left unanswered"] == counts["requests"] >= REQUESTS
    assert counts["answers"] > 0.8 * REQUESTS
    for name in ("taken", "refused", "closed", "damaged", "Ctrl-C"):
        assert counts[name] > 0, name  # it happened
    assert counts["REPL"] > REQUESTS / 50


def test_requests_with_an_overlay():
    """The tick and the planning of motion are compiled on the board's heap, not frozen."""
    modules = ("framestep.pulse.tick", "framestep.motors.axis", "framestep.controller")
    found = strain(OVERLAY_SEED, REQUESTS // 2, modules=modules)
    assert found.late_us > 0
    assert found.counts["taken"] > REQUESTS / 5
