"""A share of the scenarios on the simulated ESP32-S3; `make test-sessions` plays all."""

import pytest

from host_tests.targets.shares import play


def test_share():
    play("esp32", 40)


@pytest.mark.repeats
def test_larger_share():
    play("esp32", 10)
