"""A share of the scenarios on the emulated Pico 2; `make test-sessions TARGET=rp2350` plays all."""

from host_tests.targets import play


def test_share():
    """Of the subject that takes the least time there."""
    play("rp2350", 160, "motors")
