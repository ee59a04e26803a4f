"""No tick comes late and no queue runs dry, whatever is requested in motion: on the emulated board
with its flash cache, at the slower clock."""

import pytest

from framestep.protocol import messages as m
from framestep_tools import payloads as p
from framestep_tools.judge.virtual_reference import Axis, Rig
from host_tests.end_to_end.session import Session
from host_tests.end_to_end.virtual_axes.judging import BOOM_NODAL, XYZ
from host_tests.observers.timing import Timing

ESTOP, LIMIT = 19, 22
RIG = {"estop": "nc", "limits": [{"high": LIMIT, "contact": "nc"}]}
VELOCITY, ACCELERATION = 20_000, 50_000
FAR = 2**31 - 1
QUEUED_MS = 50  # queues must last for this; in 200 jogs of any rigs they lasted for 65 ms
MOTORS = range(1, 9)


@pytest.fixture(scope="module")
def session(chip):
    with chip.emulated({**RIG, "clock_mhz": chip.slow_mhz}) as board:
        board.wire_switches()
        session = Session(board, reply_s=0.2)
        session.timing = Timing(session)
        yield session


def speeds(session, velocity, acceleration, motors=MOTORS):
    for motor in motors:
        session.speed(motor, velocity, acceleration)


def configured(session, rig, velocity=VELOCITY, acceleration=ACCELERATION):
    for axis in rig.axes:
        if axis.motor:
            session.speed(axis.motor, velocity, acceleration)
            session.accept(p.MotorResetPosition(axis.motor, axis.step))
    session.accept(p.VirtConfig.unpack(rig.payload())).forget()


@pytest.mark.parametrize(
    "stop", [p.VirtStop(m.VIRT_MOTOR_EW), p.MotorStopAll()], ids=["VIRT_STOP", "STOP_ALL"]
)
@pytest.mark.parametrize(
    "rig",
    [
        pytest.param(BOOM_NODAL, id="type 1"),
        pytest.param(XYZ, id="type 4", marks=pytest.mark.repeats),
    ],
)
def test_a_virtual_move_is_stopped(session, rig, stop):
    configured(session, rig)
    with session.timing.judged():
        for moment in (0.3, 0.41, 0.52):
            session.accept(p.VirtMove(m.VIRT_MOTOR_EW, 120 * 100_000)).run(moment)
            session.accept(stop).wait_idle()
            session.accept(p.VirtMove(m.VIRT_MOTOR_EW, 0)).wait_idle()


@pytest.mark.parametrize("kind", [1, 3])
@pytest.mark.parametrize(
    ("steps", "velocity", "acceleration"),
    [
        pytest.param(100.0, 8000, 40_000, marks=pytest.mark.repeats),
        (500.0, 20_000, 100_000),
    ],
)
def test_a_virtual_jog_of_fast_motors_is_planned_in_time(
    session, kind, steps, velocity, acceleration
):
    """Its survey continues while the queues hold little."""
    pose = (0.0, 0.0, 500.0, 20.0, 0.0, 0.0)
    axes = tuple(Axis(i, steps, at) for i, at in enumerate(pose, 1))
    rig = Rig(kind, axes, length=800.0, extension=50.0, nodal=(0.0, 50.0, 10.0))
    configured(session, rig, velocity, acceleration)
    with session.timing.judged():
        for sign in (1, -1):
            for _ in range(5):
                session.accept(p.VirtJog(m.VIRT_MOTOR_EW, 10_000, sign * FAR))
                session.timing.run(0.25)
            session.accept(p.VirtStop(m.VIRT_MOTOR_EW)).wait_idle()
        assert session.timing.least_queued >= QUEUED_MS


def test_runs_moves_and_stops(session):
    session.accept(p.VirtConfig.unpack(b"\0"))
    speeds(session, VELOCITY, ACCELERATION)
    begins = session.positions
    with session.timing.judged():
        for factor in (1, 2):
            for motor in MOTORS:
                session.accept(p.MotorMove(motor, begins[motor] + factor * 5000))
            session.run(0.3)
            for motor in MOTORS:
                session.accept(
                    p.MotorStop(motor) if factor == 1 else p.MotorMove(motor, begins[motor])
                )
            session.accept(p.MotorStopAll()).wait_idle()
        for motor in MOTORS:
            session.accept(p.MotorJog(motor, 10_000, FAR))
        session.wait_idle()


def test_switches(session):
    """The E-stop with all motors, a limit switch with a coupled pair, and both at once, at any time
    before a tick."""
    session.accept(p.VirtConfig.unpack(b"\0"))
    speeds(session, VELOCITY, 4 * ACCELERATION)
    for motor in MOTORS:
        session.accept(p.MotorResetPosition(motor, 0), p.MotorSetLimits(motor, 0, 0, 0, 0, 1))
    session.accept(p.MotorConfigure(1, 1 | 0x20))
    as_told = []
    with session.timing.judged(stops=True):
        for pins, apart_us in (((ESTOP,), 50), ((LIMIT,), 50), ((ESTOP, LIMIT), 25)):
            for before_us in range(300, 0, -apart_us):
                for motor in MOTORS:
                    if motor != 2:
                        session.accept(p.MotorMove(motor, session.position(motor) + 8000))
                session.run(0.15)
                session.timing.wait_for_tick(before_us)
                for level in (1, 0, 1):  # they bounce
                    for pin in pins:
                        session.board.emulator.set_pin(pin, level)
                    session.run(0.0013)
                session.wait_idle()
                reason = session.events(p.HardStop)[0][1].reason
                as_told.append(reason == (0 if ESTOP in pins else 1))
                session.forget()
                for pin in pins:
                    session.board.emulator.set_pin(pin, 0)
                session.run(0.1)
    assert all(as_told)
    session.accept(p.MotorConfigure(1, 1))
