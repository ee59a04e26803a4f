"""Far from 0, positions are no small integers of a 32-bit MicroPython. Near ±2^31, what would leave
the range is refused: on a board a sum beyond it wraps, and the motor goes the other way."""

import numpy as np
import pytest

from framestep.protocol import messages as m
from framestep_tools import payloads as p
from framestep_tools.judge.virtual_reference import Axis, Rig
from host_tests.end_to_end.session import run_request, simulated

pytestmark = pytest.mark.each_processor

TOP, BOTTOM = 2**31 - 1, -(2**31)
LOWEST = BOTTOM + 1  # of an upload
FAR = 2**30 + 4000
TEN_MINUTES = 600_000
LOOP, PING_PONG = 2, 1


@pytest.fixture
def swift(rig):
    """Return a session whose first motor is as fast as a motor can be on every target."""
    rig.speed(1, 125_000, 4_000_000).accept(p.MotorConfigure(1, 3))
    return rig


@pytest.mark.parametrize("end", [TOP, LOWEST], ids=["top", "bottom"])
def test_rolls_need_room(swift, end):
    steps = end - np.sign(end) * 100 * np.arange(24, -1, -1)
    swift.upload({1: steps})
    swift.refuse(
        p.Ack.ERR_POSTROLL,
        run_request(24, 1, 25, 200, 200),
        run_request(24, 1, 20, TEN_MINUTES, TEN_MINUTES),
        run_request(24, 1, 25, 200, 0, flags=LOOP),
        run_request(24, 1, 25, 200, 0, flags=PING_PONG),
    )
    swift.refuse(p.Ack.ERR_PREROLL, run_request(24, 25, 1, 200, 200))
    swift.accept(p.MotorResetPosition(1, int(steps[0])))
    swift.play(run_request(24, 1, 20, 20, 20))
    assert swift.position(1) == steps[19]


def test_a_window_needs_room(swift):
    swift.upload({1: 100 * np.arange(25)})

    def shot(from_, to, exposure=1000):
        return p.RtShootFrame(12, 1, exposure, exposure, [p.BlurMotor(1, from_, to)])

    swift.refuse(p.Ack.ERR_POSTROLL, shot(TOP - 1000, TOP))
    swift.refuse(p.Ack.ERR_PREROLL, shot(BOTTOM, BOTTOM + 1000))
    swift.refuse(p.Ack.ERR_RANGE, shot(BOTTOM, TOP), shot(BOTTOM, TOP, 1))


def test_neighbours_at_both_ends(swift):
    """The path to the frames before them can be played, and jogged along."""
    swift.upload({1: np.array([0, 100, 200, 300, 400, 500, LOWEST, TOP, LOWEST, TOP])})
    swift.refuse(
        p.Ack.ERR_RANGE,
        *(run_request(24, *ends, 200, 200) for ends in ((1, 8), (7, 8), (10, 7))),
        run_request(0.001, 1, 10, 200, 200),
        p.RtShootFrame(7, 1, 1000, 1000),
        p.RtShootFrame2(6, 1000, 0, 360),
    )
    swift.play(run_request(24, 1, 5, 200, 200))
    assert swift.position(1) == 400
    swift.accept(p.RtPositionFrame(6)).wait_idle()
    swift.refuse(p.Ack.ERR_RANGE, p.RtJogAll(1, 10))
    swift.accept(p.RtJogAll(6000, 1)).wait_idle()
    assert swift.position(1) == 0


def test_from_end_to_end(swift):
    swift.upload({1: np.array([LOWEST, LOWEST + 100, 0, TOP - 100, TOP])})
    swift.accept(p.MotorResetPosition(1, LOWEST))
    swift.refuse(p.Ack.ERR_RANGE, run_request(0.001, 1, 5, 200, 200), p.RtJogAll(1, 5))
    swift.play(run_request(24, 2, 1, 200, 200))
    swift.play(run_request(24, 1, 1, 200, 200))
    assert swift.position(1) == LOWEST


@pytest.mark.parametrize("backlash", [0, 150])
def test_far_from_0(backlash):
    """Runs, exposures, jogs along the path and virtual axes end where they should."""
    session = simulated({"motors": [{"backlash": backlash}]}, motors=4)
    for motor in range(1, 5):
        session.speed(motor, 20_000, 100_000).accept(p.MotorConfigure(motor, 1))
    session.accept(p.MotorResetPosition(1, FAR))
    session.upload({1: FAR + 50 * np.arange(25), 2: 20 * np.arange(25)})
    session.play(run_request(24, 1, 12, 200, 200))
    assert session.position(1) == FAR + 550

    pair = [p.BlurMotor(1, FAR, FAR + 400)]
    for shot in (
        p.RtShootFrame(12, 1, 200, 1000, pair),
        p.RtShootFrame(12, 1, 200, 500, pair),
        p.RtShootFrame2(12, 500, -30, 400, pair),
    ):
        session.play(shot)

    session.accept(p.RtPositionFrame(2)).wait_idle()
    session.accept(p.RtJogAll(12_000, 25)).run(0.4)
    session.accept(p.MotorStopAll()).wait_idle()
    assert (session.position(1) - FAR) % 50 == 0, "it rests on a frame"

    camera = Rig(4, tuple(Axis(motor, 100.0) for motor in (1, 2, 0, 3, 4, 0)))
    session.accept(p.VirtConfig.unpack(camera.payload()))
    before = session.position(1)
    session.accept(p.VirtJog(m.VIRT_MOTOR_EW, 5000, TOP)).run(0.3)
    session.accept(p.VirtStop(m.VIRT_MOTOR_EW)).wait_idle()
    assert session.position(1) > before + 1000
    session.accept(p.VirtMove(m.VIRT_MOTOR_EW, 500_000)).wait_idle()
    assert session.position(1) == before + 500, "5 units of 100 steps from where it was configured"


def test_landing_far_from_0(swift):
    """Stopped just before a frame, a slow jog goes on to the next one, at a frame per second."""
    swift.accept(p.MotorResetPosition(1, FAR))
    swift.upload({1: FAR + 50 * np.arange(25)})
    swift.accept(p.RtJogAll(800, 25))
    while swift.position(1) < FAR + 47:
        swift.run(0.01)
    swift.accept(p.MotorStopAll()).wait_idle()
    assert swift.position(1) == FAR + 100


def test_outside_limits_far_from_0(swift):
    """A jog further out leaves the motor where it is."""
    swift.accept(p.MotorResetPosition(1, FAR), p.MotorSetLimits(1, 1, FAR - 900, 1, FAR - 500))
    swift.accept(p.MotorJog(1, 10_000, FAR + 100)).wait_idle()
    assert swift.position(1) == FAR
    swift.accept(p.MotorMove(1, FAR - 600)).wait_idle()
    assert swift.position(1) == FAR - 600
