"""A share of the scenarios on the simulated ESP32-S3; `make test-sessions` plays all."""

from host_tests.targets import play


def test_share(request):
    play("esp32", 10 if request.config.getoption("repeats") == 1 else 60)
