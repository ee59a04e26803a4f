"""MicroPython on the simulated chip of tools/micropython/esp32."""

import pytest

from host_tests.runtimes import Runtime


@pytest.fixture(scope="session")
def chip(tmp_path_factory) -> Runtime:
    return Runtime("esp32", tmp_path_factory.mktemp("esp32"), "stream")
