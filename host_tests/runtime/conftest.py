"""What runs on 32-bit MicroPython runs on each processor: x86, ESP32's two, and the RISC-V cores of
an RP2350."""

import itertools
import os
from pathlib import Path

import pytest

from framestep_tools.files import CACHE
from host_tests.runtimes import PROCESSORS, Runtime

HERE = Path(__file__).parent
SLOWEST = "xtensa"
RUNTIMES = ("runtime", "stream_runtime")


def pytest_collection_modifyitems(config, items):
    """Of a test's combinations of parameters the slowest processor gets only as many as have each
    value of each parameter in one of them."""
    combined = {}
    for item in items:
        if HERE in item.path.parents and SLOWEST in _parameters(item).values():
            combined.setdefault((item.path, item.originalname), []).append(item)
    dropped = set(itertools.chain(*(_spare(cases) for cases in combined.values())))
    config.hook.pytest_deselected(items=list(dropped))
    items[:] = [item for item in items if item not in dropped]


def _parameters(item):
    return item.callspec.params if hasattr(item, "callspec") else {}


def _values(item):
    """{(parameter, value)} of a case, but for the processor."""
    return {
        (name, repr(value)) for name, value in _parameters(item).items() if name not in RUNTIMES
    }


def _spare(cases):
    """Cases that are not needed for each value to be in one."""
    missing, spare = set().union(*map(_values, cases)), list(cases)
    while missing:
        best = max(spare, key=lambda item: len(_values(item) & missing))
        missing -= _values(best)
        spare.remove(best)
    return spare if len(cases) > 1 else []


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
