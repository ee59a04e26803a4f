"""A lower acceleration that is set while a motor moves counts for whatever begins once it is at
rest, also where that begins by itself."""

import itertools

import numpy as np
import pytest

from framestep.motors.positions import HOMED, KNOWN
from framestep.protocol import messages as m
from framestep_tools import payloads as p
from host_tests.end_to_end.motors.home_switches import LOW, Switch, rails, trust
from host_tests.end_to_end.realtime import LOOP, MOVE, loaded, rig, upload
from host_tests.end_to_end.session import run_request
from host_tests.end_to_end.virtual_axes.judging import XYZ, configured

SLOW = 2000  # steps/s²
FAST = 50_000
FAR = 2**31 - 1


def starts(session, moment, motor):
    """Each time that the motor has set out from rest since a moment: when, and its acceleration in
    steps/s² by the first steps of the ramp."""
    times, signs = session.steps(motor)
    begins = np.flatnonzero((np.diff(times, prepend=-1) > 0.02) | (np.diff(signs, prepend=0) != 0))
    found = []
    for begin, end in itertools.pairwise([*begins, len(times)]):
        steps = min(20, (end - begin) // 3)
        if times[begin] > moment and steps > 5:
            taken = times[begin + steps - 1] - times[begin]
            found.append((times[begin], 2 * (steps**0.5 - 1) ** 2 / taken**2))
    return found


def assert_starts(session, moment, motor, acceleration=SLOW, count=1):
    """It has set out so often since a moment, with this acceleration."""
    found = starts(session, moment, motor)
    assert len(found) == count, found
    for when, rate in found:
        assert rate == pytest.approx(acceleration, rel=0.05), (when, rate)


def next_rest(session, motor):
    """Run until the motor makes no steps for 10 ms; when it has made its last one."""
    while True:
        session.run(0.01)
        times, _ = session.steps(motor)
        if len(times) and times[-1] < session.now - 0.01:
            return times[-1]


def test_a_virtual_jog_that_waits():
    """Asked for while the one before comes to rest."""
    session = configured(XYZ, 20_000, FAST)
    session.accept(p.VirtJog(m.VIRT_MOTOR_TRACK, 10_000, FAR)).run(0.3)
    session.accept(p.VirtJog(m.VIRT_MOTOR_TRACK, 10_000, -FAR))
    for axis in XYZ.axes:
        session.speed(axis.motor, 20_000, SLOW)
    turned = session.now
    motor = XYZ.axes[2].motor
    for _ in range(10):
        session.run(0.1).accept(p.VirtJog(m.VIRT_MOTOR_TRACK, 10_000, -FAR))
    ((_, rate),) = starts(session, turned, motor)
    assert 0.8 * SLOW < rate < SLOW


@pytest.mark.parametrize("after", [0.2, 1.0, 1.45, 1.7, 1.99])
def test_the_way_back_after_a_run(after):
    session = loaded()
    session.ready(run_request(24, 1, 25, 500, 500)).forget()
    session.accept(p.RtGo()).run(after)
    for motor in MOVE:
        session.speed(motor, 20_000, SLOW)
    session.until(p.RtEnd, 10)
    ended = session.now
    session.run(2)  # no request meanwhile
    for motor in MOVE:
        assert session.position(motor) == MOVE[motor][-1]
        assert_starts(session, ended, motor)


def test_the_way_back_in_a_loop():
    session = rig()
    far = {1: 3000 * np.arange(25) // 24, 2: np.zeros(25, int)}
    upload(session, far)
    session.ready(run_request(24, 1, 25, 2000, 2000, flags=LOOP)).forget()
    session.accept(p.RtGo()).run(3.5).speed(1, 20_000, SLOW)
    begun = next_rest(session, 1)
    session.run(4)
    assert_starts(session, begun, 1)


@pytest.mark.needs("inside")
@pytest.mark.parametrize("phase", ["seek", "back", "again"])
def test_homing(phase):
    session, _ = rails(Switch(1, LOW, -1700), slow_speed=1000, back_off=800)
    session.speed(1, 20_000, FAST).accept(p.Home(b""))
    for name in ("seek", "back", "again"):
        session.run(0.2)
        if name == phase:
            session.speed(1, 20_000, SLOW)
            begun = session.now
        next_rest(session, 1)
    session.run(3)
    assert trust(session) == (KNOWN, HOMED)
    assert_starts(session, begun, 1, count=3 - ("seek", "back", "again").index(phase))


def last_leg(set_first):
    """How long a JOG_ALL that turns takes for the way back, with SLOW set before it or as it
    slows down."""
    session = rig()
    path = 60 * np.arange(241)
    upload(session, {1: path}, frames=241)
    session.accept(p.RtPositionFrame(121)).wait_idle()
    if set_first:
        session.speed(1, 20_000, 200)
    session.accept(p.RtJogAll(48_000, 140)).run(1.5)
    session.accept(p.RtJogAll(48_000, 115))
    if not set_first:
        session.speed(1, 20_000, 200)
    session.run(30)
    assert session.position(1) == path[114]
    times, signs = session.steps(1)
    turned = np.flatnonzero(np.diff(signs))[-1] + 1
    return (times[-1] - times[turned]) / (len(times) - turned)


def test_jog_all_that_turns():
    """Its destination lies behind: it comes to rest on a frame and goes on the other way."""
    assert last_leg(False) == pytest.approx(last_leg(True), rel=0.1)
