"""A share of the scenarios on the simulated ESP32-S3; `make test-sessions` plays all."""

import pytest

from host_tests.targets.shares import SUBJECTS, play


@pytest.mark.parametrize("subject", SUBJECTS)
def test_share(subject):
    play("esp32", 40, subject)


@pytest.mark.repeats
@pytest.mark.parametrize("subject", SUBJECTS)
def test_larger_share(subject):
    play("esp32", 10, subject)
