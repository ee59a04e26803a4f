"""The tests that run on 32-bit MicroPython run on each processor: x86, ESP32's two, and the RISC-V
cores of an RP2350."""

from pathlib import Path

import pytest

from host_tests.runtimes import PROCESSORS, Runtime
from host_tests.selection import by_test, parameters, spare

HERE = Path(__file__).parent
SLOWEST = "xtensa"
RUNTIMES = ("runtime", "stream_runtime")
# What each processor runs in any test run: every kernel against its result on this computer
KERNELS = ("test_motion.py", "test_runtimes.py")


def pytest_collection_modifyitems(config, items):
    """Drop combinations of parameters of a test on the slowest processor, but keep each value of
    each parameter."""
    slowest = [
        item for item in items if HERE in item.path.parents and SLOWEST in parameters(item).values()
    ]
    dropped = {item for cases in by_test(slowest).values() for item in spare(cases, RUNTIMES)}
    config.hook.pytest_deselected(items=list(dropped))
    items[:] = [item for item in items if item not in dropped]
    for item in items:
        if HERE in item.path.parents and item.path.name not in KERNELS and _emulated(item):
            item.add_marker(pytest.mark.repeats)


def _emulated(item):
    """Whether QEMU runs it."""
    return any(PROCESSORS[each].emulator for each in map(parameters(item).get, RUNTIMES) if each)


def _runtime(name, scratch, engine="pio"):
    if why := Runtime.missing(name):
        pytest.skip(f"MicroPython for {name} is not built: {why}")
    return Runtime(name, scratch, engine)


@pytest.fixture(scope="session", params=PROCESSORS)
def runtime(request, tmp_path_factory) -> Runtime:
    return _runtime(request.param, tmp_path_factory.mktemp(request.param))


@pytest.fixture(scope="session", params=PROCESSORS)
def stream_runtime(request, tmp_path_factory) -> Runtime:
    """Return the same with the core built for the engine of hal/stream.py."""
    return _runtime(request.param, tmp_path_factory.mktemp(request.param), "stream")
