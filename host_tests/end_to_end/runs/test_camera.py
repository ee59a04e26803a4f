"""The camera in a run on the host simulation: video pulses, stills, both at extreme rates."""

import itertools

import numpy as np
import pytest

from framestep_tools import payloads as p
from host_tests.end_to_end import realtime as rt
from host_tests.end_to_end.session import run_request


@pytest.mark.parametrize("flags", [rt.VIDEO, rt.VIDEO | rt.LOOP, rt.VIDEO | rt.PING_PONG])
@pytest.mark.parametrize("reverse", [False, True])
def test_video(flags, reverse):
    """Field note 6.9: meter and shutter for 100 ms at GO, before anything moves, and after the
    post-roll."""
    session = rt.loaded()
    first, last = (rt.FRAMES, 1) if reverse else (1, rt.FRAMES)
    rt.go(session, run_request(24, first, last, 500, 300, flags=flags))
    went = session.now
    if flags != rt.VIDEO:
        session.run(2.6).accept(p.RtStopLoop())
    ended = rt.to_the_end(session)
    begins = min(session.steps(motor)[0][0] for motor in rt.MOVE)
    (on, off), (on_again, off_again) = rt.camera(session)
    assert 0 <= on - went < 0.006
    assert on <= begins
    assert off - on == pytest.approx(0.1, abs=1e-4)
    assert off_again - on_again == pytest.approx(0.1, abs=1e-4)
    assert on_again == pytest.approx(ended, abs=0.006)
    rest = max(times[times < ended][-1] for times in (session.steps(motor)[0] for motor in rt.MOVE))
    assert on_again >= rest, "the whole move is on the recording"


@pytest.mark.needs("prompt")  # a pass ends the pulse that a stop begins
@pytest.mark.parametrize("after", [0.02, 0.15, 0.3, 0.55, 1.0, 1.52, 1.7])
def test_video_stopped(after):
    """However a run ends, a separate pulse stops a camera that was started."""
    session = rt.loaded()
    rt.go(session, run_request(24, 1, rt.FRAMES, 500, 500, flags=rt.VIDEO))
    session.run(after).accept(p.MotorStopAll())
    rt.to_the_end(session)
    (_, first_off), (on, _) = pulses = rt.camera(session)
    assert on - first_off >= 0.0999
    for on, off in pulses:
        assert off - on == pytest.approx(0.1, abs=1e-4)


def test_video_stopped_before_go():
    session = rt.loaded()
    session.ready(run_request(24, 1, rt.FRAMES, 500, 500, flags=rt.VIDEO)).forget()
    session.accept(p.MotorStopAll()).run(1)
    assert not rt.edges(session, "shutter")


@pytest.mark.needs("prompt")  # a pass ends the pulse that a stop begins
def test_video_and_the_next_operation():
    """The pulse that stops the camera is complete, whatever happens meanwhile."""
    session = rt.loaded()
    for other in (run_request(24, 3, 3, 0, 0), p.RtShootFrame(3, 1, 20, 500)):
        rt.go(session, run_request(24, 3, 3, 0, 0, flags=rt.VIDEO))
        session.until(p.RtEnd, 5).accept(other)
        while session.code(p.RtGo()) != p.Ack.OK:
            session.run(0.002)
        session.accept(p.MotorStopAll()).run(1)
        shutter = rt.changes(session, "shutter")
        on, off = shutter[2:4]
        assert on[1] == 1
        assert off[1] == 0
        assert off[0] - on[0] == pytest.approx(0.1, abs=1e-4)
        assert rt.level_now(session, "shutter") == rt.level_now(session, "meter") == 0


def test_video_of_few_frames():
    """Two pulses, 100 ms apart, even if the first frame is the last."""
    session = rt.loaded()
    for last in (3, 4):
        rt.go(session, run_request(24, 3, last, 50, 0, flags=rt.VIDEO))
        rt.to_the_end(session)
        (_, first_off), (on, off) = rt.camera(session)
        assert on - first_off >= 0.0999
        assert off - on == pytest.approx(0.1, abs=1e-4)


def test_video_stop_loop_after_the_last_frame():
    """STOP_LOOP comes in the post-roll of a lap that was not the last: the camera stops at its
    end."""
    session = rt.loaded()
    rt.go(session, run_request(24, 1, rt.FRAMES, 500, 500, flags=rt.VIDEO | rt.LOOP))
    session.run(1.7).accept(p.RtStopLoop())
    ended = rt.to_the_end(session)
    (_, (on, _)) = rt.camera(session)
    assert on == pytest.approx(ended, abs=0.006)


def test_both_camera_flags():
    """Field note 6.9: stills take precedence."""
    session = rt.loaded()
    rt.go(
        session,
        run_request(
            24, 1, rt.FRAMES, 300, 300, flags=rt.VIDEO | rt.STILLS, open_angle=10, close_angle=300
        ),
    )
    rt.to_the_end(session)
    assert len(rt.camera(session)) == rt.FRAMES


@pytest.mark.with_reports
@pytest.mark.parametrize("fps", [12, 24, 29.97])
@pytest.mark.parametrize("angles", [(0, 180), (90, 270), (350, 360), (0, 1)])
def test_stills(fps, angles):
    """Field note 6.9: shutter and meter while frame phase × 360° is within [open, close], in the
    last frame as well."""
    session = rt.loaded()
    request = run_request(
        fps, 1, rt.FRAMES, 500, 0, flags=rt.STILLS, open_angle=angles[0], close_angle=angles[1]
    )
    before = rt.go(session, request)
    ended = rt.to_the_end(session)
    (verdict,) = rt.judged(session, before, fps, roll=0.02)
    openings = rt.camera(session)
    assert len(openings) == rt.FRAMES
    for (on, off), time in zip(openings, rt.frame_times(verdict, fps), strict=True):
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
    session = rt.loaded()
    before = rt.go(session, run_request(24, 1, rt.FRAMES, 500, 0, flags=rt.STILLS, **more))
    rt.to_the_end(session)
    (verdict,) = rt.judged(session, before, 24, roll=0.02)
    openings = rt.camera(session)
    assert len(openings) == rt.FRAMES
    for (on, off), time in zip(openings, rt.frame_times(verdict, 24), strict=True):
        assert on == pytest.approx(time + 0.25 / 24, abs=0.00065)
        assert off == pytest.approx(time + 0.5 / 24, abs=0.00065)


@pytest.mark.needs("short pulses")
@pytest.mark.with_reports
@pytest.mark.parametrize("fps", [2, 12, 24, 29.97, 60, 200])
@pytest.mark.parametrize("angles", [(0, 360), (0, 359), (1, 360), (2, 358)])
def test_stills_of_whole_frames(fps, angles):
    """A pulse for each frame, and between two of them a gap that a camera sees: 10 ms, or an eighth
    of the frame."""
    session = rt.loaded()
    for motor in range(1, 9):
        session.speed(motor, 400_000, 4_000_000)
    opens, closes = angles
    request = run_request(
        fps, 1, rt.FRAMES, 500, 0, flags=rt.STILLS, open_angle=opens, close_angle=closes
    )
    rt.go(session, request)
    rt.to_the_end(session)
    pulses = rt.camera(session)
    assert len(pulses) == rt.FRAMES
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
    session = rt.rig()
    slow = {1: 5 * np.arange(rt.FRAMES), 2: np.zeros(rt.FRAMES, int)}
    rt.upload(session, slow, rt.LEVELS, {i: 1 + i % 2 for i in range(rt.FRAMES)})
    last = rt.FRAMES if fps > 1 else 3
    more = {
        "bloop_outputs": 4, "bloop_ms": 30, "flags": rt.STILLS, "open_angle": 90,
        "close_angle": 270,
    }  # fmt: skip
    rt.go(session, run_request(fps, 1, last, 500, 500, sync_dmx=1, **more))
    rt.to_the_end(session)
    openings = rt.camera(session)
    assert len(openings) == last
    zero = rt.changes(session, "gio3")[0][0]
    for i, (on, off) in enumerate(openings):
        assert on - zero == pytest.approx((i + 0.25) / fps, abs=0.0011)
        assert off - zero == pytest.approx((i + 0.75) / fps, abs=0.0011)
    for bit in (0, 1):
        on = [t for t, v in rt.changes(session, f"gio{bit + 1}") if v]
        assert len(on) == (last + 1 - bit) // 2
        for k, time in enumerate(on):
            assert time - zero == pytest.approx((2 * k + bit) / fps, abs=0.0011)


def test_angles_refused():
    session = rt.loaded()
    for angles in ((0, 361), (361, 361), (0, 65535)):
        session.refuse(
            p.Ack.ERR_RANGE,
            run_request(
                24, 1, 5, 500, 500, flags=rt.STILLS, open_angle=angles[0], close_angle=angles[1]
            ),
        )
    # these count only with that flag (specification)
    session.accept(run_request(24, 1, 5, 500, 500, flags=0, open_angle=500, close_angle=65535))
    session.wait_idle()
    session.refuse(
        p.Ack.ERR_RANGE, run_request(24, 1, 5, flags=0x04), run_request(24, 1, 5, flags=0x8000)
    )
    session.refuse(
        p.Ack.ERR_RANGE, run_request(24, 1, 5, sync_dmx=2), run_request(24, 1, 5, bloop_channel=513)
    )
    assert not session.moving
