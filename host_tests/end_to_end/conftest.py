"""32-bit MicroPython plays the sessions of these tests again, with the heap locked in each tick and
every pass, and with all counters close to their end, so that they wrap on the way: byte by byte and
millisecond by millisecond the result must be the same. Every run plays the short ones on x86, and
those of tests marked `each_processor`. With --replay x86 plays all, with --all the other processors
play the marked ones.
"""

import functools
import math
import warnings

import pytest

from framestep_tools import cli
from framestep_tools.client.client import Client
from framestep_tools.payloads import RtPositionFrame
from framestep_tools.simulator.boards import LockstepPort
from host_tests import observers
from host_tests.end_to_end import realtime
from host_tests.end_to_end.runs.moves import MOVE, PATH, PATH_FRAMES
from host_tests.end_to_end.session import DIALECTS, simulated
from host_tests.recording import all_differences, recorded
from host_tests.runtimes import PROCESSORS, Runtime

_SHORT = 2500  # passes of a session that every run plays again


@pytest.fixture(scope="module", autouse=True)
def replayed(request, tmp_path_factory):
    """Play again what a module recorded: set up before its boards, this comes after them all."""
    marked = {
        item.nodeid
        for item in request.session.items
        if item.path == request.path and item.get_closest_marker("each_processor")
    }
    everything = request.config.getoption("--replay")

    def most(test):
        return math.inf if everything or test in marked else _SHORT

    with recorded(most) as recorders:
        yield recorders
    played = [each for each in (recorder.finish() for recorder in recorders) if each.head]
    table = request.config.pluginmanager.get_plugin("observers")
    for _ in {each.test for each in played}:
        table.watched(request.path, {"replay"})
    failures = []
    for name in PROCESSORS if request.config.getoption("repeats") == 1 else ["x86"]:
        again = [each for each in played if name == "x86" or each.test in marked]
        if why := again and Runtime.missing(name):
            warnings.warn(
                f"not played again: MicroPython for {name} is not built: {why}", stacklevel=1
            )
        elif again:
            scratch = tmp_path_factory.mktemp(f"replay-{name}")
            found = all_differences(Runtime(name, scratch), again, scratch)
            failures += [f"on {name}, {text}" for text in found]
    assert not failures, "\n\n".join(failures)


@pytest.fixture(autouse=True)
def not_replayed(request, replayed):
    """End recordings before a test that reaches into a board (marked `inside`)."""
    inside = request.node.get_closest_marker("inside") is not None
    if inside:
        for recorder in replayed:
            recorder.finish()
    count = len(replayed)
    yield
    if inside:
        del replayed[count:]


@pytest.fixture(scope="module", autouse=True)
def _watches():
    """Watch the boards of a module's sessions."""
    observers.watches = []
    yield
    observers.watches = None


@pytest.fixture(autouse=True)
def observed(request, _watches):
    """Judge each session after the test, by what must hold in every scenario."""
    yield
    node = request.node
    table = request.config.pluginmanager.get_plugin("observers")
    table.played(node.path)
    inside = node.get_closest_marker("inside") is not None
    provoked = {kind for mark in request.node.iter_markers("provokes") for kind in mark.args}
    looks: set[str] = set()
    try:
        for watch in observers.watches:
            if inside:
                watch.end()
            elif (found := watch.settle()) and found.kind not in provoked:
                raise found
            looks |= watch.looks()
    finally:
        table.watched(node.path, looks)


@pytest.fixture
def rig():
    """Yield a session with the rig file's defaults."""
    return simulated()


@pytest.fixture(params=DIALECTS)
def both(request):
    """Yield a session in each dialect."""
    session = simulated({"dialect": request.param})
    session.dword_acks = request.param == "dmc-lite"
    return session


@pytest.fixture
def fast(request):
    """Yield a session whose motors can do MOVE; its parameter is the rig file, if it has one."""
    session = simulated(getattr(request, "param", None))
    for motor in MOVE:
        session.speed(motor, 20000, 100_000)
    return session


@pytest.fixture
def loaded(fast):
    """Return the same with MOVE uploaded as frames 1 to 25."""
    fast.upload(MOVE)
    return fast


@pytest.fixture
def standing():
    """Yield a session with the path of runs/moves.py, 1 to 241, at rest on frame 121, index 120."""
    session = realtime.rig()
    realtime.upload(session, PATH, frames=PATH_FRAMES)
    session.accept(RtPositionFrame(121)).wait_idle().forget()
    return session


@pytest.fixture
def command(monkeypatch, capsys):
    """Return a command line on a board, if one is given: it gives status, output and errors."""

    def run(board, line):
        monkeypatch.setattr(Client, "open", lambda device: Client(LockstepPort(board)))
        command, *words = line.split()
        capsys.readouterr()
        status = cli.app.status([command, *["socket://x"] * (board is not None), *words])
        said = capsys.readouterr()
        return status, said.out, said.err

    return run


@pytest.fixture
def said(command):
    """Return the same, which checks its status and gives all that it prints."""

    def run(board, line, status=0):
        found, out, err = command(board, line)
        assert found == status, out + err
        return (out + err).strip()

    return run


@pytest.fixture
def framestep(board, command):
    """Return a command line on the module's `board`: it gives status, output and errors."""
    return functools.partial(command, board)
