"""Requests for single motors on the host simulation: the answers, and the effect on the pins."""

import struct

import numpy as np
import pytest

from framestep.protocol import messages as m
from framestep_tools import payloads as p
from host_tests.end_to_end.session import assert_within, deceleration, simulated

FARTHEST, LOWEST = 2**31 - 1, -(2**31)


def is_ack(session, frame, code=p.Ack.OK):
    """Whether a frame acknowledges with this code, in the form of the session's dialect (field note
    1.4)."""
    size = 4 if session.dword_acks else 2
    return frame.is_ack and frame.payload == int(code).to_bytes(size, "little")


# ---- the greeting --------------------------------------------------------------------------------


def test_hi(both):
    answer = both.answer_to(m.MSG_HI)
    assert not answer.is_ack
    assert len(answer.payload) == 51
    info = p.DeviceInfo.unpack(answer.payload)
    assert info.name == "framestep"
    assert info.motors == 8
    assert info.protocol_version == 2
    assert info.capabilities & 0x0683 == 0x0683, "real-time moves, both go-motions, loops, camera"
    assert info.upload_frames >= 10_000
    assert both.ask(p.Hi()) == info


def test_hi_is_sent_at_each_opening(both):
    """Field note 1.5: with full data and ID 0 each time DTR rises."""
    info = both.ask(p.Hi())
    for _ in range(2):
        both.leave().run(0.2).come_back()
        frames = both.bytes_for(b"")
        assert [(f.type, f.id) for f in frames] == [(m.MSG_HI, 0)]
        assert p.DeviceInfo.unpack(frames[0].payload) == info


def test_name_of_the_rig_file():
    name = "Gerät №1 · " + "x" * 10
    assert simulated({"name": name}).ask(p.Hi()).name == name
    assert simulated({"name": "é" * 16}).ask(p.Hi()).name == "é" * 16


# ---- the form of answers: acknowledgements have the request's ID and type, and a code with the
# dialect's width; data has no flag


@pytest.mark.parametrize(
    ("kind", "payload"),
    [
        pytest.param(m.MSG_MOTOR_STOP, b"\x01", id="STOP"),
        pytest.param(m.MSG_MOTOR_STOP_ALL, b"", id="STOP_ALL"),
        pytest.param(m.MSG_MOTOR_STOP_ALL, b"\1\0\0\0", id="STOP_ALL with a payload"),
        pytest.param(m.MSG_MOTOR_RESET_POSITION, struct.pack("<Bi", 1, 5), id="RESET_POSITION"),
        pytest.param(m.MSG_MOTOR_JOG, struct.pack("<BHi", 1, 100, 5), id="JOG"),
        pytest.param(m.MSG_MOTOR_CONFIGURE, b"\x01\x01", id="CONFIGURE"),
        pytest.param(m.MSG_MOTOR_SET_SPEED, struct.pack("<BII", 1, 1000, 1000), id="SET_SPEED"),
        pytest.param(
            m.MSG_MOTOR_SET_LIMITS, struct.pack("<BBiBiB", 1, 0, 0, 0, 0, 0), id="SET_LIMITS"
        ),
    ],
)
def test_a_request_for_a_motor_is_acknowledged(both, kind, payload):
    assert is_ack(both, both.answer_to(kind, payload))


@pytest.mark.each_processor
def test_each_request_of_an_upload_is_acknowledged(both):
    for kind, payload in (
        (m.MSG_RT_UPLOAD_MOVE_BEGIN, struct.pack("<ii", 1, 3)),
        (m.MSG_RT_UPLOAD_MOVE_AXIS, struct.pack("<BI3i", 1, 0, 1, 2, 3)),
        (m.MSG_RT_UPLOAD_MOVE_END, b""),
        (m.MSG_RT_POSITION_FRAME, struct.pack("<i", 3)),
    ):
        assert is_ack(both, both.answer_to(kind, payload)), f"0x{kind:04X} {payload.hex()}"


@pytest.mark.parametrize("tail", [0, 2, 6], ids="{} bytes more".format)
def test_a_run_is_acknowledged_and_go_once(both, tail):
    both.upload({1: [1, 2, 3]})
    run = struct.pack("<IiiIIBIHH", 24000, 1, 3, 500, 500, 0, 0, 0, 0)
    assert is_ack(both, both.answer_to(m.MSG_RT_RUN_MOVE, run + bytes(tail)))
    both.wait_idle()
    assert is_ack(both, both.answer_to(m.MSG_RT_GO))
    assert is_ack(both, both.answer_to(m.MSG_RT_GO), p.Ack.ERR_MOVING)


@pytest.mark.parametrize(
    ("kind", "size"),
    [
        pytest.param(m.MSG_HI, 51, id="HI"),
        pytest.param(m.MSG_MOTOR_STATUS, 5, id="STATUS"),
        pytest.param(m.MSG_MOTOR_GET_POSITION, 4 + 4 * 8, id="GET_POSITION"),
    ],
)
def test_a_question_is_answered_by_data(both, kind, size):
    answer = both.answer_to(kind)
    assert not answer.is_ack
    assert answer.id == 77
    assert len(answer.payload) == size


def test_an_unknown_request_is_unsupported(both):
    assert is_ack(both, both.answer_to(0x0300), p.Ack.ERR_UNSUPPORTED)


def test_a_damaged_frame_is_answered_with_id_0(both):
    frames = both.bytes_for(bytes.fromhex("4446 00000000 0102 00 00 0000"))
    assert [(f.id, f.type) for f in frames] == [(0, 0x8201)]
    assert is_ack(both, frames[0], p.Ack.ERR_CHECKSUM)


def test_answer_to_a_move(both):
    """One status byte as specified, an acknowledgement in the dialect of dmc-lite (field note
    1.4)."""
    answer = both.answer_to(m.MSG_MOTOR_MOVE, struct.pack("<Bi", 2, 100))
    if both.dword_acks:
        assert is_ack(both, answer)
    else:
        assert not answer.is_ack
        assert answer.payload == b"\x01"
    both.wait_idle()
    answer = both.answer_to(m.MSG_MOTOR_MOVE, struct.pack("<Bi", 2, 100))
    assert is_ack(both, answer) if both.dword_acks else answer.payload == b"\x00"


# ---- MOVE ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("target", "velocity", "acceleration"),
    [
        (8000, 5000, 20000), (-3000, 9000, 30000), (1, 5000, 20000), (-2, 40, 7),
        (4000, 120_000, 400_000),
    ],
)  # fmt: skip
def test_move(rig, target, velocity, acceleration):
    rig.speed(3, velocity, acceleration).accept(p.MotorMove(3, target)).wait_idle()
    times, signs = rig.steps(3)
    assert rig.position(3) == target == signs.sum() == np.sign(target) * len(signs)
    if abs(target) > 2:
        assert_within(times, signs, velocity, acceleration)
    # as long as a trapezoid takes, or a triangle for a distance too short for one
    way = abs(target)
    ramp = velocity / acceleration
    ideal = way / velocity + ramp if way >= velocity * ramp else 2 * (way / acceleration) ** 0.5
    first = (2 / acceleration) ** 0.5 if way > 1 else ideal  # the first step, from rest
    # near rest at either end, a rounding of 2e-5 steps takes this long
    rounding = 2 * (2 * 2e-5 / acceleration) ** 0.5
    assert times[-1] - times[0] == pytest.approx(ideal - first, abs=1e-5 + rounding + 1e-5 * ideal)


def test_no_distance(both):
    """To its own position: an answer, no motion, no report, the same position."""
    both.accept(p.MotorResetPosition(1, -77)).run(0.1).forget()
    assert both.code(p.MotorMove(1, -77)) == p.Ack.OK
    assert both.moving == []
    both.run(0.5)
    assert both.position(1) == -77
    assert both.made(1) == 0
    assert both.events(p.Positions) == []


def test_retarget_farther_nearer_and_back(rig):
    """Field note 4.8: there is no stop if the distance is long enough, and the acceleration keeps
    its limit."""
    rig.accept(p.MotorMove(1, 4000)).run(0.5)
    rig.accept(p.MotorMove(1, 9000)).run(0.7)
    times, signs = rig.steps(1)
    inside = times > times[0] + 0.3
    assert np.diff(times[inside]).max() < 1 / 4900, "slowed down for a target that lies ahead"
    rig.accept(p.MotorMove(1, 8000)).run(0.3)
    rig.accept(p.MotorMove(1, -2000)).wait_idle()
    times, signs = rig.steps(1)
    assert rig.position(1) == -2000 == signs.sum()
    assert_within(times, signs, 5000, 20000)
    assert np.count_nonzero(np.diff(signs)) == 1, "turned more than once"


@pytest.mark.needs("prompt")
def test_retarget_nearer_than_it_can_stop(rig):
    """It overshoots by the length of the ramp and comes back."""
    rig.accept(p.MotorMove(1, 20000)).run(0.6)
    here = rig.made(1)
    rig.accept(p.MotorMove(1, here + 200)).wait_idle()
    times, signs = rig.steps(1)
    assert rig.position(1) == here + 200
    assert_within(times, signs, 5000, 20000)
    highest = np.cumsum(signs).max()
    assert highest == pytest.approx(here + 5000**2 / 40000, abs=5000 * 0.02)


def test_retarget_storm(rig):
    """A new target every 30 ms, with changes of speed between: steps and position agree, and limits
    are kept."""
    chance = np.random.default_rng(4)
    for target in chance.integers(-4000, 4000, 40):
        rig.accept(p.MotorMove(1, int(target))).run(float(chance.uniform(0.005, 0.08)))
    rig.wait_idle()
    times, signs = rig.steps(1)
    assert rig.position(1) == signs.sum() == target
    assert_within(times, signs, 5000, 20000)


@pytest.mark.each_processor
def test_large_positions(both):
    """Positions that are no small integers of a 32-bit MicroPython."""
    for start, target in (
        (FARTHEST - 300, FARTHEST),
        (LOWEST + 300, LOWEST),
        (2**30 - 5, 2**30 + 5),
    ):
        both.accept(p.MotorResetPosition(5, start))
        assert both.code(p.MotorMove(5, target)) == p.Ack.OK
        both.wait_idle()
        assert both.position(5) == target
    both.accept(p.MotorJog(5, 10000, FARTHEST), p.MotorStop(5))


def test_all_motors_at_once(rig):
    for motor in range(1, 9):
        rig.accept(p.MotorMove(motor, 700 * motor * (-1) ** motor))
    assert rig.moving == list(range(1, 9))
    rig.wait_idle()
    for motor in range(1, 9):
        target = 700 * motor * (-1) ** motor
        assert rig.made(motor) == rig.position(motor) == target
        assert_within(*rig.steps(motor), 5000, 20000)


def test_inverted_motor():
    """The rig file's `invert` changes the pin, not the counting."""
    rig = simulated({"motors": [{}, {"invert": True}]})
    for motor in (1, 2):
        rig.accept(p.MotorMove(motor, 50))
    rig.wait_idle()
    levels = {
        signal: values[-1]
        for signal, (_, values) in rig.trace().signals.items()
        if signal.startswith("dir")
    }
    assert levels == {"dir1": 1}  # motor 2's pin stays low
    assert rig.made(1) == rig.made(2) == 50 == rig.position(2)


# ---- reports -------------------------------------------------------------------------------------


def test_moving_bits(both):
    """Field note 4.7: set from the acknowledgement on, clear after the last step."""
    for motor, request in (
        (1, p.MotorMove(1, 300)),
        (3, p.MotorJog(3, 10000, -300)),
        (8, p.MotorMove(8, 1)),
    ):
        both.code(request)
        assert motor in both.moving
    assert both.ask(p.MotorStatus()).motor_bits == 0b10000101
    while both.moving:
        both.run(0.01)
    assert both.now - max(both.steps(motor)[0][-1] for motor in (1, 3)) > -0.001
    quiet = len(both.trace().steps(1)[0])
    both.run(0.2)
    assert len(both.trace().steps(1)[0]) == quiet


@pytest.mark.needs("prompt", only=("30",))
@pytest.mark.with_reports
@pytest.mark.parametrize("report_ms", [100, 30])
def test_positions_in_motion(report_ms):
    """Field note 4.6: every 100 ms while anything moves, and once more after the stop."""
    rig = simulated({"report_ms": report_ms})
    rig.run(0.5)
    assert rig.events(p.Positions) == [], "positions come though nothing moves"
    begun = rig.now
    rig.accept(p.MotorMove(1, 5000), p.MotorMove(4, -2500)).run(2)
    reports = rig.events(p.Positions)
    ends = max(rig.steps(motor)[0][-1] for motor in (1, 4))
    assert reports[0][0] - begun <= report_ms / 1000 + 0.003
    gaps = np.diff([time for time, _ in reports[:-1]])
    assert gaps == pytest.approx(report_ms / 1000, abs=0.0025)  # a whole pass comes every 2 ms
    times, signs = rig.steps(1)
    for time, message in reports[:-1]:
        # the report has the steps given to the engine, which makes them within 3 ms
        assert abs(message.steps[0] - signs[times <= time].sum()) <= 5000 * 0.003 + 1
    assert message.move_time == 0
    last, message = reports[-1]
    assert ends <= last <= ends + 0.01
    assert message.steps == (5000, 0, 0, -2500, 0, 0, 0, 0)
    assert rig.ask(p.MotorGetPosition()).steps == message.steps


# ---- STOP ----------------------------------------------------------------------------------------


def test_stop(rig):
    """The motor ramps down with its own acceleration; the others continue."""
    rig.speed(1, 6000, 30000).accept(p.MotorMove(1, 20000))
    rig.accept(p.MotorMove(2, 6000))
    rig.run(0.6).accept(p.MotorStop(1))
    asked = rig.now
    assert rig.moving == [1, 2]
    rig.wait_idle()
    times, signs = rig.steps(1)
    assert deceleration(times, signs, asked) == pytest.approx(30000, rel=0.01)
    assert times[-1] - asked == pytest.approx(6000 / 30000, abs=0.008)
    assert rig.position(1) == signs.sum()
    assert rig.position(2) == 6000
    rig.accept(p.MotorStop(1), p.MotorMove(1, 0)).wait_idle()
    assert rig.made(1) == 0


def test_stop_before_the_first_step(rig):
    rig.accept(p.MotorMove(1, 1000))
    rig.accept(p.MotorStop(1)).wait_idle()
    assert rig.made(1) == rig.position(1)
    assert rig.made(1) <= 2


@pytest.mark.parametrize("factor", [None, 2])
@pytest.mark.parametrize("flags", [None, 1])
def test_stop_all_once_and_twice(factor, flags):
    """Field note 4.4: a second one within 1000 ms decelerates `hard_stop_factor` times as
    steeply."""
    rig = simulated({"hard_stop_factor": factor} if factor else None)
    for motor, acceleration in ((1, 20000), (2, 8000)):
        rig.speed(motor, 5000, acceleration)

    def stop(times_asked, pause=0.0):
        rig.forget()
        for motor in (1, 2):
            rig.accept(p.MotorMove(motor, rig.position(motor) + 30000))
        rig.run(1)
        for _ in range(times_asked):
            rig.run(pause).accept(p.MotorStopAll(flags))
        asked = rig.now
        rig.wait_idle()
        assert all(rig.made(motor) for motor in (1, 2))
        rig.run(1.2)
        return [deceleration(*rig.steps(motor), asked) for motor in (1, 2)]

    assert stop(1) == pytest.approx([20000, 8000], rel=0.01)
    hard = factor or 4
    assert stop(2) == pytest.approx([hard * 20000, hard * 8000], rel=0.02)
    assert stop(1) == pytest.approx([20000, 8000], rel=0.01), "the third is a first one again"


def test_a_second_stop_all_too_late_is_a_first_one_again(rig):
    """Even while the motor still ramps down. One in time is hard (test_stops.py)."""
    rig.speed(1, 5000, 2000).accept(p.MotorMove(1, 60000)).run(3)
    rig.accept(p.MotorStopAll()).run(1.1)
    asked = rig.accept(p.MotorStopAll()).now
    rig.wait_idle()
    assert deceleration(*rig.steps(1), asked) == pytest.approx(2000, rel=0.02)


# ---- RESET_POSITION ------------------------------------------------------------------------------


def test_reset_position(both):
    """Field note 4.5: first the acknowledgement, then the report; nothing moves. In motion:
    0x12."""
    for value in (-5, 2**30, LOWEST, FARTHEST, 12345):
        both.forget().accept(p.MotorResetPosition(4, value)).run(0.05)
        ((_, message),) = both.events(p.Positions)
        assert message.steps[3] == value
        assert both.position(4) == value
    assert both.made(4) == 0
    both.code(p.MotorMove(4, 12345 + 2000))
    both.refuse(p.Ack.ERR_MOVING, p.MotorResetPosition(4, 0))
    both.accept(p.MotorResetPosition(5, 99)).wait_idle()
    assert both.position(4) == 14345
    assert both.made(4) == 2000
    assert both.position(5) == 99
    both.code(p.MotorMove(4, 12345))
    both.wait_idle()
    assert both.made(4) == 0


# ---- a lost host -------------------------------------------------------------------------


@pytest.mark.parametrize("jogging", [False, True])
def test_port_closed_in_motion(rig, jogging):
    """Field note 1.11: motors decelerate to a stop, and the next host finds them where their steps
    lead."""
    rig.accept(p.MotorMove(1, 30000))
    rig.code(p.MotorJog(2, 10000, LOWEST) if jogging else p.MotorMove(2, -30000))
    rig.run(0.4).leave()
    closed = rig.now
    rig.run(1)
    for motor in (1, 2):
        times, signs = rig.steps(motor)
        assert times[-1] - closed == pytest.approx(5000 / 20000, abs=0.008)
        assert deceleration(times, signs, closed) == pytest.approx(20000, rel=0.01)
    rig.come_back().forget()
    frames = rig.bytes_for(b"", 0.05)
    assert [f.type for f in frames] == [m.MSG_HI], (
        "what the last host did not read reaches the next"
    )
    assert rig.moving == []


def test_half_a_frame_of_a_lost_host(rig):
    """The beginning of its request does not hold up the next host's first request."""
    rig.port.write(b"DF\1\0\0\0\x31\0\x00\x04" + bytes(100))
    rig.run(0.02).leave().run(0.02).come_back()
    assert rig.code(p.MotorStop(1)) == p.Ack.OK
