"""A share of the scenarios on the emulated Pico 2; `make test-sessions TARGET=rp2350` plays all."""

import pytest

from host_tests.targets import SUBJECTS, play


@pytest.mark.parametrize("subject", SUBJECTS)
def test_share(subject):
    play("rp2350", 60, subject)
