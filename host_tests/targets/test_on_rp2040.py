"""A share of the scenarios on the emulated Pico; `make test-sessions TARGET=rp2040` plays all."""

import pytest

from host_tests.targets import SUBJECTS, play


@pytest.mark.parametrize("subject", SUBJECTS)
def test_share(subject):
    play("rp2040", 60, subject)
