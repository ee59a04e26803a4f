"""Sessions of these tests are played again by 32-bit MicroPython, the heap locked in every tick and
every pass, and with all counters close to their end, so that they wrap on the way: byte by byte and
millisecond by millisecond it must do what it did here. The short ones are in any run, all of them
with --replay.
"""

import math

import pytest

from framestep_tools import cli
from framestep_tools.client.client import Client
from framestep_tools.payloads import RtPositionFrame
from framestep_tools.simulator.boards import LockstepPort
from host_tests.end_to_end import realtime
from host_tests.end_to_end.runs.frame_jogs import FRAMES, PATH
from host_tests.end_to_end.runs.uploaded_runs import MOVE
from host_tests.end_to_end.session import DIALECTS, simulated
from host_tests.recording import differences, recorded

_SHORT = 6000  # passes of a session that is played again in any run


@pytest.fixture(scope="module", autouse=True)
def replayed(request):
    """Set up before any board of a module is made, it comes last when all are done."""
    most = math.inf if request.config.getoption("--replay") else _SHORT
    runtime = request.getfixturevalue("unix32f")
    scratch = request.getfixturevalue("tmp_path_factory").mktemp("replay")
    with recorded(most) as recorders:
        yield recorders
    found = [
        differences(runtime, recording, scratch / f"{number}.recording")
        for number, recording in enumerate(recorder.finish() for recorder in recorders)
        if recording.head
    ]
    failures = [text for text in found if text]
    assert not failures, "\n\n".join(failures)


@pytest.fixture(autouse=True)
def not_replayed(request, replayed):
    """Recordings end before a test that reaches into a board (marked `inside`)."""
    inside = request.node.get_closest_marker("inside") is not None
    if inside:
        for recorder in replayed:
            recorder.finish()
    count = len(replayed)
    yield
    if inside:
        del replayed[count:]


@pytest.fixture
def rig():
    """A session with the rig file's defaults."""
    return simulated()


@pytest.fixture(params=DIALECTS)
def both(request):
    """A session in each dialect."""
    session = simulated({"dialect": request.param})
    session.dword_acks = request.param == "dmc-lite"
    return session


@pytest.fixture
def fast():
    """A session whose motors can do MOVE."""
    session = simulated()
    for motor in MOVE:
        session.speed(motor, 20000, 100_000)
    return session


@pytest.fixture
def loaded(fast):
    """MOVE uploaded as frames 1 to 25."""
    fast.upload(MOVE)
    return fast


@pytest.fixture
def standing():
    """The motors on frame 121 of 1 to 241 of the path in frame_jogs.py, index 120."""
    session = realtime.rig()
    realtime.upload(session, PATH, frames=FRAMES)
    session.accept(RtPositionFrame(121))
    session.wait_idle()
    session.forget()
    return session


@pytest.fixture
def framestep(board, monkeypatch, capsys):
    """A command line on its module's `board`: its status, what it prints, what it complains."""
    monkeypatch.setattr(Client, "open", lambda device: Client(LockstepPort(board)))

    def run(line):
        command, *words = line.split()
        status = cli.app.status([command, "socket://x", *words])
        said = capsys.readouterr()
        return status, said.out, said.err

    return run
