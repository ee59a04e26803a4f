"""Real-time runs on the host simulation: loops, lights, triggers, camera, bloop, what is refused, what stops them."""

import itertools
import random

import numpy as np
import pytest

from framestep.hal import host
from framestep_tools.payloads import (
    LAST_SECTION,
    Ack,
    Dmx,
    GioOut,
    MotorConfigure,
    MotorGetPosition,
    MotorMove,
    MotorSetLimits,
    MotorStop,
    MotorStopAll,
    RtEnd,
    RtGo,
    RtJogAll,
    RtPositionFrame,
    RtShootFrame,
    RtShootFrame2,
    RtStopLoop,
    RtUploadMoveAxis,
    RtUploadMoveBegin,
    RtUploadMoveDmx,
    RtUploadMoveEnd,
    RtUploadMoveTriggers,
    Trigger,
)
from host_tests.end_to_end.realtime import (
    ACCELERATION,
    FRAMES,
    LEVELS,
    MASK,
    MOVE,
    TRIGGERS,
    VELOCITY,
    Levels,
    changes,
    edges,
    frame_times,
    judge_pass,
    level_now,
    loaded,
    passes_told,
    rig,
    turning,
    upload,
)
from host_tests.end_to_end.session import assert_within, run_request, simulated, state

PING_PONG, LOOP, VIDEO, STILLS = 0x01, 0x02, 0x10, 0x20
ALL_OFF = ("shutter", "meter", "gio1", "gio2", "gio3", "gio4")


def go(session, request):
    """Prepare, forget what was, start. Where the motors waited."""
    session.ready(request)
    before = session.positions
    session.forget()
    session.accept(RtGo())
    return before


def to_the_end(session, seconds=20):
    """Wait for RT_END; it must be the only one. When it came."""
    session.client.wait_event(RtEnd, seconds)
    ended = session.now
    session.run(0.5)
    session.wait_idle()  # on the end frame again (field note 6.11)
    assert not session.events(RtEnd), "RT_END came twice"
    return ended


def judged(session, before, fps=24, first=1, last=FRAMES, roll=0.5):
    """A verdict for each pass, each over all its frames."""
    verdicts = []
    for told in passes_told(session):
        backward = told[-1][1] < told[0][1]
        frames = turning(last, first) if backward == (last > first) else turning(first, last)
        assert [f for _, f in told] == frames[1:].tolist()
        positions = {m: steps[frames - 1] for m, steps in MOVE.items()}
        begin = told[0][0] - 1 / fps - roll / 2
        verdicts.append(judge_pass(session, begin, told[-1][0] + roll / 2, before, positions, fps))
    return verdicts


# ---- what is planned before GO ---------------------------------------------------------------------------


@pytest.mark.parametrize("ms", [0, 1, 2, 3, 5, 8, 12, 20, 50])
def test_go_at_any_moment_of_planning(ms):
    """The same run, whether its beginning has been planned, is being planned, or was dropped meanwhile."""
    session = loaded()
    session.ready(run_request(24, 1, FRAMES, 300, 300))
    session.speed(1, VELOCITY, ACCELERATION)  # begun anew
    session.run(ms / 1000)
    assert not session.moving
    before = session.positions
    session.forget()
    session.accept(RtGo())
    to_the_end(session)
    assert len(judged(session, before, roll=0.3)) == 1


@pytest.mark.parametrize("ms", [1, 4, 9, 20, 60])
@pytest.mark.parametrize("cause", ["E-stop", "lost host"])
def test_a_stop_while_the_beginning_is_planned(cause, ms):
    """Nothing moves, GO is refused, and afterwards the same run goes as if nothing had been."""
    session = loaded(estop="nc")
    board = session.board._board
    board.set_input("estop", 0)
    session.run(0.05)
    session.ready(run_request(24, 1, FRAMES, 300, 300))
    session.speed(1, VELOCITY, ACCELERATION)  # planning begins anew
    session.run(ms / 1000)
    before = session.positions
    session.forget()
    if cause == "E-stop":
        board.set_input("estop", 1)
        session.run(0.1)
        session.refuse(Ack.ERR_GENERAL, RtGo())
        board.set_input("estop", 0)
        session.run(0.1)
    else:
        session.leave()
        session.board.run_until(session.board.now_ns + 10**8)
        session.come_back()
        session.run(0.1)
    session.refuse(Ack.ERR_GENERAL, RtGo())
    session.run(0.5)
    assert session.positions == before
    assert not session.moving
    assert not session.trace().motors
    session.ready(run_request(24, 1, FRAMES, 300, 300))
    session.forget()
    session.accept(RtGo())
    to_the_end(session)
    assert len(judged(session, before, roll=0.3)) == 1


def test_what_is_planned_before_go_makes_no_edge():
    session = loaded()
    session.ready(run_request(24, 1, FRAMES, 300, 300))
    session.run(0.3)
    before = session.positions
    session.forget()
    session.accept(MotorStopAll())
    to_the_end(session, 1)
    assert session.positions == before
    assert not session.trace().motors
    session.refuse(Ack.ERR_GENERAL, RtGo())
    # away and back: MOVE starts from where the motor stands
    session.ready(run_request(24, 1, FRAMES, 300, 300))
    session.run(0.3)
    for place in (before[1] + 700, before[1]):
        session.accept(MotorMove(1, place))
        session.refuse(Ack.ERR_NOT_IN_POSITION, RtGo())
        session.wait_idle()
        session.run(0.1)
    session.forget()
    session.accept(RtGo())
    to_the_end(session)
    assert len(judged(session, before, roll=0.3)) == 1


# ---- loops -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("flags", [LOOP, PING_PONG, LOOP | PING_PONG])
@pytest.mark.parametrize(("first", "last"), [(1, FRAMES), (FRAMES, 1), (4, 20)])
def test_passes(flags, first, last):
    """Every pass keeps to its frames as a single one does, with ramps inside the limits between them; one RT_END."""
    session = loaded()
    before = go(session, run_request(24, first, last, 500, 300, flags=flags))
    session.run(4.8)
    assert not session.events(RtEnd)
    session.accept(RtStopLoop())
    to_the_end(session)
    verdicts = judged(session, before, first=first, last=last, roll=0.3)
    assert len(verdicts) >= 3
    for motor in MOVE:
        assert_within(*session.steps(motor), VELOCITY, ACCELERATION)
        assert session.position(motor) == before[motor] + session.made(motor)
    told = passes_told(session)
    turns = [p[-1][1] > p[0][1] for p in told]
    if flags & PING_PONG:
        assert all(a != b for a, b in itertools.pairwise(turns))
    else:
        assert len(set(turns)) == 1


# seconds after GO; the passes that are then played to their ends
@pytest.mark.parametrize(
    ("after", "ping_pong", "loop"), [(0.2, 1, 1), (1.0, 1, 1), (1.8, 1, 1), (2.3, 2, 1), (3.0, 2, 2)]
)
@pytest.mark.parametrize("flags", [PING_PONG, LOOP])
def test_stop_loop(after, ping_pong, loop, flags):
    """Field note 6.6: the pass under way reaches its end, then RT_END: in pre-roll, pass, post-roll, next roll."""
    session = loaded()
    before = go(session, run_request(24, 1, FRAMES, 500, 500, flags=flags))
    session.run(after)
    session.accept(RtStopLoop())
    session.accept(RtStopLoop())
    to_the_end(session)
    assert len(judged(session, before)) == (ping_pong if flags == PING_PONG else loop)
    assert passes_told(session)[-1][-1][1] in (1, FRAMES)
    session.accept(RtStopLoop())
    session.refuse(Ack.ERR_GENERAL, RtGo())
    session.wait_idle()
    # and it is forgotten: the next loop is one again
    go(session, run_request(24, 1, FRAMES, 500, 500, flags=flags))
    session.run(3.5)
    assert not session.events(RtEnd)
    assert len(passes_told(session)) >= 2
    session.accept(MotorStopAll())
    to_the_end(session)


@pytest.mark.parametrize("after", [1.2, 1.3, 1.45, 1.499, 1.51])
@pytest.mark.parametrize("flags", [PING_PONG, LOOP])
def test_stop_loop_late_in_a_pass(after, flags):
    """Field note 6.11: when the ramp behind the end frame is queued, it becomes the post-roll, within the limits."""
    session = loaded()
    go(session, run_request(24, 1, FRAMES, 500, 500, flags=flags))
    begun = session.now
    session.run(after)
    session.accept(RtStopLoop())
    ended = to_the_end(session)
    assert 1.99 < ended - begun < 2.06
    session.wait_idle()
    assert session.position(1) == MOVE[1][-1]
    assert session.position(2) == MOVE[2][-1]
    assert passes_told(session)[-1][-1][1] == FRAMES
    assert len(passes_told(session)) == 1
    for motor in MOVE:
        assert_within(*session.steps(motor), VELOCITY, ACCELERATION)


def test_stop_loop_on_the_way_back():
    """Between two passes of a loop: the rig ends at the start, an end point, and plays no further pass."""
    session = rig()
    far = {1: 4000 * np.arange(FRAMES) // 24, 2: np.zeros(FRAMES, int)}
    upload(session, far)
    session.speed(1, 6000, 20_000)
    go(session, run_request(24, 1, FRAMES, 500, 500, flags=LOOP))
    session.run(2.4)
    session.accept(RtStopLoop())
    assert not session.events(RtEnd)
    to_the_end(session)
    assert len(passes_told(session)) == 1
    assert min(session.steps(1)[1].cumsum()[1000:]) <= 1, "it has gone back to where the pass began"
    session.wait_idle()
    assert session.position(1) == far[1][-1]


@pytest.mark.parametrize("flags", [LOOP, PING_PONG])
@pytest.mark.parametrize("wait", [0.0, 0.02, 2.0])
def test_stop_loop_before_go(flags, wait):
    """Field note 6.12: it takes the loop away, on the way to the pre-roll position and while GO is awaited."""
    session = loaded()
    session.accept(run_request(24, 1, FRAMES, 500, 500, flags=flags))
    session.run(wait)
    session.accept(RtStopLoop())
    session.wait_idle()
    before = session.positions
    session.forget()
    session.accept(RtGo())
    to_the_end(session)
    assert len(judged(session, before)) == 1
    session.wait_idle()
    assert session.position(1) == MOVE[1][-1]


def test_stop_loop_without_a_loop():
    """Field note 6.12: always OK, and it changes nothing."""
    session = loaded()
    session.accept(RtStopLoop())
    session.ready(RtShootFrame(10, 1, 300, 500))
    session.accept(RtStopLoop(), RtGo(), RtStopLoop())
    to_the_end(session)
    before = go(session, run_request(24, 1, FRAMES, 500, 500))
    session.run(0.7)
    session.accept(RtStopLoop())
    to_the_end(session)
    assert len(judged(session, before)) == 1
    session.accept(RtJogAll(24000, 3), RtStopLoop())
    session.wait_idle()
    assert session.position(1) == MOVE[1][2]


@pytest.mark.parametrize("flags", [LOOP, PING_PONG])
def test_rolls_of_no_time(flags):
    """Pre-roll 0 and post-roll 0: the shortest ramps that the motors can, in each pass."""
    session = loaded()
    before = go(session, run_request(24, 1, FRAMES, 0, 0, flags=flags))
    session.run(3.5)
    session.accept(RtStopLoop())
    to_the_end(session)
    assert len(judged(session, before, roll=0.03)) >= 3
    for motor in MOVE:
        assert_within(*session.steps(motor), VELOCITY, ACCELERATION)


def test_loop_of_a_single_frame():
    session = loaded()
    for flags in (LOOP, PING_PONG):
        go(session, run_request(24, 7, 7, 200, 200, flags=flags))
        session.run(2)
        assert not session.events(RtEnd)
        session.accept(RtStopLoop())
        to_the_end(session)
        assert session.position(1) == MOVE[1][6]


def test_lights_alone():
    """An upload without positions is played as well: lights and triggers in time, then RT_END."""
    session = rig()
    upload(session, {}, LEVELS, TRIGGERS)
    session.accept(run_request(24, 1, FRAMES, 300, 0, sync_dmx=1))
    session.wait_idle()
    session.forget()
    session.accept(RtGo())
    asked = session.now
    ended = to_the_end(session)
    assert ended - asked == pytest.approx(0.3 + FRAMES / 24, abs=0.01)  # the last frame has a trigger on
    first = edges(session, "gio1")[0][0]
    assert first - asked == pytest.approx(0.3, abs=0.005)
    assert_triggers(session, first + np.arange(FRAMES) / 24, range(FRAMES))
    assert_levels(session, first + np.arange(FRAMES) / 24, range(FRAMES))


# ---- lights, triggers, bloop -----------------------------------------------------------------------------


def assert_held(session, signal, row, times):
    """A signal has each frame's level from 1 ms after the frame's time until 1 ms before the next one's."""
    level = Levels(session, signal)
    ends = np.append(times[1:], times[-1] + np.diff(times).min())
    for i, (time, end) in enumerate(zip(times, ends, strict=True)):
        assert level(time + 0.001) == row[i] == level(end - 0.001), (signal, i)


def assert_levels(session, times, frames):
    for channel, row in LEVELS.items():
        assert_held(session, f"dmx{channel}", row[list(frames)], times)


def assert_triggers(session, times, frames):
    for bit in range(3):
        assert_held(session, f"gio{bit + 1}", [TRIGGERS.get(frame, 0) >> bit & 1 for frame in frames], times)


@pytest.mark.parametrize("fps", [12, 24, 29.97, 60])
@pytest.mark.parametrize(("first", "last"), [(1, FRAMES), (FRAMES, 1), (5, 18)])
def test_lights_and_triggers(fps, first, last):
    """Field note 6.8: uploaded levels and triggers on their frames within 1 ms, forward, backward, in part."""
    session = loaded()
    for motor in MOVE:
        session.speed(motor, VELOCITY, 2 * ACCELERATION)
    before = go(session, run_request(fps, first, last, 500, 100, sync_dmx=1))
    to_the_end(session)
    (verdict,) = judged(session, before, fps, first, last, roll=0.1)
    frames = turning(first, last) - 1
    times = frame_times(verdict, fps, len(frames))
    assert_levels(session, times, frames)
    assert_triggers(session, times, frames)
    assert not edges(session, "gio4"), "an output outside the mask"
    # the levels stay, the triggers do not outlast the last frame
    for channel, row in LEVELS.items():
        assert edges(session, f"dmx{channel}")[-1][1] == row[last - 1]
    for signal in ("gio1", "gio2", "gio3"):
        assert Levels(session, signal)(times[-1] + 1 / fps + 0.002) == 0


@pytest.mark.parametrize("flags", [LOOP, PING_PONG])
def test_lights_in_a_loop(flags):
    session = loaded()
    before = go(session, run_request(24, 1, FRAMES, 300, 300, sync_dmx=1, flags=flags))
    session.run(3.5)
    session.accept(RtStopLoop())
    to_the_end(session)
    for verdict, told in zip(judged(session, before, roll=0.3), passes_told(session), strict=True):
        frames = turning(1, FRAMES) - 1
        if told[0][1] > told[-1][1]:
            frames = frames[::-1]
        times = frame_times(verdict, 24)
        assert_levels(session, times, frames)
        assert_triggers(session, times, frames)


def uploaded(session):
    """All that is kept, without what a section on its way in is worked with."""
    found = state(session)
    found[".moves.levels._words"] = found[".moves.levels._words"][: 5 * 4]
    return found


def test_no_room_for_more_lights_and_triggers(monkeypatch):
    """The stated capacity (docs/realtime.md): what goes beyond it is refused, the upload is kept, and played."""
    monkeypatch.setattr(host, "UPLOAD_BYTES", 140 * 8 * 5)  # 40 changes, 5 frames with triggers
    session = rig()
    session.accept(RtUploadMoveBegin(1, FRAMES))
    session.accept(RtUploadMoveAxis(1, LAST_SECTION, MOVE[1]))
    restless = np.where(np.arange(FRAMES) % 2, 250, 20)
    session.accept(RtUploadMoveDmx(17, LAST_SECTION, restless))  # a change with each frame
    session.accept(RtUploadMoveDmx(300, LAST_SECTION, LEVELS[300]))  # 4 more
    kept = uploaded(session)
    session.refuse(Ack.ERR_RANGE, RtUploadMoveDmx(5, LAST_SECTION, restless[:12]))
    assert uploaded(session) == kept
    session.accept(RtUploadMoveDmx(5, LAST_SECTION, restless[:11]))
    session.refuse(Ack.ERR_RANGE, RtUploadMoveDmx(6, LAST_SECTION, [1]))
    triggers = [Trigger(frame, on) for frame, on in TRIGGERS.items()]
    assert len(triggers) == 6
    kept = uploaded(session)
    session.refuse(Ack.ERR_RANGE, RtUploadMoveTriggers(MASK, triggers))
    assert uploaded(session) == kept
    session.accept(RtUploadMoveTriggers(MASK, triggers[:5]))
    session.refuse(Ack.ERR_RANGE, RtUploadMoveTriggers(MASK, triggers[5:]))
    session.accept(RtUploadMoveEnd())
    before = go(session, run_request(24, 1, FRAMES, 300, 300, sync_dmx=1))
    to_the_end(session)
    verdict = judge_pass(session, 0, session.now, before, {1: MOVE[1]}, 24)
    times = frame_times(verdict, 24)
    for channel, row in {17: restless, 300: LEVELS[300], 5: [*restless[:11], *[20] * 14]}.items():
        assert_held(session, f"dmx{channel}", row, times)
    for bit in range(3):
        on = [dict(list(TRIGGERS.items())[:5]).get(frame, 0) >> bit & 1 for frame in range(FRAMES)]
        assert_held(session, f"gio{bit + 1}", on, times)


def test_lights_left_alone():
    """SYNC DMX 0: neither levels nor triggers."""
    session = loaded()
    session.accept(Dmx(0, 17, [0x55]))
    go(session, run_request(24, 1, FRAMES, 300, 300))
    to_the_end(session)
    assert not [name for name in session.trace().signals if name.startswith(("dmx", "gio"))]


def test_position_frame_sets_lights():
    """spec: MSG_RT_POSITION_FRAME, "and DMX if applicable"."""
    session = loaded()
    session.forget()
    session.accept(RtPositionFrame(8))
    session.wait_idle()
    for channel, row in LEVELS.items():
        assert [v for _, v in edges(session, f"dmx{channel}")][-1:] == ([row[7]] if row[7] else [])
    assert not edges(session, "gio1")


@pytest.mark.parametrize("frame", [1, 4, 6, 12, 25, 2])
def test_position_frame_sets_triggers(frame):
    """As levels, at once; output bits outside the mask are left alone (field note 6.8)."""
    session = loaded()
    session.accept(GioOut(0b1101))
    session.accept(RtPositionFrame(frame))
    session.run(0.005)
    on = TRIGGERS.get(frame - 1, 0) & MASK | 0b1000
    assert [level_now(session, f"gio{bit + 1}") for bit in range(4)] == [on >> bit & 1 for bit in range(4)]
    session.wait_idle()


@pytest.mark.parametrize("sync", [0, 1])
@pytest.mark.parametrize("flags", [None, LOOP])
def test_bloop(sync, flags):
    """Field note 6.7: on for BLOOP TIME from the first frame, once in a run; the channel goes back."""
    session = loaded()
    session.accept(Dmx(0, 300, [0x0C]), Dmx(0, 40, [0x22]))
    for channel, old in ((40, 0x22), (300, LEVELS[300][3] if sync else 0x0C)):
        bloop = {"bloop_outputs": 0x80000008, "bloop_channel": channel, "bloop_ms": 120, "flags": flags}
        before = go(session, run_request(24, 1, FRAMES, 300, 200, sync_dmx=sync, **bloop))
        session.run(4)
        if flags:
            session.accept(RtStopLoop())
            to_the_end(session)
        else:
            assert session.client.take_event(RtEnd)
        zero = frame_times(judged(session, before, roll=0.2)[0], 24)[0]
        on, off = edges(session, "gio4")
        assert on == (pytest.approx(zero, abs=0.001), 1)
        assert off == (pytest.approx(zero + 0.12, abs=0.001), 0)
        if sync and not flags:
            assert_triggers(session, frame_times(judged(session, before, roll=0.2)[0], 24), range(FRAMES))
        levels = [e for e in changes(session, f"dmx{channel}") if e[0] < zero + 0.13]
        assert levels[0] == (pytest.approx(zero, abs=0.002), 255)
        assert levels[-1] == (pytest.approx(zero + 0.12, abs=0.002), old)
        assert len(levels) == 2


def test_bloop_of_no_time():
    session = loaded()
    go(session, run_request(24, 1, FRAMES, 300, 200, bloop_outputs=1, bloop_channel=40, bloop_ms=0))
    to_the_end(session)
    assert not edges(session, "gio1")
    assert not edges(session, "dmx40")


BLOOP = {"bloop_outputs": 0b1001, "bloop_channel": 40}


def assert_bloop(session, from_s, ms, level=0x22):
    """Outputs 1 and 4 and channel 40 were on for so long, and nothing else happened to them."""
    for name in ("gio1", "gio4"):
        assert changes(session, name) == [
            (pytest.approx(from_s, abs=0.001), 1),
            (pytest.approx(from_s + ms / 1000, abs=0.001), 0),
        ]
    assert changes(session, "dmx40") == [
        (pytest.approx(from_s, abs=0.002), 255),
        (pytest.approx(from_s + ms / 1000, abs=0.002), level),
    ]


@pytest.mark.parametrize("ms", [1, 2, 30, 59, 61, 900, 2500, 5000])
def test_bloop_outlives_its_run(ms):
    """Field note 6.7: on for BLOOP TIME from the first frame, also where the run ends before."""
    session = loaded()
    session.accept(Dmx(0, 40, [0x22]))
    go(session, run_request(24, 1, FRAMES, 300, 200, bloop_ms=ms, **BLOOP))
    went = session.now
    to_the_end(session)
    session.wait_idle()
    session.run(max(0, ms / 1000 + 0.4 - (session.now - went)))
    assert_bloop(session, changes(session, "gio1")[0][0], ms)
    assert changes(session, "gio1")[0][0] - went == pytest.approx(0.3, abs=0.005)


@pytest.mark.parametrize("after", [0.1, 0.31, 0.7, 1.5, 1.7])
@pytest.mark.parametrize("ms", [500, 3000])
def test_bloop_outlives_a_stop(after, ms):
    """Cut off by nothing; a run that is stopped before its first frame has none."""
    session = loaded()
    session.accept(Dmx(0, 40, [0x22]))
    go(session, run_request(24, 1, FRAMES, 300, 200, bloop_ms=ms, **BLOOP))
    session.run(after)
    session.accept(MotorStopAll())
    session.run(0.1)
    session.accept(RtUploadMoveBegin(1, 2))
    session.run(4)
    assert len(session.events(RtEnd)) == 1
    if after < 0.3:
        assert not edges(session, "gio1")
        assert not edges(session, "dmx40")
    else:
        assert_bloop(session, changes(session, "gio1")[0][0], ms)


def test_bloop_and_another_run():
    """A run without a bloop leaves that of the one before on; the next with one begins its own at its first frame."""
    session = loaded()
    session.accept(Dmx(0, 40, [0x22]))
    run = run_request(24, 1, 3, 200, 100, bloop_ms=4000, **BLOOP)
    go(session, run)
    to_the_end(session)
    session.ready(run_request(24, 5, 9, 100, 100, sync_dmx=0))
    session.accept(RtGo())
    session.run(0.3)
    session.accept(MotorStopAll())
    session.run(5)
    assert_bloop(session, changes(session, "gio1")[0][0], 4000)
    go(session, run)
    to_the_end(session)
    session.ready(run)
    session.accept(RtGo())
    session.run(5)
    on = [time for time, level in changes(session, "gio1") if level]
    off = [time for time, level in changes(session, "gio1") if not level]
    assert len(on) == len(off) == 2
    assert off[0] < on[1]
    assert off[1] - on[1] == pytest.approx(4.0, abs=0.001)
    assert [level for _, level in changes(session, "dmx40")] == [255, 0x22, 255, 0x22]


@pytest.mark.parametrize("how", ["E-stop", "lost host"])
@pytest.mark.parametrize("after", [0.5, 2.2])
def test_bloop_and_safe_levels(how, after):
    """A fault puts outputs to their safe levels, in the run and after it, and nothing comes behind that."""
    session = simulated(
        {
            "estop": "nc",
            "outputs": [{"pin": 22, "safe": "off"}, {"pin": 26}, {"pin": 27}, {"pin": 28, "safe": "on"}],
            "inputs": [],
        }
    )
    board = session.board._board
    board.set_input("estop", 0)
    session.run(0.05)
    upload(session, {1: np.zeros(FRAMES, int)})
    session.accept(GioOut(0b1111), GioOut(0), Dmx(0, 40, [0x22]))
    go(session, run_request(24, 1, FRAMES, 300, 200, bloop_ms=4000, **BLOOP))
    session.run(after)
    assert level_now(session, "gio1") == 1
    if how == "E-stop":
        board.set_input("estop", 1)
    else:
        session.leave()
    session.board.run_until(session.board.now_ns + 10**7)
    happened = session.now
    session.board.run_until(session.board.now_ns + 6 * 10**9)
    assert level_now(session, "gio1") == 0
    assert level_now(session, "gio4") == 1
    for name in ("gio1", "gio4", "dmx40"):
        assert not [time for time, _ in changes(session, name) if time > happened], name
    assert changes(session, "dmx40")[-1][1] == 0x22


# ---- camera ----------------------------------------------------------------------------------------------


def camera(session):
    """[(begin, end)] of the shutter's openings; the meter is on for the same times."""
    shutter = changes(session, "shutter")
    assert shutter == changes(session, "meter")
    assert [v for _, v in shutter] == [1, 0] * (len(shutter) // 2)
    return [(a, b) for (a, _), (b, _) in zip(shutter[::2], shutter[1::2], strict=True)]


@pytest.mark.parametrize("flags", [VIDEO, VIDEO | LOOP, VIDEO | PING_PONG])
@pytest.mark.parametrize("reverse", [False, True])
def test_video(flags, reverse):
    """Field note 6.9: meter and shutter for 100 ms at GO, before anything moves, and once the post-roll is over."""
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


@pytest.mark.parametrize("after", [0.02, 0.15, 0.3, 0.55, 1.0, 1.52, 1.7])
def test_video_stopped(after):
    """However a run ends, a camera that has been started is stopped, by a pulse of its own."""
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


def test_video_and_the_next_operation():
    """The pulse that stops the camera is given whole, whatever comes within its time."""
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
    """Two pulses, 100 ms apart, even where the first frame is the last."""
    session = loaded()
    for last in (3, 4):
        go(session, run_request(24, 3, last, 50, 0, flags=VIDEO))
        to_the_end(session)
        (_, first_off), (on, off) = camera(session)
        assert on - first_off >= 0.0999
        assert off - on == pytest.approx(0.1, abs=1e-4)


def test_video_stop_loop_after_the_last_frame():
    """STOP_LOOP in the post-roll of what was not to be the last pass: the camera is stopped at its end."""
    session = loaded()
    go(session, run_request(24, 1, FRAMES, 500, 500, flags=VIDEO | LOOP))
    session.run(1.7)
    session.accept(RtStopLoop())
    ended = to_the_end(session)
    (_, (on, _)) = camera(session)
    assert on == pytest.approx(ended, abs=0.006)


def test_both_camera_flags():
    """Field note 6.9: stills win."""
    session = loaded()
    go(session, run_request(24, 1, FRAMES, 300, 300, flags=VIDEO | STILLS, open_angle=10, close_angle=300))
    to_the_end(session)
    assert len(camera(session)) == FRAMES


@pytest.mark.parametrize("fps", [12, 24, 29.97])
@pytest.mark.parametrize("angles", [(0, 180), (90, 270), (350, 360), (0, 1)])
def test_stills(fps, angles):
    """Field note 6.9: shutter and meter while frame phase × 360° lies in [open, close], the last frame as well."""
    session = loaded()
    request = run_request(fps, 1, FRAMES, 500, 0, flags=STILLS, open_angle=angles[0], close_angle=angles[1])
    before = go(session, request)
    ended = to_the_end(session)
    (verdict,) = judged(session, before, fps, roll=0.02)
    openings = camera(session)
    assert len(openings) == FRAMES
    for (on, off), time in zip(openings, frame_times(verdict, fps), strict=True):
        assert on == pytest.approx(time + angles[0] / 360 / fps, abs=0.00065)
        assert off == pytest.approx(max(time + angles[1] / 360 / fps, on + 0.001), abs=0.00065)
    assert ended >= off


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


def test_stills_of_whole_frames():
    """From 0 to 360: open from the first frame's beginning to the last one's end."""
    session = loaded()
    before = go(session, run_request(29.97, 1, FRAMES, 500, 0, flags=STILLS, open_angle=0, close_angle=360))
    to_the_end(session)
    (verdict,) = judged(session, before, 29.97, roll=0.02)
    ((on, off),) = camera(session)
    assert on == pytest.approx(verdict.origin_ns * 1e-9, abs=0.0006)
    assert off == pytest.approx(verdict.origin_ns * 1e-9 + FRAMES / 29.97, abs=0.0006)


@pytest.mark.parametrize("fps", [0.5, 200])
def test_all_at_once_at_extreme_rates(fps):
    """Stills, lights, triggers and bloop together, slower and faster than any film: nothing is lost or late."""
    session = rig()
    slow = {1: 5 * np.arange(FRAMES), 2: np.zeros(FRAMES, int)}
    upload(session, slow, LEVELS, {i: 1 + i % 2 for i in range(FRAMES)})
    last = FRAMES if fps > 1 else 3
    more = {"bloop_outputs": 4, "bloop_ms": 30, "flags": STILLS, "open_angle": 90, "close_angle": 270}
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
            Ack.ERR_RANGE, run_request(24, 1, 5, 500, 500, flags=STILLS, open_angle=angles[0], close_angle=angles[1])
        )
    # only used with that flag (specification)
    session.accept(run_request(24, 1, 5, 500, 500, flags=0, open_angle=500, close_angle=65535))
    session.wait_idle()
    session.refuse(Ack.ERR_RANGE, run_request(24, 1, 5, flags=0x04), run_request(24, 1, 5, flags=0x8000))
    session.refuse(Ack.ERR_RANGE, run_request(24, 1, 5, sync_dmx=2), run_request(24, 1, 5, bloop_channel=513))
    assert not session.moving


# ---- what is refused, with nothing moved ------------------------------------------------------------------

RUN_VELOCITY = 60 * 24
REFUSED = {
    "lower limit in the pre-roll": (MotorSetLimits(1, 1, 100 - 350, 1, 9000), (1, FRAMES, 500, 500), Ack.ERR_PREROLL),
    "upper limit in the post-roll": (
        MotorSetLimits(1, 1, -9000, 1, 1540 + 350),
        (1, FRAMES, 500, 500),
        Ack.ERR_POSTROLL,
    ),
    "upper limit in the pre-roll": (MotorSetLimits(1, 1, -9000, 1, 1540 + 350), (FRAMES, 1, 500, 500), Ack.ERR_PREROLL),
    "lower limit in the post-roll": (MotorSetLimits(1, 1, 100 - 350, 1, 9000), (FRAMES, 1, 500, 500), Ack.ERR_POSTROLL),
    "a frame above": (MotorSetLimits(1, 0, 0, 1, 1000), (1, FRAMES, 500, 500), Ack.ERR_SOFT_UP),
    "a frame below": (MotorSetLimits(1, 1, 200, 0, 0), (1, FRAMES, 500, 500), Ack.ERR_SOFT_LOW),
    "a frame of another motor": (MotorSetLimits(2, 0, 0, 1, 390), (1, FRAMES, 500, 500), Ack.ERR_SOFT_UP),
    "a frame behind the end": (None, (1, FRAMES + 1, 500, 500), Ack.ERR_RANGE),
    "a pre-roll that is too steep": (None, (1, FRAMES, 5, 500), Ack.ERR_PREROLL),
    "a post-roll that is too steep": (None, (1, FRAMES, 500, 5), Ack.ERR_POSTROLL),
}


@pytest.mark.parametrize("case", REFUSED)
@pytest.mark.parametrize("flags", [None, LOOP, PING_PONG | STILLS])
def test_refused_before_motion(case, flags):
    setting, (first, last, pre, post), code = REFUSED[case]
    session = loaded()
    if setting:
        session.accept(setting)
    session.forget()
    session.refuse(code, run_request(24, first, last, pre, post, flags=flags, sync_dmx=1))
    session.refuse(Ack.ERR_GENERAL, RtGo())
    session.run(0.3)
    trace = session.trace()
    assert not trace.motors, "something has changed"
    assert not trace.signals, "something has changed"
    assert not session.moving
    assert not session.events(RtEnd)


def test_refused_keeps_what_waits():
    """A run that waits is not harmed by one that is refused."""
    session = loaded()
    session.ready(run_request(24, 1, FRAMES, 500, 500, flags=STILLS, open_angle=90, close_angle=180))
    session.refuse(Ack.ERR_RANGE, run_request(24, 1, 99), run_request(12, 0, 5), RtShootFrame(99, 1, 100, 500))
    session.refuse(Ack.ERR_PREROLL, run_request(12, 20, 3, 1, 500, flags=VIDEO))
    session.refuse(Ack.ERR_RANGE, RtShootFrame2(3, 100, 50, 20), RtJogAll(24000, 99))
    before = session.positions
    session.forget()
    session.accept(RtGo())
    to_the_end(session)
    judged(session, before)
    assert len(camera(session)) == FRAMES


@pytest.mark.parametrize(
    "request_", [run_request(24, 25, 1), RtShootFrame(20, 1, 100, 500), RtShootFrame2(20, 300, 0, 180)]
)
def test_go_too_early(request_):
    """Field note 6.1: 0x16 until all are there; a client that waits for zero then says GO and it is taken."""
    session = loaded()
    for motor in MOVE:
        session.speed(motor, 4000, 20_000)
    session.accept(request_)
    early = 0
    while session.moving:
        begun = session.now
        code = session.code(RtGo())
        if code == Ack.OK:
            break
        assert code == Ack.ERR_NOT_IN_POSITION
        early += 1
    else:
        begun = session.now
        session.accept(RtGo())
    assert early > 10
    session.run(0.5)
    for motor in MOVE:
        times, _ = session.steps(motor)
        assert not np.any(np.abs(times - begun) < 0.001), "it had not arrived"
    to_the_end(session)


def test_go_with_a_motor_disabled_meanwhile():
    session = loaded()
    for request in (run_request(24, 1, FRAMES), RtShootFrame(5, 1, 100, 500)):
        session.ready(request)
        session.accept(MotorConfigure(2, 0))
        session.forget()
        session.refuse(Ack.ERR_GENERAL, RtGo())
        session.run(0.2)
        assert not session.trace().motors
        session.accept(MotorConfigure(2, 3), RtGo())
        to_the_end(session)


# ---- stopped at any moment -------------------------------------------------------------------------------


OPERATIONS = {
    "run": run_request(24, 1, FRAMES, 400, 400, sync_dmx=1, bloop_outputs=8, bloop_channel=40, bloop_ms=300),
    "stills": run_request(24, FRAMES, 1, 400, 400, flags=STILLS, sync_dmx=1, open_angle=0, close_angle=300),
    "loop": run_request(24, 1, FRAMES, 300, 0, flags=LOOP, sync_dmx=1),
    "ping-pong": run_request(24, 1, 9, 0, 200, flags=PING_PONG | STILLS),
    "shoot": RtShootFrame(12, 1, 400, 700),
    "shoot 2": RtShootFrame2(12, 400, -60, 400),
    "jog": RtJogAll(24000, FRAMES),
    "position": RtPositionFrame(FRAMES),
}
STOPS = ("stop all", "twice", "stop one", "stop and all", "lost host")


def stop(session, how, rng):
    if how == "stop one":
        session.accept(MotorStop(rng.choice((1, 2))))
    elif how == "stop and all":
        session.accept(MotorStop(1))
        session.run(rng.random() * 0.05)
        session.accept(MotorStopAll())
    elif how == "lost host":
        session.leave()
    else:
        session.accept(MotorStopAll())
        if how == "twice":
            session.run(rng.choice((0, rng.random() * 0.3)))
            session.accept(MotorStopAll())


@pytest.mark.parametrize("how", STOPS)
@pytest.mark.parametrize("name", OPERATIONS)
def test_stopped_at_any_moment(name, how):
    """At rest in the end, by ramps inside the limits, RT_END once for runs and exposures, nothing left on."""
    rng = random.Random(f"{name} {how}")
    session = loaded()
    for _ in range(3):
        if name == "jog":
            session.accept(RtPositionFrame(rng.choice((1, 10))))
            session.wait_idle()
        before = session.positions
        session.forget()
        session.accept(OPERATIONS[name])
        tells = name not in ("jog", "position")
        begun = 0
        if tells and rng.random() < 0.8:
            session.wait_idle()
            session.accept(RtGo())
            begun = session.now
            session.run(rng.random() * (2.5 if name in ("loop", "ping-pong") else 1.7))
        else:
            session.run(rng.random() * 0.4)
        over = bool(session.events(RtEnd))
        stop(session, how, rng)
        session.run(7 if name == "jog" and how in ("stop all", "stop one", "stop and all") else 1.3)
        if how == "lost host":
            session.come_back()
            session.run(0.1)
            assert not [e for e in session.events(RtEnd) if not over]
        elif tells:
            assert len(session.events(RtEnd)) == 1, (begun, how)
        else:
            assert not session.events(RtEnd)
        assert not session.moving
        factor = 4 if how == "twice" else 1
        for motor in MOVE:
            times, signs = session.steps(motor)
            if len(times) > 2:
                assert_within(times, signs, VELOCITY, factor * ACCELERATION)
            assert session.position(motor) == before[motor] + signs.sum()
        for signal in ALL_OFF:
            if name != "position" or not signal.startswith("gio"):  # those are set as at its frame
                assert level_now(session, signal) == 0, signal
        assert level_now(session, "dmx40") == 0
        if tells:
            session.refuse(Ack.ERR_GENERAL, RtGo())
        # whatever it was, the rig works on
        session.accept(RtPositionFrame(3))
        session.wait_idle()
        assert session.positions[1] == MOVE[1][2]
        assert session.positions[2] == MOVE[2][2]


def test_lost_host_while_it_waits():
    """In each state before GO; the next host finds nothing prepared."""
    for request in (OPERATIONS["stills"], OPERATIONS["shoot"], OPERATIONS["shoot 2"]):
        for wait in (0.05, 3):
            session = loaded()
            session.accept(request)
            session.run(wait)
            session.leave()
            session.run(0.6)
            session.come_back()
            session.run(0.1)
            assert not session.moving
            assert not session.events(RtEnd)
            session.refuse(Ack.ERR_GENERAL, RtGo())
            assert session.ask(MotorGetPosition())


def test_lost_host_that_comes_back_at_once():
    """While the motors still ramp down: the next host is not told of an end that it knows nothing of."""
    session = loaded()
    for motor in MOVE:
        session.speed(motor, VELOCITY, 20_000)
    session.ready(run_request(12, 1, FRAMES))
    session.accept(RtGo())
    session.run(1)
    session.leave()
    session.run(0.005)
    session.come_back()
    assert session.moving
    session.run(1)
    assert not session.events(RtEnd)
    assert not session.moving
    # the next run is told of as ever
    go(session, run_request(12, 1, FRAMES))
    to_the_end(session)
