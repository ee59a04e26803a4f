"""`enable_ms`: a driver that has been switched on gets its time before the first step, whatever
moves the motor."""

import numpy as np
import pytest

from framestep.motors.positions import HOMED, KNOWN
from framestep.protocol import messages as m
from framestep_tools import payloads as p
from host_tests.end_to_end.motors.home_switches import LOW, Switch, home, rails, trust
from host_tests.end_to_end.session import run_request, simulated
from host_tests.end_to_end.virtual_axes.judging import NODAL, UNIT, assert_straight, configured

WAKE_MS = 300
SLOW = {"motors": [{"enable_ms": WAKE_MS}, {"enable_ms": 50}, {}]}
LONG_S = WAKE_MS / 1000


def rig(**more):
    return simulated({**SLOW, **more})


def move(session):
    session.accept(p.MotorMove(1, 400))


def jog(session):
    for _ in range(8):
        session.accept(p.MotorJog(1, 5000, 400)).run(0.1)


def run_a_move(session):
    session.upload({1: list(range(0, 100, 10)), 2: list(range(0, 200, 20))})
    session.accept(run_request(end=10)).run(LONG_S + 0.2)
    session.accept(p.RtGo())


@pytest.mark.parametrize("begin", [move, jog, run_a_move])
def test_the_first_step_waits(begin):
    session = rig()
    asked = session.now
    begin(session)
    session.wait_idle()
    times, _ = session.steps(1)
    assert len(times)
    assert times[0] >= asked + LONG_S
    session.accept(p.MotorMove(1, 1000))
    before = session.now
    session.wait_idle()
    times, _ = session.steps(1)
    later = times[times > before]
    assert later[0] < before + 0.05, "the driver is on already"


def test_a_stop_while_it_wakes_up_starts_nothing():
    for stop in (p.MotorStop(1), p.MotorStopAll()):
        session = rig()
        session.accept(p.MotorMove(1, 400)).run(0.1)
        assert session.moving
        session.accept(stop).run(1)
        assert not len(session.steps(1)[0])


def test_drivers_on_one_pin_wake_up_together():
    """The Pico's enable pin is that of all drivers: the slowest counts, and only once."""
    session = rig()
    asked = session.now
    session.accept(p.MotorMove(3, 100)).wait_idle()
    assert session.steps(3)[0][0] >= asked + LONG_S
    session.accept(p.MotorMove(1, 100))
    before = session.now
    session.wait_idle()
    assert session.steps(1)[0][0] < before + 0.05


def test_motors_of_a_run_start_together():
    session = rig()
    session.upload({1: list(range(0, 100, 10)), 2: list(range(0, 100, 10))})
    asked = session.now
    session.accept(run_request(end=10, pre=0)).run(LONG_S - 0.1)
    session.refuse(p.Ack.ERR_NOT_IN_POSITION, p.RtGo()).wait_idle().forget()
    session.accept(p.RtGo()).wait_idle()
    first = [session.steps(motor)[0][0] for motor in (1, 2)]
    assert first[0] == pytest.approx(first[1], abs=1e-5)
    assert first[0] >= asked + LONG_S


@pytest.mark.needs("inside")
def test_homing_waits():
    """Only before its first motion."""
    rig = {"motors": [{"enable_ms": WAKE_MS, "home": {"limit": 1, "travel": 3000, "speed": 2000}}]}
    session, _ = rails(Switch(1, LOW, -1700), rig=rig)
    asked = session.now
    home(session, 1)
    assert trust(session) == (KNOWN, HOMED)
    times, _ = session.steps(1)
    assert asked + LONG_S <= times[0] < asked + LONG_S + 0.1
    assert np.diff(times).max() < 0.25


@pytest.mark.needs("inside")
def test_a_stop_while_homing_waits():
    rig = {"motors": [{"enable_ms": WAKE_MS, "home": {"limit": 1, "travel": 3000}}]}
    session, rail = rails(Switch(1, LOW, -1700), rig=rig)
    session.accept(p.Home(b"\1")).run(0.1)
    assert session.moving == [1]
    session.accept(p.MotorStopAll()).run(1)
    assert not session.moving
    assert rail.steps == {}


SLOW_ARM = {"motors": [{}, {"enable_ms": WAKE_MS}]}


def test_a_virtual_move_waits_for_the_slowest():
    """All motors of it, and the camera then keeps to its line."""
    session = configured(NODAL, settings=SLOW_ARM)
    before = session.positions
    asked = session.now
    session.accept(p.VirtMove(m.VIRT_MOTOR_PAN, 60 * 100000))
    assert session.moving == [1, 2, 3, 4, 5, 6]
    session.wait_idle()
    firsts = [session.steps(motor)[0][:1] for motor in range(1, 7)]
    assert min(first[0] for first in firsts if len(first)) >= asked + LONG_S
    assert_straight(NODAL, session, before, UNIT[m.VIRT_MOTOR_PAN], 55)


def test_a_virtual_jog_waits():
    session = configured(NODAL, settings=SLOW_ARM)
    asked = session.now
    for _ in range(10):
        session.accept(p.VirtJog(m.VIRT_MOTOR_EW, 5000, 60_000)).run(0.1)
    session.accept(p.VirtStop(m.VIRT_MOTOR_EW)).wait_idle()
    times, _ = session.steps(1)
    assert len(times) > 100
    assert times[0] >= asked + LONG_S


@pytest.mark.parametrize(
    "stop", [p.MotorStopAll(), p.VirtStop(m.VIRT_MOTOR_PAN), p.MotorStop(1)], ids=str
)
def test_a_stop_while_a_virtual_move_waits(stop):
    session = configured(NODAL, settings=SLOW_ARM)
    session.accept(p.VirtMove(m.VIRT_MOTOR_PAN, 60 * 100000)).run(0.1)
    session.accept(stop).run(1.5)
    assert not session.moving
    assert all(len(session.steps(motor)[0]) == 0 for motor in range(1, 7))
