"""Fixtures for every layer. None of them skips a test: what is missing is built, or the test fails
with the reason."""

import contextlib
import gc
import os
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

import hypothesis
import pytest
from hypothesis.internal.conjecture import providers

# Helpers, too, show the values of an assertion.
pytest.register_assert_rewrite(
    *(f"host_tests.{path.stem}" for path in Path(__file__).parent.iterdir() if path.stem[0] != "_")
)

from host_tests import machine_code

machine_code.install()  # before the core is loaded

from framestep.base import native_cpython
from framestep_emulator import Emulator, Pool
from framestep_tools.building import images
from framestep_tools.building.board_files import CACHE, FIRMWARE, ROOT, compiled_tree
from host_tests import targets
from host_tests.processor_time import ProcessorTime
from host_tests.runtimes import Runtime
from host_tests.selection import Near, fewer_examples, left_out_repeats

FAILED = ROOT / "build" / "failed"  # logs of tests that failed
_IN_CI = bool(os.environ.get("CI"))

# Hide the axes.toml of whoever runs the tests.
os.environ["XDG_CONFIG_HOME"] = str(CACHE / "no-settings")

# Tools wait this much longer for an emulated board, as the computer may be busy.
os.environ.setdefault("FRAMESTEP_PATIENCE", "8")

# `make test` gives the same verdict each time: each test draws the same examples, in any order and
# however busy the computer is. So there are no time limits, and no examples from earlier runs.
# `make fuzz` draws new ones.
hypothesis.settings.register_profile(
    "framestep",
    derandomize=True,
    database=None,
    deadline=None,
    suppress_health_check=[hypothesis.HealthCheck.too_slow],
    print_blob=True,
)
hypothesis.settings.load_profile("framestep")
# Otherwise it also draws numbers from the modules imported so far, which depend on earlier tests.
providers._get_local_constants = lambda: providers._local_constants


def pytest_addoption(parser):
    parser.addoption(
        "--replay",
        action="store_true",
        help="play the end-to-end sessions again on 32-bit MicroPython, the heap locked",
    )
    parser.addoption(
        "--target",
        choices=targets.NAMES,
        default="host",
        help="what plays the end-to-end scenarios (host_tests/targets)",
    )
    parser.addoption("--port", help="with --target device: its protocol port")
    parser.addoption("--share", type=int, default=1, help="only every n-th test")
    parser.addoption(
        "--all",
        action="store_const",
        dest="repeats",
        const=1,
        default=0,
        help="tests as well that repeat with other values what others show",
    )
    parser.addoption(
        "--third",
        action="store_const",
        dest="repeats",
        const=3,
        help="a third of the tests that repeat with other values what others show",
    )
    parser.addoption("--near", help="only tests that what has changed since this commit reaches")
    parser.addoption("--seconds", type=float, default=45, help="with --near: begin none later")


def pytest_configure(config):
    config.pluginmanager.register(ProcessorTime())
    # A build of minutes reports its steps on the terminal, not to the capture.
    images.reporting = config.pluginmanager.getplugin("capturemanager").global_and_fixture_disabled
    targets.install(config)
    if since := config.getoption("--near"):
        config.pluginmanager.register(Near(since, config.getoption("--seconds")))


# Long tests begin first, so that no processor waits for another one at the end. Other files are
# ordered by name. The console's tests wait for real time: they are spread among the long ones.
_FIRST = (
    "targets/", "board/test_flash.py", "board/test_image.py", "board/", "runtime/", "fuzz/",
    "emulator/", "esp32/",
)  # fmt: skip
_WAITS = "console/"


def _turns(items):
    """Return {path: its turn}."""
    folder = Path(__file__).parent
    names = {Path(os.path.relpath(item.path, folder)).as_posix(): item.path for item in items}

    def first(name):
        return next((i for i, begin in enumerate(_FIRST) if name.startswith(begin)), len(_FIRST))

    waiting = [name for name in names if name.startswith(_WAITS)]
    others = sorted((name for name in names if name not in waiting), key=first)
    long = sum(first(name) < len(_FIRST) for name in others)
    turns = {names[name]: float(i) for i, name in enumerate(others)}
    for i, name in enumerate(waiting):
        turns[names[name]] = (i + 0.5) * long / len(waiting)
    return turns


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(config, items):
    """Order the files for the processors; within a file tests stay in order."""
    if (repeats := config.getoption("repeats")) != 1:
        fewer_examples(items)
        left_out = left_out_repeats(items, repeats)
        config.hook.pytest_deselected(items=left_out)
        items[:] = [item for item in items if item not in left_out]
    turns = _turns(items)
    items.sort(key=lambda item: turns[item.path])


def pytest_collection_finish():
    """Keep what is there by now, thousands of tests and modules, out of each collection of garbage,
    and make fewer of them: edges are many objects, none of them garbage. `_memory` makes one after
    every file."""
    gc.freeze()
    gc.set_threshold(20_000, 50)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item, call):
    """In CI nothing may be skipped, by whatever means. After a failure no present emulated board is
    used again."""
    report = yield
    session = sys.modules.get("host_tests.end_to_end.session")
    if report.failed and session and (said := session.logs_of(item.nodeid, FAILED)):
        report.sections.append(("what the session sent, and what came", said))
    if report.failed and Emulator.pool:
        Emulator.pool.fail()
    if _IN_CI and report.skipped and not hasattr(report, "wasxfail"):
        report.outcome = "failed"
        report.longrepr = f"{item.nodeid} was skipped, which CI does not allow: {report.longrepr}"
    return report


@pytest.fixture(scope="module", autouse=True)
def _memory():
    """Free the controllers of a module's tests: there are thousands."""
    yield
    native_cpython.forget()


@dataclass(frozen=True)
class Paths:
    """Paths of the project. `compiled` is the core cross-compiled for the 32-bit runtime."""

    root: Path
    firmware: Path
    cache: Path
    build: Path

    @property
    def unix32f(self) -> Path:
        return images.micropython("unix32f")

    @property
    def rp2_firmware(self) -> Path:
        return images.micropython("rp2")

    @property
    def compiled(self) -> Path:
        return compiled_tree("x86")


@pytest.fixture(scope="session")
def paths() -> Paths:
    return Paths(root=ROOT, firmware=FIRMWARE, cache=CACHE, build=ROOT / "build")


@pytest.fixture(scope="session")
def unix32f(tmp_path_factory) -> Runtime:
    """32-bit MicroPython on this computer's processor."""
    return Runtime("x86", tmp_path_factory.mktemp("unix32f"))


@pytest.fixture(scope="session", autouse=True)
def _shared_ports(tmp_path_factory):
    """Give each process of tests a folder for temporary files. Programs find a shared port there by
    its name, and another process may use the same name."""
    with pytest.MonkeyPatch.context() as patched:
        patched.setenv("TMPDIR", str(tmp_path_factory.mktemp("ports")))
        patched.setattr(tempfile, "tempdir", None)
        yield


@pytest.fixture(scope="session", autouse=True)
def _boards():
    """Let emulated boards use the processes of earlier ones."""
    Emulator.pool = Pool()
    yield
    Emulator.pool.close()
    Emulator.pool = None


@pytest.fixture
def emulator():
    """emulator(**options) starts an emulated board (see framestep_emulator.Emulator), by default
    with MicroPython alone, and closes it at the end of the test."""
    with contextlib.ExitStack() as running:

        def start(firmware=None, **options):
            return running.enter_context(Emulator(firmware or images.emulator_ready(), **options))

        yield start


@pytest.fixture
def board(emulator):
    """board(files={...}, **options): the same with the Pico's image and these files."""

    def start(files=None, **options):
        return emulator(firmware=images.frozen(), files=files, **options)

    return start
