"""Servos as motors on the host simulation, judged from the edges of their pulses."""

import numpy as np
import pytest

from framestep.hal.host import HostFlash
from framestep.motors.positions import KNOWN, LOST, SERVO
from framestep.protocol import messages as m
from framestep_tools import payloads as p
from framestep_tools.simulator.boards import SimulatedBoard
from host_tests.end_to_end.session import Session, assert_follows, pulses, run_request, simulated

pytestmark = pytest.mark.needs("servos")

LEAST_US = 0.4  # a 64th of a step, and the rounding of the mapping


def rig(**servo):
    return {"motors": [{}, {"servo": servo}]}


def test_refusals_name_its_ends(said):
    board = simulated(rig(low=0, high=900)).board
    assert "1000 is past the upper end of motor 2, a servo" in said(board, "move 2 1000", status=7)
    assert "so its position cannot be set" in said(board, "zero 2 5", status=7)


def enable(session, motor=2, flags=m.MOTOR_ENABLED):
    session.accept(p.MotorConfigure(motor, flags))


@pytest.mark.needs("boards")
@pytest.mark.provokes("positions")  # the observers count from 0
@pytest.mark.parametrize("was", [400, 50_000])
def test_a_position_that_no_pulse_means_is_not_restored(was):
    flash = HostFlash()
    before = Session(SimulatedBoard({"remember_positions": True}, 2, flash=flash), 2)
    before.accept(p.MotorResetPosition(2, was)).run(2.1)
    settings = {"remember_positions": True, **rig(low=-500, high=500)}
    session = Session(SimulatedBoard(settings, 2, flash=flash), 2)
    assert session.position(2) == (was if was == 400 else 0)
    session.accept(p.MotorMove(2, 100)).wait_idle()
    assert session.position(2) == 100


@pytest.mark.needs("servo edges")
def test_no_pulses_before_it_is_to_move():
    session = simulated(rig())
    session.run(0.2)
    assert len(pulses(session)[0]) == 0
    session.accept(p.MotorMove(2, 500)).wait_idle().run(0.1)
    rises, widths = pulses(session)
    assert widths[0] == pytest.approx(1500, abs=5)
    assert widths[-3:] == pytest.approx([1750] * 3, abs=LEAST_US)
    assert np.diff(rises) == pytest.approx(0.02, abs=1e-5)  # a chip divides its clock


@pytest.mark.needs("boards", "servo edges")
def test_pulses_from_power_up():
    session = simulated(rig(at_start="on", rate_hz=333, low=0, high=900, low_us=600, high_us=2400))
    session.run(0.1)
    rises, widths = pulses(session)
    assert len(widths) > 30
    assert widths == pytest.approx(600, abs=LEAST_US)
    assert np.diff(rises) == pytest.approx(0.003, abs=1e-6)


@pytest.mark.needs("servo edges")
@pytest.mark.parametrize("invert", [False, True])
def test_ends_of_the_range(invert):
    settings = rig(low=-300, high=700)
    settings["motors"][1]["invert"] = invert
    session = simulated(settings)
    for code, beyond in ((m.ERR_SOFT_UP, 701), (m.ERR_SOFT_LOW, -301)):
        session.refuse(code, p.MotorMove(2, beyond))
    # the host's limits count only within the range
    session.accept(p.MotorSetLimits(2, 1, -9000, 1, 9000, 0))
    session.refuse(m.ERR_SOFT_UP, p.MotorMove(2, 701))
    for target, width in ((700, 2000), (-300, 1000)):
        session.accept(p.MotorMove(2, target)).wait_idle().run(0.1)
        assert pulses(session)[1][-1] == pytest.approx(3000 - width if invert else width, abs=1e-3)
    session.accept(p.MotorSetLimits(2, 1, -100, 1, 200, 0))
    session.refuse(m.ERR_SOFT_UP, p.MotorMove(2, 201))


@pytest.mark.needs("servo edges")
@pytest.mark.parametrize("invert", [False, True])
def test_widths_with_many_steps(invert):
    """Each position's width is exact to a cycle of the engine, 8 ns, up to the longest."""
    settings = rig(low=-30000, high=30000, low_us=500, high_us=2500)
    settings["motors"][1]["invert"] = invert
    session = simulated(settings)
    session.speed(2, 60000, 10_000_000)
    for position in (30000, 29999, 12345, -1, -29998, -30000):
        session.accept(p.MotorMove(2, position)).wait_idle().run(0.1)
        wanted = 1500 + position / 30 * (-1 if invert else 1)
        assert pulses(session)[1][-1] == pytest.approx(wanted, abs=0.0081), position


def test_jog_ends_at_the_range():
    session = simulated(rig())
    for _ in range(20):
        session.accept(p.MotorJog(2, 10000, 30000)).run(0.1)
    assert session.position(2) == 1000
    assert pulses(session)[1].max() <= 2000.01


@pytest.mark.needs("servo edges")
def test_widths_follow_an_uploaded_move():
    """Each pulse has the position at its time, between frames as well."""
    session = simulated(rig(low=-1000, high=1000, low_us=1000, high_us=2000))
    frames = 48
    x = np.arange(frames) / frames
    path = np.round(600 * np.sin(2 * np.pi * x)).astype(int)
    session.speed(1, 20000, 200000).speed(2, 20000, 200000)
    # motor 1, a step motor, does the same: its steps are the measure
    session.upload({1: path.tolist(), 2: path.tolist()}).forget()
    before = session.play(run_request(end=frames))
    session.run(0.1)
    _, widths = pulses(session)
    assert len(widths) > 90
    assert widths.max() > 1790
    assert_follows(session, before[1], 2)
    assert len(session.steps(2)[0]) == 0


@pytest.mark.needs("servo edges")
def test_finer_than_a_step():
    """With 20 µs per step a slow motion passes widths between steps."""
    session = simulated(rig(low=-50, high=50))
    session.speed(2, 20, 1000).accept(p.MotorMove(2, 10)).wait_idle()
    widths = pulses(session)[1]
    moving = widths[(widths > 1510) & (widths < 1590)]
    assert np.abs(np.diff(moving)).max() < 5


def test_position_cannot_be_set():
    """The pulse determines it: with another number the servo would have to jump."""
    session = simulated(rig())
    session.accept(p.MotorMove(2, 100)).wait_idle()
    session.refuse(m.ERR_RANGE, p.MotorResetPosition(2, 0))
    session.accept(p.MotorResetPosition(2, 100), p.MotorResetPosition(1, 7))
    assert session.position(2) == 100


@pytest.mark.needs("inside")
def test_it_is_always_known():
    session = simulated(rig())
    positions = session.board._board.controller.axes.positions
    assert positions.states[0] == LOST
    enable(session, flags=0)
    assert (positions.states[1], positions.reasons[1]) == (KNOWN, SERVO)


def test_disabled_it_has_no_pulses():
    session = simulated(rig())
    enable(session)
    session.run(0.1)
    assert len(pulses(session)[1]) >= 4
    enable(session, flags=0)
    session.run(0.05).forget().run(0.2)
    assert len(pulses(session)[1]) == 0
    session.refuse(m.ERR_GENERAL, p.MotorMove(2, 10))


@pytest.mark.parametrize("on_stop", ["hold", "release"])
def test_emergency_stop(on_stop):
    settings = rig(on_stop=on_stop) | {"estop": "no"}
    session = simulated(settings)
    session.accept(p.MotorMove(2, 900)).run(0.1).input("estop", 0).run(0.5)
    assert not session.moving
    session.forget().run(0.2)
    widths = pulses(session)[1]
    assert len(widths) >= 9 if on_stop == "hold" else len(widths) == 0
    session.input("estop", 1).run(0.1).accept(p.MotorMove(2, 0)).wait_idle()
    session.run(0.1)
    assert pulses(session)[1][-1] == pytest.approx(1500, abs=LEAST_US)


@pytest.mark.needs("inside")
def test_fault_releases_it():
    session = simulated(rig(on_stop="release", at_start="on"))
    enable(session)
    session.run(0.1)
    assert len(pulses(session)[1])
    session.board._board.hal.taken = 0  # the REPL has taken pins
    session.run(0.2).forget().run(0.2)
    assert len(pulses(session)[1]) == 0
