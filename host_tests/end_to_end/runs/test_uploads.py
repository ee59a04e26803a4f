"""Uploads on the host simulation: message by message, refused, with one frame more, with extreme
frame numbers."""

import numpy as np
import pytest

from framestep.protocol.messages import LARGEST_PAYLOAD
from framestep_tools import payloads as p
from host_tests.end_to_end import realtime
from host_tests.end_to_end.realtime import edges
from host_tests.end_to_end.runs.moves import FRAMES, MOVE, assert_played
from host_tests.end_to_end.session import run_request


def test_upload_message_by_message(both):
    """BEGIN, sections in any order and repeated, END; a motor goes to each frame's position."""
    both.accept(
        p.RtUploadMoveBegin(10, 19),
        p.RtUploadMoveAxis(2, 5 | p.LAST_SECTION, (50, 60, 70)),
        p.RtUploadMoveAxis(2, 0, (0, 10, 20)),
        p.RtUploadMoveAxis(2, 3, (99, 40)),
        p.RtUploadMoveAxis(2, 3, (30,)),
        p.RtUploadMoveAxis(3, p.LAST_SECTION, (-5,)),
        p.RtUploadMoveEnd(),
    )
    for frame, expected in ((10, 0), (13, 30), (14, 40), (17, 70), (19, 70), (12, 20)):
        both.accept(p.RtPositionFrame(frame)).wait_idle()
        positions = both.ask_positions()
        assert positions.steps[1:3] == (expected, -5)
        assert positions.move_time == frame * 1000
    assert both.made(2) == 20
    assert both.made(1) == 0


def test_upload_refused(both):
    """Field notes 5.2 to 5.4; the earlier upload stays."""
    info_frames = both.ask(p.Hi()).upload_frames
    both.refuse(
        p.Ack.ERR_GENERAL, p.RtUploadMoveAxis(1, 0, (1,)), p.RtUploadMoveEnd(), p.RtPositionFrame(1)
    )
    both.refuse(p.Ack.ERR_GENERAL, run_request(24, 1, 2), p.RtGo())
    both.accept(p.RtUploadMoveBegin(1, 4), p.RtUploadMoveAxis(1, 0, (1, 2, 3, 4)))
    both.refuse(p.Ack.ERR_GENERAL, p.RtPositionFrame(1), run_request(24, 1, 2), p.RtGo())
    both.refuse(p.Ack.ERR_RANGE, p.RtUploadMoveBegin(5, 4), p.RtUploadMoveBegin(1, 1 + info_frames))
    both.refuse(
        p.Ack.ERR_RANGE,
        p.RtUploadMoveBegin(-(2**31), 2**31 - 1),
        p.RtUploadMoveBegin(2**31 - 1, -(2**31)),
    )
    both.refuse(p.Ack.ERR_RANGE, p.RtUploadMoveAxis(1, 4, (9,)), p.RtUploadMoveAxis(1, 5, (9, 9)))
    both.refuse(
        p.Ack.ERR_RANGE,
        p.RtUploadMoveBegin(999_999, 1_000_001),
        p.RtUploadMoveBegin(-1_000_001, -999_999),
    )
    both.refuse(p.Ack.ERR_RANGE, p.RtUploadMoveAxis(0, 0, (9,)), p.RtUploadMoveAxis(9, 0, (9,)))
    both.refuse(
        p.Ack.ERR_RANGE,
        p.RtUploadMoveAxis(1, 0x7FFFFFFF, (9,)),
        p.RtUploadMoveAxis(1, 0xFFFFFFFF, (9,)),
    )
    both.refuse(
        p.Ack.ERR_RANGE, p.RtUploadMoveAxis(1, 2**30, (9,)), p.RtUploadMoveAxis(1, 0x10001, (9,))
    )
    both.accept(p.RtUploadMoveEnd())
    both.refuse(
        p.Ack.ERR_RANGE, p.RtPositionFrame(0), p.RtPositionFrame(5), p.RtPositionFrame(2**31 - 1)
    )
    both.refuse(
        p.Ack.ERR_RANGE, p.RtPositionFrame(-(2**31)), run_request(24, 0, 3), run_request(24, 1, 5)
    )
    both.accept(p.RtPositionFrame(4)).wait_idle()
    assert both.position(1) == 4


def test_a_frame_more(both):
    """Field note 5.3: sections that extend past the end are stored up to it; END and a run work."""
    for motor in MOVE:
        both.speed(motor, 20000, 100_000)
    both.accept(p.RtUploadMoveBegin(1, FRAMES))
    for motor, steps in MOVE.items():
        both.accept(p.RtUploadMoveAxis(motor, 0, steps[:10]))
        both.accept(
            p.RtUploadMoveAxis(
                motor, 10 | p.LAST_SECTION, (*steps[10:], steps[-1], -(2**31), 2**31 - 1)
            )
        )
        both.accept(p.RtUploadMoveAxis(motor, FRAMES - 1, (steps[-1], 99_999)))
    both.accept(p.RtUploadMoveDmx(9, p.LAST_SECTION, range(FRAMES + 3)))
    both.accept(
        p.RtUploadMoveTriggers(1, (p.Trigger(FRAMES - 1, 1), p.Trigger(FRAMES, 1))),
        p.RtUploadMoveEnd(),
    )
    before = both.play(run_request(24, 1, FRAMES))
    assert_played(both, before, MOVE, 24)
    both.refuse(p.Ack.ERR_RANGE, p.RtPositionFrame(FRAMES + 1))


@pytest.mark.needs("lights")
def test_sections_that_fill_the_largest_frame(rig):
    """Field note 1.6: 1048 bytes hold 257 positions, 1030 levels or 129 triggers."""
    requests = (
        p.RtUploadMoveAxis(1, 0, range(257)),
        p.RtUploadMoveDmx(9, p.LAST_SECTION, [i // 5 for i in range(1030)]),
        p.RtUploadMoveTriggers(1, [p.Trigger(i, 1) for i in range(129)]),
    )
    assert [
        (LARGEST_PAYLOAD - len(r.pack())) // size
        for r, size in zip(requests, (4, 1, 8), strict=True)
    ] == [0, 0, 0]
    rig.accept(
        p.RtUploadMoveBegin(1, 1100), *requests, p.RtUploadMoveEnd(), p.RtPositionFrame(1030)
    )
    rig.wait_idle()
    assert rig.position(1) == 256
    assert edges(rig, "dmx9")[-1][1] == 1029 // 5


def test_frame_numbers_at_their_ends(fast):
    """Field note 5.3: ±1 000 000 is the last frame number; MOVE TIME reports it."""
    for start in (-1_000_000, 1_000_000 - FRAMES + 1):
        fast.upload(MOVE, start_frame=start)
        for frame in (start, start + FRAMES - 1):
            fast.accept(p.RtPositionFrame(frame)).wait_idle()
            assert fast.ask_positions().move_time == frame * 1000
        before = fast.play(run_request(24, start, start + FRAMES - 1))
        assert_played(fast, before, MOVE, 24)
        assert set(fast.frames_reported()) >= {1000 * (start + i) for i in range(FRAMES)}


def test_a_new_upload_replaces(loaded):
    loaded.upload({1: [7, 8, 9]}, start_frame=101)
    loaded.refuse(p.Ack.ERR_RANGE, p.RtPositionFrame(1))
    loaded.accept(p.RtPositionFrame(103)).wait_idle()
    assert loaded.positions == {1: 9} | dict.fromkeys(range(2, 9), 0)


def test_negative_frames_and_far_positions(fast):
    """Scene frames below 0, positions of any 32 bits."""
    top = 2**31 - 1
    positions = {1: top - 50 * np.arange(FRAMES)[::-1], 2: -(2**31) + 1 + 50 * np.arange(FRAMES)}
    fast.accept(
        p.MotorResetPosition(1, int(positions[1][0]) - 5),
        p.MotorResetPosition(2, int(positions[2][0]) + 700),
    )
    fast.upload(positions, start_frame=-10)
    fast.accept(p.RtPositionFrame(-10)).wait_idle()
    assert fast.position(1) == positions[1][0]
    assert fast.position(2) == positions[2][0]
    # run-ups and run-outs would exceed the range of 32 bits; from -5 to 9 they do not
    before = fast.play(run_request(24, -5, 9, 100, 100))
    assert_played(fast, before, {m: s[5:20] for m, s in positions.items()}, 24)
    assert set(fast.frames_reported()) >= {1000 * frame for frame in range(-5, 10)}


@pytest.mark.needs("little memory")
def test_each_of_65535_frames_counts():
    """Those at the end as well: in what is refused, in a run and in JOG_ALL."""
    session = realtime.rig(upload_bytes=2**20)
    frames = 65_535
    steps = 3 * np.arange(frames)
    realtime.upload(session, {1: steps}, frames=frames)
    session.accept(p.MotorSetLimits(1, 0, 0, 1, int(steps[-1]) - 1))
    session.refuse(p.Ack.ERR_SOFT_UP, run_request(24, 1, frames), p.RtPositionFrame(frames))
    session.accept(p.MotorSetLimits(1, 0, 0, 0, 0), p.MotorResetPosition(1, int(steps[-9])))
    realtime.go(session, run_request(24, frames - 5, frames, 200, 200))
    realtime.to_the_end(session)
    assert session.position(1) == steps[-1]
    assert session.frames_reported()[-6:] == [1000 * (frames + i) for i in range(-5, 1)]
    session.accept(p.RtJogAll(6000, frames - 3)).wait_idle()
    assert session.position(1) == steps[-4]
    assert session.ask_positions().move_time == 1000 * (frames - 3)
