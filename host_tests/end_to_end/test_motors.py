"""Requests for single motors on the host simulation: what is answered, and what the pins then do."""

import struct

import numpy as np
import pytest

from framestep.protocol import messages as m
from framestep_tools.payloads import (
    Ack,
    DeviceInfo,
    Hi,
    MotorConfigure,
    MotorGetPosition,
    MotorJog,
    MotorMove,
    MotorResetPosition,
    MotorSetLimits,
    MotorSetSpeed,
    MotorStatus,
    MotorStop,
    MotorStopAll,
    Positions,
)
from host_tests.end_to_end.session import DIALECTS, assert_within, deceleration, simulated

FARTHEST, LOWEST = 2**31 - 1, -(2**31)


@pytest.fixture
def rig():
    return simulated()


@pytest.fixture(params=DIALECTS)
def both(request):
    """A session in each dialect."""
    session = simulated({"dialect": request.param})
    session.wide = request.param == "dmc-lite"
    return session


def is_ack(session, frame, code=Ack.OK):
    """Whether a frame acknowledges with this code, in the form of the session's dialect (field note 1.4)."""
    size = 4 if session.wide else 2
    return frame.is_ack and frame.payload == int(code).to_bytes(size, "little")


# ---- who is there ------------------------------------------------------------------------------------------


def test_hi(both):
    answer = both.answer_to(m.MSG_HI)
    assert not answer.is_ack
    assert len(answer.payload) == 51
    info = DeviceInfo.unpack(answer.payload)
    assert info.name == "framestep"
    assert info.motors == 8
    assert info.protocol_version == 2
    assert info.capabilities & 0x0683 == 0x0683, "real-time moves, both go-motions, loops, camera"
    assert info.upload_frames >= 10_000
    assert both.ask(Hi()) == info


def test_hi_is_sent_at_each_opening(both):
    """Field note 1.5: with full data and ID 0 each time DTR rises."""
    info = both.ask(Hi())
    for _ in range(2):
        both.leave()
        both.run(0.2)
        both.come_back()
        frames = both.bytes_for(b"")
        assert [(f.type, f.id) for f in frames] == [(m.MSG_HI, 0)]
        assert DeviceInfo.unpack(frames[0].payload) == info


def test_name_of_the_rig_file():
    name = "Gerät №1 · " + "x" * 10
    assert simulated({"name": name}).ask(Hi()).name == name
    assert simulated({"name": "é" * 16}).ask(Hi()).name == "é" * 16


def test_form_of_every_answer(both):
    """Acknowledgements have the request's ID and type and a code of the dialect's width; data has no flag."""
    for kind, payload in (
        (m.MSG_MOTOR_STOP, b"\x01"),
        (m.MSG_MOTOR_STOP_ALL, b""),
        (m.MSG_MOTOR_STOP_ALL, b"\1\0\0\0"),
        (m.MSG_MOTOR_RESET_POSITION, struct.pack("<Bi", 1, 5)),
        (m.MSG_MOTOR_JOG, struct.pack("<BHi", 1, 100, 5)),
        (m.MSG_MOTOR_CONFIGURE, b"\x01\x01"),
        (m.MSG_MOTOR_SET_SPEED, struct.pack("<BII", 1, 1000, 1000)),
        (m.MSG_MOTOR_SET_LIMITS, struct.pack("<BBiBiB", 1, 0, 0, 0, 0, 0)),
        (m.MSG_RT_UPLOAD_MOVE_BEGIN, struct.pack("<ii", 1, 3)),
        (m.MSG_RT_UPLOAD_MOVE_AXIS, struct.pack("<BI3i", 1, 0, 1, 2, 3)),
        (m.MSG_RT_UPLOAD_MOVE_END, b""),
        (m.MSG_RT_POSITION_FRAME, struct.pack("<i", 3)),
    ):
        assert is_ack(both, both.answer_to(kind, payload)), kind
        both.wait_idle()
    run = struct.pack("<IiiIIBIHH", 24000, 1, 3, 500, 500, 0, 0, 0, 0)
    for tail in (b"", bytes(2), bytes(6)):
        assert is_ack(both, both.answer_to(m.MSG_RT_RUN_MOVE, run + tail)), tail
        both.wait_idle()
    assert is_ack(both, both.answer_to(m.MSG_RT_GO))
    assert is_ack(both, both.answer_to(m.MSG_RT_GO), Ack.ERR_MOVING)
    both.wait_idle()
    for kind, size in ((m.MSG_HI, 51), (m.MSG_MOTOR_STATUS, 5), (m.MSG_MOTOR_GET_POSITION, 4 + 4 * 8)):
        answer = both.answer_to(kind)
        assert not answer.is_ack
        assert answer.id == 77
        assert len(answer.payload) == size
    assert is_ack(both, both.answer_to(0x0300), Ack.ERR_UNSUPPORTED)
    damaged = bytes.fromhex("4446000000000102000000 00".replace(" ", ""))
    frames = both.bytes_for(damaged)
    assert [(f.id, f.type) for f in frames] == [(0, 0x8201)]
    assert is_ack(both, frames[0], Ack.ERR_CHECKSUM)


def test_answer_to_a_move(both):
    """One status byte as specified, an acknowledgement in the dialect of dmc-lite (field note 1.4)."""
    answer = both.answer_to(m.MSG_MOTOR_MOVE, struct.pack("<Bi", 2, 100))
    if both.wide:
        assert is_ack(both, answer)
    else:
        assert not answer.is_ack
        assert answer.payload == b"\x01"
    both.wait_idle()
    answer = both.answer_to(m.MSG_MOTOR_MOVE, struct.pack("<Bi", 2, 100))
    assert is_ack(both, answer) if both.wide else answer.payload == b"\x00"


# ---- MOVE --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("target", "velocity", "acceleration"),
    [(8000, 5000, 20000), (-3000, 9000, 30000), (1, 5000, 20000), (-2, 40, 7), (4000, 120_000, 400_000)],
)
def test_move(rig, target, velocity, acceleration):
    rig.speed(3, velocity, acceleration)
    rig.ask(MotorMove(3, target))
    rig.wait_idle()
    times, signs = rig.steps(3)
    assert rig.position(3) == target == signs.sum() == np.sign(target) * len(signs)
    if abs(target) > 2:
        assert_within(times, signs, velocity, acceleration)
    # as long as a trapezoid takes, or a triangle where the way is too short for one
    way = abs(target)
    ramp = velocity / acceleration
    ideal = way / velocity + ramp if way >= velocity * ramp else 2 * (way / acceleration) ** 0.5
    first = (2 / acceleration) ** 0.5 if way > 1 else ideal  # the first step, from rest
    # at either end, where it next to stands, a rounding of 2e-5 steps takes as long as this
    rounding = 2 * (2 * 2e-5 / acceleration) ** 0.5
    assert times[-1] - times[0] == pytest.approx(ideal - first, abs=1e-5 + rounding + 1e-5 * ideal)


def test_default_speed(rig):
    """Field note 4.1: 5000 steps/s, 20000 steps/s²."""
    rig.ask(MotorMove(1, 4000))
    rig.wait_idle()
    times, signs = rig.steps(1)
    assert 1 / np.diff(times).min() == pytest.approx(5000, rel=2e-3)
    assert deceleration(times, signs, times[-1] - 0.2) == pytest.approx(20000, rel=0.01)


def test_no_distance(both):
    """To where it stands: answered, nothing moves, no report, position kept."""
    both.accept(MotorResetPosition(1, -77))
    both.run(0.1)
    both.forget()
    assert both.code(MotorMove(1, -77)) == Ack.OK
    assert both.moving == []
    both.run(0.5)
    assert both.position(1) == -77
    assert both.made(1) == 0
    assert both.events(Positions) == []


def test_retarget_farther_nearer_and_back(rig):
    """Field note 4.8: no stop where the way ahead is long enough, and never more than the acceleration."""
    rig.ask(MotorMove(1, 4000))
    rig.run(0.5)
    rig.ask(MotorMove(1, 9000))
    rig.run(0.7)
    times, signs = rig.steps(1)
    inside = times > times[0] + 0.3
    assert np.diff(times[inside]).max() < 1 / 4900, "slowed down for a target that lies ahead"
    rig.ask(MotorMove(1, 8000))
    rig.run(0.3)
    rig.ask(MotorMove(1, -2000))
    rig.wait_idle()
    times, signs = rig.steps(1)
    assert rig.position(1) == -2000 == signs.sum()
    assert_within(times, signs, 5000, 20000)
    assert np.count_nonzero(np.diff(signs)) == 1, "turned more than once"


def test_retarget_nearer_than_it_can_stop(rig):
    """It overshoots by what the ramp needs and comes back."""
    rig.ask(MotorMove(1, 20000))
    rig.run(0.6)
    here = rig.made(1)
    rig.ask(MotorMove(1, here + 200))
    rig.wait_idle()
    times, signs = rig.steps(1)
    assert rig.position(1) == here + 200
    assert_within(times, signs, 5000, 20000)
    highest = np.cumsum(signs).max()
    assert highest == pytest.approx(here + 5000**2 / 40000, abs=5000 * 0.02)


def test_retarget_storm(rig):
    """A new target every 30 ms, with changes of speed between: steps and position agree, limits are kept."""
    chance = np.random.default_rng(4)
    for target in chance.integers(-4000, 4000, 40):
        rig.ask(MotorMove(1, int(target)))
        rig.run(float(chance.uniform(0.005, 0.08)))
    rig.wait_idle()
    times, signs = rig.steps(1)
    assert rig.position(1) == signs.sum() == target
    assert_within(times, signs, 5000, 20000)


def test_large_positions(both):
    """Where a position is no small integer of a 32-bit MicroPython."""
    for start, target in ((FARTHEST - 300, FARTHEST), (LOWEST + 300, LOWEST), (2**30 - 5, 2**30 + 5)):
        both.accept(MotorResetPosition(5, start))
        assert both.code(MotorMove(5, target)) == Ack.OK
        both.wait_idle()
        assert both.position(5) == target
    both.accept(MotorJog(5, 10000, FARTHEST), MotorStop(5))


def test_all_motors_at_once(rig):
    for motor in range(1, 9):
        rig.ask(MotorMove(motor, 700 * motor * (-1) ** motor))
    assert rig.moving == list(range(1, 9))
    rig.wait_idle()
    for motor in range(1, 9):
        target = 700 * motor * (-1) ** motor
        assert rig.made(motor) == rig.position(motor) == target
        assert_within(*rig.steps(motor), 5000, 20000)


def test_inverted_motor():
    """The rig file's `invert` swaps the pin, not the counting."""
    rig = simulated({"motors": [{}, {"invert": True}]})
    for motor in (1, 2):
        rig.ask(MotorMove(motor, 50))
    rig.wait_idle()
    levels = {signal: values[-1] for signal, (_, values) in rig.trace().signals.items() if signal.startswith("dir")}
    assert levels == {"dir1": 1}  # motor 2's pin stays low
    assert rig.made(1) == rig.made(2) == 50 == rig.position(2)


def test_jerk_limit():
    """With `jerk` in the rig file velocity and acceleration are held as well, and the move is exact and longer."""
    rig = simulated({"motors": [{"jerk": 200}]})
    for motor in (1, 2):
        rig.speed(motor, 8000, 40000)
        rig.ask(MotorMove(motor, 6000))
    rig.wait_idle()
    assert rig.made(1) == rig.made(2) == 6000
    assert_within(*rig.steps(1), 8000, 40000)
    durations = {motor: np.ptp(rig.steps(motor)[0]) for motor in (1, 2)}
    # a/j of time more than a trapezoid; of the first and the last step hardly anything is seen
    assert durations[1] - durations[2] == pytest.approx(40000 / 200_000, abs=0.04)


# ---- reports -----------------------------------------------------------------------------------------------


def test_moving_bits(both):
    """Field note 4.7: set from the acknowledgement on, clear once the last step is out."""
    for motor, request in ((1, MotorMove(1, 300)), (3, MotorJog(3, 10000, -300)), (8, MotorMove(8, 1))):
        both.code(request)
        assert motor in both.moving
    assert both.ask(MotorStatus()).motor_bits == 0b10000101
    while both.moving:
        both.run(0.01)
    assert both.now - max(both.steps(motor)[0][-1] for motor in (1, 3)) > -0.001
    quiet = len(both.trace().steps(1)[0])
    both.run(0.2)
    assert len(both.trace().steps(1)[0]) == quiet


def test_moving_bit_until_the_last_edge(rig):
    """Asked every millisecond, the bit is set at each edge."""
    rig.speed(2, 5000, 100_000)
    rig.ask(MotorMove(2, 120))
    seen = []
    while not seen or seen[-1][1]:
        seen.append((rig.now, rig.moving == [2]))
        rig.run(0.001)
    times, _ = rig.steps(2)
    assert len(times) == 120
    assert times[-1] <= seen[-1][0]


@pytest.mark.parametrize("report_ms", [100, 30])
def test_positions_in_motion(report_ms):
    """Field note 4.6: every 100 ms while anything moves, and once more after the stop."""
    rig = simulated({"report_ms": report_ms})
    rig.run(0.5)
    assert rig.events(Positions) == [], "positions come though nothing moves"
    begun = rig.now
    rig.ask(MotorMove(1, 5000))
    rig.ask(MotorMove(4, -2500))
    rig.run(2)
    reports = rig.events(Positions)
    ends = max(rig.steps(motor)[0][-1] for motor in (1, 4))
    assert reports[0][0] - begun <= report_ms / 1000 + 0.003
    gaps = np.diff([time for time, _ in reports[:-1]])
    assert gaps == pytest.approx(report_ms / 1000, abs=0.0025)  # a whole pass comes every 2 ms
    times, signs = rig.steps(1)
    for time, message in reports[:-1]:
        # the steps given to the engine, which makes them within 3 ms
        assert abs(message.steps[0] - signs[times <= time].sum()) <= 5000 * 0.003 + 1
    assert message.move_time == 0
    last, message = reports[-1]
    assert ends <= last <= ends + 0.01
    assert message.steps == (5000, 0, 0, -2500, 0, 0, 0, 0)
    assert rig.ask(MotorGetPosition()).steps == message.steps


# ---- STOP --------------------------------------------------------------------------------------------------


def test_stop(rig):
    """The motor ramps down as steeply as it is set to; the others go on."""
    rig.speed(1, 6000, 30000)
    rig.ask(MotorMove(1, 20000))
    rig.ask(MotorMove(2, 6000))
    rig.run(0.6)
    rig.accept(MotorStop(1))
    asked = rig.now
    assert rig.moving == [1, 2]
    rig.wait_idle()
    times, signs = rig.steps(1)
    assert deceleration(times, signs, asked) == pytest.approx(30000, rel=0.01)
    assert times[-1] - asked == pytest.approx(6000 / 30000, abs=0.008)
    assert rig.position(1) == signs.sum()
    assert rig.position(2) == 6000
    rig.accept(MotorStop(1))
    rig.ask(MotorMove(1, 0))
    rig.wait_idle()
    assert rig.made(1) == 0


def test_stop_before_the_first_step(rig):
    rig.ask(MotorMove(1, 1000))
    rig.accept(MotorStop(1))
    rig.wait_idle()
    assert rig.made(1) == rig.position(1)
    assert rig.made(1) <= 2


@pytest.mark.parametrize("factor", [None, 2])
@pytest.mark.parametrize("flags", [None, 1])
def test_stop_all_once_and_twice(factor, flags):
    """Field note 4.4: a second one within 1000 ms decelerates `hard_stop_factor` times as steeply."""
    rig = simulated({"hard_stop_factor": factor} if factor else None)
    for motor, acceleration in ((1, 20000), (2, 8000)):
        rig.speed(motor, 5000, acceleration)

    def stop(times_asked, pause=0.0):
        rig.forget()
        for motor in (1, 2):
            rig.ask(MotorMove(motor, rig.position(motor) + 30000))
        rig.run(1)
        for _ in range(times_asked):
            rig.run(pause)
            rig.accept(MotorStopAll(flags))
        asked = rig.now
        rig.wait_idle()
        assert all(rig.made(motor) for motor in (1, 2))
        rig.run(1.2)
        return [deceleration(*rig.steps(motor), asked) for motor in (1, 2)]

    assert stop(1) == pytest.approx([20000, 8000], rel=0.01)
    hard = factor or 4
    assert stop(2) == pytest.approx([hard * 20000, hard * 8000], rel=0.02)
    assert stop(1) == pytest.approx([20000, 8000], rel=0.01), "the third is a first one again"


def test_second_stop_all_under_way(rig):
    """It also steepens a ramp that has begun, and comes too late after a second."""
    rig.speed(1, 5000, 4000)
    rig.ask(MotorMove(1, 40000))
    rig.run(1.6)
    rig.accept(MotorStopAll())
    rig.run(0.3)
    rig.accept(MotorStopAll())
    asked = rig.now
    rig.wait_idle()
    assert deceleration(*rig.steps(1), asked) == pytest.approx(16000, rel=0.02)
    rig.run(1.2)
    rig.speed(1, 5000, 2000)
    rig.ask(MotorMove(1, 60000))
    rig.run(3)
    rig.accept(MotorStopAll())
    rig.run(1.1)
    rig.accept(MotorStopAll())
    asked = rig.now
    rig.wait_idle()
    assert deceleration(*rig.steps(1), asked) == pytest.approx(2000, rel=0.02)


# ---- RESET_POSITION ----------------------------------------------------------------------------------------


def test_reset_position(both):
    """Field note 4.5: acknowledged, then told; nothing moves. While the motor moves: 0x12."""
    for value in (-5, 2**30, LOWEST, FARTHEST, 12345):
        both.forget()
        both.accept(MotorResetPosition(4, value))
        both.run(0.05)
        ((_, message),) = both.events(Positions)
        assert message.steps[3] == value
        assert both.position(4) == value
    assert both.made(4) == 0
    both.code(MotorMove(4, 12345 + 2000))
    both.refuse(Ack.ERR_MOVING, MotorResetPosition(4, 0))
    both.accept(MotorResetPosition(5, 99))
    both.wait_idle()
    assert both.position(4) == 14345
    assert both.made(4) == 2000
    assert both.position(5) == 99
    both.code(MotorMove(4, 12345))
    both.wait_idle()
    assert both.made(4) == 0


# ---- JOG ---------------------------------------------------------------------------------------------------


def jog_for(rig, seconds, request, every=0.1):
    """As Dragonframe does while a key is held."""
    until = rig.now + seconds
    while rig.now < until:
        rig.accept(request)
        rig.run(every)


@pytest.mark.parametrize(("speed", "share"), [(10000, 1.0), (5000, 0.5), (300, 0.03), (100, 0.01), (1, 0.01)])
def test_jog_speed(rig, speed, share):
    """Field note 4.2: velocity and acceleration scaled, with a small floor."""
    rig.speed(1, 8000, 16000)
    jog_for(rig, 1.5, MotorJog(1, speed, FARTHEST))
    rig.accept(MotorStop(1))
    rig.wait_idle()
    times, _ = rig.steps(1)
    assert 1 / np.diff(times).min() == pytest.approx(8000 * share, rel=3e-3)
    # after n steps of the ramp: sqrt(2·n / a)
    n = int(0.8 * 8000 * share / (2 * 16000 / 8000))
    for k in (n // 4, n):
        assert times[k] - times[0] == pytest.approx(
            ((2 * k + 2) ** 0.5 - 2**0.5) / (16000 * share) ** 0.5, rel=2e-3, abs=1e-3
        )


def test_jog_ends_without_another(rig):
    """500 ms after the last one it ramps down."""
    jog_for(rig, 1.0, MotorJog(1, 10000, FARTHEST), every=0.2)
    rig.accept(MotorJog(1, 10000, FARTHEST))
    asked = rig.now
    rig.run(0.45)
    times, signs = rig.steps(1)
    assert np.diff(times[-20:]).max() < 1 / 4900, "slows down too soon"
    rig.wait_idle()
    times, signs = rig.steps(1)
    assert times[-1] - asked == pytest.approx(0.5 + 5000 / 20000, abs=0.012)
    assert deceleration(times, signs, asked + 0.51) == pytest.approx(20000, rel=0.01)
    assert rig.position(1) == signs.sum()


@pytest.mark.parametrize(("timeout_ms", "ends"), [(0, False), (200, True)])
def test_jog_timeout_of_the_rig_file(timeout_ms, ends):
    rig = simulated({"jog_timeout_ms": timeout_ms})
    rig.accept(MotorJog(1, 10000, FARTHEST))
    rig.run(3)
    assert (rig.moving == []) == ends
    assert rig.made(1) == pytest.approx(5000 * 0.2 if ends else 5000 * 2.9, abs=400)


def test_jog_reaches_its_destination(rig):
    """And a jog that is repeated there is answered and moves nothing."""
    jog_for(rig, 1.2, MotorJog(1, 10000, 2500))
    rig.wait_idle()
    assert rig.position(1) == rig.made(1) == 2500
    rig.accept(MotorJog(1, 10000, 2500))
    assert rig.moving == []


def test_jog_repeated_is_one_motion(rig):
    """Repetitions do not disturb it: the edges are those of a jog that was asked for once."""
    other = simulated({"jog_timeout_ms": 0})
    rig.board.run_until(100_000_000)
    other.board.run_until(100_000_000)
    jog_for(rig, 0.8, MotorJog(1, 7000, FARTHEST), every=0.03)
    other.accept(MotorJog(1, 7000, FARTHEST))
    other.run(0.8)
    count = len(rig.steps(1)[0]) - 20
    assert count > 1500
    assert (rig.steps(1)[0][:count] == other.steps(1)[0][:count]).all()


def test_jog_turns_by_ramps(rig):
    """Field note 4.2: against the direction it first ramps to a stop, then turns."""
    jog_for(rig, 0.8, MotorJog(1, 10000, FARTHEST))
    jog_for(rig, 1.0, MotorJog(1, 10000, LOWEST))
    jog_for(rig, 0.4, MotorJog(1, 4000, LOWEST))
    rig.accept(MotorStop(1))
    rig.wait_idle()
    times, signs = rig.steps(1)
    assert_within(times, signs, 5000, 20000)
    turns = np.flatnonzero(np.diff(signs))
    assert len(turns) == 1
    gaps = np.diff(times)
    # n steps before and after the turn last as long as the ramp says: sqrt(2n/a) each
    at = turns[0]
    for n in (50, 300):
        assert times[at] - times[at - n] == pytest.approx((2 * n / 20000) ** 0.5, abs=0.012)
        assert times[at + 1 + n] - times[at + 1] == pytest.approx((2 * n / 20000) ** 0.5, abs=0.012)
    assert gaps[at] < 0.03
    assert rig.position(1) == signs.sum()


def test_jog_is_held_by_soft_limits(both):
    both.accept(MotorSetLimits(1, 1, -1200, 1, 1500))
    for destination, ends in ((FARTHEST, 1500), (LOWEST, -1200), (1600, 1500), (2**30, 1500)):
        jog_for(both, 1.5, MotorJog(1, 10000, destination))
        both.wait_idle()
        assert both.position(1) == ends
        assert both.made(1) == ends
    highest = np.cumsum(both.steps(1)[1])
    assert highest.max() == 1500
    assert highest.min() == -1200


GENTLER = {
    "a slower jog": [MotorJog(1, 500, FARTHEST)],
    "a jog with less acceleration": [MotorSetSpeed(1, 20000, 2000), MotorJog(1, 10000, FARTHEST)],
    "a move with less acceleration": [MotorSetSpeed(1, 20000, 2000), MotorMove(1, 8000)],
    "a stop with less acceleration": [MotorSetSpeed(1, 20000, 2000), MotorStop(1)],
}


@pytest.mark.parametrize("jerk", [0, 300])
@pytest.mark.parametrize("requests", GENTLER.values(), ids=GENTLER)
def test_soft_limits_hold_for_what_is_gentler_under_way(requests, jerk):
    """A motor that is near its limit can still stop there, whatever is asked of it meanwhile."""
    rig = simulated({"motors": [{"jerk": jerk}]})
    rig.accept(MotorSetSpeed(1, 20000, 40000), MotorSetLimits(1, 1, -100_000, 1, 8000))
    jog_for(rig, 0.4, MotorJog(1, 10000, FARTHEST))
    rig.accept(MotorJog(1, 10000, FARTHEST))
    rig.run(0.2)
    assert 5000 < rig.position(1) < 8000
    rig.accept(*requests)
    rig.wait_idle()
    assert np.cumsum(rig.steps(1)[1]).max() <= 8000


UNDER_WAY = {
    "a move": [MotorMove(1, 30_000)],
    "a jog": [MotorJog(1, 10_000, FARTHEST)],
    "a move that turns": [MotorMove(1, -30_000), MotorMove(1, 30_000)],
}


@pytest.mark.parametrize("jerk", [0, 300])
@pytest.mark.parametrize("backlash", [0, 40])
@pytest.mark.parametrize("room", [9_000, 1_000], ids=["in time", "too late"])
@pytest.mark.parametrize("requests", UNDER_WAY.values(), ids=UNDER_WAY)
def test_a_soft_limit_set_under_way_holds(requests, room, backlash, jerk):
    """The motor comes to rest on it; where it is too near to stop there, it comes back (field note 4.3)."""
    rig = simulated({"motors": [{"jerk": jerk, "backlash": backlash}], "jog_timeout_ms": 0})
    rig.accept(MotorSetSpeed(1, 20_000, 40_000))
    for request in requests:
        rig.accept(request)
        rig.run(0.3)
    rig.run(0.2)
    limit = rig.position(1) + room
    rig.accept(MotorSetLimits(1, 1, -100_000, 1, limit))
    rig.wait_idle()
    assert rig.position(1) == limit
    times, signs = rig.steps(1)
    assert_within(times, signs, 20_000, 40_000)
    if room > 5_000:
        assert np.cumsum(signs).max() <= limit
    else:
        stop_s = 20_000 / 40_000 / 2 + 0.05 + (0.2 if jerk else 0)
        assert limit < np.cumsum(signs).max() < limit - room + 20_000 * stop_s
    rig.refuse(Ack.ERR_SOFT_UP, MotorMove(1, limit + 1))


@pytest.mark.parametrize("stop", [MotorStop(1), MotorStopAll()])
@pytest.mark.parametrize("jerk", [0, 300])
def test_a_soft_limit_set_in_a_stop_does_not_send_it_on(stop, jerk):
    rig = simulated({"motors": [{"jerk": jerk}]})
    rig.accept(MotorSetSpeed(1, 20_000, 40_000), MotorMove(1, 30_000))
    rig.run(0.4)
    rig.accept(stop)
    rig.run(0.05)
    limit = rig.position(1) + 12_000
    rig.accept(MotorSetLimits(1, 1, -100_000, 1, limit))
    rig.wait_idle()
    assert rig.position(1) < limit - 2_000


def test_limits_of_another_motor_leave_a_move_alone(rig):
    rig.accept(MotorMove(1, 3000))
    rig.run(0.2)
    rig.accept(MotorSetLimits(2, 1, -1, 1, 1), MotorSetLimits(1, 1, -1, 1, 3000))
    rig.wait_idle()
    assert rig.position(1) == 3000


def test_less_acceleration_waits_for_the_motor_to_stand(rig):
    rig.accept(MotorSetSpeed(1, 20000, 40000), MotorMove(1, 8000))
    rig.run(0.2)
    rig.accept(MotorSetSpeed(1, 20000, 2000))
    rig.wait_idle()
    fast, _ = rig.steps(1)
    rig.accept(MotorMove(1, 0))
    rig.wait_idle()
    slow = rig.steps(1)[0][len(fast) :]
    assert np.ptp(fast) == pytest.approx(2 * (8000 / 40000) ** 0.5, rel=0.05)
    assert np.ptp(slow) == pytest.approx(2 * (8000 / 2000) ** 0.5, rel=0.05)


def test_jog_past_a_limit_goes_back_only(rig):
    rig.accept(MotorResetPosition(1, 3000), MotorSetLimits(1, 1, 0, 1, 1000))
    jog_for(rig, 0.3, MotorJog(1, 10000, FARTHEST))
    rig.wait_idle()
    assert rig.position(1) == 3000, "moved further out"
    jog_for(rig, 2.0, MotorJog(1, 10000, LOWEST))
    rig.wait_idle()
    assert rig.position(1) == 0


def test_jog_refused(both):
    both.refuse(Ack.ERR_RANGE, MotorJog(1, 0, 100), MotorJog(1, 10001, 100), MotorJog(1, 65535, 100))
    both.refuse(Ack.ERR_RANGE, MotorJog(0, 100, 100), MotorJog(9, 100, 100), MotorJog(255, 100, 100))
    both.run(0.2)
    assert both.moving == []
    assert both.made(1) == 0


def test_refused_jog_does_not_prolong(rig):
    rig.accept(MotorJog(1, 10000, FARTHEST))
    asked = rig.now
    for _ in range(6):
        rig.run(0.1)
        rig.refuse(Ack.ERR_RANGE, MotorJog(1, 0, FARTHEST))
    rig.wait_idle()
    assert rig.steps(1)[0][-1] - asked == pytest.approx(0.75, abs=0.012)


def test_move_after_jog(rig):
    """A MOVE takes over from a jog, and no jog's time-out ends it."""
    rig.accept(MotorJog(1, 10000, FARTHEST))
    rig.run(0.4)
    rig.ask(MotorMove(1, 6000))
    rig.wait_idle()
    assert rig.position(1) == rig.made(1) == 6000


# ---- CONFIGURE, SET_SPEED, SET_LIMITS ----------------------------------------------------------------------


def test_configure(both):
    """A motor that is not enabled does not move; its driver's pin says so."""
    both.accept(MotorConfigure(2, m.MOTOR_ENABLED | m.MOTOR_BLUR), MotorConfigure(3, 0))
    both.refuse(Ack.ERR_GENERAL, MotorMove(3, 100), MotorJog(3, 100, 100))
    both.run(0.1)
    assert both.made(3) == 0
    assert both.moving == []
    both.accept(MotorConfigure(3, m.MOTOR_ENABLED))
    assert both.code(MotorMove(3, 100)) == Ack.OK
    both.refuse(Ack.ERR_MOVING, MotorConfigure(3, 0))
    both.wait_idle()
    assert both.position(3) == both.made(3) == 100
    both.accept(MotorConfigure(3, 0))
    assert both.trace().signals["enable3"][1].tolist() == [0, 1, 0]
    both.accept(MotorConfigure(8, 0x0F))
    both.refuse(Ack.ERR_RANGE, MotorConfigure(0, 1), MotorConfigure(9, 1))


def test_set_speed_refused(both):
    """Velocity 0, and more than the board can step: with pulses of 1 µs, high and low, 480769 steps/s."""
    for velocity in (0, 480_770, 500_001, 2**30, 2**31, 2**32 - 1):
        both.refuse(Ack.ERR_RANGE, MotorSetSpeed(1, velocity, 1000))
    both.refuse(Ack.ERR_RANGE, MotorSetSpeed(0, 1000, 1000), MotorSetSpeed(9, 1000, 1000))
    both.code(MotorMove(1, 4000))
    both.wait_idle()
    times, _ = both.steps(1)
    assert 1 / np.diff(times).min() == pytest.approx(5000, rel=2e-3), "a refused speed is in force"


@pytest.mark.parametrize(("pulse_us", "fastest"), [(0.25, 500_000), (0.8, 500_000), (2.0, 242_248), (4.0, 121_595)])
def test_fastest_speed_depends_on_the_pulse(pulse_us, fastest):
    rig = simulated({"motors": [{"pulse_us": pulse_us}]})
    rig.refuse(Ack.ERR_RANGE, MotorSetSpeed(1, fastest + 1, 1000))
    rig.speed(1, fastest, 4_000_000)
    way = int(fastest**2 / 4_000_000 + fastest / 20)
    rig.ask(MotorMove(1, way))
    rig.wait_idle()
    times, _ = rig.steps(1)
    assert len(times) == way
    assert 1 / np.median(np.diff(times)[way // 2 - 1000 :][:2000]) == pytest.approx(fastest, rel=0.01)


@pytest.mark.parametrize(
    ("velocity", "acceleration", "expected"),
    [(4000, 0, 2000), (10, 0, 5), (1, 0, 5), (3, 40, 40), (1000, 2**32 - 1, None), (480_000, 4_000_000, None)],
)
def test_set_speed(rig, velocity, acceleration, expected):
    """Field note 4.1: acceleration 0 is half the velocity, and velocity has a floor of 10 steps/s."""
    rig.speed(1, velocity, acceleration)
    top = max(velocity, 10)
    way = int(top * 1.5 * (top / expected if expected else 0.1)) + 30
    rig.ask(MotorMove(1, way))
    rig.wait_idle(200)
    times, signs = rig.steps(1)
    assert len(times) == way == rig.position(1)
    assert 1 / np.diff(times).min() == pytest.approx(top, rel=0.01)
    if expected:
        ideal = way / top + top / expected - (2 / expected) ** 0.5
        assert times[-1] - times[0] == pytest.approx(ideal, rel=0.003, abs=0.002)
        assert_within(times, signs, top, expected)


def test_set_speed_in_motion(rig):
    """It holds for the next motion; the one under way ends where it should."""
    rig.ask(MotorMove(1, 6000))
    rig.run(0.5)
    rig.speed(1, 1000, 2000)
    rig.wait_idle()
    assert rig.made(1) == 6000
    rig.forget()
    rig.ask(MotorMove(1, 4000))
    rig.wait_idle()
    assert_within(*rig.steps(1), 1000, 2000)


def test_soft_limits(both):
    """Field note 4.3: 0x20 above, 0x21 below, nothing moves; a motor past a limit may come back."""
    both.accept(MotorSetLimits(1, 1, -500, 1, 800))
    for target, code in ((801, Ack.ERR_SOFT_UP), (FARTHEST, Ack.ERR_SOFT_UP), (-501, Ack.ERR_SOFT_LOW)):
        both.refuse(code, MotorMove(1, target))
    both.refuse(Ack.ERR_SOFT_LOW, MotorMove(1, LOWEST))
    both.run(0.1)
    assert both.moving == []
    assert both.made(1) == 0
    for target in (800, -500, 0):
        assert both.code(MotorMove(1, target)) == Ack.OK
        both.wait_idle()
        assert both.position(1) == target
    both.accept(MotorResetPosition(1, 2000))
    both.refuse(Ack.ERR_SOFT_UP, MotorMove(1, 2001))
    for target in (1500, 900, 800):
        assert both.code(MotorMove(1, target)) == Ack.OK, "may move back toward the allowed range"
        both.wait_idle()
        assert both.position(1) == target
    both.refuse(Ack.ERR_SOFT_UP, MotorMove(1, 801))
    both.accept(MotorResetPosition(1, -2000))
    both.refuse(Ack.ERR_SOFT_LOW, MotorMove(1, -2001))
    both.refuse(Ack.ERR_SOFT_UP, MotorMove(1, 900))
    assert both.code(MotorMove(1, -600)) == Ack.OK


def test_limits_off_and_one_sided(rig):
    rig.accept(MotorSetLimits(1, 0, 10, 1, 500))
    rig.refuse(Ack.ERR_SOFT_UP, MotorMove(1, 501))
    rig.ask(MotorMove(1, -300))
    rig.wait_idle()
    rig.accept(MotorSetLimits(1, 0, 10, 0, -10))
    rig.ask(MotorMove(1, 600))
    rig.wait_idle()
    assert rig.position(1) == 600


def test_limits_refused(both):
    """Limits that cross, a flag that is neither 0 nor 1, a limit set that the rig does not have."""
    both.accept(MotorSetLimits(1, 1, -100, 1, 100))
    both.refuse(Ack.ERR_RANGE, MotorSetLimits(1, 1, 101, 1, 100), MotorSetLimits(1, 1, FARTHEST, 1, LOWEST))
    both.refuse(Ack.ERR_RANGE, MotorSetLimits(0, 1, 0, 1, 1), MotorSetLimits(9, 1, 0, 1, 1))
    both.refuse(Ack.ERR_RANGE, MotorSetLimits(1, 2, -300, 1, 300), MotorSetLimits(1, 1, -300, 255, 300))
    both.refuse(Ack.ERR_RANGE, MotorSetLimits(1, 1, -300, 1, 300, limit_set=3))
    both.refuse(Ack.ERR_SOFT_UP, MotorMove(1, 101))
    both.refuse(Ack.ERR_SOFT_LOW, MotorMove(1, -101))
    both.accept(MotorSetLimits(1, 1, 50, 1, 50), MotorSetLimits(1, 1, LOWEST, 1, FARTHEST))


def test_no_such_motor(both):
    for motor in (0, 9, 32, 255):
        both.refuse(Ack.ERR_RANGE, MotorMove(motor, 5), MotorStop(motor), MotorResetPosition(motor, 5))


# ---- a host that is gone -----------------------------------------------------------------------------------


@pytest.mark.parametrize("jogging", [False, True])
def test_port_closed_in_motion(rig, jogging):
    """Field note 1.11: motors decelerate to a stop, and the next host finds them where the steps say."""
    rig.ask(MotorMove(1, 30000))
    rig.code(MotorJog(2, 10000, LOWEST) if jogging else MotorMove(2, -30000))
    rig.run(0.4)
    rig.leave()
    closed = rig.now
    rig.run(1)
    for motor in (1, 2):
        times, signs = rig.steps(motor)
        assert times[-1] - closed == pytest.approx(5000 / 20000, abs=0.008)
        assert deceleration(times, signs, closed) == pytest.approx(20000, rel=0.01)
    rig.come_back()
    rig.forget()
    frames = rig.bytes_for(b"", 0.05)
    assert [f.type for f in frames] == [m.MSG_HI], "what the last host did not read reaches the next"
    assert rig.moving == []


def test_half_a_frame_of_a_lost_host(rig):
    """What it began to send does not hold up the next host's first request."""
    rig.port.write(b"DF\1\0\0\0\x31\0\x00\x04" + bytes(100))
    rig.run(0.02)
    rig.leave()
    rig.run(0.02)
    rig.come_back()
    assert rig.code(MotorStop(1)) == Ack.OK
