"""With --replay each session of these tests is played again by 32-bit MicroPython, the heap locked in every tick and
every pass, and with all counters close to their end, so that they wrap on the way: byte by byte and millisecond by
millisecond it must do what it did here.
"""

import pytest

from host_tests.end_to_end.session import DIALECTS, simulated
from host_tests.end_to_end.uploaded_runs import MOVE
from host_tests.recording import differences, recorded


@pytest.fixture(scope="module", autouse=True)
def replayed(request):
    """Set up before any board of a module is made, it comes last when all are done."""
    if not request.config.getoption("--replay"):
        yield []
        return
    runtime = request.getfixturevalue("unix32f")
    scratch = request.getfixturevalue("tmp_path_factory").mktemp("replay")
    with recorded() as recorders:
        yield recorders
    found = [
        differences(runtime, recording, scratch / f"{number}.recording")
        for number, recording in enumerate(recorder.finish() for recorder in recorders)
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
