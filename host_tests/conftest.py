"""Fixtures for every layer. None of them skips a test: what is missing is built, or the test fails
and says why."""

import contextlib
import os
import subprocess
from dataclasses import dataclass
from pathlib import Path

import hypothesis
import pytest
from hypothesis.internal.conjecture import providers

from framestep import native_cpython
from framestep_tools import builds
from framestep_tools.files import CACHE, FIRMWARE, ROOT, board_files, compiled_tree

# Heap of the 32-bit runtime: about what MicroPython leaves free on an RP2040 (233 to 242 kB).
_HEAP = "240k"


_IN_CI = bool(os.environ.get("CI"))

# Tools that the tests run, in this process or in others, wait long for a board that a busy computer
# emulates
os.environ.setdefault("FRAMESTEP_PATIENCE", "20")

# `make test` gives the same verdict each time: each test draws the same examples, in any order and
# however busy the computer is. So there are no time limits, and nothing is remembered from the run
# before. `make fuzz` draws anew.
hypothesis.settings.register_profile(
    "framestep",
    derandomize=True,
    database=None,
    deadline=None,
    suppress_health_check=[hypothesis.HealthCheck.too_slow],
    print_blob=True,
)
hypothesis.settings.load_profile("framestep")
# Otherwise it also draws numbers that it finds in the modules imported so far, which depend on what
# has run before
providers._get_local_constants = lambda: providers._local_constants


def pytest_addoption(parser):
    parser.addoption(
        "--replay",
        action="store_true",
        help="play the end-to-end sessions again on 32-bit MicroPython, the heap locked",
    )


# What takes long begins first, so that at the end no processor waits for another one. Of the rest
# files go by name.
_FIRST = (
    "board/test_flash.py",
    "board/test_image.py",
    "board/",
    "runtime/",
    "fuzz/",
    "emulator/",
    "console/",
)


def pytest_collection_modifyitems(items):
    """Files in the order in which processors are to take them; within a file tests stay in
    theirs."""

    def turn(item):
        path = item.path.relative_to(Path(__file__).parent).as_posix()
        return next(
            (i for i, beginning in enumerate(_FIRST) if path.startswith(beginning)), len(_FIRST)
        )

    items.sort(key=turn)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item, call):
    """In CI nothing may be skipped, by whatever means."""
    report = yield
    if _IN_CI and report.skipped and not hasattr(report, "wasxfail"):
        report.outcome = "failed"
        report.longrepr = f"{item.nodeid} was skipped, which CI does not allow: {report.longrepr}"
    return report


@pytest.fixture(scope="module", autouse=True)
def _memory():
    """Controllers of a module's tests do not stay in memory: there are thousands."""
    yield
    native_cpython.forget()


@dataclass(frozen=True)
class Paths:
    """Where things are. `compiled` is the core cross-compiled for the 32-bit runtime."""

    root: Path
    firmware: Path
    cache: Path
    build: Path

    @property
    def unix32f(self) -> Path:
        return builds.micropython("unix32f")

    @property
    def rp2_firmware(self) -> Path:
        return builds.micropython("rp2")

    @property
    def compiled(self) -> Path:
        return compiled_tree("x86")


@pytest.fixture(scope="session")
def paths() -> Paths:
    return Paths(root=ROOT, firmware=FIRMWARE, cache=CACHE, build=ROOT / "build")


class Runtime:
    """Runs scripts on the 32-bit MicroPython with single-precision floats, the core compiled as for
    a board.

    run("print(1)") or run(Path("script.py"), "argument"); gives back what the script printed. A
    script that ends with an exception or an exit status fails the test with its traceback. Modules
    beside a script file can be imported.
    """

    def __init__(self, executable: Path, scratch, engine: str = "pio"):
        self.executable = executable
        self._scratch = scratch
        self._core = compiled_tree("x86", engine)  # once: it takes longer than most scripts

    def run(
        self,
        script,
        *args,
        heap: str = _HEAP,
        path=(),
        stdin: bytes | None = None,
        timeout: float = 1000,
    ) -> str:
        if not isinstance(script, Path):
            script_file = self._scratch / "script.py"
            script_file.write_text(script)
            script = script_file
        search = [self._core, *path, ".frozen"]
        try:
            result = subprocess.run(
                [self.executable, "-X", f"heapsize={heap}", script, *map(str, args)],
                env={**os.environ, "MICROPYPATH": ":".join(map(str, search))},
                input=b"" if stdin is None else stdin,
                capture_output=True,
                timeout=timeout,
            )
        except subprocess.TimeoutExpired as late:
            out = (late.stdout or b"").decode(errors="replace")
            pytest.fail(
                f"{script} ran on unix32f for more than {timeout} s; it had printed:\n{out}",
                pytrace=False,
            )
        out = result.stdout.decode(errors="replace")
        if result.returncode != 0:
            # MicroPython prints tracebacks of uncaught exceptions on standard output or error, by
            # version
            err = result.stderr.decode(errors="replace")
            pytest.fail(
                f"{script} on unix32f, exit status {result.returncode}:\n{out}\n{err}",
                pytrace=False,
            )
        return out


@pytest.fixture(scope="session")
def unix32f(tmp_path_factory) -> Runtime:
    return Runtime(builds.micropython("unix32f"), tmp_path_factory.mktemp("unix32f"))


@pytest.fixture(scope="session")
def unix32f_stream(tmp_path_factory) -> Runtime:
    """The same with the core built for the engine of hal/stream.py."""
    return Runtime(builds.micropython("unix32f"), tmp_path_factory.mktemp("unix32f"), "stream")


@pytest.fixture
def emulator():
    """emulator(**options) starts an emulated board (see framestep_emulator.Emulator), closed when
    the test ends."""
    from framestep_emulator import Emulator

    with contextlib.ExitStack() as running:
        yield lambda **options: running.enter_context(Emulator(**options))


@pytest.fixture
def board(emulator):
    """board(files={...}, **options): the same with the project's files on it, those given besides
    or instead."""

    def start(files=None, **options):
        return emulator(files={**board_files("armv6m"), **(files or {})}, **options)

    return start
