"""A short run of strain.py."""

from host_tests.esp32.strain import strain

SEED = 3
REQUESTS = 300


def test_requests_with_pauses_of_the_main_loop():
    counts = strain(SEED, REQUESTS).counts
    assert counts["answers"] == counts["requests"] >= REQUESTS
    for name in ("taken", "refused", "damaged", "pauses", "unasked 0x34"):
        assert counts[name] > 0, name  # it happened
