"""Outputs of a run on the host simulation: lights, triggers, bloop."""

import numpy as np
import pytest

from framestep_tools import payloads as p
from host_tests.end_to_end import realtime as rt
from host_tests.end_to_end.session import run_request, simulated


@pytest.mark.needs("lights")
@pytest.mark.parametrize("fps", [12, 24, 29.97, 60])
@pytest.mark.parametrize(("first", "last"), [(1, rt.FRAMES), (rt.FRAMES, 1), (5, 18)])
def test_lights_and_triggers(fps, first, last):
    """Field note 6.8: uploaded levels and triggers on their frames within 1 ms, forward, backward,
    in part."""
    session = rt.loaded()
    for motor in rt.MOVE:
        session.speed(motor, rt.VELOCITY, 2 * rt.ACCELERATION)
    before = rt.go(session, run_request(fps, first, last, 500, 100, sync_dmx=1))
    rt.to_the_end(session)
    (verdict,) = rt.judged(session, before, fps, first, last, roll=0.1)
    frames = rt.turning(first, last) - 1
    times = rt.frame_times(verdict, fps, len(frames))
    rt.assert_levels(session, times, frames)
    rt.assert_triggers(session, times, frames)
    assert not rt.edges(session, "gio4"), "an output outside the mask"
    # the levels stay, the triggers end with the last frame
    for channel, row in rt.LEVELS.items():
        assert rt.edges(session, f"dmx{channel}")[-1][1] == row[last - 1]
    for signal in ("gio1", "gio2", "gio3"):
        assert rt.Levels(session, signal)(times[-1] + 1 / fps + 0.002) == 0


def laps(session, before):
    """Yield the times and the numbers of the frames of each lap."""
    for verdict, reported in zip(
        rt.judged(session, before, roll=0.3), rt.laps_seen(session), strict=True
    ):
        frames = rt.turning(1, rt.FRAMES) - 1
        if reported[0][1] > reported[-1][1]:
            frames = frames[::-1]
        yield rt.frame_times(verdict, 24), frames


@pytest.mark.needs("lights")
@pytest.mark.parametrize("flags", [rt.LOOP, rt.PING_PONG])
def test_lights_in_a_loop(flags):
    session = rt.loaded()
    before = rt.go(session, run_request(24, 1, rt.FRAMES, 300, 300, sync_dmx=1, flags=flags))
    session.run(3.5).accept(p.RtStopLoop())
    rt.to_the_end(session)
    for times, frames in laps(session, before):
        rt.assert_levels(session, times, frames)
        rt.assert_triggers(session, times, frames)


@pytest.mark.parametrize("flags", [rt.LOOP, rt.PING_PONG])
def test_triggers_and_stills_in_a_loop(flags):
    session = rt.rig()
    rt.upload(session, triggers=rt.TRIGGERS)
    more = {"flags": flags | rt.STILLS, "open_angle": 90, "close_angle": 270}
    before = rt.go(session, run_request(24, 1, rt.FRAMES, 300, 300, sync_dmx=1, **more))
    session.run(3.5).accept(p.RtStopLoop())
    rt.to_the_end(session)
    openings = np.array(rt.camera(session))
    for times, frames in laps(session, before):
        rt.assert_triggers(session, times, frames)
        wanted = times[:, np.newaxis] + np.array([90, 270]) / 360 / 24
        assert np.abs(openings[: rt.FRAMES] - wanted).max() < 0.001
        openings = openings[rt.FRAMES :]
    assert not len(openings)


@pytest.mark.needs("little memory")
def test_no_room_for_more():
    """Positions, lights and triggers share one memory (docs/internals/realtime.md). A request that
    exceeds it is refused; earlier data stays and plays."""
    units = 37  # one motor's 25 frames leave these of the least for eight motors
    session = rt.rig(upload_bytes=2 * (69 + 17 * units))
    session.accept(
        p.RtUploadMoveBegin(1, rt.FRAMES), p.RtUploadMoveAxis(1, p.LAST_SECTION, rt.MOVE[1])
    )
    restless = np.where(np.arange(rt.FRAMES) % 2, 250, 20)
    rows = {17: restless, 300: rt.LEVELS[300]}  # a unit each
    triggers = [p.Trigger(frame, on) for frame, on in rt.TRIGGERS.items()]  # one for each output: 4
    for channel, row in rows.items():
        session.accept(p.RtUploadMoveDmx(channel, p.LAST_SECTION, row))
    session.accept(p.RtUploadMoveTriggers(rt.MASK, triggers))
    for channel in range(101, 101 + units - 6):
        session.accept(p.RtUploadMoveDmx(channel, p.LAST_SECTION, restless))
    session.refuse(p.Ack.ERR_RANGE, p.RtUploadMoveDmx(5, p.LAST_SECTION, restless))
    session.refuse(p.Ack.ERR_RANGE, p.RtUploadMoveDmx(5, p.LAST_SECTION, [1]))
    session.refuse(
        p.Ack.ERR_RANGE, p.RtUploadMoveTriggers(rt.MASK | 16, [p.Trigger(2, 7), p.Trigger(3, 16)])
    )
    session.refuse(p.Ack.ERR_RANGE, p.RtUploadMoveAxis(2, p.LAST_SECTION, rt.MOVE[2]))
    session.accept(p.RtUploadMoveDmx(17, p.LAST_SECTION, restless[::-1]), p.RtUploadMoveEnd())
    before = rt.go(session, run_request(24, 1, rt.FRAMES, 300, 300, sync_dmx=1))
    rt.to_the_end(session)
    verdict = rt.judge_lap(session, 0, session.now, before, {1: rt.MOVE[1]}, 24)
    times = rt.frame_times(verdict, 24)
    rows[17] = restless[::-1]
    for channel, row in {**rows, 101: restless, 100 + units - 6: restless}.items():
        rt.assert_held(session, f"dmx{channel}", row, times)
    for bit in range(3):
        on = [rt.TRIGGERS.get(frame, 0) >> bit & 1 for frame in range(rt.FRAMES)]
        rt.assert_held(session, f"gio{bit + 1}", on, times)
    assert not rt.edges(session, "dmx5"), "refused"


@pytest.mark.each_processor
def test_lights_left_alone():
    """SYNC DMX 0: neither levels nor triggers change."""
    session = rt.loaded()
    session.accept(p.Dmx(0, 17, [0x55]))
    rt.go(session, run_request(24, 1, rt.FRAMES, 300, 300))
    rt.to_the_end(session)
    assert not [name for name in session.trace().signals if name.startswith(("dmx", "gio"))]


@pytest.mark.needs("lights")
def test_position_frame_sets_lights():
    """spec: MSG_RT_POSITION_FRAME, "and DMX if applicable"."""
    session = rt.loaded()
    session.forget().accept(p.RtPositionFrame(8)).wait_idle()
    for channel, row in rt.LEVELS.items():
        assert [v for _, v in rt.edges(session, f"dmx{channel}")][-1:] == (
            [row[7]] if row[7] else []
        )
    assert not rt.edges(session, "gio1")


@pytest.mark.parametrize("frame", [1, 4, 6, 12, 25, 2])
def test_position_frame_sets_triggers(frame):
    """Like levels, at once; output bits outside the mask stay (field note 6.8)."""
    session = rt.loaded()
    session.accept(p.GioOut(0b1101), p.RtPositionFrame(frame)).run(0.005)
    on = rt.TRIGGERS.get(frame - 1, 0) & rt.MASK | 0b1000
    assert [rt.level_now(session, f"gio{bit + 1}") for bit in range(4)] == [
        on >> bit & 1 for bit in range(4)
    ]
    session.wait_idle()


@pytest.mark.needs("lights")
@pytest.mark.parametrize("sync", [0, 1])
@pytest.mark.parametrize("flags", [None, rt.LOOP])
def test_bloop(sync, flags):
    """Field note 6.7: on for BLOOP TIME from the first frame, once in a run; then the channel
    returns to its level."""
    session = rt.loaded()
    session.accept(p.Dmx(0, 300, [0x0C]), p.Dmx(0, 40, [0x22]))
    for channel, old in ((40, 0x22), (300, rt.LEVELS[300][3] if sync else 0x0C)):
        bloop = {
            "bloop_outputs": 0x80000008, "bloop_channel": channel, "bloop_ms": 120, "flags": flags,
        }  # fmt: skip
        before = rt.go(session, run_request(24, 1, rt.FRAMES, 300, 200, sync_dmx=sync, **bloop))
        session.run(4)
        if flags:
            session.accept(p.RtStopLoop())
            rt.to_the_end(session)
        else:
            assert session.client.take_event(p.RtEnd)
        zero = rt.frame_times(rt.judged(session, before, roll=0.2)[0], 24)[0]
        on, off = rt.edges(session, "gio4")
        assert on == (pytest.approx(zero, abs=0.001), 1)
        assert off == (pytest.approx(zero + 0.12, abs=0.001), 0)
        if sync and not flags:
            rt.assert_triggers(
                session,
                rt.frame_times(rt.judged(session, before, roll=0.2)[0], 24),
                range(rt.FRAMES),
            )
        levels = [e for e in rt.changes(session, f"dmx{channel}") if e[0] < zero + 0.13]
        assert levels[0] == (pytest.approx(zero, abs=0.002), 255)
        assert levels[-1] == (pytest.approx(zero + 0.12, abs=0.002), old)
        assert len(levels) == 2


BLOOP = {"bloop_outputs": 0b1001, "bloop_channel": 40}


def assert_bloop(session, from_s, ms, level=0x22):
    """Assert that outputs 1 and 4 and channel 40 were on that long, without other changes."""
    for name in ("gio1", "gio4"):
        assert rt.changes(session, name) == [
            (pytest.approx(from_s, abs=0.001), 1),
            (pytest.approx(from_s + ms / 1000, abs=0.001), 0),
        ]
    assert rt.changes(session, "dmx40") == [
        (pytest.approx(from_s, abs=0.002), 255),
        (pytest.approx(from_s + ms / 1000, abs=0.002), level),
    ]


@pytest.mark.needs("lights")
@pytest.mark.parametrize("ms", [0, 1, 2, 30, 59, 61, 900, 2500, 5000])
def test_bloop_outlives_its_run(ms):
    """Field note 6.7: on for BLOOP TIME from the first frame, even if the run ends before; a time
    of 0 is none."""
    session = rt.loaded()
    session.accept(p.Dmx(0, 40, [0x22]))
    rt.go(session, run_request(24, 1, rt.FRAMES, 300, 200, bloop_ms=ms, **BLOOP))
    went = session.now
    rt.to_the_end(session)
    session.wait_idle().run(max(0, ms / 1000 + 0.4 - (session.now - went)))
    if not ms:
        assert not any(rt.edges(session, name) for name in ("gio1", "gio4", "dmx40"))
        return
    assert_bloop(session, rt.changes(session, "gio1")[0][0], ms)
    assert rt.changes(session, "gio1")[0][0] - went == pytest.approx(0.3, abs=0.005)


@pytest.mark.needs("lights")
@pytest.mark.parametrize("after", [0.1, 0.31, 0.7, 1.5, 1.7])
@pytest.mark.parametrize("ms", [500, 3000])
def test_bloop_outlives_a_stop(after, ms):
    """Nothing cuts it off; a run that is stopped before its first frame has none."""
    session = rt.loaded()
    session.accept(p.Dmx(0, 40, [0x22]))
    rt.go(session, run_request(24, 1, rt.FRAMES, 300, 200, bloop_ms=ms, **BLOOP))
    session.run(after).accept(p.MotorStopAll()).run(0.1)
    session.accept(p.RtUploadMoveBegin(1, 2)).run(4)
    assert len(session.events(p.RtEnd)) == 1
    if after < 0.3:
        assert not rt.edges(session, "gio1")
        assert not rt.edges(session, "dmx40")
    else:
        assert_bloop(session, rt.changes(session, "gio1")[0][0], ms)


@pytest.mark.each_processor
@pytest.mark.needs("lights")
def test_bloop_and_another_run():
    """A run without a bloop leaves the earlier bloop on; the next run with a bloop begins its own
    at its first frame."""
    session = rt.loaded()
    session.accept(p.Dmx(0, 40, [0x22]))
    run = run_request(24, 1, 3, 200, 100, bloop_ms=4000, **BLOOP)
    rt.go(session, run)
    rt.to_the_end(session)
    session.ready(run_request(24, 5, 9, 100, 100, sync_dmx=0))
    session.accept(p.RtGo()).run(0.3)
    session.accept(p.MotorStopAll()).run(5)
    assert_bloop(session, rt.changes(session, "gio1")[0][0], 4000)
    rt.go(session, run)
    rt.to_the_end(session)
    session.ready(run)
    session.accept(p.RtGo()).run(5)
    on = [time for time, level in rt.changes(session, "gio1") if level]
    off = [time for time, level in rt.changes(session, "gio1") if not level]
    assert len(on) == len(off) == 2
    assert off[0] < on[1]
    assert off[1] - on[1] == pytest.approx(4.0, abs=0.001)
    assert [level for _, level in rt.changes(session, "dmx40")] == [255, 0x22, 255, 0x22]


@pytest.mark.needs("lights")
@pytest.mark.parametrize("how", ["E-stop", "lost host"])
@pytest.mark.parametrize("after", [0.5, 2.2])
def test_bloop_and_safe_levels(how, after):
    """A fault puts outputs to their safe levels, in the run and after it, and nothing changes them
    after that."""
    session = simulated(
        {
            "estop": "nc",
            "outputs": [
                {"pin": 22, "safe": "off"}, {"pin": 26}, {"pin": 27}, {"pin": 28, "safe": "on"},
            ],
            "inputs": [],
        }
    )  # fmt: skip
    session.input("estop", 0).run(0.05)
    rt.upload(session, {1: np.zeros(rt.FRAMES, int)})
    session.accept(p.GioOut(0b1111), p.GioOut(0), p.Dmx(0, 40, [0x22]))
    rt.go(session, run_request(24, 1, rt.FRAMES, 300, 200, bloop_ms=4000, **BLOOP))
    session.run(after)
    assert rt.level_now(session, "gio1") == 1
    if how == "E-stop":
        session.input("estop", 1)
    else:
        session.leave()
    session.board.run_until(session.board.now_ns + 10**7)
    happened = session.now
    session.board.run_until(session.board.now_ns + 6 * 10**9)
    assert rt.level_now(session, "gio1") == 0
    assert rt.level_now(session, "gio4") == 1
    for name in ("gio1", "gio4", "dmx40"):
        assert not [time for time, _ in rt.changes(session, name) if time > happened], name
    assert rt.changes(session, "dmx40")[-1][1] == 0x22
