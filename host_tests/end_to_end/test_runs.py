"""Uploaded moves on the host simulation: upload, positioning, runs forward and backward, whole and in part."""

import numpy as np
import pytest

from framestep_tools.judge import frame_times_ns, judge
from framestep_tools.payloads import (
    LAST_SECTION,
    Ack,
    GetCondition,
    GetExceeded,
    HardStop,
    Hi,
    MotorConfigure,
    MotorJog,
    MotorMove,
    MotorResetPosition,
    MotorSetLimits,
    MotorStatus,
    MotorStop,
    MotorStopAll,
    Positions,
    RtEnd,
    RtGo,
    RtJogAll,
    RtPositionFrame,
    RtRunMove,
    RtStopLoop,
    RtUploadMoveAxis,
    RtUploadMoveBegin,
    RtUploadMoveDmx,
    RtUploadMoveEnd,
    RtUploadMoveTriggers,
    Trigger,
)
from host_tests.end_to_end.session import DIALECTS, assert_within, deceleration, run_request, simulated

FRAMES = 25
# A motor at constant speed, one that swings, one that holds still in the middle
MOVE = {
    1: 100 + 60 * np.arange(FRAMES),
    2: np.round(400 * np.sin(np.arange(FRAMES) * 0.3)).astype(int),
    4: np.concatenate((np.zeros(8, int), 20 * np.arange(9), np.full(8, 160))),
}


@pytest.fixture(params=DIALECTS)
def both(request):
    return simulated({"dialect": request.param})


@pytest.fixture
def rig():
    session = simulated()
    for motor in MOVE:
        session.speed(motor, 20000, 100_000)
    return session


@pytest.fixture
def loaded(rig):
    """MOVE uploaded as frames 1 to 25."""
    rig.upload(MOVE)
    return rig


def section(first, last, start_frame=1):
    """The positions of MOVE from one scene frame to another, in the order of play."""
    step = 1 if last >= first else -1
    return {m: steps[np.arange(first, last + step, step) - start_frame] for m, steps in MOVE.items()}


def assert_played(rig, before, positions, fps, **more):
    verdict = judge(rig.trace(), positions, round(fps * 1000), before, rig.positions, **more)
    assert verdict.good, verdict.complaints
    return verdict


# ---- uploads -----------------------------------------------------------------------------------------------


def test_upload_message_by_message(both):
    """BEGIN, sections in any order and again, END; a motor goes to each frame's position."""
    both.accept(
        RtUploadMoveBegin(10, 19),
        RtUploadMoveAxis(2, 5 | LAST_SECTION, (50, 60, 70)),
        RtUploadMoveAxis(2, 0, (0, 10, 20)),
        RtUploadMoveAxis(2, 3, (99, 40)),
        RtUploadMoveAxis(2, 3, (30,)),
        RtUploadMoveAxis(3, LAST_SECTION, (-5,)),
        RtUploadMoveEnd(),
    )
    for frame, expected in ((10, 0), (13, 30), (14, 40), (17, 70), (19, 70), (12, 20)):
        both.accept(RtPositionFrame(frame))
        both.wait_idle()
        positions = both.ask_positions()
        assert positions.steps[1:3] == (expected, -5)
        assert positions.move_time == frame * 1000
    assert both.made(2) == 20
    assert both.made(1) == 0


def test_upload_refused(both):
    """Field notes 5.2 to 5.4, and what was uploaded before stays."""
    info_frames = both.ask(Hi()).upload_frames
    both.refuse(Ack.ERR_GENERAL, RtUploadMoveAxis(1, 0, (1,)), RtUploadMoveEnd(), RtPositionFrame(1))
    both.refuse(Ack.ERR_GENERAL, run_request(24, 1, 2), RtGo())
    both.accept(RtUploadMoveBegin(1, 4), RtUploadMoveAxis(1, 0, (1, 2, 3, 4)))
    both.refuse(Ack.ERR_GENERAL, RtPositionFrame(1), run_request(24, 1, 2), RtGo())
    both.refuse(Ack.ERR_RANGE, RtUploadMoveBegin(5, 4), RtUploadMoveBegin(1, 1 + info_frames))
    both.refuse(Ack.ERR_RANGE, RtUploadMoveBegin(-(2**31), 2**31 - 1), RtUploadMoveBegin(2**31 - 1, -(2**31)))
    both.refuse(Ack.ERR_RANGE, RtUploadMoveAxis(1, 4, (9,)), RtUploadMoveAxis(1, 5, (9, 9)))
    both.refuse(Ack.ERR_RANGE, RtUploadMoveBegin(999_999, 1_000_001), RtUploadMoveBegin(-1_000_001, -999_999))
    both.refuse(Ack.ERR_RANGE, RtUploadMoveAxis(0, 0, (9,)), RtUploadMoveAxis(9, 0, (9,)))
    both.refuse(Ack.ERR_RANGE, RtUploadMoveAxis(1, 0x7FFFFFFF, (9,)), RtUploadMoveAxis(1, 0xFFFFFFFF, (9,)))
    both.refuse(Ack.ERR_RANGE, RtUploadMoveAxis(1, 2**30, (9,)), RtUploadMoveAxis(1, 0x10001, (9,)))
    both.accept(RtUploadMoveEnd())
    both.refuse(Ack.ERR_RANGE, RtPositionFrame(0), RtPositionFrame(5), RtPositionFrame(2**31 - 1))
    both.refuse(Ack.ERR_RANGE, RtPositionFrame(-(2**31)), run_request(24, 0, 3), run_request(24, 1, 5))
    both.accept(RtPositionFrame(4))
    both.wait_idle()
    assert both.position(1) == 4


def test_a_frame_more(both):
    """Field note 5.3: sections that reach past the end are stored as far as they lie inside; END and a run work."""
    for motor in MOVE:
        both.speed(motor, 20000, 100_000)
    both.accept(RtUploadMoveBegin(1, FRAMES))
    for motor, steps in MOVE.items():
        both.accept(RtUploadMoveAxis(motor, 0, steps[:10]))
        both.accept(RtUploadMoveAxis(motor, 10 | LAST_SECTION, (*steps[10:], steps[-1], -(2**31), 2**31 - 1)))
        both.accept(RtUploadMoveAxis(motor, FRAMES - 1, (steps[-1], 99_999)))
    both.accept(RtUploadMoveDmx(9, LAST_SECTION, range(FRAMES + 3)))
    both.accept(RtUploadMoveTriggers(1, (Trigger(FRAMES - 1, 1), Trigger(FRAMES, 1))), RtUploadMoveEnd())
    before = both.play(run_request(24, 1, FRAMES))
    assert_played(both, before, MOVE, 24)
    both.refuse(Ack.ERR_RANGE, RtPositionFrame(FRAMES + 1))


def test_frame_numbers_at_their_ends(rig):
    """Field note 5.3: ±1 000 000 is the last frame number; MOVE TIME tells it."""
    for start in (-1_000_000, 1_000_000 - FRAMES + 1):
        rig.upload(MOVE, start_frame=start)
        for frame in (start, start + FRAMES - 1):
            rig.accept(RtPositionFrame(frame))
            rig.wait_idle()
            assert rig.ask_positions().move_time == frame * 1000
        before = rig.play(run_request(24, start, start + FRAMES - 1))
        assert_played(rig, before, MOVE, 24)
        assert set(rig.frames_told()) >= {1000 * (start + i) for i in range(FRAMES)}


def test_a_new_upload_replaces(loaded):
    loaded.upload({1: [7, 8, 9]}, start_frame=101)
    loaded.refuse(Ack.ERR_RANGE, RtPositionFrame(1))
    loaded.accept(RtPositionFrame(103))
    loaded.wait_idle()
    assert loaded.positions == {1: 9} | dict.fromkeys(range(2, 9), 0)


def test_negative_frames_and_far_positions(rig):
    """Scene frames below 0, positions of any 32 bits."""
    top = 2**31 - 1
    positions = {1: top - 50 * np.arange(FRAMES)[::-1], 2: -(2**31) + 1 + 50 * np.arange(FRAMES)}
    rig.accept(MotorResetPosition(1, int(positions[1][0]) - 5), MotorResetPosition(2, int(positions[2][0]) + 700))
    rig.upload(positions, start_frame=-10)
    rig.accept(RtPositionFrame(-10))
    rig.wait_idle()
    assert rig.position(1) == positions[1][0]
    assert rig.position(2) == positions[2][0]
    # run-ups and run-outs would leave the range of 32 bits; from -5 to 9 they do not
    before = rig.play(run_request(24, -5, 9, 100, 100))
    assert_played(rig, before, {m: s[5:20] for m, s in positions.items()}, 24)
    assert set(rig.frames_told()) >= {1000 * frame for frame in range(-5, 10)}


# ---- RUN_MOVE, GO, RT_END ----------------------------------------------------------------------------------


@pytest.mark.parametrize("more", [{}, {"flags": 0}, {"flags": 0, "open_angle": 0, "close_angle": 180}])
def test_run_in_all_three_lengths(both, more):
    for motor in MOVE:
        both.speed(motor, 20000, 100_000)
    both.upload(MOVE)
    request = run_request(24, 1, FRAMES, **more)
    assert len(request.pack()) in (29, 31, 35)
    before = both.play(request)
    assert_played(both, before, MOVE, 24)


def test_run_told(loaded):
    """One position report at each frame's time with its MOVE TIME, then RT_END once; field notes 4.6 and 6.4."""
    loaded.ready(run_request(24, 1, FRAMES, 700, 300))
    before = loaded.positions
    loaded.forget()
    loaded.accept(RtGo())
    loaded.run(0.7 + FRAMES / 24 + 1)
    verdict = assert_played(loaded, before, MOVE, 24)
    assert len(loaded.events(RtEnd)) == 1
    ((end, _),) = loaded.events(RtEnd)
    times = (verdict.origin_ns + frame_times_ns(FRAMES, 24000)) * 1e-9
    kinds = [type(event.message) for event in loaded.client.events]
    assert kinds.index(RtEnd) > max(i for i, k in enumerate(kinds) if k is Positions and i < kinds.index(RtEnd))
    # the first report of each frame
    told = {}
    for time, message in loaded.events(Positions):
        if time > times[0] - 0.05:
            told.setdefault(message.move_time, (time, message))
    told.pop(1000 if 1000 in told and told[1000][0] < times[0] - 0.005 else None, None)
    for i in range(1, FRAMES):
        time, message = told[1000 * (i + 1)]
        assert 0 <= time - times[i] <= 0.004, i
        for motor, steps in MOVE.items():
            rate = abs(int(steps[i]) - int(steps[i - 1])) * 24
            assert abs(message.steps[motor - 1] - steps[i]) <= rate * 0.005 + 2
    last_edge = max(loaded.steps(motor)[0][loaded.steps(motor)[0] < end][-1] for motor in MOVE)
    assert 0 <= end - last_edge <= 0.01
    assert end - times[-1] == pytest.approx(1 / 24 + 0.3, abs=0.01)
    assert loaded.moving == []


@pytest.mark.parametrize(("first", "last"), [(1, 25), (25, 1), (4, 20), (20, 4), (7, 8)])
@pytest.mark.parametrize("roll", [(1000, 400), (400, 1000)])
def test_roll_positions(loaded, first, last, roll):
    """Field notes 6.2 and 6.11: p − ½·v·T before the first frame, by constant acceleration; behind the last one a frame
    at the same velocity and then ½·v·T."""
    pre, post = (ms / 1000 for ms in roll)
    fps = 24
    loaded.ready(run_request(fps, first, last, *roll))
    velocity = 60 * fps * (1 if last > first else -1)
    assert loaded.position(1) == round(MOVE[1][first - 1] - velocity * pre / 2)
    before = loaded.positions
    loaded.forget()
    loaded.accept(RtGo())
    loaded.client.wait_event(RtEnd, 10)
    end = loaded.now
    loaded.run(0.5)
    times, signs = loaded.steps(1)
    assert before[1] + signs[times < end].sum() == round(MOVE[1][last - 1] + velocity * (1 / fps + post / 2))
    assert loaded.position(1) == MOVE[1][last - 1]
    times, signs = times[times < end], signs[times < end]
    rate = abs(velocity)
    assert_within(times, signs, rate * 1.001, rate / min(pre, post), window=0.1)
    # the roll lasts T: its edges lie where a constant acceleration puts them
    n = int(rate * pre / 2)
    begun = times[n - 1] - pre
    ideal = begun + (2 * np.arange(1, n + 1) * pre / rate) ** 0.5
    assert np.abs(times[:n] - ideal).max() < 1e-4
    if abs(last - first) > 1:
        assert_played(loaded, before, section(first, last), fps)


@pytest.mark.parametrize(("first", "last"), [(1, 25), (25, 1), (5, 21), (21, 5), (3, 6)])
def test_sections_and_backward(loaded, first, last):
    """Field note 6.5: END before START plays backward, a part is played as if it were the whole."""
    before = loaded.play(run_request(25, first, last, 500, 500))
    assert_played(loaded, before, section(first, last), 25)
    step = 1 if last > first else -1
    assert [t for t in loaded.frames_told() if t] == [1000 * f for f in range(first, last + step, step)]


def test_single_frame(loaded):
    """Field note 6.5: START = END moves there, then RT_END."""
    for frame in (12, 1, 25):
        loaded.ready(run_request(24, frame, frame, 500, 500))
        loaded.forget()
        loaded.accept(RtGo())
        loaded.client.wait_event(RtEnd, 3)
        loaded.run(0.3)
        assert not loaded.events(RtEnd)
        for motor, steps in MOVE.items():
            assert loaded.position(motor) == steps[frame - 1]
        assert loaded.ask_positions().move_time == frame * 1000


@pytest.mark.parametrize("post", [0, 500])
@pytest.mark.parametrize(("first", "last"), [(1, 25), (25, 1)])
def test_pre_roll_of_no_time(loaded, first, last, post):
    """Field note 6.2: as short as the motor's own acceleration allows, where it moves at the first frame."""
    loaded.speed(1, 20000, 20_000)
    before = loaded.play(run_request(24, first, last, 0, post))
    assert_played(loaded, before, section(first, last), 24)
    velocity = 60 * 24 * (1 if last > first else -1)
    way = velocity * abs(velocity) / (2 * 20_000)
    assert before[1] == pytest.approx(MOVE[1][first - 1] - way, abs=1)
    if not post:
        _, signs = loaded.steps(1)
        farthest = before[1] + (np.cumsum(signs).max() if velocity > 0 else np.cumsum(signs).min())
        assert farthest == pytest.approx(MOVE[1][last - 1] + velocity / 24 + way, abs=1)
    # motor 2 has five times the acceleration and twice the velocity: it starts later, and keeps to it
    for motor, acceleration in ((1, 20_000), (2, 100_000)):
        times, signs = loaded.steps(motor)
        assert_within(times, signs, 20000, acceleration)
        n = int(abs(before[motor] - MOVE[motor][first - 1]))
        assert n > 8
        ramp = times[:n] - times[0]
        assert ramp == pytest.approx(((2 * np.arange(1, n + 1)) ** 0.5 - 2**0.5) / acceleration**0.5, abs=3e-4)


def test_no_roll_at_rest(rig):
    """A move that begins and ends at rest starts where its first frame is."""
    steps = np.round(500 * (1 - np.cos(np.linspace(0, 2 * np.pi, 30)))).astype(int)
    steps[:3], steps[-3:] = 0, 0
    positions = {1: steps, 2: steps + 3}
    rig.upload(positions)
    before = rig.play(run_request(24, 1, 30, 0, 0))
    assert before[1] == 0
    assert before[2] == 3
    assert_played(rig, before, positions, 24)
    assert rig.position(1) == 0


def test_a_second_run_and_after(loaded):
    """The same upload as often as wanted, other moves between; each run is told for itself."""
    for _ in range(2):
        before = loaded.play(run_request(24, 1, FRAMES))
        assert_played(loaded, before, MOVE, 24)
        loaded.ask(MotorMove(1, -300))
        loaded.wait_idle()
        assert loaded.position(1) == -300
    loaded.refuse(Ack.ERR_GENERAL, RtGo())


def test_motors_without_a_part_hold_still(loaded):
    """Field notes 5.4 and 3.1: no data, not enabled, under live control."""
    loaded.accept(MotorConfigure(2, 0), MotorConfigure(4, 0x01 | 0x08))
    loaded.accept(MotorResetPosition(2, 77), MotorResetPosition(4, -3))
    loaded.ready(run_request(24, 1, FRAMES))
    before = loaded.positions
    assert before[2] == 77
    assert before[4] == -3
    loaded.forget()
    loaded.accept(RtGo())
    loaded.run(0.2)
    assert loaded.code(MotorMove(4, 300)) == Ack.OK, "a motor under live control moves during a run"
    loaded.run(0.3)
    loaded.accept(MotorJog(4, 5000, 500), MotorStop(4))
    loaded.client.wait_event(RtEnd, 10)
    loaded.run(0.5)
    trace = loaded.trace()
    assert 2 not in trace.motors
    assert 4 in trace.motors
    del trace.signals["m4"]
    assert judge(trace, {1: MOVE[1]}, 24000, before).good


def test_go_too_early(loaded):
    """Field note 6.1: 0x16 until all are there; then it goes. MOTOR_STATUS tells when."""
    loaded.accept(run_request(24, 1, FRAMES))
    while loaded.moving:
        loaded.refuse(Ack.ERR_NOT_IN_POSITION, RtGo())
        loaded.run(0.03)
    loaded.run(0.05)
    before = loaded.positions
    loaded.forget()
    loaded.accept(RtGo())
    loaded.client.wait_event(RtEnd, 10)
    loaded.wait_idle()
    assert_played(loaded, before, MOVE, 24)


def test_go_after_a_motor_was_moved(loaded):
    """What waits is not where it should be any more: 0x16, and once it is back it goes."""
    loaded.ready(run_request(24, 1, FRAMES))
    waits = loaded.position(1)
    loaded.ask(MotorMove(1, waits + 10))
    loaded.refuse(Ack.ERR_NOT_IN_POSITION, RtGo())
    loaded.wait_idle()
    loaded.refuse(Ack.ERR_NOT_IN_POSITION, RtGo())
    loaded.ask(MotorMove(1, waits))
    loaded.wait_idle()
    before = loaded.positions
    loaded.forget()
    loaded.accept(RtGo())
    loaded.client.wait_event(RtEnd, 10)
    loaded.wait_idle()
    assert_played(loaded, before, MOVE, 24)


def test_acknowledged_before_it_moves(loaded):
    """Field note 6.3; and all motors start in the same tick."""
    loaded.ready(run_request(24, 1, FRAMES, 200, 200))
    loaded.forget()
    loaded.accept(RtGo())
    acknowledged = loaded.now
    loaded.run(0.5)
    assert loaded.steps(1)[0][0] > acknowledged - 0.001
    loaded.client.wait_event(RtEnd, 10)


def test_moving_bits_from_the_acknowledgement_on(loaded):
    loaded.accept(RtPositionFrame(9))
    assert loaded.moving == [1, 2]  # motor 4 stands there already
    loaded.wait_idle()
    loaded.accept(run_request(24, 1, FRAMES))
    assert set(loaded.moving) >= {1, 2}
    loaded.wait_idle()
    loaded.accept(RtGo())
    assert loaded.ask(MotorStatus()).motor_bits == 0b1011
    loaded.client.wait_event(RtEnd, 10)


# ---- what is refused ---------------------------------------------------------------------------------------


def test_run_refused_for_its_numbers(loaded):
    loaded.refuse(
        Ack.ERR_RANGE,
        RtRunMove(0, 1, 5, 500, 500),
        RtRunMove(2**32 - 1, 1, 5, 500, 500),
        RtRunMove(2**30, 1, 5, 500, 500),
        RtRunMove(24000, 1, 26, 500, 500),
        RtRunMove(24000, 0, 5, 500, 500),
        RtRunMove(24000, 26, 1, 500, 500),
        RtRunMove(24000, 1, 5, 2**32 - 1, 500),
        RtRunMove(24000, 1, 5, 500, 2**31),
    )
    assert loaded.moving == []


def test_too_fast_is_refused_at_its_rate(loaded):
    """Field note 5.5: refused where the rate asks for more than the motor's maxima, taken where it does not."""
    loaded.speed(1, 1500, 100_000)  # 60 steps a frame: 25 fps
    loaded.refuse(Ack.ERR_RANGE, run_request(30, 1, FRAMES), run_request(26, 1, FRAMES), run_request(30, FRAMES, 1))
    before = loaded.play(run_request(24, 1, FRAMES, 200, 200))
    assert_played(loaded, before, MOVE, 24)


# At 4 frames/s 1280 steps/s from frame to frame, but 2560 at either end by the parabola that leads there;
# and 1920 and 2440 at the third frame
STEEP_ENDS = [0, 320, 0, 320]
STEEP_FRAME = [300, 0, 480, 960, 660]


def gap(times, signs):
    """The least time between two steps in the same direction."""
    return np.diff(times)[signs[1:] == signs[:-1]].min()


@pytest.mark.parametrize(("first", "last"), [(1, 4), (4, 1)])
@pytest.mark.parametrize(("flags", "rolls"), [(0, (300, 300)), (0, (0, 0)), (1, (300, 200)), (2, (0, 300))])
def test_no_end_of_a_run_is_faster_than_its_motor(rig, first, last, flags, rolls):
    """Of the last frame's period, the rolls, the turns of a loop and the frames, none."""
    rig.upload({1: STEEP_ENDS})
    rig.speed(1, 2000, 100_000)
    rig.ready(run_request(4, first, last, *rolls, flags=flags))
    rig.forget()
    rig.accept(RtGo())
    rig.run(4)
    rig.accept(RtStopLoop())
    if flags:
        rig.client.wait_event(RtEnd, 10)
    rig.wait_idle()
    assert gap(*rig.steps(1)) >= 1 / 2000 - 2e-6
    assert rig.position(1) in STEEP_ENDS


@pytest.mark.parametrize(("first", "last"), [(2, 3), (3, 2)])
def test_no_end_of_a_part_is_faster_than_its_motor(rig, first, last):
    rig.upload({1: STEEP_FRAME})
    rig.speed(1, 2000, 100_000)
    rig.ready(run_request(4, first, last, 300, 300))
    rig.forget()
    go = rig.now
    rig.accept(RtGo())
    rig.client.wait_event(RtEnd, 10)
    times, signs = rig.steps(1)
    for part in (times < go + 0.3, times > go + 0.56):
        assert gap(times[part], signs[part]) >= 1 / 2000 - 2e-6


CORNERS = np.array([0, 0, 0, 50, 100, 150, 150, 150])  # 50 steps/frame² at 24 fps: 28 800 steps/s²


@pytest.mark.parametrize("acceleration", [500, 20_000, 100_000])
def test_corners_are_played_as_uploaded(rig, acceleration):
    """Field note 5.5: acceleration is no reason to refuse, and each frame is met; what is exceeded is told."""
    positions = {1: CORNERS, 2: 10 * np.arange(8)}
    rig.upload(positions, start_frame=11)
    rig.speed(1, 20000, acceleration)
    before = rig.play(run_request(24, 11, 18))
    assert_played(rig, before, positions, 24)
    told = rig.ask(GetExceeded())
    if acceleration < 28_800:
        assert (told.what, told.motor) == (2, 1)
        assert told.frame in (13, 16)
        assert told.by == 28_800 - acceleration
    else:
        assert told.what == 0
    assert bool(rig.ask(GetCondition()).bits & 0x80) == (acceleration < 28_800)


def test_strict_moves():
    """The setting refuses them, told in the same way."""
    rig = simulated({"strict_moves": True})
    rig.upload({1: CORNERS, 2: 10 * np.arange(8)})
    rig.speed(1, 20000, 20_000)
    rig.refuse(Ack.ERR_RANGE, run_request(24, 1, 8))
    told = rig.ask(GetExceeded())
    assert (told.what, told.motor, told.frame, told.by) == (2, 1, 3, 8_800)
    rig.accept(run_request(12, 1, 8))
    rig.wait_idle()
    assert rig.ask(GetExceeded()).what == 0
    rig.speed(1, 20000, 100_000)
    before = rig.play(run_request(24, 1, 8))
    assert_played(rig, before, {1: CORNERS, 2: 10 * np.arange(8)}, 24)


def test_what_is_exceeded_is_told(rig):
    """Velocity: the first frame to which it is too far, and by how much."""
    rig.upload({1: np.zeros(30, int), 3: np.concatenate((np.zeros(20, int), 1000 + np.zeros(10, int)))})
    rig.speed(3, 20_000, 100_000)
    rig.refuse(Ack.ERR_RANGE, run_request(24, 1, 30))
    told = rig.ask(GetExceeded())
    assert (told.what, told.motor, told.frame, told.by) == (1, 3, 21, 4_000)


@pytest.mark.parametrize("fps", [24, 60, 200])
@pytest.mark.parametrize("shape", ["jump", "stop", "zigzag"])
def test_the_sharpest_corners_that_the_board_can_make(rig, fps, shape):
    """Up to what its numbers hold each frame is met; beyond that it is refused, never played wrongly."""
    unit = {
        "jump": np.array([0, 0, 0, 0, 1, 1, 1, 1, 1]),
        "stop": np.array([0, 1, 2, 3, 4, 4, 4, 4, 4]),
        "zigzag": np.array([0, 0, 1, 0, 1, 0, 1, 1, 1]),
    }[shape]
    rig.speed(1, 200_000, 4_000_000)
    taken = refused = 0
    for size in (5, 20, 60, 150, 400, 1000, 3000, 7000):
        rig.upload({1: size * unit, 2: 20 * np.arange(9)})
        code = rig.code(run_request(fps, 1, 9, 500, 500))
        if code != Ack.OK:
            assert code == Ack.ERR_RANGE
            refused += 1
            continue
        assert not refused
        taken += 1
        rig.wait_idle()
        before = rig.positions
        rig.forget()
        rig.accept(RtGo())
        rig.client.wait_event(RtEnd, 10)
        rig.wait_idle()
        assert not rig.events(HardStop)
        trace = rig.trace()
        verdict = judge(trace, {1: size * unit, 2: 20 * np.arange(9)}, fps * 1000, before)
        # at a turning point the last step may be missing
        assert verdict.motors[0].worst_position <= (shape == "zigzag"), (size, verdict.complaints)
        assert rig.position(1) == size * unit[-1]
    assert taken
    assert refused


def test_limits_in_the_way(loaded):
    """Field note 6.2: pre-roll 0x17, post-roll 0x18; and a frame that lies past a limit."""
    velocity = 60 * 24
    begin, end = 100 - velocity // 4, 1540 + 60 + velocity // 4
    for lower, upper, code in (
        (begin + 5, 5000, Ack.ERR_PREROLL),
        (-5000, end - 5, Ack.ERR_POSTROLL),
        (-5000, 1500, Ack.ERR_SOFT_UP),
        (150, 5000, Ack.ERR_SOFT_LOW),
        (begin, end, Ack.OK),
    ):
        loaded.accept(MotorSetLimits(1, 1, lower, 1, upper))
        assert loaded.code(run_request(24, 1, FRAMES, 500, 500)) == code, (lower, upper)
        assert bool(loaded.moving) == (code == Ack.OK)
    loaded.wait_idle()
    loaded.accept(RtGo())
    loaded.client.wait_event(RtEnd, 10)
    loaded.wait_idle()
    loaded.accept(MotorSetLimits(1, 1, begin + 5, 1, 5000))
    # backward it is the other way round
    assert loaded.code(run_request(24, FRAMES, 1, 500, 500)) == Ack.ERR_POSTROLL
    # slower or shorter fits
    loaded.wait_idle()
    loaded.accept(run_request(24, 1, FRAMES, 450, 500))


def test_roll_too_steep(loaded):
    """A pre-roll so short that the motor's acceleration does not do."""
    loaded.speed(1, 20000, 20_000)
    loaded.refuse(Ack.ERR_PREROLL, run_request(24, 1, FRAMES, 50, 500))
    loaded.refuse(Ack.ERR_POSTROLL, run_request(24, 1, FRAMES, 500, 50))
    loaded.accept(run_request(24, 1, FRAMES, 100, 100))


def test_position_frame_past_a_limit(loaded):
    loaded.accept(MotorSetLimits(1, 1, 200, 1, 1000), MotorResetPosition(1, 500))
    loaded.refuse(Ack.ERR_SOFT_UP, RtPositionFrame(25))
    loaded.refuse(Ack.ERR_SOFT_LOW, RtPositionFrame(1))
    loaded.run(0.1)
    assert loaded.moving == []
    assert not loaded.trace().motors
    loaded.accept(RtPositionFrame(10))
    loaded.wait_idle()
    assert loaded.position(1) == 640


def test_refused_while_moving(loaded):
    """0x12 to RUN_MOVE while anything moves, and during a run to all that would disturb it."""
    loaded.ask(MotorMove(7, 2000))
    loaded.refuse(Ack.ERR_MOVING, run_request(24, 1, FRAMES))
    loaded.wait_idle()
    loaded.ready(run_request(24, 1, FRAMES))
    before = loaded.positions
    loaded.forget()
    loaded.accept(RtGo())
    loaded.run(0.6)
    loaded.refuse(
        Ack.ERR_MOVING,
        run_request(24, 1, FRAMES),
        RtGo(),
        RtPositionFrame(1),
        RtUploadMoveBegin(1, 3),
        RtUploadMoveAxis(1, 0, (1, 2)),
        RtUploadMoveEnd(),
        MotorMove(1, 0),
        MotorJog(2, 100, 0),
        MotorResetPosition(4, 0),
        MotorConfigure(1, 0),
    )
    loaded.client.wait_event(RtEnd, 10)
    loaded.wait_idle()
    assert_played(loaded, before, MOVE, 24)


# ---- the last frame, and the way back (field note 6.11) -----------------------------------------------------


def played_to(loaded, run):
    """Play a run up to its RT_END and no further. Where the motors stood before, when RT_END came."""
    loaded.ready(run)
    before = loaded.positions
    loaded.forget()
    loaded.accept(RtGo())
    loaded.client.wait_event(RtEnd, 20)
    return before, loaded.now


@pytest.mark.parametrize(("first", "last"), [(1, 25), (25, 1), (4, 20)])
@pytest.mark.parametrize("fps", [12, 24, 29.97])
@pytest.mark.parametrize("post", [0, 300])
def test_the_last_frame_lasts_its_period(loaded, first, last, fps, post):
    """The end frame's velocity until END + 1 frame, then the ramp; RT_END at its end, then back to the end frame."""
    before, end = played_to(loaded, run_request(fps, first, last, 300, post))
    loaded.wait_idle()
    assert not loaded.events(RtEnd), "RT_END came twice"
    verdict = assert_played(loaded, before, section(first, last), fps)
    period = 1 / fps
    reached = (verdict.origin_ns + frame_times_ns(abs(last - first) + 1, round(fps * 1000))[-1]) * 1e-9
    times, signs = loaded.steps(1)
    inside = (times > reached + 1e-5) & (times < reached + period)
    assert abs(inside.sum() - 60) <= 1
    assert len(set(signs[inside])) == 1
    assert np.abs(np.diff(times[inside]) * 60 * fps - 1).max() < 0.01, "constant velocity"
    behind = (times > reached + period) & (times < end)
    assert len(set(signs[behind])) == 1
    assert np.diff(times[behind])[-1] > 2 * np.diff(times[inside])[-1]
    rest = max(t[t < end][-1] for t in (loaded.steps(motor)[0] for motor in MOVE))
    assert 0 <= end - rest < 0.02
    if post:
        assert end - reached == pytest.approx(period + post / 1000, abs=0.01)
    for motor, steps in MOVE.items():
        assert loaded.position(motor) == steps[last - 1]
    assert loaded.ask_positions().move_time == last * 1000
    # it stands on a frame: what needs that goes on from here
    loaded.accept(RtJogAll(12_000, 12))
    loaded.wait_idle()
    assert loaded.position(1) == MOVE[1][11]


def test_the_way_back_is_a_position_frame(loaded):
    """MOTOR_STATUS tells it, it keeps to limits, POSITION_FRAME retargets it, STOP stops it, RUN_MOVE waits."""
    loaded.speed(1, 800, 1500)
    run = run_request(10, 1, FRAMES, 700, 700)
    _, end = played_to(loaded, run)
    assert 1 in loaded.moving
    loaded.run(0.1)
    loaded.refuse(Ack.ERR_MOVING, run)
    loaded.refuse(Ack.ERR_GENERAL, RtGo())
    loaded.wait_idle()
    times, signs = loaded.steps(1)
    back = times > end
    assert set(signs[back]) == {-1}
    assert_within(times[back], signs[back], 800, 1500, window=0.1)
    assert loaded.position(1) == 1540
    # another frame under way
    played_to(loaded, run)
    loaded.run(0.1)
    loaded.accept(RtPositionFrame(20))
    loaded.wait_idle()
    assert loaded.position(1) == MOVE[1][19]
    assert loaded.ask_positions().move_time == 20_000
    # stopped
    played_to(loaded, run)
    loaded.run(0.15)
    loaded.accept(MotorStop(1))
    loaded.wait_idle()
    assert MOVE[1][24] < loaded.position(1) < MOVE[1][24] + 60 + 210
    assert not loaded.events(RtEnd)
    loaded.play(run)


@pytest.mark.parametrize("request_", [MotorMove(4, 4321), RtPositionFrame(20), MotorStop(1), MotorStopAll(), None])
def test_asked_as_motors_set_out_for_the_way_back(loaded, request_):
    """They set out one after the other; what is asked in between finds all on their way, and none sets out later."""
    run = run_request(10, 1, FRAMES, 700, 700)
    played_to(loaded, run)
    assert loaded.moving == sorted(MOVE)
    if request_:
        loaded.client.request(request_)
    loaded.run(2)
    assert not loaded.moving
    assert not loaded.events(RtEnd)
    found = {motor: loaded.position(motor) for motor in MOVE}
    expected = {motor: steps[19 if request_ == RtPositionFrame(20) else 24] for motor, steps in MOVE.items()}
    if request_ == MotorMove(4, 4321):
        expected[4] = 4321
    elif request_ == MotorStop(1):
        assert found.pop(1) > expected.pop(1) + 100
    if request_ == MotorStopAll():
        assert found[1] > expected[1] + 100
    else:
        assert found == expected
    loaded.play(run)


def test_no_way_back_after_a_stop(loaded):
    """A run that is stopped stays where it comes to rest."""
    for after in (0.2, 0.8, 1.62):
        loaded.ready(run_request(24, 1, FRAMES, 500, 500))
        loaded.accept(RtGo())
        loaded.run(after)
        loaded.forget()
        loaded.accept(MotorStopAll())
        loaded.client.wait_event(RtEnd, 5)
        end = loaded.now
        loaded.run(0.5)
        assert not loaded.moving
        assert not [t for m in MOVE for t in loaded.steps(m)[0] if t > end]


def test_only_motors_of_the_run_go_back(loaded):
    """A motor that was disabled stays, even if it is enabled by then; one under live control goes where it is sent."""
    loaded.accept(MotorConfigure(2, 0), MotorConfigure(4, 0x01 | 0x08), MotorResetPosition(2, 70))
    loaded.ready(run_request(24, 1, FRAMES, 500, 500))
    loaded.accept(RtGo())
    loaded.run(0.5)
    loaded.accept(MotorConfigure(2, 1))
    loaded.ask(MotorMove(4, 4321))
    loaded.client.wait_event(RtEnd, 5)
    loaded.wait_idle()
    assert (loaded.position(1), loaded.position(2), loaded.position(4)) == (MOVE[1][24], 70, 4321)


def test_the_way_back_keeps_to_limits(loaded):
    """What POSITION_FRAME would refuse by then is left: the rig stays where the post-roll has ended."""
    loaded.ready(run_request(24, 1, FRAMES, 500, 500))
    loaded.accept(RtGo())
    loaded.run(1.0)
    loaded.accept(MotorSetLimits(1, 1, 1800, 0, 0))  # taken at any time; the end frame lies below
    loaded.client.wait_event(RtEnd, 5)
    loaded.run(0.5)
    assert loaded.position(1) == 1540 + 60 + 360


def test_the_last_period_and_the_ends_of_the_range(rig):
    """0x18 where the last frame's period or the post-roll would leave 32 bits, up and down, forward and backward."""
    top = 2**31 - 1
    for steps, place in ((top - 98 + 4 * np.arange(25), top - 98), (98 - top - 4 * np.arange(25), 98 - top)):
        rig.accept(MotorResetPosition(1, int(place)))
        rig.upload({1: steps})
        rig.refuse(Ack.ERR_POSTROLL, run_request(24, 1, 25, 500, 1000))
        rig.refuse(Ack.ERR_POSTROLL, run_request(24, 1, 25, 500, 0, flags=2))
        rig.accept(run_request(24, 1, 20, 100, 100))
        rig.wait_idle()


# ---- stopping a run ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("after", [0.2, 0.5, 0.9, 1.6])
@pytest.mark.parametrize("hard", [False, True])
def test_stop_all_in_a_run(loaded, after, hard):
    """Field note 6.6: ramp down, RT_END once; in the pre-roll, at its end, between frames, in the post-roll."""
    loaded.speed(1, 20000, 20_000)
    loaded.ready(run_request(24, 1, FRAMES, 500, 500))
    before = loaded.positions
    loaded.forget()
    loaded.accept(RtGo())
    loaded.run(after)
    loaded.accept(*[MotorStopAll()] * (2 if hard else 1))
    asked = loaded.now
    loaded.run(1.0)
    assert len(loaded.events(RtEnd)) == 1
    assert loaded.moving == []
    times, signs = loaded.steps(1)
    if after in (0.5, 0.9):
        expected = 80_000 if hard else 20_000
        assert deceleration(times, signs, asked) == pytest.approx(expected, rel=0.05)
    for motor in MOVE:
        assert loaded.position(motor) == before[motor] + loaded.made(motor)
    loaded.refuse(Ack.ERR_GENERAL, RtGo())
    before = loaded.play(run_request(24, 1, FRAMES))
    assert_played(loaded, before, MOVE, 24)


def test_stop_of_one_motor_ends_the_run(loaded):
    loaded.ready(run_request(24, 1, FRAMES))
    loaded.forget()
    loaded.accept(RtGo())
    loaded.run(0.8)
    loaded.accept(MotorStop(4))
    loaded.run(0.6)
    assert len(loaded.events(RtEnd)) == 1
    assert loaded.moving == []


def test_stop_all_before_go(loaded):
    """A run that waits, or is still on its way to where it begins, is given up: RT_END, and no GO any more."""
    for wait in (0.03, 3):
        loaded.accept(run_request(24, 1, FRAMES))
        loaded.run(wait)
        loaded.forget()
        loaded.accept(MotorStopAll())
        loaded.run(1.2)
        assert len(loaded.events(RtEnd)) == 1
        loaded.refuse(Ack.ERR_GENERAL, RtGo())
        loaded.ask(MotorMove(1, 2000))
        loaded.wait_idle()


def test_port_closed_in_a_run(loaded):
    """Field note 1.11: a lost host; motors ramp down, the run is over, the next host finds a rig at rest."""
    loaded.ready(run_request(24, 1, FRAMES))
    before = loaded.positions
    loaded.forget()
    loaded.accept(RtGo())
    loaded.run(0.8)
    loaded.leave()
    closed = loaded.now
    loaded.run(1.0)
    times, signs = loaded.steps(1)
    assert times[-1] - closed < 60 * 24 / 100_000 + 0.006
    loaded.come_back()
    loaded.run(0.2)
    assert loaded.events(RtEnd) == []
    assert loaded.moving == []
    assert loaded.position(1) == before[1] + signs.sum()
    loaded.refuse(Ack.ERR_GENERAL, RtGo())
    before = loaded.play(run_request(24, 1, FRAMES))
    assert_played(loaded, before, MOVE, 24)


def test_port_closed_before_go(loaded):
    loaded.ready(run_request(24, 1, FRAMES))
    loaded.leave()
    loaded.run(0.1)
    loaded.come_back()
    loaded.run(0.1)
    loaded.refuse(Ack.ERR_GENERAL, RtGo())
