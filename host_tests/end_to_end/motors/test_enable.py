"""`enable_ms`: a driver that has been switched on gets its time before the first step, whatever
moves the motor."""

import pytest

from framestep_tools import payloads as p
from host_tests.end_to_end.session import run_request, simulated

WAKE_MS = 300
SLOW = {"motors": [{"enable_ms": WAKE_MS}, {"enable_ms": 50}, {}]}
LONG_S = WAKE_MS / 1000


def rig(**more):
    return simulated({**SLOW, **more})


def move(session):
    session.accept(p.MotorMove(1, 400))


def jog(session):
    for _ in range(8):
        session.accept(p.MotorJog(1, 5000, 400))
        session.run(0.1)


def run_a_move(session):
    session.upload({1: list(range(0, 100, 10)), 2: list(range(0, 200, 20))})
    session.accept(run_request(end=10))
    session.run(LONG_S + 0.2)
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
        session.accept(p.MotorMove(1, 400))
        session.run(0.1)
        assert session.moving
        session.accept(stop)
        session.run(1)
        assert not len(session.steps(1)[0])


def test_drivers_on_one_pin_wake_up_together():
    """The Pico's enable pin is that of all drivers: the slowest counts, and only once."""
    session = rig()
    asked = session.now
    session.accept(p.MotorMove(3, 100))
    session.wait_idle()
    assert session.steps(3)[0][0] >= asked + LONG_S
    session.accept(p.MotorMove(1, 100))
    before = session.now
    session.wait_idle()
    assert session.steps(1)[0][0] < before + 0.05


def test_motors_of_a_run_start_together():
    session = rig()
    session.upload({1: list(range(0, 100, 10)), 2: list(range(0, 100, 10))})
    asked = session.now
    session.accept(run_request(end=10, pre=0))
    session.run(LONG_S - 0.1)
    session.refuse(p.Ack.ERR_NOT_IN_POSITION, p.RtGo())
    session.wait_idle()
    session.forget()
    session.accept(p.RtGo())
    session.wait_idle()
    first = [session.steps(motor)[0][0] for motor in (1, 2)]
    assert first[0] == pytest.approx(first[1], abs=1e-5)
    assert first[0] >= asked + LONG_S
