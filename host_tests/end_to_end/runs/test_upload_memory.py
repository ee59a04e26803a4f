"""An upload that does not fit into memory: the firmware says how much it needs, and what is
free."""

import random
from types import SimpleNamespace

import pytest

from framestep import boot
from framestep.moves.path.move_check import UNREPORTED
from framestep.protocol.messages import CONDITION_EXCEEDED, EXCEEDED_MEMORY
from framestep.repl import state as repl_state
from framestep_tools import payloads as p
from framestep_tools.client.client import RequestRefused
from framestep_tools.client.refusals import explain
from framestep_tools.client.state import ask, lines
from framestep_tools.simulator.boards import SimulatedBoard
from host_tests.end_to_end.session import Session, run_request

pytestmark = pytest.mark.needs("inside")

FRAMES = 256
REGION = 2 * 2 * 69  # bytes of a motor's two chunks of 128 frames (field note 5.7)
PIECE = 34
LAST = 1 << 31


@pytest.fixture
def rig():
    """Return a session of two motors, with a region for both and 13 pieces of memory."""
    size = 2 * REGION + 13 * PIECE
    rig = {"outputs": [{"pin": 26}]}
    return Session(SimulatedBoard(rig, motors=2, upload_bytes=size), motors=2)


def begin(rig):
    rig.accept(
        p.RtUploadMoveBegin(1, FRAMES),
        p.RtUploadMoveAxis(1, LAST, [7]),
        p.RtUploadMoveAxis(2, LAST, [9]),
    )


def refused(rig, request):
    """Return what a refusal says: the text, what the request needs, what is free."""
    with pytest.raises(RequestRefused) as caught:
        rig.ask(request)
    reported = rig.ask(p.GetExceeded())
    said = str(explain(rig.client, caught.value))
    if reported.what != EXCEEDED_MEMORY:
        return said, None, None
    return said, reported.by, reported.room


def unreported(rig):
    """Whether the REPL has something to report; clear it."""
    faults = rig.board._board.controller.faults
    found = faults.unreported & UNREPORTED
    faults.unreported &= ~UNREPORTED
    return bool(found)


WILD = [1_000_000 * (i % 2) for i in range(FRAMES)]


@pytest.mark.parametrize(
    ("request_", "part", "needs"),
    [
        # 7 pieces for each chunk, for 22-bit changes of the steps per frame
        (p.RtUploadMoveAxis(2, 0, WILD), "the positions of motor 2 from the upload's frame 1 on",
         14 * PIECE),
        (p.RtUploadMoveDmx(5, 0, random.Random(1).choices(range(256), k=FRAMES)),
         "the levels of channel 5 from the upload's frame 1 on", None),
        (p.RtUploadMoveTriggers(0x3FFF, [p.Trigger(3, 0x3FFF)]), "triggers", 14 * PIECE),
    ],
    ids=["positions", "levels", "triggers"],
)  # fmt: skip
def test_what_is_asked_and_what_is_free(rig, request_, part, needs):
    begin(rig)
    free = 13 * PIECE
    if needs is None:  # ten pieces, of 28 frames at most
        rig.accept(p.RtUploadMoveTriggers(0x1FF, [p.Trigger(3, 0x1FF)]))
        free, needs = 4 * PIECE, 10 * PIECE
    assert not unreported(rig)
    said, by, room = refused(rig, request_)
    assert (by, room) == (needs, free)
    assert f"refused: {part}: the board's memory is full" in said
    assert f"needs {needs} bytes, {free} are free" in said
    assert unreported(rig)
    refused(rig, request_)
    assert not unreported(rig), "once for an upload"
    line = f"the last upload does not fit into memory: it needs {needs} bytes, {free} are free"
    assert line in lines(ask(rig.client))
    boot.controller, boot.runner = rig.board._board.controller, SimpleNamespace(alive=True)
    try:
        assert line in repl_state._report()
    finally:
        boot.controller = boot.runner = None


def test_a_motor_that_has_no_region(rig):
    rig.accept(
        p.RtUploadMoveBegin(1, FRAMES),
        p.RtUploadMoveAxis(1, 0, WILD),
        p.RtUploadMoveTriggers(7, [p.Trigger(3, 7)]),
    )
    _, by, room = refused(rig, p.RtUploadMoveAxis(2, 0, [1]))
    assert (by, room) == (REGION, 2 * REGION + 13 * PIECE - REGION - 17 * PIECE)


def test_frames_between_those_sent(rig):
    """They hold the position before them, so the motor jumps after them."""
    rig.accept(
        p.RtUploadMoveBegin(1, FRAMES),
        p.RtUploadMoveAxis(1, 0, [0]),
        p.RtUploadMoveAxis(1, 100, [100_000_000]),
        p.RtUploadMoveAxis(2, LAST, [0]),
        p.RtUploadMoveTriggers(0x3FF, [p.Trigger(3, 0x3FF)]),
    )
    said, by, room = refused(rig, p.RtUploadMoveEnd())
    assert "the frames between those that were sent: the board's memory is full" in said
    assert 0 <= room < by
    rig.accept(p.RtUploadMoveAxis(1, 0, [100_000_000]), p.RtUploadMoveEnd())


def test_what_was_sent_before_can_be_played(rig):
    begin(rig)
    refused(rig, p.RtUploadMoveAxis(2, 0, WILD))
    rig.accept(p.RtUploadMoveEnd(), p.RtPositionFrame(20)).wait_idle()
    assert rig.positions == {1: 7, 2: 9}
    rig.accept(run_request(24, 1, 9))
    assert not rig.ask(p.GetCondition()).bits & CONDITION_EXCEEDED


def test_a_new_upload_begins_anew(rig):
    begin(rig)
    refused(rig, p.RtUploadMoveAxis(2, 0, WILD))
    assert rig.ask(p.GetCondition()).bits & CONDITION_EXCEEDED
    begin(rig)
    assert not rig.ask(p.GetCondition()).bits & CONDITION_EXCEEDED
    unreported(rig)
    refused(rig, p.RtUploadMoveAxis(2, 0, WILD))
    assert unreported(rig)


@pytest.mark.parametrize(
    ("request_", "words"),
    [
        (p.RtUploadMoveAxis(1, FRAMES, [1]), "from the upload's frame 257 on begin past its last"),
        (p.RtUploadMoveAxis(1, 3, [1, -(2**31)]), "have one of -2147483648, which no motor can"),
        (p.RtUploadMoveDmx(513, 0, [1]), "no channel 513, there are channels 1 to 512"),
        (p.RtUploadMoveDmx(3, FRAMES, [1]), "from the upload's frame 257 on begin past its last"),
    ],
)
def test_what_is_refused_for_another_reason(rig, request_, words):
    begin(rig)
    said, by, _ = refused(rig, request_)
    assert words in said
    assert by is None
