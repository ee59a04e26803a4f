"""CONFIGURE, SET_SPEED and SET_LIMITS on the host simulation."""

import numpy as np
import pytest

from framestep.hal.host import CLOCK_HZ
from framestep.protocol import messages as m
from framestep_tools import payloads as p
from host_tests.end_to_end.session import assert_within, simulated

FARTHEST, LOWEST = 2**31 - 1, -(2**31)


@pytest.mark.needs("boards")
def test_configure(both):
    """A motor that is not enabled does not move; its driver's pin says so."""
    both.accept(p.MotorConfigure(2, m.MOTOR_ENABLED | m.MOTOR_BLUR), p.MotorConfigure(3, 0))
    both.refuse(p.Ack.ERR_GENERAL, p.MotorMove(3, 100), p.MotorJog(3, 100, 100)).run(0.1)
    assert both.made(3) == 0
    assert both.moving == []
    both.accept(p.MotorConfigure(3, m.MOTOR_ENABLED))
    assert both.code(p.MotorMove(3, 100)) == p.Ack.OK
    both.refuse(p.Ack.ERR_MOVING, p.MotorConfigure(3, 0)).wait_idle()
    assert both.position(3) == both.made(3) == 100
    both.accept(p.MotorConfigure(3, 0))
    assert both.trace().signals["enable3"][1].tolist() == [0, 1, 0]
    both.accept(p.MotorConfigure(8, 0x0F))
    both.refuse(p.Ack.ERR_RANGE, p.MotorConfigure(0, 1), p.MotorConfigure(9, 1))


def test_set_speed_refused(both):
    """Velocity 0, and more than the board's pulses allow: 500 000 steps/s with pulses of 1 µs, high
    and low."""
    for velocity in (0, 500_001, 2**30, 2**31, 2**32 - 1):
        both.refuse(p.Ack.ERR_RANGE, p.MotorSetSpeed(1, velocity, 1000))
    both.refuse(p.Ack.ERR_RANGE, p.MotorSetSpeed(0, 1000, 1000), p.MotorSetSpeed(9, 1000, 1000))
    both.code(p.MotorMove(1, 4000))
    both.wait_idle()
    times, _ = both.steps(1)
    assert 1 / np.diff(times).min() == pytest.approx(5000, rel=2e-3), "a refused speed is in force"


@pytest.mark.needs("short pulses")
@pytest.mark.needs("cycles", only=("1.1-",))
@pytest.mark.needs("boards", only=("30-", "50-"))  # a chip's own cycles take a little more
@pytest.mark.parametrize(
    ("pulse_us", "fastest"),
    [
        (0.25, 500_000),
        (1.0, 500_000),
        (1.1, {125: 416_666, 100: 400_000, 75: 375_000}),  # by MHz of the pulse engine
        (4.0, 125_000),
        (30, 16_666),
        (50, 10_000),
    ],
    ids=lambda value: "by clock" if isinstance(value, dict) else str(value),
)
def test_fastest_speed_depends_on_the_pulse(pulse_us, fastest):
    """High for at least as long as asked, in whole steps of 25 cycles, and low for as long."""
    rig = simulated({"motors": [{"pulse_us": pulse_us}]})
    if isinstance(fastest, dict):
        fastest = fastest[getattr(rig.board, "engine_mhz", CLOCK_HZ // 1_000_000)]
    rig.refuse(p.Ack.ERR_RANGE, p.MotorSetSpeed(1, fastest + 1, 1000)).speed(1, fastest, 4_000_000)
    way = int(fastest**2 / 4_000_000 + fastest / 20)
    rig.accept(p.MotorMove(1, way)).wait_idle()
    times, _ = rig.steps(1)
    assert len(times) == way
    assert 1 / np.median(np.diff(times)[way // 2 - 1000 :][:2000]) == pytest.approx(
        fastest, rel=0.01
    )


@pytest.mark.needs("short pulses", only=("480000",))
@pytest.mark.parametrize(
    ("velocity", "acceleration", "expected"),
    [
        (4000, 0, 2000), (10, 0, 5), (1, 0, 5), (3, 40, 40), (1000, 2**32 - 1, None),
        (480_000, 4_000_000, None),
    ],
)  # fmt: skip
def test_set_speed(rig, velocity, acceleration, expected):
    """Field note 4.1: acceleration 0 is half the velocity, and the minimum velocity is 10
    steps/s."""
    rig.speed(1, velocity, acceleration)
    top = max(velocity, 10)
    way = int(top * 1.5 * (top / expected if expected else 0.1)) + 30
    rig.accept(p.MotorMove(1, way)).wait_idle(200)
    times, signs = rig.steps(1)
    assert len(times) == way == rig.position(1)
    assert 1 / np.diff(times).min() == pytest.approx(top, rel=0.01)
    if expected:
        ideal = way / top + top / expected - (2 / expected) ** 0.5
        assert times[-1] - times[0] == pytest.approx(ideal, rel=0.003, abs=0.002)
        assert_within(times, signs, top, expected)


def test_set_speed_in_motion(rig):
    """It counts for the next motion; the present one ends at its target."""
    rig.accept(p.MotorMove(1, 6000)).run(0.5).speed(1, 1000, 2000).wait_idle()
    assert rig.made(1) == 6000
    rig.forget().accept(p.MotorMove(1, 4000)).wait_idle()
    assert_within(*rig.steps(1), 1000, 2000)


def test_soft_limits(both):
    """Field note 4.3: 0x20 above, 0x21 below, and nothing moves; a motor past a limit may
    return."""
    both.accept(p.MotorSetLimits(1, 1, -500, 1, 800))
    for target, code in (
        (801, p.Ack.ERR_SOFT_UP),
        (FARTHEST, p.Ack.ERR_SOFT_UP),
        (-501, p.Ack.ERR_SOFT_LOW),
    ):
        both.refuse(code, p.MotorMove(1, target))
    both.refuse(p.Ack.ERR_SOFT_LOW, p.MotorMove(1, LOWEST)).run(0.1)
    assert both.moving == []
    assert both.made(1) == 0
    for target in (800, -500, 0):
        assert both.code(p.MotorMove(1, target)) == p.Ack.OK
        both.wait_idle()
        assert both.position(1) == target
    both.accept(p.MotorResetPosition(1, 2000))
    both.refuse(p.Ack.ERR_SOFT_UP, p.MotorMove(1, 2001))
    for target in (1500, 900, 800):
        assert both.code(p.MotorMove(1, target)) == p.Ack.OK, (
            "may move back toward the allowed range"
        )
        both.wait_idle()
        assert both.position(1) == target
    both.refuse(p.Ack.ERR_SOFT_UP, p.MotorMove(1, 801))
    both.accept(p.MotorResetPosition(1, -2000))
    both.refuse(p.Ack.ERR_SOFT_LOW, p.MotorMove(1, -2001))
    both.refuse(p.Ack.ERR_SOFT_UP, p.MotorMove(1, 900))
    assert both.code(p.MotorMove(1, -600)) == p.Ack.OK


def test_limits_off_and_one_sided(rig):
    rig.accept(p.MotorSetLimits(1, 0, 10, 1, 500))
    rig.refuse(p.Ack.ERR_SOFT_UP, p.MotorMove(1, 501))
    rig.accept(p.MotorMove(1, -300))
    rig.wait_idle().accept(p.MotorSetLimits(1, 0, 10, 0, -10))
    rig.accept(p.MotorMove(1, 600)).wait_idle()
    assert rig.position(1) == 600


def test_limits_refused(both):
    """Limits that cross, a flag other than 0 or 1, a limit set that the rig does not have."""
    both.accept(p.MotorSetLimits(1, 1, -100, 1, 100))
    both.refuse(
        p.Ack.ERR_RANGE,
        p.MotorSetLimits(1, 1, 101, 1, 100),
        p.MotorSetLimits(1, 1, FARTHEST, 1, LOWEST),
    )
    both.refuse(p.Ack.ERR_RANGE, p.MotorSetLimits(0, 1, 0, 1, 1), p.MotorSetLimits(9, 1, 0, 1, 1))
    both.refuse(
        p.Ack.ERR_RANGE,
        p.MotorSetLimits(1, 2, -300, 1, 300),
        p.MotorSetLimits(1, 1, -300, 255, 300),
    )
    both.refuse(p.Ack.ERR_RANGE, p.MotorSetLimits(1, 1, -300, 1, 300, limit_set=3))
    both.refuse(p.Ack.ERR_SOFT_UP, p.MotorMove(1, 101))
    both.refuse(p.Ack.ERR_SOFT_LOW, p.MotorMove(1, -101))
    both.accept(p.MotorSetLimits(1, 1, 50, 1, 50), p.MotorSetLimits(1, 1, LOWEST, 1, FARTHEST))


def test_no_such_motor(both):
    for motor in (0, 9, 32, 255):
        both.refuse(
            p.Ack.ERR_RANGE,
            p.MotorMove(motor, 5),
            p.MotorStop(motor),
            p.MotorResetPosition(motor, 5),
        )
