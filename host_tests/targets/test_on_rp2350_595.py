"""A share of the scenarios on the emulated Pico 2 with shift registers; `make test-sessions
TARGET=rp2350_595` plays all."""

from host_tests.targets import play


def test_share():
    """Of the subject that takes the least time there."""
    play("rp2350_595", 160, "motors")
