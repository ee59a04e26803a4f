"""`off_after_s`: drivers of motors that have been at rest are switched off, and their positions are
held."""

import numpy as np
import pytest

from framestep.motors.positions import DRIVER_OFF, HELD, KNOWN, SET
from framestep.protocol import messages as m
from framestep_tools import payloads as p
from framestep_tools.payloads import VirtMove
from host_tests.end_to_end.motors.home_switches import trust
from host_tests.end_to_end.session import run_request, simulated
from host_tests.end_to_end.virtual_axes.judging import XYZ, configured

AFTER = 3


def enables(session, motor=1):
    return [
        (time_ns * 1e-9, value)
        for time_ns, signal, value in session.board.edges()
        if signal == f"enable{motor}"
    ]


def rig(*after, **more):
    return simulated(
        {"motors": [{"off_after_s": s} for s in after], "motor_count": 4, **more}, motors=4
    )


def move(session, motor=1, to=200):
    session.accept(p.MotorResetPosition(motor, 0), p.MotorMove(motor, to)).wait_idle().forget()


@pytest.mark.needs("boards")
def test_it_is_switched_off_at_rest_and_on_for_the_next_motion():
    session = rig(AFTER)
    move(session)
    rested = session.now
    session.run(AFTER - 0.4)
    assert enables(session) == []
    assert trust(session) == (KNOWN, SET)
    session.run(0.8)
    ((at, on),) = enables(session)
    assert on == 0
    assert AFTER - 0.2 <= at - rested <= AFTER + 0.3
    assert trust(session) == (HELD, DRIVER_OFF)
    assert session.events(p.Positions), "the host is told"
    session.run(10).forget().accept(p.MotorMove(1, 0)).wait_idle()
    assert [on for _, on in enables(session)] == [1]
    assert trust(session) == (HELD, DRIVER_OFF), "somebody may have turned it"


def test_short_motions_and_jogs_count():
    session = rig(AFTER)
    move(session)
    for i in range(6):
        session.run(AFTER - 1).accept(p.MotorJog(1, 1000, 1000 * (-1) ** i)).run(0.03)
        session.accept(p.MotorStop(1)).wait_idle()
    assert enables(session) == []


def test_0_is_never():
    session = rig(0, AFTER)
    move(session, 1)
    session.run(20)
    assert enables(session) == []


@pytest.mark.needs("boards")
def test_drivers_on_one_pin_go_off_together():
    """The slowest counts, and a motor that is never switched off keeps all."""
    session = rig(AFTER, 3 * AFTER, 0)
    move(session, 1)
    move(session, 2)
    session.run(2 * AFTER)
    assert enables(session, 1) == enables(session, 2) == []
    session.run(1.5 * AFTER)
    assert [on for _, on in enables(session, 1)] == [0]
    assert trust(session, 1) == trust(session, 2) == (HELD, DRIVER_OFF)
    for motor in (1, 2, 3):
        move(session, motor)
    session.run(5 * AFTER)
    assert enables(session, 1) == enables(session, 2) == []


@pytest.mark.parametrize("state", ["waits", "runs"])
def test_never_while_an_operation_is_prepared_or_runs(state):
    session = rig(AFTER, AFTER)
    move(session, 2)
    session.upload({1: np.arange(0, 240, 10)})
    request = run_request(2, 1, 24, 500, 500) if state == "runs" else run_request(24, 1, 24)
    session.ready(request).forget()
    if state == "runs":
        session.accept(p.RtGo())
    session.run(AFTER + 4)
    assert enables(session, 1) == enables(session, 2) == []
    session.accept(p.MotorStopAll()).wait_idle().run(AFTER + 1)
    assert trust(session, 2) == (HELD, DRIVER_OFF)


def test_coupled_motors_stay_on():
    session = rig(AFTER, AFTER)
    session.accept(p.MotorConfigure(1, 0x11))
    move(session)
    session.run(3 * AFTER)
    assert enables(session, 1) == enables(session, 2) == []
    session.accept(p.MotorConfigure(1, 0x01)).run(2 * AFTER)
    assert trust(session) == (HELD, DRIVER_OFF)


def test_motors_of_a_virtual_axis_stay_on():
    """Others do not, where each driver has a pin of its own."""
    settings = {"motors": [{"off_after_s": AFTER}] * 7}
    session = configured(XYZ, settings=settings)
    session.accept(VirtMove(m.VIRT_MOTOR_EW, 20 * 100000)).wait_idle().forget().run(3 * AFTER)
    assert all(enables(session, motor) == [] for motor in range(1, 8))


@pytest.mark.needs("boards")
def test_a_host_that_has_switched_it_off():
    session = rig(AFTER)
    move(session)
    session.accept(p.MotorConfigure(1, 0)).forget().run(2 * AFTER)
    assert enables(session) == []
    session.accept(p.MotorConfigure(1, 1)).run(AFTER + 1)
    assert [on for _, on in enables(session)] == [1, 0]
