"""Servos in motions of several motors: coupled, in go-motion, as virtual axes. The reference is a
step motor with the same requests."""

import numpy as np
import pytest

from framestep.protocol import messages as m
from framestep_tools import payloads as p
from framestep_tools.judge.virtual_reference import Axis, Rig
from host_tests.end_to_end.session import assert_follows, pulses, simulated
from host_tests.end_to_end.virtual_axes.judging import UNIT, assert_straight, configured, joints

pytestmark = pytest.mark.needs("servos", "servo edges")

STEPS_PER_US = 2  # of a servo with default settings: -1000 at 1000 µs, 1000 at 2000 µs
COUPLE = {1: 0x10, -1: 0x20}
PAN = 4
# Its servo turns slightly more than 30 degrees either way, 100 steps each
RIG = Rig(
    4,
    (*(Axis(i, 1000.0) for i in (1, 2, 3)), Axis(PAN, 100.0), Axis(5, 1000.0), Axis(6, 1000.0)),
    nodal=(20.0, 35.5, -12.0),
)
SERVO = {"low": -3000, "high": 3000}


@pytest.mark.parametrize("sense", [1, -1])
@pytest.mark.parametrize("servo", [1, 2])
def test_coupled_with_a_step_motor(servo, sense):
    """It may be the leader or the other motor of the pair; its range counts for both. The other
    motor's range is a step shorter at the lower end, for the rounding of its play."""
    motors = [{}, {}]
    motors[servo - 1] = {"servo": {}}
    session = simulated({"motors": motors})
    session.accept(p.MotorConfigure(1, m.MOTOR_ENABLED | COUPLE[sense])).run(0.1)
    session.refuse(m.ERR_SOFT_UP, p.MotorMove(1, 1001))
    session.refuse(m.ERR_SOFT_LOW, p.MotorMove(1, -1001)).forget()
    for target in (700, -999):
        session.accept(p.MotorMove(1, target)).wait_idle().run(0.1)
    assert len(pulses(session, servo)[1]) > 40
    assert_follows(session, 0, STEPS_PER_US, motor=3 - servo, servo=servo, sense=sense)
    session.accept(p.MotorJog(1, 10_000, 2**31 - 1)).run(0.2)
    session.accept(p.MotorStop(2)).wait_idle().run(0.1)
    assert -1000 < session.position(1) < 1000
    assert_follows(session, 0, STEPS_PER_US, motor=3 - servo, servo=servo, sense=sense)


def test_in_go_motion():
    """It passes its window while the shutter is open, and stays within its range during the
    run-up."""
    session = simulated({"motors": [{}, {"servo": {}}]})
    for motor in (1, 2):
        session.accept(p.MotorConfigure(motor, m.MOTOR_ENABLED | m.MOTOR_BLUR))
    session.upload({1: [0] * 10, 2: [0] * 10})

    def shot(low, high):
        return p.RtShootFrame(5, 1, 500, 1000, [p.BlurMotor(n, low, high) for n in (1, 2)])

    # at 1200 steps/s the motors move on for 600 steps after the exposure (field note 7.1)
    session.refuse(m.ERR_POSTROLL, shot(100, 700))
    session.refuse(m.ERR_PREROLL, shot(-700, -100))
    session.ready(shot(-150, 200))
    before = session.positions
    assert before[1] == before[2] < -150
    session.forget().accept(p.RtGo()).until(p.RtEnd, 60).run(0.3)
    assert session.position(2) > 200
    assert_follows(session, before[1], STEPS_PER_US)
    (opened, closed), levels = session.trace().signals["shutter"]
    assert levels.tolist() == [1, 0]
    rises, widths = pulses(session)
    steps = (widths - 1500) * STEPS_PER_US
    inside = (rises > opened * 1e-9) & (rises < closed * 1e-9)
    assert inside.sum() >= 24
    # a pulse has the position at its end, or up to two milliseconds later
    passed = -150 + 700 * (rises + widths * 1e-6 - opened * 1e-9)[inside]
    assert np.all(steps[inside] > passed - 1.1)
    assert np.all(steps[inside] < passed + 700 * 0.0022 + 1.1)


@pytest.mark.needs("prompt")
def test_as_a_virtual_axis():
    """The camera's pan is a servo: with a nodal offset all axes turn about it."""
    settings = {"motors": [{}, {}, {}, {"servo": SERVO}]}
    session, beside = configured(RIG, settings=settings), configured(RIG)
    before = session.positions
    assert beside.positions == before
    number = m.VIRT_MOTOR_PAN
    for each in (session, beside):
        each.accept(p.VirtMove(number, 25 * 100_000)).wait_idle().run(0.1)
    assert_straight(RIG, beside, before, UNIT[number], 25)
    assert session.positions == beside.positions
    assert_follows(session, 0, 6, motor=PAN, servo=PAN, beside=beside)
    for motor in (1, 2, 3):  # and the others' steps are the same
        for found, expected in zip(session.steps(motor), beside.steps(motor), strict=True):
            np.testing.assert_array_equal(found, expected)
    # 30 degrees are its end
    session.refuse(m.ERR_SOFT_UP, p.VirtMove(number, 31 * 100_000))
    session.accept(p.VirtJog(number, 10_000, 2**31 - 1)).run(0.1)
    while session.moving:
        session.ask(p.VirtJog(number, 10_000, 2**31 - 1))
        session.run(0.1)
    session.run(0.1)
    pan = joints(RIG, np.array(list(session.positions.values())))[3]
    assert 28 < pan <= 30
    assert pulses(session, PAN)[1].max() <= 2000.01
