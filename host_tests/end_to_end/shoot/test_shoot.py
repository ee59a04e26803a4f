"""Go-motion on the host simulation: the window against the shutter's edges, speed, motors,
refusals."""

import numpy as np
import pytest

from framestep_tools import payloads as p
from host_tests.end_to_end.realtime import ACCELERATION, FRAMES, MOVE, VELOCITY, edges, rig, upload
from host_tests.end_to_end.session import assert_within, run_request

pytestmark = pytest.mark.needs("prompt")

FRAME = 10  # MOVE: 580 ± 30 for motor 1


@pytest.fixture
def ready():
    session = rig()
    upload(session)
    return session


def shoot(session, request, start_s=0.005):
    """Prepare, send GO, wait for the one RT_END. Return where the motors waited, and when GO came
    and the shutter opened and closed.

    start_s: the meter must go on within that time after the acknowledgement.
    """
    session.ready(request)
    before = session.positions
    session.forget().accept(p.RtGo())
    went = session.now
    session.until(p.RtEnd, 70)
    ended = session.now
    session.run(0.3)
    assert not session.events(p.RtEnd)
    assert not session.moving
    (opened, on), (closed, off) = edges(session, "shutter")
    (metered, meter_on), (unmetered, meter_off) = edges(session, "meter")
    assert (on, off, meter_on, meter_off) == (1, 0, 1, 0)
    assert -0.005 < metered - went < start_s, "meter from GO to the end of the exposure"
    assert unmetered == closed, "meter from GO to the end of the exposure"
    if isinstance(request, p.RtShootFrame):
        assert ended >= closed + 0.999
    else:
        assert ended >= closed
    return before, went, opened, closed


def assert_window(
    session, motor, before, opened, closed, at_open, at_close, exact=True, duration=None
):
    """Assert that a motor passes its window, steps at_open to at_close, while the shutter is open,
    at constant speed.

    exact: the ends are whole steps that the motor meets at the shutter's edges.
    """
    times, signs = session.steps(motor)
    position = before[motor] + np.cumsum(signs)
    inside = (times > opened + 1e-6) & (times < closed + 1e-6)
    way = at_close - at_open
    assert abs(inside.sum() - abs(way)) <= 1
    assert np.all(np.sign(signs[inside]) == np.sign(way))
    if inside.sum() > 2:
        gaps = np.diff(times[inside])
        assert abs(gaps.max() / gaps.mean() - 1) < 0.005
        assert abs(gaps.min() / gaps.mean() - 1) < 0.005
        assert gaps.mean() == pytest.approx((closed - opened) / abs(way), rel=0.005 + 1 / abs(way))
        # the motion's place at the shutter's edges, to fractions of a step
        speed = np.sign(way) / gaps.mean()
        for edge, place in ((opened, at_open), (closed, at_close)):
            nearest = np.argmin(np.abs(times - edge))
            there = position[nearest] + (edge - times[nearest]) * speed
            assert abs(there - place) <= 1.0
            if exact:
                assert abs((there - place) / speed) <= 100e-6
    assert_within(times, signs, VELOCITY, ACCELERATION)


# ---- SHOOT_FRAME ---------------------------------------------------------------------------------


@pytest.mark.parametrize("exposure", [17, 100, 1000, 5000])
@pytest.mark.parametrize("direction", [1, 0])
@pytest.mark.parametrize("pair", [(100, 700), (300, -500), (0, 40)])
def test_whole_window(ready, exposure, direction, pair):
    """Field note 7.1: POS A to POS B in the exposure time, exchanged by DIRECTION 0; 1.0 s run-up
    and run-out."""
    if exposure == 17 and abs(pair[1] - pair[0]) > 300:
        pair = (pair[0], pair[0] + (pair[1] - pair[0]) // 4)
    request = p.RtShootFrame(FRAME, direction, exposure, 1000, [p.BlurMotor(1, *pair)])
    before, went, opened, closed = shoot(ready, request)
    a, b = pair if direction else pair[::-1]
    assert closed - opened == pytest.approx(exposure / 1000, abs=2e-5)
    assert opened - went == pytest.approx(1.0, abs=0.006), (
        "fixed, so that Dragonframe can time its shutter"
    )
    (started, _), _ = edges(ready, "meter")
    assert opened - started == pytest.approx(1.001, abs=2e-5), "in a whole tick"
    assert_window(ready, 1, before, opened, closed, a, b)
    times, _ = ready.steps(1)
    assert times[-1] - closed <= 1.0 + 1e-4
    velocity = (b - a) / exposure * 1000
    assert before[1] == pytest.approx(a - velocity / 2, abs=1)
    assert ready.position(1) == pytest.approx(b + velocity / 2, abs=1)


@pytest.mark.parametrize("velocity", [4999, 5001, 3333, 4567])
def test_the_very_velocity_that_is_set(ready, velocity):
    """Rounding refuses nothing: a window of a second takes as many steps as the velocity has."""
    ready.accept(p.MotorSetSpeed(1, velocity, ACCELERATION))
    ready.accept(p.RtShootFrame(FRAME, 1, 1000, 1000, [p.BlurMotor(1, 0, velocity)]))
    ready.accept(p.MotorStopAll()).wait_idle()
    request = p.RtShootFrame(FRAME, 1, 1000, 1000, [p.BlurMotor(1, 0, velocity + 1)])
    ready.refuse(p.Ack.ERR_RANGE, request)


@pytest.mark.parametrize("blur", [1, 10, 333, 500, 999, 1000])
@pytest.mark.parametrize("direction", [1, 0])
def test_blur(ready, blur, direction):
    """The middle `blur` of the window, in steps."""
    for a, b in ((0, 4000), (1000, -3001)):
        before, _, opened, closed = shoot(
            ready, p.RtShootFrame(FRAME, direction, 400, blur, [p.BlurMotor(1, a, b)])
        )
        if not direction:
            a, b = b, a
        middle, half = (a + b) / 2, (b - a) * blur / 2000
        assert_window(ready, 1, before, opened, closed, middle - half, middle + half, exact=False)


def test_long_exposure(ready):
    before, _, opened, closed = shoot(
        ready,
        p.RtShootFrame(FRAME, 1, 60000, 500, [p.BlurMotor(1, 0, 12000), p.BlurMotor(2, 8, 0)]),
    )
    assert closed - opened == pytest.approx(60, abs=2e-5)
    assert_window(ready, 1, before, opened, closed, 3000, 9000)
    # at a step in 15 s the time of a microstep has the kernel's resolution, some ten-thousandths of
    # a step
    assert_window(ready, 2, before, opened, closed, 6, 2, exact=False)
    request = p.RtShootFrame2(FRAME, 60000, -45, 405, [p.BlurMotor(1, 0, 12000)])
    before, _, opened, closed = shoot(ready, request)
    assert closed - opened == pytest.approx(60, abs=2e-5)
    assert_angles(ready, 1, before, opened, closed, -45, 405, 0, 12000)


@pytest.mark.each_processor
def test_pairs_of_several_motors(ready):
    before, _, opened, closed = shoot(
        ready,
        p.RtShootFrame(FRAME, 1, 300, 1000, [p.BlurMotor(1, 10, 400), p.BlurMotor(2, 500, -20)]),
    )
    assert_window(ready, 1, before, opened, closed, 10, 400)
    assert_window(ready, 2, before, opened, closed, 500, -20)


def test_only_motors_that_blur_move(ready):
    """Field note 7.1: enabled and with the blur flag."""
    ready.accept(
        p.MotorConfigure(1, 0x01),
        p.MotorConfigure(3, 0x03),
        p.MotorConfigure(4, 0x02),
        p.MotorConfigure(5, 0x03),
    )
    pairs = [p.BlurMotor(m, 0, 300) for m in (1, 2, 3, 4)]
    before, _, opened, closed = shoot(ready, p.RtShootFrame(FRAME, 1, 300, 1000, pairs))
    assert ready.trace().motors == [2, 3]
    assert_window(ready, 3, before, opened, closed, 0, 300)
    # SHOOT_FRAME2: each listed motor blurs (spec), except a disabled one
    ready.speed(3, VELOCITY, ACCELERATION)
    shoot(ready, p.RtShootFrame2(FRAME, 300, 0, 360, pairs))
    assert ready.trace().motors == [1, 2, 3]


def test_without_motors(ready):
    """There is no motor to move: the shutter opens all the same."""
    ready.accept(p.MotorConfigure(1, 1), p.MotorConfigure(2, 1))
    _, went, opened, closed = shoot(ready, p.RtShootFrame(FRAME, 1, 250, 500))
    assert opened - went == pytest.approx(1.0, abs=0.006)
    assert closed - opened == pytest.approx(0.25, abs=2e-5)
    assert not ready.trace().motors
    _, went, opened, closed = shoot(ready, p.RtShootFrame2(FRAME, 250, 90, 180))
    assert opened - went == pytest.approx(0.25, abs=0.006)
    assert closed - opened == pytest.approx(0.25, abs=2e-5)
    assert not ready.trace().motors


# ---- SHOOT_FRAME2 --------------------------------------------------------------------------------


def ideal(turns):
    """Return the share of the distance from A to B after so many turns: ramps of an eighth, six
    eighths at constant speed."""
    t = np.clip(turns, 0, 1) * 8
    return np.where(t < 1, t * t / 2, np.where(t < 7, t - 0.5, 7 - (8 - t) ** 2 / 2)) / 7


def assert_angles(session, motor, before, opened, closed, opens, closes, a, b):
    """Assert field note 7.3 by the shutter's edges: on A until angle 0, all motion in 360 degrees,
    at rest on B."""
    times, signs = session.steps(motor)
    degree = (closed - opened) / (closes - opens)
    zero = opened - opens * degree
    assert before[motor] == a
    assert session.position(motor) == b
    assert a + signs.sum() == b
    way = b - a
    assert len(times) == abs(way)
    assert np.all(signs == np.sign(way))
    assert times[0] > zero - 1e-4
    assert times[-1] < zero + 360 * degree + 1e-4
    turns = (times - zero) / (360 * degree)
    # the path at each edge against the step made there; ramps begin and end on whole steps
    off = np.abs(ideal(turns) * abs(way) - np.arange(1, len(times) + 1))
    assert off.max() <= 1.1
    inside = (turns > 1 / 8) & (turns < 7 / 8)
    if inside.sum() > 20:
        gaps = np.diff(times[inside])
        assert gaps.max() / gaps.min() - 1 < 0.01, "constant speed"
        assert gaps.mean() == pytest.approx(
            360 * degree * 7 / 8 / abs(way), rel=0.005 + 2 / abs(way)
        )


@pytest.mark.parametrize(
    "angles",
    [
        (0, 360), (90, 270), (45, 315), (0, 180), (-90, 270), (90, 450), (-60, 400), (-300, -90),
        (400, 600),
    ],
)  # fmt: skip
@pytest.mark.parametrize("exposure", [100, 400, 3000])
def test_angles(ready, angles, exposure):
    """Field note 7.3: the motor waits on A, starts at GO, rests on B; the shutter opens and closes
    by its angles."""
    for motor in MOVE:
        ready.speed(motor, 200_000, 4_000_000)
    opens, closes = angles
    a, b = (720, 0) if exposure == 400 else (0, 36) if exposure == 100 else (-360, 3600)
    before, went, opened, closed = shoot(
        ready, p.RtShootFrame2(FRAME, exposure, opens, closes, [p.BlurMotor(1, a, b)])
    )
    assert closed - opened == pytest.approx(exposure / 1000, abs=2e-5)
    assert_angles(ready, 1, before, opened, closed, opens, closes, a, b)
    # GO is angle 0, or the shutter's opening if that comes before
    degree = exposure / 1000 / (closes - opens)
    assert opened - went == pytest.approx(max(opens, 0) * degree, abs=0.006)
    times, _ = ready.steps(1)
    assert times[0] - went > max(-opens, 0) * degree
    assert times[-1] - went < (360 + max(-opens, 0)) * degree + 0.007


@pytest.mark.parametrize(("a", "b"), [(-16, -9), (9, 2)])
def test_the_top_velocity_of_a_few_steps(ready, a, b):
    """Ramps of whole steps, here of 1 instead of 0.5, take some of the window's way over. What is
    left is slow enough, the steps of the ramps are not."""
    request = p.RtShootFrame2(FRAME, 250, -30, 400, [p.BlurMotor(1, a, b)])
    eighth = 0.25 * 360 / 430 / 8
    steps_per_s = 7 / (7 * eighth)
    ready.accept(p.MotorSetSpeed(1, int(steps_per_s), 3214))
    ready.refuse(p.Ack.ERR_RANGE, request)
    ready.accept(p.MotorSetSpeed(1, int(steps_per_s) + 1, 3214))
    shoot(ready, request)
    times, _ = ready.steps(1)
    assert len(times) == 7
    assert np.diff(times).min() > 1 / (int(steps_per_s) + 1)
    ready.ready(request)
    ready.accept(p.MotorSetSpeed(1, int(steps_per_s), 3214))
    ready.refuse(p.Ack.ERR_RANGE, p.RtGo())


def test_the_end_of_angles(ready):
    """RT_END comes after the shutter is closed and the motors rest on B."""
    for opens, closes in ((0, 90), (0, 720), (-360, -180), (500, 600)):
        ready.ready(p.RtShootFrame2(FRAME, 500, opens, closes, [p.BlurMotor(1, 0, 400)]))
        ready.accept(p.RtGo())
        went = ready.now
        ready.until(p.RtEnd, 10)
        degree = 0.5 / (closes - opens)
        assert ready.now - went == pytest.approx(
            (max(closes, 360) + max(-opens, 0)) * degree, abs=0.03
        )
        assert not ready.moving


def test_exposure_and_blur_of_nothing(ready):
    """Field note 7.3: EXPOSURE 0 counts as 1000 ms, BLUR 0 as 100 %."""
    before, _, opened, closed = shoot(
        ready, p.RtShootFrame(FRAME, 1, 0, 0, [p.BlurMotor(1, 100, 700)])
    )
    assert closed - opened == pytest.approx(1.0, abs=2e-5)
    assert_window(ready, 1, before, opened, closed, 100, 700)
    before, _, opened, closed = shoot(
        ready, p.RtShootFrame2(FRAME, 0, 90, 270, [p.BlurMotor(1, 100, 700)])
    )
    assert closed - opened == pytest.approx(1.0, abs=2e-5)
    assert_angles(ready, 1, before, opened, closed, 90, 270, 100, 700)


@pytest.mark.parametrize("far", [2**31 - 1, 2**30])
def test_positions_too_far_apart(ready, far):
    """Refused, never wrapped, however slow the motion would be; nearer positions are not."""
    ready.speed(1, 200_000, 4_000_000)
    for direction, a, b in ((1, -far, far), (0, far, 0)):
        pair = [p.BlurMotor(1, a, b)]
        ready.refuse(
            p.Ack.ERR_RANGE,
            *(p.RtShootFrame(FRAME, direction, 3_600_000, blur, pair) for blur in (1, 500, 1000)),
            p.RtShootFrame2(FRAME, 3_600_000, 0, 360, pair),
        )
    ready.run(0.1)
    assert not ready.trace().motors
    ready.accept(p.RtShootFrame2(FRAME, 1000, 0, 360, [p.BlurMotor(1, 300, 100)]))


@pytest.mark.parametrize("frame", [1, 2, 7, 24, 25])
@pytest.mark.parametrize("kind", ["1", "1 backward", "2"])
def test_window_from_the_path(ready, frame, kind):
    """Field note 7.2: without pairs, A and B are on the path half a frame before and after; 7.1 by
    analogy."""
    if kind == "2":
        request = p.RtShootFrame2(frame, 500, 0, 360)
    else:
        request = p.RtShootFrame(frame, int(kind == "1"), 500, 1000)
    before, _, opened, closed = shoot(ready, request)
    linear = MOVE[1][frame - 1]
    half = -30 if kind == "1 backward" else 30
    if kind == "2":
        assert_angles(ready, 1, before, opened, closed, 0, 360, linear - half, linear + half)
    else:
        assert_window(ready, 1, before, opened, closed, linear - half, linear + half)
    # the sine that motor 2 samples
    at = (frame - 1) * 0.3
    half = -0.15 if kind == "1 backward" else 0.15
    a, b = (400 * np.sin(at + sign * half) for sign in (-1, 1))
    times, signs = ready.steps(2)
    position = before[2] + np.cumsum(signs)
    for moment, place in ((opened, a), (closed, b)):
        there = position[times <= moment][-1] if np.any(times <= moment) else before[2]
        assert abs(there - place) <= (3 if 1 < frame < 25 else 6), (
            "beyond the ends the path goes on straight"
        )


@pytest.mark.each_processor
def test_pairs_and_path(ready):
    """SHOOT_FRAME2 with a pair for one motor: the other blurs along the path."""
    before, _, opened, closed = shoot(
        ready, p.RtShootFrame2(FRAME, 500, 0, 360, [p.BlurMotor(2, 0, 90)])
    )
    assert_angles(
        ready, 1, before, opened, closed, 0, 360, MOVE[1][FRAME - 1] - 30, MOVE[1][FRAME - 1] + 30
    )
    assert_angles(ready, 2, before, opened, closed, 0, 360, 0, 90)


# ---- refused -------------------------------------------------------------------------------------

PAIR = [p.BlurMotor(1, 0, 400)]


@pytest.mark.parametrize(
    "request_",
    [
        p.RtShootFrame(0, 1, 500, 500, PAIR),
        p.RtShootFrame(FRAMES + 1, 1, 500, 500, PAIR),
        p.RtShootFrame2(0, 500, 0, 180, PAIR),
        p.RtShootFrame2(FRAMES + 1, 500, 0, 180, PAIR),
        p.RtShootFrame(FRAME, 1, 2**32 - 1, 500, PAIR),
        p.RtShootFrame2(FRAME, 2**31, 0, 180, PAIR),
        p.RtShootFrame(FRAME, 2, 500, 500, PAIR),
        p.RtShootFrame(FRAME, 1, 500, 1001, PAIR),
        p.RtShootFrame(FRAME, 1, 500, 500, [p.BlurMotor(0, 0, 1)]),
        p.RtShootFrame(FRAME, 1, 500, 500, [*PAIR, p.BlurMotor(9, 0, 1)]),
        p.RtShootFrame2(FRAME, 500, 0, 180, [p.BlurMotor(255, 0, 1)]),
        p.RtShootFrame2(FRAME, 500, 180, 180, PAIR),
        p.RtShootFrame2(FRAME, 500, 180, 0, PAIR),
        p.RtShootFrame(FRAME, 1, 17, 1000, PAIR),  # 23 500 steps/s
        p.RtShootFrame(FRAME, 1, 500, 1000, [p.BlurMotor(1, -(2**31), 2**31 - 1)]),
        p.RtShootFrame2(FRAME, 17, 0, 360, PAIR),
        p.RtShootFrame2(FRAME, 60000, 0, 1, PAIR),  # six hours from A to B
        # it opens after 22 days
        p.RtShootFrame2(FRAME, 60000, 32766, 32767, PAIR),
        # the motors start 4 days after that
        p.RtShootFrame2(FRAME, 10000, -32768, -32767, PAIR),
        p.RtShootFrame2(FRAME, 120, -32768, -32767, PAIR),
    ],
)  # fmt: skip
def test_refused_for_its_numbers(ready, request_):
    ready.forget().refuse(p.Ack.ERR_RANGE, request_).run(0.2)
    assert not ready.trace().signals
    assert not ready.moving
    ready.refuse(p.Ack.ERR_GENERAL, p.RtGo())


@pytest.mark.parametrize(
    ("request_", "begin", "end", "others"),
    [
        # 400 steps in 0.5 s need 400 for the run-up, and for the run-out
        (p.RtShootFrame(FRAME, 1, 500, 1000, PAIR), -400, 800,
         [(10, 9000, p.Ack.ERR_PREROLL), (-9000, 390, p.Ack.ERR_POSTROLL)]),
        # field note 7.3: the motors go no further than A and B
        *((p.RtShootFrame2(FRAME, 500, *angles, PAIR), 0, 400, [(-9000, -1, p.Ack.ERR_PREROLL)])
          for angles in ((0, 360), (-90, 270), (90, 450))),
    ],
)  # fmt: skip
def test_limits_in_the_way(ready, request_, begin, end, others):
    """Before the exposure 0x17, after it 0x18."""
    for lower, upper, code in (
        (begin + 1, 9000, p.Ack.ERR_PREROLL),
        (-9000, end - 1, p.Ack.ERR_POSTROLL),
        (begin + 1, end - 1, p.Ack.ERR_PREROLL),
        *others,
    ):
        ready.accept(p.MotorSetLimits(1, 1, lower, 1, upper)).forget()
        ready.refuse(code, request_).run(0.1)
        assert not ready.trace().signals
        assert not ready.moving
    ready.accept(p.MotorSetLimits(1, 1, begin, 1, end))
    before, *_ = shoot(ready, request_)
    assert before[1] == begin
    assert ready.position(1) == end


def test_too_steep(ready):
    """800 steps/s within the 1.0 s of the run-up; with angles 914 steps/s within 1/16 s."""
    ready.speed(1, VELOCITY, 790)
    ready.refuse(p.Ack.ERR_PREROLL, p.RtShootFrame(FRAME, 1, 500, 1000, PAIR))
    ready.speed(1, VELOCITY, 810).accept(p.RtShootFrame(FRAME, 1, 500, 1000, PAIR)).wait_idle()
    request = p.RtShootFrame2(FRAME, 500, 0, 360, PAIR)
    ready.speed(1, VELOCITY, 14_500).refuse(p.Ack.ERR_RANGE, request)
    ready.speed(1, 910, 14_800).refuse(p.Ack.ERR_RANGE, request).speed(1, 918, 14_800)
    shoot(ready, request)
    times, signs = ready.steps(1)
    assert_within(times, signs, 918, 14_800)


def test_without_an_upload():
    session = rig()
    both = p.RtShootFrame(FRAME, 1, 500, 500, PAIR), p.RtShootFrame2(FRAME, 500, 0, 180, PAIR)
    session.refuse(p.Ack.ERR_GENERAL, *both)
    session.accept(p.RtUploadMoveBegin(1, 25))
    session.refuse(p.Ack.ERR_GENERAL, *both)
    session.accept(p.RtUploadMoveEnd(), both[0])


def test_refused_while_moving(ready):
    both = p.RtShootFrame(FRAME, 1, 500, 500, PAIR), p.RtShootFrame2(FRAME, 500, 0, 180, PAIR)
    ready.accept(p.MotorMove(7, 500))
    ready.refuse(p.Ack.ERR_MOVING, *both).wait_idle()
    ready.ready(both[0])
    ready.accept(p.RtGo())
    ready.refuse(
        p.Ack.ERR_MOVING, *both, p.RtGo(), p.RtPositionFrame(1), p.RtJogAll(24000, 3),
        run_request(24, 1, 5),
    )  # fmt: skip
    ready.until(p.RtEnd, 10).accept(both[1])
