"""What runs on 32-bit MicroPython runs on each processor: x86, ESP32's two, and the RISC-V cores of
an RP2350."""

import os

import pytest

from framestep_tools.files import CACHE
from host_tests.runtimes import PROCESSORS, Runtime


def _runtime(name, scratch, engine="pio"):
    missing = CACHE / "build" / f"{name}.missing"
    if missing.exists() and not os.environ.get("CI"):
        pytest.skip(f"MicroPython for {name} is not built: {missing.read_text().strip()}")
    return Runtime(name, scratch, engine)


@pytest.fixture(scope="session", params=PROCESSORS)
def runtime(request, tmp_path_factory) -> Runtime:
    return _runtime(request.param, tmp_path_factory.mktemp(request.param))


@pytest.fixture(scope="session", params=PROCESSORS)
def stream_runtime(request, tmp_path_factory) -> Runtime:
    """The same with the core built for the engine of hal/stream.py."""
    return _runtime(request.param, tmp_path_factory.mktemp(request.param), "stream")
