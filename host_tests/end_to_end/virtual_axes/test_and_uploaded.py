"""Virtual motion of motors that also have an uploaded move: a motor belongs to one motion at a
time, in any order of requests."""

import numpy as np
import pytest

from framestep.protocol import messages as m
from framestep_tools import payloads as p
from framestep_tools.client.wire import encode
from framestep_tools.judge.virtual_reference import Axis, Rig
from host_tests.end_to_end.realtime import FRAMES, upload
from host_tests.end_to_end.session import assert_within, run_request, simulated

VELOCITY, ACCELERATION = 2000, 4000
CAMERA = Rig(4, tuple(Axis(motor, 100.0) for motor in (1, 2, 0, 3, 4, 0)))
RUN = run_request(24, 1, FRAMES)
STARTS = [p.VirtMove(m.VIRT_MOTOR_EW, 2_000_000), p.VirtJogOnLine(m.LINE_X, 10000)]
OPERATIONS = [
    RUN,
    p.RtJogAll(24000, 5),
    p.RtPositionFrame(5),
    p.RtShootFrame2(3, 500, 0, 180, (p.BlurMotor(1, 100, 120),)),
]


def names(requests):
    return [type(request).__name__ for request in requests]


@pytest.fixture
def rig():
    """Yield a session: motors 1 and 2 carry the camera of a virtual rig and have an uploaded move;
    they are on its first frame."""
    session = simulated(motors=6)
    for motor in range(1, 7):
        session.speed(motor, VELOCITY, ACCELERATION)
    upload(session, {motor: 100 + 5 * np.arange(FRAMES) for motor in (1, 2)})
    session.accept(p.RtPositionFrame(1)).wait_idle()
    session.accept(p.VirtConfig.unpack(CAMERA.payload()))
    return session


def at_once(session, *requests):
    """Return the codes, or payloads, that answer requests of one packet."""
    data = b"".join(encode(r.TYPE, r.pack(), 100 + i) for i, r in enumerate(requests))
    frames = {frame.id: frame.payload for frame in session.bytes_for(data, 0.02)}
    return [frames[100 + i] for i in range(len(requests))]


def code_of(payload):
    return int.from_bytes(payload[:2], "little")


@pytest.mark.parametrize("start", STARTS, ids=names(STARTS))
@pytest.mark.parametrize("operation", OPERATIONS, ids=names(OPERATIONS))
def test_refused_from_the_acknowledgement_on(rig, start, operation):
    """Field notes 4.7 and 6.1: 0x12 while MOTOR_STATUS has a bit; the virtual motion begins with
    its answer."""
    begun, status, refused = at_once(rig, start, p.MotorStatus(), operation)
    assert code_of(begun) == m.OK
    assert status[0] == 0b1111
    assert code_of(refused) == m.ERR_MOVING


@pytest.mark.each_processor
@pytest.mark.parametrize("start", STARTS, ids=names(STARTS))
def test_go_while_the_motors_set_out(rig, start):
    """Field note 6.1: they are no longer where the run begins."""
    rig.ready(RUN)
    begun, refused = at_once(rig, start, p.RtGo())
    assert code_of(begun) == m.OK
    assert code_of(refused) == m.ERR_NOT_IN_POSITION


@pytest.mark.parametrize("start", STARTS, ids=names(STARTS))
@pytest.mark.parametrize(
    "stop", [p.MotorStopAll(), p.MotorStop(1), "close"], ids=["stop all", "stop", "close"]
)
@pytest.mark.parametrize("ms", [0, 10, 300, 700])
def test_stopped_while_a_run_waits(rig, start, stop, ms):
    """As without a run: along the line, in the time of the ramp, and then everything is free again.
    RT_END comes once."""
    rig.ready(RUN)
    before = rig.positions
    rig.forget().accept(start).run(ms / 1000)
    if stop == "close":
        rig.leave().run(1.0).come_back().run(0.1)
    else:
        rig.accept(stop).run(1.0)
    assert not rig.moving
    assert not rig.events(p.HardStop)
    assert len(rig.events(p.RtEnd)) == (stop != "close")
    times, signs = rig.steps(1)
    if len(times) > 2:
        assert_within(times, signs, VELOCITY, ACCELERATION)
    assert {n: rig.made(n) for n in before} == {
        n: place - before[n] for n, place in rig.positions.items()
    }
    rig.refuse(m.ERR_GENERAL, p.RtGo())
    rig.accept(p.VirtMove(m.VIRT_MOTOR_EW, 100_000))


def test_stop_of_a_motor_beside_the_line_while_a_run_waits(rig):
    """STOP of a motor of the waiting run ends that run; only a virtual motion's own motors can end
    it."""
    upload(rig, {motor: 100 + 5 * np.arange(FRAMES) for motor in (1, 6)})
    rig.ready(RUN)
    rig.accept(STARTS[1]).run(0.5)
    rig.accept(p.MotorStop(6)).run(0.5)
    assert 1 in rig.moving
    assert len(rig.events(p.RtEnd)) == 1
    rig.accept(STARTS[1], p.VirtStop(m.VIRT_MOTOR_EW)).run(1.0)
    assert not rig.moving


@pytest.mark.parametrize("flags", [0, m.MOTOR_ENABLED | m.MOTOR_COUPLE])
@pytest.mark.parametrize("motor", [1, 2, 3, 4])
def test_a_motor_of_a_line_keeps_its_driver(rig, motor, flags):
    """MOTOR_CONFIGURE, off or coupled, after the acknowledgement of a virtual motion."""
    begun, refused, same = at_once(
        rig, STARTS[0], p.MotorConfigure(motor, flags), p.MotorConfigure(motor, m.MOTOR_ENABLED)
    )
    assert [code_of(payload) for payload in (begun, refused, same)] == [m.OK, m.ERR_MOVING, m.OK]


@pytest.mark.each_processor
def test_a_motor_of_a_line_keeps_its_driver_while_others_take_up_their_play():
    session = simulated({"motors": [{"backlash": 400}]}, motors=4)
    for motor in range(1, 5):
        session.speed(motor, VELOCITY, ACCELERATION)
    session.accept(p.VirtConfig.unpack(CAMERA.payload()), p.VirtMove(m.VIRT_MOTOR_EW, -2_000_000))
    for _ in range(100):
        session.refuse(m.ERR_MOVING, p.MotorConfigure(2, 0), p.MotorConfigure(3, 0), RUN).run(0.005)


@pytest.mark.parametrize(
    "start", [p.VirtMove(m.VIRT_MOTOR_EW, 2_000_000), p.RtPositionFrame(20), p.RtJogAll(24000, 20)]
)
def test_another_motors_jog_is_let_go_of_in_time(rig, start):
    """Field note 4.2: a jog ends half a second after its last request, whatever other motors have
    begun meanwhile."""
    if isinstance(start, p.RtJogAll):
        rig.accept(start).run(0.3)
        start = p.RtJogAll(24000, 25)
    rig.forget().accept(p.MotorJog(6, 10000, 2**31 - 1)).run(0.1)
    rig.accept(start).run(0.3)
    assert 6 in rig.moving
    rig.run(1.0)
    assert 6 not in rig.moving
