"""A share of the scenarios on the emulated Pico 2; `make test-sessions TARGET=rp2350` plays all."""

import pytest

from host_tests.targets.shares import play


@pytest.mark.parametrize("subject", ["motors", "runs", "virtual_axes"])  # 80 scenarios or more
def test_share(subject):
    play("rp2350", 80, subject)
