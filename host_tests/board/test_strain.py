"""A part of `make strain`: any requests on the emulated board, alone and together with
work on its REPL. See strain.py."""

import pytest

from host_tests.board.strain import strain

QUIET_SEED = 5
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


def test_requests_alone():
    """No tick is late, no queue runs dry, in virtual motions as well."""
    found = strain(QUIET_SEED, REQUESTS // 2, quiet=True)
    assert found.late_us > 0
    assert found.counts["virtual motions taken"] > 0
    assert found.least_queued > 20


@pytest.mark.repeats
def test_requests_with_an_overlay():
    """The tick and the planning of motion are compiled on the board's heap, not frozen."""
    modules = ("framestep.pulse.tick", "framestep.motors.axis", "framestep.controller")
    found = strain(OVERLAY_SEED, REQUESTS // 2, quiet=True, modules=modules)
    assert found.late_us > 0
    assert found.counts["taken"] > REQUESTS / 5
