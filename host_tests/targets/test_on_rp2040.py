"""A share of the scenarios on the emulated Pico; `make test-sessions TARGET=rp2040` plays all."""

from host_tests.targets.shares import play


def test_share():
    play("rp2040", 40)
