"""A gantry with a motor and a home switch at each side: homing drives both, and each stops at its
own switch."""

import numpy as np
import pytest

from framestep.motors.positions import HOMED, HOMING, KNOWN, LOST, NOT_FOUND, NOT_SQUARE
from framestep_tools import payloads as p
from host_tests.end_to_end.motors.home_switches import (
    HIGH,
    HOME,
    LIMITS,
    LOW,
    LOW_2,
    Switch,
    home,
    on_rails,
    trust,
)

pytestmark = pytest.mark.needs("inside")

WITHIN = 150
COUPLED, REVERSED = 0x11, 0x21


def gantry(*switches, coupled=COUPLED, second=None, **more):
    """Return a session whose motors 1 and 2 are the sides of a gantry, and its rails."""
    first = {**HOME, "square_within": WITHIN, **more}
    settings = {
        "limits": LIMITS,
        "motors": [{"home": first}, {"home": {**HOME, "limit": 2, **(second or {})}}],
    }
    session, rails = on_rails(settings, *switches)
    if coupled:
        session.accept(p.MotorConfigure(1, coupled))
    return session, rails


def skew(rails):
    """Return how far the sides are apart at most, from the edges: both go the same way."""
    return max(abs(apart) for apart in rails.apart)


def watch(session, rails):
    rails.apart = [0]
    while session.moving:
        session.run(0.002)
        rails.apart.append(rails.steps.get(1, 0) - rails.steps.get(2, 0))


@pytest.mark.parametrize("coupled", [0, COUPLED])
@pytest.mark.parametrize("askew", [-140, -3, 0, 77, 140])
@pytest.mark.parametrize("square", [0, 25, -40])
def test_each_side_stops_at_its_own_switch(coupled, askew, square):
    session, rails = gantry(
        Switch(1, LOW, -1700), Switch(2, LOW_2, -1700 + askew), coupled=coupled, square=square
    )
    session.accept(p.Home(b"\1"))
    assert session.moving == [1, 2]
    watch(session, rails)
    assert trust(session, 1) == trust(session, 2) == (KNOWN, HOMED)
    assert rails.steps[1] == pytest.approx(-1700 + 200, abs=1)
    assert rails.steps[2] == pytest.approx(-1700 + askew + 200 + square, abs=1)
    assert skew(rails) < abs(askew) + 70 + abs(square)
    assert session.events(p.HardStop) == []
    # the couple, if there is one, holds from then on
    before = dict(rails.steps)
    session.accept(p.MotorMove(1, session.position(1) + 500)).wait_idle()
    assert rails.steps[1] == before[1] + 500
    assert rails.steps[2] == before[2] + (500 if coupled else 0)


def test_sides_that_turn_in_opposite_directions():
    session, rails = gantry(
        Switch(1, LOW, -700), Switch(2, HIGH, 740, True), coupled=REVERSED,
        second={"limit": 1, "toward": "high"},
    )  # fmt: skip
    home(session, 1)
    assert trust(session, 1) == trust(session, 2) == (KNOWN, HOMED)
    assert (rails.steps[1], rails.steps[2]) == pytest.approx((-500, 540), abs=1)
    session.accept(p.MotorMove(1, session.position(1) + 300)).wait_idle()
    assert (rails.steps[1], rails.steps[2]) == pytest.approx((-200, 240), abs=1)


@pytest.mark.parametrize("at", [(20, -90), (-90, 20), (30, 60)])
def test_it_begins_on_a_switch(at):
    session, rails = gantry(Switch(1, LOW, at[0]), Switch(2, LOW_2, at[1]))
    home(session, 1)
    assert trust(session, 1) == trust(session, 2) == (KNOWN, HOMED)
    assert (rails.steps[1], rails.steps[2]) == pytest.approx((at[0] + 200, at[1] + 200), abs=1)


@pytest.mark.parametrize("side", [1, 2])
@pytest.mark.parametrize("coupled", [0, COUPLED])
def test_a_switch_that_stays_away(side, coupled):
    """The other side goes `square_within` steps on at most, and the fault tells which it is."""
    ats = {1: (-9000, -1700), 2: (-1700, -9000)}[side]
    session, rails = gantry(Switch(1, LOW, ats[0]), Switch(2, LOW_2, ats[1]), coupled=coupled)
    session.accept(p.Home())
    watch(session, rails)
    assert trust(session, side) == (LOST, NOT_SQUARE)
    assert trust(session, 3 - side) == (LOST, HOMING)
    assert skew(rails) < WITHIN + 60
    rested = dict(rails.steps)
    session.run(1)
    assert rails.steps == rested
    session.accept(p.MotorMove(1, session.position(1) + 100)).wait_idle()
    assert rails.steps[1] == rested[1] + 100
    assert rails.steps[2] == rested[2] + (100 if coupled else 0)


def test_no_switch_at_all():
    session, rails = gantry(Switch(1, LOW, -9000), Switch(2, LOW_2, -9000), travel=2000)
    session.accept(p.Home())
    watch(session, rails)
    assert trust(session, 1) == trust(session, 2) == (LOST, NOT_FOUND)
    assert rails.steps == {1: -2000, 2: -2000}


@pytest.mark.parametrize("after", [0.3, 0.88, 1.2, 2.0])
@pytest.mark.parametrize("stop", [p.MotorStop(1), p.MotorStop(2), p.MotorStopAll()], ids=str)
def test_a_stop_stops_both_sides(after, stop):
    """Wherever they are; they are coupled again, and nothing goes on by itself."""
    session, rails = gantry(Switch(1, LOW, -1700), Switch(2, LOW_2, -1640))
    session.accept(p.Home(b"\1")).run(after)
    session.accept(stop).wait_idle()
    rested = dict(rails.steps)
    assert abs(rested[1] - rested[2]) < 130
    session.run(1)
    assert rails.steps == rested
    session.forget().accept(p.MotorMove(1, session.position(1) + 300)).wait_idle()
    assert (rails.steps[1], rails.steps[2]) == (rested[1] + 300, rested[2] + 300)
    home(session, 1)
    assert trust(session, 1) == trust(session, 2) == (KNOWN, HOMED)


def test_what_is_refused_meanwhile():
    """Both sides belong to homing; naming the second one homes both."""
    session, _ = gantry(Switch(1, LOW, -1700), Switch(2, LOW_2, -1600))
    session.accept(p.Home(b"\2"))
    for _ in range(20):
        assert session.moving == [1, 2]
        session.refuse(p.Ack.ERR_MOVING, p.MotorMove(2, 5), p.MotorMove(1, 5), p.Home(b"\1"))
        session.refuse(p.Ack.ERR_MOVING, p.MotorConfigure(1, 1), p.MotorConfigure(2, 0)).run(0.1)
    session.wait_idle()
    assert trust(session, 1) == trust(session, 2) == (KNOWN, HOMED)
    session.accept(p.MotorConfigure(2, 0))
    session.refuse(p.Ack.ERR_GENERAL, p.Home(b"\1"), p.Home())


def test_the_slower_side_sets_the_pace():
    session, rails = gantry(Switch(1, LOW, -1700), Switch(2, LOW_2, -1650), coupled=0)
    session.speed(2, 500, 3000).accept(p.Home(b"\1"))
    watch(session, rails)
    assert trust(session, 1) == trust(session, 2) == (KNOWN, HOMED)
    assert skew(rails) < 60
    for motor in (1, 2):
        assert np.diff(session.steps(motor)[0]).min() > 0.9 / 500


def test_a_soft_limit_of_one_side():
    """That side stops there, before it has found its switch; the other does not go on alone."""
    session, rails = gantry(Switch(1, LOW, -1700), Switch(2, LOW_2, -1700), coupled=0)
    session.accept(p.MotorResetPosition(1, 0), p.MotorSetLimits(1, 1, -600, 1, 3000), p.Home(b"\1"))
    watch(session, rails)
    assert trust(session, 1)[0] == trust(session, 2)[0] == LOST
    assert skew(rails) < WITHIN + 130  # and the way in which the first one slows down


def test_another_limit_switch_of_a_side():
    session, rails = gantry(Switch(1, LOW, -1700), Switch(2, LOW_2, -1700))
    session.accept(p.MotorSetLimits(2, 0, 0, 0, 0, 1), p.Home(b"\1")).run(0.4)
    session.input(LOW, 1).wait_idle()
    assert trust(session, 1)[0] == trust(session, 2)[0] == LOST
    assert abs(rails.steps[1] - rails.steps[2]) < 60
