"""A piece of `make strain`: any requests on the emulated board beside any work on its REPL. See
strain.py."""

from host_tests.board.strain import strain

SEED = 3
REQUESTS = 500


def test_requests_beside_work_on_the_repl():
    counts = strain(SEED, REQUESTS).counts
    assert counts["answers"] + counts["left unanswered"] == counts["requests"] >= REQUESTS
    assert counts["answers"] > 0.8 * REQUESTS
    for name in ("taken", "refused", "closed", "damaged", "Ctrl-C"):
        assert counts[name] > 0, name  # it has been there
    assert counts["REPL"] > REQUESTS / 50
