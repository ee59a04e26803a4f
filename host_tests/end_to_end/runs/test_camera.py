"""The camera in a run on the host simulation: video pulses, stills, both at extreme rates."""

import itertools

import numpy as np
import pytest

from framestep_tools.payloads import (
    Ack,
    MotorStopAll,
    RtEnd,
    RtGo,
    RtShootFrame,
    RtStopLoop,
)
from host_tests.end_to_end.realtime import (
    FRAMES,
    LEVELS,
    LOOP,
    MOVE,
    PING_PONG,
    STILLS,
    VIDEO,
    camera,
    changes,
    edges,
    frame_times,
    go,
    judged,
    level_now,
    loaded,
    rig,
    to_the_end,
    upload,
)
from host_tests.end_to_end.session import run_request


@pytest.mark.parametrize("flags", [VIDEO, VIDEO | LOOP, VIDEO | PING_PONG])
@pytest.mark.parametrize("reverse", [False, True])
def test_video(flags, reverse):
    """Field note 6.9: meter and shutter for 100 ms at GO, before anything moves, and after the
    post-roll."""
    session = loaded()
    first, last = (FRAMES, 1) if reverse else (1, FRAMES)
    go(session, run_request(24, first, last, 500, 300, flags=flags))
    went = session.now
    if flags != VIDEO:
        session.run(2.6)
        session.accept(RtStopLoop())
    ended = to_the_end(session)
    begins = min(session.steps(motor)[0][0] for motor in MOVE)
    (on, off), (on_again, off_again) = camera(session)
    assert 0 <= on - went < 0.006
    assert on <= begins
    assert off - on == pytest.approx(0.1, abs=1e-4)
    assert off_again - on_again == pytest.approx(0.1, abs=1e-4)
    assert on_again == pytest.approx(ended, abs=0.006)
    rest = max(times[times < ended][-1] for times in (session.steps(motor)[0] for motor in MOVE))
    assert on_again >= rest, "the whole move is on the recording"


@pytest.mark.needs("prompt")  # a pass ends the pulse that a stop begins
@pytest.mark.parametrize("after", [0.02, 0.15, 0.3, 0.55, 1.0, 1.52, 1.7])
def test_video_stopped(after):
    """However a run ends, a separate pulse stops a camera that was started."""
    session = loaded()
    go(session, run_request(24, 1, FRAMES, 500, 500, flags=VIDEO))
    session.run(after)
    session.accept(MotorStopAll())
    to_the_end(session)
    (_, first_off), (on, _) = pulses = camera(session)
    assert on - first_off >= 0.0999
    for on, off in pulses:
        assert off - on == pytest.approx(0.1, abs=1e-4)


def test_video_stopped_before_go():
    session = loaded()
    session.ready(run_request(24, 1, FRAMES, 500, 500, flags=VIDEO))
    session.forget()
    session.accept(MotorStopAll())
    session.run(1)
    assert not edges(session, "shutter")


@pytest.mark.needs("prompt")  # a pass ends the pulse that a stop begins
def test_video_and_the_next_operation():
    """The pulse that stops the camera is complete, whatever happens meanwhile."""
    session = loaded()
    for other in (run_request(24, 3, 3, 0, 0), RtShootFrame(3, 1, 20, 500)):
        go(session, run_request(24, 3, 3, 0, 0, flags=VIDEO))
        session.client.wait_event(RtEnd, 5)
        session.accept(other)
        while session.code(RtGo()) != Ack.OK:
            session.run(0.002)
        session.accept(MotorStopAll())
        session.run(1)
        shutter = changes(session, "shutter")
        on, off = shutter[2:4]
        assert on[1] == 1
        assert off[1] == 0
        assert off[0] - on[0] == pytest.approx(0.1, abs=1e-4)
        assert level_now(session, "shutter") == level_now(session, "meter") == 0


def test_video_of_few_frames():
    """Two pulses, 100 ms apart, even if the first frame is the last."""
    session = loaded()
    for last in (3, 4):
        go(session, run_request(24, 3, last, 50, 0, flags=VIDEO))
        to_the_end(session)
        (_, first_off), (on, off) = camera(session)
        assert on - first_off >= 0.0999
        assert off - on == pytest.approx(0.1, abs=1e-4)


def test_video_stop_loop_after_the_last_frame():
    """STOP_LOOP comes in the post-roll of a lap that was not the last: the camera stops at its
    end."""
    session = loaded()
    go(session, run_request(24, 1, FRAMES, 500, 500, flags=VIDEO | LOOP))
    session.run(1.7)
    session.accept(RtStopLoop())
    ended = to_the_end(session)
    (_, (on, _)) = camera(session)
    assert on == pytest.approx(ended, abs=0.006)


def test_both_camera_flags():
    """Field note 6.9: stills take precedence."""
    session = loaded()
    go(
        session,
        run_request(24, 1, FRAMES, 300, 300, flags=VIDEO | STILLS, open_angle=10, close_angle=300),
    )
    to_the_end(session)
    assert len(camera(session)) == FRAMES


@pytest.mark.with_reports
@pytest.mark.parametrize("fps", [12, 24, 29.97])
@pytest.mark.parametrize("angles", [(0, 180), (90, 270), (350, 360), (0, 1)])
def test_stills(fps, angles):
    """Field note 6.9: shutter and meter while frame phase × 360° is within [open, close], in the
    last frame as well."""
    session = loaded()
    request = run_request(
        fps, 1, FRAMES, 500, 0, flags=STILLS, open_angle=angles[0], close_angle=angles[1]
    )
    before = go(session, request)
    ended = to_the_end(session)
    (verdict,) = judged(session, before, fps, roll=0.02)
    openings = camera(session)
    assert len(openings) == FRAMES
    for (on, off), time in zip(openings, frame_times(verdict, fps), strict=True):
        assert on == pytest.approx(time + angles[0] / 360 / fps, abs=0.00065)
        assert off == pytest.approx(max(time + angles[1] / 360 / fps, on + 0.001), abs=0.00065)
    assert ended >= off


@pytest.mark.with_reports
@pytest.mark.parametrize(
    "more",
    [
        {},
        {"open_angle": 0, "close_angle": 0},
        {"open_angle": 180, "close_angle": 90},
        {"open_angle": 200, "close_angle": 200},
        {"open_angle": 360, "close_angle": 0},
    ],
)
def test_stills_without_angles(more):
    """Field note 6.9: without angles, or with OPEN not below CLOSE, 90 to 180 degrees."""
    session = loaded()
    before = go(session, run_request(24, 1, FRAMES, 500, 0, flags=STILLS, **more))
    to_the_end(session)
    (verdict,) = judged(session, before, 24, roll=0.02)
    openings = camera(session)
    assert len(openings) == FRAMES
    for (on, off), time in zip(openings, frame_times(verdict, 24), strict=True):
        assert on == pytest.approx(time + 0.25 / 24, abs=0.00065)
        assert off == pytest.approx(time + 0.5 / 24, abs=0.00065)


@pytest.mark.needs("short pulses")
@pytest.mark.with_reports
@pytest.mark.parametrize("fps", [2, 12, 24, 29.97, 60, 200])
@pytest.mark.parametrize("angles", [(0, 360), (0, 359), (1, 360), (2, 358)])
def test_stills_of_whole_frames(fps, angles):
    """A pulse for each frame, and between two of them a gap that a camera sees: 10 ms, or an eighth
    of the frame."""
    session = loaded()
    for motor in range(1, 9):
        session.speed(motor, 400_000, 4_000_000)
    opens, closes = angles
    request = run_request(
        fps, 1, FRAMES, 500, 0, flags=STILLS, open_angle=opens, close_angle=closes
    )
    go(session, request)
    to_the_end(session)
    pulses = camera(session)
    assert len(pulses) == FRAMES
    gap = max(0.001, min(0.01, 1 / fps / 8))
    for (on, off), (again, _) in itertools.pairwise(pulses):
        assert gap - 0.0011 < again - off < gap + 4 / 360 / fps + 0.0021
        assert again - off > 0.0009
        assert again - on == pytest.approx(1 / fps, abs=0.0011)


@pytest.mark.needs("instants")
@pytest.mark.parametrize("fps", [0.5, 200])
def test_all_at_once_at_extreme_rates(fps):
    """Stills, lights, triggers and bloop together, slower and faster than any film: nothing is lost
    or late."""
    session = rig()
    slow = {1: 5 * np.arange(FRAMES), 2: np.zeros(FRAMES, int)}
    upload(session, slow, LEVELS, {i: 1 + i % 2 for i in range(FRAMES)})
    last = FRAMES if fps > 1 else 3
    more = {
        "bloop_outputs": 4,
        "bloop_ms": 30,
        "flags": STILLS,
        "open_angle": 90,
        "close_angle": 270,
    }
    go(session, run_request(fps, 1, last, 500, 500, sync_dmx=1, **more))
    to_the_end(session)
    openings = camera(session)
    assert len(openings) == last
    zero = changes(session, "gio3")[0][0]
    for i, (on, off) in enumerate(openings):
        assert on - zero == pytest.approx((i + 0.25) / fps, abs=0.0011)
        assert off - zero == pytest.approx((i + 0.75) / fps, abs=0.0011)
    for bit in (0, 1):
        on = [t for t, v in changes(session, f"gio{bit + 1}") if v]
        assert len(on) == (last + 1 - bit) // 2
        for k, time in enumerate(on):
            assert time - zero == pytest.approx((2 * k + bit) / fps, abs=0.0011)


def test_angles_refused():
    session = loaded()
    for angles in ((0, 361), (361, 361), (0, 65535)):
        session.refuse(
            Ack.ERR_RANGE,
            run_request(
                24, 1, 5, 500, 500, flags=STILLS, open_angle=angles[0], close_angle=angles[1]
            ),
        )
    # these count only with that flag (specification)
    session.accept(run_request(24, 1, 5, 500, 500, flags=0, open_angle=500, close_angle=65535))
    session.wait_idle()
    session.refuse(
        Ack.ERR_RANGE, run_request(24, 1, 5, flags=0x04), run_request(24, 1, 5, flags=0x8000)
    )
    session.refuse(
        Ack.ERR_RANGE, run_request(24, 1, 5, sync_dmx=2), run_request(24, 1, 5, bloop_channel=513)
    )
    assert not session.moving
